//! Figures: amplitudes over time, Bode plot, and the patterns on the body.

use std::fmt::Write as _;

use bodyflight_core::body::pattern::moved;
use bodyflight_core::{Body, Posture};
use bodyflight_io::diagnostic::Result;
use nalgebra::Vector3;
use plotters::style::RGBColor;

use super::Technique;
use super::against::TURN;
use super::axes::pattern;
use super::report::Pattern;
use crate::output::bodies::View;
use crate::output::figure::escaped;
use crate::output::limbs::limbs;
use crate::output::plot::{Curve, Line, Panel, figure_svg, figure_svg_over};

/// Lines of the patterns, in colours that differ without hue too.
const LINES: [Line; 8] = [
    shade("pattern 1", 0x9c, 0x2f, 0x00),
    shade("pattern 2", 0x2b, 0x78, 0xc5),
    shade("pattern 3", 0x44, 0x99, 0x88),
    shade("pattern 4", 0xaa, 0x33, 0x77),
    shade("pattern 5", 0x8a, 0x8a, 0x8a),
    shade("pattern 6", 0xcc, 0xbb, 0x44),
    shade("pattern 7", 0x22, 0x22, 0x22),
    shade("pattern 8", 0x66, 0xcc, 0xee),
];
/// Gains below this are drawn as this (dB).
const LEAST_DB: f64 = -80.0;

const fn shade(label: &'static str, red: u8, green: u8, blue: u8) -> Line {
    Line {
        label,
        colour: RGBColor(red, green, blue),
        width: 2,
    }
}

/// Amplitudes of the patterns over time.
///
/// # Errors
/// Returns an error if the figure cannot be drawn.
pub fn amplitudes_svg(title: &str, technique: &Technique) -> Result<String> {
    let patterns = technique.report.patterns.iter();
    let panels: Vec<Panel> = patterns
        .zip(&technique.components)
        .zip(LINES)
        .map(|((found, component), line)| {
            let times = technique.time.iter().copied();
            let degrees = component.amplitude.iter().map(|a| a.to_degrees());
            Panel {
                caption: format!("{} (deg): {}", line.label, in_words(found)),
                curves: vec![Curve {
                    line,
                    points: times.zip(degrees).collect(),
                }],
                bands: Vec::new(),
                shades: Vec::new(),
                wraps: false,
            }
        })
        .collect();
    figure_svg(title, &panels)
}

/// Bode plot of the turn rate.
///
/// # Errors
/// Returns an error if the figure cannot be drawn.
pub fn bode_svg(title: &str, technique: &Technique) -> Result<String> {
    let curves = |value: &dyn Fn(f64, f64) -> f64| -> Vec<Curve> {
        let patterns = technique.report.patterns.iter().zip(LINES);
        patterns
            .filter_map(|(found, line)| {
                let turn = found.answer.as_ref()?.responses.get(TURN)?;
                let point = |point: &super::response::Point| {
                    let shown = value(point.gain, point.phase_rad);
                    (point.frequency_hz.log10(), shown)
                };
                Some(Curve {
                    line,
                    points: turn.bode.iter().map(point).collect(),
                })
            })
            .collect()
    };
    let panel = |caption: &str, curves: Vec<Curve>| Panel {
        caption: caption.to_owned(),
        curves,
        bands: Vec::new(),
        shades: Vec::new(),
        wraps: false,
    };
    figure_svg_over(
        "log10(Hz)",
        title,
        &[
            panel(
                "turn rate per pattern, dB of (rad/s)/rad",
                curves(&|gain, _| (20.0 * gain.log10()).max(LEAST_DB)),
            ),
            panel("phase (deg)", curves(&|_, phase| phase.to_degrees())),
        ],
    )
}

fn in_words(found: &Pattern) -> String {
    let told = found
        .weights
        .iter()
        .filter(|weight| weight.told.abs() > 0.0);
    let parts: Vec<String> = told
        .take(3)
        .map(|weight| format!("{} {:+.2}", weight.angle, weight.told))
        .collect();
    format!("{:.0} %, {}", 100.0 * found.share, parts.join(", "))
}

/// Size of a view, and its margin (px).
const VIEW: f64 = 250.0;
const EDGE: f64 = 24.0;
const HEAD: f64 = 44.0;
/// Half the width that a view shows (m).
const HALF: f64 = 1.15;
/// Views of a pattern, in body axes.
const VIEWS: [View; 3] = [
    View {
        name: "from the front",
        right: [1.0, 0.0, 0.0],
        up: [0.0, 0.0, 1.0],
    },
    View {
        name: "from its left",
        right: [0.0, 1.0, 0.0],
        up: [0.0, 0.0, 1.0],
    },
    View {
        name: "from its head",
        right: [1.0, 0.0, 0.0],
        up: [0.0, 1.0, 0.0],
    },
];

/// Each pattern on the body: the neutral pose in grey, and the pose with the pattern twice its RMS either way.
pub fn picture_svg(title: &str, body: &Body<f64>, technique: &Technique) -> String {
    let rows = technique.report.patterns.len().max(1);
    #[expect(clippy::cast_precision_loss, reason = "at most eight rows")]
    let (width, height) = (
        VIEW * VIEWS.len() as f64,
        (HEAD + VIEW) * rows as f64 + HEAD,
    );
    let plain = escaped(title);
    // Writing to a String cannot fail.
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" font-family=\"sans-serif\" font-size=\"11\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n<text x=\"8\" y=\"20\" font-size=\"14\">{plain}</text>\n\
         <text x=\"8\" y=\"38\">grey: neutral pose; red and thick: with the pattern at twice its RMS; blue and thin: against it</text>\n"
    );
    let found = technique.report.patterns.iter().zip(&technique.components);
    let mut top = HEAD;
    for (number, (found, component)) in found.enumerate() {
        let along = pattern(&technique.axes, &component.told);
        let size = 2.0 * component.rms;
        let _ = writeln!(
            svg,
            "<text x=\"8\" y=\"{:.0}\" font-weight=\"bold\">pattern {}: {}</text>",
            top + 18.0,
            number + 1,
            in_words(found)
        );
        let poses: [(Posture<f64>, &str, f64); 3] = [
            (technique.posture, "#b0b0b0", 7.0),
            (moved(&technique.posture, &along, size), "#c62828", 4.0),
            (moved(&technique.posture, &along, -size), "#1565c0", 2.0),
        ];
        let mut left = 0.0;
        for view in &VIEWS {
            let _ = writeln!(
                svg,
                "<text x=\"{:.0}\" y=\"{:.0}\" fill=\"#777777\">{}</text>",
                left + 8.0,
                top + 36.0,
                view.name
            );
            for (posture, colour, stroke) in &poses {
                let place = |point: &Vector3<f64>| {
                    let scale = (VIEW - 2.0 * EDGE) / (2.0 * HALF);
                    let [right, up] = view.place(point);
                    [
                        left + 0.5 * VIEW + scale * right,
                        // The y axis of an SVG points down.
                        top + HEAD + 0.5 * VIEW - scale * up,
                    ]
                };
                for limb in limbs(body, posture) {
                    let ([x1, y1], [x2, y2]) = (place(&limb.from), place(&limb.to));
                    let _ = writeln!(
                        svg,
                        "<path d=\"M{x1:.1} {y1:.1}L{x2:.1} {y2:.1}\" stroke=\"{colour}\" stroke-width=\"{stroke}\" stroke-linecap=\"round\"/>"
                    );
                }
            }
            left += VIEW;
        }
        top += HEAD + VIEW;
    }
    svg.push_str("</svg>\n");
    svg
}
