//! Effects that resemble each other are told apart.

use super::*;

/// Pairs of flights, each of another person in another wind: the first seeds, not those that pass.
const PAIRS: core::ops::Range<u64> = 0..4;

/// Pairs that must be named rightly; the others may have no name, but no wrong one. In flights of 40 s, 94 % of the pairs
/// are named rightly (docs/discovery.md).
const LEAST_RIGHT: usize = 3;

/// Half of the pairs have a wind that is the same at all heights, half one that changes with height.
#[test]
fn a_wind_is_distinguished_from_one_that_changes_with_height() {
    let mut right = 0;
    for pair in PAIRS {
        let effect = [Effect::Wind, Effect::WindShear][usize::from(pair % 2 == 1)];
        let truth = laboratory::strength(effect, pair, None);
        let settings = |seed| laboratory::Settings {
            seed,
            person: Some(pair),
            duration: 15.0,
            rate: 120.0,
            joints: Joints::CONSTANT,
            ..laboratory::Settings::default()
        };
        let hidden = [Hidden::Effect(effect, truth)];
        let [one, other] = [2 * pair, 2 * pair + 1].map(|seed| flown(&hidden, &settings(seed)));
        let report = discover(&[one], &[other], &Settings::default(), &()).unwrap();
        let Some(named) = report.effects.first() else {
            continue;
        };
        let name = effect.description().name;
        assert_eq!(named.name, name, "pair {pair}: {:?}", report.effects);
        assert_eq!(report.effects.len(), 1, "pair {pair}: {:?}", report.effects);
        right += 1;
        for (k, truth) in truth.iter().take(2).enumerate() {
            let (value, error) = (named.parameters[k].1, named.standard_errors[k].1);
            assert!(
                (value - truth).abs() < 4.0 * error,
                "pair {pair}, {truth}: {named:?}"
            );
        }
        // In a recording, the speed of the aircraft acts like a wind, and the same everywhere.
        let rivals: Vec<_> = named.rivals.iter().map(|rival| rival.name).collect();
        assert_eq!(
            rivals.contains(&"exit-speed"),
            effect == Effect::Wind,
            "pair {pair}: {rivals:?}"
        );
        assert!(
            !rivals.iter().any(|rival| rival.starts_with("wind")),
            "pair {pair}: {rivals:?}"
        );
    }
    assert!(right >= LEAST_RIGHT, "{right} of {} named", PAIRS.end);
}
