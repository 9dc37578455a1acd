//! Rates of velocity and angular velocity, in their exact form and as printed in the paper.
//!
//! Both forms are about the pelvic origin, in body axes. [`step`](super::step) integrates the exact equations (model.md
//! "Equations of motion") in momentum form; this module gives them as rates, for comparison and for tests against an
//! independent implementation. The published equations omit `m cg''`, one `m W x cg'` and the relative momentum `h` of
//! the segments, and contain a spurious `cg' x m V`, which breaks Galilean invariance.

use nalgebra::{Matrix3, Vector3};

use super::{Dynamics, Inputs, Motion, PostureSample, State};
use crate::body::mass_properties::{MassMotion, MassProperties};
use crate::frame::{Body as BodyFrame, Vector};
use crate::math::{Real, inverse_symmetric, small_rotation};

/// Second derivatives that only the rate form needs, in body axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MassAcceleration<T: Real> {
    /// Acceleration of the centre of gravity (m/s2).
    pub cg_acceleration: Vector3<T>,
    /// Rate of the relative angular momentum about the origin (N m).
    pub relative_angular_momentum_rate: Vector3<T>,
}

/// Force and moment about the origin acting on the body, including gravity, in body axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wrench<T: Real> {
    /// Force (N).
    pub force: Vector3<T>,
    /// Moment about the origin (N m).
    pub moment: Vector3<T>,
}

/// Rates of the body's velocities, as component rates in body axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rates<T: Real> {
    /// Rate of the velocity of the origin (m/s2).
    pub velocity_rate: Vector3<T>,
    /// Rate of the angular velocity (rad/s2).
    pub angular_velocity_rate: Vector3<T>,
}

/// Solves `F = m (V' + W' x c) + f`, `M = I W' + m c x V' + n` for the rates, where f and n are all other terms.
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

/// Exact Newton-Euler rates of a body whose segments follow a prescribed motion.
///
/// `velocity` (m/s) of the origin and `angular_velocity` (rad/s) are in body axes. Returns `None` if the inertia is
/// singular.
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

/// Rates as printed in the paper, eqs. (eq_F_M), (force1), (moment1); (force2) and (moment2) are their components. The
/// inertia is about the origin, see model.md. Returns `None` if the inertia is singular.
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

/// Second-order low-pass filter (2 Hz, damping ratio 0.7) with which the paper smooths `cg'` and `I'`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LowPass<T: Real> {
    value: Vector3<T>,
    slope: Vector3<T>,
}

/// Undamped natural frequency of the paper's low-pass filter (rad/s).
const LOW_PASS_FREQUENCY: f64 = 2.0 * core::f64::consts::TAU;
/// Damping ratio of the paper's low-pass filter.
const LOW_PASS_DAMPING: f64 = 0.7;

impl<T: Real> LowPass<T> {
    /// Creates a filter at rest with output zero.
    pub fn at_rest() -> Self {
        Self {
            value: Vector3::zeros(),
            slope: Vector3::zeros(),
        }
    }

    /// Advances the filter by `duration` (s) with constant `input` and returns the smoothed value.
    pub fn follow(&mut self, input: &Vector3<T>, duration: T) -> Vector3<T> {
        let frequency = T::of(LOW_PASS_FREQUENCY);
        let pull = (input - self.value) * frequency - self.slope * T::of(2.0 * LOW_PASS_DAMPING);
        self.slope += pull * (frequency * duration);
        self.value += self.slope * duration;
        self.value
    }
}

/// The published equations with their low-pass filters, stepped in the same way as [`Dynamics::step`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AsPublished<T: Real> {
    motion: Motion<T>,
    cg_rate: LowPass<T>,
    /// Filters for the columns of the inertia rate.
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

    /// Returns the present motion.
    pub fn motion(&self) -> &Motion<T> {
        &self.motion
    }

    /// Adds an increment of velocity (m/s) and of angular velocity (rad/s), body axes.
    pub fn push(&mut self, velocity: &Vector<T, BodyFrame>, spin: &Vector<T, BodyFrame>) {
        self.motion.velocity += *velocity;
        self.motion.angular_velocity += *spin;
    }

    /// Advances the motion by `duration` (s): explicit midpoint rule, with the damping treated implicitly.
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
    let through_air = motion.velocity - to_body * dynamics.air.velocity_at(&motion.position);
    let density = dynamics.air.density.at(motion.position.up());
    let turn = &motion.angular_velocity;
    let (loads, damping) = dynamics.loads(sample, inputs, &through_air, turn, density);
    let weight = Vector::new(T::zero(), T::zero(), -dynamics.gravity * sample.mass.mass);
    let weight = (to_body * weight).components;
    let pressure = T::of(0.5) * density * through_air.norm_squared();
    let residual = (inputs.residual.force * pressure).components;
    let wrench = Wrench {
        force: loads.force + residual + weight,
        moment: loads.moment
            + (inputs.residual.moment * pressure).components
            + sample.mass.cg.cross(&(residual + weight)),
    };
    // The printed equations are in body axes throughout.
    let (velocity, spin) = (&motion.velocity.components, &turn.components);
    let mut rates = as_published(&sample.mass, cg_rate, inertia_rate, velocity, spin, &wrench)?;
    // Treating the damping implicitly keeps a coefficient as large as 24 stable.
    let implicit = sample.inertia + Matrix3::from_diagonal(&damping) * duration;
    let resisted = inverse_symmetric(&implicit)?
        * (sample.inertia * rates.angular_velocity_rate - damping.component_mul(spin));
    rates.velocity_rate -= (resisted - rates.angular_velocity_rate).cross(&sample.mass.cg);
    rates.angular_velocity_rate = resisted;
    Some(rates)
}

/// Advances `start` by `duration` (s) with the velocities of `at` and the given rates.
fn advanced<T: Real>(
    start: &Motion<T>,
    at: &Motion<T>,
    rates: &Rates<T>,
    duration: T,
) -> Motion<T> {
    let turn = at.angular_velocity * duration;
    let turned = **start.inertial_from_body.quaternion() * *small_rotation(&turn.components);
    Motion {
        inertial_from_body: crate::frame::Rotation::from_quaternion(crate::math::normalized(
            turned,
        )),
        position: start.position + at.velocity_inertial() * duration,
        velocity: start.velocity + Vector::from_components(rates.velocity_rate) * duration,
        angular_velocity: start.angular_velocity
            + Vector::from_components(rates.angular_velocity_rate) * duration,
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
    /// Advances the flight by `duration` (s).
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

    /// Returns the motion of the body in the posture of `sample`.
    pub fn motion(&self, sample: &PostureSample<T>) -> Motion<T> {
        match self {
            Self::Exact(state) => state.motion(sample),
            Self::AsPublished(flight) => *flight.motion(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    type Nine = [f64; 9];

    fn symmetric(v: &[f64]) -> Matrix3<f64> {
        Matrix3::new(v[0], v[1], v[2], v[1], v[3], v[4], v[2], v[4], v[5])
    }

    proptest! {
        #[test]
        fn published_vector_and_component_forms_agree(
            a in prop::array::uniform9(-1.0f64..1.0),
            b in prop::array::uniform9(-1.0f64..1.0),
            c in prop::array::uniform9(-1.0f64..1.0),
        ) {
            // GIVEN a moving body and the rates from the vector form
            let at = |v: &Nine, k: usize| Vector3::new(v[k], v[k + 1], v[k + 2]);
            let cg = at(&a, 0) * 0.1;
            let mass = MassProperties {
                mass: 75.0,
                cg,
                inertia_about_origin: symmetric(&b[..6]) + Matrix3::from_diagonal_element(12.0),
            };
            let (cg_rate, velocity, spin) = (at(&a, 3), at(&a, 6) * 50.0, at(&b, 6) * 5.0);
            let inertia_rate = symmetric(&c[..6]);
            let wrench = Wrench { force: at(&c, 6) * 100.0, moment: at(&c, 3) * 50.0 };
            let rates =
                as_published(&mass, &cg_rate, &inertia_rate, &velocity, &spin, &wrench).unwrap();
            // WHEN they are inserted into the printed components, eqs. (force2) and (moment2), reading the misprint R
            // (Q z - P y) of the Y force as R (Q z - R y), and with I_xy = sum m x y (minus the matrix entry)
            let (m, [x, y, z], [dx, dy, dz]) = (mass.mass, cg.into(), cg_rate.into());
            let ([u, v, w], [p, q, r]): ([f64; 3], [f64; 3]) = (velocity.into(), spin.into());
            let [du, dv, dw]: [f64; 3] = rates.velocity_rate.into();
            let [dp, dq, dr]: [f64; 3] = rates.angular_velocity_rate.into();
            let force = Vector3::new(
                du + dq * z - dr * y + q * dz - r * dy + q * w - r * v
                    + q * (p * y - q * x) - r * (r * x - p * z),
                dv + dr * x - dp * z + r * dx - p * dz + r * u - p * w
                    + r * (q * z - r * y) - p * (p * y - q * x),
                dw + dp * y - dq * x + p * dy - q * dx + p * v - q * u
                    + p * (r * x - p * z) - q * (q * z - r * y),
            ) * m;
            let i = &mass.inertia_about_origin;
            let (ixx, iyy, izz) = (i.m11, i.m22, i.m33);
            let (ixy, ixz, iyz) = (-i.m12, -i.m13, -i.m23);
            let d = &inertia_rate;
            let (dixx, diyy, dizz) = (d.m11, d.m22, d.m33);
            let (dixy, dixz, diyz) = (-d.m12, -d.m13, -d.m23);
            let moment = Vector3::new(
                dixx * p - dixy * q - dixz * r + ixx * dp - ixy * (dq - r * p) - ixz * (dr + p * q)
                    - iyz * (q * q - r * r) + (izz - iyy) * q * r + m * dy * w - m * dz * v
                    + m * y * (dw + v * p - q * u) + m * z * (-dv + w * p - r * u),
                diyy * q - dixy * p - diyz * r + iyy * dq - ixy * (dp + q * r) - iyz * (dr - p * q)
                    - ixz * (r * r - p * p) + (ixx - izz) * p * r + m * dz * u - m * dx * w
                    + m * x * (-dw + q * u - p * v) + m * z * (du + w * q - r * v),
                dizz * r - dixz * p - diyz * q + izz * dr + ixz * (-dp + q * r) - iyz * (dq + p * r)
                    + ixy * (q * q - p * p) + (iyy - ixx) * p * q + m * dx * v - m * dy * u
                    + m * x * (dv + u * r - p * w) + m * y * (-du + v * r - q * w),
            );
            // THEN they reproduce the force and moment
            prop_assert!((force - wrench.force).norm() < 1e-8 * (1.0 + force.norm()), "{force:?} {wrench:?}");
            prop_assert!((moment - wrench.moment).norm() < 1e-8 * (1.0 + velocity.norm() * m), "{moment:?} {wrench:?}");
        }
    }
}
