//! The page with its data.

use std::io::{BufRead, BufReader};
use std::path::Path;

use bodyflight_core::Segment;
use bodyflight_viewer::cockpit::{CONTROLS, STARTS, WARNING_HEIGHT};
use bodyflight_viewer::frame;
use bodyflight_viewer::setup::Setup;
use serde::Serialize;
use serde_json::Value;
use sha2::{Digest, Sha256};

use super::run::Run;
use super::shape::{Shape, Worn, shapes};
use crate::compare::page::Beside;
use crate::compare::words::joint;
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::input;
use bodyflight_replay::flight::{DensityChoice, Flight};
use bodyflight_replay::subject::Subject;

/// The page, as `cargo xtask viewer` builds it.
const PAGE: &str = include_str!("../../data/viewer.html");

/// The place for the data.
const MARK: &str = "<script type=\"application/json\" id=\"bodyflight-data\">null</script>";

/// Version of the data; a page refuses versions that it does not know.
pub const SCHEMA: u32 = 4;

/// Kind of page.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(rename_all = "kebab-case")]
pub enum Mode {
    /// Shows flights.
    Replay,
    /// Shows what a stream sends.
    Live,
    /// Flies by keyboard.
    Fly,
    /// Shows two flights beside each other.
    Compare,
}

/// An input file, to record the origin of a page.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Input {
    /// Name of the file, without its folder.
    pub file: String,
    /// SHA-256 of its content, hexadecimal.
    pub sha256: String,
}

impl Input {
    /// Hashes a file.
    ///
    /// # Errors
    /// Returns an error if it cannot be read.
    pub fn of(path: &Path) -> Result<Self> {
        let refused = |error| Problem::system("read", path, error);
        let mut hasher = Sha256::new();
        let mut file = BufReader::new(input::file(path)?);
        loop {
            let piece = file.fill_buf().map_err(refused)?;
            if piece.is_empty() {
                break;
            }
            hasher.update(piece);
            let length = piece.len();
            file.consume(length);
        }
        let name = path.file_name().unwrap_or(path.as_os_str());
        Ok(Self {
            file: name.to_string_lossy().into_owned(),
            sha256: hasher
                .finalize()
                .iter()
                .map(|byte| format!("{byte:02x}"))
                .collect(),
        })
    }
}

/// Origin of a page.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Provenance {
    /// Version of bodyflight.
    pub version: &'static str,
    /// The command that made the page.
    pub command: String,
    /// The files that were read.
    pub inputs: Vec<Input>,
}

impl Provenance {
    /// Records a command and the files that it read.
    ///
    /// # Errors
    /// Returns an error if a file cannot be read.
    pub fn of(command: String, files: &[&Path]) -> Result<Self> {
        Ok(Self {
            version: env!("CARGO_PKG_VERSION"),
            command,
            inputs: files
                .iter()
                .map(|file| Input::of(file))
                .collect::<Result<_>>()?,
        })
    }
}

/// Data that the page needs for its own simulation.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct FlyData {
    /// The model, see [`bodyflight_viewer::setup`].
    pub setup: Vec<f32>,
    /// Density of the air (kg/m3).
    pub density_kgpm3: f64,
    /// Mass of the person with all equipment (kg).
    pub mass_kg: f64,
    /// How segments are drawn.
    pub shapes: Vec<Shape>,
    /// What the skydiver wears.
    pub worn: Worn,
    /// Names of the start conditions.
    pub starts: Vec<&'static str>,
    /// Names of the controls.
    pub controls: Vec<&'static str>,
    /// What a coach calls the joint at the proximal end of each segment.
    pub joints: Vec<&'static str>,
    /// Height above the ground below which the page warns (m).
    pub warning_height_m: f32,
    /// Parts of a frame, with the count of numbers in each.
    pub layout: Vec<(&'static str, usize)>,
    /// Parts of a segment, with the count of numbers in each.
    pub segment_layout: Vec<(&'static str, usize)>,
}

/// A mark in time with a note, which the reader of a page makes.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Note {
    /// Time of the flight (s).
    pub time_s: f64,
    /// What the reader wrote.
    pub text: String,
}

/// A video beside the body, which the reader of a page chooses.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Video {
    /// Name of the file.
    pub name: String,
    /// Time of the flight at the first picture of the video (s).
    pub begins_s: f64,
    /// The file as base64, if the reader embedded it.
    pub content: Option<String>,
}

/// All data of a page.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct PageData {
    /// Version of the data, [`SCHEMA`].
    pub schema: u32,
    /// Kind of page.
    pub mode: Mode,
    /// Title.
    pub title: String,
    /// Origin of the page.
    pub provenance: Provenance,
    /// Flights.
    pub runs: Vec<Run>,
    /// The report of `bodyflight discover`.
    #[cfg_attr(test, ts(type = "unknown"))]
    pub discovery: Option<Value>,
    /// Data for flying.
    pub fly: Option<FlyData>,
    /// Two flights beside each other.
    pub beside: Option<Beside>,
    /// Marks and notes; a page as written has none, one that its reader saves has the reader's.
    pub notes: Vec<Note>,
    /// The video that the reader chose.
    pub video: Option<Video>,
}

/// The model of a subject for the page, in still air of constant density (kg/m3): that of a flight whose `flight.toml`
/// gives nothing else.
pub fn setup(subject: &Subject, density: f64) -> Setup {
    let flight = Flight {
        subject: subject.clone(),
        density: DensityChoice::Constant(density),
        ..Flight::bare(Path::new(""))
    };
    Setup {
        dynamics: flight.dynamics(0.0).cast(),
        inputs: flight.constant_inputs().cast(),
    }
}

impl FlyData {
    /// Data for a subject in air of this density (kg/m3).
    pub fn new(subject: &Subject, density: f64) -> Self {
        Self {
            setup: setup(subject, density).numbers().to_vec(),
            density_kgpm3: density,
            mass_kg: subject.body().mass(),
            shapes: shapes(subject),
            worn: Worn::of(subject),
            starts: STARTS.iter().map(|start| start.name).collect(),
            controls: CONTROLS.iter().map(|control| control.name).collect(),
            joints: Segment::ALL.map(joint).to_vec(),
            warning_height_m: WARNING_HEIGHT,
            layout: frame::LAYOUT.to_vec(),
            segment_layout: frame::SEGMENT_LAYOUT.to_vec(),
        }
    }
}

impl PageData {
    /// A page without flights.
    pub fn of(mode: Mode, title: String, provenance: Provenance, fly: FlyData) -> Self {
        Self {
            mode,
            fly: Some(fly),
            ..Self::replay(title, provenance, Vec::new())
        }
    }

    /// A page that shows flights.
    pub fn replay(title: String, provenance: Provenance, runs: Vec<Run>) -> Self {
        Self {
            schema: SCHEMA,
            mode: Mode::Replay,
            title,
            provenance,
            runs,
            discovery: None,
            fly: None,
            beside: None,
            notes: Vec::new(),
            video: None,
        }
    }

    /// A page that shows two flights beside each other.
    pub fn compare(title: String, provenance: Provenance, beside: Beside) -> Self {
        Self {
            mode: Mode::Compare,
            beside: Some(beside),
            ..Self::replay(title, provenance, Vec::new())
        }
    }
}

/// The page as one HTML file.
///
/// # Errors
/// Returns an error if the data cannot be written as JSON.
pub fn html(data: &PageData) -> Result<String> {
    filled(PAGE, data)
}

fn filled(page: &str, data: &PageData) -> Result<String> {
    let (before, after) = page
        .split_once(MARK)
        .ok_or_else(|| Problem::internal("the viewer's page has no place for data"))?;
    let json = serde_json::to_string(data)
        .map_err(|error| Problem::internal("cannot write JSON").caused_by(error))?;
    // Names come from users, and must not be able to end the script.
    let json = json.replace('<', "\\u003c");
    let mark = MARK.replace("null", &json);
    Ok([before, &mark, after].concat())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn data(title: &str) -> PageData {
        let provenance = Provenance::of("view".to_owned(), &[]).unwrap();
        PageData::replay(title.to_owned(), provenance, Vec::new())
    }

    #[test]
    fn a_title_cannot_close_its_script_element() {
        let page = format!("<html>{MARK}</html>");
        let html = filled(&page, &data("</script><script>alert(1)")).unwrap();
        assert_eq!(html.matches("</script>").count(), 1, "{html}");
        assert!(html.contains("\\u003c/script"));
    }

    #[test]
    fn the_page_has_a_place_for_data() {
        assert!(html(&data("x")).unwrap().contains("\"x\""));
    }
}
