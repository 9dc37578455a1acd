//! SVG figures: panels over a common time, one below the other.

mod parts;

use plotters::coord::Shift;
use plotters::prelude::*;

use crate::diagnostic::{Problem, Result};
use crate::replay::comparison::{Channel, Comparison, Pair};
use parts::{thinned, unwrapped_parts};

/// How a line is drawn.
#[derive(Debug, Clone, Copy)]
pub struct Line {
    /// Name in the legend.
    pub label: &'static str,
    pub(crate) colour: RGBColor,
    pub(crate) width: u32,
}

impl Line {
    /// As the plotting library wants it.
    pub fn style(&self) -> ShapeStyle {
        self.colour.stroke_width(self.width)
    }
}

/// Broad and pale, to lie below: seen where lines agree, and in grey print.
pub const MEASURED: Line = Line {
    label: "measured",
    colour: RGBColor(0x8f, 0xb8, 0xde),
    width: 3,
};
/// Thin and dark, to lie above.
pub const SIMULATED: Line = Line {
    label: "simulated",
    colour: RGBColor(0x9c, 0x2f, 0x00),
    width: 1,
};
/// Reconstruction with estimated inputs.
pub const ESTIMATED: Line = Line {
    label: "with estimated inputs",
    colour: RGBColor(0x9c, 0x2f, 0x00),
    width: 1,
};
/// Reconstruction with constant inputs.
pub const CONSTANT: Line = Line {
    label: "with constant inputs",
    colour: RGBColor(0x8a, 0x8a, 0x8a),
    width: 1,
};
/// The plain model, with something missing.
pub const PLAIN: Line = Line {
    label: "the model alone",
    colour: RGBColor(0x8a, 0x8a, 0x8a),
    width: 2,
};
/// The model with what was found.
pub const EXTENDED: Line = Line {
    label: "with the effects found",
    colour: RGBColor(0x9c, 0x2f, 0x00),
    width: 2,
};
/// What is left where nothing is missing.
pub const FLOOR: Line = Line {
    label: "where nothing is missing",
    colour: RGBColor(0x8f, 0xb8, 0xde),
    width: 3,
};
/// Lines of the three axes: pitch, yaw, roll.
pub const AXES: [Line; 3] = [
    Line {
        label: "pitch",
        colour: RGBColor(0xc4, 0x6a, 0x00),
        width: 2,
    },
    Line {
        label: "yaw",
        colour: RGBColor(0x1b, 0x6e, 0x53),
        width: 2,
    },
    Line {
        label: "roll",
        colour: RGBColor(0x5b, 0x4b, 0xa8),
        width: 2,
    },
];

/// What a filter watches of itself: attitude, angular velocity, velocity, residual load, all channels as one.
pub const WATCHED: [Line; 5] = [
    Line {
        label: "attitude",
        colour: RGBColor(0xc4, 0x6a, 0x00),
        width: 1,
    },
    Line {
        label: "angular velocity",
        colour: RGBColor(0x1b, 0x6e, 0x53),
        width: 1,
    },
    Line {
        label: "velocity",
        colour: RGBColor(0x5b, 0x4b, 0xa8),
        width: 1,
    },
    Line {
        label: "residual load",
        colour: RGBColor(0x8f, 0xb8, 0xde),
        width: 2,
    },
    Line {
        label: "all channels",
        colour: RGBColor(0x1b, 0x6e, 0x53),
        width: 2,
    },
];
/// Above these it doubts itself, and is lost.
pub const LIMITS: [Line; 2] = [
    Line {
        label: "doubtful above",
        colour: RGBColor(0x8a, 0x8a, 0x8a),
        width: 1,
    },
    Line {
        label: "lost above",
        colour: RGBColor(0x9c, 0x2f, 0x00),
        width: 1,
    },
];
/// A fall flown again with what was told from it.
pub const FLOWN: Line = Line {
    label: "flown again",
    colour: RGBColor(0x9c, 0x2f, 0x00),
    width: 1,
};
/// Pieces with one value each.
pub const ESTIMATED_PIECES: Line = Line {
    label: "pieces",
    colour: RGBColor(0x9c, 0x2f, 0x00),
    width: 2,
};
/// Where one phase ends and another begins.
pub const BORDER: Line = Line {
    label: "exit, opening, canopy",
    colour: RGBColor(0x1b, 0x6e, 0x53),
    width: 1,
};
/// Lines of the models that validation compares, in its order.
pub const MODEL_PARTS: [Line; 4] = [
    Line {
        label: "exact equations",
        colour: RGBColor(0x1b, 0x6e, 0x53),
        width: 3,
    },
    Line {
        label: "as published",
        colour: RGBColor(0x9c, 0x2f, 0x00),
        width: 2,
    },
    Line {
        label: "limbs without momentum",
        colour: RGBColor(0x5b, 0x4b, 0xa8),
        width: 1,
    },
    Line {
        label: "posture frozen",
        colour: RGBColor(0x8a, 0x8a, 0x8a),
        width: 1,
    },
];

/// Values over time, in the order of time.
#[derive(Debug, Clone)]
pub struct Curve {
    /// How it is drawn.
    pub line: Line,
    /// Time (s) and value.
    pub points: Vec<(f64, f64)>,
}

/// One plot of a figure.
#[derive(Debug, Clone)]
pub struct Panel {
    /// What is shown, with unit and figures.
    pub caption: String,
    /// Later ones lie above.
    pub curves: Vec<Curve>,
    /// Whether values are angles that jump from one end of their range to the other.
    pub wraps: bool,
}

const WIDTH: u32 = 1000;
const PANEL_HEIGHT: u32 = 170;
const TITLE_HEIGHT: u32 = 26;
const LEGEND_HEIGHT: u32 = 20;

/// A figure as an SVG document. The legend lists every line of the panels once.
///
/// # Errors
/// Returns an error if the figure cannot be drawn.
pub fn figure_svg(title: &str, panels: &[Panel]) -> Result<String> {
    figure_svg_over("s", title, panels)
}

/// As [`figure_svg`], over something else than time in seconds: `unit` stands at its ticks.
///
/// # Errors
/// Returns an error if the figure cannot be drawn.
pub fn figure_svg_over(unit: &str, title: &str, panels: &[Panel]) -> Result<String> {
    let height: u32 = panels.iter().map(|_| PANEL_HEIGHT).sum();
    laid_out_svg(unit, title, panels, height, (panels.len().max(1), 1))
}

/// As [`figure_svg`], the panels side by side.
///
/// # Errors
/// Returns an error if the figure cannot be drawn.
pub fn row_svg(title: &str, panels: &[Panel]) -> Result<String> {
    laid_out_svg(
        "s",
        title,
        panels,
        2 * PANEL_HEIGHT,
        (1, panels.len().max(1)),
    )
}

fn laid_out_svg(
    unit: &str,
    title: &str,
    panels: &[Panel],
    height: u32,
    layout: (usize, usize),
) -> Result<String> {
    let legend = legend(panels);
    let rows = legend.last().map_or(1, |entry| entry.row + 1);
    let head = TITLE_HEIGHT + LEGEND_HEIGHT * rows;
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, (WIDTH, head + height)).into_drawing_area();
        draw(&root, title, head, &legend)
            .and_then(|body| {
                for (panel, area) in panels.iter().zip(&body.split_evenly(layout)) {
                    draw_panel(area, panel, unit)?;
                }
                Ok(root.present()?)
            })
            .map_err(|error| Problem::internal(format!("cannot draw the plot: {error}")))?;
    }
    Ok(svg)
}

/// A figure of all channels, measured and simulated.
///
/// # Errors
/// Returns an error if the figure cannot be drawn.
pub fn comparison_svg(title: &str, comparison: &Comparison) -> Result<String> {
    let rms = comparison.rms();
    let panels = Channel::ALL.map(|channel| {
        let (label, unit) = channel.label();
        Panel {
            caption: format!("{label} ({unit}): RMS gap {:.3}", rms.get(channel)),
            curves: vec![
                measured_curve(channel, comparison.series()),
                simulated_curve(channel, comparison.series(), SIMULATED),
            ],
            wraps: channel.is_angle(),
        }
    });
    figure_svg(title, &panels)
}

/// The measured side of a channel.
pub fn measured_curve(channel: Channel, series: &[Pair]) -> Curve {
    let points = series
        .iter()
        .map(|pair| (pair.time, channel.value(&pair.measured)));
    Curve {
        line: MEASURED,
        points: points.collect(),
    }
}

/// The simulated side of a channel.
pub fn simulated_curve(channel: Channel, series: &[Pair], line: Line) -> Curve {
    let points = series
        .iter()
        .map(|pair| (pair.time, channel.value(&pair.simulated)));
    Curve {
        line,
        points: points.collect(),
    }
}

type DrawResult = core::result::Result<(), Box<dyn std::error::Error>>;
type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// A line of the legend and its place.
struct Entry {
    line: Line,
    left: u32,
    row: u32,
}

/// Every line of the panels once, in as many rows as they need.
fn legend(panels: &[Panel]) -> Vec<Entry> {
    let mut entries: Vec<Entry> = Vec::new();
    let (mut left, mut row) = (60, 0);
    for curve in panels.iter().flat_map(|panel| &panel.curves) {
        let line = curve.line;
        if entries.iter().any(|entry| entry.line.label == line.label) {
            continue;
        }
        let width = 56 + 7 * u32::try_from(line.label.len()).unwrap_or(WIDTH);
        if left > 60 && left + width > WIDTH {
            (left, row) = (60, row + 1);
        }
        entries.push(Entry { line, left, row });
        left += width;
    }
    entries
}

/// Draws title and legend; what is left below them.
fn draw<'a>(
    root: &Area<'a>,
    title: &str,
    height: u32,
    legend: &[Entry],
) -> core::result::Result<Area<'a>, Box<dyn std::error::Error>> {
    root.fill(&WHITE)?;
    let (head, body) = root.split_vertically(height);
    head.draw_text(
        title,
        &("sans-serif", 18).into_font().color(&BLACK),
        (60, 8),
    )?;
    for entry in legend {
        let x = i32::try_from(entry.left)?;
        let y = i32::try_from(TITLE_HEIGHT + LEGEND_HEIGHT * entry.row)?;
        let style = entry.line.style();
        head.draw(&PathElement::new(
            vec![(x, y + 12), (x + 24, y + 12)],
            style,
        ))?;
        head.draw_text(
            entry.line.label,
            &("sans-serif", 13).into_font().color(&BLACK),
            (x + 30, y + 4),
        )?;
    }
    Ok(body)
}

fn draw_panel(area: &Area<'_>, panel: &Panel, unit: &str) -> DrawResult {
    let points = || panel.curves.iter().flat_map(|curve| curve.points.iter());
    let bounds = |values: &dyn Fn(&(f64, f64)) -> f64| {
        let low = points().map(values).fold(f64::INFINITY, f64::min);
        let high = points().map(values).fold(f64::NEG_INFINITY, f64::max);
        if low.is_finite() && high > low {
            (low, high)
        } else {
            (0.0, 1.0)
        }
    };
    let ((start, end), (low, high)) = (bounds(&|point| point.0), bounds(&|point| point.1));
    let margin = (0.06 * (high - low)).max(0.02);
    let decimals = usize::from(end - start < 8.0);
    let mut chart = ChartBuilder::on(area)
        .margin(4)
        .margin_right(16)
        .caption(&panel.caption, ("sans-serif", 13))
        .x_label_area_size(22)
        .y_label_area_size(52)
        .build_cartesian_2d(start..end, (low - margin)..(high + margin))?;
    chart
        .configure_mesh()
        .x_labels(12)
        .y_labels(5)
        .light_line_style(TRANSPARENT)
        .bold_line_style(BLACK.mix(0.12))
        .label_style(("sans-serif", 11))
        .x_label_formatter(&|x| format!("{x:.decimals$} {unit}"))
        .draw()?;
    for Curve { line, points } in &panel.curves {
        for part in unwrapped_parts(panel.wraps, points) {
            let style = line.style();
            let part = thinned(part, 2.0 * (end - start) / f64::from(WIDTH));
            chart.draw_series(LineSeries::new(part, style))?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_empty_comparison_still_draws() {
        let svg = comparison_svg("nothing", &Comparison::default()).unwrap();
        assert!(svg.starts_with("<svg") && svg.contains("vertical velocity (m/s)"));
    }
}
