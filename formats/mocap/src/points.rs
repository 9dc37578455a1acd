//! The axes of a segment from points at its ends.
//!
//! Two points give the long axis. The rotation about it comes from a third direction if there is one; otherwise the
//! segment does not turn about its long axis relative to its parent. That is a statement about rates: from frame to
//! frame the segment takes the shortest rotation. Its axes in the first frame are those of the shortest rotation out of
//! the rest posture, and it returns to these slowly, so that small errors do not add up over hours. The return pauses
//! near the one direction where they are undefined, against the rest posture.

use bodyflight_core::Segment;
use nalgebra::{Matrix3, Rotation3, Unit, UnitQuaternion, Vector3};

/// Shortest vector between two points that defines a direction (m), and smallest angle between two such vectors (rad).
const NO_WAY: f64 = 1e-9;
const NO_ANGLE: f64 = 0.05;
/// Time in which a segment returns to the shortest rotation out of the rest posture (s).
const RETURN: f64 = 2.0;
/// Longest time over which the previous axes are carried on (s).
const LONGEST: f64 = 0.5;

/// Axes of a segment relative to its parent at a time (s).
#[derive(Debug, Clone, Copy)]
pub(crate) struct Carried {
    pub(crate) time: f64,
    pub(crate) parent_from_own: UnitQuaternion<f64>,
}

/// The direction from the near to the far end in the axes of the model: toes are in front, the head is up, hands and
/// knees are down.
fn far_end(segment: Option<Segment>) -> Vector3<f64> {
    match segment {
        Some(Segment::LeftFoot | Segment::RightFoot) => -Vector3::y(),
        Some(Segment::Pelvis | Segment::Abdomen | Segment::Thorax | Segment::Head) => Vector3::z(),
        _ => -Vector3::z(),
    }
}

/// Inertial axes of a segment, from the direction to its far end, a direction to its left, the axes of its parent and
/// its axes in the previous frame.
pub(crate) fn axes(
    segment: Option<Segment>,
    along: &Vector3<f64>,
    left: Option<Vector3<f64>>,
    parent: Option<&UnitQuaternion<f64>>,
    (before, time): (Option<Carried>, f64),
) -> Result<UnitQuaternion<f64>, &'static str> {
    if along.norm() < NO_WAY {
        return Err("its two points coincide");
    }
    let along = along.normalize();
    if let Some(left) = left
        && left.norm() > NO_WAY
        && left.cross(&along).norm() > NO_ANGLE * left.norm()
    {
        return Ok(with_left(segment, &along, &left));
    }
    let parent = match (parent, left) {
        (Some(parent), _) => *parent,
        (None, Some(_)) if before.is_some() => UnitQuaternion::identity(),
        (None, Some(_)) => {
            return Err(
                "its long axis is parallel to its left direction, so its rotation is undefined",
            );
        }
        (None, None) => return Err("expected left: two points across the body"),
    };
    let (own, in_parent) = (far_end(segment), parent.inverse() * along);
    let shortest = UnitQuaternion::rotation_between(&own, &in_parent);
    let carried = before
        .filter(|before| (0.0..LONGEST).contains(&(time - before.time)))
        .and_then(|before| {
            let turn =
                UnitQuaternion::rotation_between(&(before.parent_from_own * own), &in_parent)?;
            Some((turn * before.parent_from_own, time - before.time))
        });
    let relative = match (carried, shortest) {
        (Some((carried, duration)), Some(shortest)) => {
            let near = 0.5 * (1.0 + own.dot(&in_parent));
            let share = (duration / RETURN * near * near).min(1.0);
            let off = (shortest * carried.inverse()).scaled_axis().dot(&in_parent);
            UnitQuaternion::from_axis_angle(&Unit::new_normalize(in_parent), share * off) * carried
        }
        (Some((carried, _)), None) => carried,
        (None, Some(shortest)) => shortest,
        (None, None) => {
            let left = Vector3::x();
            return Ok(with_left(segment, &along, &(parent * left)));
        }
    };
    Ok(UnitQuaternion::new_normalize(
        (parent * relative).into_inner(),
    ))
}

/// The axes whose left is nearest to a direction.
fn with_left(
    segment: Option<Segment>,
    along: &Vector3<f64>,
    left: &Vector3<f64>,
) -> UnitQuaternion<f64> {
    let far = far_end(segment);
    let (dorsal, cranial) = if far.y < 0.0 {
        (-along, along.cross(left))
    } else {
        let cranial = along * far.z;
        (cranial.cross(left), cranial)
    };
    let (dorsal, cranial) = (dorsal.normalize(), cranial.normalize());
    let axes = [dorsal.cross(&cranial), dorsal, cranial];
    UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(Matrix3::from_columns(
        &axes,
    )))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Angular speed about its long axis (rad/s) of an arm that is raised past a direction, at 100 frames a second.
    fn spin(way: impl Fn(f64) -> Vector3<f64>) -> f64 {
        let parent = UnitQuaternion::identity();
        let (mut before, mut fastest) = (None, 0.0_f64);
        for k in 0..=100 {
            let time = f64::from(k) / 100.0;
            let along = way(time);
            let turned = axes(
                Some(Segment::LeftUpperArm),
                &along,
                None,
                Some(&parent),
                (before, time),
            )
            .unwrap();
            assert!((turned * -Vector3::z() - along).norm() < 1e-9);
            if let Some(Carried {
                parent_from_own, ..
            }) = before
            {
                let rate = (turned * parent_from_own.inverse()).scaled_axis() * 100.0;
                assert!(rate.norm().is_finite());
                fastest = fastest.max(rate.dot(&along).abs());
            }
            before = Some(Carried {
                time,
                parent_from_own: turned,
            });
        }
        fastest
    }

    proptest! {
        #[test]
        fn an_arm_that_passes_any_direction_does_not_spin(
            off in 0.0..0.3_f64,
            azimuth in -3.1..3.1_f64,
            most in 1.0..3.0_f64,
        ) {
            // Raised from the side of the body in a plane through any azimuth, `off` beside the vertical plane.
            let fastest = spin(|time| {
                let raised = most * time;
                let flat = Vector3::new(azimuth.cos(), azimuth.sin(), 0.0);
                let beside = Vector3::new(-azimuth.sin(), azimuth.cos(), 0.0);
                let way = flat * raised.sin() - Vector3::z() * raised.cos();
                (way * off.cos() + beside * off.sin()).normalize()
            });
            prop_assert!(fastest < 1.0, "{fastest}");
        }
    }
}
