//! A flight's person and air as text, for files that carry them along.

use bodyflight_replay::flight::{DensityChoice, Flight};

/// Name of the subject's file beside the text.
pub(crate) const SUBJECT_FILE: &str = "subject.toml";

/// The `flight.toml` of a recording with the limb groups and the air of a flight; the person is in [`SUBJECT_FILE`].
pub(crate) fn flight_text(flight: &Flight, recording: &str) -> String {
    let [north, west, up] = flight.air_velocity;
    let density = match flight.density {
        DensityChoice::Constant(density) => format!("density = {density:?}"),
        DensityChoice::FirstFrameAltitude(altitude) => format!("altitude_m = {altitude:?}"),
    };
    format!(
        "recording = {recording:?}\nsubject = \"{SUBJECT_FILE}\"\nmuscles = \"{}\"\nmuscle_forces = \"{}\"\n\n\
         [air]\n{density}\nvelocity = [{north:?}, {west:?}, {up:?}]\n",
        flight.muscles.name(),
        flight.muscles.forces.name()
    )
}
