//! The motion filter with the sensors of a wearable, in the unit's precision and steps: a receiver, a gyroscope and an
//! accelerometer without a suit, on the ground, in an aircraft, and in a fall. The flights are the same model's; noise,
//! wind, biases and drag are not those that the filter assumes.

use bodyflight_core::Posture;
use bodyflight_core::dynamics::{Inputs, Motion, State};
use bodyflight_core::estimator::motion::measurement::SensorMeasurement;
use bodyflight_core::estimator::motion::sensors::Barometer;
use bodyflight_core::estimator::motion::state::{ATTITUDE, MUSCLE, RESIDUAL_FORCE, SPIN, VELOCITY};
use bodyflight_core::estimator::motion::support::Situation;
use bodyflight_core::estimator::motion::watch::Consistency;
use bodyflight_core::frame::{Inertial, Vector, facing_north};
use bodyflight_tests::estimator_flights::Noise;
use bodyflight_tests::range_watch::RangeWatch;

#[path = "estimator_sensors/flights.rs"]
mod flights;

use flights::{BIAS, Flight, RATE, filter, fly, flyer, receiver, sensed};

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
    // The first two seconds, until the wind is found.
    assert!(doubtful < 0.12 * count, "{doubtful} of {count}");
}

#[test]
fn an_accelerometer_makes_the_velocity_more_accurate() {
    let without = velocity_error(&STILL_AIR);
    let with = velocity_error(&Flight {
        accelerometer: true,
        ..STILL_AIR
    });
    println!("without {without:.3?}, with {with:.3?} m/s");
    // What is stated includes the receiver's own accuracy, which lasts.
    assert!(with[0] < 0.85 * without[0] && with[1] < 0.85 * without[1]);
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
            assert!(consistent < 0.02 && supported > 0.9, "{name}");
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
