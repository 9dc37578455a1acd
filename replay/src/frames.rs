//! The frames of a flight: those of its recording, with a receiver's velocities if the flight has a track.

use std::ops::Deref;
use std::path::Path;

use bodyflight_core::Body;
use bodyflight_falls::channels::{Checked, Remedy, checked};
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_mvnx::recording::{FlightFrame, Options, Recording, Warning, faults};

use crate::gnss::{Alignment, Solution, aligned, placed};
use crate::person;
use crate::support::Support;

/// A flight's recording, frame by frame.
pub struct Frames {
    recording: Recording<'static>,
    alignment: Option<Alignment>,
    /// Velocities as the receiver measured them, if there is a track.
    solutions: Option<Vec<Solution>>,
    /// What the recording says against the person of the flight.
    other_person: Vec<Warning>,
    /// What is implausible in the files about it: a track, the air, coefficients.
    of_files: Vec<Warning>,
    support: Support,
    /// Times of the first and the last row of the known inputs (s), if there are several.
    inputs: Option<[f64; 2]>,
    /// Index and time (s) of the first and the last frame read.
    read: Option<[(u64, f64); 2]>,
}

/// Time by which inputs may be shorter than a flight (s); a filter's estimates come this late.
const SHORTER: f64 = 1.0;

/// A receiver's track of a flight.
#[derive(Debug, Clone, Copy)]
pub struct Track<'a> {
    /// Its file.
    pub path: &'a Path,
    /// How long after its first row the recording begins (s); otherwise the velocities of both tell.
    pub begin_s: Option<f64>,
}

/// What is said of a receiver's track whose channels contradict each other; it is a fault if they cannot be mended.
fn said(track: &Checked) -> Vec<Warning> {
    let said = track.findings.iter().map(|finding| Warning {
        is_fault: track.motion.is_doubted && finding.remedy == Remedy::Reported,
        ..Warning::new(0, format!("of the track, {}", finding.sentence))
    });
    said.collect()
}

impl Frames {
    /// Opens a recording. If there is a receiver's track, its clock is first aligned with the recording's.
    ///
    /// # Errors
    /// Returns an error if a file cannot be used, or the clocks cannot be aligned.
    pub fn open(recording: &Path, track: Option<Track<'_>>, options: Options) -> Result<Self> {
        let mut frames = Recording::open(recording, options)?;
        let (mut alignment, mut solutions) = (None, None);
        let mut of_files = Vec::new();
        if let Some(Track { path, begin_s }) = track {
            let track = bodyflight_tracks::read(path)?;
            let all = frames.collect::<Result<Vec<_>>>()?;
            // Channels in other units or without signs would fit no recording.
            let checked = checked(&track.samples, track.given);
            of_files = said(&checked);
            let aligned = match begin_s {
                Some(begin_s) => placed(&all, &checked.samples, begin_s),
                None => aligned(&all, &checked.samples),
            };
            let aligned = aligned.map_err(|problem| problem.in_file(path))?;
            alignment = Some(aligned.alignment);
            solutions = Some(aligned.solutions(&track.speed_accuracy, track.given.velocities));
            let velocities = Box::new(move |time| aligned.velocity_at(time));
            frames = Recording::open(recording, options)?.with_velocities(velocities);
        }
        Ok(Self {
            recording: frames,
            alignment,
            solutions,
            other_person: Vec::new(),
            of_files,
            support: Support::default(),
            inputs: None,
            read: None,
        })
    }

    /// Compares the recorded person with a body, which is `stated` in a file or else assumed.
    #[must_use]
    pub fn of_person(mut self, body: &Body<f64>, stated: bool) -> Self {
        self.other_person = person::compared(self.header(), body, stated);
        self
    }

    /// Says what is implausible about the air and the coefficients.
    #[must_use]
    pub(crate) fn with_doubts(mut self, doubts: Vec<Warning>) -> Self {
        self.of_files.extend(doubts);
        self
    }

    /// Says that the air moves at this velocity (m/s, inertial).
    #[must_use]
    pub fn in_air(mut self, velocity: [f64; 3]) -> Self {
        self.support = Support::in_air(velocity);
        self.recording = self.recording.in_air(velocity);
        self
    }

    /// Says when the known inputs begin and end (s).
    #[must_use]
    pub fn with_inputs(mut self, ends: Option<[f64; 2]>) -> Self {
        // A single row is meant for the whole flight.
        self.inputs = ends.filter(|[first, last]| first < last);
        self
    }

    /// What part of the frames read the known inputs do not cover.
    fn uncovered(&self) -> Option<Warning> {
        let ([first, last], [begin, end]) = (self.inputs?, self.read?);
        let (frame, message) = if last + SHORTER < end.1 {
            let missing = end.1 - last;
            (
                end.0,
                format!(
                    "the inputs end at {last:.2} s, {missing:.1} s before the flight; their last row holds from there on"
                ),
            )
        } else if begin.1 + SHORTER < first {
            let missing = first - begin.1;
            (
                begin.0,
                format!(
                    "the inputs begin at {first:.2} s, {missing:.1} s after the flight; their first row holds before"
                ),
            )
        } else {
            return None;
        };
        Some(Warning::new(frame, message))
    }

    /// What contradicts a fall: a body that something carries, or that falls faster than gravity lets it.
    pub fn of_fall(&self) -> Vec<Warning> {
        self.support.warnings()
    }

    /// What is implausible about the person.
    pub fn of_subject(&self) -> &[Warning] {
        &self.other_person
    }

    /// Whatever is implausible in the recording of another system itself, see [`Recording::warnings_of_import`].
    pub fn of_import(&self) -> Vec<Warning> {
        self.recording.warnings_of_import()
    }

    /// All frames of a recording that is trusted, and what is said about it all the same: whatever is fitted to one that is
    /// not means nothing.
    ///
    /// # Errors
    /// Returns an error if the recording cannot be read, or contradicts itself or the files about it.
    pub fn trusted(mut self, path: &Path) -> Result<(Vec<FlightFrame>, Vec<Warning>)> {
        let frames = self.by_ref().collect::<Result<Vec<_>>>()?;
        let warnings = self.warnings();
        match faults(&warnings) {
            Some(doubt) => Err(Problem::doubt(format!(
                "nothing is fitted to this flight: {doubt}"
            ))
            .in_file(path)),
            None => Ok((frames, warnings)),
        }
    }

    /// Whatever is implausible in the frames read so far, see [`Recording::warnings`], a person of other lengths, a
    /// body that does not fall, and inputs that do not cover the flight.
    pub fn warnings(&self) -> Vec<Warning> {
        let mut warnings = self.recording.warnings();
        warnings.extend(self.other_person.clone());
        warnings.extend(self.of_files.clone());
        warnings.extend(self.support.warnings());
        warnings.extend(self.uncovered());
        warnings
    }

    /// The receiver's solutions in order of time, if there is a track: the velocities of all frames in between are
    /// interpolated.
    pub fn solutions(&self) -> Option<&[Solution]> {
        self.solutions.as_deref()
    }

    /// How the track was aligned with the recording's clock, if there is a track.
    pub fn alignment(&self) -> Option<Alignment> {
        self.alignment
    }
}

impl Deref for Frames {
    type Target = Recording<'static>;

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
            let now = (frame.index, frame.time);
            self.read = Some([self.read.map_or(now, |[first, _]| first), now]);
        }
        frame
    }
}
