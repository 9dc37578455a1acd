//! Segments without a sensor.
//!
//! The abdomen lies halfway between pelvis and thorax. A proximal limb without a sensor takes half of the rotation of
//! the next sensor outwards. An elbow is straight where the upper arm lies along the trunk, up or down, and bent as in the
//! flying pose where it is held out. Anything else keeps the angle to its parent of the flying pose. What each rule leaves open is
//! stated in a covariance.

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

use crate::body::pattern;
use crate::body::posture::{Posture, joint_rotation};
use crate::body::{SEGMENT_COUNT, Segment, SegmentArray};
use crate::math::{Real, clamp, normalized};

/// Standard deviation of a segment that has no sensor, each axis (degrees), in the order of [`Segment::ALL`]: with a
/// sensor further out, and without.
const OPEN_DEG: SegmentArray<[f32; 2]> = SegmentArray::new([
    [0.0, 0.0],
    [5.0, 8.0],
    [8.0, 12.0],
    [20.0, 20.0],
    [20.0, 30.0],
    [25.0, 45.0],
    [30.0, 30.0],
    [20.0, 30.0],
    [25.0, 45.0],
    [30.0, 30.0],
    [15.0, 20.0],
    [20.0, 25.0],
    [30.0, 30.0],
    [15.0, 20.0],
    [20.0, 25.0],
    [30.0, 30.0],
]);

/// Joint angles of [`pattern::NEUTRAL`] in single precision: the unit converts no double precision in flight.
const NEUTRAL: SegmentArray<[f32; 3]> = {
    let mut angles = [[0.0; 3]; SEGMENT_COUNT];
    let mut row = 0;
    while row < pattern::NEUTRAL.len() {
        let (segment, of) = pattern::NEUTRAL[row];
        let mut axis = 0;
        while axis < 3 {
            #[expect(clippy::cast_possible_truncation, reason = "to single precision")]
            let angle = of[axis] as f32;
            angles[segment as usize][axis] = angle;
            axis += 1;
        }
        row += 1;
    }
    SegmentArray::new(angles)
};

/// The flying pose.
fn neutral<T: Real>() -> Posture<T> {
    NEUTRAL
        .iter()
        .fold(Posture::h_pose(), |posture, (segment, angles)| {
            let [psi, theta, phi] = angles.map(T::single);
            posture.with(segment, joint_rotation(psi, theta, phi))
        })
}

/// A segment's orientation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Orientation<T: Real> {
    /// Segment axes to those of the body.
    pub body_from_segment: UnitQuaternion<T>,
    /// Covariance of its error (rad2, body axes).
    pub covariance: Matrix3<T>,
    /// Whether a sensor shows it.
    pub is_measured: bool,
}

impl<T: Real> Orientation<T> {
    /// Standard deviation about an axis (rad), the mean of the three as a variance.
    pub fn deviation(&self) -> T {
        (self.covariance.trace() / T::of(3.0)).root()
    }
}

/// Completes a set of orientations relative to the body's axes; the pelvis is the reference, and is the identity.
pub fn filled<T: Real>(
    measured: &SegmentArray<Option<Orientation<T>>>,
) -> SegmentArray<Orientation<T>> {
    let neutral = neutral::<T>();
    let mut found = SegmentArray::from_fn(|_| Orientation {
        body_from_segment: UnitQuaternion::identity(),
        covariance: Matrix3::zeros(),
        is_measured: true,
    });
    for segment in Segment::ALL {
        let Some(parent) = segment.parent() else {
            continue;
        };
        if let Some(measured) = measured[segment] {
            found[segment] = measured;
            continue;
        }
        let parent = &found[parent];
        let further = outwards(segment, measured);
        let [with, without] = OPEN_DEG[segment].map(|degrees| T::single(degrees.to_radians()));
        let filled = match further {
            Some(further) => Orientation {
                body_from_segment: halfway(&parent.body_from_segment, &further.body_from_segment),
                covariance: (parent.covariance + further.covariance) * T::of(0.25)
                    + Matrix3::from_diagonal_element(with * with),
                is_measured: false,
            },
            None => Orientation {
                body_from_segment: normalized(
                    parent.body_from_segment.into_inner()
                        * kept(segment, &neutral, &found).into_inner(),
                ),
                covariance: parent.covariance + Matrix3::from_diagonal_element(without * without),
                is_measured: false,
            },
        };
        found[segment] = filled;
    }
    found
}

/// The angle to its parent that a segment keeps; its parents are found.
fn kept<T: Real>(
    segment: Segment,
    neutral: &Posture<T>,
    found: &SegmentArray<Orientation<T>>,
) -> UnitQuaternion<T> {
    let bent = *neutral.parent_from_segment(segment);
    let (Segment::LeftForearm | Segment::RightForearm, Some(upper)) = (segment, segment.parent())
    else {
        return bent;
    };
    let along = |of: Segment| found[of].body_from_segment * Vector3::z();
    // How far the arm is held out: 1 at a right angle, 0 hanging or overhead.
    let out = T::one() - along(upper).dot(&along(Segment::Thorax)).abs();
    let out = clamp(out, T::zero(), T::one());
    let straight = UnitQuaternion::identity().coords * (T::one() - out);
    normalized(Quaternion::from(straight + bent.coords * out))
}

/// The next measured segment outwards, if the trunk or the same limb has one.
fn outwards<T: Real>(
    segment: Segment,
    measured: &SegmentArray<Option<Orientation<T>>>,
) -> Option<Orientation<T>> {
    let is_limb = |child: Segment| {
        // Neither arms nor the head tell how the thorax leans, and hands and feet turn on their own.
        !matches!(
            child,
            Segment::Head
                | Segment::LeftUpperArm
                | Segment::RightUpperArm
                | Segment::LeftHand
                | Segment::RightHand
                | Segment::LeftFoot
                | Segment::RightFoot
        )
    };
    let mut next = Segment::ALL
        .into_iter()
        .filter(|child| child.parent() == Some(segment) && is_limb(*child));
    let child = next.next()?;
    measured[child].or_else(|| outwards(child, measured))
}

/// The rotation halfway between two, along the shorter arc.
fn halfway<T: Real>(one: &UnitQuaternion<T>, other: &UnitQuaternion<T>) -> UnitQuaternion<T> {
    let same = one.coords.dot(&other.coords) >= T::zero();
    let other = if same { other.coords } else { -other.coords };
    normalized(Quaternion::from(one.coords + other))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rotation_by;

    fn turned(angle: f64) -> Orientation<f64> {
        Orientation {
            body_from_segment: rotation_by(&(Vector3::x() * angle)),
            covariance: Matrix3::from_diagonal_element(0.01),
            is_measured: true,
        }
    }

    #[test]
    fn missing_segments_follow_their_rules_and_are_less_certain() {
        let mut measured = SegmentArray::from_fn(|_| None);
        measured[Segment::Thorax] = Some(turned(0.4));
        measured[Segment::LeftShank] = Some(turned(-1.0));
        let found = filled(&measured);
        let angle = |segment: Segment| {
            let turn = found[segment].body_from_segment.scaled_axis();
            assert!(turn.y.abs() + turn.z.abs() < 0.6, "{segment:?}");
            turn.x
        };
        assert!((angle(Segment::Abdomen) - 0.2).abs() < 1e-6, "halfway");
        assert!((angle(Segment::Thorax) - 0.4).abs() < 1e-6, "measured");
        assert!((angle(Segment::Head) - 0.15).abs() < 1e-6, "neutral neck");
        assert!((angle(Segment::LeftThigh) + 0.5).abs() < 1e-6, "half");
        assert!((angle(Segment::LeftFoot) + 0.4).abs() < 1e-6, "neutral");
        let open = |segment: Segment| found[segment].deviation();
        assert!(open(Segment::RightShank) > open(Segment::RightThigh));
        assert!(open(Segment::RightThigh) > open(Segment::LeftThigh));
        assert!(open(Segment::LeftThigh) > open(Segment::Thorax));
        let elbow = |arm: f64| {
            let mut measured = SegmentArray::from_fn(|_| None);
            measured[Segment::LeftUpperArm] = Some(Orientation {
                body_from_segment: rotation_by(&(Vector3::y() * -arm)),
                ..turned(0.0)
            });
            let found = filled(&measured);
            let upper = found[Segment::LeftUpperArm].body_from_segment;
            upper.angle_to(&found[Segment::LeftForearm].body_from_segment)
        };
        assert!(elbow(0.0) < 0.05 && elbow(0.5) < 0.3, "it hangs: straight");
        assert!(elbow(3.1) < 0.05, "overhead: straight");
        assert!((elbow(1.6) - 1.57).abs() < 0.05, "held out: bent");
        let unmeasured = Segment::ALL.into_iter().filter(|s| !found[*s].is_measured);
        assert_eq!(unmeasured.count(), 13);
    }
}
