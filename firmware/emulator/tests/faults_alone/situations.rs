//! Somebody whom something other than the air carries.

use bodyflight_core::frame::{Rotation, Vector};
use bodyflight_emulator::sensed::Sensed;
use bodyflight_laboratory::sensor_bytes::SensorBytes;
use nalgebra::{UnitQuaternion, Vector3};

use super::faults::random;

/// Position (m) and rotation vector of the attitude (rad) at a time (s).
type Path = fn(f64) -> ([f64; 3], [f64; 3]);

pub const SITUATIONS: [(&str, Path); 6] = [
    ("standing", |t| {
        let sway = 0.01 * t.sin();
        ([0.0, 0.0, 0.002 * (9.0 * t).sin()], [sway, 0.0, 2.0 * sway])
    }),
    ("walking", |t| {
        let [sine, cosine] = [(5.5 * t).sin(), (5.5 * t).cos()];
        let bounce = 0.03 * (11.0 * t).sin();
        (
            [1.4 * t, 0.0, bounce],
            [0.05 * sine, 0.05 * cosine, 0.1 * sine],
        )
    }),
    ("running", |t| {
        let [sine, cosine] = [(8.5 * t).sin(), (8.5 * t).cos()];
        let bounce = 0.06 * (17.0 * t).sin();
        (
            [4.0 * t, 0.0, bounce],
            [0.1 * sine, 0.05 * cosine, 0.2 * sine],
        )
    }),
    ("sitting in an aircraft", |t| {
        let shaking = 0.002 * (60.0 * t).sin();
        (
            [60.0 * t, 0.0, 6.0 * t + shaking],
            [0.02 * t.sin(), 0.1, 0.05 * (0.3 * t).sin()],
        )
    }),
    ("in an aircraft that turns", |t| {
        let [sine, cosine] = [(0.1 * t).sin(), (0.1 * t).cos()];
        (
            [600.0 * sine, 600.0 * (1.0 - cosine), 6.0 * t],
            [0.0, 0.0, 0.1 * t],
        )
    }),
    ("under a canopy", |t| {
        let swing = 0.2 * (1.5 * t).sin();
        (
            [10.0 * t, 0.0, -5.0 * t],
            [swing, 0.15 * (1.3 * t).sin(), 0.3 * (0.5 * t).sin()],
        )
    }),
];

/// Twelve seconds of it, for a unit configured for the flight `like`.
pub fn carried(like: &Sensed, path: Path, sensor: &SensorBytes) -> Sensed {
    let attitude = |time| UnitQuaternion::from_scaled_axis(Vector3::from(path(time).1));
    let step = 1e-4;
    let frame = |index: u64| {
        let time = index as f64 / 240.0;
        let mut frame = like.frames[0];
        (frame.index, frame.time) = (index, time);
        let [x, y, z] = path(time).0;
        let turn = attitude(time + step) * attitude(time).inverse();
        let noise = Vector3::from_fn(|i, _| f64::from(random(3 * index as usize + i)) - 0.5) * 0.04;
        frame.pelvis.position = Vector::new(x, y, z);
        frame.pelvis.inertial_from_body = Rotation::from_quaternion(attitude(time));
        let spin = turn.scaled_axis() / step + noise;
        frame.pelvis.angular_velocity = Some(Vector::from_components(spin));
        frame
    };
    let frames: Vec<_> = (0..12 * 240).map(frame).collect();
    Sensed {
        setup: like.setup,
        bytes: sensor.of(&frames),
        frames,
        muscle: [f64::NAN; 3],
    }
}
