//! What tunes the motion filter, as data, and what follows from it for one rate.

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

use super::measurement::Noise;
use super::state::{
    ATTITUDE, DAMPING, INPUT_STATES, MUSCLE, RESIDUAL_FORCE, RESIDUAL_MOMENT, SPIN, STATES,
    VELOCITY,
};
use crate::estimator::preset::SAMPLE_RATE;
use crate::estimator::unscented::SettingsError;
use crate::math::Real;

/// Everything that tunes a motion filter. Three numbers are pitch, yaw, roll.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotionPreset {
    /// Standard deviations of what is measured.
    pub noise: Noise<f32>,
    /// Standard deviation of the muscle input; its mean is zero.
    pub muscle: [f32; 3],
    /// Correlation time of the muscle input (s).
    pub muscle_time: f32,
    /// Mean of the damping coefficients.
    pub damping: [f32; 3],
    /// Their standard deviation.
    pub damping_deviation: [f32; 3],
    /// Correlation time of the damping (s).
    pub damping_time: f32,
    /// Standard deviation of muscle input and of damping while an axis is moved on purpose.
    pub awake: [f32; 2],
    /// Time in which inputs then change, and for which an axis stays active (s).
    pub awake_time: f32,
    /// Deviations of the mean innovation of the angular velocity at which an axis wakes up.
    pub awake_threshold: f32,
    /// Deviations that an angular velocity must have from zero before it tells of the damping.
    pub damping_threshold: f32,
    /// Standard deviation of the recorded joints, each axis (rad).
    pub joint_error: f32,
    /// Time in which the joints' errors change (s).
    pub joint_error_time: f32,
    /// Share of the joints' load that a turn of the stream about the body makes another (1/rad).
    pub turn_rate: f32,
    /// Acceleration that the model does not know, as white noise (m/s2 over the root of Hz).
    pub acceleration_noise: f32,
    /// Angular acceleration that the model does not know (rad/s2 over the root of Hz).
    pub angular_acceleration_noise: f32,
    /// Innovation gate: deviations from the prediction beyond which a channel is rejected.
    pub gate: f32,
    /// Samples a second (Hz).
    pub sample_rate: f32,
    /// Samples from one estimate to the next.
    pub solution_window: usize,
}

/// The default: sensors as in the paper, joints 2 degrees off.
///
/// The spread of quiet muscle input and its time, the time of the joints' errors, and the thresholds were chosen on
/// synthetic flights of seed 101, with joints 2 degrees off and with exact ones.
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
    joint_error_time: 20.0,
    turn_rate: 2.0,
    acceleration_noise: 0.02,
    angular_acceleration_noise: 0.02,
    gate: 5.0,
    sample_rate: SAMPLE_RATE,
    solution_window: 4,
};

impl MotionPreset {
    /// Multiplies the process noise, the measurement noise and the start, as variances. Inputs start with the spread
    /// that they come back to, so the factor of the start counts among those of the process.
    pub fn scale(&mut self, process: f32, measurement: f32, start: f32) {
        let root = |factor: f32| factor.root();
        for spread in self.muscle.iter_mut().chain(&mut self.damping_deviation) {
            *spread *= root(process * start);
        }
        self.acceleration_noise *= root(process);
        self.angular_acceleration_noise *= root(process);
        let noise = &mut self.noise;
        for deviation in [
            &mut noise.attitude,
            &mut noise.angular_velocity,
            &mut noise.horizontal_velocity,
            &mut noise.vertical_velocity,
            &mut noise.horizontal_speed,
        ] {
            *deviation *= root(measurement);
        }
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

/// Share of the time in which muscles act on purpose, by guess, and deviations at which that is noticed.
const ON_PURPOSE: f64 = 0.25;
const NOTICED: f64 = 2.0;

/// How the inputs evolve over one interval: they return to their mean, and wander.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Process<T: Real> {
    centre: SVector<T, INPUT_STATES>,
    decay: SVector<T, INPUT_STATES>,
    /// Variance of muscle input and damping in the long run.
    spread: SVector<T, 6>,
    /// Variance that an interval adds to velocity and angular velocity.
    motion: [T; 2],
    /// Variance that an interval adds to muscle input and damping of an axis that is awake, and its ceiling.
    awake: [[T; 2]; 2],
    /// Pitch, yaw, roll: one where an axis has just woken up.
    activity: [T; 3],
    /// Share of the distance from the mean that an interval takes from muscle input, from damping, and from both where an axis is
    /// awake.
    rates: [T; 3],
    /// Share of the residual load that an interval forgets, and that a turn of the stream does (1/rad).
    joint_rate: T,
    turn_rate: T,
    /// Square of the joints' error (rad2).
    joint_variance: T,
    /// Share of the residual load that stays, by time and by turns of the stream.
    joint_kept: T,
    /// Covariance of the residual load for joints that are off by 1 rad.
    sensitivity: SMatrix<T, 6, 6>,
    /// What of its moment is the body's own turning, and the variance that a change of it brings.
    turning: Vector3<T>,
    turned: Vector3<T>,
}

impl<T: Real> Process<T> {
    /// For intervals of `duration` (s).
    ///
    /// # Errors
    /// Returns an error if a number is not finite or has the wrong sign.
    pub fn new(preset: &MotionPreset, duration: T) -> Result<Self, SettingsError> {
        let positive = |value: f32| value.is_finite() && value > 0.0;
        let times = [
            preset.muscle_time,
            preset.damping_time,
            preset.joint_error_time,
        ];
        let sizes = preset.muscle.iter().chain(&preset.damping_deviation);
        let mut sizes = sizes.chain([
            &preset.joint_error,
            &preset.acceleration_noise,
            &preset.angular_acceleration_noise,
        ]);
        if !sizes.all(|value| positive(*value)) || !positive(preset.gate) {
            return Err(SettingsError::Variance);
        }
        if !times.into_iter().all(positive) || !preset.damping.iter().all(|v| v.is_finite()) {
            return Err(SettingsError::ProcessNoise);
        }
        let mut centre = SVector::zeros();
        let mut decay = SVector::zeros();
        let mut spread = SVector::zeros();
        let [muscle, damping, joint] = times.map(|time| decay_over(duration / T::single(time)));
        for axis in 0..3 {
            centre[DAMPING - MUSCLE + axis] = T::single(preset.damping[axis]);
            decay[axis] = muscle;
            decay[DAMPING - MUSCLE + axis] = damping;
            decay[RESIDUAL_FORCE - MUSCLE + axis] = joint;
            decay[RESIDUAL_FORCE - MUSCLE + 3 + axis] = joint;
            spread[axis] = square(preset.muscle[axis]);
            spread[3 + axis] = square(preset.damping_deviation[axis]);
        }
        let motion = [preset.acceleration_noise, preset.angular_acceleration_noise];
        Ok(Self {
            centre,
            decay,
            spread,
            motion: motion.map(|noise| square::<T>(noise) * duration),
            awake: preset.awake.map(|size| {
                let rate = T::of(2.0) * duration / T::single(preset.awake_time);
                [square::<T>(size) * rate, square(size)]
            }),
            activity: [T::zero(); 3],
            rates: [preset.muscle_time, preset.damping_time, preset.awake_time]
                .map(|time| duration / T::single(time)),
            joint_rate: duration / T::single(preset.joint_error_time),
            turn_rate: T::single(preset.turn_rate),
            joint_variance: square(preset.joint_error),
            joint_kept: joint,
            sensitivity: SMatrix::zeros(),
            turning: Vector3::zeros(),
            turned: Vector3::zeros(),
        })
    }

    /// The mean that inputs return to.
    pub fn centre(&self) -> SVector<T, INPUT_STATES> {
        self.centre
    }

    /// Share of the distance from the mean that is left after an interval.
    pub fn decay(&self) -> SVector<T, INPUT_STATES> {
        self.decay
    }

    /// Takes the covariance of the residual load for joints that are off by 1 rad.
    pub fn set_sensitivity(&mut self, sensitivity: &SMatrix<T, 6, 6>) {
        self.sensitivity = *sensitivity;
    }

    /// Sets by how much the stream turned about the body in this interval (rad): what joints do to the loads
    /// is another load from another side.
    pub fn set_turn(&mut self, turn: T) {
        self.joint_kept = decay_over(self.joint_rate + turn * self.turn_rate);
        for k in RESIDUAL_FORCE - MUSCLE..INPUT_STATES {
            self.decay[k] = self.joint_kept;
        }
        self.turned = Vector3::zeros();
    }

    /// Adds what the body's own turning needs to the covariance of the residual load: `covariance` for joints that are off by
    /// 1 rad. Call it after [`Process::set_sensitivity`] and [`Process::set_turn`].
    ///
    /// Where a body begins to turn faster, its moments come to what is there already; where it turns slower, what is left of the
    /// residual moment is the share that is expected of it.
    pub fn set_turning(&mut self, covariance: &Matrix3<T>) {
        for axis in 0..3 {
            let air = self.sensitivity[(3 + axis, 3 + axis)];
            let (before, now) = (self.turning[axis], covariance[(axis, axis)]);
            if !now.is_finite() {
                continue;
            }
            self.turning[axis] = now;
            if now > before {
                self.turned[axis] = now - before;
            } else if air + before > T::zero() {
                let kept = (air + now) / (air + before);
                self.decay[RESIDUAL_MOMENT - MUSCLE + axis] = self.joint_kept * kept;
                self.turned[axis] = (air + now) * (T::one() - kept);
            }
        }
        if covariance.iter().all(|v| v.is_finite()) {
            let mut moment = self.sensitivity.fixed_view_mut::<3, 3>(3, 3);
            moment += covariance;
        }
    }

    /// Sets how much each axis is moved on purpose, 0 to 1: pitch, yaw, roll.
    pub fn set_activity(&mut self, activity: [T; 3]) {
        self.activity = activity;
        let [muscle, damping, awake] = self.rates;
        for (axis, activity) in activity.into_iter().enumerate() {
            self.decay[axis] = decay_over(muscle + activity * awake);
            self.decay[DAMPING - MUSCLE + axis] = decay_over(damping + activity * awake);
        }
    }

    /// How much each axis is moved on purpose in this interval, 0 to 1: pitch, yaw, roll.
    pub fn activity(&self) -> [T; 3] {
        self.activity
    }

    /// Standard deviations to state: the covariance knows quiet input alone, so where little is seen of an input, what may be done
    /// on purpose without being noticed is added.
    pub fn stated(&self, covariance: &SMatrix<T, STATES, STATES>) -> SVector<T, STATES> {
        let mut variance = covariance.diagonal();
        for axis in 0..3 {
            let known = variance[MUSCLE + axis];
            variance[MUSCLE + axis] = known + self.unnoticed(axis, known, self.activity[axis]);
        }
        variance.map(Real::root)
    }

    /// Variance of muscle input on purpose that goes unnoticed about an axis with this `activity`, 0 to 1, where quiet input has
    /// the variance `known`.
    ///
    /// With `left` of the spread of quiet input, measurements told `(1 - left) / known`, and the estimate falls short of an input
    /// by the share `left`. Inputs larger than some deviations of what was told wake the axis up.
    pub fn unnoticed(&self, axis: usize, known: T, activity: T) -> T {
        let one = T::one();
        let quiet = (one - activity) * T::of(ON_PURPOSE);
        let [_, largest] = self.awake[0];
        let left = known / self.spread[axis];
        if left < one {
            let size = T::of(NOTICED * NOTICED) * known / (one - left);
            let size = if size < largest { size } else { largest };
            quiet * left * left * size
        } else if known < largest {
            quiet * (largest - known)
        } else {
            T::zero()
        }
    }

    /// Covariance of the residual load in the long run.
    pub fn residual_covariance(&self) -> SMatrix<T, 6, 6> {
        self.sensitivity * self.joint_variance
    }

    /// Covariance before anything is measured but the motion, with these errors.
    pub fn start(&self, noise: &Noise<T>) -> SMatrix<T, STATES, STATES> {
        let mut covariance = SMatrix::<T, STATES, STATES>::zeros();
        let squares = |values: [T; 3]| values.map(|value| value * value);
        let [north, up] = [noise.horizontal_velocity, noise.vertical_velocity];
        let parts = [
            (ATTITUDE, squares([noise.attitude; 3])),
            (VELOCITY, squares([north, north, up])),
            (SPIN, squares([noise.angular_velocity; 3])),
        ];
        for (first, variances) in parts {
            for (k, variance) in variances.into_iter().enumerate() {
                covariance[(first + k, first + k)] = variance;
            }
        }
        for k in 0..6 {
            covariance[(MUSCLE + k, MUSCLE + k)] = self.spread[k];
        }
        covariance
            .fixed_view_mut::<6, 6>(RESIDUAL_FORCE, RESIDUAL_FORCE)
            .copy_from(&self.residual_covariance());
        covariance
    }

    /// Adds the process noise of an interval.
    pub fn add_noise(&self, covariance: &mut SMatrix<T, STATES, STATES>) {
        let one = T::one();
        for (first, variance) in [VELOCITY, SPIN].into_iter().zip(self.motion) {
            for k in first..first + 3 {
                covariance[(k, k)] += variance;
            }
        }
        for k in 0..6 {
            let lost = one - self.decay[k] * self.decay[k];
            covariance[(MUSCLE + k, MUSCLE + k)] += self.spread[k] * lost;
        }
        for (first, [variance, ceiling]) in [MUSCLE, DAMPING].into_iter().zip(self.awake) {
            for (axis, activity) in self.activity.into_iter().enumerate() {
                let k = first + axis;
                if covariance[(k, k)] < ceiling {
                    covariance[(k, k)] += variance * activity;
                }
            }
        }
        let kept = self.joint_kept * self.joint_kept;
        for axis in 0..3 {
            let k = RESIDUAL_MOMENT + axis;
            covariance[(k, k)] += self.turned[axis] * kept * self.joint_variance;
        }
        let lost = (one - kept) * self.joint_variance;
        for j in 0..6 {
            for i in 0..6 {
                covariance[(RESIDUAL_FORCE + i, RESIDUAL_FORCE + j)] +=
                    self.sensitivity[(i, j)] * lost;
            }
        }
    }
}

/// `exp(-x)` for small `x`, between 0 and 1 for any that is positive.
fn decay_over<T: Real>(x: T) -> T {
    let two = T::of(2.0);
    if x < two {
        (two - x) / (two + x)
    } else {
        T::zero()
    }
}

fn square<T: Real>(value: f32) -> T {
    T::single(value) * T::single(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_hardly_seen_may_be_done_on_purpose() {
        let process = Process::<f64>::new(&MOTION, 1.0 / 240.0).unwrap();
        let stated = |deviation: f64, activity: f64| {
            let known = deviation * deviation;
            (known + process.unnoticed(1, known, activity)).root()
        };
        // Nothing was seen: three, a quarter of the time.
        let unseen = stated(0.3, 0.0);
        assert!((1.4..1.6).contains(&unseen), "{unseen}");
        // What is known to a tenth is hardly less known, and an axis that is awake expects much already.
        let seen = stated(0.1, 0.0);
        assert!((0.1..0.103).contains(&seen), "{seen}");
        assert!((stated(1.0, 1.0) - 1.0).abs() < 1e-9);
        let mut last = 0.0;
        for k in 1..40 {
            let now = stated(0.1 * f64::from(k), 0.0);
            assert!(now >= last, "{k}: {now} after {last}");
            last = now;
        }
    }

    #[test]
    fn inputs_of_an_axis_that_is_awake_come_back_sooner() {
        let mut process = Process::<f64>::new(&MOTION, 1.0 / 240.0).unwrap();
        let quiet = process.decay();
        process.set_activity([0.0, 1.0, 0.0]);
        let awake = process.decay();
        for k in [1, 4] {
            assert!(awake[k] < 0.99 && quiet[k] > 0.997);
        }
        for k in [0, 2, 6] {
            assert!((awake[k] - quiet[k]).abs() < 1e-12);
        }
    }
}
