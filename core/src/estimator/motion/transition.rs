//! Propagation of the state and its covariance over an interval.
//!
//! The model is run once for the motion as it is and once for each error coordinate with an effect of its own; the
//! effect of a residual load is computed without a run.

use nalgebra::{SMatrix, SVector};

use super::settings::Process;
use super::state::{
    ATTITUDE, FlightState, INPUT_STATES, MOTION_STATES, MUSCLE, RESIDUAL_FORCE, RESIDUAL_MOMENT,
    SPIN, STATES, VELOCITY, input_vector, inputs_of, motion_difference, moved_motion,
};
use crate::dynamics::interval::Interval;
use crate::dynamics::{Dynamics, Inputs, State};
use crate::math::Real;

/// Derivatives of the motion at the end of an interval with respect to all error coordinates at its start.
pub type MotionSlope<T> = SMatrix<T, MOTION_STATES, STATES>;

/// Size of the step for each derivative: rotation (rad), velocity (m/s), angular velocity (rad/s), muscle input,
/// damping.
const ERRORS: [f32; 5] = [0.01, 0.5, 0.05, 0.25, 0.5];

/// Runs the model from `start` over an interval of `duration` (s); returns the state at its end and the derivatives.
#[inline(never)]
pub fn fly<T: Real>(
    dynamics: &Dynamics<T>,
    interval: &impl Interval<T>,
    process: &Process<T>,
    start: &FlightState<T>,
    duration: T,
    slope: &mut MotionSlope<T>,
) -> FlightState<T> {
    let density = dynamics.density_at(&start.motion);
    let step = |motion: &State<T>, inputs: &Inputs<T>| {
        dynamics.step_at_density(motion, interval, inputs, duration, density)
    };
    let end = step(&start.motion, &start.inputs);
    for column in 0..RESIDUAL_FORCE {
        let error = T::single(ERRORS[column / 3]);
        let side = if column < MUSCLE {
            let mut change = SVector::zeros();
            change[column] = error;
            step(
                &moved_motion(&start.motion, &change, interval),
                &start.inputs,
            )
        } else {
            let mut inputs = input_vector(&start.inputs);
            inputs[column - MUSCLE] += error;
            step(&start.motion, &inputs_of(&inputs))
        };
        let difference = motion_difference(&end, &side, interval);
        slope.set_column(column, &(difference / error));
    }
    residual_columns(dynamics, interval, start, density, duration, slope);
    let centre = process.centre();
    let inputs = input_vector(&start.inputs);
    let decayed = centre + (inputs - centre).component_mul(&process.decay());
    FlightState {
        motion: end,
        inputs: inputs_of(&decayed),
    }
}

/// Columns of the residual load, which changes the momenta for the duration of the interval.
fn residual_columns<T: Real>(
    dynamics: &Dynamics<T>,
    interval: &impl Interval<T>,
    start: &FlightState<T>,
    density: T,
    duration: T,
    slope: &mut MotionSlope<T>,
) {
    let pressure = dynamic_pressure(dynamics, interval, start, density);
    let rotation = start
        .motion
        .inertial_from_body
        .quaternion()
        .to_rotation_matrix()
        .into_inner();
    let push = rotation * (duration * pressure / interval.mass());
    let spin = interval.inverse_inertia() * (duration * pressure);
    for axis in 0..3 {
        let mut force = SVector::<T, MOTION_STATES>::zeros();
        force
            .fixed_rows_mut::<3>(VELOCITY)
            .copy_from(&push.column(axis));
        slope.set_column(RESIDUAL_FORCE + axis, &force);
        let mut moment = SVector::<T, MOTION_STATES>::zeros();
        let turned = spin.column(axis).into_owned();
        moment.fixed_rows_mut::<3>(SPIN).copy_from(&turned);
        moment
            .fixed_rows_mut::<3>(ATTITUDE)
            .copy_from(&(turned * (duration * T::of(0.5))));
        slope.set_column(RESIDUAL_MOMENT + axis, &moment);
    }
}

/// Dynamic pressure of the airstream (Pa).
fn dynamic_pressure<T: Real>(
    dynamics: &Dynamics<T>,
    interval: &impl Interval<T>,
    start: &FlightState<T>,
    density: T,
) -> T {
    let air = dynamics.air.velocity_at(&start.motion.cg_position);
    let velocity = start.motion.linear_momentum / interval.mass() - air;
    T::of(0.5) * density * velocity.norm_squared()
}

/// Propagates the covariance over the interval in place, `Phi P Phi^T + Q`, using the structure of Phi.
#[inline(never)]
pub fn spread<T: Real>(
    covariance: &mut SMatrix<T, STATES, STATES>,
    slope: &MotionSlope<T>,
    process: &Process<T>,
) {
    let decay = process.decay();
    // Rows of the motion: Phi_m P, which is then multiplied by the decay of each input and by Phi_m^T.
    #[expect(
        clippy::op_ref,
        reason = "by value it would first be copied to the unit's stack"
    )]
    let flown: MotionSlope<T> = slope * &*covariance;
    for j in 0..MOTION_STATES {
        for i in 0..=j {
            let mut sum = T::zero();
            for k in 0..STATES {
                sum += flown[(i, k)] * slope[(j, k)];
            }
            covariance[(i, j)] = sum;
            covariance[(j, i)] = sum;
        }
    }
    for j in 0..INPUT_STATES {
        for i in 0..MOTION_STATES {
            let value = flown[(i, MUSCLE + j)] * decay[j];
            covariance[(i, MUSCLE + j)] = value;
            covariance[(MUSCLE + j, i)] = value;
        }
        for i in 0..INPUT_STATES {
            covariance[(MUSCLE + i, MUSCLE + j)] *= decay[i] * decay[j];
        }
    }
    process.add_noise(covariance);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::pattern;
    use crate::dynamics::{Inputs, Motion, PostureSample};
    use crate::estimator::motion::settings::MOTION;
    use crate::frame::{Rotation, Vector};
    use crate::test_body::reference_body;
    use nalgebra::UnitQuaternion;

    const STEP: f64 = 1.0 / 240.0;

    fn flight() -> (Dynamics<f64>, PostureSample<f64>, FlightState<f64>) {
        let dynamics = Dynamics::paper(reference_body(), 1.0);
        let interval = dynamics.hold(&pattern::neutral());
        let attitude = UnitQuaternion::from_euler_angles(1.4, 0.2, 0.3);
        let motion = Motion {
            inertial_from_body: Rotation::from_quaternion(attitude),
            position: Vector::zero(),
            velocity: attitude_velocity(&attitude),
            angular_velocity: Vector::new(0.4, 1.5, -0.7),
        };
        let mut inputs = Inputs::belly_turn();
        inputs.muscle = [0.3, -0.2, 0.4].into();
        let start = FlightState {
            motion: State::from_motion(&motion, &interval),
            inputs,
        };
        (dynamics, interval, start)
    }

    fn attitude_velocity(attitude: &UnitQuaternion<f64>) -> Vector<f64, crate::frame::Body> {
        let rotation = Rotation::<f64, crate::frame::Inertial, _>::from_quaternion(*attitude);
        rotation.inverse() * Vector::new(4.0, -2.0, -48.0)
    }

    #[test]
    fn small_errors_cross_an_interval_along_the_slope() {
        let (dynamics, interval, start) = flight();
        let process = Process::new(&MOTION, STEP).unwrap();
        let mut slope = MotionSlope::zeros();
        let end = fly(&dynamics, &interval, &process, &start, STEP, &mut slope);
        let sizes = [1e-4, 1e-3, 1e-3, 1e-3, 1e-3, 1e-4, 1e-4];
        for column in 0..STATES {
            let mut error = SVector::<f64, STATES>::zeros();
            error[column] = sizes[column / 3];
            let moved = start.moved(&error, &interval);
            let mut unused = MotionSlope::zeros();
            let side = fly(&dynamics, &interval, &process, &moved, STEP, &mut unused);
            let found = end.difference(&side, &interval);
            let expected = slope * error;
            for row in 0..MOTION_STATES {
                // The derivative with respect to a residual load neglects the damping over one interval.
                let tolerance = 0.06 * expected.norm() + 1e-9;
                let gap = (found[row] - expected[row]).abs();
                assert!(
                    gap < tolerance,
                    "{row} {column}: {} {}",
                    found[row],
                    expected[row]
                );
            }
        }
    }

    #[test]
    fn the_covariance_crosses_as_the_whole_product_does() {
        let (dynamics, interval, start) = flight();
        let mut process = Process::new(&MOTION, STEP).unwrap();
        process.set_sensitivity(&SMatrix::from_fn(|i, j| if i == j { 0.3 } else { 0.1 }));
        let mut slope = MotionSlope::zeros();
        let _ = fly(&dynamics, &interval, &process, &start, STEP, &mut slope);
        let mut covariance = SMatrix::<f64, STATES, STATES>::from_fn(|i, j| {
            let mix = |k: usize| libm::sin(1.0 + k as f64);
            mix(i) * mix(j) + if i == j { 1.0 } else { 0.0 }
        });
        let mut whole = SMatrix::<f64, STATES, STATES>::zeros();
        whole.fixed_rows_mut::<MOTION_STATES>(0).copy_from(&slope);
        for k in 0..INPUT_STATES {
            whole[(MUSCLE + k, MUSCLE + k)] = process.decay()[k];
        }
        let mut expected = whole * covariance * whole.transpose();
        process.add_noise(&mut expected);
        spread(&mut covariance, &slope, &process);
        assert!((covariance - expected).abs().max() < 1e-12);
        assert!(covariance.cholesky().is_some());
    }
}
