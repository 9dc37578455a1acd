//! The cases: effects in families of errors, and flights without a missing effect.

use bodyflight_core::effect::Effect;
use bodyflight_core::maneuver::Maneuver;
use bodyflight_core::maneuver::scripts::MANEUVERS;
use bodyflight_laboratory::drawn::drawn;
use bodyflight_laboratory::outside::Outside;
use bodyflight_laboratory::{Hidden, JointErrors, strength};

/// A family of joint errors of the suit.
pub(super) struct Family {
    pub(super) name: &'static str,
    pub(super) joints: JointErrors,
}

const fn family(name: &'static str, joints: JointErrors) -> Family {
    Family { name, joints }
}

/// All families: each effect is hidden in each of them.
pub(super) const FAMILIES: [Family; 4] = [
    family("constant", JointErrors::CONSTANT),
    family("wander", JointErrors::WANDER),
    family("mixed", JointErrors::MIXED),
    family("wide", JointErrors::WIDE),
];

/// Default joint errors, which are those of `synth`.
const EXACT: Family = family("exact", JointErrors::NONE);

/// Range of sensor noise relative to the paper's, sampled evenly in its logarithm.
const SENSOR_NOISE: [f64; 2] = [0.5, 2.0];

/// The movements of a flight.
pub(super) enum Flown {
    /// Movements of the laboratory, drawn by the seed.
    Laboratory(Vec<Hidden>),
    /// A script of `synth` with its inputs, perhaps in a tunnel.
    Maneuver(&'static Maneuver, bool),
}

/// A pair of flights.
pub(super) struct Case {
    pub(super) group: &'static str,
    pub(super) family: &'static Family,
    pub(super) name: String,
    pub(super) flown: Flown,
    pub(super) seed: u64,
    /// Seed of body, movements and errors, different in every case.
    pub(super) flight_seed: u64,
    /// Sensor noise relative to the paper's.
    pub(super) sensor_noise: f64,
}

impl Case {
    /// The hidden disturbance.
    pub(super) fn hidden(&self) -> &[Hidden] {
        match &self.flown {
            Flown::Laboratory(hidden) => hidden,
            Flown::Maneuver(..) => &[],
        }
    }

    /// Names of the hidden effects.
    pub(super) fn names(&self) -> Vec<&'static str> {
        let name = |hidden: &Hidden| match hidden {
            Hidden::Effect(effect, _) => effect.description().name,
            Hidden::Outside(outside) => outside.name(),
            Hidden::Load(_) => "load",
        };
        self.hidden().iter().map(name).collect()
    }
}

fn effect(effect: Effect, seed: u64) -> Hidden {
    Hidden::Effect(effect, strength(effect, seed, None))
}

/// Pairs of effects that are hidden together.
const PAIRS: [(Effect, Effect); 6] = [
    (Effect::Wind, Effect::Mass),
    (Effect::Drag, Effect::GyroBias),
    (Effect::Lift, Effect::HeadingDrift),
    (Effect::Moment, Effect::Wind),
    (Effect::Damping, Effect::Mounting),
    (Effect::Wind, Effect::Turbulence),
];

/// Number of loads drawn from the grammar in each pass, and of flights without any effect in each of its families.
const LOADS: u64 = 6;
const CLEAN: u64 = 2;

/// All cases of a seed, in four passes. Each pass has every effect once, in a family that changes with the pass, and a
/// quarter of everything else.
fn of_seed(seed: u64) -> Vec<Case> {
    let first = seed;
    let mut cases = Vec::new();
    for pass in 0..FAMILIES.len() {
        let turned = |k: usize| &FAMILIES[(k + pass) % FAMILIES.len()];
        let mut add = |group, family, name: &str, flown, seed: u64| {
            let [least, most]: [f64; 2] = SENSOR_NOISE;
            let flight_seed = first * 1000 + cases.len() as u64;
            // The golden section spreads evenly for any number of cases.
            let place = (cases.len() as f64 * 0.618_034 + seed as f64 * 0.414_214).fract();
            let sensor_noise = if group == "maneuver" || group == "tunnel" {
                1.0
            } else {
                least * (most / least).powf(place)
            };
            cases.push(Case {
                group,
                family,
                name: name.to_owned(),
                flown,
                seed,
                flight_seed,
                sensor_noise,
            });
        };
        for family in &FAMILIES {
            for clean in 0..CLEAN {
                let seed = (seed * 4 + pass as u64) * CLEAN + clean;
                add("clean", family, "clean", Flown::Laboratory(vec![]), seed);
            }
        }
        // A flow profile acts only in a tunnel, and these flights fall through still air.
        let felt = |effect: &&Effect| **effect != Effect::TunnelProfile;
        for (k, &one) in Effect::ALL.iter().filter(felt).enumerate() {
            let hidden = vec![effect(one, seed)];
            let name = one.description().name;
            add("single", turned(k), name, Flown::Laboratory(hidden), seed);
        }
        for (k, outside) in Outside::ALL.into_iter().enumerate() {
            let hidden = vec![Hidden::Outside(outside)];
            let name = outside.name();
            add("outside", turned(k), name, Flown::Laboratory(hidden), seed);
        }
        for (k, load) in (0..LOADS).enumerate() {
            // Every pass draws its own loads, since their supply is unlimited.
            let seed = (seed * 4 + pass as u64) * LOADS + load;
            let hidden = vec![Hidden::Load(drawn(seed))];
            add("load", turned(k), "load", Flown::Laboratory(hidden), seed);
        }
        for (k, (a, b)) in PAIRS.into_iter().enumerate() {
            let name = format!("{} + {}", a.description().name, b.description().name);
            let hidden = vec![effect(a, seed), effect(b, seed + 77)];
            add("pair", turned(k), &name, Flown::Laboratory(hidden), seed);
        }
        // Three seeds of every script, and one pass in a tunnel.
        for maneuver in MANEUVERS {
            let (group, seed) = match pass {
                3 => ("tunnel", seed * 3),
                _ => ("maneuver", seed * 3 + pass as u64),
            };
            let flown = Flown::Maneuver(maneuver, pass == 3);
            add(group, &EXACT, maneuver.name, flown, seed);
        }
    }
    cases
}

/// Cases of the given seeds, restricted to names or groups if any are given.
pub(super) fn cases(seeds: core::ops::Range<u64>, only: &[String]) -> Vec<Case> {
    let asked = |case: &Case| {
        let is = |word: &String| *word == case.name || word == case.group;
        only.is_empty() || only.iter().any(is)
    };
    seeds.flat_map(of_seed).filter(asked).collect()
}
