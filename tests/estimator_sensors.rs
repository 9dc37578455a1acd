//! The motion filter with the sensors of a wearable, in the unit's precision and steps: a receiver, a gyroscope and an
//! accelerometer without a suit, on the ground, in an aircraft, and in a fall. The flights are the same model's; noise,
//! wind, biases and drag are not those that the filter assumes.

use bodyflight_core::air::STANDARD_GRAVITY;
use bodyflight_core::body::anthropometry::{Person, Sex};
use bodyflight_core::body::pattern;
use bodyflight_core::dynamics::muscle_input::BACK_TRACKING;
use bodyflight_core::dynamics::trim::{trim, with_knees};
use bodyflight_core::dynamics::{Dynamics, Inputs, Motion, PostureSample, State};
use bodyflight_core::estimator::motion::ReducedMotionFilter;
use bodyflight_core::estimator::motion::estimate::MotionEstimate;
use bodyflight_core::estimator::motion::measurement::{MotionMeasurement, SensorMeasurement};
use bodyflight_core::estimator::motion::sensors::{
    Barometer, Gyroscope, ReceiverVelocity, SpecificForce,
};
use bodyflight_core::estimator::motion::settings::{MOTION, MotionPreset};
use bodyflight_core::estimator::motion::state::{ATTITUDE, MUSCLE, RESIDUAL_FORCE, SPIN, VELOCITY};
use bodyflight_core::estimator::motion::support::Situation;
use bodyflight_core::estimator::motion::watch::Consistency;
use bodyflight_core::frame::{Body, Inertial, Rotation, Vector, facing_north};
use bodyflight_core::math::small_rotation;
use bodyflight_core::{Posture, Real, Segment};
use bodyflight_tests::estimator_flights::Noise;
use bodyflight_tests::range_watch::RangeWatch;
use nalgebra::Vector3;

/// Sample rate (Hz).
const RATE: f64 = 100.0;
/// Place of the sensor on the chest (m).
const ARM: [f64; 3] = [0.05, 0.25, 0.1];
/// Bias of the gyroscope (rad/s).
const BIAS: [f64; 3] = [0.02, -0.03, 0.015];

/// One arm up, the other down.
const ARMS: &pattern::JointAngles = &[
    (Segment::LeftUpperArm, [0.0, 0.0, 1.0]),
    (Segment::RightUpperArm, [0.0, 0.0, -1.0]),
];

struct Flyer {
    dynamics: Dynamics<f64>,
    posture: Posture<f64>,
    motion: Motion<f64>,
}

/// A person in a trimmed belly fall.
fn flyer() -> Flyer {
    let body = Person::new(1.75, 75.0, Sex::Male).body().unwrap();
    let dynamics = Dynamics {
        muscles: BACK_TRACKING,
        ..Dynamics::paper(body, 1.0)
    };
    let fall = trim(&dynamics, &pattern::neutral(), 0.0).unwrap();
    let attitude = facing_north(fall.body_pitch);
    Flyer {
        posture: with_knees(&pattern::neutral(), fall.knee),
        motion: Motion {
            inertial_from_body: attitude,
            position: Vector::zero(),
            velocity: attitude.inverse() * Vector::new(0.0, 0.0, -fall.terminal_speed),
            angular_velocity: Vector::zero(),
        },
        dynamics,
    }
}

fn vector(noise: &mut Noise, size: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| noise.normal(size))
}

fn filter(flyer: &Flyer, posture: &Posture<f64>) -> Box<ReducedMotionFilter<f32>> {
    let preset = MotionPreset {
        sample_rate: f32::of(RATE),
        ..MOTION
    };
    let (dynamics, motion) = (flyer.dynamics.cast(), flyer.motion.cast());
    Box::new(ReducedMotionFilter::new(&preset, &dynamics, &motion, &posture.cast()).unwrap())
}

/// What sensors measure of a motion that was `before` one sample ago.
fn sensed(motion: &Motion<f64>, before: &Motion<f64>, noise: &mut Noise) -> SensorMeasurement<f64> {
    let tilt = small_rotation(&vector(noise, 0.01));
    let attitude = Rotation::from_quaternion(motion.inertial_from_body.quaternion() * tilt);
    let (spin, arm) = (
        motion.angular_velocity,
        Vector::<_, Body>::from_components(ARM.into()),
    );
    let change = motion.velocity_inertial() - before.velocity_inertial();
    let force = change * RATE + Vector::new(0.0, 0.0, STANDARD_GRAVITY);
    let turn = (spin - before.angular_velocity) * RATE;
    let force = motion.inertial_from_body.inverse() * force
        + turn.cross(&arm)
        + spin.cross(&spin.cross(&arm));
    SensorMeasurement {
        gyroscope: Some(Gyroscope {
            angular_velocity: spin
                + Vector::from_components(Vector3::from(BIAS) + vector(noise, 0.01)),
            deviation: 0.01,
        }),
        specific_force: Some(SpecificForce {
            force: force + Vector::from_components(vector(noise, 0.5)),
            deviation: 0.7,
            arm,
        }),
        ..MotionMeasurement {
            inertial_from_body: Some(attitude),
            ..MotionMeasurement::none()
        }
        .into()
    }
}

fn receiver(motion: &Motion<f64>, age: f64, noise: &mut Noise) -> ReceiverVelocity<f64> {
    ReceiverVelocity {
        velocity: motion.velocity_inertial() + Vector::from_components(vector(noise, 0.15)),
        horizontal_deviation: 0.15,
        vertical_deviation: 0.3,
        age,
        arm: Vector::zero(),
    }
}

/// How a flight differs from what the filter assumes.
struct Flight {
    wind: [f64; 2],
    /// Drag area that the posture does not account for (m2).
    drag_area: f64,
    accelerometer: bool,
    /// Whether an attitude is measured, after the first second.
    attitude: bool,
    /// Error of the gyroscope's scale about each axis.
    scale: [f64; 3],
    /// How far one arm is raised and the other lowered (rad), so that the body turns.
    turn: f64,
    /// Samples between solutions of the receiver, the sample of the first, and the age of each in samples.
    receiver: [u32; 3],
}

/// Flies for a minute; calls `each` with the truth and the estimate after the first 15 s.
fn fly(
    flight: &Flight,
    mut each: impl FnMut(&Motion<f64>, &Inputs<f64>, &MotionEstimate<f32>),
) -> Box<ReducedMotionFilter<f32>> {
    let mut flyer = flyer();
    flyer.posture = pattern::moved(&flyer.posture, ARMS, flight.turn);
    let mut air = flyer.dynamics;
    let [north, west] = flight.wind;
    air.air.velocity = Vector::new(north, west, 0.0);
    let mut filter = filter(&flyer, &flyer.posture);
    let hold: PostureSample<f64> = air.hold(&flyer.posture);
    let carried = flyer.motion.inertial_from_body.inverse() * air.air.velocity;
    let start = Motion {
        velocity: flyer.motion.velocity + carried,
        ..flyer.motion
    };
    let mut state = State::from_motion(&start, &hold);
    let mut noise = Noise::new(5);
    let mut history = vec![start; 64];
    let mut ranges = RangeWatch::default();
    for k in 1..=60 * 100u32 {
        let time = f64::from(k) / RATE;
        let mut inputs = Inputs::belly_turn();
        inputs.muscle.pitch = 0.5 * (0.5 * time).sin();
        inputs.muscle.yaw = 0.6 * (0.8 * time).sin();
        inputs.residual.force = Vector::new(0.0, 0.0, flight.drag_area);
        state = air.step(&state, &hold, &inputs, 1.0 / RATE);
        let motion = state.motion(&hold);
        history.rotate_right(1);
        history[0] = motion;
        let mut measured = sensed(&motion, &history[1], &mut noise);
        if !flight.accelerometer {
            measured.specific_force = None;
        }
        if !flight.attitude && time > 1.0 {
            measured.motion.inertial_from_body = None;
        }
        if let Some(read) = &mut measured.gyroscope {
            let scale = Vector3::from(flight.scale);
            let spin = motion.angular_velocity.components;
            read.angular_velocity += Vector::from_components(spin.component_mul(&scale));
        }
        let [every, first, age] = flight.receiver;
        if k % every == first {
            let then = history[age as usize];
            measured.receiver = Some(receiver(&then, f64::from(age) / RATE, &mut noise));
        }
        let posture = flyer.posture.cast();
        let estimate = filter.push_recorded(&posture, &measured.cast(), &mut ranges);
        ranges.see(&filter);
        if let Some(estimate) = estimate.filter(|_| time > 15.0) {
            each(&motion, &inputs, &estimate);
        }
    }
    println!("{}", ranges.report());
    filter
}

/// Root mean squares of the velocity's error and of its stated deviation (m/s).
fn velocity_error(flight: &Flight) -> [f64; 2] {
    let (mut sums, mut count) = ([0.0; 2], 0.0);
    fly(flight, |motion, _, estimate| {
        let found = estimate.motion.cast::<f64>().velocity_inertial();
        sums[0] += (found - motion.velocity_inertial()).norm_squared();
        let stated = estimate.deviation.fixed_rows::<3>(VELOCITY).into_owned();
        sums[1] += f64::from(stated.norm_squared());
        count += 1.0;
    });
    sums.map(|sum| (sum / count).sqrt())
}

const STILL_AIR: Flight = Flight {
    wind: [0.0; 2],
    drag_area: 0.0,
    accelerometer: false,
    attitude: true,
    scale: [0.0; 3],
    turn: 0.0,
    receiver: [20, 7, 0],
};

#[test]
fn a_receiver_is_heard_at_any_sample_and_at_its_own_time() {
    for first in [6, 7] {
        for age in [0, 5, 12, 30] {
            let [error, stated] = velocity_error(&Flight {
                receiver: [20, first, age],
                ..STILL_AIR
            });
            println!("at sample {first}, {age} samples old: {error:.3} m/s, stated {stated:.3}");
            assert!(
                error < 0.4 && error < 2.0 * stated,
                "{first} {age}: {error} {stated}"
            );
        }
    }
}

#[test]
fn wind_bias_and_drag_are_found_within_their_error_bars() {
    let flight = Flight {
        wind: [8.0, -5.0],
        drag_area: 0.03,
        accelerometer: true,
        ..STILL_AIR
    };
    let (mut doubtful, mut count, mut last) = (0.0, 0.0, None);
    let filter = fly(&flight, |_, inputs, estimate| {
        let consistent = estimate.consistency == Consistency::Consistent;
        doubtful += f64::from(u8::from(!consistent));
        count += 1.0;
        for (k, truth) in inputs.muscle.to_array().into_iter().enumerate() {
            let error = f64::from(estimate.inputs.muscle.to_array()[k]) - truth;
            assert!(error.abs() < 3.0 * f64::from(estimate.deviation[MUSCLE + k]));
        }
        last = Some(*estimate);
    });
    let deviations = filter.constants().deviations();
    let wind = filter.dynamics().air.velocity.to_array();
    for (k, truth) in flight.wind.into_iter().enumerate() {
        let (error, deviation) = (f64::from(wind[k]) - truth, f64::from(deviations[k]));
        println!("wind {k}: {error:.2} m/s off, stated {deviation:.2}");
        assert!(error.abs() < 3.0 * deviation && deviation < 2.0);
    }
    for (k, truth) in BIAS.into_iter().enumerate() {
        let error = f64::from(filter.constants().bias()[k]) - truth;
        assert!(error.abs() < 0.003 && error.abs() < 4.0 * f64::from(deviations[2 + k]));
    }
    let last = last.unwrap();
    let drag = f64::from(last.inputs.residual.force.z());
    let deviation = f64::from(last.deviation[RESIDUAL_FORCE + 2]);
    println!("drag area {drag:.4} +- {deviation:.4} m2, doubtful {doubtful} of {count}");
    assert!((drag - 0.03).abs() < 3.0 * deviation && deviation < 0.03);
    assert!(doubtful < 0.05 * count, "{doubtful} of {count}");
}

#[test]
fn an_accelerometer_makes_the_velocity_more_accurate() {
    let without = velocity_error(&STILL_AIR);
    let with = velocity_error(&Flight {
        accelerometer: true,
        ..STILL_AIR
    });
    println!("without {without:.3?}, with {with:.3?} m/s");
    assert!(with[0] < 0.85 * without[0] && with[1] < 0.8 * without[1]);
}

/// Errors of attitude, velocity and angular velocity in their stated deviations: root mean squares, and the largest.
fn in_deviations(flight: &Flight) -> [[f64; 2]; 3] {
    let (mut found, mut count) = ([[0.0_f64; 2]; 3], 0.0);
    fly(flight, |motion, _, estimate| {
        let estimated = estimate.motion.cast::<f64>();
        let turn = motion.inertial_from_body.inverse() * estimated.inertial_from_body;
        let velocity = estimated.velocity_inertial() - motion.velocity_inertial();
        let spin = estimated.angular_velocity - motion.angular_velocity;
        let errors = [
            (ATTITUDE, turn.quaternion().scaled_axis()),
            (VELOCITY, velocity.components),
            (SPIN, spin.components),
        ];
        for ((first, error), [sum, largest]) in errors.into_iter().zip(&mut found) {
            for axis in 0..3 {
                let share = error[axis] / f64::from(estimate.deviation[first + axis]);
                *sum += share * share / 3.0;
                *largest = largest.max(share.abs());
            }
        }
        count += 1.0;
    });
    found.map(|[sum, largest]| [(sum / count).sqrt(), largest])
}

/// Turns of 4 and 9 rad/s. With a scale that is taken as exact, an attitude that is not measured would be off by up to 12
/// deviations.
#[test]
fn a_gyroscope_of_a_wrong_scale_leaves_estimates_within_their_bars() {
    for (attitude, turn) in [(true, 0.1), (true, 0.2), (false, 0.1), (false, 0.2)] {
        for scale in [
            [0.01, -0.01, 0.01],
            [-0.01; 3],
            [0.03; 3],
            [-0.03, 0.03, -0.03],
        ] {
            let found = in_deviations(&Flight {
                accelerometer: true,
                attitude,
                scale,
                turn,
                ..STILL_AIR
            });
            println!("attitude {attitude}, turn {turn}, scale {scale:?}: {found:.2?}");
            for [mean, largest] in found {
                assert!(
                    mean < 1.1 && largest < 5.0,
                    "{attitude} {turn} {scale:?}: {found:?}"
                );
            }
        }
    }
}

/// Estimates at the end of a minute in which a body with this attitude moves at a constant velocity, carried by
/// something other than the air; the share of `consistent` ones, and of those recognised as supported.
fn carried(velocity: [f64; 3], with: impl Fn(&mut SensorMeasurement<f64>)) -> [f64; 2] {
    let flyer = flyer();
    let assumed = Posture::h_pose();
    let mut filter = filter(&flyer, &assumed);
    let attitude = facing_north(0.1);
    let motion = Motion {
        inertial_from_body: attitude,
        position: Vector::zero(),
        velocity: attitude.inverse() * Vector::<_, Inertial>::from_components(velocity.into()),
        angular_velocity: Vector::zero(),
    };
    let mut noise = Noise::new(8);
    let (mut counts, mut all) = ([0.0; 2], 0.0);
    let mut ranges = RangeWatch::default();
    for k in 1..=60 * 100u32 {
        let mut measured = sensed(&motion, &motion, &mut noise);
        if k % 20 == 0 {
            measured.receiver = Some(receiver(&motion, 0.1, &mut noise));
        }
        with(&mut measured);
        let estimate = filter.push_recorded(&assumed.cast(), &measured.cast(), &mut ranges);
        ranges.see(&filter);
        if let Some(estimate) = estimate {
            all += 1.0;
            counts[0] += f64::from(u8::from(estimate.consistency == Consistency::Consistent));
            counts[1] += f64::from(u8::from(estimate.situation == Situation::Supported));
        }
    }
    println!("{}", ranges.report());
    counts.map(|count| count / all)
}

#[test]
fn standing_and_sitting_in_an_aircraft_are_called_that() {
    for (name, velocity) in [
        ("standing", [0.0; 3]),
        ("walking", [1.2, 0.8, 0.0]),
        ("in an aircraft", [45.0, 20.0, 5.0]),
    ] {
        for accelerometer in [true, false] {
            let [consistent, supported] = carried(velocity, |measured| {
                if !accelerometer {
                    measured.specific_force = None;
                }
            });
            println!(
                "{name}, accelerometer {accelerometer}: consistent {consistent:.3}, supported {supported:.3}"
            );
            assert!(consistent < 0.06 && supported > 0.8, "{name}");
        }
    }
    // Attitude and rates alone cannot tell.
    let [consistent, _] = carried([0.0; 3], |measured| {
        measured.receiver = None;
        measured.specific_force = None;
    });
    assert!(consistent <= 0.0, "{consistent}");
}

#[test]
fn a_fall_is_not_taken_for_a_support() {
    let mut supported = 0;
    for accelerometer in [true, false] {
        fly(
            &Flight {
                accelerometer,
                ..STILL_AIR
            },
            |_, _, estimate| {
                supported += u32::from(estimate.situation == Situation::Supported);
            },
        );
    }
    assert_eq!(supported, 0);
}

#[test]
fn a_barometer_alone_gives_the_vertical_velocity() {
    let flyer = flyer();
    let mut filter = filter(&flyer, &flyer.posture);
    let hold = flyer.dynamics.hold(&flyer.posture);
    let mut state = State::from_motion(&flyer.motion, &hold);
    let mut noise = Noise::new(9);
    let (mut height, mut last) = (4000.0, None);
    // More drag than the posture has, so the model alone would be wrong.
    let mut inputs = Inputs::belly_turn();
    inputs.residual.force = Vector::new(0.0, 0.0, 0.05);
    for k in 1..=40 * 100u32 {
        let before = state.motion(&hold);
        state = flyer.dynamics.step(&state, &hold, &inputs, 1.0 / RATE);
        let motion = state.motion(&hold);
        height += motion.velocity_inertial().up() / RATE;
        let mut measured = sensed(&motion, &before, &mut noise);
        measured.specific_force = None;
        if k % 5 == 0 {
            measured.barometer = Some(Barometer {
                height: Some(height + noise.normal(0.3)),
                height_deviation: 0.3,
                vertical_velocity: None,
                vertical_velocity_deviation: 0.0,
            });
        }
        last = filter
            .push_sensors(&flyer.posture.cast(), &measured.cast())
            .or(last);
    }
    let estimate = last.unwrap();
    let found = f64::from(estimate.motion.velocity_inertial().up());
    let truth = state.motion(&hold).velocity_inertial().up();
    let deviation = f64::from(estimate.deviation[VELOCITY + 2]);
    println!("up {found:.2} +- {deviation:.2}, true {truth:.2} m/s");
    assert!((found - truth).abs() < 1.0 && (found - truth).abs() < 3.0 * deviation);
}
