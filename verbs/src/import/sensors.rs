//! Raw inertial sensors on the limbs as a recording, with the errors of its segments.

use std::fmt::Write as _;
use std::path::Path;

use bodyflight_core::Segment;
use bodyflight_core::air::STANDARD_GRAVITY;
use bodyflight_core::dynamics::muscle_input::{MODELS, MuscleModel};
use bodyflight_core::frame::Vector;
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::files::write_file;
use bodyflight_io::interrupt;
use bodyflight_mocap::imu::mapping::ImuMapping;
use bodyflight_mocap::imu::worn::{Worn, sensors, worn};
use bodyflight_mvnx::recording::{FlightFrame, Options, PelvisMotion};
use bodyflight_mvnx::writer::{Description, Origin, Writer};
use bodyflight_replay::frames::{Frames, Track};
use bodyflight_replay::subject::Subject;
use nalgebra::Vector3;

use super::{
    MappedSegment, PICTURE_FILE, RECORDING_FILE, Report, limbs, remarks::no_subject,
    seen_or_removed, write_flight,
};

/// Time over which the drift of integrated velocities is averaged, on either side (s).
const SLOW: f64 = 0.8;
/// Name of a recording with integrated velocities, until they are replaced.
const PROVISIONAL_FILE: &str = "integrated.mvnx";

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
    let recording = request.folder.join(RECORDING_FILE);
    match &request.mapping.flight.gnss {
        None => write_recording(request, &worn, None, &recording)?,
        Some(track) => {
            let provisional = request.folder.join(PROVISIONAL_FILE);
            let inertial = inertial(&worn);
            write_recording(request, &worn, Some(&inertial), &provisional)?;
            let begin_s = request.mapping.flight.gnss_begin_s;
            let received = aligned(
                &provisional,
                Track {
                    path: track,
                    begin_s,
                },
            )?;
            let velocities = joined(&inertial, &received, worn.rate_hz);
            write_recording(request, &worn, Some(&velocities), &recording)?;
        }
    }
    let seen = seen_or_removed(request.has_subject, &recording, &body).map_err(in_path)?;
    let more = format!("{}{}", limb_groups(request.mapping)?, suit_table(&worn));
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
        contradictions: Vec::new(),
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

/// Writes the recording; `velocities` are those of the pelvis in each frame (m/s), if they are known.
fn write_recording(
    request: &Request<'_>,
    worn: &Worn,
    velocities: Option<&[Vector3<f64>]>,
    path: &Path,
) -> Result<()> {
    let name = request.path.file_name().unwrap_or_default();
    let name = name.to_string_lossy();
    let body = request.subject.body();
    let description = Description {
        subject_label: "Imported".to_owned(),
        frame_rate: worn.rate_hz,
        start_unix_ms: 0,
        comment: format!("bodyflight import {name}"),
        origin: Origin::Imported {
            has_places: velocities.is_some(),
        },
    };
    let mut writer = Writer::create(path, description, &body)?;
    let mut place = Vector3::zeros();
    for (index, (time, seen)) in worn.frames.iter().enumerate() {
        let velocity = velocities.and_then(|all| all.get(index)).copied();
        place += velocity.unwrap_or_default() / worn.rate_hz;
        let turn = seen.inertial_from_body.quaternion() * seen.angular_velocity;
        let posture = seen.posture();
        if index == 0 {
            let drawing = limbs::svg(&name, &body, &posture, seen.inertial_from_body);
            write_file(&request.folder.join(PICTURE_FILE), drawing.as_bytes())?;
        }
        writer.write(&FlightFrame {
            index: index as u64,
            time: *time,
            posture,
            pelvis: PelvisMotion {
                inertial_from_body: seen.inertial_from_body,
                position: Vector::from_components(place),
                velocity: velocity.map(Vector::from_components),
                angular_velocity: Some(Vector::from_components(turn)),
            },
            centre_of_mass: None,
            bridged: false,
        })?;
    }
    writer.finish()
}

/// Velocities of the pelvis by integration of the forces on its sensor (m/s). They drift as a suit's do.
fn inertial(worn: &Worn) -> Vec<Vector3<f64>> {
    let mut of_sensor = Vector3::zeros();
    let each = worn.frames.iter().map(|(_, seen)| {
        of_sensor += (seen.specific_force - Vector3::z() * STANDARD_GRAVITY) / worn.rate_hz;
        let around = seen.angular_velocity.cross(&worn.pelvis_place);
        of_sensor - seen.inertial_from_body.quaternion() * around
    });
    each.collect()
}

/// The receiver's velocities where they are slow, and those of the forces where they are fast: solutions of a receiver
/// are too few and too noisy to tell what a body does within a second (m/s).
fn joined(inertial: &[Vector3<f64>], received: &[Vector3<f64>], rate_hz: f64) -> Vec<Vector3<f64>> {
    let drift = received
        .iter()
        .zip(inertial)
        .map(|(one, other)| one - other);
    let drift = averaged(&averaged(&drift.collect::<Vec<_>>(), rate_hz), rate_hz);
    inertial
        .iter()
        .zip(&drift)
        .map(|(velocity, drift)| velocity + drift)
        .collect()
}

/// Means over [`SLOW`] on either side of each value, less at the ends.
fn averaged(values: &[Vector3<f64>], rate_hz: f64) -> Vec<Vector3<f64>> {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "only some frames"
    )]
    let reach = (SLOW * rate_hz).round() as usize;
    let mut sums = vec![Vector3::zeros()];
    for value in values {
        sums.push(sums.last().copied().unwrap_or_default() + value);
    }
    let mean = |at: usize| {
        let reach = reach.min(at).min(values.len() - 1 - at);
        let count = (2 * reach + 1) as f64;
        (sums[at + reach + 1] - sums[at - reach]) / count
    };
    (0..values.len()).map(mean).collect()
}

/// Velocities of the receiver's track on the clock of the recording and in its axes (m/s). The recording is
/// removed.
fn aligned(recording: &Path, track: Track<'_>) -> Result<Vec<Vector3<f64>>> {
    let read = || {
        let frames = Frames::open(recording, Some(track), Options::default())?;
        let velocity = |frame: Result<FlightFrame>| {
            let velocity = frame?.pelvis.velocity;
            Ok(velocity.unwrap_or_else(Vector::zero).components)
        };
        frames.map(velocity).collect::<Result<Vec<Vector3<f64>>>>()
    };
    let velocities = read();
    std::fs::remove_file(recording).map_err(|error| Problem::system("remove", recording, error))?;
    velocities.map_err(|problem: Problem| {
        problem.at("field flight.gnss").help(
            "the track must be of this flight, with some seconds on either side, and the flight must change its fall rate or turn, or gnss_begin_s say \
             how long after the first row of the track the flight begins (s)",
        )
    })
}

/// The limb groups as a line of `flight.toml`, if the mapping names them.
fn limb_groups(mapping: &ImuMapping) -> Result<String> {
    let Some(name) = &mapping.flight.muscles else {
        return Ok(String::new());
    };
    match MuscleModel::from_name(name) {
        Some(_) => Ok(format!("muscles = {name:?}\n")),
        None => Err(
            Problem::unknown("limb groups", name, MODELS.map(|(name, _)| name))
                .at("field flight.muscles"),
        ),
    }
}

/// The doubted sensors and the errors of the segments, as tables of `flight.toml`.
fn suit_table(worn: &Worn) -> String {
    let mut text = String::new();
    let doubted: Vec<&str> = worn.doubted.iter().map(|segment| segment.name()).collect();
    if !doubted.is_empty() {
        // Writing to a String cannot fail.
        let _ = writeln!(text, "\n[suit]\ndoubted = {doubted:?}");
    }
    text += "\n[suit.segments_deg]\n";
    for (segment, deviation) in worn.deviation.iter().skip(1) {
        let _ = writeln!(text, "{} = {:.1}", segment.name(), deviation.to_degrees());
    }
    text
}
