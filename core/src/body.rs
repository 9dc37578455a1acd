//! The biomechanical model: 16 rigid segments connected by 15 joints, with the mass, inertia and silhouettes of each.
//!
//! A [`Body`] is a table of segment parameters. It is built from a person's measurements ([`anthropometry`]), with
//! equipment added ([`gear`]), or read from a file; any value can be overridden. The solids that segments are modelled
//! with, and their formulas, are in [`solid`].

pub mod anthropometry;
pub mod gear;
pub mod joint_angle;
pub mod mass_properties;
pub mod pattern;
pub mod posture;
pub mod solid;

use core::ops::{Index, IndexMut};

use nalgebra::{Matrix3, Vector3};

use crate::math::{Lanes, Real};

/// Number of segments of a body.
pub const SEGMENT_COUNT: usize = 16;

/// A rigid part of the body, ordered from the root outwards: a parent comes before its children.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[expect(missing_docs, reason = "the names are self-explanatory")]
pub enum Segment {
    Pelvis,
    Abdomen,
    Thorax,
    Head,
    LeftUpperArm,
    LeftForearm,
    LeftHand,
    RightUpperArm,
    RightForearm,
    RightHand,
    LeftThigh,
    LeftShank,
    LeftFoot,
    RightThigh,
    RightShank,
    RightFoot,
}

impl Segment {
    /// All segments, parents before their children.
    pub const ALL: [Self; SEGMENT_COUNT] = [
        Self::Pelvis,
        Self::Abdomen,
        Self::Thorax,
        Self::Head,
        Self::LeftUpperArm,
        Self::LeftForearm,
        Self::LeftHand,
        Self::RightUpperArm,
        Self::RightForearm,
        Self::RightHand,
        Self::LeftThigh,
        Self::LeftShank,
        Self::LeftFoot,
        Self::RightThigh,
        Self::RightShank,
        Self::RightFoot,
    ];

    /// Returns the segment on the other side of the proximal joint, or `None` for the pelvis.
    pub const fn parent(self) -> Option<Self> {
        Some(match self {
            Self::Pelvis => return None,
            Self::Abdomen | Self::LeftThigh | Self::RightThigh => Self::Pelvis,
            Self::Thorax => Self::Abdomen,
            Self::Head | Self::LeftUpperArm | Self::RightUpperArm => Self::Thorax,
            Self::LeftForearm => Self::LeftUpperArm,
            Self::LeftHand => Self::LeftForearm,
            Self::RightForearm => Self::RightUpperArm,
            Self::RightHand => Self::RightForearm,
            Self::LeftShank => Self::LeftThigh,
            Self::LeftFoot => Self::LeftShank,
            Self::RightShank => Self::RightThigh,
            Self::RightFoot => Self::RightShank,
        })
    }

    /// Returns the same segment on the other side of the body; trunk and head segments return themselves.
    pub const fn mirrored(self) -> Self {
        match self {
            Self::LeftUpperArm => Self::RightUpperArm,
            Self::LeftForearm => Self::RightForearm,
            Self::LeftHand => Self::RightHand,
            Self::RightUpperArm => Self::LeftUpperArm,
            Self::RightForearm => Self::LeftForearm,
            Self::RightHand => Self::LeftHand,
            Self::LeftThigh => Self::RightThigh,
            Self::LeftShank => Self::RightShank,
            Self::LeftFoot => Self::RightFoot,
            Self::RightThigh => Self::LeftThigh,
            Self::RightShank => Self::LeftShank,
            Self::RightFoot => Self::LeftFoot,
            centre => centre,
        }
    }

    /// Name used in segment tables and files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Pelvis => "pelvis",
            Self::Abdomen => "abdomen",
            Self::Thorax => "thorax",
            Self::Head => "head",
            Self::LeftUpperArm => "l_upperarm",
            Self::LeftForearm => "l_forearm",
            Self::LeftHand => "l_hand",
            Self::RightUpperArm => "r_upperarm",
            Self::RightForearm => "r_forearm",
            Self::RightHand => "r_hand",
            Self::LeftThigh => "l_thigh",
            Self::LeftShank => "l_shank",
            Self::LeftFoot => "l_foot",
            Self::RightThigh => "r_thigh",
            Self::RightShank => "r_shank",
            Self::RightFoot => "r_foot",
        }
    }

    /// Returns the segment with this [name](Segment::name), or `None` if there is none.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|segment| segment.name() == name)
    }
}

/// An array with one value per segment.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Deserialize, serde::Serialize))]
pub struct SegmentArray<V>([V; SEGMENT_COUNT]);

impl<V> SegmentArray<V> {
    /// Creates an array from values in the order of [`Segment::ALL`].
    pub const fn new(values: [V; SEGMENT_COUNT]) -> Self {
        Self(values)
    }

    /// Creates an array by calling `value` for each segment.
    pub fn from_fn(value: impl FnMut(Segment) -> V) -> Self {
        Self(Segment::ALL.map(value))
    }

    /// Iterates over segments and their values, parents first.
    pub fn iter(&self) -> impl Iterator<Item = (Segment, &V)> {
        Segment::ALL.into_iter().zip(self.0.iter())
    }

    /// Iterates over segments and mutable references to their values, parents first.
    pub fn iter_mut(&mut self) -> impl Iterator<Item = (Segment, &mut V)> {
        Segment::ALL.into_iter().zip(self.0.iter_mut())
    }

    /// Iterates over the values, parents first.
    pub fn values(&self) -> core::slice::Iter<'_, V> {
        self.0.iter()
    }

    /// Iterates over mutable references to the values, parents first.
    pub fn values_mut(&mut self) -> core::slice::IterMut<'_, V> {
        self.0.iter_mut()
    }

    /// Applies a function of segment and value to each element.
    pub fn map<W>(&self, mut value: impl FnMut(Segment, &V) -> W) -> SegmentArray<W> {
        SegmentArray::from_fn(|segment| value(segment, &self[segment]))
    }
}

// Every discriminant of the enum is below SEGMENT_COUNT, so no index is out of bounds.
impl<V> Index<Segment> for SegmentArray<V> {
    type Output = V;
    #[inline]
    fn index(&self, segment: Segment) -> &V {
        &self.0[segment as usize]
    }
}

impl<V> IndexMut<Segment> for SegmentArray<V> {
    #[inline]
    fn index_mut(&mut self, segment: Segment) -> &mut V {
        &mut self.0[segment as usize]
    }
}

/// Parameters of one segment in its own frame (origin at the proximal joint, axes parallel to the body's in the
/// H-pose).
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Deserialize, serde::Serialize))]
pub struct SegmentParameters<T: Lanes> {
    /// Mass (kg).
    pub mass: T,
    /// Length along Z (m).
    pub length: T,
    /// Position of the proximal joint in the parent's frame (m).
    pub joint_offset: Vector3<T>,
    /// Position of the centre of gravity (m).
    pub cg: Vector3<T>,
    /// Inertia about the centre of gravity (kg m2).
    pub inertia: Matrix3<T>,
    /// Silhouette areas normal to X, Y and Z: [A_yz, A_xz, A_xy] (m2).
    pub area: Vector3<T>,
    /// Characteristic length l_i of the aerodynamic moment (m), paper eq. (limbm). The reference tables use the
    /// segment's length; its width gives moments closer to measured ones.
    pub moment_arm: T,
}

/// A person with all equipment: the segment table and the stature.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Deserialize, serde::Serialize))]
pub struct Body<T: Lanes> {
    /// Parameters of the segments.
    pub segments: SegmentArray<SegmentParameters<T>>,
    /// Stature H (m), which scales the damping moment and the lever arms of muscle input.
    pub height: T,
}

impl<T: Lanes> Body<T> {
    /// Total mass of body and equipment (kg).
    pub fn mass(&self) -> T {
        self.segments
            .values()
            .fold(T::zero(), |sum, segment| sum + segment.mass)
    }

    /// Multiplies masses and inertias of all segments by a factor; shape and areas stay.
    pub fn scale_mass(&mut self, factor: T) {
        for segment in self.segments.values_mut() {
            segment.mass *= factor;
            segment.inertia *= factor;
        }
    }

    /// Converts the body to another precision.
    pub fn cast<U: Lanes>(&self) -> Body<U>
    where
        T: Real,
    {
        let scalar = |value: T| U::of(value.to_f64());
        Body {
            segments: self.segments.map(|_, segment| SegmentParameters {
                mass: scalar(segment.mass),
                length: scalar(segment.length),
                joint_offset: segment.joint_offset.map(scalar),
                cg: segment.cg.map(scalar),
                inertia: segment.inertia.map(scalar),
                area: segment.area.map(scalar),
                moment_arm: scalar(segment.moment_arm),
            }),
            height: scalar(self.height),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parents_come_first_and_mirroring_twice_changes_nothing() {
        for segment in Segment::ALL {
            if let Some(parent) = segment.parent() {
                assert!(parent < segment, "{segment:?}");
            }
            assert_eq!(segment.mirrored().mirrored(), segment);
            assert_eq!(Segment::from_name(segment.name()), Some(segment));
        }
        assert_eq!(Segment::from_name("tail"), None);
    }
}
