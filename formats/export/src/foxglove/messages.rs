//! Messages in Foxglove's schemas, as far as a body needs them.

use serde::{Serialize, Serializer};

/// Numbers are rounded to nine decimals: finer than any sensor, and the file is half as large.
const DECIMALS: f64 = 1e9;

fn rounded(number: f64) -> f64 {
    (number * DECIMALS).round() / DECIMALS
}

/// A number in JSON; `null` if it is missing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Number(pub f64);

impl Serialize for Number {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if self.0.is_finite() {
            serializer.serialize_f64(rounded(self.0))
        } else {
            serializer.serialize_none()
        }
    }
}

/// A time since frame 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Time {
    /// Whole seconds.
    pub sec: u64,
    /// The rest (ns).
    pub nsec: u64,
}

impl Time {
    /// Zero; as a lifetime, it means forever.
    pub const ZERO: Self = Self { sec: 0, nsec: 0 };

    /// Converts from seconds.
    pub fn of(seconds: f64) -> Self {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "saturates; flights begin at 0"
        )]
        let all = (seconds * 1e9).round() as u64;
        Self {
            sec: all / 1_000_000_000,
            nsec: all % 1_000_000_000,
        }
    }

    /// The total in nanoseconds.
    pub const fn nanoseconds(self) -> u64 {
        self.sec * 1_000_000_000 + self.nsec
    }
}

/// A vector.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[expect(missing_docs, reason = "the names are self-explanatory")]
pub struct Vector3 {
    pub x: Number,
    pub y: Number,
    pub z: Number,
}

impl From<[f64; 3]> for Vector3 {
    fn from([x, y, z]: [f64; 3]) -> Self {
        Self {
            x: Number(x),
            y: Number(y),
            z: Number(z),
        }
    }
}

/// A rotation.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[expect(missing_docs, reason = "the names are self-explanatory")]
pub struct Quaternion {
    pub x: Number,
    pub y: Number,
    pub z: Number,
    pub w: Number,
}

impl Quaternion {
    /// No rotation.
    pub const IDENTITY: Self = Self {
        x: Number(0.0),
        y: Number(0.0),
        z: Number(0.0),
        w: Number(1.0),
    };

    /// Converts from w, x, y, z.
    pub const fn from_wxyz([w, x, y, z]: [f64; 4]) -> Self {
        Self {
            x: Number(x),
            y: Number(y),
            z: Number(z),
            w: Number(w),
        }
    }
}

/// A position and an orientation.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[expect(missing_docs, reason = "the names are self-explanatory")]
pub struct Pose {
    pub position: Vector3,
    pub orientation: Quaternion,
}

/// `foxglove.FrameTransform`.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[expect(missing_docs, reason = "documented in the schema")]
pub struct FrameTransform<'a> {
    pub timestamp: Time,
    pub parent_frame_id: &'a str,
    pub child_frame_id: &'a str,
    pub translation: Vector3,
    pub rotation: Quaternion,
}

/// `foxglove.FrameTransforms`.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[expect(missing_docs, reason = "documented in the schema")]
pub struct FrameTransforms<'a> {
    pub transforms: Vec<FrameTransform<'a>>,
}

/// `foxglove.PoseInFrame`.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[expect(missing_docs, reason = "documented in the schema")]
pub struct PoseInFrame<'a> {
    pub timestamp: Time,
    pub frame_id: &'a str,
    pub pose: Pose,
}

/// `foxglove.Color`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[expect(missing_docs, reason = "documented in the schema")]
pub struct Color {
    pub r: f64,
    pub g: f64,
    pub b: f64,
    pub a: f64,
}

/// `foxglove.SpherePrimitive`.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[expect(missing_docs, reason = "documented in the schema")]
pub struct Sphere {
    pub pose: Pose,
    pub size: Vector3,
    pub color: Color,
}

/// `foxglove.ArrowPrimitive`; it points along the x axis of its pose.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[expect(missing_docs, reason = "documented in the schema")]
pub struct Arrow {
    pub pose: Pose,
    pub shaft_length: f64,
    pub shaft_diameter: f64,
    pub head_length: f64,
    pub head_diameter: f64,
    pub color: Color,
}

/// `foxglove.SceneEntity` with spheres and arrows.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[expect(missing_docs, reason = "documented in the schema")]
pub struct SceneEntity {
    pub timestamp: Time,
    pub frame_id: String,
    pub id: String,
    pub lifetime: Time,
    pub frame_locked: bool,
    pub metadata: [(); 0],
    pub arrows: Vec<Arrow>,
    pub cubes: [(); 0],
    pub spheres: Vec<Sphere>,
    pub cylinders: [(); 0],
    pub lines: [(); 0],
    pub triangles: [(); 0],
    pub texts: [(); 0],
    pub models: [(); 0],
}

impl SceneEntity {
    /// Creates an empty entity that moves with its frame and stays until it is replaced.
    pub fn new(timestamp: Time, frame_id: String, id: String) -> Self {
        Self {
            timestamp,
            frame_id,
            id,
            lifetime: Time::ZERO,
            frame_locked: true,
            metadata: [],
            arrows: Vec::new(),
            cubes: [],
            spheres: Vec::new(),
            cylinders: [],
            lines: [],
            triangles: [],
            texts: [],
            models: [],
        }
    }
}

/// `foxglove.SceneUpdate`.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[expect(missing_docs, reason = "documented in the schema")]
pub struct SceneUpdate {
    pub deletions: [(); 0],
    pub entities: Vec<SceneEntity>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_and_numbers_are_written_as_the_schemas_want_them() {
        let time = Time::of(3.004_166_667);
        assert_eq!((time.sec, time.nsec), (3, 4_166_667));
        assert_eq!(time.nanoseconds(), 3_004_166_667);
        let written = serde_json::to_string(&[Number(1.0 / 3.0), Number(f64::NAN)]).unwrap();
        assert_eq!(written, "[0.333333333,null]");
    }
}
