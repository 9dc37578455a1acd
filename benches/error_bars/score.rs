//! Sums over the estimates of flights, as rows of a table and of a file.

use bodyflight_core::estimator::motion::settings::MOTION;
use bodyflight_core::estimator::motion::watch::Consistency;
use bodyflight_estimation::Estimation;
use serde_json::{Value, json};

/// Stated deviations below this share of those before the flight count as seen.
const SEEN: f64 = 0.7;

/// Head of the table.
pub(super) const HEAD: &str = "\
| joints (deg) | by | muscle input: squared error over variance, RMS error | damping: the same | where seen: muscle input, damping (share) | in 2 sd, % | flights | joints found (deg) | doubted, consistent |
|---|---|---|---|---|---|---|---|---|";

/// Sums over the estimates of one input.
#[derive(Default, Clone, Copy)]
struct Sums {
    /// Squared errors over stated variances.
    ratio: f64,
    square: f64,
    /// Estimates within two deviations.
    inside: f64,
    /// Ratios where the input was seen, and their number.
    seen: [f64; 2],
}

impl Sums {
    const fn numbers(&self) -> [f64; 5] {
        let [ratio, number] = self.seen;
        [self.ratio, self.square, self.inside, ratio, number]
    }

    const fn of([ratio, square, inside, seen, number]: [f64; 5]) -> Self {
        let seen = [seen, number];
        Self {
            ratio,
            square,
            inside,
            seen,
        }
    }

    fn joined(self, other: Self) -> Self {
        let [a, b] = [self.numbers(), other.numbers()];
        Self::of(std::array::from_fn(|k| a[k] + b[k]))
    }

    /// Ratio and RMS error of so many estimates.
    fn errors(&self, number: f64) -> String {
        let rms = (self.square / number).sqrt();
        format!("{:.2}, {rms:.2}", self.ratio / number)
    }

    /// Ratio where the input was seen, and the share of the estimates.
    fn where_seen(&self, number: f64) -> String {
        let [ratio, seen] = self.seen;
        if seen > 0.0 {
            format!("{:.2} ({:.0} %)", ratio / seen, 100.0 * seen / number)
        } else {
            "-".to_owned()
        }
    }
}

/// Sums over the estimates of some flights.
#[derive(Default, Clone)]
pub(super) struct Score {
    estimates: f64,
    /// Muscle input and damping, each in pitch, yaw and roll.
    inputs: [Sums; 6],
    /// Estimates that are consistent.
    consistent: f64,
    doubted: f64,
    /// Size of the joint errors as found, by flight (deg).
    joints: Vec<f64>,
}

impl Score {
    /// Compares an estimation with the true muscle input and damping at a time.
    pub(super) fn of(estimation: &Estimation, truth: impl Fn(f64) -> [f64; 6]) -> Self {
        let before = [MOTION.muscle, MOTION.damping_deviation].concat();
        let mut score = Self::default();
        for point in &estimation.points {
            let [_, found @ ..] = point.inputs.columns();
            let [_, deviation @ ..] = point.deviation.columns();
            let truth = truth(point.time);
            score.estimates += 1.0;
            let is_consistent = point.consistency == Some(Consistency::Consistent);
            score.consistent += f64::from(u8::from(is_consistent));
            for (k, sums) in score.inputs.iter_mut().enumerate() {
                let error = found[k] - truth[k];
                let ratio = (error / deviation[k]).powi(2);
                let seen = f64::from(u8::from(deviation[k] < SEEN * f64::from(before[k])));
                *sums = sums.joined(Sums {
                    ratio,
                    square: error * error,
                    inside: f64::from(u8::from(ratio < 4.0)),
                    seen: [ratio * seen, seen],
                });
            }
        }
        score.joints.extend(estimation.report.joint_error_deg);
        score.doubted = f64::from(u8::from(estimation.report.doubt.is_some()));
        score
    }

    pub(super) fn merge(mut self, other: &Self) -> Self {
        for (sums, others) in self.inputs.iter_mut().zip(other.inputs) {
            *sums = sums.joined(others);
        }
        self.estimates += other.estimates;
        self.consistent += other.consistent;
        self.doubted += other.doubted;
        self.joints.extend(&other.joints);
        self
    }

    pub(super) fn is_doubted(&self) -> bool {
        self.doubted > 0.0
    }

    /// Each input: ratio, RMS error, and the ratio where it was seen with the share of the time.
    pub(super) fn each(&self) -> String {
        let of = |sums: &Sums| {
            let (errors, seen) = (sums.errors(self.estimates), sums.where_seen(self.estimates));
            format!("{errors}, {seen}")
        };
        self.inputs.iter().map(of).collect::<Vec<_>>().join("; ")
    }

    /// A row of the table without its first two columns.
    pub(super) fn row(&self) -> String {
        let number = 3.0 * self.estimates;
        let kinds = [0, 3].map(|first| {
            let axes = self.inputs[first..first + 3].iter();
            axes.fold(Sums::default(), |all, sums| all.joined(*sums))
        });
        let [muscle, damping] = kinds.map(|sums| sums.errors(number));
        let seen = kinds.map(|sums| sums.where_seen(number)).join(", ");
        let inside = kinds.map(|sums| format!("{:.0}", 100.0 * sums.inside / number));
        let mut joints = self.joints.clone();
        joints.sort_by(f64::total_cmp);
        let place = |share: usize| joints.get(share * joints.len().saturating_sub(1) / 2);
        let [least, middle, most] = [0, 1, 2].map(|k| place(k).copied().unwrap_or(f64::NAN));
        format!(
            "{muscle} | {damping} | {seen} | {} | {} | {middle:.2} ({least:.2} to {most:.2}) | {}, {:.0} % |",
            inside.join(", "),
            joints.len(),
            self.doubted,
            100.0 * self.consistent / self.estimates
        )
    }

    /// All numbers, to be kept in a file.
    pub(super) fn to_json(&self) -> Value {
        let inputs: Vec<[f64; 5]> = self.inputs.iter().map(Sums::numbers).collect();
        json!({
            "estimates": self.estimates,
            "inputs": inputs,
            "consistent": self.consistent,
            "doubted": self.doubted,
            "joints": self.joints,
        })
    }

    /// The score that was kept; `None` if it is not one.
    pub(super) fn from_json(kept: &Value) -> Option<Self> {
        let numbers = |value: &Value| -> Option<Vec<f64>> {
            value.as_array()?.iter().map(Value::as_f64).collect()
        };
        let mut inputs = [Sums::default(); 6];
        for (sums, kept) in inputs.iter_mut().zip(kept["inputs"].as_array()?) {
            *sums = Sums::of(numbers(kept)?.try_into().ok()?);
        }
        Some(Self {
            estimates: kept["estimates"].as_f64()?,
            inputs,
            consistent: kept["consistent"].as_f64()?,
            doubted: kept["doubted"].as_f64()?,
            joints: numbers(&kept["joints"])?,
        })
    }
}
