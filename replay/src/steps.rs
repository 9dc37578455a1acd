//! A recording and the model side by side, step by step: a free run from the first frame, driven by the recorded
//! postures.

use std::collections::VecDeque;

use bodyflight_core::dynamics::{Dynamics, Motion};
use bodyflight_core::effect::Model;

use super::side_by_side::SideBySide;
pub use super::side_by_side::{DIVERGED_HELP, Divergence, Step, too_short};
use super::start::SMOOTHED_OVER;
use crate::Precision;
use crate::flight::{Flight, Start};
use crate::frames::Frames;
use crate::joint_change::JointChange;
use bodyflight_io::diagnostic::Result;
use bodyflight_mvnx::recording::{FlightFrame, Options, faults};

/// The steps of a flight, from the second frame on. `F` is the source of the frames.
pub struct Replay<'a, F> {
    frames: F,
    /// Frames already read to smooth the start, not yet replayed.
    read: VecDeque<FlightFrame>,
    ahead: Option<FlightFrame>,
    side_by_side: SideBySide<'a>,
}

impl<'a> Replay<'a, Frames> {
    /// Opens the recording of a flight.
    ///
    /// # Errors
    /// Returns an error if a file cannot be used, if there are fewer than two frames, or if the first frame has no
    /// velocity or angular velocity.
    pub fn open(flight: &'a Flight, options: Options, precision: Precision) -> Result<Self> {
        let frames = flight.open(options)?;
        Self::with_dynamics(flight, frames, precision, |height| flight.dynamics(height))
    }

    /// Like [`Replay::open`], with changes of joints, and with a given initial motion.
    ///
    /// # Errors
    /// Same as [`Replay::open`].
    pub fn open_changed(
        flight: &'a Flight,
        options: Options,
        precision: Precision,
        joints: &'a [JointChange],
        start: &Motion<f64>,
    ) -> Result<Self> {
        let mut frames = flight.open(options)?;
        let mut read = first_frames(flight, &mut frames)?;
        let first = read.make_contiguous();
        let dynamics = flight.dynamics(first[0].pelvis.position.up());
        let side_by_side =
            SideBySide::new(flight, precision, first, dynamics, joints, Some(start))?;
        Ok(Self::from(frames, read, side_by_side))
    }
}

impl Replay<'_, Frames> {
    /// The recording, with its header.
    pub fn recording(&self) -> &Frames {
        &self.frames
    }

    /// Why results so far cannot be trusted: faults of the recording, or a simulation that diverged.
    pub fn doubt(&self) -> Option<String> {
        faults(&self.frames.warnings()).or_else(|| self.diverged())
    }
}

impl<'a, F: Iterator<Item = Result<FlightFrame>>> Replay<'a, F> {
    /// Replays frames of a flight in double precision.
    ///
    /// # Errors
    /// Returns an error if there are fewer than two frames, or if the first frame has no velocity or angular velocity.
    pub fn new(flight: &'a Flight, frames: F) -> Result<Self> {
        let dynamics = |height| flight.dynamics(height);
        Self::with_dynamics(flight, frames, Precision::Double, dynamics)
    }

    /// Like [`Replay::new`], with other dynamics than the flight's, before effects are applied; `dynamics` is called
    /// with the height of the first frame (m, inertial).
    ///
    /// # Errors
    /// Same as [`Replay::new`].
    pub fn with_dynamics(
        flight: &'a Flight,
        mut frames: F,
        precision: Precision,
        dynamics: impl FnOnce(f64) -> Dynamics<f64>,
    ) -> Result<Self> {
        let mut read = first_frames(flight, &mut frames)?;
        let first = read.make_contiguous();
        let dynamics = dynamics(first[0].pelvis.position.up());
        let side_by_side = SideBySide::new(flight, precision, first, dynamics, &[], None)?;
        Ok(Self::from(frames, read, side_by_side))
    }

    /// Like [`Replay::new`], with changes of joints, and with a given initial motion.
    ///
    /// # Errors
    /// Same as [`Replay::new`].
    pub fn changed(
        flight: &'a Flight,
        mut frames: F,
        joints: &'a [JointChange],
        start: &Motion<f64>,
    ) -> Result<Self> {
        let mut read = first_frames(flight, &mut frames)?;
        let first = read.make_contiguous();
        let dynamics = flight.dynamics(first[0].pelvis.position.up());
        let precision = Precision::Double;
        let side_by_side =
            SideBySide::new(flight, precision, first, dynamics, joints, Some(start))?;
        Ok(Self::from(frames, read, side_by_side))
    }

    fn from(frames: F, mut read: VecDeque<FlightFrame>, side_by_side: SideBySide<'a>) -> Self {
        read.pop_front();
        let ahead = read.pop_front();
        Self {
            frames,
            read,
            ahead,
            side_by_side,
        }
    }

    /// Sets what happens if the simulation diverges.
    #[must_use]
    pub fn on_divergence(mut self, divergence: Divergence) -> Self {
        self.side_by_side.divergence = divergence;
        self
    }

    /// The first frame, with the initial motion of the model.
    pub const fn start(&self) -> &Step {
        &self.side_by_side.start
    }

    /// The model including its effects.
    pub const fn model(&self) -> &Model<f64> {
        &self.side_by_side.model
    }

    /// Why the simulation so far means nothing, if the model moved as no body does.
    pub fn diverged(&self) -> Option<String> {
        self.side_by_side.diverged()
    }

    /// The source of the frames.
    pub const fn frames(&self) -> &F {
        &self.frames
    }
}

impl<F: Iterator<Item = Result<FlightFrame>>> Iterator for Replay<'_, F> {
    type Item = Result<Step>;

    fn next(&mut self) -> Option<Self::Item> {
        let frame = self.ahead.take()?;
        let ahead = match self.read.pop_front() {
            Some(ahead) => Ok(Some(ahead)),
            None => self.frames.next().transpose(),
        };
        let step = ahead.and_then(|ahead| {
            self.ahead = ahead;
            self.side_by_side.advance(&frame, self.ahead.as_ref())
        });
        match step {
            Ok(step) => self.side_by_side.last = step,
            Err(_) => self.ahead = None,
        }
        Some(step)
    }
}

/// The first two frames, or as many as a smoothed start needs.
pub(crate) fn first_frames(
    flight: &Flight,
    frames: &mut impl Iterator<Item = Result<FlightFrame>>,
) -> Result<VecDeque<FlightFrame>> {
    let mut next = || {
        let frame = frames.next().transpose()?;
        frame.ok_or_else(|| too_short(&flight.recording))
    };
    let (first, second) = (next()?, next()?);
    let mut read = VecDeque::from([first, second]);
    if flight.start == Start::Smoothed {
        let is_enough = |last: &FlightFrame| last.time - first.time >= SMOOTHED_OVER - 1e-6;
        while !read.back().is_some_and(is_enough) {
            let Some(frame) = frames.next().transpose()? else {
                break;
            };
            read.push_back(frame);
        }
    }
    Ok(read)
}
