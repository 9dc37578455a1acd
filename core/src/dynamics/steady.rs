//! Steady falls of a fixed posture in any attitude, vertical where the forces allow it and gliding otherwise.
//!
//! [`trim`](super::trim) bends the knees until the fall is vertical; here the posture stays fixed. The search first
//! finds the direction of the airstream with no pitching moment; balancing weight against the aerodynamic force then
//! gives attitude, speed and glide at once.

use nalgebra::Vector3;

use super::interval::Interval;
use super::{Dynamics, Inputs, Motion, PostureSample};
use crate::body::posture::Posture;
use crate::frame::{Vector, facing_north};
use crate::math::Real;

/// A steady fall in the sagittal plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Steady<T: Real> {
    /// Motion of the body, facing north.
    pub motion: Motion<T>,
    /// Ratio of horizontal to vertical speed; positive when gliding towards the head.
    pub glide: T,
    /// Rotation of the body about its left axis from upright (rad): pi/2 is belly to earth, pi head-down.
    pub body_pitch: T,
}

/// How far the search extends to either side of the requested direction (rad).
const SEARCHED: f64 = 1.2;
/// Number of intervals into which each side is divided.
const INTERVALS: u32 = 48;
/// Number of times that the interval with the change of sign is bisected.
const HALVINGS: usize = 32;

/// Finds the steady fall of `posture`, which must be symmetric about the sagittal plane, with the pitch input of
/// `inputs` at `density` (kg/m3). If there are several, it is the one whose airstream is nearest to that of a body
/// pitched by `near` (rad, see [`Steady::body_pitch`]) that falls straight down.
///
/// Returns `None` if no direction within 1.2 rad is free of pitching moment, or if the air cannot carry the body.
pub fn steady<T: Real>(
    dynamics: &Dynamics<T>,
    posture: &Posture<T>,
    inputs: &Inputs<T>,
    near: T,
    density: T,
) -> Option<Steady<T>> {
    let sample = dynamics.hold(posture);
    let moment = |angle: T| load(dynamics, &sample, inputs, angle, density).1;
    let step = T::of(SEARCHED) / T::of(f64::from(INTERVALS));
    // Search outwards, one interval on either side at a time, so that the first change of sign is the nearest.
    let found = (0..INTERVALS).find_map(|k| {
        let inner = step * T::of(f64::from(k));
        [T::one(), -T::one()].into_iter().find_map(|side| {
            let (low, high) = (near + side * inner, near + side * (inner + step));
            let (at_low, at_high) = (moment(low), moment(high));
            (at_low * at_high <= T::zero()).then(|| halved(low, high, at_low, &moment))
        })
    })?;
    let (force, _) = load(dynamics, &sample, inputs, found, density);
    let carried = force.norm();
    let speed = (sample.mass.mass * dynamics.gravity / carried).root();
    if !speed.is_finite() || speed <= T::zero() {
        return None;
    }
    let body_pitch = force.y.arctangent2(force.z);
    let attitude = facing_north(body_pitch);
    let velocity = Vector::from_components(stream(found) * speed);
    let over_ground = attitude * velocity;
    let position = Vector::zero();
    let motion = Motion {
        inertial_from_body: attitude,
        position,
        velocity: velocity + attitude.inverse() * dynamics.air.velocity_at(&position),
        angular_velocity: Vector::zero(),
    };
    // Direction of the cranial axis over the ground: north or south.
    let headward = (attitude * Vector::new(T::zero(), T::zero(), T::one())).north();
    let along = over_ground.north()
        * if headward < T::zero() {
            -T::one()
        } else {
            T::one()
        };
    Some(Steady {
        motion,
        glide: along / -over_ground.up(),
        body_pitch,
    })
}

/// Unit vector of the velocity through the air, in body axes, of a body pitched by `angle` that falls straight down.
fn stream<T: Real>(angle: T) -> Vector3<T> {
    let (sine, cosine) = angle.sine_cosine();
    Vector3::new(T::zero(), -sine, -cosine)
}

/// Force (N) and pitching moment about the centre of gravity (N m) at a speed of 1 m/s, in body axes.
fn load<T: Real>(
    dynamics: &Dynamics<T>,
    sample: &PostureSample<T>,
    inputs: &Inputs<T>,
    angle: T,
    density: T,
) -> (Vector3<T>, T) {
    let velocity = Vector::from_components(stream(angle));
    let (loads, _) = sample.loads(dynamics, inputs, &velocity, &Vector::zero(), density);
    let moment = loads.moment - sample.mass.cg.cross(&loads.force);
    (loads.force, moment.x)
}

/// Finds a zero between two arguments by bisection.
fn halved<T: Real>(low: T, high: T, at_low: T, function: &impl Fn(T) -> T) -> T {
    let (mut low, mut high) = (low, high);
    for _ in 0..HALVINGS {
        let middle = (low + high) * T::of(0.5);
        if function(middle) * at_low <= T::zero() {
            high = middle;
        } else {
            low = middle;
        }
    }
    (low + high) * T::of(0.5)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::pattern;
    use crate::dynamics::State;
    use crate::dynamics::step::TIME_STEP;
    use crate::test_body::reference_body;

    #[test]
    fn a_steady_fall_remains_steady() {
        let dynamics = Dynamics::paper(reference_body(), 1.0);
        let posture = pattern::neutral();
        let inputs = Inputs::belly_turn();
        let half_turn = core::f64::consts::FRAC_PI_2;
        let found = steady(&dynamics, &posture, &inputs, half_turn, 1.0).expect("a balance");
        assert!((found.body_pitch - half_turn).abs() < 0.4, "{found:?}");
        let sample = dynamics.hold(&posture);
        let start = State::from_motion(&found.motion, &sample);
        let mut state = start;
        for _ in 0..240 {
            state = dynamics.step(&state, &sample, &inputs, TIME_STEP);
        }
        let change = state.linear_momentum - start.linear_momentum;
        assert!(
            change.norm() < 1e-3 * start.linear_momentum.norm(),
            "{change:?}"
        );
        assert!(state.angular_momentum.norm() < 1e-3);
    }
}
