//! What a step needs to know of the interval it crosses: mass properties, their rates, and the loads.
//!
//! [`PostureSample`] is the full form; a filter may keep a smaller one. Both go through the same integrator.

use nalgebra::{Matrix3, Vector3};

use super::muscle_input::muscle_load;
use super::{Dynamics, Inputs, PostureSample};
use crate::aerodynamics::{Flow, Loads, damping_rate};
use crate::math::Real;

/// A body over one interval of time, body axes.
pub trait Interval<T: Real> {
    /// Mass (kg).
    fn mass(&self) -> T;
    /// Centre of gravity (m).
    fn cg(&self) -> &Vector3<T>;
    /// Rate of the centre of gravity (m/s).
    fn cg_rate(&self) -> &Vector3<T>;
    /// Inertia about the centre of gravity (kg m2).
    fn inertia(&self) -> &Matrix3<T>;
    /// Its inverse.
    fn inverse_inertia(&self) -> &Matrix3<T>;
    /// Angular momentum of the segments relative to the body frame, about the centre of gravity (kg m2/s).
    fn relative_angular_momentum(&self) -> &Vector3<T>;

    /// Force and moment about the origin on a moving body, body axes: air, muscle input, no gravity, no
    /// damping; and the coefficient of the damping moment per axis (N m s).
    ///
    /// `velocity_through_air` in m/s and `spin`, the angular velocity, in rad/s, body axes; `density` in kg/m3.
    fn loads(
        &self,
        dynamics: &Dynamics<T>,
        inputs: &Inputs<T>,
        velocity_through_air: &Vector3<T>,
        spin: &Vector3<T>,
        density: T,
    ) -> (Loads<T>, Vector3<T>);

    /// Angular velocity (rad/s) that gives this angular momentum about the centre of gravity, body axes.
    #[inline]
    fn angular_velocity(&self, angular_momentum: &Vector3<T>) -> Vector3<T> {
        self.inverse_inertia() * (angular_momentum - self.relative_angular_momentum())
    }

    /// Velocity of the origin (m/s) for a linear momentum and an angular velocity, body axes.
    #[inline]
    fn origin_velocity(
        &self,
        linear_momentum: &Vector3<T>,
        angular_velocity: &Vector3<T>,
    ) -> Vector3<T> {
        linear_momentum / self.mass() - angular_velocity.cross(self.cg()) - self.cg_rate()
    }
}

impl<T: Real> Interval<T> for PostureSample<T> {
    #[inline]
    fn mass(&self) -> T {
        self.mass.mass
    }
    #[inline]
    fn cg(&self) -> &Vector3<T> {
        &self.mass.cg
    }
    #[inline]
    fn cg_rate(&self) -> &Vector3<T> {
        &self.motion.cg_rate
    }
    #[inline]
    fn inertia(&self) -> &Matrix3<T> {
        &self.inertia
    }
    #[inline]
    fn inverse_inertia(&self) -> &Matrix3<T> {
        &self.inverse_inertia
    }
    #[inline]
    fn relative_angular_momentum(&self) -> &Vector3<T> {
        &self.relative_angular_momentum
    }

    #[inline]
    fn loads(
        &self,
        dynamics: &Dynamics<T>,
        inputs: &Inputs<T>,
        velocity_through_air: &Vector3<T>,
        spin: &Vector3<T>,
        density: T,
    ) -> (Loads<T>, Vector3<T>) {
        let flow = Flow::new(velocity_through_air, density);
        let (mut loads, areas) = self.aerodynamics.total_load_and_areas(&flow);
        if !dynamics.stream.is_uniform() {
            let segments = &self.aerodynamics.segments;
            let stream = &dynamics.stream;
            loads = stream.total_load(segments, velocity_through_air, spin, density);
        }
        let muscle = muscle_load(
            &dynamics.muscles,
            &inputs.muscle,
            &self.aerodynamics.segments,
            &areas,
            &flow,
            dynamics.body.height,
        );
        loads.force += muscle.force;
        loads.moment += muscle.moment;
        let damping = damping_rate(
            &inputs.damping,
            loads.exposed_area,
            dynamics.body.height,
            &flow,
        );
        (loads, damping)
    }
}
