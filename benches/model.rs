//! Cost of the model: one posture sample, one step in both forms, a whole flight.
#![expect(clippy::expect_used, reason = "a bench that cannot start should panic")]

use std::hint::black_box;

use bodyflight_core::aerodynamics::{Flow, total_load};
use bodyflight_core::body::anthropometry::{Person, Sex};
use bodyflight_core::body::pattern;
use bodyflight_core::dynamics::step::TIME_STEP;
use bodyflight_core::dynamics::{Dynamics, Inputs, Motion, PostureSample, State};
use bodyflight_core::frame::Vector;
use bodyflight_core::maneuver::Maneuver;
use bodyflight_core::{Posture, Real};
use criterion::{Criterion, criterion_group, criterion_main};
use nalgebra::Vector3;

struct Case<T: Real> {
    dynamics: Dynamics<T>,
    postures: Vec<Posture<T>>,
    inputs: Inputs<T>,
    state: State<T>,
    sample: PostureSample<T>,
    step: T,
}

/// Five seconds of turns at 240 Hz.
fn case<T: Real>() -> Case<T> {
    let body = Person::new(1.75, 75.0, Sex::Male)
        .body()
        .expect("a valid person");
    let dynamics = Dynamics::<f64>::paper(body, 1.0).cast::<T>();
    let maneuver = Maneuver::from_name("rotations").expect("known");
    let postures: Vec<Posture<T>> = (0..1200)
        .map(|k| maneuver.posture(f64::from(k) * TIME_STEP))
        .collect();
    let sample = dynamics.hold(&pattern::neutral());
    let inertial_from_body = maneuver.start_attitude();
    let start = Motion {
        inertial_from_body,
        position: Vector::zero(),
        velocity: inertial_from_body.inverse() * Vector::new(T::zero(), T::zero(), T::of(-50.0)),
        angular_velocity: Vector::zero(),
    };
    Case {
        state: State::from_motion(&start, &sample),
        dynamics,
        postures,
        inputs: Inputs::belly_turn(),
        sample,
        step: T::of(TIME_STEP),
    }
}

fn model<T: Real>(criterion: &mut Criterion, precision: &str) {
    let case = case::<T>();
    let mut group = criterion.benchmark_group(precision);
    let (from, to) = (&case.postures[300], &case.postures[301]);
    group.bench_function("posture sample", |b| {
        b.iter(|| {
            case.dynamics
                .between(black_box(from), black_box(to), case.step)
        });
    });
    let flow = Flow::new(
        &Vector3::new(T::of(1.0), T::of(-50.0), T::of(3.0)),
        T::one(),
    );
    group.bench_function("loads, plain", |b| {
        b.iter(|| total_load(&case.sample.aerodynamics.segments, black_box(&flow)));
    });
    group.bench_function("loads, compiled", |b| {
        b.iter(|| case.sample.aerodynamics.total_load(black_box(&flow)));
    });
    group.bench_function("step, posture shared", |b| {
        b.iter(|| {
            case.dynamics.step(
                black_box(&case.state),
                &case.sample,
                &case.inputs,
                case.step,
            )
        });
    });
    group.bench_function("step, posture recomputed", |b| {
        b.iter(|| {
            let sample = case
                .dynamics
                .between(black_box(from), black_box(to), case.step);
            case.dynamics
                .step(&case.state, &sample, &case.inputs, case.step)
        });
    });
    group.sample_size(10);
    group.bench_function("flight of 55 s", |b| {
        b.iter(|| {
            let mut state = case.state;
            for _ in 0..11 {
                for pair in case.postures.windows(2) {
                    let sample = case.dynamics.between(&pair[0], &pair[1], case.step);
                    state = case.dynamics.step(&state, &sample, &case.inputs, case.step);
                }
            }
            state
        });
    });
    group.finish();
}

fn both(criterion: &mut Criterion) {
    model::<f32>(criterion, "f32");
    model::<f64>(criterion, "f64");
}

criterion_group!(benches, both);
criterion_main!(benches);
