//! Synthetic flights for the estimator: postures and conscious inputs that vary over time, simulated by the core in
//! double precision at twice the filter's rate, and measured with the paper's noise.

use std::borrow::Cow;

use bodyflight_core::body::pattern::{self, DRAW_IN_LEFT, JointAngles, NEUTRAL, PRESS, TRACK};
use bodyflight_core::dynamics::muscle_input::MuscleModel;
use bodyflight_core::dynamics::residual::ResidualLoad;
use bodyflight_core::dynamics::step::TIME_STEP;
use bodyflight_core::dynamics::{Dynamics, Inputs, Motion, State};
use bodyflight_core::estimator::measurement::Measurement;
use bodyflight_core::frame::{Vector, facing_north};
use bodyflight_core::{Body, Posture, Segment};

/// Phases (rad) of the slow drift of muscle input and damping, which also determine how fast each of them drifts.
const WANDER_PHASES: [f64; 6] = [1.0, 0.0, 2.0, 3.0, 4.0, 5.0];
/// Rise time and fall time of a pulse (s).
const RISE: f64 = 0.5;

/// A pulse of muscle input, damping or posture: rises smoothly, holds, falls.
#[derive(Debug, Clone, Copy)]
pub struct Pulse {
    /// Start and end (s).
    pub during: [f64; 2],
    /// Muscle input added [pitch, yaw, roll].
    pub muscle: [f64; 3],
    /// Damping added [pitch, yaw, roll].
    pub damping: [f64; 3],
    /// Joint pattern added to the posture, with its amplitude (rad).
    pub joints: Option<(&'static JointAngles, f64)>,
    /// Whether the pulse ends as soon as the body has changed sides.
    pub until_over: bool,
}

/// A scripted flight.
#[derive(Debug, Clone)]
pub struct Flight {
    /// Name in reports.
    pub name: &'static str,
    /// Length (s).
    pub duration: f64,
    /// Posture between the pulses.
    pub base: &'static JointAngles,
    /// Rotation about the left axis at the start (rad); pi/2 is belly to earth.
    pub start_pitch: f64,
    /// Muscle input between the pulses [pitch, yaw, roll].
    pub muscle: [f64; 3],
    /// Damping between the pulses [pitch, yaw, roll].
    pub damping: [f64; 3],
    /// Amplitude of the slow drift of inputs (fraction).
    pub wander: f64,
    /// Rate of that drift (1/s).
    pub rate: f64,
    /// Amplitude of the slow arm movements with which a skydiver holds and changes direction (rad).
    pub sway: f64,
    /// Joint pattern added while the back faces the earth.
    pub on_back: &'static JointAngles,
    /// The pulses.
    pub pulses: Cow<'static, [Pulse]>,
}

/// One arm up, the other down.
const TURN: &JointAngles = &[
    (Segment::LeftUpperArm, [0.0, 0.0, 1.0]),
    (Segment::RightUpperArm, [0.0, 0.0, -1.0]),
];
const fn roll(from: f64, muscle: f64, damping: f64, arm: f64) -> Pulse {
    Pulse {
        during: [from, from + 1.6],
        muscle: [0.0, 0.0, muscle],
        damping: [0.0, 0.0, damping],
        joints: Some((DRAW_IN_LEFT, arm)),
        until_over: false,
    }
}

const fn turn(from: f64, to: f64, amount: f64, yaw: f64) -> Pulse {
    Pulse {
        during: [from, to],
        muscle: [0.4, yaw, 0.5],
        damping: [2.0, 1.5, -2.0],
        joints: Some((TURN, amount)),
        until_over: false,
    }
}

const fn flip(from: f64, to: f64) -> Pulse {
    Pulse {
        during: [from, to],
        muscle: [3.0, 0.0, 0.0],
        damping: [-5.0, 2.0, 3.0],
        joints: Some((PRESS, 0.8)),
        until_over: false,
    }
}

/// Tracking with two barrel rolls, paper "The Tracking Maneuver".
pub const ANGLE_FLYING: Flight = Flight {
    name: "angle flying",
    duration: 55.0,
    base: TRACK,
    start_pitch: 1.9,
    muscle: [0.5, 0.2, 0.2],
    damping: [6.0, 3.0, 12.0],
    wander: 0.4,
    rate: 1.0,
    sway: 0.03,
    on_back: &[],
    pulses: Cow::Borrowed(&[roll(30.0, 1.8, -10.0, 1.2), roll(43.0, 1.8, -10.0, 1.2)]),
};

/// Seven flips and seven rolls at fixed times: the body tumbles through some, does not follow others, and changes sides
/// eight times.
pub const FLIPS_AND_ROLLS: Flight = Flight {
    name: "flips and rolls",
    duration: 45.0,
    base: NEUTRAL,
    start_pitch: core::f64::consts::FRAC_PI_2,
    muscle: [0.0; 3],
    damping: [8.0, 4.0, 16.0],
    wander: 0.2,
    rate: 1.0,
    sway: 0.1,
    on_back: &[],
    pulses: Cow::Borrowed(&[
        flip(2.0, 3.4),
        roll(5.0, 3.0, -8.0, 0.6),
        flip(8.0, 9.4),
        roll(11.0, 3.0, -8.0, 0.6),
        flip(14.0, 15.4),
        roll(17.0, 3.0, -8.0, 0.6),
        flip(20.0, 21.4),
        flip(23.0, 24.4),
        roll(26.0, 3.0, -8.0, 0.6),
        roll(29.0, 3.0, -8.0, 0.6),
        flip(32.0, 33.4),
        roll(35.0, 3.0, -8.0, 0.6),
        flip(38.0, 39.4),
        roll(41.0, 3.0, -8.0, 0.6),
    ]),
};

/// Aggressive turns left and right.
pub const TURNS: Flight = Flight {
    name: "aggressive turns",
    duration: 30.0,
    base: NEUTRAL,
    start_pitch: core::f64::consts::FRAC_PI_2,
    muscle: [0.2, 0.2, 0.2],
    damping: [3.0, 0.5, 6.0],
    wander: 0.5,
    rate: 1.0,
    sway: 0.05,
    on_back: &[],
    pulses: Cow::Borrowed(&[
        turn(2.0, 5.0, 0.3, 2.0),
        turn(6.0, 9.0, -0.35, 1.0),
        turn(11.0, 14.0, 0.4, 3.0),
        turn(16.0, 18.0, -0.3, 0.0),
        turn(19.0, 23.0, 0.3, 4.0),
        turn(24.0, 28.0, -0.4, 2.0),
    ]),
};

/// A self-sustaining spin: started by the arms, then driven by negative damping about the yaw axis, which the paper
/// observes when its failed layout turns into a roll.
pub const FED_SPIN: Flight = Flight {
    name: "self-feeding spin",
    duration: 12.0,
    base: NEUTRAL,
    start_pitch: core::f64::consts::FRAC_PI_2,
    muscle: [0.2, 0.0, 0.0],
    damping: [3.0, 1.0, 6.0],
    wander: 0.3,
    rate: 1.0,
    sway: 0.0,
    on_back: &[],
    pulses: Cow::Borrowed(&[
        turn(2.0, 4.0, 0.5, 0.0),
        Pulse {
            during: [3.0, 11.0],
            muscle: [0.0, 0.0, 0.0],
            damping: [0.0, -9.0, 0.0],
            joints: None,
            until_over: false,
        },
    ]),
};

/// A smooth rise from 0 to 1, for `x` from 0 to 1.
fn smooth(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

impl Pulse {
    /// Fraction of its amplitude that the pulse has at `time` (s).
    fn share(&self, time: f64) -> f64 {
        let [begin, end] = self.during;
        smooth((time - begin) / RISE) * smooth((end - time) / RISE)
    }
}

/// A script being flown: pulse ends that depend on the motion are determined during the flight.
#[derive(Debug, Clone)]
pub struct Course {
    script: Flight,
    changes: Vec<f64>,
}

impl Course {
    /// Times (s) at which the body had changed sides between belly and back to earth: its dorsal axis had come within
    /// 60 degrees of the vertical, on the other side than before.
    pub fn changes_of_side(&self) -> &[f64] {
        &self.changes
    }

    fn on_back(&self) -> bool {
        self.changes.len() % 2 == 1
    }

    /// Updates the course with the motion at `time` (s), without affecting earlier times.
    fn see(&mut self, time: f64, motion: &Motion<f64>) {
        let dorsal = Measurement::of(motion).vertical.y;
        let over = if self.on_back() {
            dorsal > 0.5
        } else {
            dorsal < -0.5
        };
        if over {
            self.changes.push(time);
            for pulse in self.script.pulses.to_mut() {
                let [begin, end] = &mut pulse.during;
                if pulse.until_over && *begin < time {
                    *end = end.min(time + RISE);
                }
            }
        }
    }

    /// Posture at `time` (s).
    fn posture(&self, time: f64) -> Posture<f64> {
        let script = &self.script;
        let sway = script.sway * ((1.1 * time).sin() + 0.6 * (2.3 * time).sin());
        let base = pattern::moved(&pattern::posture(script.base), TURN, sway);
        let on_back = self
            .changes
            .iter()
            .rev()
            .fold(0.0, |later, change| smooth((time - change) / RISE) - later);
        let base = pattern::moved(&base, script.on_back, on_back);
        script
            .pulses
            .iter()
            .fold(base, |posture, pulse| match pulse.joints {
                Some((joints, amount)) => {
                    pattern::moved(&posture, joints, amount * pulse.share(time))
                }
                None => posture,
            })
    }

    /// Conscious inputs at `time` (s).
    pub fn inputs(&self, time: f64) -> Inputs<f64> {
        let script = &self.script;
        let mut muscle = script.muscle;
        let mut damping = script.damping;
        for (phase, value) in WANDER_PHASES
            .iter()
            .zip(muscle.iter_mut().chain(&mut damping))
        {
            *value *=
                1.0 + script.wander * (script.rate * time * (0.7 + 0.13 * phase) + phase).sin();
        }
        for pulse in script.pulses.iter() {
            let share = pulse.share(time);
            for k in 0..3 {
                muscle[k] += pulse.muscle[k] * share;
                damping[k] += pulse.damping[k] * share;
            }
        }
        Inputs {
            muscle: muscle.map(|value| value.max(0.0)).into(),
            damping: damping.map(|value| value.max(-0.25)).into(),
            residual: ResidualLoad::none(),
        }
    }
}

impl Flight {
    /// Flies the script.
    pub fn fly(&self, body: &Body<f64>, muscles: MuscleModel) -> Record {
        let dynamics = Dynamics {
            muscles,
            ..Dynamics::paper(*body, 1.0)
        };
        let attitude = facing_north(self.start_pitch);
        let start = Motion {
            inertial_from_body: attitude,
            position: Vector::zero(),
            velocity: attitude.inverse() * Vector::new(3.0, 0.0, -42.0),
            angular_velocity: Vector::zero(),
        };
        let mut course = Course {
            script: self.clone(),
            changes: Vec::new(),
        };
        let half = TIME_STEP / 2.0;
        let posture = course.posture(0.0);
        let mut state = State::from_motion(&start, &dynamics.hold(&posture));
        let mut postures = vec![posture];
        let mut motions = vec![start];
        let mut time = 0.0;
        while time < self.duration {
            for _ in 0..2 {
                let ends = [course.posture(time), course.posture(time + half)];
                let sample = dynamics.between(&ends[0], &ends[1], half);
                state = dynamics.step(&state, &sample, &course.inputs(time + half / 2.0), half);
                time += half;
            }
            let next = [course.posture(time - half), course.posture(time + half)];
            let sample = dynamics.between(&next[0], &next[1], TIME_STEP);
            let motion = state.motion(&sample);
            postures.push(course.posture(time));
            motions.push(motion);
            course.see(time, &motion);
        }
        Record {
            dynamics,
            course,
            postures,
            motions,
        }
    }
}

/// The true flight, sample by sample.
#[derive(Debug, Clone)]
pub struct Record {
    /// The model used.
    pub dynamics: Dynamics<f64>,
    /// The script with its final pulse ends.
    pub course: Course,
    /// Postures.
    pub postures: Vec<Posture<f64>>,
    /// Motions.
    pub motions: Vec<Motion<f64>>,
}

/// Normal deviates by the Box-Muller transform, from a 64-bit xorshift generator.
#[derive(Debug, Clone)]
pub struct Noise(u64);

impl Noise {
    /// Starts the sequence of a seed.
    pub fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1)
    }

    /// A uniform deviate between 0 and 1.
    pub fn uniform(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    /// A normal deviate with this standard deviation.
    pub fn normal(&mut self, deviation: f64) -> f64 {
        let (radius, angle) = (self.uniform(), self.uniform());
        (-2.0 * (1.0 - radius).ln()).sqrt() * (core::f64::consts::TAU * angle).cos() * deviation
    }
}

impl Record {
    /// The measurements of the sensors, with the paper's noise for tracking and turning.
    pub fn measured(&self, seed: u64) -> Vec<Measurement<f64>> {
        let mut noise = Noise::new(seed);
        let mut noise_of_vertical = Noise::new(!seed);
        let mut seen = |motion| {
            let Measurement {
                horizontal_speed,
                heading,
                pitch,
                roll,
                yaw_rate,
                vertical_velocity,
                vertical,
            } = Measurement::of(motion);
            Measurement {
                horizontal_speed: horizontal_speed + noise.normal(0.1),
                heading: heading + noise.normal(0.05),
                pitch: pitch + noise.normal(0.01),
                roll: roll + noise.normal(0.01),
                yaw_rate: yaw_rate + noise.normal(0.01),
                vertical_velocity: vertical_velocity + noise.normal(1.0),
                vertical: vertical.map(|share| share + noise_of_vertical.normal(0.01)),
            }
        };
        self.motions.iter().map(&mut seen).collect()
    }
}
