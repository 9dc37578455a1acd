//! Accuracy of estimates on flights with known inputs: every maneuver of `synth`, with constant coefficients, the
//! paper's filter and its reduced form with one of the paper's presets, and the motion filter and its smoother.
//!
//! `cargo bench -p bodyflight-benches --bench estimates` prints the tables of `docs/benchmarks.md`. `--from SEED` and
//! `--seeds NUMBER` select the flights, `--only NAME` maneuvers, `--by NAME` methods; `--noise`, `--joints` and
//! `--wander` (degrees) change the errors of the flights. Unless one of the last two is given, a third table shows all
//! maneuvers with exact and with drifting joints.
#![expect(clippy::expect_used, reason = "a failing bench may panic")]

#[path = "estimates/score.rs"]
mod score;

use std::ops::Range;
use std::path::Path;

use bodyflight_core::estimator::motion::settings::{MOTION, MotionPreset, Slopes};
use bodyflight_core::estimator::preset::TRACKING_ON_BACK;
use bodyflight_core::maneuver::Maneuver;
use bodyflight_core::maneuver::scripts::MANEUVERS;
use bodyflight_core::sensor_noise::SensorNoise;
use bodyflight_estimation::motion::{self, Method};
use bodyflight_estimation::windows::estimate;
use bodyflight_estimation::{Estimation, Filter};
use bodyflight_laboratory::synthesize::{JointError, Request, synthesize};
use bodyflight_mvnx::recording::Options;
use bodyflight_replay::Precision;
use bodyflight_replay::flight::Flight;
use bodyflight_replay::subject::Subject;
use rayon::iter::{IntoParallelRefIterator, ParallelIterator};
use score::{INPUTS, RECONSTRUCTION, Score};

const METHODS: [&str; 7] = [
    "constant",
    "paper's, `tracking`",
    "the same, reduced",
    "motion filter",
    "the same, reduced, f32",
    "that with sigma points",
    "smoother",
];

/// Methods based on the motion filter.
const MOTION_METHODS: Range<usize> = 3..METHODS.len();

/// The name of all maneuvers together.
const ALL: &str = "all";

/// Length of flight for which computing times are given (s).
const LENGTH: f64 = 40.0;

/// Joint errors of the third table: its label, constant part and drift (degrees).
const FAMILIES: [(&str, f64, f64); 2] = [
    ("all, exact joints", 0.0, 0.0),
    ("all, joints wander by 1", 1.0, 1.0),
];

/// Settings common to all flights.
#[derive(Clone)]
struct Laboratory {
    subject: Subject,
    noise: SensorNoise,
    joint_error: JointError,
    /// Text that the name of a method must contain for it to be run.
    by: String,
    /// Range of methods from which they are selected.
    among: Range<usize>,
}

impl Laboratory {
    /// Flies a maneuver and estimates its inputs by each method; `None` for methods that are not selected.
    fn scores(&self, maneuver: &'static Maneuver, seed: u64, folder: &Path) -> Vec<Option<Score>> {
        let request = Request {
            noise: self.noise,
            joint_error: self.joint_error,
            ..Request::new(maneuver, &self.subject, seed)
        };
        let folder = folder.join(format!("{}-{seed}", maneuver.name));
        let written = synthesize(&request, &folder, &mut |_| ()).expect("a flight");
        let mut flight = Flight::read(&written.flight).expect("the flight");
        // The true inputs are withheld, since they are to be estimated.
        flight.inputs = None;
        let truth = |time: f64| {
            let inputs = maneuver.inputs::<f64>(time);
            let [a, b, c] = inputs.muscle.to_array();
            let [d, e, f] = inputs.damping.to_array();
            [a, b, c, d, e, f]
        };
        let methods = METHODS.iter().enumerate();
        let scores = methods.map(|(method, name)| {
            let looked_at = self.among.contains(&method) && name.contains(&self.by);
            looked_at.then(|| {
                let estimation = run(&flight, method);
                match method {
                    0 => Score::constant(&estimation.report.rms_constant),
                    _ => Score::of(&estimation, truth),
                }
            })
        });
        let scores = scores.collect();
        std::fs::remove_dir_all(folder).expect("the temporary folder should be removable");
        scores
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let option = |name: &str| {
        let place = arguments.iter().position(|argument| argument == name);
        place.and_then(|place| arguments.get(place + 1)).cloned()
    };
    let number = |name: &str, default: f64| {
        option(name).map_or(default, |text| text.parse().expect("a number"))
    };
    let laboratory = Laboratory {
        subject: Subject::default(),
        noise: SensorNoise::PAPER.scaled(number("--noise", 1.0)),
        joint_error: JointError {
            calibration: number("--joints", 2.0).to_radians(),
            wander: number("--wander", 0.0).to_radians(),
        },
        by: option("--by").unwrap_or_default(),
        among: 0..METHODS.len(),
    };
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "seeds are small"
    )]
    let [from, seeds] = [
        number("--from", 401.0) as u64,
        number("--seeds", 3.0) as u64,
    ];
    let only = option("--only").unwrap_or_default();
    let looked_at = MANEUVERS.iter().filter(|m| m.name.contains(&only));
    let flights: Vec<(&Maneuver, u64)> = looked_at
        .flat_map(|maneuver| (from..from + seeds).map(move |seed| (maneuver, seed)))
        .collect();
    tables(&laboratory, &flights);
    if option("--joints").is_none() && option("--wander").is_none() {
        families(&laboratory, &flights);
    }
}

/// Runs the methods over the flights.
fn scores(
    laboratory: &Laboratory,
    flights: &[(&'static Maneuver, u64)],
) -> Vec<Vec<Option<Score>>> {
    let folder = std::env::temp_dir().join(format!("bodyflight-estimates-{}", std::process::id()));
    let scores = flights
        .par_iter()
        .map(|(maneuver, seed)| laboratory.scores(maneuver, *seed, &folder))
        .collect();
    std::fs::remove_dir_all(&folder).expect("the temporary folder should be removable");
    scores
}

/// Sums the scores of a method over those flights `among` which it was run.
fn summed(
    flights: &[(&Maneuver, u64)],
    scores: &[Vec<Option<Score>>],
    method: usize,
    among: impl Fn(&str) -> bool,
) -> Option<Score> {
    let mut sum = Score::default();
    let found = flights
        .iter()
        .zip(scores)
        .filter(|((m, _), _)| among(m.name));
    for score in found.filter_map(|(_, scores)| scores[method].as_ref()) {
        sum.merge(score);
    }
    (!sum.is_empty()).then_some(sum)
}

/// Prints a row for each maneuver and method, and the computing times of the methods.
fn tables(laboratory: &Laboratory, flights: &[(&'static Maneuver, u64)]) {
    let scores = scores(laboratory, flights);
    let mut reconstruction = vec![RECONSTRUCTION.to_owned()];
    let mut inputs = vec![INPUTS.to_owned()];
    let mut times = Vec::new();
    let mut rows = |name: &str, among: &dyn Fn(&str) -> bool| {
        for (method, by) in METHODS.iter().enumerate() {
            let Some(sum) = summed(flights, &scores, method, among) else {
                continue;
            };
            reconstruction.push(sum.reconstruction(name, by));
            if method > 0 {
                inputs.push(sum.inputs(name, by));
            }
            if let (ALL, Some([least, middle])) = (name, sum.time(LENGTH)) {
                times.push(format!(
                    "{LENGTH} s of flight, {by}: {least:.2} s minimum, {middle:.2} s median"
                ));
            }
        }
    };
    for maneuver in MANEUVERS {
        rows(maneuver.name, &|name| name == maneuver.name);
    }
    rows(ALL, &|_| true);
    println!("{}\n\n{}", reconstruction.join("\n"), inputs.join("\n"));
    println!("\n{}", times.join("\n"));
}

/// Prints the third table: the accuracy of inputs with exact and with drifting joints, by the motion filter and its
/// smoother.
fn families(laboratory: &Laboratory, flights: &[(&'static Maneuver, u64)]) {
    println!("\n{INPUTS}");
    for (name, calibration, wander) in FAMILIES {
        let laboratory = Laboratory {
            joint_error: JointError {
                calibration: f64::to_radians(calibration),
                wander: f64::to_radians(wander),
            },
            among: MOTION_METHODS,
            ..laboratory.clone()
        };
        let scores = scores(&laboratory, flights);
        for (method, by) in METHODS.iter().enumerate() {
            if let Some(sum) = summed(flights, &scores, method, |_| true) {
                println!("{}", sum.inputs(name, by));
            }
        }
    }
}

fn run(flight: &Flight, method: usize) -> Estimation {
    let options = Options::default();
    let windows = |filter| {
        estimate(
            flight,
            &TRACKING_ON_BACK,
            filter,
            options,
            Precision::Double,
            &mut |_| (),
        )
    };
    let motion_by = |filter, method, slopes| {
        let settings = motion::Settings {
            preset: MotionPreset { slopes, ..MOTION },
            keep_noise: false,
            find_joint_error: true,
            filter,
            method,
        };
        let precision = match filter {
            Filter::Paper => Precision::Double,
            // The unit also uses the reduced filter in f32.
            Filter::Reduced => Precision::Single,
        };
        motion::estimate(flight, &settings, options, precision, &mut |_| ())
    };
    let motion = |filter, method| motion_by(filter, method, Slopes::Differences);
    match method {
        0 | 2 => windows(Filter::Reduced),
        1 => windows(Filter::Paper),
        3 => motion(Filter::Paper, Method::Filter),
        4 => motion(Filter::Reduced, Method::Filter),
        5 => motion_by(Filter::Reduced, Method::Filter, Slopes::SigmaPoints),
        _ => motion(Filter::Paper, Method::Smooth),
    }
    .expect("an estimate")
}
