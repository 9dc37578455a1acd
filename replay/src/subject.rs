//! `subject.toml`: a person's measurements, equipment and coefficients. `docs/subject.md` lists the fields.

mod file;
mod segment_table;
mod units;

use std::path::{Path, PathBuf};

use bodyflight_core::aerodynamics::load_model::LoadModel;
use bodyflight_core::aerodynamics::{Aerodynamics, ArchFactor, Coefficients};
use bodyflight_core::body::anthropometry::{Girth, Measure, MomentArm, Person, Sex};
use bodyflight_core::body::gear::{Gear, Shoes, Suit};
use bodyflight_core::{AxisCoefficients, Body, Segment, SegmentArray};
use serde::Serialize;
use std::collections::BTreeMap;

use bodyflight_io::diagnostic::choices::choices;
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::file_kind::FileKind;
use bodyflight_io::files::write_file;
use bodyflight_io::input;
use file::{
    ArchChoice, ArchName, CoefficientTable, GearTable, LoadModelName, MomentArmChoice,
    MomentArmName, SexName, SubjectFile, SuitName,
};
use segment_table::SegmentTable;
use units::unit_meant;

/// The person of a flight, with equipment and coefficients; validated when read.
#[derive(Debug, Clone)]
pub struct Subject {
    file: SubjectFile,
    table: Option<SegmentTable>,
    body: Body<f64>,
}

/// Name of a person's file in a folder.
pub const SUBJECT_FILE: &str = "subject.toml";
/// Name of the segment table that is written beside a `subject.toml`.
pub const SEGMENTS_FILE: &str = "segments.json";
/// Largest coefficient accepted; damping may also be negative, down to minus this value.
const COEFFICIENT_LIMIT: f64 = 100.0;

impl Default for Subject {
    /// 1.75 m, 75 kg, male, with helmet, shoes and a standard suit, and the paper's coefficients.
    fn default() -> Self {
        let file = SubjectFile {
            height_m: 1.75,
            mass_kg: 75.0,
            sex: SexName::Male,
            moment_arm: None,
            aerodynamics: LoadModelName::Paper,
            segments: None,
            girths: BTreeMap::new(),
            gear: GearTable::default(),
            coefficients: CoefficientTable::default(),
        };
        #[expect(
            clippy::expect_used,
            reason = "constant measurements, covered by a test"
        )]
        let body = file.body(None).expect("the default person is valid");
        Self {
            file,
            table: None,
            body,
        }
    }
}

/// Coefficients shared by all segments.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct CommonCoefficients {
    /// Drag.
    pub cd: f64,
    /// Lift: force across the airstream.
    pub cl: f64,
    /// Moment.
    pub cm: f64,
    /// Damping: pitch, yaw, roll.
    pub damp: [f64; 3],
}

impl Subject {
    /// Reads a `subject.toml`, or the one in a folder, and the segment table that it refers to.
    ///
    /// # Errors
    /// Returns an error with file, line, field and what was expected if a file is missing or a value is invalid.
    pub fn read(path: &Path) -> Result<Self> {
        let inside = path.join(SUBJECT_FILE);
        let path = if path.is_dir() {
            if !inside.is_file() {
                return Err(Problem::bad_input("this folder has no subject.toml")
                    .in_file(path)
                    .help(FileKind::Subject.got()));
            }
            &inside
        } else {
            path
        };
        let text = input::settings(path, FileKind::Subject)?;
        Self::parse(&text, path)
    }

    /// Parses the text of a `subject.toml`; `path` is used in messages and to resolve the file it refers to.
    ///
    /// # Errors
    /// Same as [`Subject::read`].
    pub fn parse(text: &str, path: &Path) -> Result<Self> {
        Self::parse_beside(text, path, SegmentTable::read)
    }

    /// Parses the text of a `subject.toml` beside that of the segment table that it refers to, as written by
    /// [`Subject::to_toml`] and [`Subject::segments_json`]; `path` is used in messages.
    ///
    /// # Errors
    /// Same as [`Subject::read`].
    pub fn parse_with_table(text: &str, table: &str, path: &Path) -> Result<Self> {
        Self::parse_beside(text, path, |path| {
            SegmentTable::parse(table.to_owned(), path)
        })
    }

    fn parse_beside(
        text: &str,
        path: &Path,
        table: impl FnOnce(&Path) -> Result<SegmentTable>,
    ) -> Result<Self> {
        let file: SubjectFile =
            toml::from_str(text).map_err(|error| Problem::toml(&error, text, path))?;
        let table = match &file.segments {
            Some(name) => {
                let folder = path.parent().unwrap_or(Path::new(""));
                Some(table(&folder.join(name))?)
            }
            None => None,
        };
        let place = |fault: Fault| {
            Problem::bad_input(fault.message)
                .in_file(path)
                .at(format!("field {}", fault.field))
                .on_its_line(text)
        };
        file.check_coefficients().map_err(place)?;
        let body = file.body(table.as_ref()).map_err(place)?;
        Ok(Self { file, table, body })
    }

    /// The person with equipment.
    ///
    /// A `segments.json` is applied last: its values override all others.
    pub fn body(&self) -> Body<f64> {
        self.body
    }

    /// The person without equipment. With a `segments.json` it equals [`Subject::body`]: the values listed there are
    /// for whole segments, equipment included.
    pub fn bare_body(&self) -> Body<f64> {
        match self.file.bare() {
            Ok(body) if self.table.is_none() => body,
            _ => self.body,
        }
    }

    /// The person's equipment.
    pub fn gear(&self) -> Gear<f64> {
        self.file.gear()
    }

    /// The aerodynamic model with the subject's coefficients.
    pub fn aerodynamics(&self) -> Aerodynamics<f64> {
        let table = &self.file.coefficients;
        let coefficients = SegmentArray::from_fn(|segment| {
            let own = table
                .segment
                .get(segment.name())
                .copied()
                .unwrap_or_default();
            Coefficients {
                drag: own.cd.unwrap_or(table.cd),
                lift: own.cl.unwrap_or(table.cl),
                moment: own.cm.unwrap_or(table.cm),
            }
        });
        let arch = match table.f_arch {
            ArchChoice::Fixed(factor) => ArchFactor::Fixed(factor),
            ArchChoice::Named(ArchName::Posture) => ArchFactor::FromPosture,
        };
        let model = match self.file.aerodynamics {
            LoadModelName::Paper => LoadModel::Paper,
            LoadModelName::FreeFly => LoadModel::FreeFly,
        };
        Aerodynamics {
            coefficients,
            arch,
            model,
        }
    }

    /// Sets how loads depend on the direction of the airstream.
    pub fn set_load_model(&mut self, model: LoadModel) {
        self.file.aerodynamics = match model {
            LoadModel::Paper => LoadModelName::Paper,
            LoadModel::FreeFly => LoadModelName::FreeFly,
        };
    }

    /// Constant damping coefficients.
    pub fn damping(&self) -> AxisCoefficients<f64> {
        self.file.coefficients.damp.into()
    }

    /// The coefficients shared by all segments, which a search varies.
    pub fn common_coefficients(&self) -> CommonCoefficients {
        let table = &self.file.coefficients;
        CommonCoefficients {
            cd: table.cd,
            cl: table.cl,
            cm: table.cm,
            damp: table.damp,
        }
    }

    /// The factor on the drag, if it is a number and does not follow from the posture.
    pub(crate) fn fixed_arch(&self) -> Option<f64> {
        match self.file.coefficients.f_arch {
            ArchChoice::Fixed(factor) => Some(factor),
            ArchChoice::Named(ArchName::Posture) => None,
        }
    }

    /// Returns the same person with the drag, lift and moment coefficients of all segments multiplied by `factors`.
    #[must_use]
    pub fn with_coefficients_times(mut self, factors: [f64; 3]) -> Self {
        let [drag, lift, moment] = factors;
        let table = &mut self.file.coefficients;
        table.cd *= drag;
        table.cl *= lift;
        table.cm *= moment;
        for own in table.segment.values_mut() {
            own.cd = own.cd.map(|value| value * drag);
            own.cl = own.cl.map(|value| value * lift);
            own.cm = own.cm.map(|value| value * moment);
        }
        self
    }

    /// Replaces the damping coefficients.
    pub fn set_damping(&mut self, damping: AxisCoefficients<f64>) {
        self.file.coefficients.damp = damping.to_array();
    }

    /// Returns the text of a `subject.toml`. It refers to the segment table, if any, as [`SEGMENTS_FILE`] in the same
    /// folder.
    ///
    /// # Errors
    /// Returns an error if a value cannot be written as TOML.
    pub fn to_toml(&self) -> Result<String> {
        let mut file = self.file.clone();
        file.segments = self.table.as_ref().map(|_| PathBuf::from(SEGMENTS_FILE));
        toml::to_string(&file)
            .map_err(|error| Problem::internal("cannot write the subject").caused_by(error))
    }

    /// Writes the `subject.toml`, and the segment table if there is one, into a folder that exists.
    ///
    /// # Errors
    /// Returns an error if a file cannot be written.
    pub fn write_in(&self, folder: &Path) -> Result<()> {
        write_file(&folder.join(SUBJECT_FILE), self.to_toml()?.as_bytes())?;
        match self.segments_json() {
            Some(table) => write_file(&folder.join(SEGMENTS_FILE), table.as_bytes()),
            None => Ok(()),
        }
    }

    /// The text of the segment table, if the subject has one.
    pub fn segments_json(&self) -> Option<&str> {
        self.table.as_ref().map(SegmentTable::text)
    }
}

/// An invalid field.
#[derive(Debug)]
struct Fault {
    field: String,
    message: String,
}

impl SubjectFile {
    fn bare(&self) -> core::result::Result<Body<f64>, Fault> {
        let sex = match self.sex {
            SexName::Male => Sex::Male,
            SexName::Female => Sex::Female,
        };
        let mut person = Person::new(self.height_m, self.mass_kg, sex);
        person.moment_arm = match self.moment_arm {
            None | Some(MomentArmChoice::Named(MomentArmName::Width)) => MomentArm::Width,
            Some(MomentArmChoice::Named(MomentArmName::Length)) => MomentArm::Length,
            Some(MomentArmChoice::Share(share)) => MomentArm::FractionOfLength(share),
        };
        for (name, value) in &self.girths {
            let girth = name
                .strip_suffix("_m")
                .and_then(Girth::from_name)
                .ok_or_else(|| {
                    let known = Girth::ALL.map(|girth| format!("{}_m", girth.name()));
                    let known = choices(name, known.iter().map(String::as_str));
                    Fault {
                        field: format!("girths.{name}"),
                        message: format!("unknown girth; {known}"),
                    }
                })?;
            person.girths.set(girth, *value);
        }
        person.body().map_err(|error| Fault {
            field: match error.measure {
                Measure::Height => "height_m".into(),
                Measure::Mass | Measure::BodyMassIndex => "mass_kg".into(),
                Measure::Girth(girth) => format!("girths.{}_m", girth.name()),
                Measure::MomentArm => "moment_arm".into(),
            },
            message: format!("{error}{}", unit_meant(&error)),
        })
    }

    fn body(&self, table: Option<&SegmentTable>) -> core::result::Result<Body<f64>, Fault> {
        let bare = self.bare()?;
        let mut body = self.gear().fit(&bare).map_err(|error| Fault {
            field: match error.item {
                item if item.starts_with("rig") => "gear.rig_kg".into(),
                item if item.starts_with("weight") => "gear.weight_belt_kg".into(),
                _ => "gear.shoe_size_eu".into(),
            },
            message: error.to_string(),
        })?;
        if let Some(table) = table {
            table
                .apply(&mut body)
                .map_err(|(field, message)| Fault { field, message })?;
        }
        Ok(body)
    }

    fn gear(&self) -> Gear<f64> {
        let gear = &self.gear;
        Gear {
            helmet: gear.helmet,
            shoes: match (gear.shoes, gear.shoe_size_eu) {
                (false, _) => Shoes::Barefoot,
                (true, None) => Shoes::Fitted,
                (true, Some(size)) => Shoes::European(size),
            },
            rig: gear.rig_kg,
            weight_belt: gear.weight_belt_kg,
            suit: match gear.suit {
                SuitName::Tight => Suit::Tight,
                SuitName::Standard => Suit::Standard,
                SuitName::Rw => Suit::RelativeWork,
            },
        }
    }

    fn check_coefficients(&self) -> core::result::Result<(), Fault> {
        let table = &self.coefficients;
        let check = |field: &str, value: f64, low: f64| {
            if value >= low && value <= COEFFICIENT_LIMIT {
                return Ok(());
            }
            let message = format!("expected {low} to {COEFFICIENT_LIMIT}, found {value}");
            Err(Fault {
                field: format!("coefficients.{field}"),
                message,
            })
        };
        check("cl", table.cl, 0.0)?;
        check("cd", table.cd, 0.0)?;
        check("cm", table.cm, 0.0)?;
        for value in table.damp {
            check("damp", value, -COEFFICIENT_LIMIT)?;
        }
        if let ArchChoice::Fixed(factor) = table.f_arch {
            check("f_arch", factor, 0.0)?;
        }
        for (name, own) in &table.segment {
            if Segment::from_name(name).is_none() {
                let known = choices(name, Segment::ALL.map(Segment::name));
                return Err(Fault {
                    field: format!("coefficients.segment.{name}"),
                    message: format!("unknown segment; {known}"),
                });
            }
            for (key, value) in [("cl", own.cl), ("cd", own.cd), ("cm", own.cm)] {
                check(&format!("segment.{name}.{key}"), value.unwrap_or(0.0), 0.0)?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Subject> {
        Subject::parse(text, Path::new("subject.toml"))
    }

    const LEAST: &str = "height_m = 1.8\nmass_kg = 80\nsex = \"female\"\n";

    #[test]
    fn three_lines_make_a_subject() {
        let subject = parse(LEAST).unwrap();
        assert!(
            (subject.body().mass() - 82.4).abs() < 0.5,
            "{}",
            subject.body().mass()
        );
        assert_eq!(subject.damping(), AxisCoefficients::new(3.0, 0.5, 6.0));
    }

    #[test]
    fn the_default_subject_is_complete() {
        assert!((Subject::default().body().mass() - 77.4).abs() < 0.5);
    }

    #[test]
    fn the_example_of_the_page_is_taken_as_printed() {
        let page = include_str!("../../docs/subject.md");
        let example = page
            .split("```toml\n")
            .nth(1)
            .unwrap()
            .split("```")
            .next()
            .unwrap();
        let subject = parse(example).unwrap();
        let coefficients = subject.aerodynamics().coefficients;
        assert!((coefficients[Segment::LeftShank].drag - 1.6).abs() < 1e-12);
        assert!((coefficients[Segment::LeftThigh].drag - 1.2).abs() < 1e-12);
    }

    #[test]
    fn writing_and_reading_again_changes_nothing() {
        let text = format!("{LEAST}[girths]\nchest_m = 1.0\n[gear]\nrig_kg = 9\nsuit = \"rw\"\n");
        let subject = parse(&text).unwrap();
        let again = parse(&subject.to_toml().unwrap()).unwrap();
        assert_eq!(subject.file, again.file);
        assert_eq!(subject.body(), again.body());
    }

    #[test]
    fn bad_values_are_named_with_their_line() {
        for (text, parts) in [
            (
                "height_m = 1.8\nmass_kg = -3\nsex = \"male\"",
                ["subject.toml:2", "mass_kg", "-3"],
            ),
            (
                "height_m = nan\nmass_kg = 80\nsex = \"male\"",
                ["subject.toml:1", "height_m", "NaN"],
            ),
            (
                "height_m = 1.8\nmass_kg = 80\nsex = \"man\"",
                ["subject.toml:3", "man", "female"],
            ),
            (
                "height_m = 1.8\nsex = \"male\"",
                ["subject.toml", "missing", "mass_kg"],
            ),
            (
                &format!("{LEAST}weight = 3"),
                ["subject.toml:4", "weight", "unknown"],
            ),
            (
                &format!("{LEAST}[girths]\nneck_m = 0.4"),
                ["subject.toml:5", "girths.neck_m", "chest_m"],
            ),
            (
                &format!("{LEAST}[girths]\nchest_m = 9"),
                ["subject.toml:5", "girths.chest_m", "9"],
            ),
            (
                &format!("{LEAST}[gear]\nrig_kg = -1"),
                ["subject.toml:5", "gear.rig_kg", "-1"],
            ),
            (
                &format!("{LEAST}[gear]\nsuit = \"wing\""),
                ["subject.toml:5", "wing", "rw"],
            ),
            (
                &format!("{LEAST}[coefficients]\ncd = inf"),
                ["subject.toml:5", "coefficients.cd", "inf"],
            ),
            (
                &format!("{LEAST}[coefficients.segment.tail]\ncd = 1"),
                ["subject.toml", "coefficients.segment.tail", "l_shank"],
            ),
            (
                &format!("{LEAST}aerodynamics = \"wing\""),
                ["subject.toml:4", "wing", "free-fly"],
            ),
            (
                &format!("{LEAST}segments = \"nowhere.json\""),
                ["nowhere.json", "read", "No such file"],
            ),
        ] {
            let problem = parse(text).unwrap_err().with_causes();
            for part in parts {
                assert!(problem.contains(part), "{text}\n-> {problem}\nlacks {part}");
            }
        }
    }
}
