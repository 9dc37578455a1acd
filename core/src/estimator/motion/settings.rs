//! Settings of the motion filter as data.

use super::measurement::Noise;
use crate::estimator::preset::SAMPLE_RATE;
use crate::math::{Lanes, Real};

/// Velocity assumed until one is measured: north, west, up (m/s).
pub const ASSUMED_FALL: [f32; 3] = [0.0, 0.0, -50.0];

/// Standard deviation of each component of that velocity (m/s): people exit at up to 60 m/s, and some stand.
pub const ASSUMED_DEVIATION: f32 = 25.0;

/// How the model's derivatives are taken with respect to velocity and angular velocity, in which it is not linear; in all
/// other coordinates it is, or they follow from these.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Slopes {
    /// By differences over small steps: those of an extended filter.
    #[default]
    Differences,
    /// By sigma points spread as far as the state is uncertain: statistically linearised, with the shift of the mean, as
    /// in an unscented filter whose linear coordinates are marginalised. The curvature's own share of the spread, which
    /// is of fourth order in the deviations, is left out.
    SigmaPoints,
}

/// All settings of a motion filter. Arrays of three are in the order pitch, yaw, roll.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotionPreset {
    /// Standard deviations of the sensors; larger values give the measurements less weight.
    pub noise: Noise<f32>,
    /// Standard deviation of the quiet muscle input, whose mean is zero; a larger one lets more of the motion be
    /// explained by muscles.
    pub muscle: [f32; 3],
    /// Correlation time of the muscle input (s); a longer one makes the estimate smoother and slower.
    pub muscle_time: f32,
    /// Mean of the damping coefficients, to which they decay (dimensionless).
    pub damping: [f32; 3],
    /// Standard deviations of the damping coefficients; larger ones let them move further from the mean.
    pub damping_deviation: [f32; 3],
    /// Correlation time of the damping (s); with a longer one it changes more slowly.
    pub damping_time: f32,
    /// Standard deviations of muscle input and of damping while an axis is moved deliberately.
    pub awake: [f32; 2],
    /// Time constant of the inputs of an awake axis, and time for which an axis stays awake (s).
    pub awake_time: f32,
    /// Number of standard deviations of the mean innovation at which an axis wakes up; a lower one reacts earlier and
    /// has more false alarms.
    pub awake_threshold: f32,
    /// Number of standard deviations by which an angular velocity must differ from zero to inform the damping.
    pub damping_threshold: f32,
    /// Standard deviation of the recorded joints, each axis (rad); a larger one attributes more of the loads to joint
    /// errors.
    pub joint_error: f32,
    /// Standard deviations of the residual force (m2) and moment (m3), divided by the dynamic pressure, beyond what joint
    /// errors of first order cause: that of a posture that is not known at all. Zero if the posture is measured.
    pub unknown_load: [f32; 2],
    /// Correlation time of the joint errors (s); with a longer one the residual load changes more slowly.
    pub joint_error_time: f32,
    /// Rate at which the joints' load decorrelates as the airstream turns about the body (1/rad).
    pub turn_rate: f32,
    /// Acceleration that the model misses, as white noise (m/s2 per root Hz).
    pub acceleration_noise: f32,
    /// Angular acceleration that the model misses, as white noise (rad/s2 per root Hz).
    pub angular_acceleration_noise: f32,
    /// Standard deviation of the wind's horizontal components (m/s) about those of the model's air, if a receiver
    /// measures the velocity over the ground; zero for no wind but the model's.
    pub wind_deviation: f32,
    /// How fast the wind changes on the way down (m/s per root second).
    pub wind_noise: f32,
    /// Standard deviation of a gyroscope's bias (rad/s), if one is read without correction.
    pub gyroscope_bias: f32,
    /// How fast the bias wanders (rad/s per root second).
    pub gyroscope_bias_noise: f32,
    /// Standard deviations of the error of the scale of angular velocities, as a share: of those that the sensor has
    /// corrected, and of a gyroscope as read.
    pub rate_scale: [f32; 2],
    /// Innovation gate: number of standard deviations beyond which a channel is rejected; must be positive.
    pub gate: f32,
    /// How derivatives are taken.
    pub slopes: Slopes,
    /// Sample rate (Hz).
    pub sample_rate: f32,
    /// Number of samples from one estimate to the next.
    pub solution_window: usize,
}

/// The default settings: sensor noise as in the paper, joint errors of 2 degrees.
///
/// The spread and time of quiet muscle input, the time of the joint errors, and the thresholds were chosen on
/// synthetic flights of seed 101, with joints 2 degrees off and with exact joints.
pub const MOTION: MotionPreset = MotionPreset {
    noise: Noise {
        attitude: 0.01,
        angular_velocity: 0.03,
        horizontal_velocity: 0.1,
        vertical_velocity: 1.0,
        horizontal_speed: 0.1,
    },
    muscle: [0.3; 3],
    muscle_time: 4.0,
    damping: [3.0, 0.5, 6.0],
    damping_deviation: [5.0, 2.0, 4.0],
    damping_time: 2.0,
    awake: [3.0, 4.0],
    awake_time: 0.3,
    awake_threshold: 4.0,
    damping_threshold: 10.0,
    joint_error: 2.0 * core::f32::consts::PI / 180.0,
    unknown_load: [0.0; 2],
    joint_error_time: 20.0,
    turn_rate: 2.0,
    acceleration_noise: 0.02,
    angular_acceleration_noise: 0.02,
    wind_deviation: 8.0,
    wind_noise: 0.3,
    gyroscope_bias: 0.03,
    gyroscope_bias_noise: 2e-4,
    rate_scale: [0.0, 0.015],
    gate: 5.0,
    slopes: Slopes::Differences,
    sample_rate: SAMPLE_RATE,
    solution_window: 4,
};

impl MotionPreset {
    /// Returns the preset for a body whose posture is not measured but assumed.
    ///
    /// Joints are off by 20 degrees an axis, and the load by a fifth of a belly fall's drag area at a lever of 0.2 m:
    /// an arm or a leg at an angle changes the drag by its cosine, which errors of first order do not show. Without a suit
    /// the angular velocity is that of a single gyroscope.
    #[must_use]
    pub const fn with_assumed_posture(mut self) -> Self {
        self.joint_error = 20.0 * core::f32::consts::PI / 180.0;
        self.unknown_load = [0.1, 0.02];
        self.rate_scale = [0.01, self.rate_scale[1]];
        self
    }

    /// Multiplies process noise, measurement noise and initial covariance, as variances. Inputs start with their
    /// long-run spread, so the factor for the start also applies to the process.
    pub fn scale(&mut self, process: f32, measurement: f32, start: f32) {
        let root = |factor: f32| factor.root();
        for spread in self.muscle.iter_mut().chain(&mut self.damping_deviation) {
            *spread *= root(process * start);
        }
        self.acceleration_noise *= root(process);
        self.angular_acceleration_noise *= root(process);
        self.noise = self.noise.scaled(root(measurement));
    }

    /// Duration of an interval of `stride` samples (s).
    pub fn duration<T: Real>(&self, stride: usize) -> T {
        let step = T::one() / T::single(self.sample_rate);
        let mut duration = T::zero();
        for _ in 0..stride {
            duration += step;
        }
        duration
    }
}
