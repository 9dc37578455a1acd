//! The frames of a flight: those of its recording, with a receiver's velocities if the flight has a track.

use std::ops::Deref;
use std::path::Path;

use bodyflight_falls::channels::checked;
use bodyflight_io::diagnostic::Result;
use bodyflight_io::input::Input;
use bodyflight_mvnx::recording::{FlightFrame, Options, Recording};

use crate::gnss::{Alignment, aligned};

/// A flight's recording, frame by frame.
pub struct Frames {
    recording: Recording<Input>,
    alignment: Option<Alignment>,
}

impl Frames {
    /// Opens a recording. If there is a receiver's track, its clock is first aligned with the recording's.
    ///
    /// # Errors
    /// Returns an error if a file cannot be used, or the clocks cannot be aligned.
    pub fn open(recording: &Path, track: Option<&Path>, options: Options) -> Result<Self> {
        let frames = Recording::open(recording, options)?;
        let Some(path) = track else {
            return Ok(Self {
                recording: frames,
                alignment: None,
            });
        };
        let track = bodyflight_tracks::read(path)?;
        let frames = frames.collect::<Result<Vec<_>>>()?;
        // Channels in other units or without signs would fit no recording.
        let samples = checked(&track.samples, track.given).samples;
        let track = aligned(&frames, &samples).map_err(|problem| problem.in_file(path))?;
        let alignment = Some(track.alignment);
        let velocities = Box::new(move |time| track.velocity_at(time));
        Ok(Self {
            recording: Recording::open(recording, options)?.with_velocities(velocities),
            alignment,
        })
    }

    /// How the track was aligned with the recording's clock, if there is a track.
    pub fn alignment(&self) -> Option<Alignment> {
        self.alignment
    }
}

impl Deref for Frames {
    type Target = Recording<Input>;

    fn deref(&self) -> &Self::Target {
        &self.recording
    }
}

impl Iterator for Frames {
    type Item = Result<FlightFrame>;

    fn next(&mut self) -> Option<Self::Item> {
        self.recording.next()
    }
}
