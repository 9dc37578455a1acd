//! How good estimates are on flights whose inputs are known: every maneuver of `synth`, by constant coefficients, the
//! paper's filter and its reduced form with a preset of the paper, and the motion filter and its smoother.
//!
//! `cargo bench -p bodyflight-benches --bench estimates -- --seeds 3` prints the tables. `--noise`, `--joints` and
//! `--wander` (degrees) vary what the flights suffer, `--only NAME` looks at some maneuvers, `--from SEED` at other seeds.
#![expect(clippy::expect_used, reason = "a bench may end with a panic")]

use bodyflight::formats::flight::Flight;
use bodyflight::formats::recording::Options;
use bodyflight::formats::subject::Subject;
use bodyflight::replay::comparison::{Channel, PerChannel};
use bodyflight::verbs::estimate::motion::{self, Method};
use bodyflight::verbs::estimate::{Estimation, Filter, estimate};
use bodyflight::verbs::synthesize::{DEFAULT_SWAY, JointError, Request, synthesize};
use bodyflight_core::estimator::motion::settings::MOTION;
use bodyflight_core::estimator::motion::watch::Consistency;
use bodyflight_core::estimator::preset::TRACKING_ON_BACK;
use bodyflight_core::maneuver::scripts::MANEUVERS;
use bodyflight_core::sensor_noise::SensorNoise;

/// Stated deviation up to which a muscle input counts as observed.
const OBSERVED: f64 = 0.15;

/// What is known of a method over several flights.
#[derive(Default, Clone)]
struct Score {
    squares: [f64; 7],
    flights: f64,
    inside: [f64; 6],
    absolute: [f64; 6],
    square_error: [f64; 6],
    /// Sum of the errors of muscle inputs that are zero and stated to better than [`OBSERVED`], and their number.
    zero: [f64; 2],
    points: f64,
    nis: f64,
    states: [f64; 3],
    /// Longest time with an error above four deviations that was not flagged (s).
    unflagged: f64,
    seconds: f64,
    doubts: f64,
}

impl Score {
    fn gap(&mut self, rms: &PerChannel) {
        for (sum, channel) in self.squares.iter_mut().zip(Channel::ALL) {
            *sum += rms.get(channel) * rms.get(channel);
        }
        self.flights += 1.0;
    }

    fn inputs(&mut self, estimation: &Estimation, truth: impl Fn(f64) -> [f64; 6]) {
        let mut runs = [0.0; 6];
        let mut last = 0.0;
        for point in &estimation.points {
            let [_, found @ ..] = point.inputs.columns();
            let [_, deviation @ ..] = point.deviation.columns();
            let truth = truth(point.time);
            let consistency = point.consistency.unwrap_or_default();
            for k in 0..6 {
                let error = (found[k] - truth[k]).abs();
                self.inside[k] += f64::from(u8::from(error < 2.0 * deviation[k]));
                self.absolute[k] += error;
                self.square_error[k] += error * error;
                if k < 3 && truth[k].abs() < 1e-9 && deviation[k] < OBSERVED {
                    self.zero[0] += error;
                    self.zero[1] += 1.0;
                }
                runs[k] = if error > 4.0 * deviation[k] && consistency == Consistency::Consistent {
                    runs[k] + point.time - last
                } else {
                    0.0
                };
                self.unflagged = self.unflagged.max(runs[k]);
            }
            last = point.time;
            self.states[consistency as usize] += 1.0;
            self.points += 1.0;
        }
        self.nis += estimation.report.nis_mean;
        self.seconds += estimation.report.filter_s;
        self.doubts += f64::from(u8::from(estimation.report.doubt.is_some()));
    }

    fn merge(&mut self, other: &Self) {
        let add = |a: &mut [f64], b: &[f64]| a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
        add(&mut self.squares, &other.squares);
        add(&mut self.inside, &other.inside);
        add(&mut self.absolute, &other.absolute);
        add(&mut self.square_error, &other.square_error);
        add(&mut self.states, &other.states);
        add(&mut self.zero, &other.zero);
        self.flights += other.flights;
        self.points += other.points;
        self.nis += other.nis;
        self.seconds += other.seconds;
        self.doubts += other.doubts;
        self.unflagged = self.unflagged.max(other.unflagged);
    }

    fn print(&self, maneuver: &str, method: &str) {
        let rms = self.squares.map(|sum| (sum / self.flights).sqrt());
        print!("| {maneuver} | {method} |");
        for value in rms {
            print!(" {value:.3} |");
        }
        if self.points > 0.0 {
            let percent = |sum: f64| format!("{:.0}", 100.0 * sum / self.points);
            let mean = |sum: f64| format!("{:.2}", sum / self.points);
            let root = |sum: f64| format!("{:.2}", (sum / self.points).sqrt());
            print!(" {} |", self.inside.map(percent).join(" "));
            print!(" {} |", self.absolute.map(mean).join(" "));
            let [sum, number] = self.zero;
            let share = 100.0 * number / (3.0 * self.points);
            print!(" {:.3} ({share:.0} %) |", sum / number.max(1.0));
            print!(" {} |", self.square_error.map(root).join(" "));
            print!(" {:.2} |", 4.0 * self.nis / self.flights);
            print!(" {} |", self.states.map(percent).join(" "));
            print!(
                " {:.1} | {:.0} | {:.2} |",
                self.unflagged,
                self.doubts,
                self.seconds / self.flights
            );
        } else {
            print!(" | | | | | | | | |");
        }
        println!();
    }
}

const METHODS: [&str; 6] = [
    "constant",
    "paper",
    "paper, reduced",
    "motion",
    "motion, reduced",
    "smoother",
];

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let option = |name: &str| {
        let place = arguments.iter().position(|argument| argument == name);
        place.and_then(|place| arguments.get(place + 1)).cloned()
    };
    let number = |name: &str, default: f64| {
        option(name).map_or(default, |text| text.parse().expect("a number"))
    };
    let noise = SensorNoise::PAPER.scaled(number("--noise", 1.0));
    let joint_error = JointError {
        calibration: number("--joints", 2.0).to_radians(),
        wander: number("--wander", 0.0).to_radians(),
    };
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "seeds"
    )]
    let [from, seeds] = [number("--from", 1.0) as u64, number("--seeds", 3.0) as u64];
    let only = option("--only").unwrap_or_default();
    println!(
        "| maneuver | by | roll | pitch | heading | yaw rate | angular velocity | V_hor | V_vert | in 2 sd, % | mean error | zero where observed | RMS error | NIS of 4 | consistent, doubtful, lost, % | unflagged, s | doubts | time, s |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|");
    let subject = Subject::default();
    let folder = std::env::temp_dir().join(format!("bodyflight-estimates-{}", std::process::id()));
    let mut all = vec![Score::default(); METHODS.len()];
    for maneuver in MANEUVERS.iter().filter(|m| m.name.contains(&only)) {
        let mut scores = vec![Score::default(); METHODS.len()];
        for seed in from..from + seeds {
            let request = Request {
                maneuver,
                subject: &subject,
                density: 1.0,
                seed,
                noise,
                joint_error,
                sway: DEFAULT_SWAY,
                tunnel: false,
            };
            let written = synthesize(&request, &folder, |_| ()).expect("a flight");
            let mut flight = Flight::read(&written.flight).expect("the flight");
            // What was put in is what is looked for.
            flight.inputs = None;
            let truth = |time: f64| {
                let inputs = maneuver.inputs::<f64>(time);
                let [a, b, c] = inputs.muscle.to_array();
                let [d, e, f] = inputs.damping.to_array();
                [a, b, c, d, e, f]
            };
            for (method, score) in scores.iter_mut().enumerate() {
                let estimation = run(&flight, method);
                if method == 0 {
                    score.gap(&estimation.report.rms_constant);
                } else {
                    score.gap(&estimation.report.rms);
                    score.inputs(&estimation, truth);
                }
            }
        }
        for ((score, all), method) in scores.iter().zip(&mut all).zip(METHODS) {
            score.print(maneuver.name, method);
            all.merge(score);
        }
    }
    for (score, method) in all.iter().zip(METHODS) {
        score.print("all", method);
    }
    std::fs::remove_dir_all(folder).expect("a folder of our own");
}

fn run(flight: &Flight, method: usize) -> Estimation {
    let options = Options::default();
    let windows = |filter| estimate::<f64>(flight, &TRACKING_ON_BACK, filter, options, |_| ());
    let motion = |filter, method| {
        let settings = motion::Settings {
            preset: MOTION,
            keep_noise: false,
            find_joint_error: true,
            filter,
            method,
        };
        motion::estimate::<f64>(flight, &settings, options, |_| ())
    };
    match method {
        0 | 2 => windows(Filter::Reduced),
        1 => windows(Filter::Paper),
        3 => motion(Filter::Paper, Method::Filter),
        4 => motion(Filter::Reduced, Method::Filter),
        _ => motion(Filter::Paper, Method::Smooth),
    }
    .expect("an estimate")
}
