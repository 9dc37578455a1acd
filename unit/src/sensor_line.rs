//! The unit's application on this machine with nothing but the bytes of its sensor, as when it flies alone.

use std::cell::{Cell, RefCell};
use std::io::Write as _;
use std::path::Path;
use std::time::Duration;

use bodyflight_core::Segment;
use bodyflight_core::chain::Decoder;
use bodyflight_core::link::{
    Calibration, ChainReport, Estimate, EstimateFlags, Header, MAX_FRAME_LENGTH, Message,
    SegmentErrors, SensorKind, Setup, Status,
};
use bodyflight_firmware::{Board, Identity, Unit};
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::interrupt;
use serde::Serialize;

use crate::calibration::refused;
use crate::log::{LoggedFlight, Written};
use crate::monitor::{Chunk, Input, Xbus};
use crate::stream::qemu::Qemu;
use crate::virtual_unit::SensorLine;

/// Longest wait for bytes between checks for Ctrl-C.
const PATIENCE: Duration = Duration::from_millis(100);
/// Time lost (s) and share of doubtful estimates beyond which the result is not to be trusted, as in `estimate`.
const LONGEST_LOST: f64 = 1.0;
const LARGEST_DOUBT: f64 = 0.25;
/// Time in which the filter sees that it begins on the ground (s).
const LONGEST_ARRIVAL: f64 = 5.0;
/// Bytes that a BNO08x in its UART-RVC mode sends in a second: a hundred packets of 19.
const RVC_PACE: f64 = 1900.0;
/// Share by which the rate of the samples may differ from the configured one.
const RATE_TOLERANCE: f64 = 0.05;

/// What the unit estimated from a sensor's bytes.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct SensorReport {
    /// Bytes received.
    pub bytes: u64,
    /// Time from the first sample to the last, by the sensor's clock (s).
    pub flight_s: f64,
    /// Samples of the sensor: given to the filter, refused by it, and missing by the sensor's counter.
    pub used: u32,
    /// See `used`.
    pub rejected: u32,
    /// See `used`.
    pub missing: u32,
    /// Restarts of the sensor.
    pub sensor_restarts: u32,
    /// Solutions of a receiver.
    pub receiver_solutions: u32,
    /// Sensors on the limbs, if that is what was configured.
    pub limbs: Option<Limbs>,
    /// Estimates, and estimates that were not finite and were withheld.
    pub estimates: u64,
    /// See `estimates`.
    pub estimates_bad: u32,
    /// Share of the estimates during which something other than the air carried the body.
    pub supported: f64,
    /// Shares of the other estimates that agree with the measurements, are doubtful, and are lost.
    pub consistent: f64,
    /// See `consistent`.
    pub doubtful: f64,
    /// See `consistent`.
    pub lost: f64,
    /// The last estimate.
    pub last: Option<LastEstimate>,
    /// The files, if they were asked for.
    pub written: Option<Written>,
    /// Why the result is not to be trusted.
    pub doubt: Option<String>,
}

/// Sensors on the limbs.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Limbs {
    /// Segments with a calibrated sensor.
    pub calibrated: Vec<&'static str>,
    /// Sensors that are missing, have failed or have slipped at the end.
    pub failed: Vec<&'static str>,
    /// Cycles without a packet of each calibrated sensor, since it was heard first.
    pub missing: Vec<u32>,
    /// Bytes outside of packets: noise, damaged packets, or the messages of a receiver.
    pub skipped_bytes: u32,
    /// Standard deviation of the orientation of each segment relative to the pelvis at the end (deg), in table order.
    pub deviations_deg: Vec<f32>,
}

impl Limbs {
    fn of(unit: &Unit<Desk>, chain: &ChainReport) -> Self {
        let rows = || unit.limbs().table().rows();
        let errors = unit.board().errors.get();
        let has_failed =
            |segment: Segment| errors.is_some_and(|errors| errors.failed & 1 << segment as u8 != 0);
        let failed = Segment::ALL.into_iter().filter(|s| has_failed(*s));
        let deviations = errors.map(|errors| errors.deviations());
        Self {
            calibrated: rows().map(|row| row.segment.name()).collect(),
            failed: failed.map(Segment::name).collect(),
            missing: (rows())
                .filter_map(|row| chain.missing.get(row.segment as usize).copied())
                .collect(),
            skipped_bytes: chain.skipped,
            deviations_deg: deviations.map_or_else(Vec::new, |deviations| {
                deviations.iter().map(|(_, d)| d.to_degrees()).collect()
            }),
        }
    }
}

/// The last estimate of a flight.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct LastEstimate {
    /// Attitude, a quaternion w, x, y, z; none with the paper's filters.
    pub inertial_from_body_wxyz: Option<[f32; 4]>,
    /// Velocity: north, west, up (m/s); none with the paper's filters.
    pub velocity_mps: Option<[f32; 3]>,
    /// Muscle input and damping coefficients, each in pitch, yaw, roll.
    pub state: [f32; 6],
    /// Their variances.
    pub variance: [f32; 6],
}

impl From<&Estimate> for LastEstimate {
    fn from(estimate: &Estimate) -> Self {
        let has_motion = estimate.flags.contains(EstimateFlags::MOTION);
        let q = estimate.inertial_from_body.unpack();
        Self {
            inertial_from_body_wxyz: has_motion.then_some([q.w, q.i, q.j, q.k]),
            velocity_mps: has_motion.then_some(estimate.velocity),
            state: estimate.state,
            variance: estimate.variance,
        }
    }
}

/// Runs the unit with a stored configuration on the bytes of `input` until they end or Ctrl-C is pressed. `look` is
/// called with the number of samples so far. Returns the flight as the unit would log it, from the first byte.
///
/// The board's clock advances by one sample interval with each sample, so the same bytes always give the same result.
///
/// # Errors
/// Returns an error if the configuration is not usable, if reading fails, or if the bytes contain no sample.
pub fn run(
    setup: &Setup,
    input: &Input,
    mut look: impl FnMut(u32),
) -> Result<(LoggedFlight, SensorReport)> {
    let mut unit = Unit::new(Desk::new(setup), Identity::default());
    if !unit.resume(setup) {
        return Err(Problem::bad_input(
            "the unit does not accept this configuration",
        ));
    }
    let mut contents = (setup.configure.sensor == SensorKind::Xbus).then(Xbus::new);
    let mut bytes = 0;
    while !interrupt::requested() {
        let piece = match input.next(PATIENCE)? {
            Chunk::Bytes(piece) => piece,
            Chunk::Silence => continue,
            Chunk::End => break,
        };
        bytes += piece.len() as u64;
        if let Some(contents) = &mut contents {
            contents.push(&piece);
        }
        // One by one: a solution is as old as the sample that it arrives after.
        for &byte in &piece {
            unit.receive_sensor(&[byte]);
            advance(&mut unit);
        }
        look(unit.board().samples.get());
    }
    unit.report();
    let status = unit.status();
    if status.sensor_samples == 0 {
        return Err(match setup.configure.sensor {
            SensorKind::Chain => not_calibrated(bytes, &unit.limbs().calibration()),
            SensorKind::Xbus | SensorKind::Bno08xRvc => nothing_in(bytes, contents.as_ref()),
        });
    }
    let flight = unit.board().flight.replace(LoggedFlight::default());
    let rate = f64::from(setup.configure.sample_rate);
    let mut report = SensorReport::of(&flight, &status, rate, bytes);
    report.limbs = (unit.limbs().report()).map(|chain| Limbs::of(&unit, &chain));
    let failed = report.limbs.as_ref().map(|limbs| limbs.failed.join(", "));
    if let Some(failed) = failed.filter(|failed| !failed.is_empty()) {
        let sentence = format!("sensors are missing, have failed or have slipped: {failed}");
        report.doubt = Some(sentence);
    }
    Ok((flight, report))
}

/// Opens a sensor's port, or its recorded bytes to be played at the pace at which they were sent.
///
/// # Errors
/// Returns an error if it cannot be read.
pub fn open(source: &str, baud: u32) -> Result<SensorLine> {
    let path = Path::new(source);
    let input = Input::open(source, baud)?;
    if !path.is_file() {
        return Ok(SensorLine { input, pace: None });
    }
    let bytes = std::fs::read(path).map_err(|error| Problem::system("read", path, error))?;
    let mut contents = Xbus::new();
    contents.push(&bytes);
    #[expect(clippy::cast_precision_loss, reason = "lengths of files")]
    let length = bytes.len() as f64;
    let duration = contents.totals().duration_s;
    let duration = chain_duration(&bytes).unwrap_or(duration);
    let pace = if duration > 0.0 {
        length / duration
    } else {
        RVC_PACE
    };
    let pace = Some(pace);
    Ok(SensorLine { input, pace })
}

/// Duration of the bytes of sensors on the limbs (s), by the clock of the one on the pelvis; `None` if they are none.
fn chain_duration(bytes: &[u8]) -> Option<f64> {
    let (mut decoder, mut input) = (Decoder::new(), bytes);
    let (mut last, mut elapsed) = (None, 0.0);
    while let Some(packet) = decoder.next(&mut input) {
        let before = last.replace(packet.time).unwrap_or(packet.time);
        elapsed += f64::from(packet.time.wrapping_sub(before)) * 1e-6;
    }
    last.map(|_| elapsed)
}

/// Time for which a machine runs on after the last byte, so that its log is written.
const REST: Duration = Duration::from_millis(500);

/// Flies a unit in QEMU that no host can reach, with what is stored in the file `flash`, until the sensor's line ends or
/// Ctrl-C is pressed.
///
/// # Errors
/// Returns an error if the image, the file or QEMU is missing.
pub fn fly_in_qemu(image: &Path, flash: &Path, sensor: SensorLine) -> Result<()> {
    let (machine, mut line) = Qemu::start_alone(image, flash)?;
    let player = std::thread::spawn(move || sensor.play(|piece| line.write_all(piece).is_ok()));
    while !player.is_finished() && !interrupt::requested() {
        std::thread::sleep(REST / 10);
    }
    std::thread::sleep(REST);
    machine.stop();
    Ok(())
}

/// Processes what has arrived, and reports once a second.
fn advance(unit: &mut Unit<Desk>) {
    let before = unit.board().samples.get();
    while unit.work() {}
    let samples = unit.board().samples.get();
    if samples == before {
        return;
    }
    if samples.is_multiple_of(unit.board().samples_a_second) {
        unit.report();
    }
    let mut frame = [0; MAX_FRAME_LENGTH];
    while unit.transmit(&mut frame).is_some() {}
}

/// Explains why bytes contain no sample.
fn nothing_in(bytes: u64, contents: Option<&Xbus>) -> Problem {
    let problem = Problem::bad_input(format!("found no sample of a sensor in {bytes} bytes"));
    let Some(totals) = contents.map(Xbus::totals).filter(|all| all.packets > 0) else {
        return problem.help("check --protocol, and --baud for a port");
    };
    let names: Vec<_> = totals.items.iter().map(|item| item.name).collect();
    problem.help(format!(
        "its {} packets have no orientation, which a sample needs; they contain: {}",
        totals.packets,
        names.join(", ")
    ))
}

/// Explains why sensors on the limbs give no samples.
fn not_calibrated(bytes: u64, calibration: &Calibration) -> Problem {
    if calibration.heard == 0 {
        let problem = format!("found no packet of a sensor on a limb in {bytes} bytes");
        return Problem::bad_input(problem).help("check --protocol, and --baud for a port");
    }
    refused(calibration)
}

impl SensorReport {
    fn of(flight: &LoggedFlight, status: &Status, rate: f64, bytes: u64) -> Self {
        let count = |wanted: EstimateFlags, but: EstimateFlags| {
            let flags = flight.estimates().map(|(_, estimate)| estimate.flags);
            flags
                .filter(|flags| flags.intersects(wanted) && !flags.intersects(but))
                .count()
        };
        let all = flight.estimates().count();
        let supported = count(EstimateFlags::SUPPORTED, EstimateFlags::empty());
        // Until the filter has seen that the person stands, it is lost on the ground, not in flight.
        let standing = flight
            .estimates()
            .take_while(|(time, _)| *time < LONGEST_ARRIVAL)
            .position(|(_, estimate)| estimate.flags.contains(EstimateFlags::SUPPORTED))
            .unwrap_or(0);
        let lost = count(EstimateFlags::LOST, EstimateFlags::SUPPORTED);
        let lost = lost.saturating_sub(standing);
        let unsure = EstimateFlags::DOUBTFUL | EstimateFlags::INCONSISTENT;
        let settled = EstimateFlags::SUPPORTED | EstimateFlags::LOST;
        let doubtful = count(unsure, settled);
        let other = count(EstimateFlags::all(), settled | unsure);
        let wrong_rate = count(EstimateFlags::RATE, EstimateFlags::empty());
        let mut report = Self {
            bytes,
            flight_s: flight.duration(),
            used: status.used,
            rejected: status.rejected,
            missing: status.missing,
            sensor_restarts: status.sensor_restarts,
            receiver_solutions: status.receiver_solutions,
            limbs: None,
            estimates: all as u64,
            estimates_bad: status.estimates_bad,
            supported: share(supported, all),
            consistent: share(other, all - supported),
            doubtful: share(doubtful, all - supported),
            lost: share(lost, all - supported),
            last: flight
                .estimates()
                .last()
                .map(|(_, estimate)| estimate.into()),
            written: None,
            doubt: None,
        };
        let lost_s = share(lost, all) * report.flight_s;
        let sent = report.used + report.rejected + report.missing;
        let sent_hz = f64::from(sent.saturating_sub(1)) / report.flight_s;
        let is_wrong = (sent_hz / rate - 1.0).abs() > RATE_TOLERANCE;
        report.doubt = if all == 0 {
            Some(format!("no estimate comes of {sent} samples of the sensor"))
        } else if is_wrong || share(wrong_rate, all) > LARGEST_DOUBT {
            Some(format!(
                "the sensor sends {sent_hz:.1} samples a second, and {rate:.1} are configured"
            ))
        } else if lost_s > LONGEST_LOST {
            Some(format!("the estimates are lost for {lost_s:.1} s"))
        } else {
            let share = 100.0 * report.doubtful;
            (report.doubtful > LARGEST_DOUBT)
                .then(|| format!("{share:.0} % of the estimates are doubtful"))
        };
        report
    }
}

fn share(part: usize, all: usize) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "counts of estimates")]
    let share = part as f64 / all.max(1) as f64;
    share
}

/// A board whose time passes with the samples.
struct Desk {
    samples: Cell<u32>,
    samples_a_second: u32,
    /// Interval of the samples (us).
    interval: f64,
    /// Errors of the posture from sensors on the limbs.
    errors: Cell<Option<SegmentErrors>>,
    flight: RefCell<LoggedFlight>,
}

impl Desk {
    fn new(setup: &Setup) -> Self {
        let rate = f64::from(setup.configure.sample_rate);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "saturates"
        )]
        let samples_a_second = rate.round().max(1.0) as u32;
        Self {
            samples: Cell::new(0),
            samples_a_second,
            interval: 1e6 / rate,
            errors: Cell::new(None),
            flight: RefCell::new(LoggedFlight::new(setup)),
        }
    }
}

impl Board for Desk {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "saturates"
    )]
    fn now(&self) -> u64 {
        (f64::from(self.samples.get()) * self.interval) as u64
    }

    fn cycles(&self) -> u32 {
        0
    }

    fn stack_free(&self) -> u32 {
        0
    }

    fn line_errors(&self) -> [u32; 2] {
        [0; 2]
    }

    fn feed_watchdog(&self) {}

    fn observe(&self, header: &Header, message: &Message) {
        if matches!(message, Message::Sample(_)) {
            self.samples.set(self.samples.get().wrapping_add(1));
        }
        if let Message::SegmentErrors(errors) = message {
            self.errors.set(Some(*errors));
        }
        self.flight.borrow_mut().push(header, *message);
    }

    fn note(&self, _: u32) {}
}
