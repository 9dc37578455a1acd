//! How a sensor lies on its segment, from two poses and a march.
//!
//! Upright, gravity shows the tilt of every sensor; its heading remains unknown without a magnetometer. A bend forwards
//! shows it where a segment tilts, since a person bends about the left-right axis; the march shows it where a segment
//! swings about that axis. What a pose leaves open is stated in the standard deviations.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

use super::strapdown::LONGEST_INTERVAL;
use crate::body::{Segment, SegmentArray};
use crate::math::{Real, normalized};

/// What a segment does in the poses: its tilt from upright is wrong by so much (degrees, each axis), it turns about the
/// left axis in the bend and in the march with this sign (0 if that is not known), and these axes are wrong by so much
/// (degrees).
#[derive(Debug, Clone, Copy)]
struct Conduct {
    tilt: f32,
    bend: i8,
    march: i8,
    axis: f32,
}

const fn conduct(tilt: f32, bend: i8, march: i8, axis: f32) -> Conduct {
    Conduct {
        tilt,
        bend,
        march,
        axis,
    }
}

/// In the order of [`Segment::ALL`]. Knees and hands come forwards in the march, which is a negative turn about the left
/// axis; heels go back. In the bend, knees are bent too: thighs lean back and shanks forwards.
const CONDUCT: SegmentArray<Conduct> = SegmentArray::new([
    conduct(3.0, 1, 0, 3.0),
    conduct(4.0, 1, 0, 3.0),
    conduct(4.0, 1, 0, 3.0),
    conduct(6.0, 1, 0, 8.0),
    conduct(6.0, 0, -1, 11.0),
    conduct(7.0, 0, -1, 11.0),
    conduct(10.0, 0, -1, 15.0),
    conduct(6.0, 0, -1, 11.0),
    conduct(7.0, 0, -1, 11.0),
    conduct(10.0, 0, -1, 15.0),
    conduct(3.0, -1, -1, 7.0),
    conduct(3.0, 1, 1, 7.0),
    conduct(5.0, 0, 1, 12.0),
    conduct(3.0, -1, -1, 7.0),
    conduct(3.0, 1, 1, 7.0),
    conduct(5.0, 0, 1, 12.0),
]);

/// Least sine of the tilt in the bend from which a heading follows.
const LEAST_TILT: f64 = 0.2;
/// Error of a pose that acts on the heading, divided by the sine of the tilt (rad).
const POSE: f64 = 0.05;
/// Least turn in the march from which a heading follows, root of its mean square (rad/s).
const LEAST_SWING: f64 = 0.3;
/// Least mean angle in the march that tells forwards from backwards (rad), and for each rad/s of the swing (s): a shank in a mere
/// walk swings as far to either side, which a march does not.
const LEAST_SIDE: f64 = 0.06;
const LEAST_BALANCE: f64 = 0.05;
/// Cosine of the angle beyond which bend and march contradict each other.
const CONTRADICTION: f64 = 0.5;

/// The swings of a sensor in the march.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct March<T: Real> {
    squares: Matrix3<T>,
    angle: Vector3<T>,
    area: Vector3<T>,
    duration: T,
}

impl<T: Real> Default for March<T> {
    fn default() -> Self {
        Self {
            squares: Matrix3::zeros(),
            angle: Vector3::zeros(),
            area: Vector3::zeros(),
            duration: T::zero(),
        }
    }
}

impl<T: Real> March<T> {
    /// Takes a rate (rad/s, sensor axes, corrected) that lasts `duration` (s). Begin in the upright pose.
    pub fn take(&mut self, rate: &Vector3<T>, duration: T) {
        if rate.norm_squared().is_finite()
            && duration > T::zero()
            && duration <= T::of(LONGEST_INTERVAL)
        {
            self.squares += rate * rate.transpose() * duration;
            self.angle += rate * duration;
            self.area += self.angle * duration;
            self.duration += duration;
        }
    }

    /// The axis of the swings across `up` (unit vector), with the sense of rotation in which the segment spends more
    /// time, and the standard deviation of its direction (rad). `None` if it hardly swings or favours no side.
    fn axis(&self, up: &Vector3<T>) -> Option<(Vector3<T>, T)> {
        let has_samples = self.duration > T::zero();
        if !has_samples {
            return None;
        }
        let one = any_across(up);
        let other = up.cross(&one);
        let about = |a: &Vector3<T>, b: &Vector3<T>| a.dot(&(self.squares * b)) / self.duration;
        let (xx, xy, yy) = (
            about(&one, &one),
            about(&one, &other),
            about(&other, &other),
        );
        let two = T::of(2.0);
        let (sine, cosine) = ((two * xy).arctangent2(xx - yy) / two).sine_cosine();
        let axis = one * cosine + other * sine;
        let along = about(&axis, &axis);
        let across = xx + yy - along;
        let side = self.area.dot(&axis) / self.duration;
        let is_undecided = side.abs() < T::of(LEAST_SIDE)
            || side * side < T::of(LEAST_BALANCE * LEAST_BALANCE) * along;
        if along < T::of(LEAST_SWING * LEAST_SWING) || is_undecided {
            return None;
        }
        let spread = if across > T::zero() {
            across / along
        } else {
            T::zero()
        };
        let deviation = (spread * T::of(0.25)).root();
        Some((if side < T::zero() { -axis } else { axis }, deviation))
    }
}

/// What a sensor felt in the poses.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stances<T: Real> {
    /// Direction of up when standing upright (unit vector, sensor axes).
    pub upright: Vector3<T>,
    /// Direction of up when bent forwards.
    pub bent: Option<Vector3<T>>,
    /// The march.
    pub march: Option<March<T>>,
}

/// How a sensor lies on its segment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mounting<T: Real> {
    /// Sensor axes to those of the segment.
    pub segment_from_sensor: UnitQuaternion<T>,
    /// Standard deviation of the segment's tilt in the upright pose, each axis (rad).
    pub tilt_deviation: T,
    /// Standard deviation of the heading (rad).
    pub heading_deviation: T,
}

/// Why no mounting was found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MountingError {
    /// Neither bend nor march turned the segment enough.
    NoHeading,
    /// Bend and march show opposite headings: the sensor is on another segment, or was turned in between.
    Contradiction,
}

/// Finds the mounting of a sensor. `level_from_segment` is the attitude of the segment in the upright pose relative to
/// axes of the body that are level; the identity for arms that hang down.
///
/// # Errors
/// Returns an error if the poses do not show the heading.
pub fn fit<T: Real>(
    segment: Segment,
    stances: &Stances<T>,
    level_from_segment: &UnitQuaternion<T>,
) -> Result<Mounting<T>, MountingError> {
    let conduct = CONDUCT[segment];
    let up = stances.upright;
    let radians = |degrees: f32| T::single(degrees.to_radians());
    let sign = |sign: i8| T::single(f32::from(sign));
    let bend = stances.bent.and_then(|bent| {
        // Up moves to the back when a segment leans forwards, about the left axis.
        let turn = bent.cross(&up);
        let sine = turn.norm_squared().root();
        (conduct.bend != 0 && sine > T::of(LEAST_TILT))
            .then(|| (turn * (sign(conduct.bend) / sine), T::of(POSE) / sine))
    });
    let march = stances.march.and_then(|march| {
        let (axis, deviation) = march.axis(&up)?;
        (conduct.march != 0).then(|| (axis * sign(conduct.march), deviation))
    });
    if let (Some((bend, _)), Some((march, _))) = (bend, march)
        && bend.dot(&march) < T::of(CONTRADICTION)
    {
        return Err(MountingError::Contradiction);
    }
    let axis_deviation = radians(conduct.axis);
    let (mut left, mut weights) = (Vector3::zeros(), T::zero());
    for (axis, deviation) in [bend, march].into_iter().flatten() {
        let weight = T::one() / (deviation * deviation + axis_deviation * axis_deviation);
        left += axis * weight;
        weights += weight;
    }
    left -= up * left.dot(&up);
    let size = left.norm_squared().root();
    let is_seen = weights > T::zero() && size > T::zero();
    if !is_seen {
        return Err(MountingError::NoHeading);
    }
    let left = left / size;
    let rows = Matrix3::from_rows(&[
        left.transpose(),
        up.cross(&left).transpose(),
        up.transpose(),
    ]);
    let level_from_sensor =
        UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rows));
    let back = level_from_segment.inverse().into_inner();
    Ok(Mounting {
        segment_from_sensor: normalized(back * level_from_sensor.into_inner()),
        tilt_deviation: radians(conduct.tilt),
        heading_deviation: (T::one() / weights).root(),
    })
}

/// A unit vector across another.
fn any_across<T: Real>(axis: &Vector3<T>) -> Vector3<T> {
    let other = if axis.x.abs() < T::of(0.7) {
        Vector3::x()
    } else {
        Vector3::y()
    };
    let across = axis.cross(&other);
    across / across.norm_squared().root()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Lanes;

    /// Stances of a sensor that lies on the segment like `mounted`, if the segment leans by `bend` and swings with this
    /// amplitude about the left axis to one side.
    fn stances(mounted: UnitQuaternion<f32>, bend: f32, swing: f32) -> Stances<f32> {
        let up = |angle: f32| mounted.inverse() * (rotation(-angle) * Vector3::<f32>::z());
        let mut march = March::default();
        for k in 0..600_u16 {
            let (sine, _) = (f32::from(k) * 0.01 * core::f32::consts::TAU).sine_cosine();
            // Its integral stays on the side of the swing.
            let rate = Vector3::x() * (swing * sine);
            march.take(&(mounted.inverse() * rate), 0.01);
        }
        Stances {
            upright: up(0.0),
            bent: Some(up(bend)),
            march: Some(march),
        }
    }

    fn rotation(angle: f32) -> UnitQuaternion<f32> {
        crate::math::rotation_by(&(Vector3::x() * angle))
    }

    #[test]
    fn any_mounting_is_found_from_bend_and_march() {
        for segment in Segment::ALL {
            let conduct = CONDUCT[segment];
            for turn in [[0.3, -1.2, 0.4], [2.0, 0.5, -1.5], [0.0, 3.0, 0.1]] {
                let mounted = crate::math::rotation_by(&Vector3::from(turn));
                let seen = stances(
                    mounted,
                    1.2 * f32::from(conduct.bend),
                    3.0 * f32::from(conduct.march),
                );
                let found = fit(segment, &seen, &UnitQuaternion::identity()).unwrap();
                let error = found.segment_from_sensor.angle_to(&mounted);
                assert!(error < 1e-3, "{segment:?}: {error}");
                assert!((0.03..0.3).contains(&found.heading_deviation));
            }
        }
    }

    #[test]
    fn a_swing_to_both_sides_shows_no_heading() {
        let mounted = crate::math::rotation_by(&Vector3::new(0.3, -1.2, 0.4));
        let mut march = March::default();
        for k in 0..600_u16 {
            let (sine, cosine) = (f32::from(k) * 0.01 * core::f32::consts::TAU).sine_cosine();
            // Forwards and backwards by 30 degrees, and 4 degrees more to one side.
            let rate = Vector3::x() * (3.3 * cosine + 0.44 * sine);
            march.take(&(mounted.inverse() * rate), 0.01);
        }
        let walk = Stances {
            march: Some(march),
            bent: None,
            ..stances(mounted, 0.0, 0.0)
        };
        let found = fit(Segment::LeftShank, &walk, &UnitQuaternion::identity());
        assert_eq!(found, Err(MountingError::NoHeading));
    }

    #[test]
    fn no_motion_shows_no_heading_and_a_sensor_on_the_wrong_segment_contradicts_itself() {
        let mounted = crate::math::rotation_by(&Vector3::new(0.3, -1.2, 0.4));
        let still = stances(mounted, 0.05, 0.01);
        let level = UnitQuaternion::identity();
        assert_eq!(
            fit(Segment::LeftThigh, &still, &level),
            Err(MountingError::NoHeading)
        );
        // A shank's conduct reported as a thigh's bend with a shank's march.
        let mixed = stances(mounted, -1.0, 3.0);
        assert_eq!(
            fit(Segment::LeftThigh, &mixed, &level),
            Err(MountingError::Contradiction)
        );
    }
}
