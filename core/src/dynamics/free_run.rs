//! A free run: the model alone, driven by a sequence of postures from an initial measured motion.

use super::applied_load::AppliedLoads;
use super::equations_of_motion::{AsPublished, Flight};
use super::step::TIME_STEP;
use super::{Dynamics, Inputs, Motion, PostureSample, State};
use crate::body::mass_properties::PostureRate;
use crate::body::posture::Posture;
use crate::math::Real;

/// Which equations of motion a run uses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Equations {
    /// The exact Newton-Euler equations of model.md.
    #[default]
    Exact,
    /// The equations as printed in the paper.
    AsPublished,
}

/// A flight that follows recorded postures.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FreeRun<T: Real> {
    flight: Flight<T>,
    posture: Posture<T>,
}

/// Longest gap between two postures that is crossed in steps of [`TIME_STEP`] (s); longer gaps take the same number of
/// longer steps.
const LONGEST_GAP: f64 = 1.0;

impl<T: Real> FreeRun<T> {
    /// Starts from a motion and a posture whose joints move at `rate`.
    pub fn new(
        dynamics: &Dynamics<T>,
        equations: Equations,
        motion: &Motion<T>,
        posture: &Posture<T>,
        rate: &PostureRate<T>,
    ) -> Self {
        let flight = match equations {
            Equations::Exact => {
                Flight::Exact(State::from_motion(motion, &dynamics.sample(posture, rate)))
            }
            Equations::AsPublished => Flight::AsPublished(AsPublished::new(*motion)),
        };
        Self {
            flight,
            posture: *posture,
        }
    }

    /// Advances to the next posture, `duration` (s) later, in steps of [`TIME_STEP`] or less for gaps of up to 1 s.
    pub fn advance(
        &mut self,
        dynamics: &Dynamics<T>,
        inputs: &Inputs<T>,
        next: &Posture<T>,
        duration: T,
    ) {
        let nothing = (&AppliedLoads::none(), T::zero());
        self.advance_under(nothing, dynamics, inputs, next, duration);
    }

    /// Same as [`FreeRun::advance`], with user-defined loads; `time` is the time at the present posture (s since the
    /// start of the flight).
    pub fn advance_under(
        &mut self,
        (loads, time): (&AppliedLoads<T>, T),
        dynamics: &Dynamics<T>,
        inputs: &Inputs<T>,
        next: &Posture<T>,
        duration: T,
    ) {
        let steps = steps_for(duration.to_f64());
        let share = T::one() / T::of(f64::from(steps));
        let mut from = self.posture;
        for step in 1..=steps {
            let to = if step == steps {
                *next
            } else {
                self.posture
                    .interpolated(next, share * T::of(f64::from(step)))
            };
            let part = duration * share;
            let sample = dynamics.between(&from, &to, part);
            let end = time + part * T::of(f64::from(step));
            let half = part * T::of(0.5);
            self.flight
                .push(dynamics, loads, (&from, &sample), end - part, half);
            self.flight.step(dynamics, &sample, inputs, part);
            self.flight.push(dynamics, loads, (&to, &sample), end, half);
            from = to;
        }
        self.posture = *next;
    }

    /// Returns the motion in the present posture, whose joints move at `rate`.
    pub fn motion(&self, dynamics: &Dynamics<T>, rate: &PostureRate<T>) -> Motion<T> {
        self.flight.motion(&self.present(dynamics, rate))
    }

    /// Returns the sample of the present posture, whose joints move at `rate`.
    pub fn present(&self, dynamics: &Dynamics<T>, rate: &PostureRate<T>) -> PostureSample<T> {
        dynamics.sample(&self.posture, rate)
    }
}

/// Number of steps for a time between two postures (s).
fn steps_for(duration: f64) -> u32 {
    let wanted = duration.clamp(0.0, LONGEST_GAP) / TIME_STEP;
    // A small tolerance makes a difference of times that rounds to 1/240 s count as a single step.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped above"
    )]
    let steps = libm::ceil(wanted - 1e-3) as u32;
    steps.max(1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::{Segment, pattern};
    use crate::frame::{Rotation, Vector};
    use crate::test_body::reference_body;
    use nalgebra::{UnitQuaternion, Vector3};

    fn falling() -> Motion<f64> {
        let belly = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), 1.5);
        Motion {
            inertial_from_body: Rotation::from_quaternion(belly),
            position: Vector::zero(),
            velocity: Vector::new(0.0, -46.0, 0.0),
            angular_velocity: Vector::zero(),
        }
    }

    fn run(rate_hz: f64) -> Motion<f64> {
        let dynamics = Dynamics::paper(reference_body(), 1.0);
        let posture = |time: f64| {
            let angle = 0.2 * libm::sin(time);
            pattern::neutral().with_angles(Segment::LeftUpperArm, 0.0, 1.57, angle)
        };
        let dt = 1.0 / rate_hz;
        let rate =
            |time: f64| PostureRate::between(&posture(time - dt), &posture(time + dt), 2.0 * dt);
        let mut free = FreeRun::new(
            &dynamics,
            Equations::Exact,
            &falling(),
            &posture(0.0),
            &rate(0.0),
        );
        let frames = libm::round(3.0 * rate_hz);
        let mut k = 0.0;
        while k < frames {
            k += 1.0;
            free.advance(&dynamics, &Inputs::belly_turn(), &posture(k * dt), dt);
        }
        free.motion(&dynamics, &rate(3.0))
    }

    #[test]
    fn a_slow_recording_gives_the_same_flight() {
        let (fast, slow) = (run(240.0), run(60.0));
        let spin = fast.angular_velocity - slow.angular_velocity;
        assert!(fast.angular_velocity.norm() > 0.1);
        assert!(spin.norm() < 2e-3, "{spin:?}");
    }

    #[test]
    fn any_duration_takes_a_bounded_number_of_steps() {
        for (duration, steps) in [
            (1.0 / 240.0, 1),
            (1.0 / 60.0, 4),
            (0.0, 1),
            (-1.0, 1),
            (1e9, 240),
            (0.005, 2),
        ] {
            assert_eq!(steps_for(duration), steps, "{duration}");
        }
        assert_eq!(steps_for(f64::NAN), 1);
    }
}
