//! Raw inertial sensors on the limbs as a recording, with the errors of its segments.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use bodyflight_core::air::STANDARD_GRAVITY;
use bodyflight_core::frame::Vector;
use bodyflight_core::{Segment, SegmentArray};
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::files::write_file;
use bodyflight_io::interrupt;
use bodyflight_mocap::imu::mapping::ImuMapping;
use bodyflight_mocap::imu::worn::{Frame, Worn, sensors, worn};
use bodyflight_mvnx::recording::{FlightFrame, PelvisMotion};
use bodyflight_mvnx::writer::{Description, Origin, Writer};
use bodyflight_replay::subject::Subject;
use nalgebra::Vector3;

use super::{
    MappedSegment, PICTURE_FILE, RECORDING_FILE, Report, limbs, no_subject, seen_or_removed,
    write_flight,
};

/// What to import.
#[derive(Debug, Clone)]
pub struct Request<'a> {
    /// The folder with a file for each sensor, or one file of all sensors.
    pub path: &'a Path,
    /// The mapping.
    pub mapping: &'a ImuMapping,
    /// The person.
    pub subject: &'a Subject,
    /// Whether the person is known; otherwise a default one is written.
    pub has_subject: bool,
    /// Output folder.
    pub folder: &'a Path,
}

/// Imports raw sensors: the same files as [`super::import`], and the errors of the segments in `flight.toml`.
///
/// # Errors
/// Returns an error if the sensors or their calibration cannot be used, or the folder cannot be written to.
pub fn import(request: &Request<'_>, progress: &mut dyn FnMut(f64)) -> Result<Report> {
    let in_path = |problem: Problem| match problem.file {
        Some(_) => problem,
        None => problem.in_file(request.path),
    };
    let body = request.subject.body();
    let streams = sensors(request.mapping, request.path).map_err(in_path)?;
    let mut each = |share: f64| {
        progress(share);
        interrupt::check()
    };
    let worn = worn(request.mapping, &streams, &body, &mut each).map_err(in_path)?;
    std::fs::create_dir_all(request.folder)
        .map_err(|error| Problem::system("create", request.folder, error))?;
    write_recording(request, &worn)?;
    let recording = request.folder.join(RECORDING_FILE);
    let seen = seen_or_removed(request.has_subject, &recording, &body).map_err(in_path)?;
    let more = flight_fields(request.mapping, &worn.deviation)?;
    let flight = write_flight(request.subject, request.folder, &more)?;
    let mut warnings = worn.notes.clone();
    warnings.extend(no_subject(request.has_subject, request.subject));
    if request.mapping.flight.gnss.is_none() {
        warnings.push(
            "sensors on the body show no velocity: give a receiver's track, gnss = \"TRACK.CSV\" in the table [flight] of the mapping"
                .to_owned(),
        );
    }
    warnings.extend(seen.warnings.iter().map(ToString::to_string));
    warnings.extend(worn.doubts.iter().cloned());
    let mut doubts = worn.doubts.clone();
    doubts.extend(seen.faults());
    Ok(Report {
        flight,
        picture: request.folder.join(PICTURE_FILE),
        frames: worn.frames.len() as u64,
        rows_skipped: 0,
        frame_rate_hz: worn.rate_hz,
        duration_s: worn.frames.last().map_or(0.0, |(time, _)| *time),
        unit_m: 1.0,
        has_places: false,
        segments: mapped(request.mapping, &worn),
        warnings,
        verdict: seen.verdict(&doubts),
        doubts,
        slips: Vec::new(),
        letters: seen.picture,
    })
}

fn mapped(mapping: &ImuMapping, worn: &Worn) -> Vec<MappedSegment> {
    let each = Segment::ALL.into_iter().map(|segment| {
        let row = mapping.sensors.get(segment.name());
        let source = row.map(|row| match &row.file {
            Some(file) => file.display().to_string(),
            None => row.prefix.clone(),
        });
        MappedSegment {
            segment: segment.name(),
            source,
            deviation_deg: (segment != Segment::Pelvis)
                .then(|| worn.deviation[segment].to_degrees()),
        }
    });
    each.collect()
}

fn write_recording(request: &Request<'_>, worn: &Worn) -> Result<()> {
    let name = request.path.file_name().unwrap_or_default();
    let name = name.to_string_lossy();
    let body = request.subject.body();
    let has_track = request.mapping.flight.gnss.is_some();
    let description = Description {
        subject_label: "Imported".to_owned(),
        frame_rate: worn.rate_hz,
        start_unix_ms: 0,
        comment: format!("bodyflight import {name}"),
        origin: Origin::Imported {
            has_places: has_track,
        },
    };
    let mut writer = Writer::create(&request.folder.join(RECORDING_FILE), description, &body)?;
    let mut inertial = Inertial::default();
    for (index, frame) in (0..).zip(&worn.frames) {
        let written = flight_frame(index, frame, worn.rate_hz, &mut inertial, has_track);
        if index == 0 {
            let attitude = written.pelvis.inertial_from_body;
            let drawing = limbs::svg(&name, &body, &written.posture, attitude);
            write_file(&request.folder.join(PICTURE_FILE), drawing.as_bytes())?;
        }
        writer.write(&written)?;
    }
    writer.finish()
}

/// Velocity and place by integration. They drift as a suit's do, and serve to find the shift between the clocks of sensors
/// and receiver, whose velocities then replace them.
#[derive(Default)]
struct Inertial {
    velocity: Vector3<f64>,
    place: Vector3<f64>,
}

fn flight_frame(
    index: u64,
    (time, seen): &Frame,
    rate_hz: f64,
    inertial: &mut Inertial,
    has_track: bool,
) -> FlightFrame {
    let fall = seen.specific_force - Vector3::z() * STANDARD_GRAVITY;
    inertial.velocity += fall / rate_hz;
    inertial.place += inertial.velocity / rate_hz;
    let turn = seen.inertial_from_body.quaternion() * seen.angular_velocity;
    FlightFrame {
        index,
        time: *time,
        posture: seen.posture(),
        pelvis: PelvisMotion {
            inertial_from_body: seen.inertial_from_body,
            position: Vector::from_components(if has_track {
                inertial.place
            } else {
                Vector3::zeros()
            }),
            velocity: has_track.then(|| Vector::from_components(inertial.velocity)),
            angular_velocity: Some(Vector::from_components(turn)),
        },
        centre_of_mass: None,
        bridged: false,
    }
}

/// The receiver's track, and the errors of the segments.
fn flight_fields(mapping: &ImuMapping, deviation: &SegmentArray<f64>) -> Result<String> {
    let mut text = String::new();
    if let Some(track) = &mapping.flight.gnss {
        let track: PathBuf =
            std::fs::canonicalize(track).map_err(|error| Problem::system("read", track, error))?;
        // Writing to a String cannot fail.
        let _ = writeln!(text, "gnss = {:?}", track.display().to_string());
    }
    let _ = writeln!(text, "\n[suit.segments_deg]");
    for (segment, deviation) in deviation.iter().skip(1) {
        let _ = writeln!(text, "{} = {:.1}", segment.name(), deviation.to_degrees());
    }
    Ok(text)
}
