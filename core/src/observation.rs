//! Observable channels of a motion, in which simulation and measurement are compared.

use crate::dynamics::Motion;
use crate::frame::{AttitudeAngles, Body, Inertial, Vector};
use crate::math::Lanes;

/// The observable channels at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Deserialize, serde::Serialize))]
pub struct Observation<T: Lanes> {
    /// Heading, pitch and roll (rad), paper eq. (ypr).
    pub angles: AttitudeAngles<T>,
    /// Rate of rotation about the vertical, positive counter-clockwise seen from above (rad/s); equals the rate of the
    /// heading if the body is level, paper eq. (meas_turns).
    pub yaw_rate: T,
    /// Angular velocity in body axes (rad/s).
    pub angular_velocity: Vector<T, Body>,
    /// Speed over the ground (m/s), paper eq. (vel).
    pub horizontal_speed: T,
    /// Vertical velocity, positive up (m/s).
    pub vertical_velocity: T,
}

impl<T: Lanes> Observation<T> {
    /// Computes the channels of a motion.
    pub fn of(motion: &Motion<T>) -> Self {
        let spin = motion.inertial_from_body * motion.angular_velocity;
        let velocity = motion.velocity_inertial();
        Self {
            angles: AttitudeAngles::of(&motion.inertial_from_body),
            yaw_rate: spin.up(),
            angular_velocity: motion.angular_velocity,
            horizontal_speed: horizontal_speed(&velocity),
            vertical_velocity: velocity.up(),
        }
    }
}

/// Magnitude of the horizontal part of a velocity (m/s), paper eq. (vel).
pub fn horizontal_speed<T: Lanes>(velocity: &Vector<T, Inertial>) -> T {
    let (north, west) = (velocity.north(), velocity.west());
    (north * north + west * west).root()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{Rotation, facing_north};
    use nalgebra::{UnitQuaternion, Vector3};

    #[test]
    fn a_tilted_glide_is_recognised() {
        // Belly to earth, heading north, turned left by 0.3 rad, gliding north-west.
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 0.3);
        let attitude = Rotation::<_, Inertial, Inertial>::from_quaternion(turn)
            * facing_north(core::f64::consts::FRAC_PI_2);
        let motion = Motion {
            inertial_from_body: attitude,
            position: Vector::zero(),
            velocity: attitude.inverse() * Vector::<f64, Inertial>::new(3.0, 4.0, -50.0),
            angular_velocity: Vector::new(0.0, 1.5, 0.0),
        };
        let seen = Observation::of(&motion);
        assert!((seen.angles.heading - 0.3).abs() < 1e-12, "{seen:?}");
        assert!(
            seen.angles.pitch.abs() < 1e-12 && seen.angles.roll.abs() < 1e-12,
            "{seen:?}"
        );
        assert!((seen.yaw_rate - 1.5).abs() < 1e-12);
        assert!((seen.horizontal_speed - 5.0).abs() < 1e-12);
        assert!((seen.vertical_velocity + 50.0).abs() < 1e-12);
    }
}
