//! A flight that was flown in the page, as an ordinary recording.

use std::path::{Path, PathBuf};

use bodyflight_core::body::mass_properties::PostureRate;
use bodyflight_core::dynamics::{Dynamics, Inputs, State};
use bodyflight_core::frame::{Rotation, Vector};
use bodyflight_core::{Posture, Segment};
use bodyflight_viewer::frame::{LAYOUT, NUMBERS, SEGMENT_NUMBERS, place};
use nalgebra::{Quaternion, UnitQuaternion};

use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::files::{AtomicFolder, CsvFile, write_file};
use bodyflight_io::input;
use bodyflight_mvnx::recording::{FlightFrame, PelvisMotion};
use bodyflight_mvnx::writer::{Description, Origin, Writer};
use bodyflight_replay::input_history::InputRow;
use bodyflight_replay::subject::{SEGMENTS_FILE, Subject};

/// Frame rate (Hz), that of the page's steps.
const RATE: f64 = 240.0;

/// Shortest flight that can be saved (frames).
const LEAST: usize = 24;

/// One frame of a flight in the page.
#[derive(Debug, Clone, Copy)]
pub struct FlownFrame {
    /// As recorded.
    pub frame: FlightFrame,
    /// Muscle input and damping since the frame before.
    pub inputs: Inputs<f64>,
}

/// What the first line of a file of a page without a program begins with; density and mass follow.
const FIRST: &str = "# bodyflight fly:";

/// A flight that a page saved without a program.
#[derive(Debug, Clone)]
pub struct Saved {
    /// Frames.
    pub frames: Vec<FlownFrame>,
    /// Density of the air (kg/m3).
    pub density: f64,
    /// Mass of the person with all equipment (kg).
    pub mass: f64,
}

/// Reads the CSV file that a page of `fly --out` saves.
///
/// # Errors
/// Returns an error if the file cannot be read or is not such a file, names the line of a number that is none, and as
/// [`frames`].
pub fn saved(path: &Path) -> Result<Saved> {
    let text = input::text(path)?;
    let wrong = |line: u64, message: String| {
        let problem = Problem::bad_input(message).in_file(path).at_line(line);
        problem.help("expected the CSV file that \"save\" writes in a page of bodyflight fly --out")
    };
    let mut lines = text.lines().zip(1u64..);
    let mut next = || lines.next().map_or("", |(line, _)| line);
    let (first, head) = (next(), next());
    let given = |name: &str| {
        let (_, rest) = first.strip_prefix(FIRST)?.split_once(name)?;
        let number = rest.trim_start_matches('=').split(',').next()?;
        number
            .trim()
            .parse::<f64>()
            .ok()
            .filter(|number| *number > 0.0)
    };
    let (Some(density), Some(mass)) = (given("density_kgpm3"), given("mass_kg")) else {
        let message = format!("expected a first line \"{FIRST} density_kgpm3=..., mass_kg=...\"");
        return Err(wrong(1, message));
    };
    let names: Vec<&str> = head.split(',').collect();
    if names.len() != NUMBERS || names != columns() {
        let message = format!(
            "expected the {NUMBERS} columns of a frame, found {}",
            names.len()
        );
        return Err(wrong(2, message));
    }
    let mut bytes = Vec::new();
    for (line, number) in lines {
        let numbers = line.split(',').map(str::parse::<f32>);
        let numbers: Vec<f32> = numbers
            .collect::<std::result::Result<_, _>>()
            .map_err(|_| wrong(number, format!("expected numbers, found \"{:.60}\"", line)))?;
        if numbers.len() != NUMBERS {
            let message = format!("expected {NUMBERS} numbers, found {}", numbers.len());
            return Err(wrong(number, message));
        }
        bytes.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
    }
    let frames = frames(&bytes).map_err(|problem| problem.in_file(path))?;
    Ok(Saved {
        frames,
        density,
        mass,
    })
}

/// Names of the columns of a frame, as the page writes them.
fn columns() -> Vec<String> {
    let names = LAYOUT.iter().flat_map(|(name, count)| {
        (0..*count).map(move |k| match count {
            1 => (*name).to_owned(),
            _ => format!("{name}_{k}"),
        })
    });
    names.collect()
}

/// Decodes frames from the page: numbers in single precision, little-endian.
///
/// # Errors
/// Returns an error if the last frame is incomplete, there are too few frames, or a number is not finite.
pub fn frames(bytes: &[u8]) -> Result<Vec<FlownFrame>> {
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

fn frame(index: usize, numbers: &[f64]) -> Option<FlownFrame> {
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
    let three = |name: &str| part(name, 3)?.try_into().ok();
    let vector = |name: &str| three(name).map(|[x, y, z]: [f64; 3]| (x, y, z));
    let ((x, y, z), (u, v, w), (p, q, r)) = (
        vector("position_m")?,
        vector("velocity_mps")?,
        vector("angular_velocity_radps")?,
    );
    let frame = FlightFrame {
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
    };
    let inputs = Inputs {
        muscle: three("muscle")?.into(),
        damping: three("damping")?.into(),
        ..Inputs::belly_turn()
    };
    Some(FlownFrame { frame, inputs })
}

/// Writes frames as a new folder with `flight.toml`, `subject.toml`, `inputs.csv` and `flight.mvnx`, and returns the path
/// of its `flight.toml`. The folder appears once it is complete.
///
/// # Errors
/// Returns an error if the folder exists or cannot be written to.
pub fn write(
    frames: &[FlownFrame],
    subject: &Subject,
    density: f64,
    folder: &Path,
) -> Result<PathBuf> {
    let making = AtomicFolder::create(folder)?;
    let at = |name: &str| making.path().join(name);
    let description = Description {
        subject_label: "Page".to_owned(),
        frame_rate: RATE,
        start_unix_ms: 0,
        comment: "bodyflight fly".to_owned(),
        origin: Origin::Simulated,
    };
    let mut writer = Writer::create(&at("flight.mvnx"), description, &subject.body())?;
    let setup = super::page::setup(subject, density);
    for frame in with_central_rates(frames, &setup.dynamics.cast())? {
        writer.write(&frame)?;
    }
    writer.finish()?;
    write_inputs(frames, &at("inputs.csv"))?;
    write_file(&at("subject.toml"), subject.to_toml()?.as_bytes())?;
    if let Some(table) = subject.segments_json() {
        write_file(&at(SEGMENTS_FILE), table.as_bytes())?;
    }
    let text = format!(
        "recording = \"flight.mvnx\"\nsubject = \"subject.toml\"\ninputs = \"inputs.csv\"\n\n\
         [air]\ndensity = {density:?}\n"
    );
    write_file(&at("flight.toml"), text.as_bytes())?;
    making.finish()?;
    Ok(folder.join("flight.toml"))
}

/// The frames of a recording. The page knows the joints' rates over the step before a frame only; the motion of the
/// pelvis is converted to their central differences, as a replay of a recording has them, by way of the momenta.
fn with_central_rates(frames: &[FlownFrame], dynamics: &Dynamics<f64>) -> Result<Vec<FlightFrame>> {
    let mut all: Vec<FlightFrame> = frames.iter().map(|flown| flown.frame).collect();
    for (three, place) in frames.windows(3).zip(1..) {
        let [before, here, after] = [0, 1, 2].map(|k| three[k].frame);
        let sample = |from: &FlightFrame, to: &FlightFrame| {
            let rate = PostureRate::between(&from.posture, &to.posture, to.time - from.time);
            dynamics.sample(&here.posture, &rate)
        };
        let state = State::from_motion(&here.motion()?, &sample(&before, &here));
        let motion = state.motion(&sample(&before, &after));
        let pelvis = &mut all[place].pelvis;
        pelvis.velocity = Some(motion.velocity_inertial());
        pelvis.angular_velocity = Some(motion.inertial_from_body * motion.angular_velocity);
    }
    Ok(all)
}

/// Writes the inputs, each at the middle of the step in which it acted. Rows that equal both their neighbours are left
/// out.
fn write_inputs(frames: &[FlownFrame], path: &Path) -> Result<()> {
    let mut file = CsvFile::create(path, &InputRow::COLUMNS)?;
    for (index, here) in frames.iter().enumerate() {
        let same = |other: Option<&FlownFrame>| other.is_some_and(|o| o.inputs == here.inputs);
        let before = index.checked_sub(1).and_then(|k| frames.get(k));
        if !(same(before) && same(frames.get(index + 1))) {
            let middle = here.frame.time - 0.5 / RATE;
            file.write(InputRow::of(middle, &here.inputs).columns())?;
        }
    }
    file.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn incomplete_frames_and_nan_are_refused() {
        assert!(frames(&[0; 4 * NUMBERS * 30 - 1]).is_err());
        assert!(frames(&[0; 4 * NUMBERS]).is_err());
        let mut bytes = vec![0; 4 * NUMBERS * 30];
        bytes[..4].copy_from_slice(&f32::NAN.to_le_bytes());
        assert!(frames(&bytes).is_err());
    }

    #[test]
    fn files_that_no_page_saved_are_refused_with_their_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("flight.csv");
        let first = format!("{FIRST} density_kgpm3=1, mass_kg=85\n");
        let head = format!("{}\n", columns().join(","));
        let row = format!("{}\n", vec!["0"; NUMBERS].join(","));
        for (text, line, part) in [
            ("time_s,roll\n0,1\n".to_owned(), Some(1), "density_kgpm3"),
            (first.replace("85", "-85"), Some(1), "mass_kg"),
            (first.clone() + "time_s,roll\n", Some(2), "found 2"),
            (first.clone() + &head + &row + "1,2\n", Some(4), "found 2"),
            (
                first.clone() + &head + &row + &row.replace('0', "x"),
                Some(4),
                "numbers",
            ),
            (first.clone() + &head + &row, None, "at least 24 frames"),
        ] {
            std::fs::write(&path, text).unwrap();
            let problem = saved(&path).unwrap_err();
            assert!(problem.to_string().contains(part), "{problem}");
            assert_eq!(problem.line, line, "{problem}");
        }
    }
}
