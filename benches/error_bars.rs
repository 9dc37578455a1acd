//! Whether error bars are right: squared errors of muscle input and damping over the stated variances, which should be one
//! on average, in flights whose recorded joints are off by 0 to 8 degrees, throughout or wandering.
//!
//! `cargo bench -p bodyflight-benches --bench error_bars` prints the table of `docs/estimator.md`. Inputs are those of the
//! maneuver, and beside them vary as slowly and as much as the filter expects of quiet input; otherwise a bar that says how
//! much they may vary would only ever be too large. `--from SEED`, `--seeds NUMBER` and `--only NAME,NAME` select flights,
//! `--degrees 4,8` selects sizes of joint errors, `--each` prints each maneuver and, below it, each
//! input. `--flights FOLDER` reads flights with a `truth.json` instead; with `--receiver RATE` their
//! velocities are those of a receiver with this rate, whose errors last for `--lasts SECONDS`.
#![expect(clippy::expect_used, reason = "a failing bench may panic")]

use std::path::{Path, PathBuf};

use bodyflight_core::axis::AxisCoefficients;
use bodyflight_core::estimator::motion::settings::MOTION;
use bodyflight_core::estimator::motion::watch::Consistency;
use bodyflight_core::maneuver::Maneuver;
use bodyflight_core::maneuver::scripts::MANEUVERS;
use bodyflight_core::sensor_noise::SensorNoise;
use bodyflight_estimation::motion::{self, Method};
use bodyflight_estimation::{Estimation, Filter};
use bodyflight_laboratory::synthesize::{DEFAULT_SWAY, JointError, Request, synthesize};
use bodyflight_mvnx::recording::Options;
use bodyflight_replay::Precision;
use bodyflight_replay::flight::Flight;
use bodyflight_replay::subject::Subject;
use bodyflight_tests::estimator_flights::Noise;
use bodyflight_tests::receiver::Receiver;
use rayon::iter::{IntoParallelRefIterator, ParallelIterator};
use serde_json::Value;

const METHODS: [(&str, Method); 2] = [("filter", Method::Filter), ("smoother", Method::Smooth)];

/// Errors of the joints (degrees).
const DEGREES: [f64; 6] = [0.0, 0.5, 1.0, 2.0, 4.0, 8.0];

/// Deviation of the inputs about those of the script, and their time (s): muscle input, then damping.
const VARIES: [([f64; 3], f64); 2] = [([0.3, 0.3, 0.3], 4.0), ([1.0, 0.4, 1.5], 2.0)];

/// Stated deviations below this share of those before the flight count as seen.
const SEEN: f64 = 0.7;

const HEAD: &str = "\
| joints (deg) | by | muscle input: squared error over variance, RMS error | damping: the same | where seen: muscle input, damping (share) | in 2 sd, % | joints found (deg) | doubted, consistent |
|---|---|---|---|---|---|---|---|";

/// Sums over estimates. Of two, the first is muscle input and the second is damping.
#[derive(Default, Clone)]
struct Score {
    points: f64,
    ratios: [f64; 2],
    squares: [f64; 2],
    /// Ratios where an input was seen, and their number.
    seen: [[f64; 2]; 2],
    inside: [f64; 2],
    /// Of each input: ratios, squared errors, ratios where it was seen, and their number.
    each: [[f64; 4]; 6],
    /// Size of the joint errors as found, by flight (deg).
    joints: Vec<f64>,
    doubted: f64,
    /// Estimates that are consistent.
    consistent: f64,
}

impl Score {
    fn of(estimation: &Estimation, truth: impl Fn(f64) -> [f64; 6]) -> Self {
        let before = [MOTION.muscle, MOTION.damping_deviation];
        let mut score = Self::default();
        for point in &estimation.points {
            let [_, found @ ..] = point.inputs.columns();
            let [_, deviation @ ..] = point.deviation.columns();
            let truth = truth(point.time);
            score.points += 3.0;
            let is_consistent = point.consistency == Some(Consistency::Consistent);
            score.consistent += 3.0 * f64::from(u8::from(is_consistent));
            for k in 0..6 {
                let kind = k / 3;
                let error = found[k] - truth[k];
                let ratio = (error / deviation[k]).powi(2);
                score.ratios[kind] += ratio;
                score.squares[kind] += error * error;
                score.inside[kind] += f64::from(u8::from(ratio < 4.0));
                let each = &mut score.each[k];
                each[0] += ratio;
                each[1] += error * error;
                if deviation[k] < SEEN * f64::from(before[kind][k % 3]) {
                    each[2] += ratio;
                    each[3] += 1.0;
                    score.seen[kind][0] += ratio;
                    score.seen[kind][1] += 1.0;
                }
            }
        }
        score.joints.extend(estimation.report.joint_error_deg);
        score.doubted = f64::from(u8::from(estimation.report.doubt.is_some()));
        score
    }

    fn merge(mut self, other: &Self) -> Self {
        let add = |a: &mut [f64], b: &[f64]| a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
        add(&mut self.ratios, &other.ratios);
        add(&mut self.squares, &other.squares);
        add(&mut self.inside, &other.inside);
        add(self.each.as_flattened_mut(), other.each.as_flattened());
        add(self.seen.as_flattened_mut(), other.seen.as_flattened());
        self.points += other.points;
        self.doubted += other.doubted;
        self.consistent += other.consistent;
        self.joints.extend(&other.joints);
        self
    }

    /// Each input: ratio, RMS error, and the ratio where it was seen with the share of the time.
    fn inputs(&self) -> String {
        let number = self.points / 3.0;
        let of = |[ratios, squares, seen, times]: &[f64; 4]| {
            let (ratio, rms) = (ratios / number, (squares / number).sqrt());
            let share = 100.0 * times / number;
            format!("{ratio:.2}, {rms:.2}, {:.2} ({share:.0} %)", seen / times)
        };
        let each: Vec<String> = self.each.iter().map(of).collect();
        each.join("; ")
    }

    fn row(&self, name: &str, by: &str) -> String {
        let kind = |k: usize| {
            let rms = (self.squares[k] / self.points).sqrt();
            format!("{:.2}, {rms:.2}", self.ratios[k] / self.points)
        };
        let seen = self.seen.map(|[sum, number]| match number {
            0.0 => "-".to_owned(),
            _ => format!(
                "{:.2} ({:.0} %)",
                sum / number,
                100.0 * number / self.points
            ),
        });
        let [muscle, damping] = self.inside.map(|sum| 100.0 * sum / self.points);
        let mut joints = self.joints.clone();
        joints.sort_by(f64::total_cmp);
        let place = |share: usize| joints.get(share * joints.len().saturating_sub(1) / 2);
        let [least, middle, most] = [0, 1, 2].map(|k| place(k).copied().unwrap_or(f64::NAN));
        format!(
            "| {name} | {by} | {} | {} | {} | {muscle:.0}, {damping:.0} | {middle:.2} ({least:.2} to {most:.2}) | {} of {}, {:.0} % |",
            kind(0),
            kind(1),
            seen.join(", "),
            self.doubted,
            joints.len(),
            100.0 * self.consistent / self.points
        )
    }
}

/// Estimates a flight by each method.
fn scores(flight: &Flight, truth: impl Fn(f64) -> [f64; 6]) -> [Score; 2] {
    let mut preset = MOTION;
    #[expect(clippy::cast_possible_truncation, reason = "a coefficient")]
    let damping = flight.subject.damping().map(|value| value as f32);
    preset.damping = damping.to_array();
    METHODS.map(|(_, method)| {
        let settings = motion::Settings {
            preset,
            keep_noise: false,
            find_joint_error: true,
            filter: Filter::Paper,
            method,
        };
        let (options, precision) = (Options::default(), Precision::Double);
        let estimation = motion::estimate(flight, &settings, options, precision, &mut |_| ());
        Score::of(&estimation.expect("an estimate"), &truth)
    })
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

/// Flies a maneuver with these joint errors and estimates its inputs.
fn flown(maneuver: &Maneuver, seed: u64, joint_error: JointError) -> [Score; 2] {
    let maneuver: &'static Maneuver = Box::leak(Box::new(varied(maneuver, seed)));
    let request = Request {
        maneuver,
        subject: &Subject::default(),
        density: 1.0,
        seed,
        noise: SensorNoise::PAPER,
        joint_error,
        sway: DEFAULT_SWAY,
        tunnel: false,
    };
    let folder = tempfile::tempdir().expect("a folder");
    let written = synthesize(&request, folder.path(), &mut |_| ()).expect("a flight");
    let mut flight = Flight::read(&written.flight).expect("the flight");
    // The true inputs are withheld, since they are to be estimated.
    flight.inputs = None;
    scores(&flight, |time| {
        let inputs = maneuver.inputs::<f64>(time);
        let [a, b, c] = inputs.muscle.to_array();
        let [d, e, f] = inputs.damping.to_array();
        [a, b, c, d, e, f]
    })
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
            println!("{}", score.row(&name.to_string(), METHODS[k].0));
            if score.doubted == 0.0 {
                all[k] = all[k].clone().merge(score);
            }
        }
    }
    for (score, (by, _)) in all.iter().zip(METHODS) {
        println!("{}", score.row("all that are not doubted", by));
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
    scores(&flight, |_| truth)
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let option = |name: &str| {
        let place = arguments.iter().position(|argument| argument == name);
        place.and_then(|place| arguments.get(place + 1)).cloned()
    };
    let only = option("--only");
    let is_meant = |name: &str| {
        let only = only.as_ref();
        only.is_none_or(|only| only.split(',').any(|meant| meant == name))
    };
    println!("{HEAD}");
    if let Some(folder) = option("--flights") {
        let seconds = |name: &str| option(name).map(|text| text.parse().expect("a number"));
        let receiver = seconds("--receiver").map(|rate| Receiver {
            rate,
            deviation: 0.25,
            lasts: seconds("--lasts").unwrap_or(0.0),
            before: 7.3,
        });
        recorded(Path::new(&folder), &is_meant, receiver);
        return;
    }
    let number = |name: &str, default: u64| {
        option(name).map_or(default, |text| text.parse().expect("a number"))
    };
    let (from, seeds) = (number("--from", 601), number("--seeds", 1));
    let flights: Vec<(&Maneuver, u64)> = MANEUVERS
        .iter()
        .filter(|maneuver| is_meant(maneuver.name))
        .flat_map(|maneuver| (from..from + seeds).map(move |seed| (maneuver, seed)))
        .collect();
    let sizes = option("--degrees").map_or(DEGREES.to_vec(), |text| {
        let sizes = text.split(',').map(|size| size.parse().expect("a number"));
        sizes.collect()
    });
    for kind in ["constant", "wandering"] {
        for &degrees in &sizes {
            let size = degrees.to_radians();
            let joint_error = match kind {
                "constant" => JointError {
                    calibration: size,
                    wander: 0.0,
                },
                // Exact joints are in the rows of constant errors.
                _ if degrees == 0.0 => continue,
                _ => JointError {
                    calibration: 0.0,
                    wander: size,
                },
            };
            let scores: Vec<[Score; 2]> = flights
                .par_iter()
                .map(|(maneuver, seed)| flown(maneuver, *seed, joint_error))
                .collect();
            let name = format!("{degrees} {kind}");
            for (k, (by, _)) in METHODS.into_iter().enumerate() {
                let all = scores.iter().map(|scores| &scores[k]);
                let sum = all.fold(Score::default(), Score::merge);
                println!("{}", sum.row(&name, by));
                if arguments.iter().any(|argument| argument == "--each") {
                    for ((maneuver, seed), scores) in flights.iter().zip(&scores) {
                        let name = format!("{}, {seed}", maneuver.name);
                        println!("{}", scores[k].row(&name, by));
                        println!("{}", scores[k].inputs());
                    }
                }
            }
        }
    }
}
