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
        let present = self.posture;
        crossed(&present, next, duration, |step| {
            let sample = dynamics.between(&step.from, &step.to, step.duration);
            self.cross((loads, time), dynamics, inputs, (step, &sample));
        });
        self.posture = *next;
    }

    /// Takes one step of [`FreeRun::advance_under`] with its sample; the present posture stays.
    pub fn cross(
        &mut self,
        (loads, time): (&AppliedLoads<T>, T),
        dynamics: &Dynamics<T>,
        inputs: &Inputs<T>,
        (step, sample): (&Crossing<T>, &PostureSample<T>),
    ) {
        let end = time + step.end;
        let half = step.duration * T::of(0.5);
        let begin = end - step.duration;
        self.flight
            .push(dynamics, loads, (&step.from, sample), begin, half);
        self.flight.step(dynamics, sample, inputs, step.duration);
        self.flight
            .push(dynamics, loads, (&step.to, sample), end, half);
    }

    /// Returns the motion in the present posture, whose joints move at `rate`.
    pub fn motion(&self, dynamics: &Dynamics<T>, rate: &PostureRate<T>) -> Motion<T> {
        // The motion does not depend on the air.
        let mut sample = PostureSample::blank();
        dynamics.pose_into(&self.posture, rate, &mut sample);
        self.flight.motion(&sample)
    }

    /// Returns the flight at the present posture.
    pub const fn flight(&self) -> &Flight<T> {
        &self.flight
    }
}

/// One of the steps from one posture to the next.
#[derive(Debug, Clone, Copy)]
pub struct Crossing<T: Real> {
    /// Posture at its start.
    pub from: Posture<T>,
    /// Posture at its end.
    pub to: Posture<T>,
    /// Its duration (s).
    pub duration: T,
    /// Its end (s), since the first of the steps began.
    pub end: T,
}

/// Crosses a gap of `duration` (s) between two postures in steps of [`TIME_STEP`] or less, for gaps of up to 1 s.
#[inline]
pub fn crossed<T: Real>(
    from: &Posture<T>,
    to: &Posture<T>,
    duration: T,
    mut take: impl FnMut(&Crossing<T>),
) {
    let steps = steps_for(duration.to_f64());
    let share = T::one() / T::of(f64::from(steps));
    let mut reached = *from;
    for step in 1..=steps {
        let number = T::of(f64::from(step));
        let next = if step == steps {
            *to
        } else {
            from.interpolated(to, share * number)
        };
        let part = duration * share;
        take(&Crossing {
            from: reached,
            to: next,
            duration: part,
            end: part * number,
        });
        reached = next;
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
