//! Turns the blocks of a log into flights: recordings that every command can read, with the unit's estimates beside
//! them.

use std::path::{Path, PathBuf};

use bodyflight_core::frame::{Inertial, Vector};
use bodyflight_core::link::{
    BlockReader, Configure, Estimate, Header, Message, Sample, SegmentTable, Setup, Status,
    Validity,
};
use bodyflight_core::{Body, Posture};
use serde::Serialize;

use super::tables::{self, since};
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::files::write_file;
use bodyflight_mvnx::recording::{FlightFrame, PelvisMotion};
use bodyflight_mvnx::writer::{Description, Origin, Writer};
use bodyflight_replay::subject::Subject;

/// What to do if a flight has no attitude.
pub(super) const LEVELLED: &str = "a sensor that sends no attitude is levelled once it was still for a second: hold the unit still \
     for some seconds after power-on";

/// A flight found in the log.
#[derive(Debug, Default)]
pub struct LoggedFlight {
    session: u16,
    configure: Option<Configure>,
    table: SegmentTable,
    /// Sensor time (us).
    samples: Vec<(u64, Sample)>,
    estimates: Vec<(u64, Estimate)>,
    reports: Vec<(u64, Status)>,
}

/// What was written for a flight.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Written {
    /// The `flight.toml`.
    pub flight: PathBuf,
    /// Frames of the recording.
    pub frames: u64,
    /// Frames with the posture that the unit assumed, since it had none.
    pub assumed_postures: u64,
    /// Number of estimates beside it.
    pub estimates: usize,
    /// Duration (s).
    pub duration_s: f64,
    /// Lowest voltage of the unit's battery during the flight, if the unit measures it (V).
    pub battery_v: Option<f64>,
}

impl Written {
    /// Says that the unit had no posture in the flight or in part of it, and what to do; `None` if it always had one.
    pub fn without_posture(&self) -> Option<String> {
        let (assumed, frames) = (self.assumed_postures, self.frames);
        let what = match assumed {
            0 => return None,
            _ if assumed == frames => "no posture was logged, so all frames show".to_owned(),
            _ => format!("{assumed} of {frames} frames have no logged posture and show"),
        };
        Some(format!(
            "{}: {what} the one that the unit assumed. A posture comes from a host or from sensors on the limbs: calibrate these with \
             `bodyflight unit calibrate`, and after each power-on stand upright and still until the light flashes twice",
            self.flight.display()
        ))
    }
}

/// The flights in the blocks of a log, and the number of blocks that end in damage. The beginning of the oldest flight,
/// and with it its configuration, may have been overwritten by newer ones.
pub fn flights(blocks: &[Vec<u8>]) -> (Vec<LoggedFlight>, usize) {
    let mut flights: Vec<LoggedFlight> = Vec::new();
    let mut damaged = 0;
    for read in blocks.iter().flat_map(|block| BlockReader::new(block)) {
        let Ok((header, message)) = read else {
            damaged += 1;
            continue;
        };
        if flights
            .last()
            .is_none_or(|flight| flight.ends_before(&header, &message))
        {
            flights.push(LoggedFlight {
                session: header.session,
                ..LoggedFlight::default()
            });
        }
        let Some(flight) = flights.last_mut() else {
            continue;
        };
        flight.push(&header, message);
    }
    flights.retain(|flight| !flight.samples.is_empty());
    (flights, damaged)
}

impl LoggedFlight {
    /// A flight without samples yet, of a unit with this configuration.
    pub fn new(setup: &Setup) -> Self {
        Self {
            configure: Some(setup.configure),
            table: setup.table,
            ..Self::default()
        }
    }

    /// Adds a message of the log.
    pub fn push(&mut self, header: &Header, message: Message) {
        match message {
            Message::Configure(configure) => self.configure = Some(configure),
            Message::SegmentValues(row) => self.table.insert(row),
            Message::Sample(sample) => self.samples.push((header.time, sample)),
            Message::Estimate(estimate) => self.estimates.push((header.time, estimate)),
            Message::Status(report) => self.reports.push((header.time, report)),
            _ => {}
        }
    }

    /// Whether this message belongs to the next flight. Its configuration, with which it begins, may be damaged.
    fn ends_before(&self, header: &Header, message: &Message) -> bool {
        match message {
            Message::Configure(_) => true,
            Message::SegmentValues(_) | Message::HelloAcknowledge(_) | Message::Start(_) => {
                !self.samples.is_empty()
            }
            _ => header.session != self.session,
        }
    }

    /// Number of samples and estimates.
    pub fn lengths(&self) -> [usize; 2] {
        [self.samples.len(), self.estimates.len()]
    }

    /// Its estimates, each with the time of its sample since the first sample (s).
    pub fn estimates(&self) -> impl DoubleEndedIterator<Item = (f64, &Estimate)> {
        let first = self.samples.first().map_or(0, |(time, _)| *time);
        let estimates = self.estimates.iter();
        estimates.map(move |(time, estimate)| (since(first, *time), estimate))
    }

    /// The postures of its samples, each with the time since the first sample (s).
    pub fn postures(&self) -> impl Iterator<Item = (f64, Posture<f64>)> {
        let first = self.samples.first().map_or(0, |(time, _)| *time);
        let samples = self.samples.iter();
        samples.map(move |(time, sample)| (since(first, *time), sample.posture().cast()))
    }

    /// Whether any sample has an attitude; without one there is nothing to record.
    pub fn has_attitude(&self) -> bool {
        let mut samples = self.samples.iter();
        samples.any(|(_, sample)| sample.valid.contains(Validity::ATTITUDE))
    }

    /// Time from the first sample to the last (s).
    pub fn duration(&self) -> f64 {
        let ends = self.samples.first().zip(self.samples.last());
        ends.map_or(0.0, |(first, last)| since(first.0, last.0))
    }

    /// Sample rate (Hz): as configured, or else from the shortest interval.
    fn rate(&self) -> f64 {
        if let Some(configure) = &self.configure {
            return f64::from(configure.sample_rate);
        }
        let pairs = self.samples.windows(2);
        let intervals = pairs.filter_map(|pair| pair[1].0.checked_sub(pair[0].0));
        let shortest = intervals.filter(|&interval| interval > 0).min();
        #[expect(clippy::cast_precision_loss, reason = "intervals are short")]
        let rate = shortest.map_or(240.0, |interval| (1e6 / interval as f64).round());
        rate
    }

    /// The body that the unit used in its computations.
    fn body(&self) -> Option<Body<f64>> {
        let configure = self.configure.as_ref()?;
        let body = self.table.body(configure.height, configure.table_digest);
        body.ok().map(|body| body.cast())
    }

    /// Samples with an attitude, as frames, and in how many of them the posture is assumed.
    fn frames(&self) -> (Vec<FlightFrame>, u64) {
        let rate = self.rate();
        let first = self.samples.first().map_or(0, |(time, _)| *time);
        let mut frames: Vec<FlightFrame> = Vec::new();
        let mut assumed = 0;
        for (time, sample) in &self.samples {
            let index = index(time.saturating_sub(first), rate);
            let is_next = frames.last().is_none_or(|last| last.index < index);
            if is_next && sample.valid.contains(Validity::ATTITUDE) {
                frames.push(frame(index, rate, sample));
                assumed += u64::from(!sample.valid.contains(Validity::POSTURE));
            }
        }
        fill_velocities(&mut frames);
        integrate_positions(&mut frames);
        (frames, assumed)
    }
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_precision_loss,
    reason = "saturates; a flight has far fewer frames than 2^53"
)]
fn index(elapsed_us: u64, rate: f64) -> u64 {
    (elapsed_us as f64 * 1e-6 * rate).round() as u64
}

/// A frame without a position.
fn frame(index: u64, rate: f64, sample: &Sample) -> FlightFrame {
    #[expect(clippy::cast_precision_loss, reason = "indices count frames")]
    let time = index as f64 / rate;
    let motion = sample.motion();
    let inertial_from_body = sample.inertial_from_body().cast();
    FlightFrame {
        index,
        time,
        posture: sample.posture().cast(),
        pelvis: PelvisMotion {
            inertial_from_body,
            position: Vector::zero(),
            velocity: motion.velocity.map(|velocity| velocity.cast()),
            angular_velocity: motion
                .angular_velocity
                .map(|turn| inertial_from_body * turn.cast()),
        },
        centre_of_mass: None,
        bridged: false,
    }
}

/// Gives frames between two solutions of a receiver, which come a few times a second, the velocity between theirs, and
/// those before the first and after the last that one's.
fn fill_velocities(frames: &mut [FlightFrame]) {
    let known: Vec<(f64, Vector<f64, Inertial>)> = frames
        .iter()
        .filter_map(|frame| Some((frame.time, frame.pelvis.velocity?)))
        .collect();
    for frame in frames {
        let after = known.partition_point(|(time, _)| *time <= frame.time);
        let next = known.get(after);
        let before = after.checked_sub(1).and_then(|place| known.get(place));
        frame.pelvis.velocity = match (before, next) {
            (Some((from, one)), Some((to, other))) => {
                Some(*one + (*other - *one) * ((frame.time - from) / (to - from)))
            }
            (one, other) => one.or(other).map(|(_, velocity)| *velocity),
        };
    }
}

/// A log contains no position: it is integrated from the velocity.
fn integrate_positions(frames: &mut [FlightFrame]) {
    let velocity = |of: &FlightFrame| of.pelvis.velocity.unwrap_or_else(Vector::zero);
    let mut last: Option<FlightFrame> = None;
    for frame in frames {
        if let Some(last) = last {
            let mean = (velocity(&last) + velocity(frame)) * 0.5;
            frame.pelvis.position = last.pelvis.position + mean * (frame.time - last.time);
        }
        last = Some(*frame);
    }
}

/// Files written by [`write()`].
pub const FILES: [&str; 5] = [
    "flight.toml",
    "flight.mvnx",
    "estimates.csv",
    "unit.csv",
    "subject.toml",
];

/// Writes a flight into `folder` as `flight.toml`, `flight.mvnx`, `estimates.csv` and `unit.csv` (the unit's reports on
/// itself), plus `subject.toml` if the subject is known.
///
/// # Errors
/// Returns an error if the folder cannot be written to, or if no sample has an attitude.
pub fn write(flight: &LoggedFlight, subject: Option<&Subject>, folder: &Path) -> Result<Written> {
    let (frames, assumed_postures) = flight.frames();
    let Some(last) = frames.last() else {
        return Err(Problem::bad_input(
            "expected samples with an attitude, found none in this flight",
        )
        .help(LEVELLED));
    };
    std::fs::create_dir_all(folder).map_err(|error| Problem::system("create", folder, error))?;
    let description = Description {
        subject_label: "Unit".to_owned(),
        frame_rate: flight.rate(),
        start_unix_ms: 0,
        comment: "bodyflight unit log".to_owned(),
        origin: Origin::Logged,
    };
    let body = match subject {
        Some(subject) => subject.body(),
        None => flight.body().unwrap_or_else(|| Subject::default().body()),
    };
    let mut writer = Writer::create(&folder.join("flight.mvnx"), description, &body)?;
    for frame in &frames {
        writer.write(frame)?;
    }
    writer.finish()?;
    let first = flight.samples.first().map_or(0, |(time, _)| *time);
    tables::write_estimates(first, &flight.estimates, &folder.join("estimates.csv"))?;
    tables::write_reports(first, &flight.reports, &folder.join("unit.csv"))?;
    let mut text = "recording = \"flight.mvnx\"\n".to_owned();
    if let Some(subject) = subject {
        write_file(&folder.join("subject.toml"), subject.to_toml()?.as_bytes())?;
        text += "subject = \"subject.toml\"\n";
    }
    if let Some(configure) = &flight.configure {
        text += &format!("\n[air]\ndensity = {:?}\n", configure.air_density);
    }
    let path = folder.join("flight.toml");
    write_file(&path, text.as_bytes())?;
    Ok(Written {
        flight: path,
        frames: frames.len() as u64,
        assumed_postures,
        estimates: flight.estimates.len(),
        duration_s: last.time,
        battery_v: flight
            .reports
            .iter()
            .filter_map(|(_, report)| tables::battery_v(report))
            .reduce(f64::min),
    })
}

#[cfg(test)]
mod tests {
    use bodyflight_core::Posture;
    use bodyflight_core::frame::Rotation;
    use bodyflight_core::link::{BlockWriter, Motion, Start, StreamMode};
    use nalgebra::UnitQuaternion;

    use super::*;

    /// A block with one message in each session given.
    fn block(message: &Message, sessions: &[u16]) -> Vec<u8> {
        let mut block = BlockWriter::new();
        for session in sessions {
            let header = Header {
                session: *session,
                ..Header::default()
            };
            assert!(block.push(&header, message));
        }
        block.bytes().to_vec()
    }

    #[test]
    fn a_flight_without_a_logged_posture_says_so() {
        let attitude = Rotation::from_quaternion(UnitQuaternion::identity());
        let known = Sample::new(&Posture::h_pose(), &attitude, &Motion::default());
        let mut assumed = known;
        assumed.valid.remove(Validity::POSTURE);
        let said = |samples: &[Sample]| {
            let mut flight = LoggedFlight::default();
            for (time, sample) in (0..).step_by(4000).zip(samples) {
                let header = Header {
                    time,
                    ..Header::default()
                };
                flight.push(&header, (*sample).into());
            }
            let folder = tempfile::tempdir().unwrap();
            let written = write(&flight, None, folder.path()).unwrap();
            written.without_posture()
        };
        assert_eq!(said(&[known; 4]), None);
        let none = said(&[assumed; 4]).unwrap();
        let parts = ["no posture was logged", "unit calibrate", "flight.toml"];
        assert!(parts.iter().all(|part| none.contains(part)), "{none}");
        let some = said(&[assumed, assumed, known, known]).unwrap();
        assert!(some.contains("2 of 4 frames"), "{some}");
    }

    #[test]
    fn flights_are_told_apart_where_a_configuration_is_damaged() {
        let attitude = Rotation::from_quaternion(UnitQuaternion::identity());
        let sample = Sample::new(&Posture::h_pose(), &attitude, &Motion::default()).into();
        let mode = StreamMode::Sensor;
        let start = Start { mode }.into();
        // What a unit sends of a block that it cannot read.
        let unreadable = vec![0xff];
        let log = [
            block(&start, &[1]),
            block(&sample, &[1, 1]),
            unreadable.clone(),
            block(&start, &[1]),
            block(&sample, &[1, 1, 1]),
            unreadable,
            block(&sample, &[2]),
        ];
        let (found, damaged) = flights(&log);
        let samples: Vec<_> = found.iter().map(|flight| flight.lengths()[0]).collect();
        assert_eq!((samples, damaged), (vec![2, 3, 1], 2));
    }
}
