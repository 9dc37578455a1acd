//! Whether error bars are right: squared errors of muscle input and damping over the stated variances, which should be one
//! on average, in flights whose recorded joints are off by 0 to 8 degrees, throughout or wandering.
//!
//! `cargo bench -p bodyflight-benches --bench error_bars -- --seeds 3 --scores FILE --seconds 200 --write` flies all maneuvers
//! and writes the table of `docs/estimator.md`. It begins no flight after the given time, and keeps what it flew in the file;
//! the same command goes on from there until all is flown. Seed by seed, a maneuver with every joint error comes before the
//! next one, so rows are comparable at any time, and say how many flights they have. Without `--write` the
//! table is only printed.
//!
//! Inputs are those of the maneuver, and beside them vary as slowly and as much as the filter expects of quiet input;
//! otherwise a bar that says how much they may vary would only ever be too large. `--from SEED`, `--seeds NUMBER` and `--only
//! NAME,NAME` select flights, `--degrees 4,8` and `--kind wandering` joint errors, `--each` prints each flight and, below it,
//! each input. `--flights FOLDER` reads flights with a `truth.json` instead; with `--receiver RATE` their velocities are
//! those of a receiver with this rate, whose errors last for `--lasts SECONDS`.
#![expect(clippy::expect_used, reason = "a failing bench may panic")]

#[path = "error_bars/kept.rs"]
mod kept;
#[path = "error_bars/score.rs"]
mod score;

use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::Instant;

use bodyflight_core::axis::AxisCoefficients;
use bodyflight_core::maneuver::Maneuver;
use bodyflight_core::maneuver::scripts::MANEUVERS;
use bodyflight_estimation::motion::{self, Settings};
use bodyflight_io::diagnostic::Result;
use bodyflight_laboratory::synthesize::{JointError, Request, synthesize};
use bodyflight_mvnx::recording::Options;
use bodyflight_replay::Precision;
use bodyflight_replay::flight::Flight;
use bodyflight_replay::subject::Subject;
use bodyflight_tests::estimator_flights::Noise;
use bodyflight_tests::receiver::Receiver;
use kept::{Case, Kept};
use rayon::iter::{IntoParallelRefIterator, ParallelBridge, ParallelIterator};
use score::{HEAD, Score};
use serde_json::Value;

const METHODS: [&str; 2] = ["filter", "smoother"];

/// How joint errors act.
const KINDS: [&str; 2] = ["constant", "wandering"];

/// Errors of the joints (degrees).
const DEGREES: [f64; 6] = [0.0, 0.5, 1.0, 2.0, 4.0, 8.0];

/// Deviation of the inputs about those of the script, and their time (s): muscle input, then damping.
const VARIES: [([f64; 3], f64); 2] = [([0.3, 0.3, 0.3], 4.0), ([1.0, 0.4, 1.5], 2.0)];

/// Estimates a flight by each method. Returns an error if its recording is refused.
fn scores(flight: &Flight, truth: impl Fn(f64) -> [f64; 6]) -> Result<[Score; 2]> {
    let settings = Settings::usual(&flight.subject);
    let (options, precision) = (Options::default(), Precision::Double);
    let both = motion::estimate_both(flight, &settings, options, precision)?;
    Ok(both.map(|estimation| Score::of(&estimation, &truth)))
}

/// Inputs of a maneuver that vary beside those of its script.
fn varied(maneuver: &Maneuver, seed: u64) -> Maneuver {
    const STEP: f64 = 0.1;
    let mut noise = Noise::new(seed);
    let mut beside = VARIES.map(|(sizes, _)| sizes.map(|size| noise.normal(size)));
    let mut knots = [Vec::new(), Vec::new()];
    let mut time = 0.0;
    while time < maneuver.duration + STEP {
        let inputs = maneuver.inputs::<f64>(time);
        let script = [inputs.muscle.to_array(), inputs.damping.to_array()];
        for (kind, (sizes, lasting)) in VARIES.into_iter().enumerate() {
            let sum = std::array::from_fn(|axis| script[kind][axis] + beside[kind][axis]);
            knots[kind].push((time, AxisCoefficients::from(sum)));
            let kept = (-STEP / lasting).exp();
            for axis in 0..3 {
                let added = noise.normal(sizes[axis] * (1.0 - kept * kept).sqrt());
                beside[kind][axis] = kept * beside[kind][axis] + added;
            }
        }
        time += STEP;
    }
    let [muscle, damping] = knots.map(|knots| &*knots.leak());
    Maneuver {
        muscle,
        damping,
        ..*maneuver
    }
}

/// Flies a maneuver with the joint errors of a case and estimates its inputs. Returns `None`, and says so, if a damping that
/// varies to below zero lets the body spin beyond all numbers, or faster than a recording may.
fn flown(case: &Case) -> Option<[Score; 2]> {
    let Case { kind, seed, .. } = *case;
    let size = case.degrees.to_radians();
    let of = |meant: &str| if kind == meant { size } else { 0.0 };
    let [calibration, wander] = KINDS.map(of);
    let joint_error = JointError {
        calibration,
        wander,
    };
    let maneuver = Maneuver::from_name(case.maneuver).expect("a maneuver");
    let maneuver: &'static Maneuver = Box::leak(Box::new(varied(maneuver, seed)));
    let subject = Subject::default();
    let request = Request {
        joint_error,
        ..Request::new(maneuver, &subject, seed)
    };
    let folder = tempfile::tempdir().expect("a folder");
    let written = synthesize(&request, folder.path(), &mut |_| ());
    let written = written
        .inspect_err(|problem| println!("{}, {seed}: {}", maneuver.name, problem.message))
        .ok()?;
    let mut flight = Flight::read(&written.flight).expect("the flight");
    // The true inputs are withheld, since they are to be estimated.
    flight.inputs = None;
    let scores = scores(&flight, |time| {
        let inputs = maneuver.inputs::<f64>(time);
        let [a, b, c] = inputs.muscle.to_array();
        let [d, e, f] = inputs.damping.to_array();
        [a, b, c, d, e, f]
    });
    scores
        .inspect_err(|problem| println!("{}, {seed}: {}", maneuver.name, problem.message))
        .ok()
}

/// Prints the rows of the pairs of flights in a folder that are meant, with the velocities of a receiver if there is
/// one, and of those together that are not doubted.
fn recorded(folder: &Path, is_meant: &dyn Fn(&str) -> bool, receiver: Option<Receiver>) {
    let mut flights: Vec<PathBuf> = std::fs::read_dir(folder)
        .expect("a folder")
        .map(|entry| entry.expect("an entry"))
        .filter(|pair| is_meant(&pair.file_name().to_string_lossy()))
        .flat_map(|pair| ["flight-0", "flight-1"].map(|part| pair.path().join(part)))
        .filter(|flight| flight.is_dir())
        .collect();
    flights.sort();
    let scores: Vec<[Score; 2]> = flights
        .par_iter()
        .map(|flight| of_recorded(flight, receiver))
        .collect();
    let mut all = [Score::default(), Score::default()];
    for (from, scores) in flights.iter().zip(&scores) {
        let name = from.strip_prefix(folder).expect("inside").display();
        for (k, score) in scores.iter().enumerate() {
            println!("| {name} | {} | {}", METHODS[k], score.row());
            if !score.is_doubted() {
                all[k] = all[k].clone().merge(score);
            }
        }
    }
    for (score, by) in all.iter().zip(METHODS) {
        println!("| all that are not doubted | {by} | {}", score.row());
    }
}

/// Estimates a flight with a `truth.json`.
fn of_recorded(from: &Path, receiver: Option<Receiver>) -> [Score; 2] {
    let to = tempfile::tempdir().expect("a folder");
    for name in ["flight.toml", "subject.toml", "segments.json"] {
        std::fs::copy(from.join(name), to.path().join(name)).expect("a file");
    }
    let packed = from.join("flight.mvnx.xz");
    let recording = to.path().join("flight.mvnx");
    std::fs::copy(packed, &recording).expect("a recording");
    let text = std::fs::read_to_string(from.join("truth.json")).expect("the truth");
    let truth: Value = serde_json::from_str(&text).expect("JSON");
    let pitch = truth["in_pitch"].as_f64().unwrap_or(0.0);
    let damping = truth["damp"].as_f64().unwrap_or(1.0);
    let truth = [pitch, 0.0, 0.0, 3.0 * damping, 0.5 * damping, 6.0 * damping];
    let mut flight = Flight::read(&to.path().join("flight.toml")).expect("a flight");
    if let Some(receiver) = receiver {
        let track = to.path().join("TRACK.CSV");
        std::fs::write(&track, receiver.track(&recording, 5)).expect("a track");
        flight.gnss = Some(track);
    }
    scores(&flight, |_| truth).expect("estimates")
}

/// The arguments of the command line.
struct Arguments(Vec<String>);

impl Arguments {
    fn option(&self, name: &str) -> Option<&String> {
        let place = self.0.iter().position(|argument| argument == name);
        place.and_then(|place| self.0.get(place + 1))
    }

    fn number<T: std::str::FromStr>(&self, name: &str) -> Option<T> {
        let text = self.option(name)?;
        Some(text.parse().ok().expect("a number"))
    }

    fn has(&self, name: &str) -> bool {
        self.0.iter().any(|argument| argument == name)
    }

    fn is_meant(&self, name: &str) -> bool {
        let only = self.option("--only");
        only.is_none_or(|only| only.split(',').any(|meant| meant == name))
    }

    /// Kinds and sizes (degrees) of joint errors.
    fn rows(&self) -> Vec<(&'static str, f64)> {
        let sizes = self.option("--degrees").map_or(DEGREES.to_vec(), |text| {
            let sizes = text.split(',').map(|size| size.parse().expect("a number"));
            sizes.collect()
        });
        let meant = self.option("--kind");
        let kinds = KINDS
            .into_iter()
            .filter(|kind| meant.is_none_or(|meant| meant == kind));
        let rows = kinds.flat_map(|kind| {
            let sizes = sizes.iter().map(move |size| (kind, *size));
            // Exact joints are in the rows of constant errors.
            sizes.filter(|(kind, size)| *kind == KINDS[0] || *size > 0.0)
        });
        rows.collect()
    }

    /// Every flight, seed by seed and maneuver by maneuver.
    fn cases(&self, rows: &[(&'static str, f64)]) -> Vec<Case> {
        let from = self.number("--from").unwrap_or(601);
        let seeds: u64 = self.number("--seeds").unwrap_or(1);
        let maneuvers = MANEUVERS.iter().filter(|m| self.is_meant(m.name));
        let maneuvers: Vec<&Maneuver> = maneuvers.collect();
        let mut cases = Vec::new();
        for seed in from..from + seeds {
            for maneuver in &maneuvers {
                cases.extend(rows.iter().map(|(kind, degrees)| Case {
                    degrees: *degrees,
                    kind,
                    maneuver: maneuver.name,
                    seed,
                }));
            }
        }
        cases
    }
}

/// Flies what has not been flown, in this order, so that what is flown is always the beginning. Begins no flight after
/// `seconds`.
fn fly(cases: &[Case], kept: Kept, seconds: u64) -> Kept {
    let due: Vec<&Case> = cases.iter().filter(|case| !kept.has(case)).collect();
    let (kept, begin) = (Mutex::new(kept), Instant::now());
    due.into_iter().par_bridge().for_each(|case| {
        if begin.elapsed().as_secs() < seconds {
            let scores = flown(case);
            kept.lock()
                .expect("no flight panics")
                .keep(case, scores.as_ref());
        }
    });
    kept.into_inner().expect("no flight panics")
}

/// The rows of the table that have a flight; prints `each` flight too.
fn table(rows: &[(&str, f64)], cases: &[Case], kept: &Kept, each: bool) -> Vec<String> {
    let mut table = Vec::new();
    for row in rows {
        let cases = cases.iter().filter(|c| (c.kind, c.degrees) == *row);
        let flown = cases.filter_map(|case| Some((case, kept.scores(case)?)));
        let flown: Vec<(&Case, [Score; 2])> = flown.collect();
        let Some((case, _)) = flown.first() else {
            continue;
        };
        for (k, by) in METHODS.into_iter().enumerate() {
            let all = flown.iter().map(|(_, scores)| &scores[k]);
            let sum = all.fold(Score::default(), Score::merge);
            table.push(format!("| {} | {by} | {}", case.row(), sum.row()));
            for (case, scores) in flown.iter().filter(|_| each) {
                let name = format!("{}, {}, {}", case.row(), case.maneuver, case.seed);
                let (row, each) = (scores[k].row(), scores[k].each());
                println!("| {name} | {by} | {row}\n{each}");
            }
        }
    }
    table
}

fn main() {
    let arguments = Arguments(std::env::args().collect());
    println!("{HEAD}");
    if let Some(folder) = arguments.option("--flights") {
        let receiver = arguments.number("--receiver").map(|rate| Receiver {
            rate,
            deviation: 0.25,
            lasts: arguments.number("--lasts").unwrap_or(0.0),
            before: 7.3,
        });
        let is_meant = |name: &str| arguments.is_meant(name);
        recorded(Path::new(folder), &is_meant, receiver);
        return;
    }
    let rows = arguments.rows();
    let cases = arguments.cases(&rows);
    let kept = Kept::read(arguments.option("--scores").map(PathBuf::from));
    let seconds = arguments.number("--seconds").unwrap_or(u64::MAX);
    let kept = fly(&cases, kept, seconds);
    let table = table(&rows, &cases, &kept, arguments.has("--each"));
    println!("{}", table.join("\n"));
    if arguments.has("--write") {
        kept::write(&table);
    }
}
