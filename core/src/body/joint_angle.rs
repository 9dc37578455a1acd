//! Named angles of the joints: the paper's angles, and the bend of a knee.
//!
//! A joint has the name of the segment at whose proximal end it is: `l_shank` is the left knee. Differences between two
//! postures are rotations about the axes of the joint's parent, as changes of a joint are: adding the difference to one
//! posture gives the other.

use core::fmt;

use super::Segment;
use super::pattern;
use super::posture::{Posture, joint_angles};
use crate::math::{Real, clamp};

/// An angle of a joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointAngle {
    /// The segment at whose proximal end the joint is.
    pub segment: Segment,
    /// Name of the angle: `psi`, `theta` or `phi` about Z, Y and X in the paper's sense, or `bend`.
    pub name: &'static str,
    /// The paper's angles psi, theta, phi for each radian of it.
    shares: [f64; 3],
}

/// The paper's angles, about Z, Y and X; every joint has them.
const ANGLES: [(&str, [f64; 3]); 3] = [
    ("psi", [1.0, 0.0, 0.0]),
    ("theta", [0.0, 1.0, 0.0]),
    ("phi", [0.0, 0.0, 1.0]),
];
/// The bend of a knee, 0 when straight, as in `trim`.
const BEND: (&str, [f64; 3]) = ("bend", [0.0, 0.0, -1.0]);
const KNEES: [Segment; 2] = [Segment::LeftShank, Segment::RightShank];

/// Time in which a joint reaches an angle that begins or ends within the flight (s).
pub const REACH: f64 = 0.2;

/// The share of a change that acts at a time (s), for a change within a window (s). The window is entered and left within
/// [`REACH`], with a rate that is zero at both ends.
pub fn share_within<T: Real>([begin, end]: [T; 2], time: T) -> T {
    let reached = |since: T| {
        let share = clamp(since / T::of(REACH), T::zero(), T::one());
        share * share * (T::of(3.0) - T::of(2.0) * share)
    };
    reached(time - begin) - reached(time - end)
}

impl JointAngle {
    /// The angles of the joint at the proximal end of a segment, `bend` first; none for the pelvis.
    pub fn of_joint(segment: Segment) -> impl Iterator<Item = Self> {
        let bend = KNEES.contains(&segment).then_some(BEND);
        let has_joint = segment != Segment::Pelvis;
        let all = bend.into_iter().chain(ANGLES);
        all.filter(move |_| has_joint)
            .map(move |(name, shares)| Self {
                segment,
                name,
                shares,
            })
    }

    /// Three angles of each joint that fix the posture: psi, theta and phi, for knees with the bend in place of phi.
    pub fn all() -> impl Iterator<Item = Self> {
        Segment::ALL.into_iter().flat_map(|segment| {
            let is_double = move |angle: &Self| KNEES.contains(&segment) && angle.name == "phi";
            Self::of_joint(segment).filter(move |angle| !is_double(angle))
        })
    }

    /// The paper's angles psi, theta, phi for each radian of it.
    pub const fn shares(&self) -> [f64; 3] {
        self.shares
    }

    /// Whether it bends a knee.
    pub fn is_bend(&self) -> bool {
        self.name == BEND.0
    }

    /// The angle in a posture (rad).
    pub fn value<T: Real>(&self, posture: &Posture<T>) -> T {
        self.share(joint_angles(posture.parent_from_segment(self.segment)))
    }

    /// How much further the joint is turned in `to` than in `from` (rad), about the axes of its parent.
    ///
    /// For small differences, and for knees that only bend, it is the difference of the angles. Where psi and phi turn
    /// about nearly the same axis, as in arms that are held out, it stays accurate, and the difference of the angles
    /// does not.
    pub fn difference<T: Real>(&self, from: &Posture<T>, to: &Posture<T>) -> T {
        let [from, to] = [from, to].map(|posture| posture.parent_from_segment(self.segment));
        self.share(joint_angles(&(to * from.inverse())))
    }

    /// The angle over time (rad): that of the `first` posture, and how much further the joint is turned since. It does not
    /// jump where psi and phi turn about nearly the same axis.
    pub fn since<T: Real>(&self, first: &Posture<T>, posture: &Posture<T>) -> T {
        self.value(first) + self.difference(first, posture)
    }

    /// The posture with the joint turned further by this angle (rad), about the axes of its parent.
    #[must_use]
    pub fn turned<T: Real>(&self, posture: &Posture<T>, by: T) -> Posture<T> {
        pattern::moved(posture, &[(self.segment, self.shares)], by)
    }

    fn share<T: Real>(&self, angles: [T; 3]) -> T {
        let mut sum = T::zero();
        for (angle, share) in angles.into_iter().zip(self.shares) {
            sum += angle * T::of(share);
        }
        sum
    }
}

impl fmt::Display for JointAngle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}", self.segment.name(), self.name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_body::any_posture;
    use proptest::prelude::*;

    #[test]
    fn a_difference_is_the_turn_that_was_made() {
        let neutral = pattern::neutral::<f64>();
        for angle in JointAngle::all() {
            let turned = angle.turned(&neutral, 0.3);
            for other in JointAngle::all() {
                let by = if other == angle { 0.3 } else { 0.0 };
                let found = other.difference(&neutral, &turned);
                assert!((found - by).abs() < 1e-9, "{angle}, {other}: {found}");
            }
        }
        assert_eq!(JointAngle::all().count(), 45);
        assert_eq!(JointAngle::of_joint(Segment::Pelvis).count(), 0);
    }

    proptest! {
        #[test]
        fn the_bend_of_a_knee_grows_by_its_difference(posture in any_posture(), by in -0.2..0.2_f64) {
            let angle = JointAngle::of_joint(Segment::LeftShank).next().unwrap();
            prop_assert!(angle.is_bend());
            let theta = JointAngle::of_joint(Segment::LeftShank).find(|own| own.name == "theta").unwrap();
            prop_assume!(theta.value(&posture).abs() < 1.4 && (angle.value(&posture).abs() + by.abs()) < 3.1);
            let bent = angle.turned(&posture, by);
            prop_assert!((angle.value(&bent) - angle.value(&posture) - by).abs() < 1e-9);
        }
    }
}
