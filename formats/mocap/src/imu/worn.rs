//! The suit of the core over a whole recording.

use std::path::Path;

use bodyflight_core::suit::clock::Clocks;
use bodyflight_core::suit::set::{SetError, Suit, SuitPosture, pairs_of};
use bodyflight_core::{Body, Posture, Segment, SegmentArray};
use bodyflight_io::diagnostic::{Problem, Result};
use nalgebra::Vector3;

use super::arc::Arcs;
use super::arrival;
use super::calibration::{Calibrated, calibrated};
use super::checks::{FirstPose, Joints};
use super::clocks::{self, Late};
use super::doubts::{Doubts, restarted};
use super::exchange::Calibration;
use super::mapping::ImuMapping;
use super::mvnx;
use super::stream::{self, Stream};
use super::windows::completed;

/// Range of rates of postures (Hz).
const RATES: [f64; 2] = [50.0, 240.0];
/// Jitter, as a share of the interval, and share of lost samples from which they are said.
const JITTER: f64 = 0.1;
const LOST: f64 = 0.005;
/// Longest flight (frames).
const FRAME_LIMIT: f64 = 1e7;

/// A posture at a time since the begin of the flight (s).
pub type Frame = (f64, SuitPosture<f64>);

/// A flight from raw sensors.
pub struct Worn {
    /// Frames per second (Hz).
    pub rate_hz: f64,
    /// The frames.
    pub frames: Vec<Frame>,
    /// Standard deviation of each segment's orientation relative to the pelvis about an axis (rad), root of its mean
    /// square over the flight.
    pub deviation: SegmentArray<f64>,
    /// Place of the sensor on the pelvis, in its frame (m).
    pub pelvis_place: Vector3<f64>,
    /// Remarks.
    pub notes: Vec<String>,
    /// Faults of sensors.
    pub doubts: Vec<String>,
    /// The segments whose sensors they concern.
    pub doubted: Vec<Segment>,
}

/// Reads all sensors of a mapping from a folder or a file.
///
/// # Errors
/// Returns an error if a file cannot be read, or does not follow the mapping.
pub fn sensors(mapping: &ImuMapping, path: &Path) -> Result<Vec<(Segment, Stream)>> {
    if mapping.is_mvnx() {
        let rows = mapping.rows()?;
        let streams = mvnx::streams(path, &rows)?.into_iter().zip(rows);
        let earlier =
            streams.map(|((segment, stream), (_, row))| (segment, stream.earlier(row.late_s)));
        return Ok(earlier.collect());
    }
    let columns = mapping.columns()?;
    let mut found = Vec::new();
    for (segment, row) in mapping.rows()? {
        let file = match &row.file {
            Some(file) if path.is_dir() => path.join(file),
            Some(file) => path.with_file_name(file),
            None if path.is_dir() => {
                return Err(Problem::bad_input("expected the file of this sensor")
                    .at(format!("table sensors.{}", segment.name()))
                    .help("file = \"...\", or give one file of all sensors instead of a folder"));
            }
            None => path.to_owned(),
        };
        let read = match columns.arrived {
            true => arrival::read(&file, &columns, row),
            false => stream::read(&file, &columns, row, mapping.rate_hz),
        };
        let stream = read.map_err(|problem| problem.at(format!("sensor {}", segment.name())))?;
        found.push((segment, stream.earlier(row.late_s)));
    }
    Ok(found)
}

/// Calibrates the sensors and follows them through the flight. `progress` is called with the share done.
///
/// # Errors
/// Returns an error if the calibration cannot be used, or the flight is not within the samples.
pub fn worn(
    mapping: &ImuMapping,
    sensors: &[(Segment, Stream)],
    body: &Body<f64>,
    progress: &mut dyn FnMut(f64) -> Result<()>,
) -> Result<Worn> {
    let sensors: Vec<(Segment, &Stream)> = sensors.iter().map(|(s, stream)| (*s, stream)).collect();
    let sensors = sensors.as_slice();
    let windows = completed(&mapping.calibration, sensors, mapping.flight.begin_s)?;
    let ground = Calibration {
        mapping,
        windows: &windows,
        body,
    };
    let calibrated = ready(&ground, sensors)?;
    let mut notes = calibrated.notes.clone();
    notes.extend(remarks(sensors));
    let mut doubts = Doubts::default();
    doubts.fused(&mapping.rows()?);
    doubts.exchanged(ground.exchange(sensors, &calibrated.fitted));
    let in_tray = clocks::in_tray(&mapping.calibration.turns_s, sensors, &calibrated.fitted);
    let window = flight(mapping, sensors, &calibrated)?;
    doubts.restarted(mapping, sensors, windows.upright[0], window);
    let rate_hz = common_rate(sensors);
    let count = frame_count(window, rate_hz)?;
    let mut suit = Box::new(
        Suit::<f64, 16, { pairs_of(16) }>::new(&calibrated.fitted, body, &Posture::h_pose())
            .map_err(set_problem)?,
    );
    let mut clocks = Clocks::default();
    let mut first_pose = FirstPose::new(calibrated.pelvis_up);
    let (mut joints, mut arcs) = (Joints::new(), Arcs::new());
    let mut readings = vec![None; sensors.len()];
    let mut frames = Vec::new();
    let mut squares = SegmentArray::from_fn(|_| 0.0);
    // Before the flight, frames count backwards from its begin, so that one falls on it.
    let mut frame = -((window[0] - calibrated.begin_s) * rate_hz).floor();
    while frame <= count {
        let time = window[0] + frame / rate_hz;
        for ((_, stream), reading) in sensors.iter().zip(&mut readings) {
            *reading = stream.at(time);
        }
        suit.set_on_ground(frame < 0.0);
        suit.push(&readings, 1.0 / rate_hz);
        arcs.take(frame / rate_hz, 1.0 / rate_hz, &suit);
        if frame < 0.0 {
            clocks.take(&suit, 1.0 / rate_hz);
            if time > calibrated.end_s {
                first_pose.take(time, sensors, || suit.posture());
            }
        } else {
            let posture = suit.posture();
            joints.take(frame / rate_hz, 1.0 / rate_hz, &posture);
            add(&mut squares, &posture);
            frames.push((frame / rate_hz, posture));
            if frames.len() % 1000 == 0 {
                progress(frame / count)?;
            }
        }
        frame += 1.0;
    }
    doubts.late(&in_tray.unwrap_or_else(|| late_as_worn(&suit, &clocks)));
    doubts.moved(&first_pose.moved);
    doubts.read(mapping, sensors, window);
    doubts.failed(suit.faults());
    doubts.turned(arcs.turned());
    doubts.bent(&joints.bent);
    notes.extend(doubts.ended(early(mapping, sensors), mapping.flight.end_s.is_some()));
    let flown = frames.len().max(1) as f64;
    let stated = squares.map(|_, square| (square / flown).sqrt());
    Ok(Worn {
        rate_hz,
        deviation: doubts.widened(&stated),
        pelvis_place: calibrated.pelvis_place(),
        doubted: doubts.of(),
        doubts: doubts.said,
        frames,
        notes,
    })
}

/// Adds the variances of a posture.
fn add(squares: &mut SegmentArray<f64>, posture: &SuitPosture<f64>) {
    for (segment, orientation) in posture.orientations.iter() {
        squares[segment] += orientation.deviation().powi(2);
    }
}

/// Frames after the first within a window (s).
fn frame_count([from, to]: [f64; 2], rate_hz: f64) -> Result<f64> {
    let count = ((to - from) * rate_hz).floor();
    if count > FRAME_LIMIT {
        let message = format!("expected at most {FRAME_LIMIT} frames, found {count}");
        return Err(Problem::bad_input(message));
    }
    Ok(count)
}

/// The sensors whose clocks are late by what they feel on the body.
fn late_as_worn(suit: &Suit<f64, 16, { pairs_of(16) }>, clocks: &Clocks<f64, 16>) -> Vec<Late> {
    let delays = suit.segments().zip(clocks.delays(suit));
    let known = delays.filter_map(|(segment, delay)| delay.map(|[by, off]| (segment, by, off)));
    clocks::worn(&known.collect::<Vec<_>>())
}

/// Calibrates the sensors. A refusal says what may be the reason: a sensor that began again after the begin of the first pose,
/// since its heading is another one, or sensors that are exchanged.
fn ready(ground: &Calibration<'_>, sensors: &[(Segment, &Stream)]) -> Result<Calibrated> {
    let Calibration {
        mapping,
        windows,
        body,
    } = *ground;
    let again = || {
        sensors.iter().find_map(|(segment, stream)| {
            let is_after = |[_, first]: &&[f64; 2]| *first > windows.upright[0];
            let after = stream.restarts.iter().find(is_after)?;
            Some(restarted(mapping, *segment, *after, f64::INFINITY))
        })
    };
    calibrated(mapping, windows, sensors, body).map_err(|problem| match again() {
        Some(said) => problem.help(said),
        None => with_remedy(problem, ground.remedy(sensors)),
    })
}

/// Adds to a refusal which exchange would explain it.
fn with_remedy(problem: Problem, remedy: Option<[Segment; 2]>) -> Problem {
    match remedy {
        None => problem,
        Some([one, other]) => problem.help(format!(
            "with the files of {} and {} exchanged, all sensors agree with the poses",
            one.name(),
            other.name()
        )),
    }
}

/// The flight within the samples that all sensors have.
fn flight(
    mapping: &ImuMapping,
    sensors: &[(Segment, &Stream)],
    calibrated: &Calibrated,
) -> Result<[f64; 2]> {
    let last = sensors.iter().map(|(_, stream)| stream.span()[1]);
    let pelvis = sensors.iter().find(|(s, _)| *s == Segment::Pelvis);
    let end = pelvis.map_or_else(|| last.fold(0.0, f64::max), |(_, stream)| stream.span()[1]);
    let begin = mapping.flight.begin_s.unwrap_or(calibrated.end_s);
    let until = mapping.flight.end_s.unwrap_or(end).min(end);
    if begin < calibrated.begin_s || until - begin < 1.0 {
        let message = format!(
            "expected a flight of a second or more between the upright pose, which ends at {:.1} s, and the last sample at {end:.1} s, found {begin:.1} to {until:.1} s",
            calibrated.begin_s
        );
        return Err(Problem::bad_input(message).at("table flight"));
    }
    Ok([begin, until])
}

/// How long before most of the others the sensor on the pelvis ends (s), if it ends the flight.
fn early(mapping: &ImuMapping, sensors: &[(Segment, &Stream)]) -> f64 {
    let end_of = |(_, stream): &(Segment, &Stream)| stream.span()[1];
    let pelvis = sensors.iter().find(|(s, _)| *s == Segment::Pelvis);
    let mut ends: Vec<f64> = sensors.iter().map(end_of).collect();
    ends.sort_by(f64::total_cmp);
    let usual = ends.get(ends.len() / 2).copied().unwrap_or(0.0);
    let until = mapping.flight.end_s.unwrap_or(usual).min(usual);
    pelvis.map_or(0.0, |pelvis| until - end_of(pelvis))
}

/// The usual rate of the sensors, within the range for postures.
fn common_rate(sensors: &[(Segment, &Stream)]) -> f64 {
    let mut rates: Vec<f64> = sensors.iter().map(|(_, stream)| stream.rate_hz).collect();
    rates.sort_by(f64::total_cmp);
    let usual = rates.get(rates.len() / 2).copied().unwrap_or(RATES[0]);
    let [least, most] = RATES;
    usual.round().clamp(least, most)
}

/// What the clocks of the sensors did.
fn remarks(sensors: &[(Segment, &Stream)]) -> Vec<String> {
    let mut notes = Vec::new();
    for (segment, stream) in sensors {
        let name = segment.name();
        if stream.jitter_s * stream.rate_hz > JITTER {
            notes.push(format!(
                "{name}: samples come irregularly, {:.1} ms standard deviation at {:.0} Hz",
                1e3 * stream.jitter_s,
                stream.rate_hz
            ));
        }
        if stream.lost > LOST || !stream.gaps.is_empty() {
            let longest = stream.gaps.iter().map(|gap| gap[1]).fold(0.0, f64::max);
            notes.push(format!(
                "{name}: {:.1} % of the samples are missing, {} gaps, the longest of {longest:.2} s",
                100.0 * stream.lost,
                stream.gaps.len()
            ));
        }
    }
    notes
}

fn set_problem(error: SetError) -> Problem {
    Problem::bad_input(match error {
        SetError::NoPelvis => "expected a sensor on the pelvis".to_owned(),
        SetError::Twice(segment) => format!("two sensors are on {}", segment.name()),
        SetError::TooMany => "more sensors than segments".to_owned(),
    })
}
