//! How the solid of a segment is attached to its joint.

use nalgebra::{Matrix3, Vector3};

use crate::body::SegmentParameters;
use crate::body::solid::Solid;
use crate::math::Real;

/// Distance of the ankle joint from the heel, as a share of the length of the foot or shoe.
pub(in crate::body) const ANKLE_FROM_HEEL: f64 = 0.25;

/// The length `l_i` that scales the aerodynamic moment of a segment, paper eq. (limbm).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum MomentArm<T: Real> {
    /// Mean width of the segment. With Cm = 3.5, pitch stiffness and trim come close to measured ones.
    #[default]
    Width,
    /// Length of the segment. With Cm = 3.5, the body is three to four times as stiff in pitch.
    Length,
    /// A share of the segment's length, 0.001 to 10.
    FractionOfLength(T),
}

/// A solid and how it is attached to the proximal joint of its segment.
#[derive(Debug, Clone, Copy)]
pub(super) enum Form<T: Real> {
    /// The base is at the joint and the axis points cranially.
    Up(Solid<T>),
    /// The base is at the joint and the axis points caudally.
    Down(Solid<T>),
    /// The base is the heel, the axis points to the toes and the solid's Y points up; the ankle is on top.
    Foot(Solid<T>),
}

impl<T: Real> Form<T> {
    fn solid(&self) -> &Solid<T> {
        match self {
            Self::Up(solid) | Self::Down(solid) | Self::Foot(solid) => solid,
        }
    }

    /// Converts values about the axes of the solid to the axes of the segment.
    fn turned(&self, about: Vector3<T>) -> Vector3<T> {
        match self {
            Self::Up(_) | Self::Down(_) => about,
            Self::Foot(_) => Vector3::new(about.x, about.z, about.y),
        }
    }

    /// Centre of gravity in the segment frame (m).
    fn cg(&self) -> Vector3<T> {
        let zero = T::zero();
        match self {
            Self::Up(solid) => Vector3::new(zero, zero, solid.cg()),
            Self::Down(solid) => Vector3::new(zero, zero, -solid.cg()),
            Self::Foot(solid) => {
                let height = match *solid {
                    Solid::TruncatedEllipticCone { base: [_, b], .. } => b,
                    _ => zero,
                };
                let ankle = solid.length() * T::of(ANKLE_FROM_HEEL);
                Vector3::new(zero, ankle - solid.cg(), -height)
            }
        }
    }

    /// Inertia about the centre of gravity for a mass (kg m2).
    fn inertia(&self, mass: T) -> Matrix3<T> {
        Matrix3::from_diagonal(&(self.turned(self.solid().gyration()) * mass))
    }

    /// Silhouettes normal to the axes of the segment (m2).
    fn silhouette(&self) -> Vector3<T> {
        self.turned(self.solid().silhouette())
    }

    pub(super) fn parameters(
        &self,
        mass: T,
        joint_offset: Vector3<T>,
        moment_arm: MomentArm<T>,
    ) -> SegmentParameters<T> {
        let length = self.solid().length();
        SegmentParameters {
            mass,
            length,
            joint_offset,
            cg: self.cg(),
            inertia: self.inertia(mass),
            area: self.silhouette(),
            moment_arm: match moment_arm {
                MomentArm::Width => self.solid().mean_width(),
                MomentArm::Length => length,
                MomentArm::FractionOfLength(share) => length * share,
            },
        }
    }
}
