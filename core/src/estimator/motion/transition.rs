//! Propagation of the state and its covariance over an interval.
//!
//! The model is run once for the motion as it is, and once for each component of velocity and angular velocity, or
//! twice with sigma points. The other derivatives need no run: turning the body is the same as turning gravity and the
//! velocity the other way, and the loads of inputs and residual load are linear.

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

use super::process::Process;
use super::state::{
    ATTITUDE, DAMPING, FlightState, INPUT_STATES, MOTION_STATES, MUSCLE, RESIDUAL_FORCE,
    RESIDUAL_MOMENT, SPIN, STATES, VELOCITY, input_vector, inputs_of, motion_difference,
    moved_motion, turn_between,
};
use crate::dynamics::interval::Interval;
use crate::dynamics::step::Middle;
use crate::dynamics::{Dynamics, State};
use crate::estimator::factor::Cholesky;
use crate::frame::{Inertial, Vector};
use crate::math::{Real, inverse_symmetric};

/// Derivatives of the motion at the end of an interval with respect to all error coordinates at its start.
pub type MotionSlope<T> = SMatrix<T, MOTION_STATES, STATES>;

/// A change of the motion.
type Change<T> = SVector<T, MOTION_STATES>;

/// Size of the step for the derivatives that need a run: velocity (m/s), angular velocity (rad/s).
const STEPS: [f32; 2] = [0.5, 0.05];

/// Covariance of velocity and angular velocity.
pub type Spread<T> = SMatrix<T, POINTS, POINTS>;

/// Number of coordinates in which the model is not linear.
const POINTS: usize = MUSCLE - VELOCITY;

/// Distance of sigma points in deviations: with it they have the fourth moment of a Gaussian.
const DISTANCE: f64 = 1.732_050_807_568_877_2;

/// Runs the model from `start` over an interval of `duration` (s); returns the state at its end and the derivatives.
/// With a `spread` they are those of sigma points.
#[inline(never)]
pub fn fly<T: Real>(
    dynamics: &Dynamics<T>,
    interval: &impl Interval<T>,
    process: &Process<T>,
    start: &FlightState<T>,
    spread: Option<&Spread<T>>,
    duration: T,
    slope: &mut MotionSlope<T>,
) -> FlightState<T> {
    let density = dynamics.density_at(&start.motion);
    let (motion, inputs) = (&start.motion, &start.inputs);
    let step =
        |motion: &State<T>| dynamics.step_at_density(motion, interval, inputs, duration, density);
    let end = step(motion);
    let mean = if let Some(spread) = spread {
        let shift = sigma_points(&step, motion, &end, interval, spread, slope);
        moved_motion(&end, &shift, interval)
    } else {
        differences(&step, motion, &end, interval, slope);
        end
    };
    turned_columns(dynamics, interval, motion, &end, duration, slope);
    load_columns(dynamics, interval, start, &end, (density, duration), slope);
    let centre = process.centre();
    let inputs = input_vector(inputs);
    let decayed = centre + (inputs - centre).component_mul(&process.decay());
    FlightState {
        motion: mean,
        inputs: inputs_of(&decayed),
    }
}

/// Columns of velocity and angular velocity, by differences.
fn differences<T: Real>(
    step: &impl Fn(&State<T>) -> State<T>,
    motion: &State<T>,
    end: &State<T>,
    interval: &impl Interval<T>,
    slope: &mut MotionSlope<T>,
) {
    for column in VELOCITY..MUSCLE {
        let size = T::single(STEPS[column / 3 - 1]);
        let mut change = Change::zeros();
        change[column] = size;
        let side = step(&moved_motion(motion, &change, interval));
        let difference = motion_difference(end, &side, interval);
        slope.set_column(column, &(difference / size));
    }
}

/// The same columns by sigma points along the columns of the spread's Cholesky factor; returns the shift of the mean.
#[inline(never)]
fn sigma_points<T: Real>(
    step: &impl Fn(&State<T>) -> State<T>,
    motion: &State<T>,
    end: &State<T>,
    interval: &impl Interval<T>,
    spread: &Spread<T>,
    slope: &mut MotionSlope<T>,
) -> Change<T> {
    let root = Cholesky::new(spread);
    let distance = T::of(DISTANCE);
    let mut changes = SMatrix::<T, MOTION_STATES, POINTS>::zeros();
    let mut shift = Change::zeros();
    for point in 0..POINTS {
        let side = |sign: T| {
            let mut change = Change::zeros();
            for row in point..POINTS {
                change[VELOCITY + row] = root.lower()[(row, point)] * (sign * distance);
            }
            motion_difference(
                end,
                &step(&moved_motion(motion, &change, interval)),
                interval,
            )
        };
        let (after, before) = (side(T::one()), side(-T::one()));
        changes.set_column(point, &((after - before) / (distance * T::of(2.0))));
        shift += (after + before) / (distance * distance * T::of(2.0));
    }
    slope
        .fixed_columns_mut::<POINTS>(VELOCITY)
        .copy_from(&root.solve(&changes));
    shift
}

/// Columns of the attitude.
///
/// If everything turns with the body, so does the end. What does not turn with it, seen from the body, is turned back:
/// its velocity through the air, and gravity.
#[inline(never)]
fn turned_columns<T: Real>(
    dynamics: &Dynamics<T>,
    interval: &impl Interval<T>,
    start: &State<T>,
    end: &State<T>,
    duration: T,
    slope: &mut MotionSlope<T>,
) {
    let air = dynamics.air.velocity_at(&start.cg_position);
    let through_air = |state: &State<T>| state.linear_momentum / interval.mass() - air;
    let (before, after) = (through_air(start), through_air(end));
    let fallen = Vector::<T, Inertial>::new(T::zero(), T::zero(), -dynamics.gravity * duration);
    let body_from_inertial = end.inertial_from_body.inverse();
    for axis in 0..3 {
        let mut unit = Vector3::zeros();
        unit[axis] = T::one();
        let turn = start.inertial_from_body * Vector::from_components(unit);
        let back = before.cross(&turn).components;
        let mut column = Change::zeros();
        for (k, share) in back.iter().enumerate() {
            column += slope.column(VELOCITY + k) * *share;
        }
        for (first, part) in [
            (ATTITUDE, (body_from_inertial * turn).components),
            (VELOCITY, turn.cross(&(after - fallen)).components),
        ] {
            let mut rows = column.fixed_rows_mut::<3>(first);
            rows += part;
        }
        slope.set_column(ATTITUDE + axis, &column);
    }
}

/// Columns of the inputs and of the residual load, all of them constant loads over the interval.
#[inline(never)]
fn load_columns<T: Real>(
    dynamics: &Dynamics<T>,
    interval: &impl Interval<T>,
    start: &FlightState<T>,
    end: &State<T>,
    (density, duration): (T, T),
    slope: &mut MotionSlope<T>,
) {
    let middle = dynamics.middle(&start.motion, interval, duration * T::of(0.5));
    let velocity = &middle.velocity_through_air;
    let loads = interval.unit_loads(dynamics, velocity, &middle.spin, density);
    let damping = start.inputs.damping.to_vector() * loads.damping;
    // The step turns the body at its mean angular velocity.
    let turned = turn_between(&start.motion.inertial_from_body, &end.inertial_from_body);
    let mean_spin = turned / duration;
    let pressure = T::of(0.5) * density * velocity.norm_squared();
    let push = middle.inertial_from_middle.matrix() * (duration / interval.mass());
    let turns = turns_by_moments(interval, end, &middle, &damping, duration);
    let cg = interval.cg().components;
    for (axis, turn) in turns.iter().enumerate() {
        let muscle = &loads.muscle[axis];
        let moment = muscle.moment - cg.cross(&muscle.force);
        let mut by_muscle = turns[0] * moment.x + turns[1] * moment.y + turns[2] * moment.z;
        let mut by_force = Change::zeros();
        for k in 0..3 {
            by_muscle[VELOCITY + k] = push.row(k).transpose().dot(&muscle.force);
            by_force[VELOCITY + k] = push[(k, axis)] * pressure;
        }
        slope.set_column(MUSCLE + axis, &by_muscle);
        let damped = -loads.damping * mean_spin[axis];
        slope.set_column(DAMPING + axis, &(turn * damped));
        slope.set_column(RESIDUAL_FORCE + axis, &by_force);
        slope.set_column(RESIDUAL_MOMENT + axis, &(turn * pressure));
    }
}

/// Change by a moment of 1 N m about each axis of the middle; the damping takes a part of it.
fn turns_by_moments<T: Real>(
    interval: &impl Interval<T>,
    end: &State<T>,
    middle: &Middle<T>,
    damping: &Vector3<T>,
    duration: T,
) -> [Change<T>; 3] {
    let half_damping = damping * (duration * T::of(0.5));
    let implicit = *interval.inertia() + Matrix3::from_diagonal(&half_damping);
    let body_from_inertial = end.inertial_from_body.inverse().to_matrix();
    let momentum = (&body_from_inertial * end.angular_momentum).components;
    let compliance = inverse_symmetric(&implicit).unwrap_or_else(Matrix3::zeros);
    let mut turns = [Change::zeros(); 3];
    for (axis, turn) in turns.iter_mut().enumerate() {
        let spin: Vector3<T> = compliance.column(axis) * duration;
        let angle = spin * (duration * T::of(0.5));
        let mut impulse = -half_damping.component_mul(&spin);
        impulse[axis] += duration;
        let kept = &middle.inertial_from_middle * Vector::from_components(impulse);
        let kept = (&body_from_inertial * kept).components;
        let spin = interval.inverse_inertia() * (kept + momentum.cross(&angle));
        for k in 0..3 {
            turn[ATTITUDE + k] = angle[k];
            turn[SPIN + k] = spin[k];
        }
    }
    turns
}

/// Propagates the covariance over the interval in place, `Phi P Phi^T + Q`, using the structure of Phi. The filter does
/// the same to its [factors](super::covariance).
pub fn spread<T: Real>(
    covariance: &mut SMatrix<T, STATES, STATES>,
    slope: &MotionSlope<T>,
    process: &Process<T>,
) {
    let decay = process.decay();
    // Rows of the motion: Phi_m P, which is then multiplied by the decay of each input and by Phi_m^T.
    let flown: MotionSlope<T> = slope * *covariance;
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
        let rotation = Rotation::<f64, Inertial, _>::from_quaternion(*attitude);
        rotation.inverse() * Vector::new(4.0, -2.0, -48.0)
    }

    #[test]
    fn small_errors_cross_an_interval_along_the_slope() {
        let (dynamics, interval, start) = flight();
        let process = Process::new(&MOTION, STEP).unwrap();
        let mut slope = MotionSlope::zeros();
        let end = fly(
            &dynamics, &interval, &process, &start, None, STEP, &mut slope,
        );
        let sizes = [1e-4, 1e-3, 1e-3, 1e-3, 1e-3, 1e-4, 1e-4];
        for column in 0..STATES {
            let mut error = SVector::<f64, STATES>::zeros();
            error[column] = sizes[column / 3];
            let moved = start.moved(&error, &interval);
            let mut unused = MotionSlope::zeros();
            let side = fly(
                &dynamics,
                &interval,
                &process,
                &moved,
                None,
                STEP,
                &mut unused,
            );
            let found = end.difference(&side, &interval);
            let expected = slope * error;
            for row in 0..MOTION_STATES {
                let tolerance = 0.004 * expected.norm() + 1e-9;
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

    /// Within small deviations both are the derivatives; within large ones the mean and the slope are those of many
    /// samples.
    #[test]
    fn sigma_points_agree_with_differences_and_with_samples() {
        let (dynamics, interval, start) = flight();
        let process = Process::new(&MOTION, STEP).unwrap();
        let fly = |spread: Option<&Spread<f64>>| {
            let mut slope = MotionSlope::zeros();
            (
                fly(
                    &dynamics, &interval, &process, &start, spread, STEP, &mut slope,
                ),
                slope,
            )
        };
        let (end, by_differences) = fly(None);
        let root = |size: f64| {
            SMatrix::<f64, POINTS, POINTS>::from_fn(|i, j| {
                let scale = if i < 3 { 1.0 } else { 0.1 };
                let mix = libm::sin(1.0 + (3 * i + j) as f64);
                size * scale * if i == j { 1.0 } else { 0.3 * mix }
            })
        };
        let narrow = root(1e-2);
        let (_, narrow) = fly(Some(&(narrow * narrow.transpose())));
        assert!((narrow - by_differences).abs().max() < 2e-3 * by_differences.abs().max());

        let wide = root(8.0);
        let (shifted, slope) = fly(Some(&(wide * wide.transpose())));
        let shift = end.difference(&shifted, &interval);
        let mut mean = SVector::<f64, STATES>::zeros();
        let mut noise = 1_u64;
        let mut normal = || {
            (0..12)
                .map(|_| {
                    noise = noise
                        .wrapping_mul(6_364_136_223_846_793_005)
                        .wrapping_add(1);
                    (noise >> 11) as f64 / (1_u64 << 53) as f64
                })
                .sum::<f64>()
                - 6.0
        };
        let samples = 40_000;
        let mut unexplained = 0.0;
        let mut whole = 0.0;
        for _ in 0..samples {
            let error = wide * SVector::<f64, POINTS>::from_fn(|_, _| normal());
            let mut moved = SVector::<f64, STATES>::zeros();
            moved.fixed_rows_mut::<POINTS>(VELOCITY).copy_from(&error);
            let mut unused = MotionSlope::zeros();
            let side = start.moved(&moved, &interval);
            let side = super::fly(
                &dynamics,
                &interval,
                &process,
                &side,
                None,
                STEP,
                &mut unused,
            );
            let difference = end.difference(&side, &interval);
            mean += difference / f64::from(samples);
            let expected = slope * moved;
            for row in VELOCITY..VELOCITY + 3 {
                unexplained += (difference[row] - shift[row] - expected[row]).powi(2);
                whole += difference[row].powi(2);
            }
        }
        for row in VELOCITY..VELOCITY + 3 {
            let error = 4.0 * (whole / 3.0).sqrt() / f64::from(samples);
            assert!(
                (mean[row] - shift[row]).abs() < error.max(0.02),
                "{row}: {} {}",
                mean[row],
                shift[row]
            );
        }
        assert!(unexplained < 1e-3 * whole, "{unexplained} of {whole}");
    }

    #[test]
    fn the_covariance_crosses_as_the_whole_product_does() {
        let (dynamics, interval, start) = flight();
        let mut process = Process::new(&MOTION, STEP).unwrap();
        process.set_sensitivity(&SMatrix::from_fn(|i, j| if i == j { 0.3 } else { 0.1 }));
        let mut slope = MotionSlope::zeros();
        let _ = fly(
            &dynamics, &interval, &process, &start, None, STEP, &mut slope,
        );
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
