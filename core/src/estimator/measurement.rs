//! The quantities whose measured and predicted values the filter compares, channel by channel, with the paper's noise.
//!
//! A [`MeasurementModel`] is data: a list of quantities with their standard deviations. Angles are compared by their
//! wrapped differences to an anchor, never by their raw values.

use nalgebra::{SVector, Vector3};

use crate::dynamics::Motion;
use crate::frame::{AttitudeAngles, Vector};
use crate::math::{Real, wrap_angle};
use crate::observation::horizontal_speed;

/// Maximum number of channels of a measurement.
pub const CHANNELS: usize = 4;

/// A quantity that can be measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// Speed of the pelvic joint over the ground (m/s), paper eq. (vel).
    HorizontalSpeed,
    /// Heading of the cranial axis (rad), paper eq. (ypr).
    Heading,
    /// Elevation of the cranial axis above the horizon (rad), paper eq. (ypr).
    Pitch,
    /// Roll (rad), 0 when level and belly to earth, paper eq. (ypr).
    Roll,
    /// Rate of the heading (rad/s), paper eq. (meas_turns).
    YawRate,
    /// Vertical velocity of the pelvic joint (m/s), positive up; not used in the paper.
    VerticalVelocity,
    /// Component of the unit vertical along the body's X axis, see [`Measurement::vertical`]: 1 with the left side up.
    VerticalLeft,
    /// Component of the unit vertical along the body's Y axis: 1 belly to earth, -1 back to earth.
    VerticalDorsal,
    /// Component of the unit vertical along the body's Z axis: 1 upright, -1 head down.
    VerticalCranial,
}

impl Quantity {
    /// Name used in tables and files, with the unit.
    pub const fn name(self) -> &'static str {
        match self {
            Self::HorizontalSpeed => "v_hor_mps",
            Self::Heading => "heading_rad",
            Self::Pitch => "pitch_rad",
            Self::Roll => "roll_rad",
            Self::YawRate => "yaw_rate_radps",
            Self::VerticalVelocity => "v_vert_mps",
            Self::VerticalLeft => "vertical_left",
            Self::VerticalDorsal => "vertical_dorsal",
            Self::VerticalCranial => "vertical_cranial",
        }
    }

    /// Returns whether the quantity is an angle, for which values a full turn apart are equal.
    pub const fn is_angle(self) -> bool {
        matches!(self, Self::Heading | Self::Pitch | Self::Roll)
    }

    /// Magnitude (SI) beyond which a value is implausible.
    pub const fn limit(self) -> f32 {
        match self {
            Self::HorizontalSpeed | Self::VerticalVelocity => 120.0,
            // Headings may be unwrapped, up to ten turns either way.
            Self::Heading | Self::Pitch | Self::Roll => 20.0 * core::f32::consts::PI,
            Self::YawRate => 35.0,
            // Noise may lengthen a unit vector.
            Self::VerticalLeft | Self::VerticalDorsal | Self::VerticalCranial => 1.5,
        }
    }
}

/// One value for each quantity, either measured or predicted from a motion; NaN where unknown.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measurement<T> {
    /// Speed over the ground (m/s).
    pub horizontal_speed: T,
    /// Heading (rad).
    pub heading: T,
    /// Pitch (rad).
    pub pitch: T,
    /// Roll (rad).
    pub roll: T,
    /// Rate of the heading (rad/s).
    pub yaw_rate: T,
    /// Vertical velocity, positive up (m/s).
    pub vertical_velocity: T,
    /// Direction of the vertical, positive up, in body axes (unit vector). It contains pitch and roll without the
    /// heading, and without the jump of the roll where the cranial axis passes the vertical. Not used in the paper.
    pub vertical: Vector3<T>,
}

impl<T: Real> Measurement<T> {
    /// Computes what sensors would measure of a motion, paper eqs. (xyz) to (vel).
    pub fn of(motion: &Motion<T>) -> Self {
        let AttitudeAngles {
            heading,
            pitch,
            roll,
        } = AttitudeAngles::of(&motion.inertial_from_body);
        let velocity = motion.velocity_inertial();
        Self {
            horizontal_speed: horizontal_speed(&velocity),
            heading,
            pitch,
            roll,
            yaw_rate: heading_rate(motion),
            vertical_velocity: velocity.up(),
            vertical: motion
                .inertial_from_body
                .quaternion()
                .inverse_transform_vector(&Vector3::z()),
        }
    }

    /// A measurement in which every value is unknown.
    pub fn none() -> Self {
        let unknown = T::single(f32::NAN);
        Self {
            horizontal_speed: unknown,
            heading: unknown,
            pitch: unknown,
            roll: unknown,
            yaw_rate: unknown,
            vertical_velocity: unknown,
            vertical: Vector3::repeat(unknown),
        }
    }

    /// Returns the value of one quantity.
    pub fn value(&self, quantity: Quantity) -> T {
        match quantity {
            Quantity::HorizontalSpeed => self.horizontal_speed,
            Quantity::Heading => self.heading,
            Quantity::Pitch => self.pitch,
            Quantity::Roll => self.roll,
            Quantity::YawRate => self.yaw_rate,
            Quantity::VerticalVelocity => self.vertical_velocity,
            Quantity::VerticalLeft => self.vertical.x,
            Quantity::VerticalDorsal => self.vertical.y,
            Quantity::VerticalCranial => self.vertical.z,
        }
    }

    /// Converts the values to another precision.
    pub fn cast<U: Real>(&self) -> Measurement<U> {
        let scalar = |value: T| U::of(value.to_f64());
        Measurement {
            horizontal_speed: scalar(self.horizontal_speed),
            heading: scalar(self.heading),
            pitch: scalar(self.pitch),
            roll: scalar(self.roll),
            yaw_rate: scalar(self.yaw_rate),
            vertical_velocity: scalar(self.vertical_velocity),
            vertical: self.vertical.map(scalar),
        }
    }
}

/// Rate of the heading (rad/s), from attitude and angular velocity, without numerical differentiation.
///
/// The cranial axis moves at `spin x axis`, and the heading is the direction of its horizontal part. Near the
/// vertical, where the heading is undefined, a lower bound on the horizontal part (3 degrees) keeps the rate finite.
pub fn heading_rate<T: Real>(motion: &Motion<T>) -> T {
    let spin = motion.inertial_from_body * motion.angular_velocity;
    let cranial = Vector::new(T::zero(), T::zero(), T::one());
    let axis = motion.inertial_from_body * cranial;
    let rate = spin.cross(&axis);
    let horizontal = axis.x() * axis.x() + axis.y() * axis.y();
    let floor = T::of(0.003);
    let horizontal = if horizontal > floor {
        horizontal
    } else {
        floor
    };
    (axis.x() * rate.y() - axis.y() * rate.x()) / horizontal
}

/// A list of quantities with their standard deviations (SI), in the order of the measurement vector.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeasurementModel {
    /// Channels in use; the remaining elements of the vector stay zero.
    pub channels: [Option<(Quantity, f32)>; CHANNELS],
}

/// Tracking, paper eq. (meas).
pub const TRACKING: MeasurementModel = MeasurementModel {
    channels: [
        Some((Quantity::HorizontalSpeed, 0.1)),
        Some((Quantity::Heading, 0.05)),
        Some((Quantity::Pitch, 0.01)),
        Some((Quantity::Roll, 0.01)),
    ],
};

/// Transitions, paper eq. (meas_flips): without satellite data, so the heading has a standard deviation of 1.5 rad.
pub const TRANSITIONS: MeasurementModel = MeasurementModel {
    channels: [
        Some((Quantity::Heading, 1.5)),
        Some((Quantity::Pitch, 0.01)),
        Some((Quantity::Roll, 0.01)),
        None,
    ],
};

/// Transitions with satellite data: horizontal speed as in tracking, and vertical velocity with the paper's 1 m/s.
/// Without them nothing constrains the fall speed, and the muscle forces would make it drift.
pub const TRANSITIONS_WITH_GNSS: MeasurementModel = MeasurementModel {
    channels: [
        Some((Quantity::VerticalVelocity, 1.0)),
        Some((Quantity::HorizontalSpeed, 0.1)),
        Some((Quantity::Pitch, 0.01)),
        Some((Quantity::Roll, 0.01)),
    ],
};

/// The vertical in body axes, for flips. In the angles of [`TRANSITIONS`] a flip appears as a jump of half a turn, from
/// which the filter cannot tell its direction or extent.
pub const VERTICAL: MeasurementModel = MeasurementModel {
    channels: [
        Some((Quantity::VerticalLeft, 0.01)),
        Some((Quantity::VerticalDorsal, 0.01)),
        Some((Quantity::VerticalCranial, 0.01)),
        None,
    ],
};

/// Turning, paper eq. (meas_turns).
pub const TURNING: MeasurementModel = MeasurementModel {
    channels: [
        Some((Quantity::YawRate, 0.01)),
        Some((Quantity::Pitch, 0.01)),
        Some((Quantity::Roll, 0.01)),
        None,
    ],
};

impl MeasurementModel {
    /// Iterates over the quantities in use.
    pub fn quantities(&self) -> impl Iterator<Item = Quantity> {
        let channels = self.channels.into_iter().flatten();
        channels.map(|(quantity, _)| quantity)
    }

    /// Returns the measurement vector, with zero in unused channels.
    pub fn vector<T: Real>(&self, values: &Measurement<T>) -> SVector<T, CHANNELS> {
        SVector::from(self.channels.map(|channel| match channel {
            Some((quantity, _)) => values.value(quantity),
            None => T::zero(),
        }))
    }

    /// Returns the diagonal of R, with one in unused channels.
    pub fn noise<T: Real>(&self) -> SVector<T, CHANNELS> {
        SVector::from(self.channels.map(|channel| {
            let deviation = channel.map_or(1.0, |(_, deviation)| deviation);
            T::single(deviation) * T::single(deviation)
        }))
    }

    /// Returns which channels hold a plausible value.
    pub fn usable<T: Real>(&self, values: &Measurement<T>) -> [bool; CHANNELS] {
        self.channels.map(|channel| {
            channel.is_some_and(|(quantity, _)| {
                // The comparison is false for NaN.
                values.value(quantity).abs() <= T::single(quantity.limit())
            })
        })
    }

    /// Computes `values - anchor`, with differences of angles taken the shorter way round.
    pub fn difference<T: Real>(
        &self,
        values: &SVector<T, CHANNELS>,
        anchor: &SVector<T, CHANNELS>,
    ) -> SVector<T, CHANNELS> {
        let mut difference = values - anchor;
        for (value, channel) in difference.iter_mut().zip(self.channels) {
            if channel.is_some_and(|(quantity, _)| quantity.is_angle()) {
                *value = wrap_angle(*value);
            }
        }
        difference
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{Rotation, Vector};
    use crate::math::small_rotation;
    use nalgebra::UnitQuaternion;
    use proptest::prelude::*;

    fn motion(attitude: UnitQuaternion<f64>, spin: Vector3<f64>) -> Motion<f64> {
        Motion {
            inertial_from_body: Rotation::from_quaternion(attitude),
            position: Vector::zero(),
            velocity: Vector::new(10.0, -40.0, 20.0),
            angular_velocity: Vector::from_components(spin),
        }
    }

    proptest! {
        #[test]
        fn yaw_rate_is_the_slope_of_the_heading(
            turn in prop::array::uniform3(-3.0f64..3.0),
            spin in prop::array::uniform3(-6.0f64..6.0),
        ) {
            let attitude = UnitQuaternion::from_scaled_axis(Vector3::from(turn));
            let (spin, time) = (Vector3::from(spin), 1e-6);
            let later = attitude * small_rotation(&(spin * time));
            let (now, then) = (motion(attitude, spin), motion(later, spin));
            let [a, b] = [&now, &then].map(Measurement::of);
            prop_assume!(a.pitch.abs() < 1.4);
            let slope = wrap_angle(b.heading - a.heading) / time;
            prop_assert!((slope - a.yaw_rate).abs() < 1e-3 * (1.0 + slope.abs()), "{} {}", slope, a.yaw_rate);
        }

        #[test]
        fn differences_do_not_see_full_turns(angle in -3.0f64..3.0, turns in -3i8..3) {
            let near = SVector::from([0.0, angle, 0.1, angle]);
            let far = near.map(|a| a + f64::from(turns) * core::f64::consts::TAU);
            let mut far = TRACKING.difference(&far, &near);
            far[0] = 0.0;
            prop_assert!(far.norm() < 1e-9);
        }
    }

    #[test]
    fn implausible_values_are_not_used() {
        let mut values = Measurement::of(&motion(UnitQuaternion::identity(), Vector3::zeros()));
        assert_eq!(TRACKING.usable(&values), [true; 4]);
        assert_eq!(TURNING.usable(&values), [true, true, true, false]);
        values.heading = f64::NAN;
        values.horizontal_speed = 1e30;
        assert_eq!(TRACKING.usable(&values), [false, false, true, true]);
    }

    #[test]
    fn the_rate_of_a_vertical_axis_is_finite() {
        // Head up, where the heading is undefined.
        let upright = motion(UnitQuaternion::identity(), Vector3::new(2.0, 3.0, 4.0));
        assert!(heading_rate(&upright).is_finite());
    }
}
