//! One step of the momentum form, with the forces evaluated once, at the middle of the interval.
//!
//! The attitude is predicted at the middle of the interval, where posture and forces are evaluated, and then rotated
//! by the mean angular velocity over the whole interval: second order in posture and attitude. The damping moment is
//! integrated by the trapezium rule, which is stable for any positive coefficient and tolerates small negative ones.
//! Momenta change by impulses alone, so without loads they stay bit-identical.

use nalgebra::{Matrix3, Vector3};

use super::interval::Interval;
use super::{Dynamics, Inputs, State};
use crate::aerodynamics::Loads;
use crate::frame::{Body as BodyFrame, Inertial, Rotation, RotationMatrix, Vector};
use crate::math::{Lanes, renormalized, small_rotation, solve_symmetric_or};

/// Time step of simulation and filter (s), the sample interval of Xsens recordings.
pub const TIME_STEP: f64 = 1.0 / 240.0;

impl<T: Lanes> Dynamics<T> {
    /// Force, moment and damping of a posed body, see [`Interval::loads`].
    #[inline]
    pub fn loads(
        &self,
        interval: &impl Interval<T>,
        inputs: &Inputs<T>,
        velocity_through_air: &Vector<T, BodyFrame>,
        spin: &Vector<T, BodyFrame>,
        density: T,
    ) -> (Loads<T>, Vector3<T>) {
        interval.loads(self, inputs, velocity_through_air, spin, density)
    }

    /// Advances `state` by `duration` (s) while the body moves as in `sample` and the inputs are constant.
    pub fn step(
        &self,
        state: &State<T>,
        sample: &impl Interval<T>,
        inputs: &Inputs<T>,
        duration: T,
    ) -> State<T> {
        let density = self.density_at(state);
        self.step_at_density(state, sample, inputs, duration, density)
    }

    /// Returns the density of the air at the height of the centre of gravity (kg/m3).
    pub fn density_at(&self, state: &State<T>) -> T {
        self.air.density.at(state.cg_position.up())
    }

    /// Returns the motion at the middle of an interval, `half` its duration (s) after `state`.
    #[inline(always)]
    pub fn middle(&self, state: &State<T>, sample: &impl Interval<T>, half: T) -> Middle<T> {
        // Predict the attitude at the middle of the interval from the present angular velocity.
        let momentum = state.inertial_from_body.inverse() * state.angular_momentum;
        let spin = sample.angular_velocity(&momentum);
        let inertial_from_middle = turned(&state.inertial_from_body, &spin, half);

        // Forces at the middle of the interval. Vectors constant in inertial axes rotate with the attitude.
        let inertial_from_middle = inertial_from_middle.to_matrix();
        let middle_from_inertial = inertial_from_middle.inverse();
        let angular_momentum = &middle_from_inertial * state.angular_momentum;
        // Momentum relative to the air; the air's velocity is rotated into the body axes of the middle.
        let air = self.air.velocity_at(&state.cg_position);
        let relative_momentum = state.linear_momentum - air * sample.mass();
        let linear_momentum = &middle_from_inertial * relative_momentum;
        let spin = sample.angular_velocity(&angular_momentum);
        Middle {
            inertial_from_middle,
            velocity_through_air: sample.origin_velocity(&linear_momentum, &spin),
            spin,
        }
    }

    /// Same as [`Dynamics::step`] with a given density (kg/m3), which many runs over a short time can share.
    #[inline]
    pub fn step_at_density(
        &self,
        state: &State<T>,
        sample: &impl Interval<T>,
        inputs: &Inputs<T>,
        duration: T,
        density: T,
    ) -> State<T> {
        let half = duration * T::of(0.5);
        let Middle {
            inertial_from_middle,
            velocity_through_air: velocity,
            spin,
        } = self.middle(state, sample, half);
        let (loads, damping) = self.loads(sample, inputs, &velocity, &spin, density);
        let mut force = Vector::<T, BodyFrame>::from_components(loads.force);
        let mut moment = Vector::from_components(loads.moment) - sample.cg().cross(&force);
        if !inputs.residual.is_none() {
            let pressure = T::of(0.5) * density * velocity.norm_squared();
            force += inputs.residual.force * pressure;
            moment += inputs.residual.moment * pressure;
        }

        // Trapezium rule for the damping: (I + D dt/2) W1 = (I - D dt/2) W0 + M dt.
        let half_damping = damping * half;
        let push = moment * duration;
        let implicit = *sample.inertia() + Matrix3::from_diagonal(&half_damping);
        let explicit = sample.inertia() * spin - spin.component_mul(&half_damping) + push;
        let next_spin = Vector::from_components(solve_symmetric_or(
            &implicit,
            &explicit.components,
            &spin.components,
        ));
        let mean_spin = (spin + next_spin) * T::of(0.5);
        let push = push - mean_spin.component_mul(&damping) * duration;
        let weight = -self.gravity * sample.mass();
        let gravity_impulse = Vector::new(T::zero(), T::zero(), weight * duration);
        let impulse = &inertial_from_middle * (force * duration) + gravity_impulse;
        let start = state.linear_momentum;

        State {
            inertial_from_body: turned(&state.inertial_from_body, &mean_spin, duration),
            cg_position: state.cg_position
                + (start + impulse * T::of(0.5)) * (duration / sample.mass()),
            linear_momentum: start + impulse,
            angular_momentum: state.angular_momentum + &inertial_from_middle * push,
        }
    }
}

/// The motion at which a step evaluates the forces, in the body axes of the middle of its interval.
#[derive(Debug, Clone, Copy)]
pub struct Middle<T: Lanes> {
    /// Attitude.
    pub inertial_from_middle: RotationMatrix<T, Inertial, BodyFrame>,
    /// Velocity of the origin through the air (m/s).
    pub velocity_through_air: Vector<T, BodyFrame>,
    /// Angular velocity (rad/s).
    pub spin: Vector<T, BodyFrame>,
}

/// Attitude after rotating at `angular_velocity` (rad/s) for `duration` (s), paper eq. (quat).
#[inline]
fn turned<T: Lanes>(
    inertial_from_body: &Rotation<T, Inertial, BodyFrame>,
    angular_velocity: &Vector<T, BodyFrame>,
    duration: T,
) -> Rotation<T, Inertial, BodyFrame> {
    let turn = small_rotation(&(*angular_velocity * duration).components);
    let product = **inertial_from_body.quaternion() * *turn;
    Rotation::from_quaternion(renormalized(product))
}
