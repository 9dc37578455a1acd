//! What a sensor and its neighbour feel, and where their common joint is.

use nalgebra::{UnitQuaternion, Vector3};

use super::sensor::Sensor;
use super::set::Suit;
use crate::body::Segment;
use crate::math::Real;

/// One of the two sensors at a joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Felt<T: Real> {
    /// From the sensor's axes to reference axes.
    pub attitude: UnitQuaternion<T>,
    /// Specific force (m/s2, reference axes).
    pub force: Vector3<T>,
    /// Where the joint is, seen from the sensor (m, reference axes).
    pub to_joint: Vector3<T>,
    /// Angular velocity (rad/s, reference axes).
    pub rate: Vector3<T>,
}

impl<T: Real> Felt<T> {
    fn of(sensor: &Sensor<T>, joint: &Vector3<T>) -> Self {
        let attitude = sensor.strapdown.reference_from_sensor;
        Self {
            attitude,
            force: sensor.force,
            to_joint: attitude * joint,
            rate: attitude * sensor.strapdown.rate(),
        }
    }
}

impl<T: Real, const N: usize, const P: usize> Suit<T, N, P> {
    /// What the sensor of a segment feels now, and what that of the segment feels that it is joined to; `None` if either has
    /// no sensor, or lost a sample lately.
    pub fn felt(&self, segment: Segment) -> Option<[Felt<T>; 2]> {
        let own = (self.sensors.iter()).find(|sensor| sensor.segment == segment)?;
        let link = own.link.filter(|link| !link.is_far())?;
        let parent = self.sensors.get(link.parent())?;
        (!own.has_lost && !parent.has_lost).then(|| {
            [
                Felt::of(own, &link.from_own),
                Felt::of(parent, &link.from_parent),
            ]
        })
    }
}
