//! Error of each model's attitude over a whole flight with fitted start.

use super::windows::{MODELS, angle, whole_run};
use crate::output::plot::{Curve, MODEL_PARTS, Panel, figure_svg};
use bodyflight_io::diagnostic::Result;
use bodyflight_replay::recorded::Recorded;

/// One panel per flight, one line per model.
///
/// # Errors
/// Returns an error if the figure cannot be drawn.
pub fn svg(title: &str, flights: &[(String, Recorded)]) -> Result<String> {
    let panels: Vec<Panel> = flights
        .iter()
        .map(|(name, flight)| Panel {
            caption: format!("{name}: angle between measured and simulated attitude (degrees)"),
            curves: MODELS
                .iter()
                .zip(MODEL_PARTS)
                .map(|(model, line)| Curve {
                    line,
                    points: whole_run(flight, *model)
                        .iter()
                        .zip(&flight.samples)
                        .map(|(simulated, sample)| {
                            (
                                sample.time - flight.samples[0].time,
                                angle(simulated, &sample.motion).to_degrees(),
                            )
                        })
                        .collect(),
                })
                .collect(),
            bands: Vec::new(),
            shades: Vec::new(),
            wraps: false,
        })
        .collect();
    figure_svg(title, &panels)
}
