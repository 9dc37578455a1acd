//! Measurements of the motion: single channels, each with its derivative with respect to the error coordinates.

use nalgebra::{SVector, Vector3};

use super::state::{ATTITUDE, FlightState, SPIN, STATES, VELOCITY, turn_between};
use crate::dynamics::Motion;
use crate::dynamics::interval::Interval;
use crate::frame::{Body, Inertial, Rotation, Vector};
use crate::math::Real;

/// Number of channels.
pub const CHANNELS: usize = 10;

/// The channels of the angular velocity: pitch, yaw, roll.
pub const RATE_CHANNELS: core::ops::Range<usize> = 3..6;

/// Names of the channels in files, with their units.
pub const NAMES: [&str; CHANNELS] = [
    "attitude_pitch_rad",
    "attitude_yaw_rad",
    "attitude_roll_rad",
    "rate_pitch_radps",
    "rate_yaw_radps",
    "rate_roll_radps",
    "velocity_north_mps",
    "velocity_west_mps",
    "velocity_up_mps",
    "horizontal_speed_mps",
];

/// Standard deviations of the sensors; larger values give the measurements less weight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise<T> {
    /// Attitude, each axis (rad).
    pub attitude: T,
    /// Angular velocity, each axis (rad/s).
    pub angular_velocity: T,
    /// Horizontal velocity, each axis (m/s).
    pub horizontal_velocity: T,
    /// Vertical velocity (m/s).
    pub vertical_velocity: T,
    /// Horizontal speed from GNSS (m/s).
    pub horizontal_speed: T,
}

impl Noise<f32> {
    /// Converts the values to the precision of the filter.
    pub fn of<T: Real>(&self) -> Noise<T> {
        Noise {
            attitude: T::single(self.attitude),
            angular_velocity: T::single(self.angular_velocity),
            horizontal_velocity: T::single(self.horizontal_velocity),
            vertical_velocity: T::single(self.vertical_velocity),
            horizontal_speed: T::single(self.horizontal_speed),
        }
    }
}

impl<T: Real> Noise<T> {
    /// Returns the variance of a channel for a body rotating at `spin` (rad/s, body axes).
    ///
    /// Recordings give the angular velocity in inertial axes. The measured attitude rotates it into body axes, so an
    /// attitude error `n` adds an error of `n x spin`, which in a fast turn exceeds the noise of the gyroscopes.
    #[inline]
    pub fn variance(&self, channel: usize, spin: &Vector3<T>) -> T {
        let deviation = match channel {
            0..3 => self.attitude,
            3..6 => self.angular_velocity,
            6 | 7 => self.horizontal_velocity,
            8 => self.vertical_velocity,
            _ => self.horizontal_speed,
        };
        let own = deviation * deviation;
        if RATE_CHANNELS.contains(&channel) {
            let along = spin[channel - RATE_CHANNELS.start];
            let across = spin.norm_squared() - along * along;
            return own + self.attitude * self.attitude * across;
        }
        own
    }
}

/// Sensor data of one instant; `None` for a quantity that was not measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotionMeasurement<T: Real> {
    /// Attitude of the body frame.
    pub inertial_from_body: Option<Rotation<T, Inertial, Body>>,
    /// Angular velocity in body axes (rad/s).
    pub angular_velocity: Option<Vector<T, Body>>,
    /// Velocity of the pelvic joint over the ground (m/s).
    pub velocity: Option<Vector<T, Inertial>>,
    /// Horizontal speed from GNSS (m/s). If present, it is used instead of the horizontal part of the velocity.
    pub horizontal_speed: Option<T>,
}

impl<T: Real> MotionMeasurement<T> {
    /// A measurement without any data.
    pub fn none() -> Self {
        Self {
            inertial_from_body: None,
            angular_velocity: None,
            velocity: None,
            horizontal_speed: None,
        }
    }

    /// Returns a complete measurement of a motion.
    pub fn of(motion: &Motion<T>) -> Self {
        Self {
            inertial_from_body: Some(motion.inertial_from_body),
            angular_velocity: Some(motion.angular_velocity),
            velocity: Some(motion.velocity_inertial()),
            horizontal_speed: None,
        }
    }
}

impl<T: Real> MotionMeasurement<T> {
    /// Converts the values to another precision.
    pub fn cast<U: Real>(&self) -> MotionMeasurement<U> {
        MotionMeasurement {
            inertial_from_body: self.inertial_from_body.map(|attitude| attitude.cast()),
            angular_velocity: self.angular_velocity.map(|spin| spin.cast()),
            velocity: self.velocity.map(|velocity| velocity.cast()),
            horizontal_speed: self.horizontal_speed.map(|speed| U::of(speed.to_f64())),
        }
    }
}

/// A channel at a given state: innovation, and derivative of the prediction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Row<T: Real> {
    /// Measured minus predicted.
    pub innovation: T,
    /// Derivative of the prediction with respect to the error coordinates of attitude, velocity and angular velocity.
    pub slope: SVector<T, 9>,
}

impl<T: Real> Row<T> {
    /// Returns the derivative times a vector of error coordinates.
    #[inline]
    pub fn along(&self, difference: &SVector<T, STATES>) -> T {
        let mut sum = T::zero();
        for k in 0..9 {
            sum += self.slope[k] * difference[k];
        }
        sum
    }
}

/// The prediction of a state, against which channels are compared.
#[derive(Debug, Clone, Copy)]
pub struct Prediction<T: Real> {
    /// The motion of the pelvic joint.
    pub motion: Motion<T>,
    velocity: Vector3<T>,
    rotation: nalgebra::Matrix3<T>,
    /// Velocity of the centre of gravity relative to the pelvic joint, in body axes, for the derivative with respect to
    /// the attitude.
    offset: Vector3<T>,
    cg: Vector3<T>,
}

impl<T: Real> Prediction<T> {
    /// Predicts from a state in the posture of `interval`.
    pub fn of(state: &FlightState<T>, interval: &impl Interval<T>) -> Self {
        let motion = state.motion.motion(interval);
        Self {
            velocity: motion.velocity_inertial().components,
            rotation: motion
                .inertial_from_body
                .quaternion()
                .to_rotation_matrix()
                .into_inner(),
            offset: (motion.angular_velocity.cross(&interval.cg()) + interval.cg_rate()).components,
            cg: interval.cg().components,
            motion,
        }
    }

    /// Compares a channel with its measurement; `None` if it was not measured or is not plausible.
    pub fn row(&self, channel: usize, measured: &MotionMeasurement<T>) -> Option<Row<T>> {
        let mut slope = SVector::<T, 9>::zeros();
        let axis = channel % 3;
        let innovation = match channel {
            0..3 => {
                let attitude = measured.inertial_from_body?;
                slope[ATTITUDE + axis] = T::one();
                turn_between(&self.motion.inertial_from_body, &attitude)[axis]
            }
            3..6 => {
                let spin = measured.angular_velocity?.components;
                slope[SPIN + axis] = T::one();
                spin[axis] - self.motion.angular_velocity.components[axis]
            }
            6..9 => {
                if axis < 2 && measured.horizontal_speed.is_some() {
                    return None;
                }
                let mut direction = Vector3::zeros();
                direction[axis] = T::one();
                self.velocity_slope(&direction, &mut slope);
                measured.velocity?.components[axis] - self.velocity[axis]
            }
            _ => {
                let speed = measured.horizontal_speed?;
                let [x, y] = [self.velocity.x, self.velocity.y];
                let predicted = (x * x + y * y).root();
                // In a vertical fall the horizontal speed has no direction along which to differentiate.
                let inverse = if predicted > T::of(0.1) {
                    T::one() / predicted
                } else {
                    T::zero()
                };
                self.velocity_slope(
                    &Vector3::new(x * inverse, y * inverse, T::zero()),
                    &mut slope,
                );
                speed - predicted
            }
        };
        innovation.is_finite().then_some(Row { innovation, slope })
    }

    /// Derivative of the pelvic joint's velocity along an inertial direction: that of the centre of gravity, minus the
    /// contributions of rotation and limb motion.
    fn velocity_slope(&self, direction: &Vector3<T>, slope: &mut SVector<T, 9>) {
        let along = self.rotation.transpose() * direction;
        // -(turn x offset) . along, and -(spin x cg) . along.
        let by_turn = -self.offset.cross(&along);
        let by_spin = -self.cg.cross(&along);
        for k in 0..3 {
            slope[ATTITUDE + k] = by_turn[k];
            slope[VELOCITY + k] = direction[k];
            slope[SPIN + k] = by_spin[k];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::pattern;
    use crate::dynamics::{Dynamics, Inputs, State};
    use crate::test_body::reference_body;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_slope_of_a_channel_is_its_derivative(
            q in prop::array::uniform4(-1.0f64..1.0),
            moving in prop::array::uniform6(-6.0f64..6.0),
            error in prop::array::uniform9(-1.0f64..1.0),
        ) {
            let Some(inertial_from_body) = Rotation::from_wxyz(q) else {
                return Ok(());
            };
            let dynamics = Dynamics::paper(reference_body(), 1.0);
            let interval = dynamics.hold(&pattern::neutral());
            let motion = Motion {
                inertial_from_body,
                position: Vector::zero(),
                velocity: Vector::new(moving[0], moving[1] - 45.0, moving[2]),
                angular_velocity: Vector::new(moving[3], moving[4], moving[5]),
            };
            let state = FlightState {
                motion: State::from_motion(&motion, &interval),
                inputs: Inputs::belly_turn(),
            };
            let mut difference = SVector::<f64, STATES>::zeros();
            for (k, value) in error.into_iter().enumerate() {
                difference[k] = value * 1e-4;
            }
            let moved = state.moved(&difference, &interval);
            let measured = MotionMeasurement {
                horizontal_speed: None,
                ..MotionMeasurement::of(&moved.motion.motion(&interval))
            };
            let speed = crate::observation::horizontal_speed(&measured.velocity.unwrap());
            prop_assume!(speed > 1.0);
            let prediction = Prediction::of(&state, &interval);
            for (channel, name) in NAMES.iter().enumerate().take(CHANNELS - 1) {
                let row = prediction.row(channel, &measured).unwrap();
                let gap = (row.innovation - row.along(&difference)).abs();
                prop_assert!(gap < 2e-6, "{name}: {gap}");
            }
            let with_speed = MotionMeasurement { horizontal_speed: Some(speed), ..measured };
            let row = prediction.row(CHANNELS - 1, &with_speed).unwrap();
            prop_assert!((row.innovation - row.along(&difference)).abs() < 2e-6);
            // GNSS speed replaces the horizontal part of the velocity.
            prop_assert!(prediction.row(6, &with_speed).is_none());
            prop_assert!(prediction.row(8, &with_speed).is_some());
        }
    }
}
