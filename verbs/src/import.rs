//! `bodyflight import`: the motion of another system as a recording, with a picture of its first frame.

mod print;
pub mod sensors;

use std::path::{Path, PathBuf};

use bodyflight_core::frame::Vector;
use bodyflight_core::{Body, Segment};
use nalgebra::Vector3;
use serde::Serialize;

use crate::output::limbs;
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::files::write_file;
use bodyflight_io::interrupt;
use bodyflight_mocap::mapping::Mapping;
use bodyflight_mocap::slip as mocap;
use bodyflight_mocap::source::Source;
use bodyflight_mvnx::recording::{FlightFrame, Options, PelvisMotion, Warning};
use bodyflight_mvnx::writer::{Description, Origin, Writer};
use bodyflight_replay::frames::Frames;
use bodyflight_replay::person::disproportionate;
use bodyflight_replay::subject::{SEGMENTS_FILE, Subject};

use crate::inspect::activity::Activities;
use crate::inspect::picture::first_frame;

/// Name of the picture file.
const PICTURE_FILE: &str = "first-frame.svg";
/// Name of the recording file.
pub(crate) const RECORDING_FILE: &str = "flight.mvnx";
/// Files that are written; the segments only if the subject has its own table.
pub const FILES: &[&str] = &[
    "flight.toml",
    "subject.toml",
    SEGMENTS_FILE,
    RECORDING_FILE,
    PICTURE_FILE,
];
/// Relative difference allowed between the thigh lengths of source and subject.
const THIGH: f64 = 0.15;
/// Lowest frame rate that can follow a body in flight (Hz).
const SLOW: f64 = 50.0;

/// What to import.
#[derive(Debug, Clone)]
pub struct Request<'a> {
    /// The file.
    pub file: &'a Path,
    /// The mapping; without one, a BVH file is mapped by its joint names.
    pub mapping: Option<&'a Mapping>,
    /// The person.
    pub subject: &'a Subject,
    /// Whether the person is known; otherwise a default one is written.
    pub has_subject: bool,
    /// Output folder.
    pub folder: &'a Path,
}

/// Result of an import.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Report {
    /// The `flight.toml`.
    pub flight: PathBuf,
    /// The picture of the first frame.
    pub picture: PathBuf,
    /// Frames written.
    pub frames: u64,
    /// Rows skipped because of an empty cell.
    pub rows_skipped: usize,
    /// Frame rate (Hz).
    pub frame_rate_hz: f64,
    /// From the first to the last frame (s).
    pub duration_s: f64,
    /// The source's unit of length (m).
    pub unit_m: f64,
    /// Whether the source contains positions.
    pub has_places: bool,
    /// Segments with their names in the source; null for a segment that moves rigidly with its neighbours.
    pub segments: Vec<MappedSegment>,
    /// Warnings about the flight.
    pub warnings: Vec<String>,
    /// Why results from this flight cannot be trusted: what contradicts itself, or that it is no fall.
    pub doubts: Vec<String>,
    /// What the body does, and whether the flight can be used, in a sentence.
    pub verdict: String,
    /// Markers that slipped along the skin and stay there, in order of time.
    pub slips: Vec<Slip>,
    /// The first frame, as text art.
    #[serde(skip)]
    pub letters: String,
}

/// A segment of the model and its name in the source.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct MappedSegment {
    /// Name in the model.
    pub segment: &'static str,
    /// Name in the source.
    pub source: Option<String>,
    /// Standard deviation of its orientation relative to the pelvis about an axis (deg), if the source is of sensors
    /// whose errors are known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub deviation_deg: Option<f64>,
}

/// A marker that slipped along the skin and stays there.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Slip {
    /// The segment whose length shows it best.
    pub segment: String,
    /// The marker; several if the lengths do not tell which of them it is.
    pub markers: Vec<String>,
    /// When it begins (s since frame 0).
    pub begin_s: f64,
    /// How long it takes (s).
    pub duration_s: f64,
    /// Change of the length that shows it best (m), apart from what the posture does.
    pub change_m: f64,
    /// Its standard error (m).
    pub error_m: f64,
    /// Standard deviation of that length (m) that neither posture nor slip explains: soft tissue.
    pub tissue_m: f64,
    /// In a sentence.
    pub message: String,
}

impl Slip {
    fn of(slip: &mocap::Slip, first: f64) -> Self {
        Self {
            segment: slip.segment.clone(),
            markers: slip.markers.clone(),
            begin_s: slip.begin_s - first,
            duration_s: slip.duration_s,
            change_m: slip.change_m,
            error_m: slip.error_m,
            tissue_m: slip.tissue_m,
            message: slip.to_string(),
        }
    }
}

impl Report {
    /// Why results from the flight cannot be trusted, `None` if nothing contradicts it.
    pub fn doubt(&self) -> Option<String> {
        (!self.doubts.is_empty()).then(|| {
            format!(
                "the recording cannot be trusted: {}",
                self.doubts.join("; ")
            )
        })
    }

    /// The slips as faults of the recording that was written.
    pub fn faults(&self) -> Vec<Warning> {
        let warning = |slip: &Slip| Warning {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "the index of a frame"
            )]
            frame: (slip.begin_s * self.frame_rate_hz).round().max(0.0) as u64,
            message: slip.message.clone(),
            segment: Some(slip.segment.clone()),
            span_s: Some([slip.begin_s, self.duration_s]),
            is_fault: true,
        };
        self.slips.iter().map(warning).collect()
    }
}

/// Imports a file: `flight.mvnx`, `subject.toml`, `flight.toml` and a picture of the first frame.
///
/// # Errors
/// Returns an error if the source or its mapping cannot be used or the folder cannot be written to.
pub fn import(request: &Request<'_>, progress: &mut dyn FnMut(f64)) -> Result<Report> {
    let mut source = Source::open(request.file, request.mapping)?;
    let first = source
        .frame(0)
        .map_err(|problem| problem.in_file(request.file))?;
    let has_places = first.position.is_some();
    std::fs::create_dir_all(request.folder)
        .map_err(|error| Problem::system("create", request.folder, error))?;
    let body = request.subject.body();
    let drawn = write_recording(request, &mut source, &body, has_places, progress)?;
    // The same checks as in any other verb.
    let recording = request.folder.join(RECORDING_FILE);
    let seen = seen_or_removed(request.has_subject, &recording, &body).map_err(|problem| {
        problem
            .in_file(request.file)
            .help("check the units and axes of its positions and its rate: [world] and [time] in the mapping")
    })?;
    let picture = request.folder.join(PICTURE_FILE);
    if let Some(drawing) = drawn {
        write_file(&picture, drawing.as_bytes())?;
    }
    let flight = write_flight(request.subject, request.folder, "")?;
    let (mut warnings, mut doubts) = warnings(request, &source, has_places);
    warnings.extend(seen.warnings.iter().map(ToString::to_string));
    doubts.extend(seen.faults());
    let last = source.timing.indices.last().copied().unwrap_or(0);
    Ok(Report {
        flight,
        picture,
        frames: source.frames() as u64,
        rows_skipped: source.skipped,
        frame_rate_hz: source.timing.rate,
        duration_s: last as f64 / source.timing.rate,
        unit_m: source.unit_m,
        has_places,
        segments: (source.names.iter())
            .map(|(segment, name)| MappedSegment {
                segment: segment.name(),
                source: name.clone(),
                deviation_deg: None,
            })
            .collect(),
        warnings,
        verdict: seen.verdict(&doubts),
        doubts,
        slips: (source.slips.iter())
            .map(|slip| Slip::of(slip, source.first_s))
            .collect(),
        letters: seen.picture,
    })
}

/// Writes the frames, and returns a drawing of the first.
fn write_recording(
    request: &Request<'_>,
    source: &mut Source,
    body: &Body<f64>,
    has_places: bool,
    progress: &mut dyn FnMut(f64),
) -> Result<Option<String>> {
    let name = request
        .file
        .file_name()
        .unwrap_or_default()
        .to_string_lossy();
    let description = Description {
        subject_label: "Imported".to_owned(),
        frame_rate: source.timing.rate,
        start_unix_ms: 0,
        comment: format!("bodyflight import {name}"),
        origin: Origin::Imported { has_places },
    };
    let mut writer = Writer::create(&request.folder.join(RECORDING_FILE), description, body)?;
    let mut drawn = None;
    for place in 0..source.frames() {
        let frame = flight_frame(source, place).map_err(|problem| problem.in_file(request.file))?;
        drawn.get_or_insert_with(|| {
            let attitude = frame.pelvis.inertial_from_body;
            limbs::svg(&name, body, &frame.posture, attitude)
        });
        writer.write(&frame)?;
        if place % 1000 == 0 {
            progress(place as f64 / source.frames() as f64);
            interrupt::check()?;
        }
    }
    writer.finish()?;
    Ok(drawn)
}

/// What the flight shows that was written.
struct Seen {
    warnings: Vec<Warning>,
    of_fall: Vec<Warning>,
    activity: Option<&'static str>,
    picture: String,
}

impl Seen {
    /// What contradicts itself, or is no fall.
    fn faults(&self) -> impl Iterator<Item = String> {
        let all = self.warnings.iter().chain(&self.of_fall);
        all.filter(|warning| warning.is_fault)
            .map(|warning| warning.message.clone())
    }

    /// What the body does, and why that is doubtful.
    fn verdict(&self, doubts: &[String]) -> String {
        let does = self.activity.unwrap_or("does nothing known");
        if doubts.is_empty() {
            return format!("nothing contradicts it; the body {does} for most of the time");
        }
        let doubts = doubts.join("; ");
        format!("doubtful: the body {does} for most of the time; {doubts}")
    }
}

/// What the recording shows; it is removed if no flight can be made of it.
fn seen_or_removed(has_subject: bool, recording: &Path, body: &Body<f64>) -> Result<Seen> {
    let problem = match seen(has_subject, recording, body) {
        Ok(seen) => return Ok(seen),
        Err(problem) => problem,
    };
    std::fs::remove_file(recording).map_err(|error| Problem::system("remove", recording, error))?;
    Err(Problem::bad_input(format!(
        "no flight can be made of it: {}",
        problem.message
    )))
}

fn seen(has_subject: bool, recording: &Path, body: &Body<f64>) -> Result<Seen> {
    let frames = Frames::open(recording, None, Options::default())?;
    let mut frames = frames.of_person(body, has_subject);
    let mut activities = Activities::default();
    let mut picture = None;
    for frame in frames.by_ref() {
        let frame = frame?;
        picture.get_or_insert_with(|| first_frame(body, &frame));
        activities.see(&frame);
    }
    let mut warnings = frames.of_import();
    warnings.extend_from_slice(frames.of_subject());
    Ok(Seen {
        warnings,
        of_fall: frames.of_fall(),
        activity: activities.most(),
        picture: picture.unwrap_or_default(),
    })
}

/// A frame of the source as one of a flight.
fn flight_frame(source: &mut Source, place: usize) -> Result<FlightFrame> {
    let frame = source.frame(place)?;
    let (inertial_from_body, posture) = source.skeleton.posture(&frame.world_from_segment);
    let index = source.timing.indices.get(place).copied().unwrap_or(0);
    let position = frame.position.map(|at| source.skeleton.to_inertial(&at));
    Ok(FlightFrame {
        index,
        time: index as f64 / source.timing.rate,
        posture,
        pelvis: PelvisMotion {
            inertial_from_body,
            position: Vector::from_components(position.unwrap_or_else(Vector3::zeros)),
            velocity: None,
            angular_velocity: None,
        },
        centre_of_mass: None,
        bridged: false,
    })
}

/// Remarks about the source, and those among them that contradict it.
fn warnings(
    request: &Request<'_>,
    source: &Source,
    has_places: bool,
) -> (Vec<String>, Vec<String>) {
    let mut warnings = source.warnings.clone();
    let mut doubts: Vec<String> = source.slips.iter().map(ToString::to_string).collect();
    warnings.extend(doubts.iter().cloned());
    if !has_places {
        warnings.push(
            "the source has no positions, so the recording has no velocity; add a receiver's track for it: \
             gnss = \"TRACK.CSV\" in flight.toml, and gnss_begin_s = 12.3, by how much (s) the recording begins after the first row of the track"
                .to_owned(),
        );
    }
    if source.timing.rate < SLOW {
        warnings.push(format!(
            "only {:.1} frames per second: rotation between frames is assumed to be uniform",
            source.timing.rate
        ));
    }
    warnings.extend(no_subject(request.has_subject, request.subject));
    let own = request.subject.body().segments[Segment::LeftThigh].length;
    if let Some(thigh) = source.lengths_m[Segment::LeftThigh]
        && ((thigh / own) - 1.0).abs() > THIGH
    {
        let said = format!(
            "the thigh of the source is {thigh:.3} m long, that of the subject {own:.3} m: is it the same person?"
        );
        doubts.extend(request.has_subject.then(|| said.clone()));
        warnings.push(said);
    }
    if let Some((_, said)) = disproportionate(|segment| source.lengths_m[segment]) {
        doubts.push(said.clone());
        warnings.push(said);
    }
    (warnings, doubts)
}

fn no_subject(has_subject: bool, subject: &Subject) -> Option<String> {
    (!has_subject).then(|| {
        format!(
            "no subject was given: a person of {:.0} kg with equipment is written to subject.toml",
            subject.body().mass()
        )
    })
}

/// Writes the person, and the `flight.toml` that ties the files together, with further fields.
fn write_flight(subject: &Subject, folder: &Path, more: &str) -> Result<PathBuf> {
    subject.write_in(folder)?;
    let path = folder.join("flight.toml");
    let text = format!("recording = \"flight.mvnx\"\nsubject = \"subject.toml\"\n{more}");
    write_file(&path, text.as_bytes())?;
    Ok(path)
}
