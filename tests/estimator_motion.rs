//! The motion filter in the unit's precision and steps: a fast turn, and ten minutes of constant input.

use bodyflight_core::body::pattern;
use bodyflight_core::dynamics::muscle_input::{BACK_TRACKING, MuscleForces};
use bodyflight_core::dynamics::step::TIME_STEP;
use bodyflight_core::dynamics::{Dynamics, Inputs, Motion, State};
use bodyflight_core::estimator::motion::ReducedMotionFilter;
use bodyflight_core::estimator::motion::measurement::MotionMeasurement;
use bodyflight_core::estimator::motion::settings::MOTION;
use bodyflight_core::estimator::motion::state::MUSCLE;
use bodyflight_core::estimator::motion::watch::Consistency;
use bodyflight_core::frame::{Inertial, Rotation, Vector, facing_north};
use bodyflight_core::math::small_rotation;
use bodyflight_tests::estimator_flights::Noise;
use bodyflight_tests::range_watch::RangeWatch;
use bodyflight_tests::{reference, reference_body};
use nalgebra::Vector3;

/// Length of the flight (s).
const LENGTH: u32 = 600;
/// Constant muscle input in pitch.
const PITCH: f64 = 0.4;

/// A motion measured with the paper's noise; as in recordings, the angular velocity is measured in inertial axes.
fn seen(motion: &Motion<f64>, noise: &mut Noise) -> MotionMeasurement<f64> {
    let mut vector = |sizes: [f64; 3]| Vector3::from(sizes.map(|size| noise.normal(size)));
    let tilt = small_rotation(&vector([0.01; 3]));
    let attitude = Rotation::from_quaternion(motion.inertial_from_body.quaternion() * tilt);
    let velocity = vector([0.1, 0.1, 1.0]);
    let spin = motion.inertial_from_body * motion.angular_velocity
        + Vector::<_, Inertial>::from_components(vector([0.03; 3]));
    MotionMeasurement {
        inertial_from_body: Some(attitude),
        angular_velocity: Some(attitude.inverse() * spin),
        velocity: Some(
            motion.velocity_inertial() + Vector::<_, Inertial>::from_components(velocity),
        ),
        horizontal_speed: None,
    }
}

#[test]
fn a_fast_turn_is_consistent_though_attitude_noise_turns_the_angular_velocity() {
    let Some(table) = reference("segments.json") else {
        return;
    };
    let dynamics = Dynamics::paper(reference_body(&table), 1.0);
    let attitude = facing_north(core::f64::consts::FRAC_PI_2);
    let start = Motion {
        inertial_from_body: attitude,
        position: Vector::zero(),
        velocity: attitude.inverse() * Vector::new(0.0, 0.0, -50.0),
        angular_velocity: Vector::new(0.0, 12.0, 0.0),
    };
    let posture = pattern::neutral();
    let interval = dynamics.hold(&posture);
    let mut flown = State::from_motion(&start, &interval);
    let mut inputs = Inputs::belly_turn();
    inputs.damping.yaw = 0.0;
    let recorded = posture.cast();
    let filter =
        ReducedMotionFilter::<f32>::new(&MOTION, &dynamics.cast(), &start.cast(), &recorded);
    let mut filter = Box::new(filter.unwrap());
    let (mut noise, mut ranges) = (Noise::new(2), RangeWatch::default());
    let (mut estimates, mut inconsistent, mut squares) = (0.0f32, 0.0, 0.0);
    for _ in 1..=5 * 240 {
        flown = dynamics.step(&flown, &interval, &inputs, TIME_STEP);
        let measured = seen(&flown.motion(&interval), &mut noise);
        let pushed = filter.push_recorded(&recorded, &measured.cast().into(), &mut ranges);
        ranges.see(&filter);
        if let Some(estimate) = pushed {
            estimates += 1.0;
            squares += estimate.normalised_innovation;
            inconsistent += f32::from(u8::from(estimate.consistency != Consistency::Consistent));
        }
    }
    let spin = flown.motion(&interval).angular_velocity.components[1];
    let mean = squares / estimates;
    println!("at the end {spin} rad/s, mean square {mean}");
    assert!(spin > 8.0 && (0.8..1.3).contains(&mean), "{spin} {mean}");
    assert!(
        inconsistent < 0.02 * estimates,
        "{inconsistent} of {estimates}"
    );
}

#[test]
fn ten_minutes_of_constant_input_lose_nothing_in_single_precision() {
    let Some(table) = reference("segments.json") else {
        return;
    };
    let dynamics = Dynamics {
        muscles: BACK_TRACKING.with_forces(MuscleForces::Moment),
        ..Dynamics::paper(reference_body(&table), 1.0)
    };
    let attitude = facing_north(core::f64::consts::FRAC_PI_2);
    let start = Motion {
        inertial_from_body: attitude,
        position: Vector::zero(),
        velocity: attitude.inverse() * Vector::new(0.0, 0.0, -50.0),
        angular_velocity: Vector::zero(),
    };
    let posture = pattern::neutral();
    let interval = dynamics.hold(&posture);
    let mut flown = State::from_motion(&start, &interval);
    let mut inputs = Inputs::belly_turn();
    inputs.muscle.pitch = PITCH;
    let recorded = posture.cast();
    let filter =
        ReducedMotionFilter::<f32>::new(&MOTION, &dynamics.cast(), &start.cast(), &recorded);
    let mut filter = Box::new(filter.unwrap());
    let (mut noise, mut ranges) = (Noise::new(1), RangeWatch::default());
    let (mut estimates, mut wrong, mut inconsistent) = (0.0, 0.0, 0.0);
    for k in 1..=LENGTH * 240 {
        flown = dynamics.step(&flown, &interval, &inputs, TIME_STEP);
        let measured = seen(&flown.motion(&interval), &mut noise);
        let pushed = filter.push_recorded(&recorded, &measured.cast().into(), &mut ranges);
        ranges.see(&filter);
        let Some(estimate) = pushed else {
            continue;
        };
        if k < 10 * 240 {
            continue;
        }
        let error = (estimate.inputs.muscle.pitch - PITCH as f32).abs();
        let deviation = estimate.deviation[MUSCLE];
        assert!(error.is_finite() && deviation > 0.0, "{k}");
        estimates += 1.0;
        wrong += f64::from(u8::from(error > 2.0 * deviation));
        inconsistent += f64::from(u8::from(estimate.consistency != Consistency::Consistent));
    }
    println!(
        "outside 2 sd {}, not consistent {}",
        wrong / estimates,
        inconsistent / estimates
    );
    assert!(wrong < 0.1 * estimates, "{wrong} of {estimates}");
    assert!(
        inconsistent < 0.01 * estimates,
        "{inconsistent} of {estimates}"
    );
}
