//! Flights of a second, each too short for a search of its own.

use bodyflight_core::effect::Effect;
use bodyflight_core::flight_sample::FlightSample;
use bodyflight_laboratory::{self as laboratory, Hidden};

use super::flown;
use crate::input::flight::RecordedFlight;
use crate::named_effect::Outcome;
use crate::{Settings, discover};

/// Short flights of one person in one suit, each with a start of its own.
fn jumps(seed: u64, duration: f64, hidden: &[Hidden]) -> Vec<RecordedFlight> {
    let settings = laboratory::Settings {
        seed,
        person: Some(1),
        duration: 15.0,
        ..laboratory::Settings::default()
    };
    let flight = flown(hidden, &settings);
    let after = |sample: &&FlightSample| sample.time > flight.samples[0].time + duration;
    let frames = flight.samples.iter().position(|sample| after(&sample));
    let pieces = flight.samples.chunks_exact(frames.unwrap());
    let inputs = flight.inputs[0];
    pieces
        .map(|piece| RecordedFlight::new(piece, flight.dynamics, |_| inputs))
        .collect()
}

/// A second is too short to tell anything, but many such jumps together are as good as a flight.
#[test]
fn short_flights_together_name_an_effect() {
    let wind = [Hidden::Effect(Effect::Wind, [5.0, -3.0, 0.0])];
    let (fitted, held_out) = (jumps(3, 0.9, &wind), jumps(4, 0.9, &wind));
    let settings = Settings::default();
    let report = discover(&fitted[..3], &[], &settings, &()).unwrap();
    assert_eq!(report.verdict, Outcome::Thin);
    assert!(
        report
            .fly_next
            .contains("s in all, and effects can be told apart from 12 s on"),
        "{}",
        report.fly_next
    );
    let report = discover(&fitted, &held_out, &settings, &()).unwrap();
    assert_eq!(report.verdict, Outcome::Named);
    let named = &report.effects[0];
    assert_eq!(named.name, "wind");
    let numbers = named.parameters.iter().zip(&named.standard_errors);
    for (((name, value), (_, error)), truth) in numbers.zip([5.0, -3.0]) {
        assert!(
            (value - truth).abs() < 3.0 * error,
            "{name}: {value} +- {error}"
        );
    }
    let clean = discover(&jumps(5, 0.9, &[]), &jumps(6, 0.9, &[]), &settings, &()).unwrap();
    assert!(clean.effects.is_empty(), "{:?}", clean.verdict);
}
