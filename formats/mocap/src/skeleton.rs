//! From the segments of a source to the attitude and posture of the model.

use bodyflight_core::frame::{self, Inertial, Rotation};
use bodyflight_core::{Posture, Segment, SegmentArray};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

use crate::axes::BodyAxes;
use crate::mapping::{Kind, Mapping, Rest};
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_mvnx::xsens;

/// Whether a posture requires the segment; the others can move rigidly with their neighbours.
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
    /// Rotation from the axes of each mapped segment to those of the world.
    pub world_from_segment: SegmentArray<Matrix3<f64>>,
    /// The midpoint of the hips (m), if the source has positions.
    pub position: Option<Vector3<f64>>,
}

impl SourceFrame {
    /// What a number of the file that is too large made of a rotation or the position, which are then not finite.
    pub(crate) fn too_large(&self) -> Option<String> {
        let mut segments = self.world_from_segment.iter();
        let turned = segments.find(|(_, turned)| !turned.iter().all(|value| value.is_finite()));
        let is_far = |at: Vector3<f64>| !at.iter().all(|value| value.is_finite());
        match turned {
            Some((segment, _)) => Some(format!("an angle of {}", segment.name())),
            None => self
                .position
                .is_some_and(is_far)
                .then(|| "a position".to_owned()),
        }
    }
}

/// Converts the rotations of mapped segments. The rotation from the axes of a model segment to inertial axes is
/// `world · R · rest`, where `R` is the rotation from the axes of the source's segment to those of its world.
#[derive(Debug, Clone, PartialEq)]
pub struct Skeleton {
    world: Matrix3<f64>,
    /// Rotation from model segment axes to source segment axes, `None` if the segment is not mapped.
    rest: SegmentArray<Option<Matrix3<f64>>>,
}

impl Skeleton {
    /// Creates the skeleton of a mapping.
    ///
    /// # Errors
    /// Returns an error if a required segment is missing.
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
            .help("only abdomen, head, hands and feet may be left out: they then move rigidly with their neighbours"));
        }
        let posture = match mapping.body.rest {
            Some(Rest::HPose) => Posture::h_pose(),
            Some(Rest::TPose | Rest::Bones) | None => xsens::t_pose(),
        };
        let body_from_model = posture.body_from_segments();
        let rest = SegmentArray::from_fn(|segment| {
            let row = mapping.segments.get(segment.name())?;
            if mapping.kind == Kind::Points {
                // Axes computed from points are already those of the model.
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

    /// Whether the source has a rotation for the segment.
    pub fn has(&self, segment: Segment) -> bool {
        self.rest[segment].is_some()
    }

    /// Aligns the long axis of a segment in the rest posture with a direction, in the axes of the source's segment.
    ///
    /// This takes the shortest rotation, so the rotation about the long axis is kept.
    pub fn align(&mut self, segment: Segment, along: &Vector3<f64>) {
        if let Some(rest) = &mut self.rest[segment]
            && let Some(turn) = Rotation3::rotation_between(&(*rest * -Vector3::z()), along)
        {
            *rest = turn.matrix() * *rest;
        }
    }

    /// Angle (rad) between the long axis of a segment in the rest posture and a direction, in the axes of the source's
    /// segment.
    pub fn angle_to(&self, segment: Segment, along: &Vector3<f64>) -> Option<f64> {
        Some((self.rest[segment]? * -Vector3::z()).angle(along))
    }

    /// Aligns a segment with another in the rest posture; its rotation about the long axis is kept.
    pub fn follow(&mut self, segment: Segment, other: Segment) {
        if let Some(along) = self.rest[other].map(|rest| rest * -Vector3::z()) {
            self.align(segment, &along);
        }
    }

    /// Converts a direction from the axes of the source's pelvis to body axes, both in the rest posture.
    pub fn in_body(&self, way: &Vector3<f64>) -> Option<Vector3<f64>> {
        Some(self.rest[Segment::Pelvis]?.transpose() * way)
    }

    /// Converts a direction from the axes of the source's world to inertial axes.
    pub fn to_inertial(&self, way: &Vector3<f64>) -> Vector3<f64> {
        self.world * way
    }

    /// Attitude and posture, given the rotation from each source segment to the source's world.
    ///
    /// Segments that are not mapped move rigidly with their parent; an abdomen takes the rotation half-way between
    /// pelvis and thorax.
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
