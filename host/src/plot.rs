//! SVG plots of measured and simulated channels.

use plotters::coord::Shift;
use plotters::prelude::*;

use crate::comparison::{Channel, Comparison, Pair};
use crate::diagnostic::{Problem, Result};

/// Broad and pale below, thin and dark above: both are seen where they agree, in grey print too.
const MEASURED: RGBColor = RGBColor(0x8f, 0xb8, 0xde);
const SIMULATED: RGBColor = RGBColor(0x9c, 0x2f, 0x00);
const WIDTH: u32 = 1000;
const PANEL_HEIGHT: u32 = 170;
const HEAD_HEIGHT: u32 = 46;

/// A figure of all channels, measured and simulated over time, as an SVG document.
///
/// # Errors
/// Where the plot cannot be drawn.
pub fn comparison_svg(title: &str, comparison: &Comparison) -> Result<String> {
    let mut svg = String::new();
    {
        let rows = Channel::ALL.map(|_| PANEL_HEIGHT);
        let size = (WIDTH, HEAD_HEIGHT + rows.iter().sum::<u32>());
        let root = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        draw(&root, title, comparison)
            .map_err(|error| Problem::bad_input(format!("cannot draw the plot: {error}")))?;
    }
    Ok(svg)
}

/// Points, colour and width of a line.
type Curve = (Vec<(f64, f64)>, RGBColor, u32);
type DrawResult = core::result::Result<(), Box<dyn std::error::Error>>;

fn draw(
    root: &DrawingArea<SVGBackend<'_>, Shift>,
    title: &str,
    comparison: &Comparison,
) -> DrawResult {
    root.fill(&WHITE)?;
    let (head, body) = root.split_vertically(HEAD_HEIGHT);
    head.draw_text(
        title,
        &("sans-serif", 18).into_font().color(&BLACK),
        (60, 8),
    )?;
    for (label, colour, x) in [("measured", MEASURED, 60), ("simulated", SIMULATED, 170)] {
        head.draw(&PathElement::new(
            vec![(x, 38), (x + 24, 38)],
            colour.stroke_width(2),
        ))?;
        head.draw_text(
            label,
            &("sans-serif", 13).into_font().color(&BLACK),
            (x + 30, 30),
        )?;
    }
    let rms = comparison.rms();
    let panels = body.split_evenly((Channel::ALL.len(), 1));
    for (channel, panel) in Channel::ALL.into_iter().zip(&panels) {
        draw_channel(panel, channel, rms.get(channel), comparison.series())?;
    }
    root.present()?;
    Ok(())
}

fn draw_channel(
    panel: &DrawingArea<SVGBackend<'_>, Shift>,
    channel: Channel,
    rms: f64,
    series: &[Pair],
) -> DrawResult {
    let curves: [Curve; 2] = [
        (
            series
                .iter()
                .map(|p| (p.time, channel.value(&p.measured)))
                .collect(),
            MEASURED,
            3,
        ),
        (
            series
                .iter()
                .map(|p| (p.time, channel.value(&p.simulated)))
                .collect(),
            SIMULATED,
            1,
        ),
    ];
    let (start, end) = match (series.first(), series.last()) {
        (Some(first), Some(last)) if last.time > first.time => (first.time, last.time),
        _ => (0.0, 1.0),
    };
    let values = || {
        curves
            .iter()
            .flat_map(|(points, ..)| points.iter().map(|p| p.1))
    };
    let low = values().fold(f64::INFINITY, f64::min);
    let high = values().fold(f64::NEG_INFINITY, f64::max);
    let (low, high) = if low.is_finite() && high.is_finite() {
        (low, high)
    } else {
        (0.0, 1.0)
    };
    let margin = (0.06 * (high - low)).max(0.02);
    let (label, unit) = channel.label();
    let caption = format!("{label} ({unit}): RMS gap {rms:.3}");
    let mut chart = ChartBuilder::on(panel)
        .margin(4)
        .margin_right(16)
        .caption(caption, ("sans-serif", 13))
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
        .x_label_formatter(&|time| format!("{time:.0} s"))
        .draw()?;
    for (points, colour, width) in curves {
        for part in unwrapped_parts(channel, &points) {
            chart.draw_series(LineSeries::new(
                part.iter().copied(),
                colour.stroke_width(width),
            ))?;
        }
    }
    Ok(())
}

/// Parts of a curve between jumps of an angle from one end of its range to the other.
fn unwrapped_parts(channel: Channel, points: &[(f64, f64)]) -> Vec<&[(f64, f64)]> {
    let is_angle = matches!(channel, Channel::Roll | Channel::Pitch | Channel::Heading);
    let jumps = |pair: &[(f64, f64)]| match pair {
        [a, b] => is_angle && (b.1 - a.1).abs() > std::f64::consts::PI,
        _ => false,
    };
    let mut parts = Vec::new();
    let mut begin = 0;
    for (index, pair) in points.windows(2).enumerate() {
        if jumps(pair) {
            parts.extend(points.get(begin..=index));
            begin = index + 1;
        }
    }
    parts.extend(points.get(begin..));
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_angle_is_cut_where_it_wraps() {
        let points = [(0.0, 3.0), (1.0, 3.1), (2.0, -3.1), (3.0, -3.0)];
        let parts = unwrapped_parts(Channel::Heading, &points);
        assert_eq!(parts, [&points[..2], &points[2..]]);
        assert_eq!(unwrapped_parts(Channel::YawRate, &points).len(), 1);
    }

    #[test]
    fn an_empty_comparison_still_draws() {
        let svg = comparison_svg("nothing", &Comparison::default()).unwrap();
        assert!(svg.starts_with("<svg") && svg.contains("vertical velocity (m/s)"));
    }
}
