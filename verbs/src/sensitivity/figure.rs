//! The figure of a sensitivity: change of each channel against the change of each parameter.

use plotters::style::RGBColor;

use super::{Parameter, Report, SHOWN};
use crate::output::plot::{Curve, Line, Panel, figure_svg_over};
use bodyflight_io::diagnostic::Result;

/// A colour for each parameter, in order.
const COLOURS: [RGBColor; Parameter::ALL.len()] = [
    RGBColor(0x00, 0x72, 0xb2),
    RGBColor(0xd5, 0x5e, 0x00),
    RGBColor(0x00, 0x9e, 0x73),
    RGBColor(0xcc, 0x79, 0xa7),
    RGBColor(0xe6, 0x9f, 0x00),
    RGBColor(0x56, 0xb4, 0xe9),
    RGBColor(0x77, 0x77, 0x77),
    RGBColor(0x00, 0x00, 0x00),
    RGBColor(0x8a, 0x6d, 0x00),
];

impl Report {
    /// The figure, from free runs with the same postures and inputs: one panel per channel, one line per parameter.
    ///
    /// # Errors
    /// Returns an error if the figure cannot be drawn.
    pub fn svg(&self, title: &str) -> Result<String> {
        let panels = SHOWN.map(|channel| {
            let share = |value: f64| 100.0 * value / self.amplitude.get(channel).max(1e-9);
            let curve = |(parameter, colour): (Parameter, RGBColor)| {
                let effects = self.effects.iter().filter(|e| e.parameter == parameter);
                let ends =
                    effects.map(|e| (100.0 * (e.factor - 1.0), share(e.change.get(channel))));
                let mut points: Vec<(f64, f64)> = ends.chain([(0.0, 0.0)]).collect();
                points.sort_by(|a, b| a.0.total_cmp(&b.0));
                Curve {
                    line: Line {
                        label: parameter.label(),
                        colour,
                        width: 2,
                    },
                    points,
                }
            };
            Panel {
                caption: format!(
                    "change of {} (RMS, % of its largest size)",
                    channel.label().0
                ),
                curves: Parameter::ALL.into_iter().zip(COLOURS).map(curve).collect(),
                bands: Vec::new(),
                wraps: false,
            }
        });
        figure_svg_over("%", title, &panels)
    }
}
