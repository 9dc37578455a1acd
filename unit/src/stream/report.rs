//! The result of a stream.

use std::fmt::Write as _;

use bodyflight_core::link::Status;
use bodyflight_core::link::fault::Struck;
use serde::Serialize;

use super::session::Session;
use super::settings::Settings;
use super::twin::Agreement;
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_mvnx::live::Kept;
use bodyflight_mvnx::recording::{Warning, faults};

/// The progress of a stream.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct Live {
    /// Time of the flight (s).
    pub time_s: f64,
    /// Samples sent.
    pub sent: u32,
    /// Estimates received.
    pub estimates: u64,
    /// Latency of the last estimate received (ms).
    pub latency_ms: Option<f64>,
    /// Samples that are missing at the unit.
    pub missing: u32,
    /// Samples that the unit dropped because it was behind.
    pub dropped: u32,
    /// Deadlines that the unit missed.
    pub deadline_missed: u32,
    /// The last estimate.
    pub estimate: Option<LiveEstimate>,
}

/// An estimate of the unit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct LiveEstimate {
    /// Muscle input and damping coefficients, each in pitch, yaw, roll.
    pub state: [f32; 6],
    /// Their variances.
    pub variance: [f32; 6],
    /// Normalised innovation squared.
    pub nis: f32,
}

impl Live {
    pub(super) fn of(session: &Session, time_s: f64) -> Self {
        let status = session.status.as_ref();
        Self {
            time_s,
            sent: session.sent(),
            estimates: session.twin.agreement().received,
            latency_ms: session.latencies.last(),
            missing: status.map_or(0, |s| s.missing),
            dropped: status.map_or(0, |s| s.dropped_oldest),
            deadline_missed: status.map_or(0, |s| s.deadline_missed),
            estimate: session.estimate.map(|estimate| LiveEstimate {
                state: estimate.state,
                variance: estimate.variance,
                nis: estimate.nis,
            }),
        }
    }
}

/// Latencies from a sample to its estimate (ms).
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Latency {
    /// Median.
    pub median_ms: f64,
    /// 99th percentile.
    pub p99_ms: f64,
    /// The longest.
    pub max_ms: f64,
    /// Shortest round trip of a clock comparison.
    pub round_trip_ms: f64,
}

/// The unit's counters at the end; see `docs/unit.md`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[expect(missing_docs, reason = "documented in Status")]
pub struct UnitCounters {
    pub received_bytes: u32,
    pub received_frames: u32,
    pub crc_bad: u32,
    pub cobs_bad: u32,
    pub too_long: u32,
    pub unknown: u32,
    pub value_bad: u32,
    pub wrong_session: u32,
    pub duplicate: u32,
    pub late: u32,
    pub gap_events: u32,
    pub missing: u32,
    pub used: u32,
    pub rejected: u32,
    pub dropped_oldest: u32,
    pub uart_overrun: u32,
    pub uart_framing: u32,
    pub queue_high_water: u32,
    pub deadline_missed: u32,
    pub cycles_max: u32,
    pub innovation_rejected: u32,
    pub transmit_dropped: u32,
    pub stack_free: u32,
    pub watchdog_resets: u32,
    pub sensor_overrun: u32,
    pub sensor_framing: u32,
    pub battery_mv: u16,
}

impl From<&Status> for UnitCounters {
    fn from(status: &Status) -> Self {
        Self {
            received_bytes: status.received_bytes,
            received_frames: status.received_frames,
            crc_bad: status.crc_bad,
            cobs_bad: status.cobs_bad,
            too_long: status.too_long,
            unknown: status.unknown,
            value_bad: status.value_bad,
            wrong_session: status.wrong_session,
            duplicate: status.duplicate,
            late: status.late,
            gap_events: status.gap_events,
            missing: status.missing,
            used: status.used,
            rejected: status.rejected,
            dropped_oldest: status.dropped_oldest,
            uart_overrun: status.uart_overrun,
            uart_framing: status.uart_framing,
            queue_high_water: status.queue_high_water,
            deadline_missed: status.deadline_missed,
            cycles_max: status.cycles_max,
            innovation_rejected: status.innovation_rejected,
            transmit_dropped: status.transmit_dropped,
            stack_free: status.stack_free,
            watchdog_resets: status.watchdog_resets,
            sensor_overrun: status.sensor_overrun,
            sensor_framing: status.sensor_framing,
            battery_mv: status.battery,
        }
    }
}

/// Source location of the last panic, if the unit's last fault was one.
fn place_of_panic(status: &Status) -> Option<String> {
    let place = String::from_utf8_lossy(&status.fault_place);
    let place = place.trim_start_matches('\0');
    (!place.is_empty()).then(|| place.to_owned())
}

/// Frames damaged on purpose.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[expect(missing_docs, reason = "documented in Struck")]
pub struct Harmed {
    pub dropped: u32,
    pub corrupted: u32,
    pub reordered: u32,
}

impl From<&Struck> for Harmed {
    fn from(struck: &Struck) -> Self {
        Self {
            dropped: struck.drop,
            corrupted: struck.corrupt,
            reordered: struck.reorder,
        }
    }
}

/// The result of a stream.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Report {
    /// Build ID of the unit.
    pub unit_build: String,
    /// End of `file:line` if the unit's last fault since power-on was a panic.
    pub unit_panic: Option<String>,
    /// Filter preset.
    pub preset: String,
    /// Samples sent.
    pub sent: u32,
    /// Duration of the flight (s).
    pub flight_s: f64,
    /// Time that the stream took (s).
    pub wall_s: f64,
    /// Data rate to the unit (B/s).
    pub bytes_per_second: f64,
    /// Frames damaged on purpose.
    pub harmed: Harmed,
    /// The unit's estimates compared with the desktop's.
    pub estimates: Agreement,
    /// Latency from sample to estimate.
    pub latency: Latency,
    /// Samples that did not reach the unit intact, besides those damaged on purpose.
    pub lost: u32,
    /// Samples whose fate is known.
    pub accounted: u32,
    /// Frames from the unit that were rejected.
    pub refused: u64,
    /// Counters of the unit.
    pub unit: UnitCounters,
    /// Lines of the unit's log, if it was read.
    pub log_lines: Option<u64>,
    /// Log frames that could not be decoded.
    pub log_malformed: Option<u64>,
    /// The recording of the stream, if one was requested.
    pub kept: Option<Kept>,
    /// What is implausible in the flight that was sent.
    pub warnings: Vec<Warning>,
}

impl Report {
    pub(super) fn of(session: &Session, settings: &Settings, flight_s: f64, wall_s: f64) -> Self {
        let status = session.status.as_ref();
        let unit = status.map(UnitCounters::from).unwrap_or_default();
        let harmed = Harmed::from(session.injector.struck());
        let build = session.unit.map_or([0; 8], |unit| unit.build);
        let text = String::from_utf8_lossy(&build);
        #[expect(clippy::cast_precision_loss, reason = "far below 2^53")]
        let bytes_per_second = session.line.sent_bytes as f64 / wall_s;
        Self {
            unit_build: text.trim_end_matches('\0').to_owned(),
            unit_panic: session.status.as_ref().and_then(place_of_panic),
            preset: settings.preset.clone(),
            sent: session.sent(),
            flight_s,
            wall_s,
            bytes_per_second,
            harmed,
            estimates: session.twin.agreement(),
            latency: latency(session),
            lost: unit
                .missing
                .saturating_sub(harmed.dropped + harmed.corrupted),
            accounted: status.map_or(0, Status::accounted),
            refused: session.line.refused,
            unit,
            log_lines: None,
            log_malformed: None,
            kept: None,
            warnings: Vec::new(),
        }
    }

    /// Why the estimates cannot be trusted however well both sides agree, `None` if nothing contradicts the flight.
    pub fn doubt(&self) -> Option<String> {
        faults(&self.warnings)
    }

    /// Checks that every sample is accounted for and every estimate equals the desktop's.
    ///
    /// # Errors
    /// Returns a disagreement that states the differences.
    pub fn verdict(&self) -> Result<()> {
        let mut wrong = String::new();
        let estimates = &self.estimates;
        if !estimates.holds() {
            let _ = write!(
                wrong,
                "{} estimates expected, {} received, {} equal",
                estimates.expected, estimates.received, estimates.equal
            );
            if let Some(first) = estimates.first_difference {
                let _ = write!(wrong, ", the first difference is at sample {first}");
            }
        }
        if self.accounted != self.sent {
            let _ = write!(
                wrong,
                "; {} samples sent, {} accounted for",
                self.sent, self.accounted
            );
        }
        if self.lost > 0 {
            let _ = write!(wrong, "; {} samples lost on the line", self.lost);
        }
        if self.unit.dropped_oldest > 0 {
            let dropped = self.unit.dropped_oldest;
            let _ = write!(wrong, "; the unit was behind and dropped {dropped} samples");
        }
        if wrong.is_empty() {
            return Ok(());
        }
        Err(
            Problem::disagreement(wrong.trim_start_matches("; ").to_owned())
                .help("--speed max streams without dropping; docs/unit.md explains each counter"),
        )
    }
}

fn latency(session: &Session) -> Latency {
    let latencies = &session.latencies;
    #[expect(clippy::cast_precision_loss, reason = "durations are below 2^53 us")]
    let round_trip_ms = session.round_trip.unwrap_or(0) as f64 * 1e-3;
    Latency {
        median_ms: latencies.quantile(0.5),
        p99_ms: latencies.quantile(0.99),
        max_ms: latencies.longest(),
        round_trip_ms,
    }
}
