//! SVG figures: panels stacked over a common time axis.

mod lines;
mod parts;

use plotters::coord::Shift;
use plotters::prelude::*;

use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_replay::comparison::{Channel, Comparison, Pair};
pub use lines::{
    AXES, BORDER, CHANGED, CONSTANT, ESTIMATED, ESTIMATED_PIECES, EXTENDED, FINE, FLIGHTS, FLOOR,
    FLOWN, LIMITS, Line, MEASURED, MODEL_PARTS, PLAIN, SIMULATED, UNCHANGED, UNTRUSTED, WATCHED,
};
use parts::{thinned, unwrapped_parts};

/// Values over time, in ascending order of time.
#[derive(Debug, Clone)]
pub struct Curve {
    /// How it is drawn.
    pub line: Line,
    /// Time (s) and value.
    pub points: Vec<(f64, f64)>,
}

/// The likely range of a value: lower and upper bounds over time.
#[derive(Debug, Clone)]
pub struct Band {
    /// The line of the value itself.
    pub line: Line,
    /// Time (s), lower and upper bound.
    pub bounds: Vec<(f64, f64, f64)>,
}

/// A time in which what is shown cannot be trusted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shade {
    /// Name in the legend, and colour.
    pub line: Line,
    /// Begin and end (s).
    pub during: [f64; 2],
}

/// One plot of a figure.
#[derive(Debug, Clone)]
pub struct Panel {
    /// What is shown, with its unit and figures.
    pub caption: String,
    /// Drawn below all curves; they extend the axis to at most three times the range of the curves.
    pub bands: Vec<Band>,
    /// Drawn over the whole height, below everything else.
    pub shades: Vec<Shade>,
    /// Drawn in order, later ones on top.
    pub curves: Vec<Curve>,
    /// Whether values are angles (degrees) that jump between the ends of their range.
    pub wraps: bool,
}

const WIDTH: u32 = 1000;
const PANEL_HEIGHT: u32 = 170;
const TITLE_HEIGHT: u32 = 26;
const LEGEND_HEIGHT: u32 = 20;

/// A figure as an SVG document. Each panel has a legend of its lines.
///
/// # Errors
/// Returns an error if the figure cannot be drawn.
pub fn figure_svg(title: &str, panels: &[Panel]) -> Result<String> {
    figure_svg_over("s", title, panels)
}

/// Like [`figure_svg`], over a quantity other than time in seconds: `unit` is printed at the ticks.
///
/// # Errors
/// Returns an error if the figure cannot be drawn.
pub fn figure_svg_over(unit: &str, title: &str, panels: &[Panel]) -> Result<String> {
    let height = |panel: &Panel| PANEL_HEIGHT + LEGEND_HEIGHT * legend_rows(panel, WIDTH);
    let above = head(title);
    drawn(
        (WIDTH, above + panels.iter().map(height).sum::<u32>()),
        |root| {
            let mut rest = draw_title(root, title, above)?;
            for panel in panels {
                let (area, below) = rest.split_vertically(height(panel) * FINE);
                draw_with_legend(&area, panel, unit, (WIDTH, legend_rows(panel, WIDTH)))?;
                rest = below;
            }
            Ok(())
        },
    )
}

/// Like [`figure_svg`], with the panels side by side.
///
/// # Errors
/// Returns an error if the figure cannot be drawn.
pub fn row_svg(title: &str, panels: &[Panel]) -> Result<String> {
    let columns = panels.len().max(1);
    let width = WIDTH / u32::try_from(columns).unwrap_or(1);
    let rows = panels.iter().map(|panel| legend_rows(panel, width)).max();
    let rows = rows.unwrap_or(0);
    let above = head(title);
    let height = above + 2 * PANEL_HEIGHT + LEGEND_HEIGHT * rows;
    drawn((WIDTH, height), |root| {
        let body = draw_title(root, title, above)?;
        for (panel, area) in panels.iter().zip(&body.split_evenly((1, columns))) {
            draw_with_legend(area, panel, "s", (width, rows))?;
        }
        Ok(())
    })
}

/// Height of a title.
fn head(title: &str) -> u32 {
    if title.is_empty() { 0 } else { TITLE_HEIGHT }
}

/// Draws a panel of this width, with so many rows above it for its legend.
fn draw_with_legend(
    area: &Area<'_>,
    panel: &Panel,
    unit: &str,
    (width, rows): (u32, u32),
) -> DrawResult {
    let (head, below) = area.split_vertically(LEGEND_HEIGHT * rows * FINE);
    draw_panel(&below, panel, unit)?;
    draw_legend(if rows == 0 { area } else { &head }, &entries(panel, width))
}

/// A drawing of this width and height, drawn [`FINE`] times as large.
///
/// # Errors
/// Returns an error if `draw` does.
pub fn drawn(
    (width, height): (u32, u32),
    draw: impl FnOnce(&Area<'_>) -> DrawResult,
) -> Result<String> {
    let mut svg = String::new();
    let large = (width * FINE, height * FINE);
    let root = SVGBackend::with_string(&mut svg, large).into_drawing_area();
    draw(&root)
        .and_then(|()| Ok(root.present()?))
        .map_err(|error| Problem::internal(format!("cannot draw the plot: {error}")))?;
    drop(root);
    let size = |(width, height): (u32, u32)| format!("<svg width=\"{width}\" height=\"{height}\"");
    Ok(svg.replacen(&size(large), &size((width, height)), 1))
}

/// A figure of all channels, measured and simulated.
///
/// # Errors
/// Returns an error if the figure cannot be drawn.
pub fn comparison_svg(title: &str, comparison: &Comparison) -> Result<String> {
    let rms = comparison.rms();
    let panels = Channel::ALL.map(|channel| {
        let (label, (unit, factor)) = (channel.titled(), channel.drawn());
        let gap = factor * rms.get(channel);
        Panel {
            caption: format!("{label} ({unit}): RMS gap {gap:.2}"),
            curves: vec![
                measured_curve(channel, comparison.series()),
                simulated_curve(channel, comparison.series(), SIMULATED),
            ],
            bands: Vec::new(),
            shades: Vec::new(),
            wraps: channel.is_angle(),
        }
    });
    figure_svg(title, &panels)
}

/// The measured curve of a channel, in the unit used in figures.
pub fn measured_curve(channel: Channel, series: &[Pair]) -> Curve {
    let factor = channel.drawn().1;
    let points = series
        .iter()
        .map(|pair| (pair.time, factor * channel.value(&pair.measured)));
    Curve {
        line: MEASURED,
        points: points.collect(),
    }
}

/// The simulated curve of a channel, in the unit used in figures.
pub fn simulated_curve(channel: Channel, series: &[Pair], line: Line) -> Curve {
    let factor = channel.drawn().1;
    let points = series
        .iter()
        .map(|pair| (pair.time, factor * channel.value(&pair.simulated)));
    Curve {
        line,
        points: points.collect(),
    }
}

/// The result of drawing.
pub type DrawResult = core::result::Result<(), Box<dyn std::error::Error>>;
/// The area drawn on.
pub type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// A legend entry and its position.
struct Entry {
    line: Line,
    left: u32,
    row: u32,
}

/// Every line of a panel once, in as many rows as a panel of this width needs.
fn entries(panel: &Panel, width: u32) -> Vec<Entry> {
    let mut entries: Vec<Entry> = Vec::new();
    let (mut left, mut row) = (LEGEND_LEFT, 0);
    let shades = panel.shades.iter().map(|shade| shade.line);
    for line in panel.curves.iter().map(|curve| curve.line).chain(shades) {
        if entries.iter().any(|entry| entry.line.label == line.label) {
            continue;
        }
        let room = 56 + text_width(line.label);
        if left > LEGEND_LEFT && left + room > width {
            (left, row) = (LEGEND_LEFT, row + 1);
        }
        entries.push(Entry { line, left, row });
        left += room;
    }
    entries
}

/// Left end of a legend (px).
const LEGEND_LEFT: u32 = 60;

/// Width of a text in the font of captions and legends (px), a little more than it takes.
fn text_width(text: &str) -> u32 {
    7 * u32::try_from(text.chars().count()).unwrap_or(WIDTH)
}

/// Rows that a panel needs above its caption for its legend: none if it fits beside the caption, which is in the middle.
fn legend_rows(panel: &Panel, width: u32) -> u32 {
    let Some(last) = entries(panel, width).pop() else {
        return 0;
    };
    let end = last.left + 40 + text_width(last.line.label);
    let middle = (width + LEGEND_LEFT) / 2;
    let fits = last.row == 0 && end + text_width(&panel.caption) / 2 <= middle;
    if fits { 0 } else { last.row + 1 }
}

/// A place of a drawing in the units of its library.
fn fine((x, y): (u32, u32)) -> core::result::Result<(i32, i32), std::num::TryFromIntError> {
    Ok((i32::try_from(x * FINE)?, i32::try_from(y * FINE)?))
}

/// Draws the title; returns the area below it.
fn draw_title<'a>(
    root: &Area<'a>,
    title: &str,
    above: u32,
) -> core::result::Result<Area<'a>, Box<dyn std::error::Error>> {
    root.fill(&WHITE)?;
    let (head, body) = root.split_vertically(above * FINE);
    if !title.is_empty() {
        let font = ("sans-serif", 18 * FINE).into_font().color(&BLACK);
        head.draw_text(title, &font, fine((60, 8))?)?;
    }
    Ok(body)
}

fn draw_legend(area: &Area<'_>, legend: &[Entry]) -> DrawResult {
    let font = ("sans-serif", 13 * FINE).into_font().color(&BLACK);
    for entry in legend {
        let (x, y) = (entry.left, LEGEND_HEIGHT * entry.row);
        let ends = vec![fine((x, y + 12))?, fine((x + 24, y + 12))?];
        area.draw(&PathElement::new(ends, entry.line.style()))?;
        area.draw_text(entry.line.label, &font, fine((x + 30, y + 4))?)?;
    }
    Ok(())
}

/// Ranges of time and value of a panel.
fn ranges(panel: &Panel) -> [(f64, f64); 2] {
    let points = || panel.curves.iter().flat_map(|curve| curve.points.iter());
    let bounds = |values: &mut dyn Iterator<Item = f64>| {
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
            (low.min(value), high.max(value))
        });
        if low.is_finite() && high > low {
            (low, high)
        } else {
            (0.0, 1.0)
        }
    };
    let times = bounds(&mut points().map(|point| point.0));
    let (low, high) = bounds(&mut points().map(|point| point.1));
    // The first bounds of a filter are wide; they must not flatten the curves.
    let room = high - low;
    let bands = panel.bands.iter().flat_map(|band| band.bounds.iter());
    let (lowest, highest) = bands
        .flat_map(|(_, low, high)| [*low, *high])
        .filter(|value| value.is_finite())
        .fold((low, high), |(low, high), value| {
            (low.min(value), high.max(value))
        });
    [times, (lowest.max(low - room), highest.min(high + room))]
}

fn draw_panel(area: &Area<'_>, panel: &Panel, unit: &str) -> DrawResult {
    let [(start, end), (low, high)] = ranges(panel);
    let margin = (0.06 * (high - low)).max(0.02);
    let decimals = usize::from(end - start < 8.0);
    let mut chart = ChartBuilder::on(area)
        .margin(4 * FINE)
        .margin_right(16 * FINE)
        .caption(&panel.caption, ("sans-serif", 13 * FINE))
        .x_label_area_size(22 * FINE)
        .y_label_area_size(52 * FINE)
        .build_cartesian_2d(start..end, (low - margin)..(high + margin))?;
    for Shade { line, during } in &panel.shades {
        let [from, to] = during.map(|time| time.clamp(start, end));
        let corners = [(from, low - margin), (to, high + margin)];
        chart.draw_series([Rectangle::new(corners, line.colour.filled())])?;
    }
    chart
        .configure_mesh()
        .x_labels(12)
        .y_labels(5)
        .light_line_style(TRANSPARENT)
        .bold_line_style(BLACK.mix(0.12).stroke_width(FINE / 2))
        .axis_style(BLACK.stroke_width(FINE))
        .set_all_tick_mark_size(4 * FINE)
        .label_style(("sans-serif", 11 * FINE))
        .x_label_formatter(&|x| format!("{x:.decimals$} {unit}"))
        .draw()?;
    let width = 2.0 * (end - start) / f64::from(WIDTH);
    let inside = |value: f64| value.clamp(low - margin, high + margin);
    for Band { line, bounds } in &panel.bands {
        let bound = |which: fn(&(f64, f64, f64)) -> f64| {
            let points: Vec<_> = bounds
                .iter()
                .filter(|bound| which(bound).is_finite())
                .map(|bound| (bound.0, inside(which(bound))))
                .collect();
            thinned(&points, width)
        };
        let (lower, upper) = (bound(|bound| bound.1), bound(|bound| bound.2));
        let around: Vec<_> = lower.into_iter().chain(upper.into_iter().rev()).collect();
        chart.draw_series([Polygon::new(around, line.colour.mix(0.18))])?;
    }
    for Curve { line, points } in &panel.curves {
        for part in unwrapped_parts(panel.wraps, points) {
            chart.draw_series(LineSeries::new(thinned(part, width), line.style()))?;
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
        assert!(svg.starts_with("<svg width=\"1000\"") && svg.contains("vertical velocity (m/s)"));
        assert!(svg.contains("viewBox=\"0 0 10000 "));
    }

    #[test]
    fn each_panel_has_the_legend_of_its_own_lines() {
        let panel = |caption: &str, lines: &[Line]| Panel {
            caption: caption.into(),
            bands: Vec::new(),
            shades: Vec::new(),
            curves: (lines.iter())
                .map(|line| Curve {
                    line: *line,
                    points: vec![(0.0, 0.0), (1.0, 1.0)],
                })
                .collect(),
            wraps: false,
        };
        let panels = [
            panel("a", &[MEASURED, SIMULATED]),
            panel("b", &[MEASURED, CONSTANT]),
        ];
        let svg = figure_svg("", &panels).unwrap();
        let count = |label: &str| svg.matches(&format!("\n{label}\n")).count();
        assert_eq!(
            ["measured", "simulated", "with constant inputs"].map(count),
            [2, 1, 1]
        );
        assert_eq!(legend_rows(&panels[0], WIDTH), 0);
        assert_eq!(legend_rows(&panels[0], WIDTH / 3), 1);
        assert_eq!(legend_rows(&panel("b", &WATCHED), WIDTH), 1);
    }

    #[test]
    fn bands_are_drawn_and_do_not_flatten_what_is_in_them() {
        let points = vec![(0.0, 1.0), (1.0, 2.0)];
        let band = Band {
            line: AXES[0],
            bounds: vec![(0.0, -1e6, 1e6), (1.0, 1.5, 2.5)],
        };
        let panel = Panel {
            caption: "muscle".into(),
            bands: vec![band],
            shades: Vec::new(),
            curves: vec![Curve {
                line: AXES[0],
                points,
            }],
            wraps: false,
        };
        assert_eq!(ranges(&panel), [(0.0, 1.0), (0.0, 3.0)]);
        let svg = figure_svg("", &[panel]).unwrap();
        assert!(svg.contains("<polygon") && !svg.contains("font-size=\"180\""));
    }
}
