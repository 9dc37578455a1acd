//! Saves frames as they arrive. Their rate is determined on the way, and the recording is complete however it ends.

use std::path::{Path, PathBuf};

use bodyflight_core::Body;
use serde::Serialize;

use super::writer::{Description, Origin, Writer};
use crate::recording::FlightFrame;
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::files::AtomicFile;

/// Time after which the rate of the frames is known (s): by then, time codes in milliseconds are accurate to a
/// thousandth.
const SETTLING: f64 = 2.0;
/// Rates of MVN (Hz).
const RATES: [f64; 6] = [240.0, 120.0, 100.0, 80.0, 60.0, 50.0];
/// Largest relative difference at which a measured rate is rounded to one of these.
const NEAR: f64 = 0.02;
/// Rate assumed if it cannot be determined, as from a single frame (Hz).
const USUAL_RATE: f64 = RATES[0];

/// The recording that was saved.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Kept {
    /// Number of frames in it.
    pub file: PathBuf,
    /// Frames in it.
    pub frames: u64,
    /// Its rate (Hz).
    pub frame_rate_hz: f64,
    /// Frames left out: the sender had restarted, and they belong to another flight.
    pub left_out: u64,
}

/// A recording of frames as they arrive.
///
/// Frames keep their numbers, counted from the first, so frames lost on the way are gaps in the recording too.
pub struct LiveRecording {
    path: PathBuf,
    body: Body<f64>,
    label: String,
    /// Frames held until the rate is known.
    waiting: Vec<FlightFrame>,
    writer: Option<(Writer<AtomicFile>, f64)>,
    first: u64,
    last: Option<u64>,
    /// Whether the sender's frame numbers went backwards.
    ended: bool,
    frames: u64,
    left_out: u64,
}

impl LiveRecording {
    /// Prepares a recording of `body`; nothing is written before the first frame.
    ///
    /// # Errors
    /// Returns an error if the name does not end in `.mvnx`.
    pub fn new(path: &Path, body: Body<f64>) -> Result<Self> {
        if path.extension().is_none_or(|end| end != "mvnx") {
            return Err(Problem::bad_input("expected a name that ends in .mvnx").in_file(path));
        }
        Ok(Self {
            path: path.to_path_buf(),
            body,
            label: "Live".to_owned(),
            waiting: Vec::new(),
            writer: None,
            first: 0,
            last: None,
            ended: false,
            frames: 0,
            left_out: 0,
        })
    }

    /// Sets the name of the person; it has no effect once the file has been started.
    pub fn name(&mut self, label: &str) {
        label.clone_into(&mut self.label);
    }

    /// Adds a frame.
    ///
    /// # Errors
    /// Returns an error if writing fails or the frame has a number that is not finite.
    pub fn push(&mut self, frame: &FlightFrame) -> Result<()> {
        self.ended |= self.last.is_some_and(|last| frame.index <= last);
        if self.ended {
            self.left_out += 1;
            return Ok(());
        }
        if self.last.is_none() {
            self.first = frame.index;
        }
        self.last = Some(frame.index);
        if self.writer.is_some() {
            return self.write(frame);
        }
        self.waiting.push(*frame);
        let begun = self.waiting.first().map_or(0.0, |first| first.time);
        if frame.time - begun < SETTLING {
            return Ok(());
        }
        self.begin()
    }

    /// Completes the file; `None` if no frame arrived.
    ///
    /// # Errors
    /// Returns an error if writing fails; no file is left then.
    pub fn finish(mut self) -> Result<Option<Kept>> {
        if self.last.is_none() {
            return Ok(None);
        }
        if self.writer.is_none() {
            self.begin()?;
        }
        let Some((writer, frame_rate_hz)) = self.writer else {
            return Ok(None);
        };
        writer.finish()?;
        Ok(Some(Kept {
            file: self.path,
            frames: self.frames,
            frame_rate_hz,
            left_out: self.left_out,
        }))
    }

    fn begin(&mut self) -> Result<()> {
        let rate = rate(&self.waiting);
        let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
        let description = Description {
            subject_label: self.label.clone(),
            frame_rate: rate,
            start_unix_ms: now.map_or(0, |now| u64::try_from(now.as_millis()).unwrap_or(0)),
            comment: "bodyflight, live".to_owned(),
            origin: Origin::Live,
        };
        self.writer = Some((Writer::create(&self.path, description, &self.body)?, rate));
        for frame in std::mem::take(&mut self.waiting) {
            self.write(&frame)?;
        }
        Ok(())
    }

    fn write(&mut self, frame: &FlightFrame) -> Result<()> {
        let Some((writer, _)) = &mut self.writer else {
            return Ok(());
        };
        self.frames += 1;
        writer.write(&FlightFrame {
            index: frame.index - self.first,
            ..*frame
        })
    }
}

/// Frame rate (Hz) from the numbers and times of the frames; one of MVN's rates if it is near one.
fn rate(frames: &[FlightFrame]) -> f64 {
    let (Some(first), Some(last)) = (frames.first(), frames.last()) else {
        return USUAL_RATE;
    };
    #[expect(clippy::cast_precision_loss, reason = "few frames in a few seconds")]
    let found = (last.index - first.index) as f64 / (last.time - first.time);
    if !(found.is_finite() && found >= 1.0) {
        return USUAL_RATE;
    }
    let near = |rate: &&f64| (found / **rate - 1.0).abs() < NEAR;
    let known = RATES.iter().find(near).copied();
    known.unwrap_or((found * 10.0).round() / 10.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use bodyflight_core::Posture;
    use bodyflight_core::body::anthropometry::{Person, Sex};
    use bodyflight_core::dynamics::Motion;
    use bodyflight_core::frame::{Rotation, Vector};

    use crate::recording::{Options, Recording};

    fn body() -> Body<f64> {
        Person::new(1.75, 75.0, Sex::Male).body().unwrap()
    }

    fn frame(index: u64, rate: f64) -> FlightFrame {
        let motion = Motion {
            inertial_from_body: Rotation::identity(),
            position: Vector::zero(),
            velocity: Vector::new(0.0, 0.0, -50.0),
            angular_velocity: Vector::zero(),
        };
        // Time codes truncated to milliseconds.
        let time = (index as f64 / rate * 1000.0).floor() / 1000.0;
        FlightFrame::from_motion(index, time, Posture::h_pose(), &motion)
    }

    fn kept(frames: impl Iterator<Item = FlightFrame>) -> (Kept, Vec<FlightFrame>) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("live.mvnx");
        let mut live = LiveRecording::new(&path, body()).unwrap();
        for frame in frames {
            live.push(&frame).unwrap();
        }
        let kept = live.finish().unwrap().unwrap();
        let recording = Recording::open(&path, Options::default()).unwrap();
        (kept, recording.map(Result::unwrap).collect())
    }

    #[test]
    fn the_rate_is_found_and_gaps_stay_gaps() {
        for rate in [240.0, 60.0, 33.3] {
            let come = (1000..1400).filter(|index| index % 50 != 7);
            let (kept, frames) = kept(come.map(|index| frame(index, rate)));
            assert!((kept.frame_rate_hz / rate - 1.0).abs() < 2e-3, "{kept:?}");
            assert_eq!((kept.frames, kept.left_out), (392, 0));
            assert_eq!(frames.len(), 392);
            assert_eq!(frames.first().unwrap().index, 0);
            assert_eq!(frames.last().unwrap().index, 399);
        }
    }

    #[test]
    fn a_short_flight_is_kept_but_not_a_second_one() {
        let again = (0..20).map(|index| frame(index, 240.0));
        let all = (500..530).map(|index| frame(index, 240.0)).chain(again);
        let (kept, frames) = kept(all);
        assert_eq!((kept.frames, kept.left_out), (30, 20));
        assert_eq!(frames.len(), 30);
    }

    #[test]
    fn nothing_is_written_if_nothing_was_received() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("live.mvnx");
        let live = LiveRecording::new(&path, body()).unwrap();
        assert_eq!(live.finish().unwrap(), None);
        assert!(!path.exists());
        assert!(LiveRecording::new(&folder.path().join("live.csv"), body()).is_err());
    }
}
