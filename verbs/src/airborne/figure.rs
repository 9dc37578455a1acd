//! Height of the centre of mass and angular momentum over time, with the phases in the air.

use super::{Capture, Report};
use crate::output::plot::{Curve, MODEL_PARTS, Panel, figure_svg};
use bodyflight_io::diagnostic::Result;

/// Draws a capture.
///
/// # Errors
/// Returns an error if the figure cannot be drawn.
pub fn svg(title: &str, capture: &Capture, report: &Report) -> Result<String> {
    let [exact, published, limbs, _] = MODEL_PARTS;
    let in_air = |time: f64| {
        let within = |begin: f64, length: f64| (begin..=begin + length).contains(&time);
        report
            .phases
            .iter()
            .any(|phase| within(phase.begin_s, phase.length_s))
    };
    let centres = capture.centres();
    let times = capture.times();
    let heights: Vec<(f64, f64)> = (times.iter().copied())
        .zip(centres.iter().map(|centre| centre.z))
        .collect();
    let aloft = heights.iter().copied().filter(|(time, _)| in_air(*time));
    let momenta = |axis: usize| {
        let states = times.iter().zip(&capture.states);
        let values = states.map(|(time, state)| (*time, state.angular_momentum.components[axis]));
        values.filter(|(time, _)| in_air(*time)).collect()
    };
    let named = |line: &crate::output::plot::Line, label: &'static str| crate::output::plot::Line {
        label,
        ..*line
    };
    let panels = [
        Panel {
            caption: "height of the centre of mass (m)".to_owned(),
            curves: vec![
                Curve {
                    line: named(&published, "recorded"),
                    points: heights.clone(),
                },
                Curve {
                    line: named(&exact, "in the air"),
                    points: aloft.collect(),
                },
            ],
            bands: Vec::new(),
            wraps: false,
        },
        Panel {
            caption: "angular momentum in the air (kg m2/s)".to_owned(),
            curves: vec![
                Curve {
                    line: named(&exact, "north"),
                    points: momenta(0),
                },
                Curve {
                    line: named(&published, "west"),
                    points: momenta(1),
                },
                Curve {
                    line: named(&limbs, "up"),
                    points: momenta(2),
                },
            ],
            bands: Vec::new(),
            wraps: false,
        },
    ];
    figure_svg(title, &panels)
}
