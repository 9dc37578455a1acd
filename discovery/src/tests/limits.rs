//! Limits of detection against what a search then finds.

use bodyflight_core::effect::Effect;
use bodyflight_laboratory::{self as laboratory, Hidden, JointErrors};

use super::flown;
use crate::named_effect::Outcome;
use crate::output::report::Report;
use crate::{Settings, discover};

/// What is found in two flights of one person in a suit that wanders.
fn searched(seed: u64, duration: f64, hidden: &[Hidden]) -> Report {
    let [flight, other] = [seed, seed + 1].map(|seed| {
        let settings = laboratory::Settings {
            seed,
            person: Some(seed / 2),
            duration,
            rate: 120.0,
            joints: JointErrors {
                wander_deg: 1.0,
                wander_hz: 0.3,
                ..JointErrors::default()
            },
            ..laboratory::Settings::default()
        };
        flown(hidden, &settings)
    });
    discover(&[flight], &[other], &Settings::default(), &()).unwrap()
}

fn limit(report: &Report, effect: Effect, index: usize) -> Option<f64> {
    let name = effect.description().name;
    let mut all = report.detectable.iter();
    all.find(|one| one.name == name).unwrap().least[index].1
}

#[test]
fn an_effect_above_its_limit_is_named_and_one_far_below_is_not() {
    let clean = searched(40, 14.0, &[]);
    assert_eq!(clean.effects, []);
    for (effect, index) in [(Effect::Updraft, 0), (Effect::Damping, 0)] {
        let least = limit(&clean, effect, index).expect("within its range");
        for (times, is_named) in [(1.1, true), (0.3, false)] {
            let mut values = effect.neutral();
            values[index] += times * least;
            let found = searched(40, 14.0, &[Hidden::Effect(effect, values)]);
            let names: Vec<&str> = found.effects.iter().map(|named| named.name).collect();
            let expected = [effect.description().name];
            let expected = if is_named { &expected[..] } else { &[] };
            assert_eq!(names, expected, "{values:?}");
        }
    }
}

#[test]
fn longer_flights_show_weaker_effects_and_short_ones_state_no_limit() {
    let [short, long] = [14.0, 28.0].map(|duration| searched(42, duration, &[]));
    for (effect, index) in [
        (Effect::Updraft, 0),
        (Effect::Drag, 0),
        (Effect::ForearmDrag, 1),
    ] {
        let [least, less] = [&short, &long].map(|report| limit(report, effect, index).unwrap());
        assert!(less < 0.95 * least, "{effect:?}: {less}, {least}");
    }
    let thin = searched(42, 8.0, &[]);
    assert_eq!((thin.verdict, thin.detectable), (Outcome::Thin, Vec::new()));
}
