//! `flight.toml`: a recording with the subject, the air and the inputs that go with it.

use std::path::{Path, PathBuf};

use bodyflight_core::aerodynamics::stream::Stream;
use bodyflight_core::air::{Air, Density};
use bodyflight_core::dynamics::free_run::Equations;
use bodyflight_core::dynamics::muscle_input::{self, MuscleForces, MuscleModel};
use bodyflight_core::dynamics::{Dynamics, Inputs};
use bodyflight_core::frame::Vector;
use bodyflight_core::tolerances::Tolerances;
use bodyflight_core::{Segment, SegmentArray};
use serde::{Deserialize, Serialize};

use crate::conditions;
use crate::frames::{Frames, Track};
use crate::input_history::InputHistory;
use crate::model_file::Effects;
use crate::person;
use crate::subject::Subject;
use crate::tolerances::{SuitTable, ToleranceTable, tolerances};
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::file_kind::FileKind;
use bodyflight_io::input;
use bodyflight_mvnx::recording::{Options, Warning};

/// Density if a flight gives none (kg/m3): that at about 2000 m.
pub const DEFAULT_DENSITY: f64 = 1.0;

/// A readable name of a flight: that of the folder if the file is called `flight.toml`, otherwise that of the file.
pub fn name_of(path: &Path) -> String {
    let stem = path.file_stem().unwrap_or(path.as_os_str());
    let folder = path.parent().and_then(Path::file_name);
    match folder {
        Some(folder) if stem == "flight" => folder.to_string_lossy().into_owned(),
        _ => stem.to_string_lossy().into_owned(),
    }
}

/// Everything that a command needs to know about a flight besides its frames.
#[derive(Debug, Clone)]
pub struct Flight {
    /// The MVNX file.
    pub recording: PathBuf,
    /// The person.
    pub subject: Subject,
    /// Air density, before the height of the first frame is known.
    pub density: DensityChoice,
    /// Velocity of the air (m/s), north, west, up.
    pub air_velocity: [f64; 3],
    /// Equations of motion.
    pub equations: Equations,
    /// Limb groups that muscle input acts on.
    pub muscles: MuscleModel,
    /// Known conscious inputs over time; otherwise the subject's constant damping.
    pub inputs: Option<InputHistory>,
    /// Effects that extend the model.
    pub effects: Effects,
    /// A satellite receiver's track, whose velocities replace the suit's.
    pub gnss: Option<PathBuf>,
    /// How long after the first row of that track the recording begins (s), if it is given.
    pub gnss_begin_s: Option<f64>,
    /// How a free run gets its initial motion.
    pub start: Start,
    /// Whether a subject was given; if not, the default one is used.
    pub has_subject: bool,
    /// Tolerances of suit and subject.
    pub tolerances: Tolerances,
    /// Standard deviation of each segment's orientation relative to the pelvis about an axis (rad), if it is stated.
    pub segment_errors: Option<SegmentArray<f64>>,
    /// Segments whose orientation may be wrong by any angle, since their sensors are doubted.
    pub doubted: Vec<Segment>,
}

/// How a free run gets its initial motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Start {
    /// The first frame alone.
    First,
    /// A fit to the first tenth of a second.
    #[default]
    Smoothed,
}

/// How a flight specifies the air density.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum DensityChoice {
    /// One density (kg/m3).
    Constant(f64),
    /// Altitude of the first frame above sea level (m): standard atmosphere from there.
    FirstFrameAltitude(f64),
}

/// The effect of muscle input besides its moments, as named by `muscle_forces`.
#[derive(Deserialize, Clone, Copy)]
#[serde(rename_all = "lowercase")]
enum MuscleForcesName {
    Moment,
    Paper,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FlightFile {
    recording: PathBuf,
    subject: Option<PathBuf>,
    inputs: Option<PathBuf>,
    gnss: Option<PathBuf>,
    gnss_begin_s: Option<f64>,
    muscles: Option<String>,
    muscle_forces: Option<MuscleForcesName>,
    lever_arms: Option<[f32; 4]>,
    equations: Option<EquationsName>,
    #[serde(default)]
    air: AirTable,
    #[serde(default)]
    suit: SuitTable,
    #[serde(default)]
    tolerance: ToleranceTable,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
struct AirTable {
    density: Option<f64>,
    altitude_m: Option<f64>,
    #[serde(default)]
    velocity: [f64; 3],
}

#[derive(Deserialize, Clone, Copy)]
#[serde(rename_all = "kebab-case")]
enum EquationsName {
    Exact,
    AsPublished,
}

impl Flight {
    /// Reads a `flight.toml`, the one in a folder, or a bare MVNX file with defaults for everything else.
    ///
    /// # Errors
    /// Returns an error with file, line and field if a file is missing or a value cannot be used.
    pub fn read(path: &Path) -> Result<Self> {
        let inside = path.join("flight.toml");
        let path = if path.is_dir() {
            if !inside.is_file() {
                return Err(Problem::bad_input("this folder has no flight.toml")
                    .in_file(path)
                    .help("give the flight.toml or the recording itself"));
            }
            &inside
        } else {
            path
        };
        let is_toml = path
            .extension()
            .is_some_and(|extension| extension == "toml");
        let flight = if is_toml {
            Self::parse(&input::settings(path, FileKind::Flight)?, path)?
        } else {
            Self::bare(path)
        };
        // Not read yet, but no output may replace them meanwhile.
        input::claim(&flight.recording);
        flight.gnss.iter().for_each(|track| input::claim(track));
        Ok(flight)
    }

    /// Reads a `flight.toml`, the one in a folder, or a `subject.toml` as a flight in still air, for those who need the
    /// person and the air alone.
    ///
    /// # Errors
    /// Returns an error if the file is neither, or unusable.
    pub fn read_person(path: &Path) -> Result<Self> {
        if path.is_dir() || input::kind(path) == Some(FileKind::Flight) {
            return Self::read(path);
        }
        Ok(Self {
            subject: Subject::read(path)?,
            has_subject: true,
            ..Self::bare(path)
        })
    }

    /// Opens the recording. If the flight has a receiver's track, its clock is first aligned with the recording's.
    ///
    /// # Errors
    /// Returns an error if a file cannot be used, or the clocks cannot be aligned.
    pub fn open(&self, options: Options) -> Result<Frames> {
        let track = self.gnss.as_deref().map(|path| Track {
            path,
            begin_s: self.gnss_begin_s,
        });
        let frames = Frames::open(&self.recording, track, options)?;
        Ok(frames
            .of_person(&self.subject.body(), self.has_subject)
            .with_doubts(self.unlikely_conditions())
            .in_air(self.air_velocity)
            .with_inputs(self.inputs.as_ref().and_then(InputHistory::ends)))
    }

    /// Air and coefficients that nobody flies in or has.
    fn unlikely_conditions(&self) -> Vec<Warning> {
        let density = match self.density {
            DensityChoice::Constant(density) => Some(density),
            DensityChoice::FirstFrameAltitude(_) => None,
        };
        conditions::doubted(self.air_velocity, density, &self.subject)
    }

    /// Why nobody is this person or flies in this air, without any recording.
    pub fn doubt(&self) -> Option<String> {
        let person = person::unlikely(&self.subject.body());
        let others = self
            .unlikely_conditions()
            .into_iter()
            .map(|warning| warning.message);
        let said: Vec<String> = person.into_iter().chain(others).collect();
        (!said.is_empty()).then(|| said.join("; "))
    }

    /// A recording alone: default subject, still air of [`DEFAULT_DENSITY`].
    pub fn bare(recording: &Path) -> Self {
        Self {
            recording: recording.to_path_buf(),
            subject: Subject::default(),
            density: DensityChoice::Constant(DEFAULT_DENSITY),
            air_velocity: [0.0; 3],
            equations: Equations::default(),
            muscles: muscle_input::BACK_TRACKING.with_forces(MuscleForces::Moment),
            inputs: None,
            effects: Effects::default(),
            gnss: None,
            gnss_begin_s: None,
            start: Start::default(),
            has_subject: false,
            tolerances: Tolerances::default(),
            segment_errors: None,
            doubted: Vec::new(),
        }
    }

    /// Parses the text of a `flight.toml`; `path` is used in messages and to resolve the files it refers to.
    ///
    /// # Errors
    /// Returns an error if a file is missing or a value cannot be used.
    pub fn parse(text: &str, path: &Path) -> Result<Self> {
        let file: FlightFile =
            toml::from_str(text).map_err(|error| Problem::toml(&error, text, path))?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let at = |field: &str, message: String| {
            Problem::bad_input(message)
                .in_file(path)
                .at(format!("field {field}"))
                .on_its_line(text)
        };
        let here = |problem: Problem| problem.in_file(path).on_its_line(text);
        let density = file.air.density().map_err(here)?;
        if !file.air.velocity.iter().all(|v| v.abs() <= 150.0) {
            return Err(at(
                "air.velocity",
                format!(
                    "expected three numbers within 150 m/s, found {:?}",
                    file.air.velocity
                ),
            ));
        }
        let muscles = match &file.muscles {
            None => muscle_input::BACK_TRACKING,
            Some(name) => MuscleModel::from_name(name).ok_or_else(|| {
                Problem::unknown(
                    "limb groups",
                    name,
                    muscle_input::MODELS.map(|(name, _)| name),
                )
                .in_file(path)
                .at("field muscles")
                .on_its_line(text)
            })?,
        };
        let forces = match file.muscle_forces {
            None | Some(MuscleForcesName::Moment) => MuscleForces::Moment,
            Some(MuscleForcesName::Paper) => MuscleForces::Paper,
        };
        Ok(Self {
            recording: folder.join(&file.recording),
            subject: match &file.subject {
                Some(subject) => Subject::read(&folder.join(subject))?,
                None => Subject::default(),
            },
            density,
            air_velocity: file.air.velocity,
            equations: match file.equations {
                None | Some(EquationsName::Exact) => Equations::Exact,
                Some(EquationsName::AsPublished) => Equations::AsPublished,
            },
            muscles: (file.with_lever_arms(muscles.with_forces(forces))).map_err(here)?,
            inputs: match &file.inputs {
                Some(inputs) => Some(InputHistory::read(&folder.join(inputs))?),
                None => None,
            },
            effects: Effects::default(),
            gnss: file.gnss.map(|gnss| folder.join(gnss)),
            gnss_begin_s: file.gnss_begin_s,
            start: Start::default(),
            has_subject: file.subject.is_some(),
            tolerances: tolerances(&file.suit, &file.tolerance)
                .map_err(|(field, message)| at(field, message))?,
            segment_errors: (file.suit.segment_errors())
                .map_err(|message| at("suit.segments_deg", message))?,
            doubted: (file.suit.doubted()).map_err(|message| at("suit.doubted", message))?,
        })
    }

    /// The conscious inputs at a time (s): the known ones, or else the subject's damping.
    pub fn inputs_at(&self, time: f64) -> Inputs<f64> {
        match &self.inputs {
            Some(history) => history.at(time),
            None => self.constant_inputs(),
        }
    }

    /// The subject's damping without muscle input.
    pub fn constant_inputs(&self) -> Inputs<f64> {
        Inputs {
            damping: self.subject.damping(),
            ..Inputs::belly_turn()
        }
    }

    /// The model of this flight; `first_height` is where the recording starts (m, inertial).
    pub fn dynamics(&self, first_height: f64) -> Dynamics<f64> {
        let [north, west, up] = self.air_velocity;
        let density = match self.density {
            DensityChoice::Constant(density) => Density::Constant(density),
            DensityChoice::FirstFrameAltitude(altitude) => Density::StandardAtmosphere {
                origin_altitude: altitude - first_height,
            },
        };
        Dynamics {
            body: self.subject.body(),
            aerodynamics: self.subject.aerodynamics(),
            air: Air {
                density,
                velocity: Vector::new(north, west, up),
                ..Air::still(0.0)
            },
            stream: Stream::uniform(),
            muscles: self.muscles,
            gravity: bodyflight_core::air::GRAVITY,
        }
    }
}

impl FlightFile {
    /// The limbs with the file's lever arms, if it gives any.
    fn with_lever_arms(&self, muscles: MuscleModel) -> Result<MuscleModel> {
        let Some(arms) = self.lever_arms else {
            return Ok(muscles);
        };
        let at = |message: String| Problem::bad_input(message).at("field lever_arms");
        if muscles.forces == MuscleForces::Moment {
            return Err(at(
                "expected muscle_forces = \"paper\" beside lever arms, which only these forces have"
                    .to_owned(),
            ));
        }
        if arms.iter().any(|arm| !(0.01..=1000.0).contains(arm)) {
            return Err(at(format!(
                "expected four shares of the stature from 0.01 to 1000, found {arms:?}"
            )));
        }
        Ok(muscles.with_lever_arms(arms))
    }
}

impl AirTable {
    /// The density, given in one of the two ways.
    fn density(&self) -> Result<DensityChoice> {
        let at =
            |field: &str, message: String| Problem::bad_input(message).at(format!("field {field}"));
        match (self.density, self.altitude_m) {
            (Some(_), Some(_)) => Err(at("air", "density and altitude_m are both given".into())
                .help(
                    "keep one: density for constant air, altitude_m for the standard atmosphere",
                )),
            (Some(density), None) if density > 0.0 && density <= 2.0 => {
                Ok(DensityChoice::Constant(density))
            }
            (Some(density), None) => Err(at(
                "air.density",
                format!("expected more than 0 and at most 2 kg/m3, found {density}"),
            )),
            (None, Some(altitude)) if (-500.0..=11_000.0).contains(&altitude) => {
                Ok(DensityChoice::FirstFrameAltitude(altitude))
            }
            (None, Some(altitude)) => Err(at(
                "air.altitude_m",
                format!("expected -500 to 11000 m above sea level, found {altitude}"),
            )),
            (None, None) => Ok(DensityChoice::Constant(DEFAULT_DENSITY)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bodyflight_core::Segment;

    fn parse(text: &str) -> Result<Flight> {
        Flight::parse(text, Path::new("flight.toml"))
    }

    #[test]
    fn a_flight_needs_only_its_recording() {
        let flight = parse("recording = \"a.mvnx\"").unwrap();
        assert_eq!(flight.recording, Path::new("a.mvnx"));
        assert_eq!(flight.density, DensityChoice::Constant(DEFAULT_DENSITY));
    }

    #[test]
    fn tolerances_are_those_of_the_file() {
        let flight =
            parse("recording = \"a.mvnx\"\n[suit]\njoint_deg = 3\n[tolerance]\nmass = 0.1")
                .unwrap();
        let expected = Tolerances {
            joint_deg: 3.0,
            mass: 0.1,
            ..Tolerances::default()
        };
        assert_eq!(flight.tolerances, expected);
    }

    #[test]
    fn errors_of_segments_are_those_of_the_file_and_go_outwards() {
        let text = "recording = \"a.mvnx\"\n[suit]\nsegments_deg = { l_thigh = 6, thorax = 4 }";
        let errors = parse(text).unwrap().segment_errors.unwrap();
        for (segment, degrees) in [
            (Segment::LeftThigh, 6.0),
            (Segment::LeftFoot, 6.0),
            (Segment::RightHand, 4.0),
            (Segment::RightThigh, 0.1),
        ] {
            assert!((errors[segment].to_degrees() - degrees).abs() < 1e-9);
        }
        assert!(
            parse("recording = \"a.mvnx\"")
                .unwrap()
                .segment_errors
                .is_none()
        );
    }

    #[test]
    fn doubted_segments_are_those_of_the_file() {
        let text = "recording = \"a.mvnx\"\n[suit]\ndoubted = [\"l_thigh\"]\n[suit.segments_deg]\nhead = 9";
        assert_eq!(parse(text).unwrap().doubted, [Segment::LeftThigh]);
    }

    #[test]
    fn lever_arms_are_those_of_the_file() {
        let arms = [2.8, 1.2, 1.8, 2.2];
        let text =
            format!("recording = \"a.mvnx\"\nmuscle_forces = \"paper\"\nlever_arms = {arms:?}");
        let muscles = parse(&text).unwrap().muscles;
        assert_eq!(muscles, muscle_input::BACK_TRACKING.with_lever_arms(arms));
        assert_eq!(muscles.name(), "back-tracking");
    }

    #[test]
    fn altitude_is_that_of_the_first_frame() {
        let flight = parse("recording = \"a.mvnx\"\n[air]\naltitude_m = 3800").unwrap();
        let dynamics = flight.dynamics(100.0);
        let expected = bodyflight_core::air::standard_density(3800.0);
        assert!((dynamics.air.density.at(100.0) - expected).abs() < 1e-12);
    }

    #[test]
    fn bad_values_are_named() {
        for (text, parts) in [
            (
                "recording = \"a\"\n[air]\ndensity = -1",
                ["air.density", "-1"],
            ),
            (
                "recording = \"a\"\n[air]\ndensity = 0.0",
                ["air.density", "more than 0"],
            ),
            (
                "recording = \"a\"\n[air]\ndensity = 1.0\naltitude_m = 3",
                ["field air", "both"],
            ),
            (
                "recording = \"a\"\n[air]\naltitude_m = 1e9",
                ["air.altitude_m", "1000000000"],
            ),
            (
                "recording = \"a\"\n[air]\nvelocity = [0, 0, 999]",
                ["air.velocity", "999"],
            ),
            (
                "recording = \"a\"\n[suit]\njoint_deg = 99",
                ["suit.joint_deg", "99"],
            ),
            (
                "recording = \"a\"\n[suit]\nsegments_deg = { tail = 3 }",
                ["suit.segments_deg", "tail"],
            ),
            (
                "recording = \"a\"\n[suit]\ndoubted = [\"tail\"]",
                ["suit.doubted", "tail"],
            ),
            (
                "recording = \"a\"\n[suit]\nsegments_deg = { head = 0 }",
                ["suit.segments_deg", "head: expected 0.1 to 90"],
            ),
            (
                "recording = \"a\"\n[tolerance]\nmass = 0",
                ["tolerance.mass", "0"],
            ),
            ("recording = \"a\"\nmuscles = \"tail\"", ["muscles", "tail"]),
            (
                "recording = \"a\"\nlever_arms = [1.0, 1.0, 1.0, 1.0]",
                ["lever_arms", "muscle_forces"],
            ),
            (
                "recording = \"a\"\nmuscle_forces = \"paper\"\nlever_arms = [0.0, 1.0, 1.0, 1.0]",
                ["lever_arms", "0.0, 1.0"],
            ),
            (
                "recording = \"a\"\nsbject = \"b\"",
                ["flight.toml:2", "sbject"],
            ),
            ("subject = \"b\"", ["flight.toml", "recording"]),
        ] {
            let problem = parse(text).unwrap_err().to_string();
            for part in parts {
                assert!(problem.contains(part), "{text}: {problem}");
            }
        }
    }
}
