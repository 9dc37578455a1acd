//! The reduced prediction, for a unit with little memory and time.
//!
//! Four simplifications make it cheap. One run at the state and one run to one side for each coefficient give the
//! slope of the measurement; the moments of all thirteen bounded sigma points follow from that slope without further
//! runs. A step spans two samples, because the integrator is of second order and treats damping implicitly. An
//! interval stores no segments, but the aerodynamics of the faces exposed in the central run ([`FrozenAerodynamics`])
//! and the moments of the muscle groups linearised about its velocity. All runs share the intervals.

use nalgebra::{SMatrix, SVector, Vector3};

use super::check::Check;
use super::coefficients::{STATES, StateVector, inputs_of_filter};
use super::measurement::{CHANNELS, MeasurementModel};
use super::propagation::Propagation;
use super::unscented::{Moments, Root, SigmaPoints, Unscented};
use super::window::Window;
use crate::aerodynamics::compiled::FrozenAerodynamics;
use crate::aerodynamics::{Flow, Loads, damping_rate};
use crate::axis::AxisCoefficients;
use crate::dynamics::interval::{Interval, UnitLoads};
use crate::dynamics::muscle_input::{GROUPS, GroupMoments};
use crate::dynamics::{Dynamics, Inputs, PostureSample, State};
use crate::frame::{Body, Vector};
use crate::math::Real;
use nalgebra::Matrix3;

/// Seven runs over intervals of two samples, and one more for the [check](super::check).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Reduced;

/// An interval stored without its segments.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReducedInterval<T: Real> {
    mass: T,
    cg: Vector<T, Body>,
    cg_rate: Vector<T, Body>,
    inertia: Matrix3<T>,
    inverse_inertia: Matrix3<T>,
    relative_angular_momentum: Vector<T, Body>,
    aerodynamics: FrozenAerodynamics<T>,
    groups: LinearGroups<T>,
    levers: [T; 4],
}

/// Moments of the muscle groups about a reference velocity, divided by the density.
///
/// They are quadratic in the speed, so `f(V) = J (V - V_0 / 2)` matches both value and slope at `V_0`.
#[derive(Debug, Clone, Copy, PartialEq)]
struct LinearGroups<T: Real> {
    slope: [Vector3<T>; GROUPS],
    half_velocity: Vector3<T>,
}

/// Rotation of the airstream (rad) over which the slope is taken, about as large as the differences between sigma
/// points.
const STREAM_TURN: f64 = 0.05;

impl<T: Real> LinearGroups<T> {
    /// Linearises from the loads at the reference and at two airstreams rotated by [`STREAM_TURN`]; along the
    /// reference the slope follows from the quadratic dependence on the speed.
    fn about(dynamics: &Dynamics<T>, sample: &PostureSample<T>, velocity: &Vector3<T>) -> Self {
        let one = T::one();
        let unit = AxisCoefficients::repeat(one);
        let at = |velocity: &Vector3<T>| {
            let flow = Flow::new(velocity, one);
            let segments = &sample.aerodynamics.segments;
            let seen = sample.aerodynamics.seen(&flow.direction);
            GroupMoments::of(&dynamics.muscles, &unit, segments, &seen, &flow).0
        };
        let square = velocity.norm_squared();
        let speed = square.root();
        let along = velocity * (one / speed);
        let first = across(&along);
        let second = along.cross(&first);
        let turn = speed * T::of(STREAM_TURN);
        let centre = at(velocity);
        let sides = [first, second].map(|side| at(&(velocity + side * turn)));
        let mut slope = [Vector3::zeros(); GROUPS];
        for (k, slope) in slope.iter_mut().enumerate() {
            let [a, b] = [0, 1].map(|side| (sides[side][k] - centre[k]) / turn);
            *slope = first * a + second * b + along * (centre[k] * T::of(2.0) / speed);
            if !slope.iter().all(|v| v.is_finite()) {
                *slope = Vector3::zeros();
            }
        }
        Self {
            slope,
            half_velocity: velocity * T::of(0.5),
        }
    }

    #[inline]
    fn at(&self, velocity: &Vector3<T>, density: T) -> GroupMoments<T> {
        let offset = (velocity - self.half_velocity) * density;
        GroupMoments(self.slope.map(|row| row.dot(&offset)))
    }
}

/// Returns a unit vector perpendicular to a unit vector.
fn across<T: Real>(along: &Vector3<T>) -> Vector3<T> {
    // The cross product with the least aligned axis is never short.
    let axis = if along.x.abs() < T::of(0.7) {
        Vector3::x()
    } else {
        Vector3::y()
    };
    let side = along.cross(&axis);
    side * (T::one() / side.norm_squared().root())
}

impl<T: Real> Interval<T> for ReducedInterval<T> {
    #[inline]
    fn mass(&self) -> T {
        self.mass
    }
    #[inline]
    fn cg(&self) -> Vector<T, Body> {
        self.cg
    }
    #[inline]
    fn cg_rate(&self) -> Vector<T, Body> {
        self.cg_rate
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
        self.relative_angular_momentum
    }

    #[inline]
    fn loads(
        &self,
        dynamics: &Dynamics<T>,
        inputs: &Inputs<T>,
        velocity_through_air: &Vector<T, Body>,
        _spin: &Vector<T, Body>,
        density: T,
    ) -> (Loads<T>, Vector3<T>) {
        let velocity_through_air = &velocity_through_air.components;
        let flow = Flow::new(velocity_through_air, density);
        let mut loads = self.aerodynamics.total_load(&flow);
        let groups = self.groups.at(velocity_through_air, density);
        let muscle = groups.load(&inputs.muscle, &self.levers);
        loads.force += muscle.force;
        loads.moment += muscle.moment;
        let height = dynamics.body.height;
        let damping = damping_rate(&inputs.damping, loads.exposed_area, height, &flow);
        (loads, damping)
    }

    fn unit_loads(
        &self,
        dynamics: &Dynamics<T>,
        velocity_through_air: &Vector<T, Body>,
        _spin: &Vector<T, Body>,
        density: T,
    ) -> UnitLoads<T> {
        let velocity_through_air = &velocity_through_air.components;
        let flow = Flow::new(velocity_through_air, density);
        let groups = self.groups.at(velocity_through_air, density);
        let unit = AxisCoefficients::repeat(T::one());
        let area = self.aerodynamics.exposed_area(&flow.direction);
        let damping = damping_rate(&unit, area, dynamics.body.height, &flow);
        UnitLoads::of(&groups, &self.levers, damping.x)
    }
}

impl<T: Real> Propagation<T> for Reduced {
    type Interval = ReducedInterval<T>;
    const STRIDE: usize = 2;
    const ROOT: Root = Root::Cholesky;

    fn keep(
        dynamics: &Dynamics<T>,
        sample: &PostureSample<T>,
        velocity: &Vector<T, Body>,
    ) -> ReducedInterval<T> {
        let velocity = &velocity.components;
        let flow = Flow::new(velocity, T::one());
        ReducedInterval {
            mass: sample.mass.mass,
            cg: sample.cg(),
            cg_rate: sample.cg_rate(),
            inertia: sample.inertia,
            inverse_inertia: sample.inverse_inertia,
            relative_angular_momentum: sample.relative_angular_momentum(),
            aerodynamics: sample.aerodynamics.about(&flow.direction),
            groups: LinearGroups::about(dynamics, sample, velocity),
            levers: dynamics.muscles.levers(dynamics.body.height),
        }
    }

    fn predict<const N: usize>(
        filter: &Unscented<T, STATES>,
        points: &SigmaPoints<T, STATES>,
        start: &State<T>,
        window: &Window<'_, T, ReducedInterval<T>, N>,
        model: &MeasurementModel,
    ) -> (Moments<T, STATES, CHANNELS>, State<T>) {
        let offsets = one_sided(filter);
        let mut coefficients = [points.centre; STATES + 1];
        for (k, point) in coefficients.iter_mut().skip(1).enumerate() {
            point[k] += offsets[k];
        }
        let runs = window.run(start, &coefficients.map(|x| inputs_of_filter(&x)));
        let seen = runs.map(|state| window.observe(&state, model));
        let mut slope = SMatrix::<T, CHANNELS, STATES>::zeros();
        for (k, side) in seen.iter().skip(1).enumerate() {
            let change: SVector<T, CHANNELS> = model.difference(side, &seen[0]);
            slope.set_column(k, &(change / offsets[k]));
        }
        (filter.linear_moments(points, &seen[0], &slope), runs[0])
    }

    fn settle<const N: usize>(
        check: &Check<'_, T>,
        filter: &mut Unscented<T, STATES>,
        start: &State<T>,
        window: &Window<'_, T, ReducedInterval<T>, N>,
        _: State<T>,
    ) -> State<T> {
        check.apply(filter, start, window)
    }
}

/// Step of the run for each coefficient: the distance that a sigma point would have if no other coefficient varied,
/// towards the side with more room within the bounds.
fn one_sided<T: Real>(filter: &Unscented<T, STATES>) -> StateVector<T> {
    let (settings, state) = (filter.settings(), filter.state());
    let spread = filter.spread();
    StateVector::from_fn(|k, _| {
        let (up, down) = (settings.high[k] - state[k], state[k] - settings.low[k]);
        let room = if up > down { up } else { down };
        let reach = filter.covariance()[(k, k)].root() * spread;
        let distance = if reach < room { reach } else { room };
        if up > down { distance } else { -distance }
    })
}
