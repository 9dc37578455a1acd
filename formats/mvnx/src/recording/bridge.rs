//! Keeps a flight continuous across short runs of bad frames.

use std::collections::VecDeque;

use bodyflight_core::body::posture::near;
use bodyflight_core::frame::{Inertial, Rotation, Vector};
use nalgebra::{Quaternion, UnitQuaternion};

use super::frame::{FlightFrame, PelvisMotion};
use crate::Fault;
use bodyflight_io::diagnostic::{Problem, Result};

/// Longest time without a good frame that is bridged (s).
pub const BRIDGE_LIMIT: f64 = 0.1;

/// What to do with a frame whose numbers cannot be used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum BadFrames {
    /// Replaces it with a frame interpolated between its good neighbours, for up to [`BRIDGE_LIMIT`].
    #[default]
    Bridge,
    /// Stops reading.
    Refuse,
}

/// What has been read so far.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Quality {
    /// Good frames handed out.
    pub good_frames: u64,
    /// Bad frames replaced with interpolated ones.
    pub bridged_frames: u64,
    /// Bad frames left out before the first and after the last good one.
    pub dropped_frames: u64,
    /// Frames missing from the indices.
    pub missing_frames: u64,
    /// The first fault.
    pub first_fault: Option<Fault>,
    /// Whether the file ended too early.
    pub truncated: bool,
}

/// Holds bad frames back until the next good one.
pub(super) struct Bridge {
    frame_rate: f64,
    policy: BadFrames,
    last: Option<FlightFrame>,
    bad: Vec<Fault>,
    ready: VecDeque<FlightFrame>,
    last_index: Option<u64>,
    pub(super) quality: Quality,
}

impl Bridge {
    pub(super) fn new(frame_rate: f64, policy: BadFrames) -> Self {
        Self {
            frame_rate,
            policy,
            last: None,
            bad: Vec::new(),
            ready: VecDeque::new(),
            last_index: None,
            quality: Quality::default(),
        }
    }

    /// Time of a frame (s).
    #[expect(
        clippy::cast_precision_loss,
        reason = "the reader keeps indices below 2^53"
    )]
    pub(super) fn time(&self, index: u64) -> f64 {
        index as f64 / self.frame_rate
    }

    /// The next frame that can be handed out.
    pub(super) fn ready(&mut self) -> Option<FlightFrame> {
        self.ready.pop_front()
    }

    /// Drops the held frames after a problem.
    pub(super) fn discard(&mut self) {
        self.ready.clear();
        self.bad.clear();
    }

    pub(super) fn held_bytes(&self) -> usize {
        self.ready.capacity() * size_of::<FlightFrame>() + self.bad.capacity() * size_of::<Fault>()
    }

    fn count_missing(&mut self, index: u64) {
        if let Some(last) = self.last_index {
            self.quality.missing_frames += index.saturating_sub(last).saturating_sub(1);
        }
        self.last_index = Some(index);
    }

    /// Takes a bad frame.
    pub(super) fn bad(&mut self, fault: Fault) -> Result<()> {
        self.count_missing(fault.index);
        if self.policy == BadFrames::Refuse {
            return Err(refusal(&fault).help("correct the file, or allow short gaps to be bridged"));
        }
        let first = self.bad.first().unwrap_or(&fault);
        // Checked before the next good frame arrives, so that a long bad run does not accumulate.
        if self.time(fault.index) - self.time(first.index) > BRIDGE_LIMIT {
            return Err(self.too_long(first.clone()));
        }
        self.quality
            .first_fault
            .get_or_insert_with(|| fault.clone());
        self.bad.push(fault);
        Ok(())
    }

    /// Takes a good frame; everything held can be handed out after it.
    pub(super) fn good(&mut self, frame: FlightFrame) -> Result<()> {
        self.count_missing(frame.index);
        match (&self.last, self.bad.first()) {
            (Some(last), Some(first)) => {
                if frame.time - last.time > BRIDGE_LIMIT {
                    return Err(self.too_long(first.clone()));
                }
                for fault in &self.bad {
                    let time = self.time(fault.index);
                    let share = (time - last.time) / (frame.time - last.time);
                    self.ready
                        .push_back(between(last, &frame, fault.index, time, share));
                }
                self.quality.bridged_frames += self.bad.len() as u64;
            }
            _ => self.quality.dropped_frames += self.bad.len() as u64,
        }
        self.bad.clear();
        self.quality.good_frames += 1;
        self.ready.push_back(frame);
        self.last = Some(frame);
        Ok(())
    }

    /// Ends the input: no frame follows.
    pub(super) fn end(&mut self) -> Result<()> {
        if self.last.is_none()
            && let Some(first) = self.bad.first()
        {
            return Err(refusal(first).help("the file has no good frame: export it again"));
        }
        self.quality.dropped_frames += self.bad.len() as u64;
        self.bad.clear();
        Ok(())
    }

    fn too_long(&self, first: Fault) -> Problem {
        let count = self.bad.len();
        let problem = refusal(&first);
        let message = format!(
            "{}; a run of {count} bad frames starts here, longer than the {BRIDGE_LIMIT} s that can be bridged",
            problem.message
        );
        Problem { message, ..problem }
            .help("export the recording again, or cut it off before this frame")
    }
}

/// A bad frame as an error.
fn refusal(fault: &Fault) -> Problem {
    Problem::bad_input(fault.message.clone())
        .at_line(fault.line)
        .at(format!("frame {}, {}", fault.index, fault.element))
}

/// The frame at the fraction `share` (0 to 1) of the way from `a` to `b`.
fn between(a: &FlightFrame, b: &FlightFrame, index: u64, time: f64, share: f64) -> FlightFrame {
    let vector = |a: Vector<f64, Inertial>, b: Vector<f64, Inertial>| {
        Vector::from_components(a.components.lerp(&b.components, share))
    };
    let optional = |a: Option<Vector<f64, Inertial>>, b: Option<_>| Some(vector(a?, b?));
    let from = a.pelvis.inertial_from_body;
    let to = near(b.pelvis.inertial_from_body.quaternion(), from.quaternion());
    let attitude = Quaternion::from(from.quaternion().coords.lerp(&to.coords, share));
    FlightFrame {
        index,
        time,
        posture: a.posture.interpolated(&b.posture, share),
        pelvis: PelvisMotion {
            inertial_from_body: Rotation::from_quaternion(UnitQuaternion::new_normalize(attitude)),
            position: vector(a.pelvis.position, b.pelvis.position),
            velocity: optional(a.pelvis.velocity, b.pelvis.velocity),
            angular_velocity: optional(a.pelvis.angular_velocity, b.pelvis.angular_velocity),
        },
        centre_of_mass: optional(a.centre_of_mass, b.centre_of_mass),
        bridged: true,
    }
}
