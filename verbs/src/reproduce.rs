//! `bodyflight reproduce`: the paper's experiments as simulated flights that anyone can reconstruct, in one report.
//!
//! The paper recorded people; here the model flies scripts of the same maneuvers, with the paper's sensor noise. So a
//! report shows what the method recovers if the model is right, not that the model is right about people: for that, use
//! `bodyflight validate`, and `simulate` on recordings.
//!
//! Each experiment is flown twice: with muscle moments alone, which is the program's model, and matched, with the paper's
//! muscle forces, which is the model that the paper's filter has.

mod drawings;
pub mod experiments;
mod flown;
mod matched;
pub mod report;

use std::path::{Path, PathBuf};

use bodyflight_core::estimator::motion::settings::MOTION;
use rayon::prelude::*;
use serde::Serialize;

use super::sensitivity::{self, sensitivity};
use super::{bifurcation, poses};
use crate::estimate::svg;
use crate::output::figure::Format;
use bodyflight_estimation::motion::{Method, Settings};
use bodyflight_estimation::windows::estimate;
use bodyflight_estimation::{Filter, motion};
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::files::write_file;
use bodyflight_laboratory::synthesize::Additions;
use bodyflight_mvnx::recording::Options;
use bodyflight_replay::Precision;
use bodyflight_replay::flight::Flight;
use drawings::{Drawings, files};
use experiments::{EXPERIMENTS, Experiment};
use flown::{fly, preset};
use report::{Outcome, Parts};

/// Result of a reproduction.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Report {
    /// The file with the report.
    pub report: PathBuf,
    /// Experiments in the order of the paper.
    pub outcomes: Vec<Outcome>,
}

/// Parts of a report that are not flights.
pub const PARTS: [&str; 3] = ["poses", "oscillation-map", "sensitivity"];

/// Those of them that are figures.
const DRAWN_PARTS: [&str; 2] = ["oscillation-map", "sensitivity"];

/// Parts that take minutes.
pub const LONG_PARTS: [&str; 2] = ["levers", "settings"];

/// Names of all experiments and other parts.
pub fn names() -> impl Iterator<Item = &'static str> {
    EXPERIMENTS
        .iter()
        .map(|e| e.name)
        .chain(PARTS)
        .chain(LONG_PARTS)
}

/// Whether an experiment or part is asked for: if none is named, all are but those that take minutes.
pub fn is_wanted(what: &[String], name: &str) -> bool {
    if what.is_empty() {
        !LONG_PARTS.contains(&name)
    } else {
        what.iter().any(|asked| asked == name)
    }
}

/// File names of all figures of a report.
pub fn figures(what: &[String], formats: &[Format]) -> Vec<PathBuf> {
    let experiments = EXPERIMENTS.iter().map(|experiment| experiment.name);
    experiments
        .chain(DRAWN_PARTS)
        .filter(|name| is_wanted(what, name))
        .flat_map(|name| files(name, formats))
        .collect()
}

/// Flies and reconstructs the named experiments, or what [`is_wanted`] if none is named, and writes `report.md`, figures and flights
/// into `folder`. The figures are SVG, and also what is asked for in `formats`. `progress` is called once for each experiment
/// and part that is wanted.
///
/// # Errors
/// Returns an error if a name is unknown, or the folder cannot be written to.
pub fn reproduce(
    what: &[String],
    folder: &Path,
    formats: &[Format],
    progress: &(dyn Fn() + Sync),
) -> Result<Report> {
    let wanted = |name: &str| is_wanted(what, name);
    if let Some(unknown) = what.iter().find(|asked| names().all(|name| name != *asked)) {
        return Err(Problem::unknown("experiment", unknown, names()));
    }
    for format in formats {
        format.available()?;
    }
    let drawings = Drawings { folder, formats };
    std::fs::create_dir_all(folder).map_err(|error| Problem::system("create", folder, error))?;
    let outcomes = EXPERIMENTS
        .par_iter()
        .filter(|experiment| wanted(experiment.name))
        .map(|experiment| {
            let outcome = run(experiment, drawings);
            progress();
            outcome
        })
        .collect::<Result<Vec<_>>>()?;
    let parts = parts(wanted, drawings, progress)?;
    let path = folder.join("report.md");
    let text = report::markdown(&outcomes, &parts);
    write_file(&path, text.as_bytes())?;
    Ok(Report {
        report: path,
        outcomes,
    })
}

/// Computes the parts that are not flights.
fn parts(
    wanted: impl Fn(&str) -> bool,
    drawings: Drawings<'_>,
    progress: &dyn Fn(),
) -> Result<Parts> {
    let folder = drawings.folder;
    let done = |part: &str| {
        if wanted(part) {
            progress();
        }
    };
    let poses = wanted("poses").then(poses::table).transpose()?;
    done("poses");
    let map = wanted("oscillation-map");
    if map {
        let dynamics = Flight::bare(Path::new("")).dynamics(0.0);
        drawings.write("oscillation-map", &bifurcation::svg(&dynamics)?)?;
    }
    done("oscillation-map");
    let sensitivity = wanted("sensitivity").then(|| vary(drawings)).transpose()?;
    done("sensitivity");
    let levers = wanted("levers")
        .then(|| matched::levers(folder))
        .transpose()?;
    done("levers");
    let settings = wanted("settings")
        .then(|| matched::settings(folder))
        .transpose()?;
    done("settings");
    Ok(Parts {
        poses,
        map,
        sensitivity,
        levers,
        settings,
    })
}

/// Varies each parameter by 30 % in the turns of an experienced skydiver, and draws the result.
fn vary(drawings: Drawings<'_>) -> Result<sensitivity::Report> {
    let at = drawings.folder.join("flights/sensitivity");
    let flown = fly("rotations", false, Additions::default(), &at)?;
    let flight = Flight::read(&flown.flight)?;
    let preset = preset("turning-experienced")?;
    let found = sensitivity(&flight, 0.3, Some(preset), Options::default(), &mut || {})?;
    let svg = found.svg("Turns in free fall, each parameter 30 % less and more");
    drawings.write("sensitivity", &svg)?;
    Ok(found)
}

fn run(experiment: &Experiment, drawings: Drawings<'_>) -> Result<Outcome> {
    let folder = drawings.folder;
    let preset = preset(experiment.preset)?;
    let flights = folder.join("flights").join(experiment.name);
    let additions = Additions::default();
    let flown = fly(experiment.maneuver, experiment.tunnel, additions, &flights)?;
    // The reconstruction does not know the inputs that were flown.
    let flight = Flight {
        inputs: None,
        muscles: preset.muscles,
        ..Flight::read(&flown.flight)?
    };
    let options = Options::default();
    let by_paper = estimate(
        &flight,
        preset,
        Filter::Paper,
        options,
        Precision::Double,
        &mut |_| {},
    )?;
    let settings = Settings {
        preset: MOTION,
        keep_noise: false,
        find_joint_error: false,
        filter: Filter::Reduced,
        method: Method::Filter,
    };
    let by_motion = motion::estimate(&flight, &settings, options, Precision::Double, &mut |_| {})?;
    let matched = matched::run(experiment, &by_paper, folder)?;
    let figure = matched
        .figure
        .map_or_else(|| svg(&by_paper, experiment.title), Ok)?;
    let figure = drawings.write(experiment.name, &figure)?;
    Ok(Outcome {
        name: experiment.name,
        duration_s: flown.duration_s,
        amplitude: by_paper.report.amplitude,
        constant: by_paper.report.rms_constant,
        paper_filter: by_paper.report.rms,
        motion_filter: by_motion.report.rms,
        doubt: by_motion.report.doubt,
        matched_amplitude: matched.amplitude,
        matched: matched.gap,
        tunnel: flown.tunnel,
        figure,
    })
}
