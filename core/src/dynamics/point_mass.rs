//! A body without posture, for falls of which only GNSS data are known.
//!
//! Drag acts against the velocity through the air on the drag area of a posture held belly to earth. Lift and moments,
//! which depend on attitude and posture, are omitted.

use super::Dynamics;
use super::trim::belly_drag_area;
use crate::Posture;
use crate::air::Air;
use crate::frame::{Inertial, Vector};
use crate::math::Real;

/// A falling body without posture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointMass<T: Real> {
    /// Density and velocity of the air.
    pub air: Air<T>,
    /// Area times drag coefficient (m2); a larger value lowers the terminal speed.
    pub drag_area: T,
    /// Mass (kg).
    pub mass: T,
    /// Gravitational acceleration, positive downwards (m/s2).
    pub gravity: T,
}

impl<T: Real> PointMass<T> {
    /// Creates a point mass from the body of `dynamics` in a posture held belly to earth.
    pub fn of(dynamics: &Dynamics<T>, posture: &Posture<T>) -> Self {
        Self {
            air: dynamics.air,
            drag_area: belly_drag_area(dynamics, posture),
            mass: dynamics.body.mass(),
            gravity: dynamics.gravity,
        }
    }

    /// Returns the acceleration (m/s2) at a position (m) and a velocity over the ground (m/s).
    pub fn acceleration(
        &self,
        position: &Vector<T, Inertial>,
        velocity: &Vector<T, Inertial>,
    ) -> Vector<T, Inertial> {
        let through_air = *velocity - self.air.velocity_at(position);
        let density = self.air.density.at(position.up());
        let drag = density * T::of(0.5) * self.drag_area * through_air.norm() / self.mass;
        let weight = Vector::new(T::zero(), T::zero(), -self.gravity);
        weight - through_air * drag
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use crate::body::pattern;
    use crate::dynamics::trim::trim;
    use crate::test_body::reference_body;

    #[test]
    fn at_the_speed_of_a_trimmed_fall_nothing_accelerates() {
        let mut body = reference_body();
        // Moment arms of about the width of the limbs, as in the other tests of the trim.
        for (_, segment) in body.segments.iter_mut() {
            segment.moment_arm *= 0.33;
        }
        let dynamics = Dynamics::paper(body, 1.0);
        let posture = pattern::neutral();
        let point = PointMass::of(&dynamics, &posture);
        let terminal = (point.mass * point.gravity * 2.0 / point.drag_area).sqrt();
        let down = Vector::new(0.0, 0.0, -terminal);
        let rest = point.acceleration(&Vector::zero(), &down);
        assert!(rest.norm() < 1e-12);
        // The trimmed attitude differs slightly from belly to earth.
        let trim = trim(&dynamics, &posture, 0.0).unwrap();
        assert!((terminal / trim.terminal_speed - 1.0).abs() < 0.05);
    }

    #[test]
    fn wind_carries_the_body_along() {
        let mut dynamics = Dynamics::paper(reference_body(), 1.0);
        dynamics.air.velocity = Vector::new(5.0, -3.0, 0.0);
        let point = PointMass::of(&dynamics, &pattern::neutral());
        let with_it = Vector::new(5.0, -3.0, -50.0);
        let pull = point.acceleration(&Vector::zero(), &with_it);
        assert!(pull.north().abs() < 1e-12 && pull.west().abs() < 1e-12);
        let still = Vector::new(0.0, 0.0, -50.0);
        let pull = point.acceleration(&Vector::zero(), &still);
        assert!(pull.north() > 0.1 && pull.west() < -0.05);
    }
}
