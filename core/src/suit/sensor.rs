//! One sensor of a set, in use.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use super::mounting::Mounting;
use super::strapdown::{Reading, Strapdown};
use super::tray::Gyroscope;
use super::watch::Watch;
use crate::body::{Body, Segment};
use crate::math::{Real, normalized};

/// Further share of the force that the lever arms cause.
const LEVER: f32 = 0.3;
/// The same for a pair with a segment without sensor between them.
const FAR_LEVER: f32 = 0.6;

/// A sensor with its calibration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fitted<T: Real> {
    /// The segment that carries it.
    pub segment: Segment,
    /// Its place in the segment's frame (m).
    pub place: Vector3<T>,
    /// Its gyroscope.
    pub gyroscope: Gyroscope<T>,
    /// How it lies on the segment.
    pub mounting: Mounting<T>,
    /// Largest angular velocity that it can read (rad/s), if that is known.
    pub range: Option<T>,
}

/// A neighbour towards the pelvis: its index, and the common joint as seen from either sensor (m, sensor axes).
#[derive(Debug, Clone, Copy)]
pub(super) struct Link<T: Real> {
    parent: u8,
    /// Whether a segment without a sensor is between them.
    is_far: bool,
    pub(super) from_parent: Vector3<T>,
    pub(super) from_own: Vector3<T>,
}

impl<T: Real> Link<T> {
    pub(super) fn parent(&self) -> usize {
        self.parent.into()
    }

    pub(super) fn is_far(&self) -> bool {
        self.is_far
    }

    /// Further share of the force that the lever arms cause.
    pub(super) fn lever(&self) -> T {
        T::single(if self.is_far { FAR_LEVER } else { LEVER })
    }
}

#[derive(Debug, Clone, Copy)]
pub(super) struct Sensor<T: Real> {
    pub(super) segment: Segment,
    pub(super) gyroscope: Gyroscope<T>,
    pub(super) mounting: Mounting<T>,
    pub(super) strapdown: Strapdown<T>,
    pub(super) watch: Watch<T>,
    pub(super) link: Option<Link<T>>,
    /// Attitude and rate at the begin of the window.
    pub(super) begin: (UnitQuaternion<T>, Vector3<T>),
    /// The last force (m/s2, reference axes).
    pub(super) force: Vector3<T>,
    /// Integral of the force over the window (m/s, reference axes).
    pub(super) pushed: Vector3<T>,
    /// Whether a sample of the window was lost.
    pub(super) has_lost: bool,
    /// Integral of the rate since turns were compared (rad, reference axes).
    pub(super) turned: Vector3<T>,
    /// Attitude error (rad, reference axes) for an error of the scale of each axis, and the largest variance by it.
    pub(super) by_gain: Matrix3<T>,
    pub(super) gain_variance: Vector3<T>,
}

impl<T: Real> Sensor<T> {
    /// A sensor before its first attitude.
    pub(super) fn new(fitted: &Fitted<T>, link: Option<Link<T>>) -> Self {
        Self {
            segment: fitted.segment,
            gyroscope: fitted.gyroscope,
            mounting: fitted.mounting,
            strapdown: Strapdown::new(UnitQuaternion::identity()),
            watch: Watch::new(fitted.range),
            link,
            begin: (UnitQuaternion::identity(), Vector3::zeros()),
            force: Vector3::zeros(),
            pushed: Vector3::zeros(),
            has_lost: false,
            turned: Vector3::zeros(),
            by_gain: Matrix3::zeros(),
            gain_variance: Vector3::zeros(),
        }
    }

    /// Takes a sample, or holds the last rate if it was lost.
    pub(super) fn take(&mut self, reading: Option<&Reading<T>>, duration: T) {
        self.watch.take(reading, duration);
        let rate = match reading {
            Some(reading) => self.gyroscope.corrected(&reading.angular_velocity),
            None => self.strapdown.rate(),
        };
        self.strapdown.advance(&rate, duration);
        let attitude = self.strapdown.reference_from_sensor;
        if let Some(reading) = reading {
            self.force = attitude * reading.specific_force;
            self.pushed += self.force * duration;
        } else {
            self.has_lost = true;
        }
        let turn = attitude * rate * duration;
        self.turned += turn;
        let matrix = matrix(&attitude);
        for axis in 0..3 {
            let mut column = self.by_gain.column_mut(axis);
            column += matrix.column(axis) * (rate[axis] * duration);
        }
    }

    /// Mean force over the window at a place relative to the sensor (m, sensor axes), and the part of it that its
    /// distance causes: the change of the velocity there relative to the sensor (m/s2, reference axes).
    pub(super) fn force_at(&self, place: &Vector3<T>, window: T) -> (Vector3<T>, Vector3<T>) {
        let (attitude, rate) = self.begin;
        let before = attitude * rate.cross(place);
        let now = self.strapdown.reference_from_sensor * self.strapdown.rate().cross(place);
        let lever = (now - before) / window;
        (self.pushed / window + lever, lever)
    }

    pub(super) fn restart(&mut self) {
        self.begin = (self.strapdown.reference_from_sensor, self.strapdown.rate());
        self.pushed = Vector3::zeros();
        self.has_lost = false;
    }

    pub(super) fn reference_from_segment(&self) -> UnitQuaternion<T> {
        let mounted = self.mounting.segment_from_sensor.inverse();
        normalized(self.strapdown.reference_from_sensor.into_inner() * mounted.into_inner())
    }
}

/// The next sensor towards the pelvis, and the joint between them.
pub(super) fn link<T: Real>(own: &Fitted<T>, all: &[Fitted<T>], body: &Body<T>) -> Option<Link<T>> {
    let mut joint = body.segments[own.segment].joint_offset;
    let mut segment = own.segment.parent()?;
    let mut is_far = false;
    let parent = loop {
        if let Some(parent) = all.iter().position(|other| other.segment == segment) {
            break parent;
        }
        is_far = true;
        joint += body.segments[segment].joint_offset;
        segment = segment.parent()?;
    };
    let other = all.get(parent)?;
    let to_sensor = |fitted: &Fitted<T>| fitted.mounting.segment_from_sensor.inverse();
    Some(Link {
        parent: u8::try_from(parent).ok()?,
        is_far,
        from_parent: to_sensor(other) * (joint - other.place),
        from_own: to_sensor(own) * -own.place,
    })
}

pub(super) fn matrix<T: Real>(rotation: &UnitQuaternion<T>) -> Matrix3<T> {
    rotation.to_rotation_matrix().into_inner()
}

/// A covariance in the axes that a rotation comes from.
pub(super) fn in_axes<T: Real>(covariance: &Matrix3<T>, to: &UnitQuaternion<T>) -> Matrix3<T> {
    let axes = matrix(to);
    axes.transpose() * covariance * axes
}
