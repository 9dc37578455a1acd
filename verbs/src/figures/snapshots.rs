//! The body at regular times, in one or more views: the measured body over the simulated one.
//!
//! Near segments hide the lines of far ones, within each body.

use std::fmt::Write as _;

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use crate::output::bodies::{Ellipsoid, View, seen};
use crate::output::figure::escaped;
use crate::view::series::Series;
use crate::view::shape::Shape;

/// Side of the square of one body (px), and its width (m).
const SQUARE: f64 = 190.0;
const METRES: f64 = 2.4;

const HEAD: f64 = 34.0;

/// Series and style of the two bodies.
const BODIES: [(&str, f64, &str); 2] = [
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
];

/// Draws `count` bodies in a row for each view. The views stay as they are at the first body, so that turns are seen.
pub(super) fn svg(
    title: &str,
    shapes: &[Shape],
    series: &Series,
    count: usize,
    views: &[View],
) -> String {
    let rows = series.rows();
    let places: Vec<usize> = match (rows, count) {
        (0, _) | (_, 0) => Vec::new(),
        (_, 1) => vec![0],
        _ => (0..count).map(|k| k * (rows - 1) / (count - 1)).collect(),
    };
    let facing = ahead_from_inertial(&quaternion(series.column("measured_attitude"), 0, 0));
    let width = SQUARE * places.len().max(1) as f64;
    let low = HEAD + SQUARE * views.len() as f64;
    let height = low + 24.0;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" font-family=\"sans-serif\" font-size=\"12\">\n<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n<text x=\"8\" y=\"20\" font-size=\"15\">{}</text>\n",
        escaped(title)
    );
    for (line, view) in views.iter().enumerate() {
        let top = HEAD + SQUARE * line as f64;
        for (k, row) in places.iter().enumerate() {
            let centre = [SQUARE * (k as f64 + 0.5), top + SQUARE * 0.5];
            for (attitude, opacity, style) in BODIES {
                let turn = facing * quaternion(series.column(attitude), *row, 0);
                // Each body is one layer, so that it hides its own lines and not those of the other.
                let _ = writeln!(svg, "<g opacity=\"{opacity}\">");
                for ellipse in seen(view, &ellipsoids(shapes, series, *row, &turn)) {
                    ellipse.write(&mut svg, centre, SQUARE / METRES, style);
                }
                svg.push_str("</g>\n");
            }
        }
        let _ = writeln!(
            svg,
            "<text x=\"8\" y=\"{:.1}\" font-size=\"11\">{}</text>",
            top + 12.0,
            view.name
        );
    }
    for (k, row) in places.iter().enumerate() {
        let times = series.column("time_s").first();
        let time = times.and_then(|times| times.get(*row)).copied();
        let _ = writeln!(
            svg,
            "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{:.1} s</text>",
            SQUARE * (k as f64 + 0.5),
            height - 8.0,
            time.unwrap_or(0.0)
        );
    }
    let _ = writeln!(
        svg,
        "<path d=\"M8 {low:.1}h{:.2}\" stroke=\"#000000\" stroke-width=\"2\"/><text x=\"8\" y=\"{:.1}\" font-size=\"10\">1 m</text>",
        SQUARE / METRES,
        low - 4.0
    );
    svg.push_str("</svg>\n");
    svg
}

/// The turn about the vertical to axes ahead, left, up of a body: ahead is where the head points or, if the body is
/// upright or head down, where the chest does.
fn ahead_from_inertial(inertial_from_body: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    let (head, chest) = (Vector3::z(), -Vector3::y());
    let level = |axis: Vector3<f64>| (inertial_from_body * axis).xy();
    let ahead = [head, chest]
        .map(level)
        .into_iter()
        .max_by(|a, b| a.norm().total_cmp(&b.norm()));
    let heading = ahead.map_or(0.0, |ahead| ahead.y.atan2(ahead.x));
    UnitQuaternion::from_axis_angle(&Vector3::z_axis(), -heading)
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
    use crate::output::bodies::{FRONT, SIDE, TOP};

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
        let ellipse = seen(&FRONT, &rods)[0];
        let mut half = ellipse.half;
        half.sort_by(f64::total_cmp);
        assert!((half[0] - 0.2).abs() < 1e-9 && (half[1] - 0.5).abs() < 1e-9);
        assert!((ellipse.place[1] - 0.3).abs() < 1e-3);
    }

    #[test]
    fn views_are_named_and_stay_as_the_body_faces_at_first() {
        // Belly to earth with the head to the west: the left is south, the back up.
        let west =
            nalgebra::Rotation3::from_basis_unchecked(&[-Vector3::x(), Vector3::z(), Vector3::y()]);
        let inertial_from_body = UnitQuaternion::from_rotation_matrix(&west);
        let facing = ahead_from_inertial(&inertial_from_body) * inertial_from_body;
        let [left, back, head] = [Vector3::x(), Vector3::y(), Vector3::z()].map(|v| facing * v);
        for (view, [left_at, back_at, head_at]) in [
            (FRONT, [[1.0, 0.0], [0.0, 1.0], [0.0, 0.0]]),
            (SIDE, [[0.0, 0.0], [0.0, 1.0], [1.0, 0.0]]),
            (TOP, [[0.0, 1.0], [0.0, 0.0], [1.0, 0.0]]),
        ] {
            for (axis, expected) in [(left, left_at), (back, back_at), (head, head_at)] {
                let place = view.place(&axis);
                let apart = (place[0] - expected[0]).hypot(place[1] - expected[1]);
                assert!(apart < 1e-12, "{}: {place:?}, {expected:?}", view.name);
            }
        }
    }

    #[test]
    fn titles_stay_text_and_each_view_has_its_row() {
        let (shapes, series) = standing();
        let svg = svg("<a> & b", &shapes, &series, 3, &[FRONT, TOP]);
        assert!(svg.contains("&lt;a> &amp; b"));
        assert_eq!(svg.matches("<ellipse").count(), 12);
        assert!(svg.contains(">front</text>") && svg.contains(">top</text>"));
        assert!(svg.contains("height=\"438\""));
    }
}
