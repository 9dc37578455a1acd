//! The flights of the experiments, and the presets that reconstruct them.

use std::path::Path;

use bodyflight_core::estimator::preset::Preset;
use bodyflight_core::maneuver::Maneuver;
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_laboratory::synthesize::{self, Additions, Request};
use bodyflight_replay::subject::Subject;

/// Seed of sway and noise.
const SEED: u64 = 1;

/// Flies a script with the paper's sensor noise, and writes the flight into `folder`.
pub(super) fn fly(
    maneuver: &str,
    tunnel: bool,
    additions: Additions<'_>,
    folder: &Path,
) -> Result<synthesize::Report> {
    let maneuver = Maneuver::from_name(maneuver)
        .ok_or_else(|| Problem::internal(format!("there is no maneuver {maneuver}")))?;
    let subject = Subject::default();
    let request = Request {
        tunnel,
        ..Request::new(maneuver, &subject, SEED)
    };
    synthesize::synthesize_with(&request, additions, folder, &mut |_| {})
}

/// The preset of the paper with this name.
pub(super) fn preset(name: &str) -> Result<&'static Preset> {
    Preset::from_name(name).ok_or_else(|| Problem::internal(format!("there is no preset {name}")))
}
