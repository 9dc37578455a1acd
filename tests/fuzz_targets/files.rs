//! Parsers of tables and settings.

use std::path::Path;

use bodyflight_mocap::mapping::Mapping;
use bodyflight_replay::flight::Flight;
use bodyflight_replay::input_history::InputHistory;
use bodyflight_replay::model_file::Effects;
use bodyflight_replay::preset_file::Tuning;
use bodyflight_replay::subject::Subject;
use bodyflight_tracks as track;
use bodyflight_tracks::flysight::Track;
use bodyflight_verbs::fall::{Conditions, fall};

/// A folder that does not exist, so that inputs cannot name a file on this machine.
pub(super) const NOWHERE: &str = "/nowhere/of/fuzz";

/// Longest track (samples) that is also analysed, which is a hundred times slower than reading: the target `jump` is for
/// that.
const LONGEST_JUDGED: usize = 40;

/// Reads a FlySight track.
pub(super) fn flysight(input: &[u8]) {
    let path = Path::new(NOWHERE).join("TRACK.CSV");
    if let Ok(track) = Track::parse(input, &path) {
        assert!(!track.fixes.is_empty());
        assert!(track.fixes.is_sorted_by(|a, b| a.time < b.time));
        for fix in &track.fixes {
            assert!(fix.position.is_finite() && fix.velocity.is_finite());
        }
    }
    judged(input, &path, LONGEST_JUDGED);
}

/// Reads any track accepted by `bodyflight fall`, and a history of inputs.
pub(super) fn csv(input: &[u8]) {
    let path = Path::new(NOWHERE).join("track.csv");
    judged(input, &path, LONGEST_JUDGED);
    if let Ok(history) = InputHistory::parse(input, &path) {
        for time in [-1e9, 0.0, 0.5, 1e9] {
            let damping = history.at(time).damping.to_array();
            assert!(damping.iter().all(|value| value.is_finite()));
        }
    }
}

/// Reads a track, and analyses it unless it has more than `longest` samples.
pub(super) fn judged(input: &[u8], path: &Path, longest: usize) {
    let Ok(track) = track::parse(input, path) else {
        return;
    };
    assert!(track.samples.len() >= 2);
    assert!(track.samples.is_sorted_by(|a, b| a.time < b.time));
    if track.samples.len() <= longest
        && let Ok((report, _)) = fall(&track, &Conditions::default(), path)
    {
        let shown = report.steady_drag().unwrap_or_default();
        assert!(report.fall_s.is_finite() && shown.iter().all(|number| number.is_finite()));
        assert_eq!(report.drag_area_m2.is_none(), report.pieces.is_empty());
    }
}

/// Reads settings of every kind.
pub(super) fn toml(input: &[u8]) {
    let Ok(text) = core::str::from_utf8(input) else {
        return;
    };
    let path = Path::new(NOWHERE).join("a.toml");
    if let Ok(flight) = Flight::parse(text, &path) {
        let dynamics = flight.dynamics(1000.0);
        assert!(dynamics.air.density.at(1000.0).is_finite());
    }
    if let Ok(subject) = Subject::parse(text, &path) {
        assert!(subject.body().mass() > 0.0 && subject.body().mass().is_finite());
    }
    if let Ok(effects) = Effects::parse(text, &path) {
        let flight = Flight::bare(&path);
        let model = effects.applied(flight.dynamics(0.0), 0.0);
        assert!(
            model.is_ok(),
            "a file that was read has no value out of range"
        );
    }
    // Accepting and refusing are both correct.
    let _ = Tuning::parse(text, &path);
    let _ = Mapping::parse(text, &path);
}
