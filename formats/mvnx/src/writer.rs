//! Writes a flight as MVN does: version 4, six decimals, all 23 segments, calibration frames first.
//!
//! A file appears under its name only when it is complete: until [`Writer::finish`] it is a temporary file in the same
//! folder, which is removed if the writer is dropped.

mod document;
mod motion;

use std::io::Write;
use std::path::{Path, PathBuf};

use bodyflight_core::Body;

pub use self::document::{Description, Origin};
pub use self::motion::{Differences, MovingFrame, rotation_rate};
use crate::recording::FlightFrame;
use crate::xsens::skeleton::Layout;
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::files::AtomicFile;

/// Writes a recording frame by frame, in constant memory.
pub struct Writer<W: Write> {
    output: W,
    description: Description,
    layout: Layout,
    differences: Differences,
    path: PathBuf,
    last_index: Option<u64>,
}

impl Writer<AtomicFile> {
    /// Starts a recording of `body` in a file: header, skeleton and calibration.
    ///
    /// # Errors
    /// Returns an error if the folder cannot be written to, or the frame rate is not above 0.
    pub fn create(path: &Path, description: Description, body: &Body<f64>) -> Result<Self> {
        Self::new(AtomicFile::create(path)?, path, description, body)
    }

    /// Completes the file and moves it to its final name, replacing any file there.
    ///
    /// # Errors
    /// Returns an error if writing fails; no file is left then.
    pub fn finish(self) -> Result<()> {
        self.complete()?.finish()
    }
}

impl<W: Write> Writer<W> {
    /// Starts a recording of `body` in any output; `path` names it in messages.
    ///
    /// # Errors
    /// Returns an error if writing fails, or the frame rate is not above 0.
    pub fn new(
        mut output: W,
        path: &Path,
        description: Description,
        body: &Body<f64>,
    ) -> Result<Self> {
        let rate = description.frame_rate;
        if !(rate.is_finite() && rate > 0.0) {
            let message = format!("expected a frame rate above 0 Hz, found {rate}");
            return Err(Problem::bad_input(message).in_file(path));
        }
        let layout = Layout::new(body);
        document::header(&mut output, &description, &layout)
            .map_err(|error| Problem::system("write", path, error))?;
        Ok(Self {
            output,
            description,
            layout,
            differences: Differences::default(),
            path: path.to_path_buf(),
            last_index: None,
        })
    }

    /// Appends a frame. Its index, which must be greater than that of the previous frame, determines its time.
    ///
    /// Velocity and angular velocity of the pelvis are written as given; those of the other segments, and all
    /// accelerations, come from differences between frames.
    ///
    /// # Errors
    /// Returns an error if writing fails, an index does not increase, or a number is not finite.
    pub fn write(&mut self, frame: &FlightFrame) -> Result<()> {
        let problem = |message: &str| {
            Problem::bad_input(message)
                .in_file(&self.path)
                .at(format!("frame {}", frame.index))
        };
        if let Some(last) = self.last_index
            && frame.index <= last
        {
            return Err(problem(&format!("expected an index above {last}")));
        }
        let pelvis = &frame.pelvis;
        let placed = self
            .layout
            .place(pelvis.inertial_from_body, pelvis.position, &frame.posture);
        let rates = [
            pelvis.velocity,
            pelvis.angular_velocity,
            frame.centre_of_mass,
        ];
        let finite = placed.iter().all(|segment| {
            segment.position.iter().all(|c| c.is_finite())
                && segment.orientation.coords.iter().all(|c| c.is_finite())
        }) && rates.iter().flatten().all(|vector| vector.is_finite());
        if !finite || !frame.posture.is_valid() {
            return Err(problem(
                "the flight has a number that is not finite here; nothing is written",
            ));
        }
        self.last_index = Some(frame.index);
        #[expect(clippy::cast_precision_loss, reason = "indices count frames")]
        let time = frame.index as f64 / self.description.frame_rate;
        match self.differences.push(frame, time, placed) {
            Some(moving) => self.put(&moving),
            None => Ok(()),
        }
    }

    /// Writes what follows the frames and returns the output.
    ///
    /// # Errors
    /// Returns an error if writing fails.
    pub fn complete(mut self) -> Result<W> {
        if let Some(moving) = self.differences.last() {
            self.put(&moving)?;
        }
        document::tail(&mut self.output)
            .and_then(|()| self.output.flush())
            .map_err(|error| Problem::system("write", &self.path, error))?;
        Ok(self.output)
    }

    fn put(&mut self, moving: &MovingFrame) -> Result<()> {
        document::frame(&mut self.output, &self.description, moving)
            .map_err(|error| Problem::system("write", &self.path, error))
    }
}
