//! The frames of a flight: those of its recording, with a receiver's velocities if the flight has a track.

use std::ops::Deref;
use std::path::Path;

use bodyflight_core::Body;
use bodyflight_falls::channels::checked;
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::input::Input;
use bodyflight_mvnx::recording::{FlightFrame, Options, Recording, Warning, faults};

use crate::gnss::{Alignment, aligned};
use crate::person;
use crate::support::Support;

/// A flight's recording, frame by frame.
pub struct Frames {
    recording: Recording<Input>,
    alignment: Option<Alignment>,
    /// What the recording says against the person of the flight.
    other_person: Option<Warning>,
    support: Support,
}

impl Frames {
    /// Opens a recording. If there is a receiver's track, its clock is first aligned with the recording's.
    ///
    /// # Errors
    /// Returns an error if a file cannot be used, or the clocks cannot be aligned.
    pub fn open(recording: &Path, track: Option<&Path>, options: Options) -> Result<Self> {
        let mut frames = Recording::open(recording, options)?;
        let mut alignment = None;
        if let Some(path) = track {
            let track = bodyflight_tracks::read(path)?;
            let all = frames.collect::<Result<Vec<_>>>()?;
            // Channels in other units or without signs would fit no recording.
            let samples = checked(&track.samples, track.given).samples;
            let track = aligned(&all, &samples).map_err(|problem| problem.in_file(path))?;
            alignment = Some(track.alignment);
            let velocities = Box::new(move |time| track.velocity_at(time));
            frames = Recording::open(recording, options)?.with_velocities(velocities);
        }
        Ok(Self {
            recording: frames,
            alignment,
            other_person: None,
            support: Support::default(),
        })
    }

    /// Compares the recorded person with a body, which is `stated` in a file or else assumed.
    #[must_use]
    pub fn of_person(mut self, body: &Body<f64>, stated: bool) -> Self {
        self.other_person = person::compared(self.header(), body, stated);
        self
    }

    /// Says that the air moves at this velocity (m/s, inertial).
    #[must_use]
    pub fn in_air(mut self, velocity: [f64; 3]) -> Self {
        self.support = Support::in_air(velocity);
        self
    }

    /// Whatever is implausible in the recording itself, see [`Recording::warnings`].
    pub fn of_recording(&self) -> Vec<Warning> {
        self.recording.warnings()
    }

    /// All frames of a recording that is trusted: whatever is fitted to one that is not means nothing.
    ///
    /// # Errors
    /// Returns an error if the recording cannot be read, or contradicts itself or the files about it.
    pub fn trusted(mut self, path: &Path) -> Result<Vec<FlightFrame>> {
        let frames = self.by_ref().collect::<Result<Vec<_>>>()?;
        match faults(&self.warnings()) {
            Some(doubt) => Err(Problem::doubt(format!(
                "nothing is fitted to this flight: {doubt}"
            ))
            .in_file(path)),
            None => Ok(frames),
        }
    }

    /// Whatever is implausible in the frames read so far, see [`Recording::warnings`], a person of other lengths, and a
    /// body that does not fall.
    pub fn warnings(&self) -> Vec<Warning> {
        let mut warnings = self.recording.warnings();
        warnings.extend(self.other_person.clone());
        warnings.extend(self.support.warning());
        warnings
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
        let frame = self.recording.next();
        if let Some(Ok(frame)) = &frame {
            self.support.see(frame);
        }
        frame
    }
}
