//! The hidden-effect laboratory: simulated flights with an effect that the files do not mention.
//!
//! The simulated body differs from the files: masses, inertias and areas are a few percent off, joints are recorded
//! with a calibration error of some degrees, sensors have the paper's noise, and the truth is computed with four times
//! finer steps. So the model is never exactly right, and an effect must be found in spite of these errors.
#![forbid(unsafe_code)]

pub mod drawn;
pub mod limb_sensors;
pub mod outside;
mod paths;
pub mod sensor_bytes;
mod suit;
pub mod synthesize;

use bodyflight_core::body::mass_properties::PostureRate;
use bodyflight_core::body::pattern::{self, JointAngles};
use bodyflight_core::dynamics::applied_load::AppliedLoad;
use bodyflight_core::dynamics::{Dynamics, Inputs, Motion, State};
use bodyflight_core::effect::sensors::Moving;
use bodyflight_core::effect::{Effect, Model, PARAMETER_COUNT};
use bodyflight_core::frame::{Vector, facing_north};
use bodyflight_core::{Posture, Segment};
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;

use bodyflight_core::effect::history::moving_at;
use bodyflight_core::flight_sample::FlightSample;
use outside::Outside;
use paths::Paths;
pub use suit::JointErrors;
use suit::{Scale, Suit};

/// FlightSample rate (Hz).
pub const FRAME_RATE: f64 = 240.0;

/// Number of integration steps per frame for the true flight, at the usual frame rate.
const FINER: f64 = 4.0;

/// Distinguishes the seed of a person from that of a flight with the same number.
const PERSON: u64 = 0xb0d1;

/// Height at the start (m, inertial).
const START_HEIGHT: f64 = 4000.0;

/// A hidden disturbance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Hidden {
    /// An effect of the library with its parameters.
    Effect(Effect, [f64; PARAMETER_COUNT]),
    /// A load of the description grammar.
    Load(AppliedLoad<f64>),
    /// A disturbance outside the library.
    Outside(Outside),
}

/// Options of a flight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Seed of everything random.
    pub seed: u64,
    /// Seed of the simulated body, shared by flights of one person; `None` uses the seed of the flight.
    pub person: Option<u64>,
    /// Length (s).
    pub duration: f64,
    /// Factor on sensor noise and errors of subject and joints.
    pub noise: f64,
    /// Additional factor on the sensor noise.
    pub sensor_noise: f64,
    /// Joint errors of the suit, before `noise` scales them.
    pub joints: JointErrors,
    /// FlightSample rate (Hz).
    pub rate: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            seed: 0,
            person: None,
            duration: 40.0,
            noise: 1.0,
            sensor_noise: 1.0,
            joints: JointErrors::default(),
            rate: FRAME_RATE,
        }
    }
}

/// Standard deviation of mass, inertia and each area of the simulated body from the body in the files (fraction).
pub const SUBJECT_DEVIATION: f64 = 0.03;

/// A strength at which an effect can be hidden: a fraction of its plausible range, chosen by the seed between 40 and 80
/// % if `share` is `None`, with either sign if the range has both.
pub fn strength(effect: Effect, seed: u64, share: Option<f64>) -> [f64; PARAMETER_COUNT] {
    let of_effect = effect.description().name.bytes();
    let mixed = of_effect.fold(seed ^ 0x5eed, |mixed, byte| {
        mixed.wrapping_mul(131).wrapping_add(u64::from(byte))
    });
    let mut random = ChaCha8Rng::seed_from_u64(mixed);
    let mut values = effect.neutral();
    for (value, parameter) in values.iter_mut().zip(effect.description().parameters) {
        let up = random.random::<bool>() || parameter.is_one_sided();
        let drawn = 0.4 + 0.4 * random.random::<f64>();
        let share = share.unwrap_or(drawn);
        *value = parameter.towards_end(if up { share } else { -share });
    }
    values
}

/// Movements of the laboratory's skydiver, performed in a random order.
const MOVEMENTS: [(&JointAngles, f64); 8] = [
    (pattern::ARCH, 0.5),
    (pattern::ARCH, -0.5),
    (pattern::DRAW_IN_LEFT, 0.8),
    (pattern::PRESS, 0.8),
    (LEGS, 1.0),
    (SHOULDERS, 0.5),
    (ARMS_BACK, 1.0),
    (HIPS, 0.7),
];

/// Arms swept back to the body, legs stretched, as for tracking.
const ARMS_BACK: &JointAngles = &[
    (Segment::LeftUpperArm, [0.0, -1.0, 0.0]),
    (Segment::RightUpperArm, [0.0, 1.0, 0.0]),
    (Segment::LeftForearm, [0.0, -1.5, 0.0]),
    (Segment::RightForearm, [0.0, 1.5, 0.0]),
    (Segment::LeftShank, [0.0, 0.0, 1.0]),
    (Segment::RightShank, [0.0, 0.0, 1.0]),
];

/// Thighs bent forward, towards a sit.
const HIPS: &JointAngles = &[
    (Segment::LeftThigh, [0.0, 0.0, 1.0]),
    (Segment::RightThigh, [0.0, 0.0, 1.0]),
];

/// Legs stretched.
const LEGS: &JointAngles = &[
    (Segment::LeftShank, [0.0, 0.0, 1.2]),
    (Segment::RightShank, [0.0, 0.0, 1.2]),
];

/// One arm up, the other down.
const SHOULDERS: &JointAngles = &[
    (Segment::LeftUpperArm, [0.0, 0.0, 1.0]),
    (Segment::RightUpperArm, [0.0, 0.0, -1.0]),
];

/// Interval between movements (s).
const PERIOD: f64 = 2.5;

/// The sequence of movements for a seed.
#[derive(Debug, Clone)]
struct Script {
    movements: Vec<(&'static JointAngles, f64, bool)>,
}

impl Script {
    fn new(random: &mut ChaCha8Rng, duration: f64) -> Self {
        let mut movements = Vec::new();
        let mut time = 0.0;
        while time < duration + PERIOD {
            let (pattern, amount) = MOVEMENTS[random.random_range(0..MOVEMENTS.len())];
            let amount = amount * (0.6 + 0.4 * random.random::<f64>());
            movements.push((pattern, amount, random.random::<bool>()));
            time += PERIOD;
        }
        Self { movements }
    }

    fn posture(&self, time: f64) -> Posture<f64> {
        let base = pattern::neutral();
        let place = (time / PERIOD).max(0.0);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "only a few movements"
        )]
        let Some((pattern, amount, mirrored)) = self.movements.get(place as usize) else {
            return base;
        };
        // Out and back again, smoothly.
        let phase = core::f64::consts::TAU * place.fract();
        let moved = pattern::moved(&base, pattern, amount * 0.5 * (1.0 - phase.cos()));
        if *mirrored { moved.mirrored() } else { moved }
    }
}

/// Flies the model of `dynamics` with the hidden disturbance; returns the recording.
pub fn fly(
    dynamics: &Dynamics<f64>,
    inputs: &Inputs<f64>,
    hidden: &[Hidden],
    settings: &Settings,
) -> Vec<FlightSample> {
    let mut random = ChaCha8Rng::seed_from_u64(settings.seed);
    let script = Script::new(&mut random, settings.duration);
    let mut model = Model::new(*dynamics, START_HEIGHT);
    let mut person = settings
        .person
        .map(|person| ChaCha8Rng::seed_from_u64(person ^ PERSON));
    let body = person.as_mut().unwrap_or(&mut random);
    perturb(&mut model.dynamics, body, settings.noise);
    for hidden in hidden {
        match hidden {
            // A strength outside the plausible range is clamped.
            Hidden::Effect(effect, values) => drop(effect.apply(values, &mut model)),
            Hidden::Load(load) => {
                model.applied = model.applied.with(*load).unwrap_or(model.applied)
            }
            Hidden::Outside(_) => {}
        }
    }
    let mut suit = Suit::new(
        random,
        &settings.joints,
        Scale {
            errors: settings.noise,
            sensors: settings.noise * settings.sensor_noise,
        },
    );
    let (flown, history) = truth(&model, &script, inputs, hidden, settings);
    // Sensor delays are arbitrary, so readings are computed after the flight.
    let frames = flown.iter().map(|(time, motion)| {
        let past =
            |delay: f64| moving_at(&history, time - delay).unwrap_or_else(|| Moving::of(motion));
        let seen = model.sensors.observe(motion, past, *time);
        let posture = script.posture(time - model.sensors.posture_delay);
        suit.recorded(*time, &posture, &seen)
    });
    frames.collect()
}

/// What sensors that lag may report, over time (s).
type Course = Vec<(f64, Moving<f64>)>;

/// The true flight: time and motion at each frame, and the motion over time.
fn truth(
    model: &Model<f64>,
    script: &Script,
    inputs: &Inputs<f64>,
    hidden: &[Hidden],
    settings: &Settings,
) -> (Vec<(f64, Motion<f64>)>, Course) {
    let finer = (FINER * FRAME_RATE / settings.rate).round().max(1.0);
    let step = 1.0 / (settings.rate * finer);
    let inputs = model.inputs(inputs);
    let mut paths = Paths::new(&model.random, settings.seed);
    let mut dynamics = model.dynamics;
    let mut state = State::from_motion(&start(), &model.dynamics.hold(&script.posture(0.0)));
    let mut flown = Vec::new();
    let mut history = Vec::new();
    let mut time = 0.0;
    while time <= settings.duration {
        let rate = PostureRate::between(
            &script.posture(time - step),
            &script.posture(time + step),
            2.0 * step,
        );
        let sample = model.dynamics.sample(&script.posture(time), &rate);
        let motion = state.motion(&sample);
        history.push((time, Moving::of(&motion)));
        flown.push((time, motion));
        let mut part = 0.0;
        while part < finer {
            let now = time + step * part;
            part += 1.0;
            let interval =
                model
                    .dynamics
                    .between(&script.posture(now), &script.posture(now + step), step);
            let apply = |state: &mut State<f64>, time: f64| {
                let body = (&script.posture(time), &interval);
                let loads = &model.applied;
                loads.push(&model.dynamics, state, body, time, 0.5 * step);
            };
            apply(&mut state, now);
            let acting = paths.as_mut().map_or(inputs, |paths| {
                paths.advance(
                    (motion.velocity_inertial() - dynamics.air.velocity).norm(),
                    step,
                );
                dynamics.air.velocity = model.dynamics.air.velocity + paths.gust();
                paths.changed(&inputs)
            });
            state = dynamics.step(&state, &interval, &acting, step);
            apply(&mut state, now + step);
            for hidden in hidden {
                if let Hidden::Outside(outside) = hidden {
                    outside.push(&mut state, &motion, now, step);
                }
            }
        }
        time = flown.len() as f64 / settings.rate;
    }
    (flown, history)
}

/// Initial motion: belly to earth at terminal speed.
fn start() -> Motion<f64> {
    let inertial_from_body = facing_north(core::f64::consts::FRAC_PI_2);
    Motion {
        inertial_from_body,
        position: Vector::new(0.0, 0.0, START_HEIGHT),
        velocity: inertial_from_body.inverse() * Vector::new(2.0, 1.0, -52.0),
        angular_velocity: Vector::zero(),
    }
}

/// Perturbs the simulated body relative to the one in the files.
fn perturb(dynamics: &mut Dynamics<f64>, random: &mut ChaCha8Rng, noise: f64) {
    let mut factor = || 1.0 + random.sample::<f64, _>(StandardNormal) * SUBJECT_DEVIATION * noise;
    let (mass, inertia) = (factor(), factor());
    for (_, segment) in dynamics.body.segments.iter_mut() {
        segment.mass *= mass;
        segment.inertia *= mass * inertia;
        segment.area *= factor();
    }
}
