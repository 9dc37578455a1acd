//! From the segments of a source to attitude and posture of the model.

use bodyflight_core::frame::{self, Inertial, Rotation};
use bodyflight_core::{Posture, Segment, SegmentArray};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

use super::axes::BodyAxes;
use super::mapping::{Kind, Mapping, Rest};
use crate::diagnostic::{Problem, Result};
use crate::formats::xsens;

/// Segments without which there is no posture; the others go along with their neighbours.
pub fn is_needed(segment: Segment) -> bool {
    !matches!(
        segment,
        Segment::Abdomen
            | Segment::Head
            | Segment::LeftHand
            | Segment::RightHand
            | Segment::LeftFoot
            | Segment::RightFoot
    )
}

/// A frame in the axes of the source.
#[derive(Debug, Clone, Copy)]
pub struct SourceFrame {
    /// Axes of the world from those of each mapped segment.
    pub world_from_segment: SegmentArray<Matrix3<f64>>,
    /// The middle of the hips (m), where the source says where anything is.
    pub position: Option<Vector3<f64>>,
}

/// How a mapped segment is turned: inertial axes from those of the model's segment are `world · R · rest`, where `R` takes
/// the axes of the source's segment to those of its world.
#[derive(Debug, Clone, PartialEq)]
pub struct Skeleton {
    world: Matrix3<f64>,
    /// Axes of the source's segment from those of the model's, `None` where it is not mapped.
    rest: SegmentArray<Option<Matrix3<f64>>>,
}

impl Skeleton {
    /// The segments of a mapping.
    ///
    /// # Errors
    /// Returns an error if a segment is missing without which there is no posture.
    pub fn new(mapping: &Mapping) -> Result<Self> {
        let missing: Vec<&str> = Segment::ALL
            .into_iter()
            .filter(|segment| is_needed(*segment) && !mapping.segments.contains_key(segment.name()))
            .map(Segment::name)
            .collect();
        if !missing.is_empty() {
            return Err(Problem::bad_input(format!(
                "the mapping lacks {}",
                missing.join(", ")
            ))
            .at("segments")
            .help("only abdomen, head, hands and feet may be left out: they go along with their neighbours"));
        }
        let posture = match mapping.body.rest {
            Some(Rest::HPose) => Posture::h_pose(),
            Some(Rest::TPose | Rest::Bones) | None => xsens::t_pose(),
        };
        let body_from_model = posture.body_from_segments();
        let rest = SegmentArray::from_fn(|segment| {
            let row = mapping.segments.get(segment.name())?;
            if mapping.kind == Kind::Points {
                // Axes made of points are the model's.
                return Some(Matrix3::identity());
            }
            let BodyAxes(body_from_source) = row.axes.or(mapping.body.axes)?;
            let model = body_from_model[segment].to_rotation_matrix();
            Some(body_from_source.transpose() * model.matrix())
        });
        Ok(Self {
            world: mapping.world.axes.0,
            rest,
        })
    }

    /// Whether a segment has a rotation of its own in the source.
    pub fn has(&self, segment: Segment) -> bool {
        self.rest[segment].is_some()
    }

    /// Takes the long axis of a segment in the rest posture to be along this way, in the axes of the source's segment.
    ///
    /// The shortest turn does it: what the segment does about its long axis stays.
    pub fn align(&mut self, segment: Segment, along: &Vector3<f64>) {
        if let Some(rest) = &mut self.rest[segment]
            && let Some(turn) = Rotation3::rotation_between(&(*rest * -Vector3::z()), along)
        {
            *rest = turn.matrix() * *rest;
        }
    }

    /// Angle (rad) between the long axis of a segment in the rest posture and this way, in the axes of the source's segment.
    pub fn angle_to(&self, segment: Segment, along: &Vector3<f64>) -> Option<f64> {
        Some((self.rest[segment]? * -Vector3::z()).angle(along))
    }

    /// Takes a segment to lie in the rest posture along another, turned about its long axis as it was.
    pub fn follow(&mut self, segment: Segment, other: Segment) {
        if let Some(along) = self.rest[other].map(|rest| rest * -Vector3::z()) {
            self.align(segment, &along);
        }
    }

    /// A way in the axes of the source's pelvis in those of the body, both in the rest posture.
    pub fn in_body(&self, way: &Vector3<f64>) -> Option<Vector3<f64>> {
        Some(self.rest[Segment::Pelvis]?.transpose() * way)
    }

    /// A way in the axes of the source's world, in inertial ones.
    pub fn to_inertial(&self, way: &Vector3<f64>) -> Vector3<f64> {
        self.world * way
    }

    /// Attitude and posture, from the axes of the source's world from those of each of its segments.
    ///
    /// What is not mapped goes along with its parent, the abdomen half-way between pelvis and thorax.
    pub fn posture(
        &self,
        world_from_segment: &SegmentArray<Matrix3<f64>>,
    ) -> (Rotation<f64, Inertial, frame::Body>, Posture<f64>) {
        let rotation = |matrix: Matrix3<f64>| {
            UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(matrix))
        };
        let mut inertial_from_segment = SegmentArray::from_fn(|segment| {
            let rest = self.rest[segment].unwrap_or_else(Matrix3::identity);
            rotation(self.world * world_from_segment[segment] * rest)
        });
        for segment in Segment::ALL {
            if self.has(segment) {
                continue;
            }
            inertial_from_segment[segment] = match (segment, segment.parent()) {
                (Segment::Abdomen, _) => {
                    let pelvis = inertial_from_segment[Segment::Pelvis];
                    let half = pelvis.rotation_to(&inertial_from_segment[Segment::Thorax]);
                    half.powf(0.5) * pelvis
                }
                (_, Some(parent)) => inertial_from_segment[parent],
                (_, None) => UnitQuaternion::identity(),
            };
        }
        let posture = Posture::from_body_rotations(&inertial_from_segment);
        let attitude = Rotation::from_quaternion(inertial_from_segment[Segment::Pelvis]);
        (attitude, posture)
    }
}
