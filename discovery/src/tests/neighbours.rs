//! Effects that resemble each other are told apart.

use super::*;
use crate::report::Report;

/// The report for two flights of 15 s.
fn found(effect: Effect, truth: [f64; 3], joints: Joints) -> Report {
    let settings = |seed| laboratory::Settings {
        seed,
        person: Some(5),
        duration: 15.0,
        rate: 120.0,
        joints,
        ..laboratory::Settings::default()
    };
    let hidden = [Hidden::Effect(effect, truth)];
    let [one, other] = [5, 6].map(|seed| flown(&hidden, &settings(seed)));
    discover(&[one], &[other], &Settings::default(), &()).unwrap()
}

#[test]
fn a_wind_is_distinguished_from_one_that_changes_with_height() {
    let joints = Joints {
        constant_deg: 1.1,
        wander_deg: 0.0,
        ..Joints::default()
    };
    // These winds are so strong that no suit has errors large enough to explain them.
    let winds = [
        (Effect::Wind, [-31.2, -25.1, 0.0]),
        (Effect::WindShear, [15.0, -20.0, 0.0]),
    ];
    for (effect, truth) in winds {
        let report = found(effect, truth, joints);
        let name = effect.description().name;
        assert_eq!(report.verdict, Outcome::Named, "{report:?}");
        assert_eq!(report.effects.len(), 1, "{:?}", report.effects);
        let named = &report.effects[0];
        assert_eq!(named.name, name, "{named:?}");
        for (k, truth) in truth.iter().take(2).enumerate() {
            let (value, error) = (named.parameters[k].1, named.standard_errors[k].1);
            assert!((value - truth).abs() < 4.0 * error, "{named:?}");
        }
        // In a recording, the speed of the aircraft acts like a wind.
        let rivals = named.rivals.iter().map(|rival| rival.name);
        assert_eq!(
            rivals.clone().any(|rival| rival == "exit-speed"),
            name == "wind"
        );
        assert!(
            !rivals.clone().any(|rival| rival.starts_with("wind")),
            "{named:?}"
        );
        assert!(
            report.errors[0].joint_wander_deg < 0.5,
            "{:?}",
            report.errors
        );
    }
}
