//! Describes a recording without simulating it.

mod accelerations;
pub(crate) mod activity;
pub mod flight;
pub mod picture;

use std::fmt;
use std::io::BufRead;
use std::path::Path;

use bodyflight_core::Body;
use serde::Serialize;

use accelerations::Accelerations;
use bodyflight_io::diagnostic::Result;
use bodyflight_io::input::STANDARD_INPUT;
use bodyflight_io::progress;
use bodyflight_mvnx::closure::Skeleton;
use bodyflight_mvnx::recording::{self, CLOSURE_LIMIT, Warning, faults};
use bodyflight_mvnx::{ArmFrame, Fault, Field, Fields, Frame, ReadOptions, Reader};
use flight::FlightReport;

/// Most bad frames and markers listed one by one.
const LIST_LIMIT: usize = 100;
/// Number of frames from which the arm frame is detected, besides those of the calibration.
const FRAMES_FOR_ARMS: usize = 8;

/// Contents of a recording.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Report {
    /// Always `mvnx`.
    pub format: &'static str,
    /// Version of the format.
    pub version: u32,
    /// Version of MVN that wrote the file.
    pub mvn_version: Option<String>,
    /// Name of the subject.
    pub subject_label: Option<String>,
    /// Date as written in the file.
    pub recorded: Option<String>,
    /// Sensor configuration.
    pub configuration: Option<String>,
    /// Frame rate (Hz).
    pub frame_rate_hz: f64,
    /// Normal frames, good and bad.
    pub frames: u64,
    /// From the first to the last frame (s).
    pub duration_s: f64,
    /// Number of segments.
    pub segments: usize,
    /// Number of sensors; 0 if not listed.
    pub sensors: usize,
    /// Calibration frames.
    pub calibration_frames: usize,
    /// Convention of the arms, `t-pose` or `isb`; null if there are no joints to detect it from.
    pub arm_frame: Option<&'static str>,
    /// Largest distance between the two sides of a joint in the whole file (m), in the detected convention.
    pub closure_error_m: Option<f64>,
    /// Names of the elements in the frames.
    pub fields: Vec<String>,
    /// Places where the frame index jumps.
    pub gaps: u64,
    /// Frames missing in those gaps.
    pub missing_frames: u64,
    /// Frames whose numbers are unusable.
    pub bad_frames: u64,
    /// The first of the bad frames.
    pub bad_frame_list: Vec<BadFrame>,
    /// The first events marked in the recording.
    pub markers: Vec<Marker>,
    /// Whether the file is truncated.
    pub truncated: bool,
    /// What the import of a file of another system found; empty for a recording.
    pub notes: Vec<String>,
    /// The recording as a flight, if it is one.
    pub flight: Option<FlightReport>,
    /// What kind of recording this is, and whether it can be used, in a sentence.
    pub verdict: String,
    /// Why a recording of a whole body cannot be read as a flight.
    #[serde(skip)]
    unusable: Option<String>,
}

impl Report {
    /// Why results from this recording cannot be trusted, `None` if nothing contradicts it.
    pub fn doubt(&self) -> Option<String> {
        let Some(flight) = &self.flight else {
            return self.unusable.clone();
        };
        faults(&flight.warnings)
    }

    pub(crate) fn judged(mut self, not_a_flight: Option<String>) -> Self {
        let does = self.flight.as_ref().and_then(|flight| flight.activity);
        let body = format!(
            "the body {} for most of the time",
            does.unwrap_or("does nothing known")
        );
        // A recording of a part of the body is sound; one of the whole body that cannot be used is not.
        let is_open = self
            .closure_error_m
            .is_some_and(|error| error > CLOSURE_LIMIT);
        if self.flight.is_none() && (is_open || self.bad_frames > 0) {
            self.unusable.clone_from(&not_a_flight);
        }
        self.verdict = match (&self.flight, self.doubt(), not_a_flight) {
            (_, Some(doubt), _) => format!("doubtful: {doubt}"),
            (None, _, Some(why)) => format!("not a full-body motion: {why}"),
            (None, _, None) => "not judged".to_owned(),
            (Some(flight), None, _) if flight.warnings.is_empty() => {
                format!("consistent; {body}")
            }
            (Some(_), None, _) => format!("usable with the warnings above; {body}"),
        };
        self
    }
}

/// A frame whose numbers are unusable.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct BadFrame {
    /// Index of the frame.
    pub index: u64,
    /// Line in the file, from 1.
    pub line: u64,
    /// The element at fault.
    pub element: &'static str,
    /// What was found and what was expected.
    pub message: String,
}

impl From<Fault> for BadFrame {
    fn from(fault: Fault) -> Self {
        Self {
            index: fault.index,
            line: fault.line,
            element: fault.element,
            message: fault.message,
        }
    }
}

/// An event marked in the recording.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Marker {
    /// Time since frame 0 (s).
    pub time_s: f64,
    /// Name of the event.
    pub name: String,
}

/// Reads a whole recording and describes it. With a person, also compares MVN's centre of mass with that of the model's
/// body. A truncated file is reported, not refused.
///
/// # Errors
/// Returns an error if the file cannot be read or is not a recording.
pub fn inspect(path: &Path, person: Option<&Body<f64>>) -> Result<Report> {
    let (mut report, accelerations) = inspect_reader(Reader::open(path, options())?)?;
    // Standard input cannot be read twice, and not every recording is a flight.
    if path != Path::new(STANDARD_INPUT) {
        return Ok(match flight::inspected(path, person) {
            Ok(mut flight) => {
                flight.warnings.extend(accelerations);
                report.flight = Some(flight);
                report.judged(None)
            }
            Err(problem) => report.judged(Some(problem.message)),
        });
    }
    Ok(report)
}

/// Same as [`inspect`], for any input.
///
/// # Errors
/// Returns an error if the input cannot be read or is not a recording.
pub fn inspect_input(input: impl BufRead + Send, path: &Path) -> Result<Report> {
    Ok(inspect_reader(Reader::new(input, path, options())?)?.0)
}

fn options() -> ReadOptions {
    ReadOptions {
        fields: Fields::ALL,
        allow_truncated: true,
    }
}

/// What is in a file, and what contradicts its accelerations.
fn inspect_reader(mut reader: Reader<'_>) -> Result<(Report, Option<Warning>)> {
    let skeleton = Skeleton::of(reader.header());
    let pelvis = reader.header().segment_index("Pelvis");
    let mut survey = Survey::new(reader.header().frame_rate);
    let mut frame = Frame::default();
    let mut first_frames = Vec::with_capacity(FRAMES_FOR_ARMS);
    while reader.next_frame(&mut frame)? {
        if first_frames.len() < FRAMES_FOR_ARMS && frame.fault.is_none() {
            first_frames.push(frame.clone());
        }
        if let Some((place, velocity)) = pelvis
            .filter(|_| frame.fault.is_none())
            .and_then(|place| Some((place, frame.vector(Field::Velocity, place)?)))
        {
            let acceleration = frame.vector(Field::Acceleration, place);
            let time = survey.time(frame.index);
            (survey.accelerations).see(time, &velocity, acceleration.as_ref());
        }
        survey.take(&mut frame, skeleton.as_ref());
        if frame.index.is_multiple_of(1024) {
            progress::at(survey.time(frame.index))?;
        }
    }
    let arms = skeleton.as_ref().and_then(|skeleton| {
        recording::arm_frame(skeleton, reader.calibration(), first_frames.iter())
    });
    let header = reader.header();
    let accelerations = survey.accelerations.warning();
    let report = Report {
        format: "mvnx",
        version: header.version,
        mvn_version: header.mvn_version.clone(),
        subject_label: header.subject_label.clone(),
        recorded: header.recorded.clone(),
        configuration: header.configuration.clone(),
        frame_rate_hz: header.frame_rate,
        frames: survey.frames,
        duration_s: survey.duration(),
        segments: header.segments.len(),
        sensors: header.sensors.len(),
        calibration_frames: reader.calibration().len(),
        arm_frame: arms.map(|(arms, _)| arms.name()),
        closure_error_m: arms.map(|(arms, error)| error.max(survey.closure[arms as usize])),
        fields: reader.elements(),
        gaps: survey.gaps,
        missing_frames: survey.missing_frames,
        bad_frames: survey.bad_frames,
        bad_frame_list: survey.bad_frame_list,
        markers: survey.markers,
        truncated: reader.is_truncated(),
        notes: Vec::new(),
        flight: None,
        verdict: "not judged".to_owned(),
        unusable: None,
    };
    Ok((report, accelerations))
}

/// Data collected frame by frame.
struct Survey {
    frame_rate: f64,
    frames: u64,
    ends: Option<(u64, u64)>,
    gaps: u64,
    missing_frames: u64,
    bad_frames: u64,
    bad_frame_list: Vec<BadFrame>,
    markers: Vec<Marker>,
    /// Closure error in each convention (m).
    closure: [f64; 2],
    accelerations: Accelerations,
}

impl Survey {
    fn new(frame_rate: f64) -> Self {
        Self {
            frame_rate,
            frames: 0,
            ends: None,
            gaps: 0,
            missing_frames: 0,
            bad_frames: 0,
            bad_frame_list: Vec::new(),
            markers: Vec::new(),
            closure: [0.0; 2],
            accelerations: Accelerations::default(),
        }
    }

    fn take(&mut self, frame: &mut Frame, skeleton: Option<&Skeleton>) {
        self.frames += 1;
        let (first, last) = self.ends.unwrap_or((frame.index, frame.index));
        let missing = frame.index.saturating_sub(last).saturating_sub(1);
        self.gaps += u64::from(missing > 0);
        self.missing_frames += missing;
        self.ends = Some((first, frame.index));
        if let Some(name) = frame.marker.take()
            && self.markers.len() < LIST_LIMIT
        {
            let time_s = self.time(frame.index);
            self.markers.push(Marker { time_s, name });
        }
        if let Some(fault) = frame.fault.take() {
            self.bad_frames += 1;
            if self.bad_frame_list.len() < LIST_LIMIT {
                self.bad_frame_list.push(fault.into());
            }
            return;
        }
        let (orientation, position) = (Field::Orientation, Field::Position);
        if let (Some(skeleton), Some(orientation), Some(position)) = (
            skeleton,
            frame.numbers(orientation),
            frame.numbers(position),
        ) {
            for arms in [ArmFrame::TPose, ArmFrame::Isb] {
                let error = skeleton.closure_error(orientation, position, arms);
                let largest = &mut self.closure[arms as usize];
                *largest = largest.max(error);
            }
        }
    }

    #[expect(
        clippy::cast_precision_loss,
        reason = "the reader keeps indices below 2^53"
    )]
    fn time(&self, index: u64) -> f64 {
        index as f64 / self.frame_rate
    }

    fn duration(&self) -> f64 {
        self.ends
            .map_or(0.0, |(first, last)| self.time(last - first))
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let unknown = || "unknown".to_owned();
        let text = |value: &Option<String>| value.clone().unwrap_or_else(unknown);
        writeln!(f, "format          MVNX version {}", self.version)?;
        writeln!(f, "MVN version     {}", text(&self.mvn_version))?;
        writeln!(f, "subject         {}", text(&self.subject_label))?;
        writeln!(f, "recorded        {}", text(&self.recorded))?;
        writeln!(f, "configuration   {}", text(&self.configuration))?;
        writeln!(
            f,
            "frames          {} in {:.3} s at {} Hz",
            self.frames, self.duration_s, self.frame_rate_hz
        )?;
        writeln!(
            f,
            "segments        {}, sensors {}, calibration frames {}",
            self.segments, self.sensors, self.calibration_frames
        )?;
        match (self.arm_frame, self.closure_error_m) {
            (Some(arms), Some(error)) => {
                writeln!(f, "arm frame       {arms}, joints close to {error:.6} m")?;
            }
            _ => writeln!(
                f,
                "arm frame       unknown: there are no joints to detect it from"
            )?,
        }
        writeln!(f, "fields          {}", self.fields.join(", "))?;
        writeln!(
            f,
            "gaps            {}, with {} frames missing",
            self.gaps, self.missing_frames
        )?;
        writeln!(f, "bad frames      {}", self.bad_frames)?;
        for bad in &self.bad_frame_list {
            let BadFrame {
                index,
                line,
                element,
                message,
            } = bad;
            writeln!(f, "  line {line}, frame {index}, {element}: {message}")?;
        }
        for marker in &self.markers {
            writeln!(f, "marker          {:.3} s {}", marker.time_s, marker.name)?;
        }
        for note in &self.notes {
            writeln!(f, "import          {note}")?;
        }
        if let Some(flight) = &self.flight {
            write!(f, "{flight}")?;
        }
        if self.truncated {
            writeln!(f, "the file ends too early: its last frame is incomplete")?;
        }
        writeln!(f, "verdict         {}", self.verdict)
    }
}
