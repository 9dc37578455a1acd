//! A segment of a mapping: what the file has for it.

use serde::Deserialize;

use crate::axes::BodyAxes;

/// The kind of data that the source has for a segment.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// The joints of a BVH file.
    Bvh,
    /// Angles of its joint.
    Angles,
    /// A quaternion.
    Quaternions,
    /// Points at its ends.
    Points,
}

/// A point, or the midpoint of several.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[serde(
    untagged,
    expecting = "expected the name of a point or a list of names"
)]
pub enum Point {
    /// One point.
    One(String),
    /// The midpoint of these.
    Middle(Vec<String>),
}

impl Point {
    /// Names of the points whose midpoint it is.
    pub fn names(&self) -> &[String] {
        match self {
            Self::One(name) => core::slice::from_ref(name),
            Self::Middle(names) => names,
        }
    }
}

/// A segment, or a link between segments.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Row {
    /// Joint of a BVH file.
    pub joint: Option<String>,
    /// Its parent; if absent, the next mapped segment towards the pelvis.
    pub parent: Option<String>,
    /// Rotation axes of the angles in order, one letter each.
    pub rotations: Option<String>,
    /// Columns of angles or of a quaternion; a minus before a name reverses the sense.
    pub columns: Option<Vec<String>>,
    /// Rows of the matrix from its axes to those of the parent when all angles are zero.
    pub zero: Option<[[f64; 3]; 3]>,
    /// Directions of its own X, Y and Z in the rest posture, if they differ from those of the body.
    pub axes: Option<BodyAxes>,
    /// The point at its joint; for the trunk and the head, at the lower end.
    pub from: Option<Point>,
    /// The point at its far end.
    pub to: Option<Point>,
    /// Two points, the second further left.
    pub left: Option<[Point; 2]>,
}
