//! Messages in Foxglove's schemas, as far as a body needs them. Field numbers are those of `schemas`.

use std::time::Duration;

use crate::protobuf::Message;

/// A message that knows its encoding.
pub trait Encode {
    /// Writes its fields.
    fn encode(&self, out: &mut Message);
}

/// A vector (x, y, z).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Vector3(pub [f64; 3]);

impl Encode for Vector3 {
    fn encode(&self, out: &mut Message) {
        for (field, number) in (1..).zip(self.0) {
            out.double(field, number);
        }
    }
}

/// A rotation, as w, x, y, z.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quaternion(pub [f64; 4]);

impl Quaternion {
    /// No rotation.
    pub const IDENTITY: Self = Self([1.0, 0.0, 0.0, 0.0]);
}

impl Encode for Quaternion {
    fn encode(&self, out: &mut Message) {
        let [w, x, y, z] = self.0;
        for (field, number) in (1..).zip([x, y, z, w]) {
            out.double(field, number);
        }
    }
}

/// A position and an orientation.
#[derive(Debug, Clone, Copy, PartialEq)]
#[expect(missing_docs, reason = "the names are self-explanatory")]
pub struct Pose {
    pub position: Vector3,
    pub orientation: Quaternion,
}

impl Encode for Pose {
    fn encode(&self, out: &mut Message) {
        out.message(1, |out| self.position.encode(out));
        out.message(2, |out| self.orientation.encode(out));
    }
}

/// A time: since 1970 if the file knows it, and else since frame 0.
impl Encode for Duration {
    fn encode(&self, out: &mut Message) {
        out.whole(1, self.as_secs());
        out.whole(2, u64::from(self.subsec_nanos()));
    }
}

/// `foxglove.FrameTransform`.
#[derive(Debug, Clone, PartialEq)]
#[expect(missing_docs, reason = "documented in the schema")]
pub struct FrameTransform<'a> {
    pub timestamp: Duration,
    pub parent_frame_id: &'a str,
    pub child_frame_id: &'a str,
    pub pose: Pose,
}

/// `foxglove.FrameTransforms`.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameTransforms<'a>(pub Vec<FrameTransform<'a>>);

impl Encode for FrameTransforms<'_> {
    fn encode(&self, out: &mut Message) {
        for transform in &self.0 {
            out.message(1, |out| {
                out.message(1, |out| transform.timestamp.encode(out));
                out.text(2, transform.parent_frame_id);
                out.text(3, transform.child_frame_id);
                out.message(4, |out| transform.pose.position.encode(out));
                out.message(5, |out| transform.pose.orientation.encode(out));
            });
        }
    }
}

/// `foxglove.PoseInFrame`.
#[derive(Debug, Clone, PartialEq)]
#[expect(missing_docs, reason = "documented in the schema")]
pub struct PoseInFrame<'a> {
    pub timestamp: Duration,
    pub frame_id: &'a str,
    pub pose: Pose,
}

impl Encode for PoseInFrame<'_> {
    fn encode(&self, out: &mut Message) {
        out.message(1, |out| self.timestamp.encode(out));
        out.text(2, self.frame_id);
        out.message(3, |out| self.pose.encode(out));
    }
}

/// `foxglove.Color`: red, green, blue, opacity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Color(pub [f64; 4]);

impl Encode for Color {
    fn encode(&self, out: &mut Message) {
        for (field, number) in (1..).zip(self.0) {
            out.double(field, number);
        }
    }
}

/// `foxglove.SpherePrimitive`.
#[derive(Debug, Clone, PartialEq)]
#[expect(missing_docs, reason = "documented in the schema")]
pub struct Sphere {
    pub pose: Pose,
    pub size: Vector3,
    pub color: Color,
}

impl Encode for Sphere {
    fn encode(&self, out: &mut Message) {
        out.message(1, |out| self.pose.encode(out));
        out.message(2, |out| self.size.encode(out));
        out.message(3, |out| self.color.encode(out));
    }
}

/// `foxglove.ArrowPrimitive`; it points along the x axis of its pose.
#[derive(Debug, Clone, PartialEq)]
#[expect(missing_docs, reason = "documented in the schema")]
pub struct Arrow {
    pub pose: Pose,
    pub shaft_length: f64,
    pub shaft_diameter: f64,
    pub head_length: f64,
    pub head_diameter: f64,
    pub color: Color,
}

impl Encode for Arrow {
    fn encode(&self, out: &mut Message) {
        out.message(1, |out| self.pose.encode(out));
        out.double(2, self.shaft_length);
        out.double(3, self.shaft_diameter);
        out.double(4, self.head_length);
        out.double(5, self.head_diameter);
        out.message(6, |out| self.color.encode(out));
    }
}

/// `foxglove.SceneEntity` with spheres and arrows. It moves with its frame and stays until it is replaced.
#[derive(Debug, Clone, PartialEq)]
#[expect(missing_docs, reason = "documented in the schema")]
pub struct SceneEntity {
    pub timestamp: Duration,
    pub frame_id: String,
    pub id: String,
    pub arrows: Vec<Arrow>,
    pub spheres: Vec<Sphere>,
}

/// `foxglove.SceneUpdate`.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneUpdate(pub Vec<SceneEntity>);

impl Encode for SceneUpdate {
    fn encode(&self, out: &mut Message) {
        for entity in &self.0 {
            out.message(2, |out| {
                out.message(1, |out| entity.timestamp.encode(out));
                out.text(2, &entity.frame_id);
                out.text(3, &entity.id);
                // A lifetime of zero means forever.
                out.message(4, |out| Duration::ZERO.encode(out));
                out.whole(5, 1);
                for arrow in &entity.arrows {
                    out.message(7, |out| arrow.encode(out));
                }
                for sphere in &entity.spheres {
                    out.message(9, |out| sphere.encode(out));
                }
            });
        }
    }
}
