//! Bodies drawn as the ellipsoids of their segments, near ones over far ones.
//!
//! The projection of an ellipsoid is an ellipse, so a body is sixteen ellipses. Filled and drawn from far to near, they
//! hide the lines that a body hides.

use core::fmt::Write as _;

use bodyflight_core::body::posture::pose;
use bodyflight_core::{Body, Posture, Segment};
use bodyflight_viewer::frame::half_extents;
use nalgebra::{Matrix2, Matrix3, Vector3};

/// A direction from which a body is seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    /// Name, as printed.
    pub name: &'static str,
    /// What points to the right and up in the picture; the axes are those of the ellipsoids.
    pub right: [f64; 3],
    /// See `right`.
    pub up: [f64; 3],
}

/// The back of a body, in body axes: left, dorsal, cranial.
pub const BACK: View = View {
    name: "from the back",
    right: [-1.0, 0.0, 0.0],
    up: [0.0, 0.0, 1.0],
};
/// The left side of a body in body axes, its back up.
pub const LEFT: View = View {
    name: "from the left",
    right: [0.0, 0.0, -1.0],
    up: [0.0, 1.0, 0.0],
};

/// The directions in which the body of a flight is seen, in inertial axes turned about the vertical so that the body
/// faces the first of them: ahead, left, up.
pub const FRONT: View = View {
    name: "front",
    right: [0.0, 1.0, 0.0],
    up: [0.0, 0.0, 1.0],
};
/// See [`FRONT`]: from the right of the body, so that it faces to the right.
pub const SIDE: View = View {
    name: "side",
    right: [1.0, 0.0, 0.0],
    up: [0.0, 0.0, 1.0],
};
/// See [`FRONT`]: from above.
pub const TOP: View = View {
    name: "top",
    right: [1.0, 0.0, 0.0],
    up: [0.0, 1.0, 0.0],
};

impl View {
    /// Rows are to the right, up and towards the viewer.
    fn axes(&self) -> Matrix3<f64> {
        let (right, up) = (Vector3::from(self.right), Vector3::from(self.up));
        Matrix3::from_rows(&[
            right.transpose(),
            up.transpose(),
            right.cross(&up).transpose(),
        ])
    }

    /// Where a point is drawn, to the right and up.
    pub fn place(&self, point: &Vector3<f64>) -> [f64; 2] {
        let seen = self.axes() * point;
        [seen.x, seen.y]
    }
}

/// A segment as an ellipsoid (m).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ellipsoid {
    /// Its middle.
    pub centre: Vector3<f64>,
    /// Its axes as columns.
    pub axes: Matrix3<f64>,
    /// Half its extents along them.
    pub half: Vector3<f64>,
}

/// The segments of a posed body, in body axes.
pub fn posed(body: &Body<f64>, posture: &Posture<f64>) -> Vec<Ellipsoid> {
    let posed = pose(body, posture);
    let of = |segment: Segment| Ellipsoid {
        centre: posed[segment].cg,
        axes: posed[segment].body_from_segment,
        half: half_extents(&body.segments[segment].area),
    };
    Segment::ALL.map(of).to_vec()
}

/// The projection of an ellipsoid: place, depth towards the viewer, half axes and rotation (rad).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ellipse {
    /// To the right and up (m).
    pub place: [f64; 2],
    /// Towards the viewer (m).
    pub depth: f64,
    /// Half axes (m).
    pub half: [f64; 2],
    /// Rotation of the first axis from the right, counter-clockwise (rad).
    pub turn: f64,
}

/// What is seen of ellipsoids, far ones first.
pub fn seen(view: &View, ellipsoids: &[Ellipsoid]) -> Vec<Ellipse> {
    let axes = view.axes();
    let project = |ellipsoid: &Ellipsoid| {
        let place = axes * ellipsoid.centre;
        let turned = axes * ellipsoid.axes;
        let squares = Matrix3::from_diagonal(&ellipsoid.half.map(|half| half * half));
        let spread = turned * squares * turned.transpose();
        let shadow: Matrix2<f64> = spread.fixed_view::<2, 2>(0, 0).into_owned();
        let eigen = shadow.symmetric_eigen();
        let first = eigen.eigenvectors.column(0);
        Ellipse {
            place: [place.x, place.y],
            depth: place.z,
            half: eigen.eigenvalues.map(|value| value.max(0.0).sqrt()).into(),
            turn: first.y.atan2(first.x),
        }
    };
    let mut all: Vec<Ellipse> = ellipsoids.iter().map(project).collect();
    all.sort_by(|a, b| a.depth.total_cmp(&b.depth));
    all
}

impl Ellipse {
    /// Draws it around a centre (px), with this many px to a metre.
    pub fn write(&self, svg: &mut String, centre: [f64; 2], scale: f64, style: &str) {
        // In SVG, y points down.
        let x = centre[0] + self.place[0] * scale;
        let y = centre[1] - self.place[1] * scale;
        let [a, b] = self.half.map(|half| half * scale);
        let turn = -self.turn.to_degrees();
        let _ = writeln!(
            svg,
            "<ellipse cx=\"{x:.2}\" cy=\"{y:.2}\" rx=\"{a:.2}\" ry=\"{b:.2}\" transform=\"rotate({turn:.2} {x:.2} {y:.2})\" {style}/>"
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bodyflight_core::body::pattern;
    use bodyflight_replay::subject::Subject;

    #[test]
    fn a_rod_is_drawn_with_its_length_and_width() {
        let rod = Ellipsoid {
            centre: Vector3::new(0.0, 0.0, 0.3),
            axes: Matrix3::identity(),
            half: Vector3::new(0.1, 0.2, 0.5),
        };
        let ellipse = seen(&BACK, &[rod])[0];
        let mut half = ellipse.half;
        half.sort_by(f64::total_cmp);
        assert!((half[0] - 0.1).abs() < 1e-9 && (half[1] - 0.5).abs() < 1e-9);
        assert!((ellipse.place[1] - 0.3).abs() < 1e-9);
    }

    #[test]
    fn the_left_is_on_the_left_of_a_back_and_nearer_from_the_left() {
        let body = posed(&Subject::default().body(), &pattern::neutral());
        let at = |segment: Segment| body[segment as usize].centre;
        let [left, right] = [Segment::LeftForearm, Segment::RightForearm].map(at);
        assert!(BACK.place(&left)[0] < BACK.place(&right)[0]);
        let from_left = seen(&LEFT, &body);
        let nearest = from_left.last().unwrap();
        assert!(
            (nearest.depth - left.x.max(body[Segment::LeftHand as usize].centre.x)).abs() < 1e-9
        );
    }
}
