//! Flights of a wearable's sensors: what they measure, and the filter that flies with them.

use bodyflight_core::air::STANDARD_GRAVITY;
use bodyflight_core::body::anthropometry::{Person, Sex};
use bodyflight_core::body::pattern;
use bodyflight_core::dynamics::muscle_input::BACK_TRACKING;
use bodyflight_core::dynamics::trim::{trim, with_knees};
use bodyflight_core::dynamics::{Dynamics, Inputs, Motion, PostureSample, State};
use bodyflight_core::estimator::motion::ReducedMotionFilter;
use bodyflight_core::estimator::motion::estimate::MotionEstimate;
use bodyflight_core::estimator::motion::measurement::{MotionMeasurement, SensorMeasurement};
use bodyflight_core::estimator::motion::sensors::{Gyroscope, ReceiverVelocity, SpecificForce};
use bodyflight_core::estimator::motion::settings::{MOTION, MotionPreset};
use bodyflight_core::frame::{Body, Rotation, Vector, facing_north};
use bodyflight_core::math::small_rotation;
use bodyflight_core::{Lanes, Posture, Segment};
use bodyflight_tests::estimator_flights::Noise;
use bodyflight_tests::range_watch::RangeWatch;
use nalgebra::Vector3;

/// Sample rate (Hz).
pub(crate) const RATE: f64 = 100.0;
/// Place of the sensor on the chest (m).
pub(crate) const ARM: [f64; 3] = [0.05, 0.25, 0.1];
/// Bias of the gyroscope (rad/s).
pub(crate) const BIAS: [f64; 3] = [0.02, -0.03, 0.015];

/// One arm up, the other down.
pub(crate) const ARMS: &pattern::JointAngles = &[
    (Segment::LeftUpperArm, [0.0, 0.0, 1.0]),
    (Segment::RightUpperArm, [0.0, 0.0, -1.0]),
];

pub(crate) struct Flyer {
    pub(crate) dynamics: Dynamics<f64>,
    pub(crate) posture: Posture<f64>,
    pub(crate) motion: Motion<f64>,
}

/// A person in a trimmed belly fall.
pub(crate) fn flyer() -> Flyer {
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

pub(crate) fn vector(noise: &mut Noise, size: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| noise.normal(size))
}

pub(crate) fn filter(flyer: &Flyer, posture: &Posture<f64>) -> Box<ReducedMotionFilter<f32>> {
    let preset = MotionPreset {
        sample_rate: f32::of(RATE),
        ..MOTION
    };
    let (dynamics, motion) = (flyer.dynamics.cast(), flyer.motion.cast());
    Box::new(ReducedMotionFilter::new(&preset, &dynamics, &motion, &posture.cast()).unwrap())
}

/// What sensors measure of a motion that was `before` one sample ago.
pub(crate) fn sensed(
    motion: &Motion<f64>,
    before: &Motion<f64>,
    noise: &mut Noise,
) -> SensorMeasurement<f64> {
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

pub(crate) fn receiver(motion: &Motion<f64>, age: f64, noise: &mut Noise) -> ReceiverVelocity<f64> {
    ReceiverVelocity {
        velocity: motion.velocity_inertial() + Vector::from_components(vector(noise, 0.15)),
        horizontal_deviation: 0.15,
        vertical_deviation: 0.3,
        age,
        arm: Vector::zero(),
    }
}

/// How a flight differs from what the filter assumes.
pub(crate) struct Flight {
    pub(crate) wind: [f64; 2],
    /// Drag area that the posture does not account for (m2).
    pub(crate) drag_area: f64,
    pub(crate) accelerometer: bool,
    /// Whether an attitude is measured, after the first second.
    pub(crate) attitude: bool,
    /// Error of the gyroscope's scale about each axis.
    pub(crate) scale: [f64; 3],
    /// How far one arm is raised and the other lowered (rad), so that the body turns.
    pub(crate) turn: f64,
    /// Samples between solutions of the receiver, the sample of the first, and the age of each in samples.
    pub(crate) receiver: [u32; 3],
}

/// Flies for a minute; calls `each` with the truth and the estimate after the first 15 s.
pub(crate) fn fly(
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
