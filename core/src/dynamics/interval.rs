//! What a step needs to know about the interval it crosses: mass properties, their rates, and the loads.
//!
//! [`PostureSample`] is the full form; a filter may store a smaller one. Both use the same integrator.

use nalgebra::{Matrix3, Vector3};

use super::muscle_input::{GroupMoments, MuscleLoad, muscle_load};
use super::{Dynamics, Inputs, Motion, PostureSample, State};
use crate::aerodynamics::compiled::Seen;
use crate::aerodynamics::{Flow, Loads, damping_rate};
use crate::axis::AxisCoefficients;
use crate::frame::{Body, Vector};
use crate::math::Lanes;

/// Loads of inputs of one, in body axes: the derivatives of the loads, which are linear in the inputs.
#[derive(Debug, Clone, Copy)]
pub struct UnitLoads<T: Lanes> {
    /// Load of the muscle input of each axis.
    pub muscle: [MuscleLoad<T>; 3],
    /// Damping of an axis for a coefficient of one (N m s).
    pub damping: T,
}

impl<T: Lanes> UnitLoads<T> {
    /// Loads of the limb `groups` for the reciprocal lever arms of [`MuscleModel::levers`], and this damping.
    ///
    /// [`MuscleModel::levers`]: super::muscle_input::MuscleModel::levers
    #[inline]
    pub fn of(groups: &GroupMoments<T>, levers: &[T; 4], damping: T) -> Self {
        let [zero, one] = [T::zero(), T::one()];
        let units = [[one, zero, zero], [zero, one, zero], [zero, zero, one]];
        Self {
            muscle: units.map(|input| groups.load(&input.into(), levers)),
            damping,
        }
    }
}

/// A body during one time interval, in body axes.
pub trait Interval<T: Lanes> {
    /// Mass (kg).
    fn mass(&self) -> T;
    /// Position of the centre of gravity (m).
    fn cg(&self) -> Vector<T, Body>;
    /// Rate of the centre of gravity (m/s).
    fn cg_rate(&self) -> Vector<T, Body>;
    /// Inertia about the centre of gravity (kg m2).
    fn inertia(&self) -> &Matrix3<T>;
    /// Inverse of the inertia about the centre of gravity (1/(kg m2)).
    fn inverse_inertia(&self) -> &Matrix3<T>;
    /// Angular momentum of the segments relative to the body frame, about the centre of gravity (kg m2/s).
    fn relative_angular_momentum(&self) -> Vector<T, Body>;

    /// Returns the force and the moment about the origin on a moving body, and the damping coefficient of each axis (N
    /// m s). The loads include air and muscle input but neither gravity nor damping.
    ///
    /// `velocity_through_air` (m/s) and `spin`, the angular velocity (rad/s), are in body axes; `density` is in kg/m3.
    fn loads(
        &self,
        dynamics: &Dynamics<T>,
        inputs: &Inputs<T>,
        velocity_through_air: &Vector<T, Body>,
        spin: &Vector<T, Body>,
        density: T,
    ) -> (Loads<T>, Vector3<T>);

    /// Returns the loads of inputs of one, see [`UnitLoads`]; arguments as for [`Interval::loads`].
    fn unit_loads(
        &self,
        dynamics: &Dynamics<T>,
        velocity_through_air: &Vector<T, Body>,
        spin: &Vector<T, Body>,
        density: T,
    ) -> UnitLoads<T>;

    /// Returns the angular velocity (rad/s) that corresponds to this angular momentum about the centre of gravity.
    #[inline]
    fn angular_velocity(&self, angular_momentum: &Vector<T, Body>) -> Vector<T, Body> {
        self.inverse_inertia() * (*angular_momentum - self.relative_angular_momentum())
    }

    /// Returns the velocity of the origin (m/s) for a linear momentum and an angular velocity.
    #[inline]
    fn origin_velocity(
        &self,
        linear_momentum: &Vector<T, Body>,
        angular_velocity: &Vector<T, Body>,
    ) -> Vector<T, Body> {
        *linear_momentum / self.mass() - angular_velocity.cross(&self.cg()) - self.cg_rate()
    }
}

impl<T: Lanes> Interval<T> for PostureSample<T> {
    #[inline]
    fn mass(&self) -> T {
        self.mass.mass
    }
    #[inline]
    fn cg(&self) -> Vector<T, Body> {
        Vector::from_components(self.mass.cg)
    }
    #[inline]
    fn cg_rate(&self) -> Vector<T, Body> {
        Vector::from_components(self.motion.cg_rate)
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
    fn relative_angular_momentum(&self) -> Vector<T, Body> {
        Vector::from_components(self.relative_angular_momentum)
    }

    #[inline]
    fn loads(
        &self,
        dynamics: &Dynamics<T>,
        inputs: &Inputs<T>,
        velocity_through_air: &Vector<T, Body>,
        spin: &Vector<T, Body>,
        density: T,
    ) -> (Loads<T>, Vector3<T>) {
        let flow = Flow::new(&velocity_through_air.components, density);
        let mut seen = Seen::nothing();
        let mut loads = self.air_loads(
            dynamics,
            velocity_through_air,
            spin,
            density,
            &flow,
            &mut seen,
        );
        let muscle = muscle_load(
            &dynamics.muscles,
            &inputs.muscle,
            &self.aerodynamics.segments,
            &seen,
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

    fn unit_loads(
        &self,
        dynamics: &Dynamics<T>,
        velocity_through_air: &Vector<T, Body>,
        spin: &Vector<T, Body>,
        density: T,
    ) -> UnitLoads<T> {
        let flow = Flow::new(&velocity_through_air.components, density);
        let mut seen = Seen::nothing();
        let loads = self.air_loads(
            dynamics,
            velocity_through_air,
            spin,
            density,
            &flow,
            &mut seen,
        );
        let unit = AxisCoefficients::repeat(T::one());
        let segments = &self.aerodynamics.segments;
        let groups = GroupMoments::of(&dynamics.muscles, &unit, segments, &seen, &flow);
        let height = dynamics.body.height;
        let damping = damping_rate(&unit, loads.exposed_area, height, &flow);
        UnitLoads::of(&groups, &dynamics.muscles.levers(height), damping.x)
    }
}

impl<T: Lanes> PostureSample<T> {
    /// Loads of the air; `seen` receives the areas that it sees. Other arguments as for [`Interval::loads`].
    #[inline(always)]
    fn air_loads(
        &self,
        dynamics: &Dynamics<T>,
        velocity_through_air: &Vector<T, Body>,
        spin: &Vector<T, Body>,
        density: T,
        flow: &Flow<T>,
        seen: &mut Seen<T>,
    ) -> Loads<T> {
        let loads = self.aerodynamics.total_load_seen(flow, seen);
        if dynamics.stream.is_uniform() {
            return loads;
        }
        let (aerodynamics, stream) = (&self.aerodynamics, &dynamics.stream);
        let (velocity, spin) = (&velocity_through_air.components, &spin.components);
        aerodynamics.total_load_in(stream, velocity, spin, density)
    }
}

impl<T: Lanes> State<T> {
    /// Converts a motion in the posture of `sample` to a state.
    pub fn from_motion(motion: &Motion<T>, sample: &impl Interval<T>) -> Self {
        let to_inertial = motion.inertial_from_body;
        let cg = sample.cg();
        let spin = motion.angular_velocity;
        let cg_velocity = motion.velocity + spin.cross(&cg) + sample.cg_rate();
        let momentum = sample.inertia() * spin + sample.relative_angular_momentum();
        Self {
            inertial_from_body: to_inertial,
            cg_position: motion.position + to_inertial * cg,
            linear_momentum: to_inertial * (cg_velocity * sample.mass()),
            angular_momentum: to_inertial * momentum,
        }
    }

    /// Converts this state in the posture of `sample` to a motion of the body frame.
    pub fn motion(&self, sample: &impl Interval<T>) -> Motion<T> {
        let to_body = self.inertial_from_body.inverse();
        let spin = sample.angular_velocity(&(to_body * self.angular_momentum));
        let momentum = to_body * self.linear_momentum;
        Motion {
            inertial_from_body: self.inertial_from_body,
            position: self.cg_position - self.inertial_from_body * sample.cg(),
            velocity: sample.origin_velocity(&momentum, &spin),
            angular_velocity: spin,
        }
    }
}
