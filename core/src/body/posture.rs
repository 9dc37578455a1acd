//! Posture: 15 joint rotations with 45 degrees of freedom, and the forward kinematics that pose the body.

use nalgebra::{Matrix3, Quaternion, SimdBool, UnitQuaternion, Vector3};

use super::{Body, Segment, SegmentArray, SegmentParameters};
use crate::math::{self, Lanes, Real};

/// Rotation of each segment relative to its parent; every rotation is the identity in the H-pose (standing, arms
/// down).
///
/// The pelvis is the root: its entry is always the identity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Posture<T: Lanes> {
    parent_from_segment: SegmentArray<UnitQuaternion<T>>,
}

impl<T: Lanes> Default for Posture<T> {
    fn default() -> Self {
        Self::h_pose()
    }
}

impl<T: Lanes> Posture<T> {
    /// Returns the H-pose: standing, arms down, all joints at zero.
    pub fn h_pose() -> Self {
        Self {
            parent_from_segment: SegmentArray::from_fn(|_| UnitQuaternion::identity()),
        }
    }

    /// Returns the rotation of `segment` relative to its parent.
    pub fn parent_from_segment(&self, segment: Segment) -> &UnitQuaternion<T> {
        &self.parent_from_segment[segment]
    }

    /// Sets the joint at the proximal end of `segment`. Has no effect for the pelvis, which has no proximal joint.
    pub fn set(&mut self, segment: Segment, parent_from_segment: UnitQuaternion<T>) {
        if segment != Segment::Pelvis {
            self.parent_from_segment[segment] = parent_from_segment;
        }
    }

    /// Returns the posture with one joint set, see [`Posture::set`].
    #[must_use]
    pub fn with(mut self, segment: Segment, parent_from_segment: UnitQuaternion<T>) -> Self {
        self.set(segment, parent_from_segment);
        self
    }

    /// Returns the posture with one joint set from the paper's angles, see [`joint_rotation`].
    #[must_use]
    pub fn with_angles(self, segment: Segment, psi: T, theta: T, phi: T) -> Self {
        self.with(segment, joint_rotation(psi, theta, phi))
    }

    /// Creates a posture from the rotation of each segment relative to the body frame; the pelvis is the reference.
    pub fn from_body_rotations(body_from_segment: &SegmentArray<UnitQuaternion<T>>) -> Self {
        Self {
            parent_from_segment: body_from_segment.map(|segment, rotation| {
                match segment.parent() {
                    Some(parent) => body_from_segment[parent].inverse() * rotation,
                    None => UnitQuaternion::identity(),
                }
            }),
        }
    }

    /// Returns the rotation of each segment relative to the body frame, paper eq. (chain), first line.
    pub fn body_from_segments(&self) -> SegmentArray<UnitQuaternion<T>> {
        let mut body_from_segment = self.parent_from_segment;
        for segment in Segment::ALL {
            if let Some(parent) = segment.parent() {
                body_from_segment[segment] =
                    body_from_segment[parent] * self.parent_from_segment[segment];
            }
        }
        body_from_segment
    }

    /// Interpolates from `self` (`share` 0) to `other` (`share` 1) by normalised linear interpolation, each joint
    /// along the shorter arc.
    #[must_use]
    pub fn interpolated(&self, other: &Self, share: T) -> Self {
        Self {
            parent_from_segment: self.parent_from_segment.map(|segment, from| {
                joint_between(from, &other.parent_from_segment[segment], share)
            }),
        }
    }

    /// Returns the mean rotation of each joint, all along the shorter arc from the first; the H-pose if there are none.
    pub fn mean<'a>(mut postures: impl Iterator<Item = &'a Self>) -> Self {
        let Some(first) = postures.next() else {
            return Self::h_pose();
        };
        let mut sums = first.parent_from_segment.map(|_, rotation| rotation.coords);
        for posture in postures {
            for (segment, reference) in first.parent_from_segment.iter() {
                sums[segment] += near(&posture.parent_from_segment[segment], reference).coords;
            }
        }
        Self {
            parent_from_segment: sums.map(|_, sum| math::normalized(Quaternion::from(*sum))),
        }
    }

    /// Returns the mirrored posture, with left and right exchanged.
    #[must_use]
    pub fn mirrored(&self) -> Self {
        Self {
            parent_from_segment: SegmentArray::from_fn(|segment| {
                let q = &self.parent_from_segment[segment.mirrored()];
                // Mirroring in the sagittal plane keeps rotations about X and reverses those about Y and Z.
                UnitQuaternion::new_unchecked(Quaternion::new(q.w, q.i, -q.j, -q.k))
            }),
        }
    }

    /// Returns whether every joint is a finite unit quaternion (norm within 1e-3 of 1).
    pub fn is_valid(&self) -> bool
    where
        T: Real,
    {
        self.parent_from_segment.values().all(|q| {
            let size = q.coords.norm_squared();
            size.is_finite() && (size - T::one()).abs() < T::of(2e-3)
        })
    }

    /// Converts the posture to another precision.
    pub fn cast<U: Lanes>(&self) -> Posture<U>
    where
        T: Real,
    {
        Posture {
            parent_from_segment: self.parent_from_segment.map(|_, q| {
                math::normalized(Quaternion::from(q.coords.map(|c| U::of(c.to_f64()))))
            }),
        }
    }
}

/// One joint of [`Posture::interpolated`].
#[inline]
pub fn joint_between<T: Lanes>(
    from: &UnitQuaternion<T>,
    to: &UnitQuaternion<T>,
    share: T,
) -> UnitQuaternion<T> {
    let to = near(to, from);
    math::normalized(Quaternion::from(
        from.coords * (T::one() - share) + to.coords * share,
    ))
}

/// Returns whichever of `rotation` and its negated quaternion, the same rotation, is nearer to `reference`.
pub fn near<T: Lanes>(
    rotation: &UnitQuaternion<T>,
    reference: &UnitQuaternion<T>,
) -> UnitQuaternion<T> {
    let cosine = rotation.coords.dot(&reference.coords);
    cosine
        .simd_lt(T::zero())
        .if_else(|| UnitQuaternion::new_unchecked(-**rotation), || *rotation)
}

/// Returns a joint rotation from the paper's angles about Z, Y, X (rad): v_parent = Rx(-phi) Ry(-theta) Rz(-psi)
/// v_child.
///
/// The paper's angles follow MATLAB's passive convention, see model.md "Frames and rotations".
pub fn joint_rotation<T: Lanes>(psi: T, theta: T, phi: T) -> UnitQuaternion<T> {
    let (zero, half) = (T::zero(), T::of(-0.5));
    let about = |angle: T| (angle * half).sine_cosine();
    // Most joints of a pattern turn about one axis; a turn by zero changes no bit of the product.
    let x = (phi != zero).then(|| about(phi));
    let y = (theta != zero).then(|| about(theta));
    let z = (psi != zero).then(|| about(psi));
    let turns = [
        x.map(|(sine, cosine)| Quaternion::new(cosine, sine, zero, zero)),
        y.map(|(sine, cosine)| Quaternion::new(cosine, zero, sine, zero)),
        z.map(|(sine, cosine)| Quaternion::new(cosine, zero, zero, sine)),
    ];
    let product = turns.into_iter().flatten().reduce(|turn, next| turn * next);
    product.map_or_else(UnitQuaternion::identity, UnitQuaternion::new_unchecked)
}

/// The paper's angles psi, theta, phi about Z, Y, X (rad) of a joint rotation, the inverse of [`joint_rotation`].
///
/// theta lies within a quarter turn either way. At the ends of that range psi and phi turn about the same axis, and psi
/// is returned as 0.
pub fn joint_angles<T: Real>(rotation: &UnitQuaternion<T>) -> [T; 3] {
    let turn = rotation_matrix(rotation);
    let (xx, xy) = (turn[(0, 0)], turn[(0, 1)]);
    let level = (xx * xx + xy * xy).root();
    let theta = -turn[(0, 2)].arctangent2(level);
    if level < T::of(1e-6) {
        return [T::zero(), theta, -turn[(2, 1)].arctangent2(turn[(1, 1)])];
    }
    let psi = xy.arctangent2(xx);
    let phi = turn[(1, 2)].arctangent2(turn[(2, 2)]);
    [psi, theta, phi]
}

/// Pose of one segment, in body axes with the origin at the pelvic joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PosedSegment<T: Lanes> {
    /// Axes of the segment as columns (x, y, z).
    pub body_from_segment: Matrix3<T>,
    /// Position of the proximal joint (m).
    pub joint: Vector3<T>,
    /// Position of the centre of gravity (m).
    pub cg: Vector3<T>,
}

impl<T: Lanes> PosedSegment<T> {
    /// Poses a segment that is turned against its parent, which is posed already.
    #[inline(always)]
    pub(crate) fn of(
        parameters: &SegmentParameters<T>,
        parent: Option<&Self>,
        parent_from_segment: &UnitQuaternion<T>,
    ) -> Self {
        let parent_from_segment = rotation_matrix(parent_from_segment);
        let (body_from_segment, joint) = match parent {
            Some(parent) => (
                parent.body_from_segment * parent_from_segment,
                parent.joint + parent.body_from_segment * parameters.joint_offset,
            ),
            None => (parent_from_segment, parameters.joint_offset),
        };
        let cg = joint + body_from_segment * parameters.cg;
        Self {
            body_from_segment,
            joint,
            cg,
        }
    }
}

/// Computes axes, joint and centre of gravity of every segment, paper eq. (chain).
pub fn pose<T: Lanes>(body: &Body<T>, posture: &Posture<T>) -> SegmentArray<PosedSegment<T>> {
    let mut posed = SegmentArray::from_fn(|_| PosedSegment {
        body_from_segment: Matrix3::identity(),
        joint: Vector3::zeros(),
        cg: Vector3::zeros(),
    });
    for segment in Segment::ALL {
        let parent = segment.parent().map(|parent| &posed[parent]);
        let turn = posture.parent_from_segment(segment);
        posed[segment] = PosedSegment::of(&body.segments[segment], parent, turn);
    }
    posed
}

/// Rotation matrix (direction cosines) of a unit quaternion.
fn rotation_matrix<T: Lanes>(rotation: &UnitQuaternion<T>) -> Matrix3<T> {
    let (two, one) = (T::of(2.0), T::one());
    let (w, x, y, z) = (rotation.w, rotation.i, rotation.j, rotation.k);
    let (x2, y2, z2) = (x * two, y * two, z * two);
    let (wx, wy, wz) = (w * x2, w * y2, w * z2);
    let (xx, xy, xz) = (x * x2, x * y2, x * z2);
    let (yy, yz, zz) = (y * y2, y * z2, z * z2);
    Matrix3::new(
        one - yy - zz,
        xy - wz,
        xz + wy,
        xy + wz,
        one - xx - zz,
        yz - wx,
        xz - wy,
        yz + wx,
        one - xx - yy,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_body::any_posture;
    use proptest::prelude::*;

    #[test]
    fn the_mean_of_postures_is_between_them_whatever_the_sign_of_a_quaternion() {
        let at = |angle: f64| {
            let turned = joint_rotation(0.0, angle, 0.0);
            let other = UnitQuaternion::new_unchecked(-*turned);
            Posture::h_pose().with(Segment::LeftShank, if angle > 0.4 { other } else { turned })
        };
        let mean = Posture::mean([at(0.2), at(0.4), at(0.6)].iter());
        let found = mean.parent_from_segment(Segment::LeftShank);
        assert!(found.angle_to(&joint_rotation(0.0, 0.4, 0.0)) < 1e-9);
        assert_eq!(Posture::<f64>::mean([].iter()), Posture::h_pose());
    }

    #[test]
    fn paper_angles_are_passive() {
        // model.md: v_parent = Rx(-phi) v_child, so a positive phi takes the cranial axis to dorsal.
        let arched = joint_rotation(0.0, 0.0, 0.3) * Vector3::z();
        assert!((arched - Vector3::new(0.0, libm::sin(0.3), libm::cos(0.3))).norm() < 1e-12);
    }

    #[test]
    fn angles_at_a_quarter_turn_are_those_of_the_same_rotation() {
        for (theta, sum) in [(1.0, 0.4), (-1.0, -2.0)] {
            let rotation = joint_rotation(0.0, theta * core::f64::consts::FRAC_PI_2, sum);
            let [psi, theta, phi] = joint_angles(&rotation);
            let again = joint_rotation(psi, theta, phi);
            assert!(rotation.rotation_to(&again).coords.xyz().norm() < 1e-7);
        }
    }

    proptest! {
        #[test]
        fn angles_give_the_rotation_back(posture in any_posture()) {
            for segment in Segment::ALL {
                let rotation = posture.parent_from_segment(segment);
                let [psi, theta, phi] = joint_angles(rotation);
                let again = joint_rotation(psi, theta, phi);
                prop_assert!(rotation.rotation_to(&again).coords.xyz().norm() < 1e-9);
            }
        }

        #[test]
        fn chains_and_joints_agree(posture in any_posture()) {
            let rebuilt = Posture::from_body_rotations(&posture.body_from_segments());
            for segment in Segment::ALL {
                let angle = rebuilt.parent_from_segment(segment)
                    .rotation_to(posture.parent_from_segment(segment)).coords.xyz().norm();
                prop_assert!(angle < 1e-12);
            }
        }

        #[test]
        fn interpolation_ends_at_its_ends(a in any_posture(), b in any_posture()) {
            for (share, end) in [(0.0, &a), (1.0, &b)] {
                let posture = a.interpolated(&b, share);
                for segment in Segment::ALL {
                    let between = posture.parent_from_segment(segment)
                        .rotation_to(end.parent_from_segment(segment)).coords.xyz().norm();
                    prop_assert!(between < 1e-12);
                }
            }
        }

        #[test]
        fn mirroring_twice_changes_nothing(posture in any_posture()) {
            prop_assert_eq!(posture.mirrored().mirrored(), posture);
            prop_assert!(posture.is_valid());
        }
    }
}
