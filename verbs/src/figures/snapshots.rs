//! The body at regular times, seen from the side: the measured body over the simulated one.
//!
//! Near segments hide the lines of far ones, within each body.

use std::fmt::Write as _;

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use crate::output::bodies::{Ellipsoid, SOUTH, seen};
use crate::output::figure::escaped;
use crate::view::series::Series;
use crate::view::shape::Shape;

/// Side of the square of one body (px), and its width (m).
const SQUARE: f64 = 190.0;
const METRES: f64 = 2.4;

const HEAD: f64 = 34.0;

pub(super) fn svg(title: &str, shapes: &[Shape], series: &Series, count: usize) -> String {
    let rows = series.rows();
    let places: Vec<usize> = match (rows, count) {
        (0, _) | (_, 0) => Vec::new(),
        (_, 1) => vec![0],
        _ => (0..count).map(|k| k * (rows - 1) / (count - 1)).collect(),
    };
    let width = SQUARE * places.len().max(1) as f64;
    let height = HEAD + SQUARE + 24.0;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" font-family=\"sans-serif\" font-size=\"12\">\n<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n<text x=\"8\" y=\"20\" font-size=\"15\">{}</text>\n",
        escaped(title)
    );
    for (k, row) in places.into_iter().enumerate() {
        let centre = [SQUARE * (k as f64 + 0.5), HEAD + SQUARE * 0.5];
        for (attitude, opacity, style) in [
            (
                "simulated_attitude",
                1.0,
                "fill=\"#e2b58c\" stroke=\"#7a3b12\" stroke-width=\"0.6\"",
            ),
            (
                "measured_attitude",
                0.55,
                "fill=\"#ffffff\" stroke=\"#2b78c5\" stroke-width=\"0.8\"",
            ),
        ] {
            let turn = quaternion(series.column(attitude), row, 0);
            // Each body is one layer, so that it hides its own lines and not those of the other.
            let _ = writeln!(svg, "<g opacity=\"{opacity}\">");
            for ellipse in seen(&SOUTH, &ellipsoids(shapes, series, row, &turn)) {
                ellipse.write(&mut svg, centre, SQUARE / METRES, style);
            }
            svg.push_str("</g>\n");
        }
        let time = series
            .column("time_s")
            .first()
            .and_then(|times| times.get(row))
            .copied()
            .unwrap_or(0.0);
        let _ = writeln!(
            svg,
            "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{time:.1} s</text>",
            centre[0],
            height - 8.0
        );
    }
    let (length, low) = (SQUARE / METRES, HEAD + SQUARE);
    let _ = writeln!(
        svg,
        "<path d=\"M8 {low:.1}h{length:.2}\" stroke=\"#000000\" stroke-width=\"2\"/><text x=\"8\" y=\"{:.1}\" font-size=\"10\">1 m, {}</text>",
        low - 4.0,
        SOUTH.name
    );
    svg.push_str("</svg>\n");
    svg
}

fn quaternion(column: &[Vec<f64>], row: usize, from: usize) -> UnitQuaternion<f64> {
    let at = |k: usize| {
        let numbers = column.get(from + k);
        numbers.and_then(|n| n.get(row)).copied().unwrap_or(0.0)
    };
    let turn = Quaternion::new(at(0), at(1), at(2), at(3));
    UnitQuaternion::try_new(turn, 1e-3).unwrap_or_default()
}

/// The segments at a row, in inertial axes around the pelvis.
fn ellipsoids(
    shapes: &[Shape],
    series: &Series,
    row: usize,
    inertial_from_body: &UnitQuaternion<f64>,
) -> Vec<Ellipsoid> {
    let places = series.column("segment_cg_m");
    let turns = series.column("segment_attitude");
    let at = |k: usize| {
        let numbers = places.get(k);
        numbers.and_then(|n| n.get(row)).copied().unwrap_or(0.0)
    };
    let segment = |(k, shape): (usize, &Shape)| {
        let turn = inertial_from_body * quaternion(turns, row, 4 * k);
        Ellipsoid {
            centre: inertial_from_body * Vector3::new(at(3 * k), at(3 * k + 1), at(3 * k + 2)),
            axes: turn.to_rotation_matrix().into_inner(),
            half: Vector3::from(shape.half_extents_m),
        }
    };
    shapes.iter().enumerate().map(segment).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn standing() -> (Vec<Shape>, Series) {
        let shapes = vec![Shape {
            name: "rod",
            half_extents_m: [0.1, 0.2, 0.5],
            cg_m: [0.0; 3],
            person_half_extents_m: [0.1, 0.2, 0.5],
            person_middle_m: [0.0; 3],
            rest_joint_m: [0.0; 3],
            rest_attitude: [1.0, 0.0, 0.0, 0.0],
        }];
        let mut series = Series::new(&[
            ("time_s", 1, 1e-4),
            ("segment_cg_m", 3, 1e-3),
            ("segment_attitude", 4, 1e-4),
        ]);
        series.push([0.5, 0.0, 0.0, 0.3, 1.0, 0.0, 0.0, 0.0]);
        (shapes, series)
    }

    #[test]
    fn a_standing_rod_is_drawn_with_its_length_and_width() {
        let (shapes, series) = standing();
        let rods = ellipsoids(&shapes, &series, 0, &UnitQuaternion::identity());
        let ellipse = seen(&SOUTH, &rods)[0];
        let mut half = ellipse.half;
        half.sort_by(f64::total_cmp);
        assert!((half[0] - 0.2).abs() < 1e-9 && (half[1] - 0.5).abs() < 1e-9);
        assert!((ellipse.place[1] - 0.3).abs() < 1e-3);
    }

    #[test]
    fn titles_stay_text() {
        let (shapes, series) = standing();
        let svg = svg("<a> & b", &shapes, &series, 3);
        assert!(svg.contains("&lt;a> &amp; b"));
        assert_eq!(svg.matches("<ellipse").count(), 6);
        assert!(svg.contains("from the south, east to the right"));
    }
}
