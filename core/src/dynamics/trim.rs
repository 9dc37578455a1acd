//! Trim: the steady vertical fall of a symmetric posture, paper "The Trim Condition".
//!
//! All rates are zero, so the aerodynamic force and moment balance the weight. For a posture that is symmetric about
//! the sagittal plane three equations remain: forces along Y and Z, and the pitching moment. They determine the
//! terminal speed, the pitch of the body and the bend of the knees; every other joint stays fixed.

use core::fmt;

use nalgebra::Vector3;

use super::Dynamics;
use crate::aerodynamics::Flow;
use crate::body::Segment;
use crate::body::posture::{Posture, joint_rotation};
use crate::math::Real;

/// A steady vertical fall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Trim<T: Real> {
    /// Terminal speed (m/s).
    pub terminal_speed: T,
    /// Rotation of the body about its left axis from upright (rad): pi/2 is belly to earth.
    pub body_pitch: T,
    /// Bend of both knees (rad), 0 for straight legs.
    pub knee: T,
    /// Derivative of the pitching moment with respect to pitch (N m/rad); negative if the fall is stable in pitch.
    pub pitch_stiffness: T,
}

/// Reason why no trim was found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TrimError {
    /// No bend of the knees within the range searched balances the posture.
    NoBalance,
    /// The air cannot carry the body: there is no density, no area, or the airstream is that of a tunnel.
    NoSupport,
}

impl fmt::Display for TrimError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NoBalance => "no bend of the knees within the range searched balances the posture",
            Self::NoSupport => {
                "the air cannot carry the body: it has no density, the body has no area, or the air is that of a tunnel"
            }
        })
    }
}

impl core::error::Error for TrimError {}

/// Range of knee bends searched (rad).
const KNEE_RANGE: (f64, f64) = (0.0, 2.4);
/// Range of pitch searched (rad): belly to earth within 40 deg.
const PITCH_RANGE: (f64, f64) = (0.87, 2.27);
/// Number of equal intervals into which a range is divided to find a change of sign.
const INTERVALS: usize = 24;
/// Number of times that the interval found is bisected, which narrows it to less than 1e-8 rad.
const HALVINGS: usize = 24;

/// Returns `posture` with both knees bent by `knee` (rad).
pub fn with_knees<T: Real>(posture: &Posture<T>, knee: T) -> Posture<T> {
    let bend = joint_rotation(T::zero(), T::zero(), -knee);
    posture
        .with(Segment::LeftShank, bend)
        .with(Segment::RightShank, bend)
}

/// Finds the steady fall of `posture`, adjusting the knees, in air with the density at height `altitude` (m, inertial).
///
/// # Errors
/// Returns an error if no knee bend in the human range gives a balance, or if the air cannot carry the body.
pub fn trim<T: Real>(
    dynamics: &Dynamics<T>,
    posture: &Posture<T>,
    altitude: T,
) -> Result<Trim<T>, TrimError> {
    let balance = |pitch: T, knee: T| Balance::of(dynamics, &with_knees(posture, knee), pitch);
    // Forces have kinks where a different face of a segment becomes the largest, so bisection is used instead of
    // derivatives: first for the pitch without glide, then for the knee bend without moment.
    let pitch_for = |knee: T| zero(PITCH_RANGE, |pitch| Some(balance(pitch, knee).glide));
    let moment_at = |knee: T| Some(balance(pitch_for(knee)?, knee).moment);
    let knee = zero(KNEE_RANGE, moment_at).ok_or(TrimError::NoBalance)?;
    let pitch = pitch_for(knee).ok_or(TrimError::NoBalance)?;
    let found = balance(pitch, knee);
    let density = dynamics.air.density.at(altitude);
    let weight = dynamics.body.mass() * dynamics.gravity;
    let dynamic_pressure = weight / found.support;
    let terminal_speed = (dynamic_pressure * T::of(2.0) / density).root();
    if terminal_speed <= T::zero() || !terminal_speed.is_finite() {
        return Err(TrimError::NoSupport);
    }
    let delta = T::of(1e-3);
    let stiffness = (balance(pitch + delta, knee).moment - balance(pitch - delta, knee).moment)
        / (delta + delta);
    Ok(Trim {
        terminal_speed,
        body_pitch: pitch,
        knee,
        pitch_stiffness: stiffness * dynamic_pressure,
    })
}

/// Drag area (area times drag coefficient, m2) of a posture that falls belly to earth.
pub(super) fn belly_drag_area<T: Real>(dynamics: &Dynamics<T>, posture: &Posture<T>) -> T {
    Balance::of(dynamics, posture, T::of(core::f64::consts::FRAC_PI_2)).support
}

/// Balance of a vertical fall; all loads are divided by the dynamic pressure.
struct Balance<T: Real> {
    /// Force upwards (m2).
    support: T,
    /// Horizontal force in the sagittal plane (m2); zero for a vertical fall.
    glide: T,
    /// Moment about the body's left axis through the centre of gravity (m3).
    moment: T,
}

impl<T: Real> Balance<T> {
    fn of(dynamics: &Dynamics<T>, posture: &Posture<T>, pitch: T) -> Self {
        let sample = dynamics.hold(posture);
        let (sine, cosine) = pitch.sine_cosine();
        // The downward direction in body axes.
        let down = Vector3::new(T::zero(), -sine, -cosine);
        let flow = Flow {
            direction: down,
            dynamic_pressure: T::one(),
        };
        let loads = sample.aerodynamics.total_load(&flow);
        let moment = loads.moment - sample.mass.cg.cross(&loads.force);
        let level = Vector3::new(T::zero(), -cosine, sine);
        Self {
            support: -loads.force.dot(&down),
            glide: loads.force.dot(&level),
            moment: moment.x,
        }
    }
}

/// Finds a zero of a continuous function within `range`, at the first change of sign from its lower end; `None` if
/// there is none.
fn zero<T: Real>(range: (f64, f64), function: impl Fn(T) -> Option<T>) -> Option<T> {
    let width = (range.1 - range.0) / INTERVALS as f64;
    let mut low = T::of(range.0);
    let mut at_low = function(low);
    for k in 1..=INTERVALS {
        let mut high = T::of(range.0 + width * k as f64);
        let at_high = function(high);
        if let (Some(a), Some(b)) = (at_low, at_high)
            && a * b <= T::zero()
        {
            for _ in 0..HALVINGS {
                let middle = (low + high) * T::of(0.5);
                if function(middle)? * a > T::zero() {
                    low = middle;
                } else {
                    high = middle;
                }
            }
            return Some((low + high) * T::of(0.5));
        }
        (low, at_low) = (high, at_high);
    }
    None
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use crate::body::pattern;
    use crate::dynamics::step::TIME_STEP;
    use crate::dynamics::{Inputs, Motion, State};
    use crate::frame::{Rotation, Vector};
    use crate::test_body::reference_body;
    use nalgebra::UnitQuaternion;

    /// The reference body with moment arms of a third of the length, about the width of the limbs.
    fn dynamics() -> Dynamics<f64> {
        let mut body = reference_body();
        for (_, segment) in body.segments.iter_mut() {
            segment.moment_arm *= 0.33;
        }
        Dynamics::paper(body, 1.0)
    }

    #[test]
    fn a_trimmed_fall_stays_trimmed() {
        let dynamics = dynamics();
        let trim = trim(&dynamics, &pattern::neutral(), 0.0).unwrap();
        std::println!("{trim:?}");
        assert!((40.0..60.0).contains(&trim.terminal_speed), "{trim:?}");
        assert!((1.4..1.8).contains(&trim.body_pitch), "{trim:?}");
        assert!(trim.pitch_stiffness < 0.0, "{trim:?}");
        // GIVEN the trimmed posture, attitude and speed
        let sample = dynamics.hold(&with_knees(&pattern::neutral(), trim.knee));
        let attitude = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), trim.body_pitch);
        let inertial_from_body = Rotation::from_quaternion(attitude);
        let fall = inertial_from_body.inverse() * Vector::new(0.0, 0.0, -trim.terminal_speed);
        let motion = Motion {
            inertial_from_body,
            position: Vector::zero(),
            velocity: fall,
            angular_velocity: Vector::zero(),
        };
        let mut state = State::from_motion(&motion, &sample);
        // WHEN it falls for five seconds
        for _ in 0..1200 {
            state = dynamics.step(&state, &sample, &Inputs::belly_turn(), TIME_STEP);
        }
        // THEN nothing has changed
        let end = state.motion(&sample);
        assert!((end.velocity - fall).norm() < 0.05, "{end:?}");
        assert!(end.inertial_from_body.quaternion().angle_to(&attitude) < 0.01);
    }

    #[test]
    fn no_trim_exists_in_vacuum() {
        let mut dynamics = dynamics();
        dynamics.air.density = crate::air::Density::Constant(0.0);
        assert_eq!(
            trim(&dynamics, &pattern::neutral(), 0.0),
            Err(TrimError::NoSupport)
        );
    }
}
