//! The unit's two filters behind one interface: their inputs from a sample, and their outputs for the link.

use bodyflight_core::dynamics::{Dynamics, Motion};
use bodyflight_core::estimator::measurement::Measurement;
use bodyflight_core::estimator::motion::ReducedMotionFilter;
use bodyflight_core::estimator::motion::estimate::MotionEstimate;
use bodyflight_core::estimator::motion::measurement::{MotionMeasurement, SensorMeasurement};
use bodyflight_core::estimator::motion::sensors::Gyroscope;
use bodyflight_core::estimator::motion::settings::MotionPreset;
use bodyflight_core::estimator::motion::state::{MUSCLE, STATES};
use bodyflight_core::estimator::motion::support::Situation;
use bodyflight_core::estimator::motion::watch::Consistency;
use bodyflight_core::estimator::preset::Preset;
use bodyflight_core::estimator::status::{Estimate, Health};
use bodyflight_core::estimator::unit_preset::UnitPreset;
use bodyflight_core::estimator::unscented::SettingsError;
use bodyflight_core::estimator::{ReducedFilter, input_coefficients};
use bodyflight_core::link::{self, EstimateFlags, PackedQuaternion, Sample, Sensors, Validity};

use crate::limbs;
use bodyflight_core::{Posture, SegmentArray};

/// Standard deviation of a gyroscope on the body, vibration included (rad/s).
const GYROSCOPE_DEVIATION: f32 = 0.02;

/// Either of the two filters.
#[derive(Debug)]
#[expect(
    clippy::large_enum_variant,
    reason = "there is only one, in static memory sized for the larger variant"
)]
pub(super) enum Filter {
    Windows(ReducedFilter<f32>),
    Motion(ReducedMotionFilter<f32>),
}

/// The result of an update.
#[expect(
    clippy::large_enum_variant,
    reason = "there is one at a time, and no heap to box it in"
)]
pub(super) enum Answer {
    Windows(Estimate<f32>),
    Motion(MotionEstimate<f32>),
}

impl Filter {
    /// Starts the filter of a preset in `slot`, which is left empty if the preset or the start is refused. The velocity is
    /// known to within `velocity_deviation` (m/s), zero if it was measured.
    ///
    /// Each kind is moved to its place only once, and the motion filter is started in place: filters are so large that
    /// a unit's stack cannot hold several.
    pub(super) fn start_in(
        slot: &mut Option<Self>,
        preset: &UnitPreset,
        dynamics: &Dynamics<f32>,
        motion: &Motion<f32>,
        posture: &Posture<f32>,
        velocity_deviation: f32,
    ) -> Result<(), SettingsError> {
        match preset {
            UnitPreset::Windows(preset) => windows_in(slot, preset, dynamics, motion, posture),
            UnitPreset::Motion(preset, _) => {
                motion_in(slot, preset, dynamics)?;
                let started = slot.as_mut().map_or(Ok(()), |filter| {
                    filter.restart(motion, posture, velocity_deviation)
                });
                if started.is_err() {
                    *slot = None;
                }
                started
            }
        }
    }

    /// Starts again; see [`Filter::start_in`]. The paper's filters take every velocity as measured.
    pub(super) fn restart(
        &mut self,
        motion: &Motion<f32>,
        posture: &Posture<f32>,
        velocity_deviation: f32,
    ) -> Result<(), SettingsError> {
        match self {
            Self::Windows(filter) => filter.restart(motion, posture),
            Self::Motion(filter) => filter.restart_assuming(motion, posture, velocity_deviation),
        }
    }

    /// Takes errors of segments (rad) after a start; the paper's filters know none, and a build without sensors on the limbs has
    /// no room for them.
    pub(super) fn set_segment_errors(&mut self, deviations: &SegmentArray<f32>) {
        if let Self::Motion(filter) = self
            && limbs::IS_BUILT_IN
        {
            filter.set_segment_errors(deviations);
        }
    }

    /// Replaces them in flight.
    pub(super) fn change_segment_errors(&mut self, deviations: &SegmentArray<f32>) {
        if let Self::Motion(filter) = self
            && limbs::IS_BUILT_IN
        {
            filter.change_segment_errors(deviations);
        }
    }

    /// Standard deviations of the present state, of the motion filter only.
    pub(super) fn deviation(&self) -> Option<[f32; STATES]> {
        match self {
            Self::Windows(_) => None,
            Self::Motion(filter) => Some(filter.deviation().into()),
        }
    }

    /// Processes a posture and the sample that it comes from, with its motion; `None` for a bridged posture.
    pub(super) fn push(
        &mut self,
        posture: &Posture<f32>,
        seen: Option<(&Sample, &Motion<f32>, Option<&Sensors>)>,
    ) -> Option<Answer> {
        match self {
            Self::Windows(filter) => {
                let seen = seen.map_or_else(Measurement::none, |(sample, motion, _)| {
                    measurement_of(sample, motion)
                });
                filter.push(posture, &seen).map(Answer::Windows)
            }
            Self::Motion(filter) => {
                let seen = seen.map_or_else(SensorMeasurement::none, |(sample, _, sensors)| {
                    sensor_measurement_of(sample, sensors)
                });
                filter.push_sensors(posture, &seen).map(Answer::Motion)
            }
        }
    }
}

#[inline(never)]
fn windows_in(
    slot: &mut Option<Filter>,
    preset: &Preset,
    dynamics: &Dynamics<f32>,
    motion: &Motion<f32>,
    posture: &Posture<f32>,
) -> Result<(), SettingsError> {
    let filter = ReducedFilter::new(preset, dynamics, motion, posture)?;
    *slot = Some(Filter::Windows(filter));
    Ok(())
}

#[inline(never)]
fn motion_in(
    slot: &mut Option<Filter>,
    preset: &MotionPreset,
    dynamics: &Dynamics<f32>,
) -> Result<(), SettingsError> {
    let process = ReducedMotionFilter::process(preset)?;
    *slot = Some(Filter::Motion(ReducedMotionFilter::unstarted(
        preset, process, dynamics,
    )));
    Ok(())
}

impl Answer {
    /// Whether predictions are inconsistent with the measurements.
    pub(super) fn is_lost(&self) -> bool {
        match self {
            Self::Windows(estimate) => estimate.health == Health::Inconsistent,
            Self::Motion(estimate) => estimate.consistency == Consistency::Lost,
        }
    }

    /// Output for the link.
    pub(super) fn over_the_link(&self, sequence: u32, pending: EstimateFlags) -> link::Estimate {
        match self {
            Self::Windows(estimate) => answer(estimate, sequence, pending),
            Self::Motion(estimate) => motion_answer(estimate, sequence, pending),
        }
    }
}

/// The measurement in the sample; NaN for channels that it lacks.
fn measurement_of(sample: &Sample, motion: &Motion<f32>) -> Measurement<f32> {
    let all = Measurement::of(motion);
    let mut seen = Measurement::none();
    let has = |part| sample.valid.contains(part);
    if has(Validity::ATTITUDE) {
        seen.heading = all.heading;
        seen.pitch = all.pitch;
        seen.roll = all.roll;
        seen.vertical = all.vertical;
        if has(Validity::ANGULAR_VELOCITY) {
            seen.yaw_rate = all.yaw_rate;
        }
    }
    if has(Validity::VELOCITY) {
        seen.vertical_velocity = all.vertical_velocity;
        seen.horizontal_speed = all.horizontal_speed;
    }
    // Satellites measure speed directly, while inertial sensors integrate it, so satellites take precedence.
    if let Some(speed) = sample.motion().horizontal_speed {
        seen.horizontal_speed = speed;
    }
    seen
}

/// The measurement in the sample for the motion filter.
fn sensor_measurement_of(sample: &Sample, sensors: Option<&Sensors>) -> SensorMeasurement<f32> {
    let measured = sample.motion();
    let receiver = sensors.and_then(Sensors::receiver);
    let has_attitude = sample.valid.contains(Validity::ATTITUDE);
    // A sensor without an attitude does not correct its gyroscope for the bias.
    let is_raw = !has_attitude && sensors.is_some();
    let raw = measured.angular_velocity.filter(|_| is_raw);
    let motion = MotionMeasurement {
        inertial_from_body: has_attitude.then(|| sample.inertial_from_body()),
        angular_velocity: measured.angular_velocity.filter(|_| !is_raw),
        // With its accuracy and age the same velocity is worth more, and must not count twice.
        velocity: measured.velocity.filter(|_| receiver.is_none()),
        horizontal_speed: measured.horizontal_speed.filter(|_| receiver.is_none()),
    };
    SensorMeasurement {
        attitude_error: sensors.map_or(0.0, Sensors::attitude_error),
        is_still: sensors.is_some_and(Sensors::is_still),
        receiver,
        barometer: sensors.and_then(Sensors::barometer),
        gyroscope: raw.map(|angular_velocity| Gyroscope {
            angular_velocity,
            deviation: GYROSCOPE_DEVIATION,
        }),
        specific_force: sensors.and_then(Sensors::specific_force),
        ..motion.into()
    }
}

/// Output of the motion filter for the link. The measurement fields are the ground speed, heading, pitch and roll of
/// its motion.
fn motion_answer(
    estimate: &MotionEstimate<f32>,
    sequence: u32,
    pending: EstimateFlags,
) -> link::Estimate {
    let taken_in = estimate.channels.iter().any(|channel| channel.fused);
    let consistency = estimate.consistency;
    let mut flags = pending;
    flags.set(
        EstimateFlags::VALID,
        taken_in && consistency != Consistency::Lost,
    );
    flags.set(EstimateFlags::NOT_TAKEN_IN, !taken_in);
    flags.set(
        EstimateFlags::DOUBTFUL,
        consistency == Consistency::Doubtful,
    );
    flags.set(EstimateFlags::LOST, consistency == Consistency::Lost);
    // A rejected channel is no failure of the filter.
    flags.set(EstimateFlags::FAULT, estimate.faults.is_of_filter());
    flags.set(EstimateFlags::RATE, estimate.faults.rate);
    flags.set(
        EstimateFlags::SUPPORTED,
        estimate.situation == Situation::Supported,
    );
    flags |= EstimateFlags::MOTION;
    let seen = Measurement::of(&estimate.motion);
    let variance = |k: usize| estimate.deviation[MUSCLE + k] * estimate.deviation[MUSCLE + k];
    link::Estimate {
        sample_sequence: sequence,
        flags,
        state: input_coefficients(&estimate.inputs),
        variance: core::array::from_fn(variance),
        measurement: [seen.horizontal_speed, seen.heading, seen.pitch, seen.roll],
        nis: estimate.normalised_innovation,
        cycles: 0,
        inertial_from_body: PackedQuaternion::pack(estimate.motion.inertial_from_body.quaternion()),
        velocity: estimate.motion.velocity_inertial().to_array(),
    }
}

/// Output for the link; the caller fills in the processor's cycles.
fn answer(estimate: &Estimate<f32>, sequence: u32, pending: EstimateFlags) -> link::Estimate {
    let taken_in = estimate.channels.iter().any(|channel| channel.fused);
    let health = estimate.health;
    let follows = matches!(health, Health::Good | Health::Settling);
    let mut flags = pending;
    flags.set(EstimateFlags::VALID, taken_in && follows);
    flags.set(EstimateFlags::NOT_TAKEN_IN, !taken_in);
    flags.set(EstimateFlags::INCONSISTENT, health == Health::Inconsistent);
    flags.set(EstimateFlags::SETTLING, health == Health::Settling);
    flags.set(EstimateFlags::FAULT, !estimate.faults.none());
    link::Estimate {
        sample_sequence: sequence,
        flags,
        state: estimate.state.into(),
        variance: estimate.deviation.map(|d| d * d).into(),
        measurement: estimate.channels.map(|channel| channel.predicted),
        nis: estimate.normalised_innovation,
        cycles: 0,
        inertial_from_body: PackedQuaternion::default(),
        velocity: [0.0; 3],
    }
}
