//! The process noise that follows from the settings at a given rate.

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

use super::measurement::Noise;
use super::settings::MotionPreset;
use super::state::{
    DAMPING, INPUT_STATES, MUSCLE, RESIDUAL_FORCE, RESIDUAL_MOMENT, SPIN, STATES, VELOCITY,
};
use crate::estimator::unscented::SettingsError;
use crate::math::{Lanes, Real};

/// Assumed share of time in which muscles act deliberately.
const ON_PURPOSE: f64 = 0.25;
/// Number of standard deviations at which deliberate input is noticed.
const NOTICED: f64 = 2.0;

/// Standard deviation of the muscle input that an unknown posture may appear to be: a belly fall taken for a person
/// standing upright with bent arms appears as up to 0.7.
const UNKNOWN_POSTURE: f64 = 0.6;

/// Evolution of the inputs over one interval: they decay to their mean and are driven by noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Process<T: Real> {
    centre: SVector<T, INPUT_STATES>,
    decay: SVector<T, INPUT_STATES>,
    /// Long-run variance of muscle input and damping.
    spread: SVector<T, 6>,
    /// Variance added per interval to velocity and angular velocity.
    motion: [T; 2],
    /// Variance added per interval to muscle input and damping of an awake axis, each with its ceiling.
    awake: [[T; 2]; 2],
    /// Activity of pitch, yaw and roll; one for an axis that has just woken up.
    activity: [T; 3],
    /// Decay of the distance from the mean per interval, as a share: of muscle input, of damping, and additionally of
    /// both for an awake axis.
    rates: [T; 3],
    /// Decay of the residual load, as a share per interval and per rotation of the airstream (1/rad).
    joint_rate: T,
    turn_rate: T,
    /// Variance of the joint errors (rad2).
    joint_variance: T,
    /// Variances of force (m4) and moment (m6) of an unknown posture, for joint errors of 1 rad.
    unknown: [T; 2],
    /// Share of the residual load that remains after an interval, allowing for time and rotation of the airstream.
    joint_kept: T,
    /// Covariance of the residual load for joint errors of 1 rad.
    sensitivity: SMatrix<T, 6, 6>,
    /// Part of the moment's variance that is due to the body's own rotation, and the variance added when it changes.
    turning: Vector3<T>,
    turned: Vector3<T>,
}

impl<T: Real> Process<T> {
    /// Creates the process for intervals of `duration` (s).
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
        let mut unknown = preset.unknown_load.iter();
        if !unknown.all(|load| load.is_finite() && *load >= 0.0) {
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
            unknown: preset
                .unknown_load
                .map(|load| square::<T>(load) / square(preset.joint_error)),
            joint_kept: joint,
            sensitivity: SMatrix::zeros(),
            turning: Vector3::zeros(),
            turned: Vector3::zeros(),
        })
    }

    /// Returns the mean to which the inputs decay.
    pub fn centre(&self) -> SVector<T, INPUT_STATES> {
        self.centre
    }

    /// Returns the share of the distance from the mean that remains after an interval.
    pub fn decay(&self) -> SVector<T, INPUT_STATES> {
        self.decay
    }

    /// Sets the covariance of the residual load for joint errors of 1 rad.
    pub fn set_sensitivity(&mut self, sensitivity: &SMatrix<T, 6, 6>) {
        self.sensitivity = *sensitivity;
        let [force, moment] = self.unknown;
        for axis in 0..3 {
            self.sensitivity[(axis, axis)] += force;
            self.sensitivity[(3 + axis, 3 + axis)] += moment;
        }
    }

    /// Sets the rotation of the airstream relative to the body in this interval (rad): the effect of joint errors on
    /// the loads changes with the direction of the airstream.
    pub fn set_turn(&mut self, turn: T) {
        self.joint_kept = decay_over(self.joint_rate + turn * self.turn_rate);
        for k in RESIDUAL_FORCE - MUSCLE..INPUT_STATES {
            self.decay[k] = self.joint_kept;
        }
        self.turned = Vector3::zeros();
    }

    /// Adds the moment that the body's own rotation requires to the covariance of the residual load; `covariance` is
    /// for joint errors of 1 rad. Call it after [`Process::set_sensitivity`] and [`Process::set_turn`].
    ///
    /// If the body rotates faster than before, the additional moment increases the variance; if it rotates slower, the
    /// residual moment decays to its expected share.
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

    /// Sets the degree to which each axis is moved deliberately, 0 to 1: pitch, yaw, roll.
    pub fn set_activity(&mut self, activity: [T; 3]) {
        self.activity = activity;
        let [muscle, damping, awake] = self.rates;
        for (axis, activity) in activity.into_iter().enumerate() {
            self.decay[axis] = decay_over(muscle + activity * awake);
            self.decay[DAMPING - MUSCLE + axis] = decay_over(damping + activity * awake);
        }
    }

    /// Degree to which each axis is moved deliberately in this interval, 0 to 1: pitch, yaw, roll.
    pub fn activity(&self) -> [T; 3] {
        self.activity
    }

    /// Returns the standard deviations to publish. These variances cover quiet input only, so where an input is poorly
    /// observed, the variance of deliberate input that could go unnoticed is added.
    ///
    /// If the posture is not known, loads of the actual posture may appear as muscle input.
    pub fn stated(
        &self,
        variance: &SVector<T, STATES>,
        unknown_posture: bool,
    ) -> SVector<T, STATES> {
        let mut variance = *variance;
        for axis in 0..3 {
            let known = variance[MUSCLE + axis];
            variance[MUSCLE + axis] = known + self.unnoticed(axis, known, self.activity[axis]);
            if unknown_posture {
                variance[MUSCLE + axis] += T::of(UNKNOWN_POSTURE * UNKNOWN_POSTURE);
            }
        }
        variance.map(Lanes::root)
    }

    /// Returns the variance of deliberate muscle input that goes unnoticed about an axis with this `activity` (0 to
    /// 1), if quiet input has the variance `known`.
    ///
    /// Let `left` be the ratio of `known` to the variance of quiet input. The measurements then contributed the
    /// information `(1 - left) / known`, and the estimate falls short of an input by the share `left`. An input larger
    /// than a few standard deviations of what was measured wakes the axis up.
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

    /// Returns the variance of deliberate muscle input about an axis that a constant error of the posture hides. `per_moment`
    /// is the input that turns the body as a residual moment of 1 m3 does.
    ///
    /// A push as large as a few standard deviations of the residual moment looks like the posture when the air or the
    /// spin changes, whether the axis is awake or not.
    pub fn hidden(&self, axis: usize, per_moment: T) -> T {
        let variance = self.sensitivity[(3 + axis, 3 + axis)] * self.joint_variance;
        let size = T::of(NOTICED * NOTICED) * variance * per_moment * per_moment;
        let [_, largest] = self.awake[0];
        // The comparison is false for NaN.
        T::of(ON_PURPOSE) * if size < largest { size } else { largest }
    }

    /// Returns the standard deviation of the joints (rad).
    pub fn joint_deviation(&self) -> T {
        self.joint_variance.root()
    }

    /// Returns the long-run covariance of the residual load.
    pub fn residual_covariance(&self) -> SMatrix<T, 6, 6> {
        self.sensitivity * self.joint_variance
    }

    /// Returns the long-run variances of muscle input and damping.
    pub fn spread(&self) -> SVector<T, 6> {
        self.spread
    }

    /// Returns the initial covariance for a motion measured with these errors and inputs that are not yet observed.
    pub fn start(&self, noise: &Noise<T>) -> SMatrix<T, STATES, STATES> {
        let mut covariance = SMatrix::<T, STATES, STATES>::zeros();
        for (k, variance) in noise.motion_variances().into_iter().enumerate() {
            covariance[(k, k)] = variance;
        }
        for k in 0..6 {
            covariance[(MUSCLE + k, MUSCLE + k)] = self.spread[k];
        }
        covariance
            .fixed_view_mut::<6, 6>(RESIDUAL_FORCE, RESIDUAL_FORCE)
            .copy_from(&self.residual_covariance());
        covariance
    }

    /// Variance added per interval to each component of the velocity and of the angular velocity.
    pub fn motion_noise(&self) -> [T; 2] {
        self.motion
    }

    /// Variance added in this interval to a coordinate of muscle input (0 to 2) or damping (3 to 5) whose variance is
    /// `present`.
    pub fn input_noise(&self, k: usize, present: T) -> T {
        let lost = T::one() - self.decay[k] * self.decay[k];
        let quiet = self.spread[k] * lost;
        let [variance, ceiling] = self.awake[k / 3];
        if present + quiet < ceiling {
            quiet + variance * self.activity[k % 3]
        } else {
            quiet
        }
    }

    /// Covariance added in this interval to the residual load.
    pub fn residual_noise(&self) -> SMatrix<T, 6, 6> {
        let kept = self.joint_kept * self.joint_kept;
        let mut noise = self.sensitivity * ((T::one() - kept) * self.joint_variance);
        for axis in 0..3 {
            noise[(3 + axis, 3 + axis)] += self.turned[axis] * kept * self.joint_variance;
        }
        noise
    }

    /// Adds the process noise of one interval.
    pub fn add_noise(&self, covariance: &mut SMatrix<T, STATES, STATES>) {
        for (first, variance) in [VELOCITY, SPIN].into_iter().zip(self.motion) {
            for k in first..first + 3 {
                covariance[(k, k)] += variance;
            }
        }
        for k in 0..6 {
            let noise = self.input_noise(k, covariance[(MUSCLE + k, MUSCLE + k)]);
            covariance[(MUSCLE + k, MUSCLE + k)] += noise;
        }
        let mut residual = covariance.fixed_view_mut::<6, 6>(RESIDUAL_FORCE, RESIDUAL_FORCE);
        residual += self.residual_noise();
    }
}

/// `exp(-x)` for small `x`; between 0 and 1 for any positive `x`.
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
    use super::super::settings::MOTION;
    use super::*;

    #[test]
    fn poorly_observed_inputs_may_be_large() {
        let process = Process::<f64>::new(&MOTION, 1.0 / 240.0).unwrap();
        let stated = |deviation: f64, activity: f64| {
            let known = deviation * deviation;
            (known + process.unnoticed(1, known, activity)).root()
        };
        // With nothing observed: as uncertain as an input of three during a quarter of the time.
        let unseen = stated(0.3, 0.0);
        assert!((1.4..1.6).contains(&unseen), "{unseen}");
        // An input known to a tenth becomes hardly less certain, and an awake axis already expects large inputs.
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
    fn a_wrong_posture_hides_inputs_up_to_the_largest() {
        let mut process = Process::<f64>::new(&MOTION, 1.0 / 240.0).unwrap();
        // A standard deviation of 0.2 m3 for joint errors of 2 degrees.
        let share = 0.2 / process.joint_deviation();
        process.set_sensitivity(&(SMatrix::identity() * (share * share)));
        let hidden = |per_moment: f64| process.hidden(1, per_moment).root();
        // Twice that in a quarter of the time, and never more than deliberate inputs are.
        assert!((hidden(2.0) - 0.4).abs() < 1e-9);
        assert!((hidden(100.0) - 0.5 * f64::from(MOTION.awake[0])).abs() < 1e-9);
        assert!((hidden(f64::NAN) - hidden(100.0)).abs() < 1e-12 && hidden(0.0).abs() < 1e-12);
    }

    #[test]
    fn inputs_of_an_awake_axis_decay_faster() {
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
