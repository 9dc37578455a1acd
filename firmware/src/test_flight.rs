//! A short flight, as samples, for the tests of this crate.

use bodyflight_core::aerodynamics::Aerodynamics;
use bodyflight_core::body::anthropometry::{Person, Sex};
use bodyflight_core::body::pattern;
use bodyflight_core::dynamics::{Dynamics, Inputs, Motion, State};
use bodyflight_core::frame::{Rotation, Vector};
use bodyflight_core::link::{
    self, ArchSource, Configure, PackedQuaternion, Sample, SegmentTable, SensorKind,
};
use bodyflight_core::math::small_rotation;
use bodyflight_core::{Body, Posture};
use nalgebra::Vector3;

/// Sample rate (Hz).
pub(crate) const RATE: f32 = 240.0;

pub(crate) fn body() -> Body<f32> {
    Person::new(1.75, 75.0, Sex::Male).body().unwrap()
}

pub(crate) fn table() -> SegmentTable {
    SegmentTable::of(&body(), &Aerodynamics::paper())
}

pub(crate) fn configure() -> Configure {
    Configure {
        preset: 0,
        sample_rate: RATE,
        update_rate: 60.0,
        height: 1.75,
        air_density: 1.0,
        air_velocity: [0.0; 3],
        arch_source: ArchSource::Posture,
        arch: 1.0,
        body_from_sensor: PackedQuaternion::default(),
        receiver_latency: 0.1,
        sensor: SensorKind::Xbus,
        table_digest: table().digest(),
    }
}

/// Sensor time of sample `k` (us).
pub(crate) fn time(k: u32) -> u64 {
    u64::from(k) * 1_000_000 / 240
}

fn posture(k: u16) -> Posture<f32> {
    let swing = (f32::from(k) * 0.01).sin() * 0.1;
    pattern::arched(&pattern::neutral(), swing)
}

/// A fall of `count` samples, simulated by the model.
pub(crate) fn samples(count: u16) -> std::vec::Vec<Sample> {
    let dynamics = Dynamics::paper(body(), 1.0);
    let turn = small_rotation(&Vector3::new(0.5, 0.0, 0.0));
    let attitude = Rotation::from_quaternion(turn * turn * turn);
    let start = Motion {
        inertial_from_body: attitude,
        position: Vector::zero(),
        velocity: attitude.inverse() * Vector::new(3.0, 0.0, -45.0),
        angular_velocity: Vector::zero(),
    };
    let step = 1.0 / RATE;
    let mut state = State::from_motion(&start, &dynamics.hold(&posture(0)));
    (0..count)
        .map(|k| {
            let interval = dynamics.between(&posture(k), &posture(k + 1), step);
            let motion = state.motion(&interval);
            let seen = link::Motion {
                angular_velocity: Some(motion.angular_velocity),
                velocity: Some(motion.velocity_inertial()),
                horizontal_speed: None,
            };
            let sample = Sample::new(&posture(k), &motion.inertial_from_body, &seen);
            state = dynamics.step(&state, &interval, &Inputs::belly_turn(), step);
            sample
        })
        .collect()
}
