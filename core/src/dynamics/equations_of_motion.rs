//! Rates of velocity and angular velocity: the exact equations and those printed in the paper.
//!
//! Both are about the pelvic origin, in body axes. The exact ones (model.md "Equations of motion") are what
//! [`step`](super::step) integrates in momentum form; here they stand as rates, for comparison and for tests
//! against an independent implementation. The published ones drop `m cg''`, one `m W x cg'` and the
//! segments' relative momentum `h`, and carry a spurious `cg' x m V`, which breaks Galilean invariance.

use nalgebra::{Matrix3, Vector3};

use super::{Dynamics, Inputs, Motion, PostureSample, State};
use crate::body::mass_properties::{MassMotion, MassProperties};
use crate::frame::Vector;
use crate::math::{Real, inverse_symmetric, small_rotation};

/// Second derivatives that only the rate form needs, body axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MassAcceleration<T: Real> {
    /// Of the centre of gravity (m/s2).
    pub cg_acceleration: Vector3<T>,
    /// Rate of the relative angular momentum about the origin (N m).
    pub relative_angular_momentum_rate: Vector3<T>,
}

/// Force and moment about the origin that act on the body, gravity included, body axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wrench<T: Real> {
    /// Force (N).
    pub force: Vector3<T>,
    /// Moment about the origin (N m).
    pub moment: Vector3<T>,
}

/// Rates of the body's velocities, component rates in body axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rates<T: Real> {
    /// Rate of the velocity of the origin (m/s2).
    pub velocity_rate: Vector3<T>,
    /// Rate of the angular velocity (rad/s2).
    pub angular_velocity_rate: Vector3<T>,
}

/// Solves `F = m (V' + W' x c) + f`, `M = I W' + m c x V' + n` for the rates, f and n being all other terms.
fn solve<T: Real>(
    mass: &MassProperties<T>,
    force: Vector3<T>,
    moment: Vector3<T>,
) -> Option<Rates<T>> {
    let inverse = inverse_symmetric(&mass.inertia_about_cg())?;
    let angular_velocity_rate = inverse * (moment - mass.cg.cross(&force));
    let velocity_rate = force / mass.mass - angular_velocity_rate.cross(&mass.cg);
    Some(Rates {
        velocity_rate,
        angular_velocity_rate,
    })
}

/// Exact Newton-Euler rates of a body whose segments move in a prescribed way.
///
/// `velocity` (m/s) of the origin and `angular_velocity` (rad/s) in body axes. `None` for a singular inertia.
pub fn exact<T: Real>(
    mass: &MassProperties<T>,
    motion: &MassMotion<T>,
    acceleration: &MassAcceleration<T>,
    velocity: &Vector3<T>,
    angular_velocity: &Vector3<T>,
    wrench: &Wrench<T>,
) -> Option<Rates<T>> {
    let (w, v, cg) = (angular_velocity, velocity, &mass.cg);
    let two = T::of(2.0);
    let force = wrench.force
        - (w.cross(v)
            + w.cross(&w.cross(cg))
            + w.cross(&motion.cg_rate) * two
            + acceleration.cg_acceleration)
            * mass.mass;
    let moment = wrench.moment
        - motion.inertia_rate * w
        - acceleration.relative_angular_momentum_rate
        - w.cross(&(mass.inertia_about_origin * w + motion.relative_angular_momentum))
        - cg.cross(&w.cross(v)) * mass.mass;
    solve(mass, force, moment)
}

/// Rates as printed in the paper, eqs. (eq_F_M), (force1), (moment1); (force2) and (moment2) are their
/// components. Inertia about the origin, see model.md. `None` for a singular inertia.
pub fn as_published<T: Real>(
    mass: &MassProperties<T>,
    cg_rate: &Vector3<T>,
    inertia_rate: &Matrix3<T>,
    velocity: &Vector3<T>,
    angular_velocity: &Vector3<T>,
    wrench: &Wrench<T>,
) -> Option<Rates<T>> {
    let (w, v, cg) = (angular_velocity, velocity, &mass.cg);
    let force = wrench.force - (w.cross(cg_rate) + w.cross(&(v + w.cross(cg)))) * mass.mass;
    let moment = wrench.moment
        - inertia_rate * w
        - w.cross(&(mass.inertia_about_origin * w))
        - (cg_rate.cross(v) + v.cross(&w.cross(cg)) + w.cross(&cg.cross(v))) * mass.mass;
    solve(mass, force, moment)
}

/// Second-order low pass, 2 Hz with damping 0.7, by which the paper smooths `cg'` and `I'`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LowPass<T: Real> {
    value: Vector3<T>,
    slope: Vector3<T>,
}

/// Undamped frequency of the paper's low pass (rad/s).
const LOW_PASS_FREQUENCY: f64 = 2.0 * core::f64::consts::TAU;
/// Its damping ratio.
const LOW_PASS_DAMPING: f64 = 0.7;

impl<T: Real> LowPass<T> {
    /// At rest at zero.
    pub fn at_rest() -> Self {
        Self {
            value: Vector3::zeros(),
            slope: Vector3::zeros(),
        }
    }

    /// Follows `input` for `duration` (s) and gives the smoothed value.
    pub fn follow(&mut self, input: &Vector3<T>, duration: T) -> Vector3<T> {
        let frequency = T::of(LOW_PASS_FREQUENCY);
        let pull = (input - self.value) * frequency - self.slope * T::of(2.0 * LOW_PASS_DAMPING);
        self.slope += pull * (frequency * duration);
        self.value += self.slope * duration;
        self.value
    }
}

/// The published equations with their low-pass filters, stepped like [`Dynamics::step`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AsPublished<T: Real> {
    motion: Motion<T>,
    cg_rate: LowPass<T>,
    /// Filters of the columns of the inertia's rate.
    inertia_rate: [LowPass<T>; 3],
}

impl<T: Real> AsPublished<T> {
    /// Starts from a motion, with the filters at rest.
    pub fn new(motion: Motion<T>) -> Self {
        Self {
            motion,
            cg_rate: LowPass::at_rest(),
            inertia_rate: [LowPass::at_rest(); 3],
        }
    }

    /// The present motion.
    pub fn motion(&self) -> &Motion<T> {
        &self.motion
    }

    /// Steps the motion by `duration` (s): explicit midpoint, damping by the trapezium rule.
    pub fn step(
        &mut self,
        dynamics: &Dynamics<T>,
        sample: &PostureSample<T>,
        inputs: &Inputs<T>,
        duration: T,
    ) {
        let cg_rate = self.cg_rate.follow(&sample.motion.cg_rate, duration);
        let mut inertia_rate = Matrix3::zeros();
        for (k, filter) in self.inertia_rate.iter_mut().enumerate() {
            let column = sample.motion.inertia_rate.column(k).into_owned();
            inertia_rate.set_column(k, &filter.follow(&column, duration));
        }
        let half = duration * T::of(0.5);
        let start = self.motion;
        let Some(first) = rates(
            &start,
            dynamics,
            sample,
            inputs,
            &cg_rate,
            &inertia_rate,
            duration,
        ) else {
            return;
        };
        let middle = advanced(&start, &start, &first, half);
        let Some(second) = rates(
            &middle,
            dynamics,
            sample,
            inputs,
            &cg_rate,
            &inertia_rate,
            duration,
        ) else {
            return;
        };
        self.motion = advanced(&start, &middle, &second, duration);
    }
}

/// Rates of a motion under loads, gravity and damping, as published.
fn rates<T: Real>(
    motion: &Motion<T>,
    dynamics: &Dynamics<T>,
    sample: &PostureSample<T>,
    inputs: &Inputs<T>,
    cg_rate: &Vector3<T>,
    inertia_rate: &Matrix3<T>,
    duration: T,
) -> Option<Rates<T>> {
    let to_body = motion.inertial_from_body.inverse();
    let velocity = &motion.velocity.components;
    let spin = &motion.angular_velocity.components;
    let through_air = velocity - (to_body * dynamics.air.velocity).components;
    let density = dynamics.air.density.at(motion.position.components.z);
    let (loads, damping) = dynamics.loads(sample, inputs, &through_air, density);
    let weight = Vector::new(T::zero(), T::zero(), -dynamics.gravity * sample.mass.mass);
    let weight = (to_body * weight).components;
    let wrench = Wrench {
        force: loads.force + weight,
        moment: loads.moment + sample.mass.cg.cross(&weight),
    };
    let mut rates = as_published(&sample.mass, cg_rate, inertia_rate, velocity, spin, &wrench)?;
    // Damping by the implicit rule keeps a coefficient of 24 stable.
    let implicit = sample.inertia + Matrix3::from_diagonal(&damping) * duration;
    let resisted = inverse_symmetric(&implicit)?
        * (sample.inertia * rates.angular_velocity_rate - damping.component_mul(spin));
    rates.velocity_rate -= (resisted - rates.angular_velocity_rate).cross(&sample.mass.cg);
    rates.angular_velocity_rate = resisted;
    Some(rates)
}

/// `start` moved for `duration` at the velocities of `at` and the given rates.
fn advanced<T: Real>(
    start: &Motion<T>,
    at: &Motion<T>,
    rates: &Rates<T>,
    duration: T,
) -> Motion<T> {
    let spin = at.angular_velocity.components * duration;
    let turned = **start.inertial_from_body.quaternion() * *small_rotation(&spin);
    Motion {
        inertial_from_body: crate::frame::Rotation::from_quaternion(crate::math::normalized(
            turned,
        )),
        position: Vector::from_components(
            start.position.components + at.velocity_inertial().components * duration,
        ),
        velocity: Vector::from_components(
            start.velocity.components + rates.velocity_rate * duration,
        ),
        angular_velocity: Vector::from_components(
            start.angular_velocity.components + rates.angular_velocity_rate * duration,
        ),
    }
}

/// A flight in progress under either set of equations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Flight<T: Real> {
    /// Exact equations, momentum form.
    Exact(State<T>),
    /// The paper's equations as printed.
    AsPublished(AsPublished<T>),
}

impl<T: Real> Flight<T> {
    /// Steps by `duration` (s).
    pub fn step(
        &mut self,
        dynamics: &Dynamics<T>,
        sample: &PostureSample<T>,
        inputs: &Inputs<T>,
        duration: T,
    ) {
        match self {
            Self::Exact(state) => *state = dynamics.step(state, sample, inputs, duration),
            Self::AsPublished(flight) => flight.step(dynamics, sample, inputs, duration),
        }
    }

    /// Motion of the body in the posture of `sample`.
    pub fn motion(&self, sample: &PostureSample<T>) -> Motion<T> {
        match self {
            Self::Exact(state) => state.motion(sample),
            Self::AsPublished(flight) => *flight.motion(),
        }
    }
}
