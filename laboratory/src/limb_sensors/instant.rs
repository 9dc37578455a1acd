//! A body at an instant, and the points on it.

use bodyflight_core::body::posture::pose;
use bodyflight_core::{Body, Posture, Segment};
use bodyflight_mvnx::recording::FlightFrame;
use nalgebra::{UnitQuaternion, Vector3};

/// Attitude and place of the pelvis with the posture, at an instant.
#[derive(Debug, Clone, Copy)]
pub(super) struct Instant {
    pub(super) inertial_from_body: UnitQuaternion<f64>,
    pub(super) position: Vector3<f64>,
    pub(super) posture: Posture<f64>,
}

impl Instant {
    pub(super) fn of(frame: &FlightFrame) -> Self {
        Self {
            inertial_from_body: *frame.pelvis.inertial_from_body.quaternion(),
            position: frame.pelvis.position.components,
            posture: frame.posture,
        }
    }

    /// Attitude and place of a point of a segment.
    pub(super) fn point(
        &self,
        body: &Body<f64>,
        segment: Segment,
        place: &Vector3<f64>,
    ) -> (UnitQuaternion<f64>, Vector3<f64>) {
        let posed = &pose(body, &self.posture)[segment];
        let turned = self.posture.body_from_segments()[segment];
        let at = posed.joint + turned * place;
        (
            self.inertial_from_body * turned,
            self.position + self.inertial_from_body * at,
        )
    }
}
