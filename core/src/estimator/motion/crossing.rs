//! From one posture to the next: the posture's data, then the motion and its covariance.

use nalgebra::Vector3;

use super::airflow::Airflow;
use super::covariance;
use super::filter::{MotionFilter, STILL};
use super::settings::Slopes;
use super::state::{DAMPING, MOTION_STATES, SPIN, VELOCITY};
use super::transition;
use crate::body::posture::Posture;
use crate::dynamics::interval::Interval;
use crate::dynamics::{Motion, State};
use crate::estimator::limits::limit;
use crate::estimator::propagation::Propagation;
use crate::frame::Vector;
use crate::math::Real;

/// Largest derivative over an interval that means anything, in the units of the coordinates: beyond it the interval is too
/// long for the forces that act.
const LARGEST_SLOPE: f32 = 32_768.0;

impl<T: Real, P: Propagation<T>> MotionFilter<T, P> {
    /// Advances to the next posture: first the posture's data, then the motion. They are separate functions so that
    /// their stack frames do not add up.
    pub(super) fn cross(&mut self, posture: &Posture<T>) {
        let motion = self.motion();
        self.follow_posture(posture, &motion);
        self.fly(&motion);
    }

    /// Updates the interval and the effect of joint errors for the next posture.
    #[inline(never)]
    fn follow_posture(&mut self, posture: &Posture<T>, motion: &Motion<T>) {
        let good = posture.is_valid();
        self.faults.posture |= !good;
        // Once per estimate on the unit, so that every update costs the same.
        if self.since == 0 || P::STRIDE == 1 {
            let next = if good { posture } else { &self.posture };
            self.posture_error
                .renew_next(&self.dynamics, next, motion, &mut self.sample);
        }
        let next = if good { posture } else { &self.posture };
        self.dynamics
            .between_into(&self.posture, next, self.duration, &mut self.sample);
        if good {
            if self.posture == *posture {
                if self.still < T::single(STILL) {
                    self.still += self.duration;
                }
            } else {
                self.still = T::zero();
            }
            self.posture = *posture;
        }
    }

    /// Propagates state and covariance over the interval.
    #[inline(never)]
    fn fly(&mut self, motion: &Motion<T>) {
        let velocity = self.velocity_through_air(motion);
        self.follow_joints(motion, &velocity);
        let interval = P::keep(
            &self.dynamics,
            &self.sample,
            &Vector::from_components(velocity),
        );
        if let Some(start) = self.start.take() {
            self.state.motion = State::from_motion(&start, &interval);
        }
        let spread = match self.slopes {
            Slopes::Differences => None,
            Slopes::SigmaPoints => Some(self.factors.block(VELOCITY)),
        };
        let end = transition::fly(
            &self.dynamics,
            &interval,
            &self.process,
            &self.state,
            spread.as_ref(),
            self.duration,
            &mut self.slope,
        );
        let spin = &motion.angular_velocity.components;
        let variance = Vector3::from_fn(|axis, _| self.factors.variance(SPIN + axis));
        let trust = self.activity.damping_trust(spin, &variance);
        for (axis, trust) in trust.into_iter().enumerate() {
            for row in 0..MOTION_STATES {
                self.slope[(row, DAMPING + axis)] *= trust;
            }
        }
        // The comparison is false for NaN.
        let largest = T::single(LARGEST_SLOPE);
        if end.is_finite() && self.slope.iter().all(|v| v.abs() <= largest) {
            let after = end.motion.motion(&interval);
            let change = after.velocity_inertial() - motion.velocity_inertial();
            self.trail.push(change.components);
            let pushed = end.motion.linear_momentum - self.state.motion.linear_momentum;
            let mut force = pushed.components / (interval.mass() * self.duration);
            force.z += self.dynamics.gravity;
            let turn = after.angular_velocity - motion.angular_velocity;
            self.airflow = Airflow {
                force,
                turn: turn.components / self.duration,
            };
            self.state = end;
            if limit(&mut self.state.motion, &interval) {
                self.faults.motion = true;
            }
            covariance::cross(&mut self.factors, &self.slope, &self.process);
            self.constants.cross(&self.slope, &self.process);
        } else {
            self.slope.fill(T::zero());
            self.faults.motion = true;
        }
        self.interval = Some(interval);
    }

    /// Updates the process noise for the effect of joint errors in this interval.
    #[inline(never)]
    fn follow_joints(&mut self, motion: &Motion<T>, velocity: &Vector3<T>) {
        let length = |vector: Vector3<T>| vector.norm_squared().root();
        let across = length(motion.angular_velocity.components.cross(velocity));
        let turn = across * self.duration / length(*velocity);
        self.process
            .set_turn(if turn.is_finite() { turn } else { T::zero() });
        self.take_joint_errors(motion);
    }
}
