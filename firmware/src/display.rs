//! The motion of the pelvis in integers, for logs and displays on the unit.
//!
//! Square roots are micromath's, which are fast but up to 6 % off; no result here is used by the filter.

use bodyflight_core::frame::AttitudeAngles;
use bodyflight_core::link::Sample;
use micromath::F32Ext;

/// Motion rounded for display.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Glance {
    /// Heading (deg).
    pub heading: i16,
    /// Pitch (deg).
    pub pitch: i16,
    /// Roll (deg).
    pub roll: i16,
    /// Magnitude of the angular velocity (deg/s), to 6 %; 0 if not measured.
    pub turn: i16,
}

impl Glance {
    /// Converts the motion of a sample.
    pub fn of(sample: &Sample) -> Self {
        let AttitudeAngles {
            heading,
            pitch,
            roll,
        } = AttitudeAngles::of(&sample.inertial_from_body());
        let turn = sample.motion().angular_velocity;
        let square = turn.map_or(0.0, |turn| turn.norm_squared());
        Self {
            heading: degrees(heading),
            pitch: degrees(pitch),
            roll: degrees(roll),
            // Called by its path, since the standard library's own method takes precedence where it is linked.
            turn: degrees(F32Ext::sqrt(square)),
        }
    }
}

#[expect(clippy::cast_possible_truncation, reason = "saturates, for display")]
fn degrees(angle: f32) -> i16 {
    F32Ext::round(angle.to_degrees()) as i16
}

#[cfg(test)]
mod tests {
    use super::*;
    use bodyflight_core::Posture;
    use bodyflight_core::frame::{Inertial, Rotation, Vector, facing_north};
    use bodyflight_core::link::Motion;
    use nalgebra::{UnitQuaternion, Vector3};

    #[test]
    fn the_display_shows_a_turn_on_the_belly() {
        // Belly to earth with the head to the north, where the heading is zero; then a turn to the left.
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 0.524);
        let attitude = Rotation::<_, Inertial, Inertial>::from_quaternion(turn)
            * facing_north(core::f32::consts::FRAC_PI_2);
        let motion = Motion {
            angular_velocity: Some(Vector::new(0.0, 3.0, 0.0)),
            ..Motion::default()
        };
        let sample = Sample::new(&Posture::h_pose(), &attitude, &motion);
        let glance = Glance::of(&sample);
        assert!((162..=182).contains(&glance.turn), "{glance:?}");
        assert_eq!((glance.heading, glance.pitch, glance.roll), (30, 0, 0));
    }
}
