//! A falling skydiver who swings an arm, simulated by the model, for tests of the unit.

use bodyflight_core::body::anthropometry::{Person, Sex};
use bodyflight_core::body::pattern;
use bodyflight_core::dynamics::{Dynamics, Inputs, Motion, State};
use bodyflight_core::frame::{Rotation, Vector};
use bodyflight_core::link::{self, Sample};
use bodyflight_core::{Body, Real};
use nalgebra::{UnitQuaternion, Vector3};

/// Sample rate (Hz).
pub const RATE: u32 = 240;

/// The skydiver: 1.75 m, 75 kg.
///
/// # Panics
///
/// Never, since the measurements are plausible.
pub fn body<T: Real>() -> Body<T> {
    Person::new(T::of(1.75), T::of(75.0), Sex::Male)
        .body()
        .expect("a body")
}

/// Belly to earth, falling at 50 m/s and gliding a little.
pub fn start<T: Real>() -> Motion<T> {
    let belly = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), T::of(1.5));
    let attitude = Rotation::from_quaternion(belly);
    let velocity = Vector::new(T::of(2.0), T::zero(), T::of(-50.0));
    Motion {
        inertial_from_body: attitude,
        position: Vector::zero(),
        velocity: attitude.inverse() * velocity,
        angular_velocity: Vector::zero(),
    }
}

/// The first samples of the flight, without sensor noise.
pub fn samples(count: u32) -> Vec<Sample> {
    let dynamics = Dynamics::paper(body(), 1.0);
    let posture = |k: u32| {
        let time = f64::from(k) / f64::from(RATE);
        #[expect(clippy::cast_possible_truncation, reason = "single precision posture")]
        let swing = ((time * 2.0).sin() * 0.15) as f32;
        pattern::moved(&pattern::neutral(), pattern::DRAW_IN_LEFT, swing)
    };
    let step = 1.0 / 240.0;
    let mut state = State::from_motion(&start(), &dynamics.hold(&posture(0)));
    (0..count)
        .map(|k| {
            let interval = dynamics.between(&posture(k), &posture(k + 1), step);
            let motion = state.motion(&interval);
            let seen = link::Motion {
                angular_velocity: Some(motion.angular_velocity),
                velocity: Some(motion.velocity_inertial()),
                horizontal_speed: None,
            };
            state = dynamics.step(&state, &interval, &Inputs::belly_turn(), step);
            Sample::new(&posture(k), &motion.inertial_from_body, &seen)
        })
        .collect()
}
