//! Height of the centre of mass and angular momentum over time, with the phases in the air.

use super::blocks::states;
use super::{Capture, Report};
use crate::output::plot::{Curve, MODEL_PARTS, Panel, figure_svg};
use bodyflight_io::diagnostic::Result;
use nalgebra::Vector3;

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
    let heights = &capture.heights.points;
    let aloft = heights.iter().copied().filter(|(time, _)| in_air(*time));
    let aloft_momenta: Vec<(f64, Vector3<f64>)> = (capture.parts.iter())
        .flat_map(|part| {
            let times = part.recorded.samples.iter().map(|sample| sample.time);
            let states = states(&part.recorded);
            let momenta = states
                .into_iter()
                .map(|state| state.angular_momentum.components);
            times.zip(momenta).collect::<Vec<_>>()
        })
        .collect();
    let momenta = |axis: usize| {
        let values = aloft_momenta.iter();
        values
            .map(|(time, momentum)| (*time, momentum[axis]))
            .collect()
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
            shades: Vec::new(),
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
            shades: Vec::new(),
            wraps: false,
        },
    ];
    figure_svg(title, &panels)
}
