//! The figures of a jump as tables.

use bodyflight_falls::fall::Jump;

use super::drawing::escaped;
use crate::fall::units::Units;
use crate::fall::{Moment, Report, WindRow};

/// Drag area in the steady part, or a dash.
pub(super) fn area(report: &Report) -> String {
    report
        .drag_area_m2
        .map_or("-".to_owned(), |area| format!("{area:.2} m2"))
}

/// The figures of a jump, one a line.
pub(super) fn table(report: &Report, jump: &Jump, units: Units) -> String {
    let ground = report.landing.map(|landing| landing.height_m);
    let moment = |moment: Option<Moment>| match moment {
        None => "not on the track".to_owned(),
        Some(moment) => {
            let above = ground.map(|ground| {
                format!(
                    ", {} above the landing",
                    units.length(moment.height_m - ground)
                )
            });
            format!(
                "{}{} ({:.1} &plusmn; {:.1} s)",
                units.length(moment.height_m),
                above.unwrap_or_default(),
                moment.time_s,
                moment.deviation_s
            )
        }
    };
    let glide =
        |glide: Option<f64>| glide.map_or("unknown".to_owned(), |glide| format!("{glide:.2}"));
    let mut rows = vec![
        ("exit", moment(report.exit)),
        ("opening", moment(report.opening)),
        ("time of fall", format!("{:.1} s", report.fall_s)),
        ("mean fall rate", units.speed(report.mean_rate_mps)),
        ("fastest", units.speed(report.fastest_mps)),
        (
            "normalised fall rate",
            format!(
                "{} at {} of the standard atmosphere",
                units.speed(report.normalised_rate_mps),
                units.length(report.reference_height_m)
            ),
        ),
        (
            "drag area",
            report.steady_drag().map_or(
                "unknown: no second of the fall can be used, or nothing slows it".to_owned(),
                |[area, spread, ballistic]| {
                    format!(
                        "{area:.2} m2 &plusmn; {spread:.2} at {:.0} kg; {ballistic:.0} kg/m2",
                        report.mass_kg
                    )
                },
            ),
        ),
        ("glide in the fall", glide(report.glide)),
        ("distance in the fall", units.length(report.fall_distance_m)),
    ];
    rows.extend(further(report, units));
    let count = jump.taken_out.count + report.rows_skipped;
    if count > 0 {
        rows.push(("rows not used", count.to_string()));
    }
    let rows: Vec<String> = (rows.iter())
        .map(|(name, value)| format!("<tr><th>{}</th><td>{value}</td></tr>", escaped(name)))
        .collect();
    format!("<table>{}</table>\n", rows.concat())
}

/// Figures that not every jump has.
fn further(report: &Report, units: Units) -> Vec<(&'static str, String)> {
    let glide = report
        .canopy_glide
        .map_or("unknown".to_owned(), |glide| format!("{glide:.2}"));
    let mut rows = Vec::new();
    if let Some(opening) = &report.opening_details {
        let sensed = report
            .sensors
            .largest_g
            .map(|g| format!(", {g:.1} g by the accelerometer"));
        rows.push((
            "the opening took",
            format!(
                "{:.1} s and {}, {:.1} g by the receiver{}",
                opening.duration_s,
                units.length(opening.lost_m),
                opening.largest_g,
                sensed.unwrap_or_default()
            ),
        ));
    }
    if let (Some(time), Some(way)) = (report.canopy_s, report.canopy_distance_m) {
        rows.push((
            "under canopy",
            format!(
                "{time:.0} s, {}, glide over ground {}",
                units.length(way),
                glide
            ),
        ));
    }
    if let (Some(force), Some(area)) = (report.sensors.fall_g, report.sensors.drag_area_m2) {
        rows.push((
            "accelerometer",
            format!("{force:.2} g in the steady fall, and from it a drag area of {area:.2} m2"),
        ));
    }
    if let Some(prediction) = &report.prediction {
        rows.push((
            "last third, predicted",
            format!(
                "{} &plusmn; {}, measured {}",
                units.speed(prediction.predicted_mps),
                units.speed(prediction.deviation_mps),
                units.speed(prediction.measured_mps)
            ),
        ));
    }
    rows
}

/// The winds that are determined.
pub(super) fn winds(report: &Report, units: Units) -> String {
    if report.wind.is_empty() && report.canopy_wind.is_empty() {
        return "<p class=\"note\">The wind is not determined by this jump.</p>\n".to_owned();
    }
    let mut table =
        "<table class=\"book\"><tr><th>wind at</th><th>from</th><th>speed</th><th>&plusmn;</th><th>by</th></tr>\n"
            .to_owned();
    let mut add = |row: &WindRow, by: &str| {
        table += &format!(
            "<tr><td>{}</td><td>{:.0}&deg;</td><td>{}</td><td>{}</td><td>{by}</td></tr>\n",
            units.length(row.height_m),
            row.from_rad.to_degrees(),
            units.speed(row.speed_mps),
            units.speed(row.deviation_mps)
        );
    };
    report.wind.iter().for_each(|row| add(row, "the fall"));
    report
        .canopy_wind
        .iter()
        .for_each(|row| add(row, "circles under canopy"));
    table + "</table>\n"
}
