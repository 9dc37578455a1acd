//! A flight that was flown in the page, as an ordinary recording.

use std::path::{Path, PathBuf};

use bodyflight_core::frame::{Rotation, Vector};
use bodyflight_core::{Posture, Segment};
use bodyflight_viewer::frame::{NUMBERS, SEGMENT_NUMBERS, place};
use nalgebra::{Quaternion, UnitQuaternion};

use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::files::write_file;
use bodyflight_mvnx::recording::{FlightFrame, PelvisMotion};
use bodyflight_mvnx::writer::{Description, Origin, Writer};
use bodyflight_replay::subject::Subject;

/// Frame rate (Hz), that of the page's steps.
const RATE: f64 = 240.0;

/// Shortest flight that can be saved (frames).
const LEAST: usize = 24;

/// Decodes frames from the page: numbers in single precision, little-endian.
///
/// # Errors
/// Returns an error if the last frame is incomplete, there are too few frames, or a number is not finite.
pub fn frames(bytes: &[u8]) -> Result<Vec<FlightFrame>> {
    let size = 4 * NUMBERS;
    if !bytes.len().is_multiple_of(size) || bytes.len() < size * LEAST {
        return Err(Problem::bad_input(format!(
            "expected at least {LEAST} frames of {size} bytes, found {} bytes",
            bytes.len()
        )));
    }
    let all = bytes.chunks_exact(size).enumerate().map(|(index, bytes)| {
        let numbers: Vec<f64> = bytes
            .chunks_exact(4)
            .map(|four| f64::from(f32::from_le_bytes(four.try_into().unwrap_or_default())))
            .collect();
        frame(index, &numbers).ok_or_else(|| {
            Problem::bad_input(format!(
                "frame {index} contains a number that is not finite"
            ))
            .help("the simulation diverged; start again and save before that")
        })
    });
    all.collect()
}

fn frame(index: usize, numbers: &[f64]) -> Option<FlightFrame> {
    if !numbers.iter().all(|number| number.is_finite()) {
        return None;
    }
    let part = |name: &str, count: usize| {
        let from = place(name)?;
        numbers.get(from..from + count)
    };
    let rotation = |numbers: &[f64]| {
        let &[w, x, y, z] = numbers else { return None };
        UnitQuaternion::try_new(Quaternion::new(w, x, y, z), 1e-3)
    };
    let inertial_from_body = Rotation::from_quaternion(rotation(part("inertial_from_body", 4)?)?);
    let segments = part("segments", Segment::ALL.len() * SEGMENT_NUMBERS)?;
    let mut posture = Posture::h_pose();
    for (segment, numbers) in Segment::ALL
        .into_iter()
        .zip(segments.chunks_exact(SEGMENT_NUMBERS))
    {
        posture.set(segment, rotation(&numbers[..4])?);
    }
    let vector = |name: &str| match part(name, 3) {
        Some(&[x, y, z]) => Some((x, y, z)),
        _ => None,
    };
    let ((x, y, z), (u, v, w), (p, q, r)) = (
        vector("position_m")?,
        vector("velocity_mps")?,
        vector("angular_velocity_radps")?,
    );
    Some(FlightFrame {
        index: index as u64,
        time: index as f64 / RATE,
        posture,
        pelvis: PelvisMotion {
            inertial_from_body,
            position: Vector::new(x, y, z),
            velocity: Some(Vector::new(u, v, w)),
            angular_velocity: Some(inertial_from_body * Vector::new(p, q, r)),
        },
        centre_of_mass: None,
        bridged: false,
    })
}

/// Writes frames as `flight.toml`, `subject.toml` and `flight.mvnx` into `folder`.
///
/// # Errors
/// Returns an error if the folder cannot be written to.
pub fn write(
    frames: &[FlightFrame],
    subject: &Subject,
    density: f64,
    folder: &Path,
) -> Result<PathBuf> {
    std::fs::create_dir_all(folder).map_err(|error| Problem::system("create", folder, error))?;
    let description = Description {
        subject_label: "Page".to_owned(),
        frame_rate: RATE,
        start_unix_ms: 0,
        comment: "bodyflight fly".to_owned(),
        origin: Origin::Simulated,
    };
    let mut writer = Writer::create(&folder.join("flight.mvnx"), description, &subject.body())?;
    for frame in frames {
        writer.write(frame)?;
    }
    writer.finish()?;
    write_file(&folder.join("subject.toml"), subject.to_toml()?.as_bytes())?;
    if let Some(table) = subject.segments_json() {
        write_file(
            &folder.join(bodyflight_replay::subject::SEGMENTS_FILE),
            table.as_bytes(),
        )?;
    }
    let path = folder.join("flight.toml");
    let text = format!(
        "recording = \"flight.mvnx\"\nsubject = \"subject.toml\"\n\n[air]\ndensity = {density:?}\n"
    );
    write_file(&path, text.as_bytes())?;
    Ok(path)
}

#[cfg(test)]
mod tests {
    use super::*;
    use bodyflight_replay::Precision;
    use bodyflight_viewer::cockpit::Cockpit;

    use crate::simulate::simulate;
    use crate::view::page::setup;
    use bodyflight_mvnx::recording::Options;
    use bodyflight_replay::flight::{DEFAULT_DENSITY, Flight};

    #[test]
    fn a_flight_of_the_page_is_flown_again_by_the_model() {
        let subject = Subject::default();
        let mut cockpit = Cockpit::new(&setup(&subject, DEFAULT_DENSITY), 0);
        let mut bytes = Vec::new();
        for step in 0..240 * 4 {
            if step == 240 {
                cockpit.command(0, 1.0);
            }
            cockpit.step();
            for number in cockpit.frame() {
                bytes.extend(number.to_le_bytes());
            }
        }
        let folder = tempfile::tempdir().unwrap();
        let path = write(
            &frames(&bytes).unwrap(),
            &subject,
            DEFAULT_DENSITY,
            folder.path(),
        )
        .unwrap();
        let flight = Flight::read(&path).unwrap();
        let flown = simulate(
            &flight,
            Options::default(),
            Precision::Double,
            &mut |_| Ok(()),
            &mut |_| {},
        )
        .unwrap();
        for (channel, gap) in bodyflight_replay::comparison::Channel::ALL
            .iter()
            .zip(flown.report.rms.0)
        {
            assert!(gap < 0.01, "{channel:?}: {gap}");
        }
    }

    #[test]
    fn incomplete_frames_and_nan_are_refused() {
        assert!(frames(&[0; 4 * NUMBERS * 30 - 1]).is_err());
        assert!(frames(&[0; 4 * NUMBERS]).is_err());
        let mut bytes = vec![0; 4 * NUMBERS * 30];
        bytes[..4].copy_from_slice(&f32::NAN.to_le_bytes());
        assert!(frames(&bytes).is_err());
    }
}
