//! Analyses of synthetic jumps.

use bodyflight_core::air::GRAVITY;

use super::*;
use crate::prediction::Outcome;
use crate::synthetic::{EXIT, Jump as Flying, jump, wind_at};

/// The only jump of a track.
fn only(samples: &[Sample]) -> Jump {
    let mut jumps = analysed(samples, &Settings::default());
    assert_eq!(jumps.len(), 1, "{jumps:?}");
    jumps.remove(0)
}

#[test]
fn drag_wind_and_opening_of_a_jump_are_found() {
    let flying = Flying::default();
    let found = only(&jump(&flying));
    assert_eq!(found.verdict, Verdict::Explained, "{}", found.reason);
    assert_eq!(found.pieces.len(), 1, "{:?}", found.pieces);
    let [drag, _] = found.drag.expect("usable seconds");
    assert!((drag * 153.0 - 1.0).abs() < 0.02, "{drag}");
    assert!((found.times.exit.unwrap().time - EXIT).abs() < 0.5);
    for wind in found.wind.layers(500.0) {
        let flown = wind_at(&flying, wind.height).xy();
        for axis in 0..2 {
            let off = (wind.velocity[axis] - flown[axis]).abs();
            assert!(
                off < 3.0 * wind.deviation[axis] + 0.3,
                "{wind:?}, flown {flown}"
            );
        }
    }
    let low = found.wind.values.last().unwrap();
    assert!(low.deviation.max() < 3.0, "{low:?}");
    assert!(found.winds_apart().unwrap() < 2.0);
    let opening = found.opening().unwrap();
    assert!((1.0..6.0).contains(&opening.duration_s), "{opening:?}");
    let prediction = found.prediction.unwrap();
    let off = prediction.predicted_mps / prediction.measured_mps - 1.0;
    assert!(off.abs() < 0.02, "{prediction:?}");
    assert_eq!(prediction.outcome, Outcome::Held);
}

#[test]
fn postures_that_change_are_pieces() {
    let flying = Flying {
        drag: vec![(0.0, 1.0 / 153.0), (15.0, 1.0 / 290.0), (35.0, 1.0 / 150.0)],
        ..Flying::default()
    };
    let found = only(&jump(&flying));
    assert_eq!(found.verdict, Verdict::Explained, "{}", found.reason);
    assert_eq!(found.pieces.len(), 3, "{:?}", found.pieces);
    for (piece, (from, factor)) in found.pieces.iter().zip(&flying.drag) {
        assert!((piece.time[0] - EXIT - from).abs() < 2.0, "{piece:?}");
        assert!(
            (piece.drag / factor - 1.0).abs() < 0.06,
            "{piece:?}, {factor}"
        );
    }
}

#[test]
fn a_posture_change_is_reported_instead_of_a_miss() {
    // Braking and a dive in the last third, and a dive that begins just before it.
    for (from, factor) in [(38.0, 1.0 / 100.0), (38.0, 1.0 / 260.0), (32.0, 1.0 / 90.0)] {
        let flying = Flying {
            drag: vec![(0.0, 1.0 / 153.0), (from, factor)],
            ..Flying::default()
        };
        let found = only(&jump(&flying));
        let prediction = found.prediction.unwrap();
        assert_eq!(
            prediction.outcome,
            Outcome::PostureChanged,
            "{prediction:?}"
        );
        let (_, said) = prediction.sentence.split_once("posture changed ").unwrap();
        let said: f64 = said.split(' ').next().unwrap().parse().unwrap();
        assert!((said - from).abs() < 3.0, "{}", prediction.sentence);
        // The change could not be predicted, but its probability is in the error bar.
        let off = (prediction.measured_mps - prediction.predicted_mps).abs();
        assert!(off < 3.0 * prediction.deviation_mps, "{prediction:?}");
        assert!(prediction.kept_chance < 0.9, "{prediction:?}");
    }
    // A wind that turns with height is not a change of posture.
    for speed in [0.0, 15.0, 25.0] {
        let flying = Flying {
            wind: [
                Vector3::new(speed, -speed, 0.0),
                Vector3::new(-3.0, 1.0, 0.0),
            ],
            noise: 0.3,
            ..Flying::default()
        };
        let found = only(&jump(&flying));
        let prediction = found.prediction.unwrap();
        assert_eq!(prediction.outcome, Outcome::Held, "{prediction:?}");
    }
}

#[test]
fn a_short_fall_is_thin_and_that_of_an_anvil_is_not_explained() {
    let hop = Flying {
        opening: 5.0,
        ..Flying::default()
    };
    assert_eq!(only(&jump(&hop)).verdict, Verdict::Thin);
    let anvil = Flying {
        drag: vec![(0.0, 0.000_2)],
        opening: 15.0,
        ..Flying::default()
    };
    let found = only(&jump(&anvil));
    assert_eq!(found.verdict, Verdict::Unexplained, "{}", found.reason);
}

#[test]
fn thin_air_makes_a_fall_of_the_same_drag_faster_but_not_its_normalised_rate() {
    let flown = jump(&Flying::default());
    let found = only(&flown);
    let density = Atmosphere::Standard.density(2000.0);
    let terminal = (2.0 * GRAVITY * 153.0 / density).sqrt();
    assert!(
        (found.normalised_rate / terminal - 1.0).abs() < 0.02,
        "{}",
        found.normalised_rate
    );
}
