//! Joints that no person bends so: a sensor slipped, or was turned, since it was calibrated.
//!
//! Integration follows a sensor that turns on its segment as if the segment had turned; the force that it feels agrees
//! with its neighbours' then. What remains is that a knee bends to one side only. Elbows and shoulders reach almost
//! anywhere, so little can be told of arms.

use nalgebra::{UnitQuaternion, Vector3};

use crate::body::{Segment, SegmentArray};
use crate::math::Real;

/// Ends of a range that nobody reaches, as components of the direction of a segment's outer end along axes of another
/// one: least and greatest to the left, to the back and towards the head.
#[derive(Debug, Clone, Copy)]
struct Range {
    of: Segment,
    ends: [[f32; 2]; 3],
    /// Greatest turn about its own length relative to the other one (degrees).
    twist: f32,
}

const FREE: [f32; 2] = [-1.0, 1.0];
const ANY: f32 = 180.0;

const fn range(of: Segment, ends: [[f32; 2]; 3], twist: f32) -> Option<Range> {
    Some(Range { of, ends, twist })
}

/// In the order of [`Segment::ALL`]; those of the right side are mirrored.
const RANGES: SegmentArray<Option<Range>> = SegmentArray::new([
    None,
    None,
    range(
        Segment::Pelvis,
        [[-0.8, 0.8], [-0.8, 1.0], [-1.0, 0.2]],
        50.0,
    ),
    range(Segment::Thorax, [[-0.8, 0.8], FREE, [-1.0, 0.3]], 100.0),
    range(Segment::Thorax, [[-0.75, 1.0], [-1.0, 0.9], FREE], ANY),
    range(Segment::LeftUpperArm, [FREE, FREE, [-1.0, 0.92]], ANY),
    None,
    None,
    None,
    None,
    range(
        Segment::Pelvis,
        [[-0.6, 0.9], [-1.0, 0.65], [-1.0, 0.6]],
        60.0,
    ),
    range(
        Segment::LeftThigh,
        [[-0.3, 0.3], [-0.25, 1.0], [-1.0, 0.85]],
        50.0,
    ),
    None,
    None,
    None,
    None,
]);

/// By how much a component of a segment's direction is outside its range, about an angle (rad), and along which other
/// segment; `None` if it has no range. Rotations are those of the segments to one frame.
pub fn beyond<T: Real>(
    segment: Segment,
    from_segments: &SegmentArray<UnitQuaternion<T>>,
) -> Option<(Segment, T)> {
    let is_right = segment.mirrored() < segment;
    let (range, of) = if is_right {
        let range = RANGES[segment.mirrored()]?;
        (range, range.of.mirrored())
    } else {
        let range = RANGES[segment]?;
        (range, range.of)
    };
    let relative = from_segments[of].inverse() * from_segments[segment];
    let mut along = relative * -Vector3::z();
    if is_right {
        along.x = -along.x;
    }
    let mut most = T::zero();
    for (part, [least, greatest]) in along.iter().zip(range.ends) {
        for excess in [*part - T::single(greatest), T::single(least) - *part] {
            if excess > most {
                most = excess;
            }
        }
    }
    let twist = twist(&relative).abs() - T::single(range.twist.to_radians());
    Some((of, if twist > most { twist } else { most }))
}

/// The turn of a segment about its own length (rad), within half a turn either way.
fn twist<T: Real>(rotation: &UnitQuaternion<T>) -> T {
    let (along, cosine) = (rotation.k, rotation.w);
    let sign = if cosine < T::zero() {
        -T::one()
    } else {
        T::one()
    };
    T::of(2.0) * (along * sign).arctangent2(cosine * sign)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::pattern;
    use crate::body::posture::Posture;
    use crate::math::rotation_by;

    /// Usual poses are within all ranges; a thigh that turned about itself bends the knee to the side, on either side.
    #[test]
    fn poses_are_within_and_a_slip_is_not() {
        let all = |posture: &Posture<f64>| {
            let turned = posture.body_from_segments();
            let mut most = (Segment::Pelvis, 0.0);
            for segment in Segment::ALL {
                if let Some((_, by)) = beyond(segment, &turned).filter(|(_, by)| *by > most.1) {
                    most = (segment, by);
                }
            }
            most
        };
        let neutral = pattern::neutral::<f64>();
        for posture in [
            neutral,
            Posture::h_pose(),
            pattern::posture(pattern::TRACK),
            pattern::posture(pattern::SIT),
            pattern::posture(pattern::HEAD_DOWN),
            pattern::posture(pattern::BACK),
        ] {
            assert!(all(&posture).1 < 1e-9, "{:?}", all(&posture));
        }
        for (thigh, shank) in [
            (Segment::LeftThigh, Segment::LeftShank),
            (Segment::RightThigh, Segment::RightShank),
        ] {
            let mut turned = neutral.body_from_segments();
            turned[thigh] *= rotation_by(&(Vector3::z() * 1.2));
            let slipped = Posture::from_body_rotations(&turned);
            let (segment, by) = all(&slipped);
            assert_eq!(segment, shank);
            assert!(by > 0.2, "{by}");
            let mut turned = neutral.body_from_segments();
            turned[shank] *= rotation_by(&(Vector3::z() * -1.2));
            let (segment, by) = all(&Posture::from_body_rotations(&turned));
            assert!(segment == shank && by > 0.2, "{segment:?} {by}");
        }
    }
}
