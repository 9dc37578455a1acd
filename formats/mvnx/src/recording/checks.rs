//! The checks of a recording on frames that come from elsewhere.

use bodyflight_core::{Segment, SegmentArray};

use super::frame::FlightFrame;
use super::limbs::Moving;
use super::warning::Warning;
use super::watch::Watch;

/// What is implausible in frames that no file holds, such as those of a network stream.
#[derive(Debug, Clone)]
pub struct Checks(Watch);

impl Checks {
    /// For frames at this rate (Hz).
    pub fn new(frame_rate: f64) -> Self {
        Self(Watch::new(frame_rate))
    }

    /// In air that moves at this velocity (m/s, inertial).
    #[must_use]
    pub fn in_air(mut self, velocity: [f64; 3]) -> Self {
        self.0.in_air(velocity);
        self
    }

    /// Takes the next frame.
    pub fn see(&mut self, frame: &FlightFrame) {
        let pelvis = frame.pelvis;
        let mut moving = SegmentArray::from_fn(|_| Moving::default());
        moving[Segment::Pelvis] = Moving {
            position: Some(pelvis.position.components),
            velocity: pelvis.velocity.map(|velocity| velocity.components),
            angular_velocity: pelvis.angular_velocity.map(|rate| rate.components),
        };
        self.0.see(frame, None, None, &moving);
    }

    /// Whatever is implausible so far.
    pub fn warnings(&self) -> Vec<Warning> {
        self.0.warnings(super::watch::JUDGED)
    }
}
