//! A wearer in belly flight who moves an arm continuously, simulated by the model and measured by noisy sensors.

use bodyflight_core::Posture;
use bodyflight_core::aerodynamics::Aerodynamics;
use bodyflight_core::body::pattern;
use bodyflight_core::dynamics::{Dynamics, Inputs, State};
use bodyflight_core::frame::{Rotation, Vector};
use bodyflight_core::link::fault::Random;
use bodyflight_core::link::{self, Sample, SegmentTable};
use bodyflight_core::math::{Real, small_rotation};
use bodyflight_core::sensor_noise::SensorNoise;
use bodyflight_tests::arm_swing::{self, RATE};
use nalgebra::Vector3;

const STEP: f64 = 1.0 / RATE as f64;

/// Period of the arm's swing (samples).
const SWING: u32 = 750;

pub struct Wearer {
    dynamics: Dynamics<f64>,
    state: State<f64>,
    number: u32,
    random: Random,
}

impl Wearer {
    pub fn new() -> Self {
        let dynamics = Dynamics::paper(arm_swing::body(), 1.0);
        Self {
            state: State::from_motion(&arm_swing::start(), &dynamics.hold(&posture(0))),
            dynamics,
            number: 0,
            random: Random::new(20),
        }
    }

    /// Configuration of a unit for the wearer.
    pub fn table() -> SegmentTable {
        SegmentTable::of(&arm_swing::body::<f32>(), &Aerodynamics::paper())
    }

    /// The constant muscle input and damping, each [pitch, yaw, roll].
    pub fn truth() -> [f64; 6] {
        let Inputs {
            muscle, damping, ..
        } = Inputs::belly_turn();
        [
            muscle.pitch,
            muscle.yaw,
            muscle.roll,
            damping.pitch,
            damping.yaw,
            damping.roll,
        ]
    }

    /// The next sample, with the paper's sensor noise.
    pub fn sample(&mut self) -> Sample {
        let [here, next] = [self.number, self.number + 1].map(posture);
        let interval = self.dynamics.between(&here, &next, STEP);
        let motion = self.state.motion(&interval);
        self.state = self
            .dynamics
            .step(&self.state, &interval, &Inputs::belly_turn(), STEP);
        self.number += 1;
        let noise = SensorNoise::PAPER;
        let tilt = small_rotation(&self.noise([noise.attitude; 3]));
        let attitude = Rotation::from_quaternion(tilt * *motion.inertial_from_body.quaternion());
        let spin = self.noise([noise.angular_velocity; 3]);
        let (along, up) = (noise.horizontal_velocity, noise.vertical_velocity);
        let drift = self.noise([along, along, up]);
        let angular_velocity = motion.angular_velocity + Vector::from_components(spin);
        let velocity = motion.velocity_inertial() + Vector::from_components(drift);
        let seen = link::Motion {
            angular_velocity: Some(angular_velocity.cast()),
            velocity: Some(velocity.cast()),
            horizontal_speed: None,
        };
        Sample::new(&posture(self.number - 1), &attitude.cast(), &seen)
    }

    /// The sum of twelve uniform numbers is close enough to normal here.
    fn noise(&mut self, deviation: [f64; 3]) -> Vector3<f64> {
        let mut normal = || (0..12).map(|_| f64::from(self.random.bits())).sum::<f64>();
        let whole = f64::from(u32::MAX);
        Vector3::from(deviation.map(|deviation| (normal() / whole - 6.0) * deviation))
    }
}

fn posture<T: Real>(number: u32) -> Posture<T> {
    let time = f64::from(number % SWING) / f64::from(SWING);
    let swing = 0.15 * (core::f64::consts::TAU * time).sin();
    pattern::moved(&pattern::neutral(), pattern::DRAW_IN_LEFT, T::of(swing))
}
