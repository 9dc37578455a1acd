//! The filter behind the link: samples in, estimates out.
//!
//! There is no input, output or clock here: results depend only on the samples and their sensor times, so a desktop
//! that runs a [`Computer`] over the same samples gets the same bits as the unit.

mod filter;
mod tempo;

use bodyflight_core::aerodynamics::Aerodynamics;
use bodyflight_core::air::Air;
use bodyflight_core::dynamics::{Dynamics, Motion};
use bodyflight_core::estimator::motion::settings::{ASSUMED_DEVIATION, ASSUMED_FALL};
#[cfg(doc)]
use bodyflight_core::estimator::motion::state;
use bodyflight_core::estimator::motion::state::STATES;
use bodyflight_core::estimator::unit_preset::UnitPreset;
use bodyflight_core::frame::{Inertial, Vector};
use bodyflight_core::link::{
    self, Configure, EstimateFlags, Sample, SegmentErrors, SegmentTable, Sensors, Validity, Verdict,
};
use bodyflight_core::{Body, Lanes, Posture};

use filter::Filter;
use tempo::Tempo;

/// Largest step in sample numbers that the model bridges, with interpolated postures; after a longer gap the
/// reconstructed motion is reset to the next sample.
pub const LONGEST_BRIDGE: u16 = 12;

/// Change of the velocity in a second that nothing measures (m/s), of which [`ASSUMED_DEVIATION`] is the limit.
const UNMEASURED: f32 = 10.0;

/// Samples per interval of the filter; the number of samples per update is a multiple of it.
const STRIDE: usize = 2;

/// Lowest sample rate (Hz), at which the samples of one filter interval span 50 ms.
pub const LOWEST_RATE: f32 = 40.0;

/// Configuration of the computation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Configuration {
    preset: UnitPreset,
    sample_rate: f32,
    dynamics: Dynamics<f32>,
    update_period: u32,
}

impl Configuration {
    /// Checks a host's request together with the segment table sent with it.
    ///
    /// # Errors
    /// Returns the verdict to send to the host if the request is not usable.
    pub fn new(asked: &Configure, table: &SegmentTable) -> Result<Self, Verdict> {
        let preset = UnitPreset::of(usize::from(asked.preset)).ok_or(Verdict::UnknownPreset)?;
        let samples = (asked.sample_rate / asked.update_rate).nearest();
        let exact =
            (samples * asked.update_rate - asked.sample_rate).abs() < 1e-3 * asked.sample_rate;
        let solution_window = whole(samples) as usize;
        let usable = exact
            && (STRIDE..=preset.longest_solution_window()).contains(&solution_window)
            && solution_window.is_multiple_of(STRIDE)
            && asked.sample_rate >= LOWEST_RATE;
        if !usable {
            return Err(Verdict::UnusableRates);
        }
        let body = table.body(asked.height, asked.table_digest)?;
        Ok(Self {
            preset: preset.at_rates(asked.sample_rate, solution_window),
            sample_rate: asked.sample_rate,
            dynamics: Dynamics {
                muscles: *preset.muscles(),
                aerodynamics: Aerodynamics {
                    coefficients: table.coefficients(),
                    arch: asked.arch_factor(),
                    ..Aerodynamics::paper()
                },
                air: Air {
                    velocity: Vector::from_components(asked.air_velocity.into()),
                    ..Air::still(asked.air_density)
                },
                ..Dynamics::paper(body, asked.air_density)
            },
            update_period: whole(1e6 / asked.update_rate),
        })
    }

    /// The body.
    pub const fn body(&self) -> &Body<f32> {
        &self.dynamics.body
    }

    /// Time between updates (us).
    pub const fn update_period(&self) -> u32 {
        self.update_period
    }
}

/// Truncates a non-negative number to an integer.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "saturates; callers check the range"
)]
fn whole(value: f32) -> u32 {
    value as u32
}

/// Result of processing a sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Outcome {
    /// Used; with an estimate if it triggered an update.
    Used(Option<link::Estimate>),
    /// Not used: there is no configuration, no motion to start from, or the time does not advance.
    Rejected,
}

/// State kept from the last sample.
#[derive(Debug, Clone, Copy)]
struct Last {
    time: u64,
    posture: Posture<f32>,
    velocity: Vector<f32, Inertial>,
}

/// Runs the unit's filter on samples.
#[derive(Debug)]
pub struct Computer {
    configuration: Option<Configuration>,
    filter: Option<Filter>,
    /// Whether the filter started without a posture.
    is_posture_assumed: bool,
    last: Option<Last>,
    /// Errors of a posture that sensors on the limbs measure.
    errors: Option<SegmentErrors>,
    tempo: Tempo,
    /// Flags to be reported with the next estimate.
    pending: EstimateFlags,
    /// Number of consecutive inconsistent updates.
    inconsistent: u32,
}

impl Default for Computer {
    fn default() -> Self {
        Self::new()
    }
}

impl Computer {
    /// Creates a computer without a configuration, which rejects every sample.
    pub const fn new() -> Self {
        Self {
            configuration: None,
            filter: None,
            is_posture_assumed: false,
            last: None,
            errors: None,
            tempo: Tempo::new(),
            pending: EstimateFlags::empty(),
            inconsistent: 0,
        }
    }

    /// Sets the configuration and restarts the filter. Setting the current configuration again changes nothing.
    pub fn configure(&mut self, configuration: Configuration) {
        if self.configuration != Some(configuration) {
            self.configuration = Some(configuration);
            self.reset();
        }
    }

    /// The current configuration, if any.
    pub const fn configuration(&self) -> Option<&Configuration> {
        self.configuration.as_ref()
    }

    /// Standard deviations of the motion filter's present state, in the order of [`state`]; `None` before its start and
    /// with the paper's filters. The link has room for those of the inputs only.
    pub fn deviation(&self) -> Option<[f32; STATES]> {
        self.filter.as_ref().and_then(Filter::deviation)
    }

    /// Restarts the filter with the next sample.
    pub fn reset(&mut self) {
        self.filter = None;
        self.last = None;
        self.errors = None;
        self.tempo = Tempo::new();
        self.pending = EstimateFlags::empty();
        self.inconsistent = 0;
    }

    /// Takes the errors of postures from the next sample on.
    pub fn set_segment_errors(&mut self, errors: &SegmentErrors) {
        let is_first = self.errors.replace(*errors).is_none();
        match &mut self.filter {
            // It was started with errors of joints, as a suit of another kind has them.
            filter if is_first => *filter = None,
            Some(filter) if !self.is_posture_assumed => {
                filter.change_segment_errors(&errors.deviations());
            }
            _ => {}
        }
    }

    /// Processes the next sample; `sequence` and `time` (us) are those of its header.
    pub fn sample(&mut self, sequence: u32, time: u64, sample: &Sample) -> Outcome {
        self.sample_with(sequence, time, sample, None)
    }

    /// Same as [`Computer::sample`], with what sensors other than a suit measured at that instant.
    pub fn sample_with(
        &mut self,
        sequence: u32,
        time: u64,
        sample: &Sample,
        sensors: Option<&Sensors>,
    ) -> Outcome {
        if sensors.is_some_and(Sensors::finds_north) {
            // Everything learned so far belongs to another attitude.
            self.reset();
        }
        let Some(configuration) = &self.configuration else {
            return Outcome::Rejected;
        };
        let has_posture = sample.valid.contains(Validity::POSTURE);
        if self.is_posture_assumed && has_posture {
            self.filter = None;
        }
        let (Some(filter), Some(last)) = (&mut self.filter, &self.last) else {
            return self.start(time, sample, sensors.is_some());
        };
        let steps = steps_between(last.time, time, configuration.sample_rate);
        if steps == 0 {
            return Outcome::Rejected;
        }
        let (from, elapsed) = (last.posture, time.saturating_sub(last.time));
        let posture = if has_posture { sample.posture() } else { from };
        let motion = motion_of(sample, last.velocity);
        self.last = Some(Last {
            time,
            posture,
            velocity: motion.velocity_inertial(),
        });
        if steps > LONGEST_BRIDGE {
            self.tempo.interrupt();
            // Coefficients and covariance are kept.
            let gap = f32::from(steps) / configuration.sample_rate;
            let unknown = unless_measured(sample, (UNMEASURED * gap).min(ASSUMED_DEVIATION));
            if filter.restart(&motion, &posture, unknown).is_ok() {
                self.pending |= EstimateFlags::RESTARTED;
            }
            return Outcome::Used(None);
        }
        self.tempo.take(elapsed, steps, configuration.sample_rate);
        let mut estimate = None;
        let share = 1.0 / f32::from(steps);
        for step in 1..steps {
            let between = from.interpolated(&posture, share * f32::from(step));
            estimate = filter.push(&between, None).or(estimate);
        }
        estimate = filter
            .push(&posture, Some((sample, &motion, sensors)))
            .or(estimate);
        if steps > 1 {
            self.pending |= EstimateFlags::BRIDGED;
        }
        let Some(estimate) = estimate else {
            return Outcome::Used(None);
        };
        let pending = core::mem::take(&mut self.pending);
        let mut answer = estimate.over_the_link(sequence, pending);
        if self.tempo.is_wrong() {
            let is_lost = answer.flags.contains(EstimateFlags::LOST);
            answer.flags.set(EstimateFlags::RATE, true);
            answer.flags.set(EstimateFlags::DOUBTFUL, !is_lost);
        }
        let has_failed = self.errors.is_some_and(|errors| errors.failed != 0);
        answer.flags.set(EstimateFlags::LIMB, has_failed);
        self.watch(estimate.is_lost(), sample, &motion, &posture);
        Outcome::Used(Some(answer))
    }

    /// Starts from the motion of the first sample. Without a posture it only starts if the sample `is_sensed` by the
    /// unit's own sensor: the one in the sample is assumed then.
    fn start(&mut self, time: u64, sample: &Sample, is_sensed: bool) -> Outcome {
        let has_posture = sample.valid.contains(Validity::POSTURE);
        let complete = sample.valid.contains(Validity::ATTITUDE) && (has_posture || is_sensed);
        let Some(configuration) = self.configuration.as_ref().filter(|_| complete) else {
            return Outcome::Rejected;
        };
        let motion = motion_of(sample, Vector::from_components(ASSUMED_FALL.into()));
        let posture = sample.posture();
        let Configuration {
            preset, dynamics, ..
        } = configuration;
        let preset = if has_posture {
            *preset
        } else {
            preset.with_assumed_posture()
        };
        let unknown = unless_measured(sample, ASSUMED_DEVIATION);
        let slot = &mut self.filter;
        if Filter::start_in(slot, &preset, dynamics, &motion, &posture, unknown).is_err() {
            return Outcome::Rejected;
        }
        if has_posture && let (Some(filter), Some(errors)) = (slot, &self.errors) {
            filter.set_segment_errors(&errors.deviations());
        }
        self.is_posture_assumed = !has_posture;
        self.last = Some(Last {
            time,
            posture,
            velocity: motion.velocity_inertial(),
        });
        self.pending = EstimateFlags::RESTARTED;
        Outcome::Used(None)
    }

    /// Resets the reconstructed motion if predictions have disagreed with the measurements for a second.
    fn watch(
        &mut self,
        is_lost: bool,
        sample: &Sample,
        motion: &Motion<f32>,
        posture: &Posture<f32>,
    ) {
        self.inconsistent = if is_lost { self.inconsistent + 1 } else { 0 };
        let (Some(configuration), Some(filter)) = (&self.configuration, &mut self.filter) else {
            return;
        };
        let lost = self
            .inconsistent
            .saturating_mul(configuration.update_period)
            >= 1_000_000;
        let whole = [Validity::ATTITUDE, Validity::VELOCITY]
            .iter()
            .all(|&part| sample.valid.contains(part));
        if lost && whole {
            let restarted = filter.restart(motion, posture, 0.0).is_ok();
            if restarted {
                self.pending |= EstimateFlags::RESTARTED;
            }
            self.inconsistent = 0;
        }
    }
}

/// Number of sample periods between two times (us), rounded; 0 if time does not advance.
fn steps_between(last: u64, time: u64, sample_rate: f32) -> u16 {
    let elapsed = u32::try_from(time.saturating_sub(last)).unwrap_or(u32::MAX);
    let steps = (elapsed as f32 * sample_rate * 1e-6).nearest();
    u16::try_from(whole(steps)).unwrap_or(u16::MAX)
}

/// Standard deviation of the velocity that a start takes (m/s): `assumed` if the sample measures none.
fn unless_measured(sample: &Sample, assumed: f32) -> f32 {
    if sample.valid.contains(Validity::VELOCITY) {
        0.0
    } else {
        assumed
    }
}

/// Motion of the pelvis as far as it is known; `velocity` is used if none is measured.
fn motion_of(sample: &Sample, velocity: Vector<f32, Inertial>) -> Motion<f32> {
    let measured = sample.motion();
    let inertial_from_body = sample.inertial_from_body();
    Motion {
        inertial_from_body,
        position: Vector::zero(),
        velocity: inertial_from_body.inverse() * measured.velocity.unwrap_or(velocity),
        angular_velocity: measured.angular_velocity.unwrap_or_else(Vector::zero),
    }
}

#[cfg(test)]
mod tests;
