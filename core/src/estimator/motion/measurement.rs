//! Measurements of the motion: single channels, each with its derivative with respect to the error coordinates.

use nalgebra::{SVector, Vector3};

use super::sensors::{Barometer, Gyroscope, ReceiverVelocity, SpecificForce};
use super::state::{ATTITUDE, FlightState, MOTION_STATES, SPIN, STATES, VELOCITY, turn_between};
use crate::dynamics::Motion;
use crate::dynamics::interval::Interval;
use crate::frame::{Body, Inertial, Rotation, Vector};
use crate::math::Real;

/// Number of channels.
pub const CHANNELS: usize = 17;

/// Number of channels of a recording: attitude, angular velocity and velocity.
pub const RECORDED_CHANNELS: usize = 9;

/// The channels of the angular velocity: pitch, yaw, roll.
pub const RATE_CHANNELS: core::ops::Range<usize> = 3..6;

/// The channel of the horizontal speed.
pub const SPEED_CHANNEL: usize = 9;

/// The channels of a receiver's velocity: north, west, up.
pub const RECEIVER_CHANNELS: core::ops::Range<usize> = 10..13;

/// The channel of the barometer's vertical velocity.
pub const BAROMETER_CHANNEL: usize = 13;

/// The channels of the accelerometer: the three body axes.
pub const FORCE_CHANNELS: core::ops::Range<usize> = 14..17;

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
    "receiver_north_mps",
    "receiver_west_mps",
    "receiver_up_mps",
    "barometer_up_mps",
    "specific_force_pitch_mps2",
    "specific_force_yaw_mps2",
    "specific_force_roll_mps2",
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
    /// Returns the noise of sensors whose deviations are `factor` times as large.
    #[must_use]
    pub fn scaled(&self, factor: T) -> Self {
        Self {
            attitude: self.attitude * factor,
            angular_velocity: self.angular_velocity * factor,
            horizontal_velocity: self.horizontal_velocity * factor,
            vertical_velocity: self.vertical_velocity * factor,
            horizontal_speed: self.horizontal_speed * factor,
        }
    }

    /// Returns the variances of a motion measured at rest, in the order of the error coordinates.
    pub fn motion_variances(&self) -> [T; MOTION_STATES] {
        [0, 1, 2, 6, 7, 8, 3, 4, 5].map(|channel| self.variance(channel, &Vector3::zeros()))
    }

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
    /// Horizontal speed from GNSS (m/s). It has no direction, so it is used only if no velocity is measured.
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

    /// Returns the measurement of a suit: attitude, angular velocity and velocity of a motion.
    pub fn of(motion: &Motion<T>) -> Self {
        Self {
            inertial_from_body: Some(motion.inertial_from_body),
            angular_velocity: Some(motion.angular_velocity),
            velocity: Some(motion.velocity_inertial()),
            ..Self::none()
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

/// Everything measured at an instant; `None` for what was not.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensorMeasurement<T: Real> {
    /// Motion as a suit or an attitude sensor reports it.
    pub motion: MotionMeasurement<T>,
    /// Standard deviation of the attitude's error that lasts for seconds, each axis (rad), in addition to its noise. No mean
    /// removes it, so the error bars include it; zero for a suit.
    pub attitude_error: T,
    /// Whether the sensor is known to lie or stand still, so that the body is not in the air.
    pub is_still: bool,
    /// Velocity from a satellite receiver, fused at its own time.
    pub receiver: Option<ReceiverVelocity<T>>,
    /// Height or vertical velocity from a barometer.
    pub barometer: Option<Barometer<T>>,
    /// Angular velocity of a gyroscope, which is used if `motion` has none.
    pub gyroscope: Option<Gyroscope<T>>,
    /// Specific force of an accelerometer.
    pub specific_force: Option<SpecificForce<T>>,
}

/// Smallest standard deviation that a sensor may state, in the unit of its channel; a smaller one is taken as this.
const LEAST_DEVIATION: f32 = 0.02;

impl<T: Real> SensorMeasurement<T> {
    /// A measurement without any data.
    pub fn none() -> Self {
        MotionMeasurement::none().into()
    }

    /// Returns whether a channel's quantity was measured.
    pub fn measures(&self, channel: usize) -> bool {
        let motion = &self.motion;
        match channel {
            0..3 => motion.inertial_from_body.is_some(),
            3..6 => motion.angular_velocity.is_some() || self.gyroscope.is_some(),
            6..9 => motion.velocity.is_some(),
            SPEED_CHANNEL => motion.horizontal_speed.is_some(),
            10..13 => self.receiver.is_some(),
            BAROMETER_CHANNEL => self
                .barometer
                .is_some_and(|b| b.vertical_velocity.is_some()),
            _ => self.specific_force.is_some(),
        }
    }

    /// Returns whether a channel was measured but another says the same better.
    pub fn is_superseded(&self, channel: usize) -> bool {
        let velocity = self.motion.velocity.is_some() || self.receiver.is_some();
        channel == SPEED_CHANNEL && velocity
    }

    /// Returns whether a channel is one of a gyroscope as read, which is used if no angular velocity is measured.
    pub fn reads(&self, channel: usize) -> bool {
        let is_read = self.motion.angular_velocity.is_none() && self.gyroscope.is_some();
        RATE_CHANNELS.contains(&channel) && is_read
    }

    /// Returns the variance that the sensor of a channel states, if it states one.
    pub fn stated_variance(&self, channel: usize) -> Option<T> {
        let deviation = match channel {
            3..6 if self.motion.angular_velocity.is_none() => self.gyroscope?.deviation,
            10 | 11 => self.receiver?.horizontal_deviation,
            12 => self.receiver?.vertical_deviation,
            BAROMETER_CHANNEL => self.barometer?.vertical_velocity_deviation,
            14..17 => self.specific_force?.deviation,
            _ => return None,
        };
        // The comparison is false for NaN, so that the channel is then rejected.
        let least = T::single(LEAST_DEVIATION);
        let deviation = if deviation < least { least } else { deviation };
        Some(deviation * deviation)
    }

    /// Converts the values to another precision.
    pub fn cast<U: Real>(&self) -> SensorMeasurement<U> {
        SensorMeasurement {
            motion: self.motion.cast(),
            attitude_error: U::of(self.attitude_error.to_f64()),
            is_still: self.is_still,
            receiver: self.receiver.map(|receiver| receiver.cast()),
            barometer: self.barometer.map(|barometer| barometer.cast()),
            gyroscope: self.gyroscope.map(|gyroscope| gyroscope.cast()),
            specific_force: self.specific_force.map(|force| force.cast()),
        }
    }
}

impl<T: Real> From<MotionMeasurement<T>> for SensorMeasurement<T> {
    fn from(motion: MotionMeasurement<T>) -> Self {
        Self {
            motion,
            attitude_error: T::zero(),
            is_still: false,
            receiver: None,
            barometer: None,
            gyroscope: None,
            specific_force: None,
        }
    }
}

fn unit<T: Real>(axis: usize) -> Vector3<T> {
    let mut unit = Vector3::zeros();
    unit[axis] = T::one();
    unit
}

/// Largest velocity (m/s) and angular velocity (rad/s) of a measurement that is plausible.
const FASTEST: f32 = 128.0;
const FASTEST_SPIN: f32 = 35.0;

/// Returns `None` unless a vector is no longer than `largest`.
fn plausible<T: Real>(vector: &Vector3<T>, largest: f32) -> Option<()> {
    (vector.norm_squared() <= T::single(largest * largest)).then_some(())
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
    pub fn row(&self, channel: usize, sensors: &SensorMeasurement<T>) -> Option<Row<T>> {
        let measured = &sensors.motion;
        let mut slope = SVector::<T, 9>::zeros();
        let axis = channel % 3;
        let innovation = match channel {
            0..3 => {
                let attitude = measured.inertial_from_body?;
                slope[ATTITUDE + axis] = T::one();
                turn_between(&self.motion.inertial_from_body, &attitude)[axis]
            }
            3..6 => {
                let gyroscope = || sensors.gyroscope.map(|read| read.angular_velocity);
                let spin = measured.angular_velocity.or_else(gyroscope)?.components;
                slope[SPIN + axis] = T::one();
                plausible(&spin, FASTEST_SPIN)?;
                spin[axis] - self.motion.angular_velocity.components[axis]
            }
            6..9 => {
                let velocity = measured.velocity?.components;
                plausible(&velocity, FASTEST)?;
                self.velocity_slope(&unit(axis), &Vector3::zeros(), &mut slope);
                velocity[axis] - self.velocity[axis]
            }
            SPEED_CHANNEL => {
                let speed = measured.horizontal_speed?;
                if measured.velocity.is_some() || sensors.receiver.is_some() {
                    return None;
                }
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
                    &Vector3::zeros(),
                    &mut slope,
                );
                speed - predicted
            }
            10..13 => {
                let receiver = sensors.receiver?;
                plausible(&receiver.velocity.components, FASTEST)?;
                let axis = channel - RECEIVER_CHANNELS.start;
                let arm = receiver.arm.components;
                self.velocity_slope(&unit(axis), &arm, &mut slope);
                let spin = self.motion.angular_velocity.components;
                let predicted = self.velocity + self.rotation * spin.cross(&arm);
                receiver.velocity.components[axis] - predicted[axis]
            }
            BAROMETER_CHANNEL => {
                let up = sensors.barometer?.vertical_velocity?;
                self.velocity_slope(&unit(2), &Vector3::zeros(), &mut slope);
                up - self.velocity[2]
            }
            _ => return None,
        };
        innovation.is_finite().then_some(Row { innovation, slope })
    }

    /// Derivative of the velocity along an inertial direction of the point `arm` of the body: that of the centre of
    /// gravity, minus the contributions of rotation and limb motion.
    fn velocity_slope(&self, direction: &Vector3<T>, arm: &Vector3<T>, slope: &mut SVector<T, 9>) {
        let along = self.rotation.transpose() * direction;
        let spin = self.motion.angular_velocity.components;
        // -(turn x offset) . along, and -(spin x (cg - arm)) . along.
        let by_turn = -(self.offset - spin.cross(arm)).cross(&along);
        let by_spin = -(self.cg - arm).cross(&along);
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
            // A receiver elsewhere on the body, and a barometer, see the same motion.
            let flown = moved.motion.motion(&interval);
            let arm = Vector::new(0.1, -0.2, 0.4);
            let receiver = ReceiverVelocity {
                velocity: flown.velocity_inertial()
                    + flown.inertial_from_body * flown.angular_velocity.cross(&arm),
                horizontal_deviation: 0.2,
                vertical_deviation: 0.4,
                age: 0.0,
                arm,
            };
            let measured = SensorMeasurement {
                receiver: Some(receiver),
                barometer: Some(Barometer {
                    height: None,
                    height_deviation: 1.0,
                    vertical_velocity: Some(flown.velocity_inertial().up()),
                    vertical_velocity_deviation: 0.5,
                }),
                ..measured.into()
            };
            for (channel, name) in NAMES.iter().enumerate().take(BAROMETER_CHANNEL + 1) {
                if channel == SPEED_CHANNEL {
                    continue;
                }
                let row = prediction.row(channel, &measured).unwrap();
                let gap = (row.innovation - row.along(&difference)).abs();
                prop_assert!(gap < 4e-6, "{name}: {gap}");
            }
            // A speed has no direction, so it never replaces a velocity.
            let mut with_speed = measured;
            with_speed.motion.horizontal_speed = Some(speed);
            prop_assert!(prediction.row(SPEED_CHANNEL, &with_speed).is_none());
            prop_assert!(prediction.row(6, &with_speed).is_some());
            let only_speed = MotionMeasurement {
                horizontal_speed: Some(speed),
                ..MotionMeasurement::none()
            }
            .into();
            let row = prediction.row(SPEED_CHANNEL, &only_speed).unwrap();
            prop_assert!((row.innovation - row.along(&difference)).abs() < 2e-6);
        }
    }
}
