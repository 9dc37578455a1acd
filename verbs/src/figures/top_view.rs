//! The path over ground seen from above, north up, with one scale for both axes.

use plotters::prelude::*;

use crate::output::plot::{Area, DrawResult, FINE, Line, drawn};
use crate::view::series::Series;
use bodyflight_io::diagnostic::Result;

const SIZE: u32 = 520;

/// Columns of a measured and of a simulated path.
const COLUMNS: [&str; 2] = ["measured_position_m", "simulated_position_m"];

/// Draws the paths of flights, each with the lines of its measured and of its simulated one.
pub(super) fn svg(title: &str, flights: &[([Line; 2], &Series)]) -> Result<String> {
    drawn((SIZE, SIZE), |root| draw(title, flights, root))
}

fn draw(title: &str, flights: &[([Line; 2], &Series)], root: &Area<'_>) -> DrawResult {
    root.fill(&WHITE)?;
    // East is to the right.
    let of_flight = |(lines, series): &([Line; 2], &Series)| {
        let (lines, series) = (*lines, *series);
        let ways = lines.into_iter().zip(COLUMNS).map(|(line, column)| {
            let way: Vec<(f64, f64)> = match series.column(column) {
                [north, west, _] => west.iter().zip(north).map(|(w, n)| (-w, *n)).collect(),
                _ => Vec::new(),
            };
            (line, way)
        });
        ways.collect::<Vec<_>>()
    };
    let ways: Vec<(Line, Vec<(f64, f64)>)> = flights.iter().flat_map(of_flight).collect();
    let all = || ways.iter().flat_map(|(_, way)| way);
    let range = |value: fn(&(f64, f64)) -> f64| {
        let low = all().map(value).fold(f64::INFINITY, f64::min);
        let high = all().map(value).fold(f64::NEG_INFINITY, f64::max);
        if low.is_finite() {
            (low, high)
        } else {
            (0.0, 1.0)
        }
    };
    let (east, north) = (range(|place| place.0), range(|place| place.1));
    let half = 0.55 * (east.1 - east.0).max(north.1 - north.0).max(1.0);
    let around = |(low, high): (f64, f64)| {
        let middle = 0.5 * (low + high);
        middle - half..middle + half
    };
    let mut chart = ChartBuilder::on(root)
        .caption(title, ("sans-serif", 16 * FINE))
        .margin(10 * FINE)
        .x_label_area_size(40 * FINE)
        .y_label_area_size(52 * FINE)
        .build_cartesian_2d(around(east), around(north))?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(BLACK.mix(0.12).stroke_width(FINE / 2))
        .axis_style(BLACK.stroke_width(FINE))
        .label_style(("sans-serif", 11 * FINE))
        .axis_desc_style(("sans-serif", 13 * FINE))
        .set_all_tick_mark_size(4 * FINE)
        .x_desc("east (m)")
        .y_desc("north (m)")
        .draw()?;
    for (line, way) in ways {
        let style = line.style();
        chart
            .draw_series(LineSeries::new(way, style))?
            .label(line.label)
            .legend(move |(x, y)| PathElement::new(vec![(x, y), (x + 180, y)], style));
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperLeft)
        .label_font(("sans-serif", 12 * FINE))
        .legend_area_size(24 * FINE)
        .margin(5 * FINE)
        .background_style(WHITE)
        .border_style(BLACK.mix(0.3))
        .draw()?;
    Ok(())
}
