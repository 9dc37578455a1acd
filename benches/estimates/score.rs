//! Accumulated errors of a method over several flights, and the rows of the tables.

use bodyflight_core::estimator::motion::watch::Consistency;
use bodyflight_estimation::Estimation;
use bodyflight_replay::comparison::{Channel, PerChannel};

/// Largest stated standard deviation with which a muscle input counts as observed.
const OBSERVED: f64 = 0.15;

/// Channels of the first table.
const SHOWN: [Channel; 6] = [
    Channel::VerticalVelocity,
    Channel::HorizontalVelocity,
    Channel::Roll,
    Channel::Pitch,
    Channel::YawRate,
    Channel::AngularVelocity,
];

/// Head of the table of reconstructions.
pub(crate) const RECONSTRUCTION: &str = "\
| maneuver | by | V_vert (m/s) | V_hor (m/s) | roll (rad) | pitch (rad) | yaw rate (rad/s) | angular velocity (rad/s) | NIS of 4, by flight |
|---|---|---|---|---|---|---|---|---|";

/// Head of the table of inputs.
pub(crate) const INPUTS: &str = "\
| maneuver | by | in 2 sd, % | error, RMS: muscle, damping | of it offset | zero muscle input, mean error (share stated so well, %) | consistent, doubtful, lost, % | refused | unflagged (s) |
|---|---|---|---|---|---|---|---|---|";

/// Sums over flights. Three components are pitch, yaw, roll; six are muscle input, then damping.
#[derive(Default, Clone)]
pub(crate) struct Score {
    squares: [f64; 6],
    flights: f64,
    inside: [f64; 6],
    square_error: [f64; 6],
    /// Square of the mean error of a flight, times its number of points.
    square_offset: [f64; 6],
    /// Sum of squared errors of zero muscle inputs stated to better than [`OBSERVED`], and their number.
    zero: [[f64; 2]; 3],
    points: f64,
    nis: Vec<f64>,
    states: [f64; 3],
    /// Longest time with an error above four deviations that was not flagged (s).
    unflagged: f64,
    refused: f64,
    /// Computing time per second of flight, by flight (s).
    paces: Vec<f64>,
}

impl Score {
    /// The score of a flight with constant coefficients.
    pub(crate) fn constant(rms: &PerChannel) -> Self {
        Self {
            squares: SHOWN.map(|channel| rms.get(channel) * rms.get(channel)),
            flights: 1.0,
            ..Self::default()
        }
    }

    /// The score of a flight with estimated inputs whose truth is known.
    pub(crate) fn of(estimation: &Estimation, truth: impl Fn(f64) -> [f64; 6]) -> Self {
        let mut score = Self::constant(&estimation.report.rms);
        let (mut sums, mut runs, mut last) = ([0.0; 6], [0.0; 6], 0.0);
        for point in &estimation.points {
            let [_, found @ ..] = point.inputs.columns();
            let [_, deviation @ ..] = point.deviation.columns();
            let truth = truth(point.time);
            let consistency = point.consistency.unwrap_or_default();
            for k in 0..6 {
                let error = found[k] - truth[k];
                score.inside[k] += f64::from(u8::from(error.abs() < 2.0 * deviation[k]));
                score.square_error[k] += error * error;
                sums[k] += error;
                if k < 3 && truth[k].abs() < 1e-9 && deviation[k] < OBSERVED {
                    score.zero[k][0] += error.abs();
                    score.zero[k][1] += 1.0;
                }
                let wrong = error.abs() > 4.0 * deviation[k];
                let unflagged = wrong && consistency == Consistency::Consistent;
                runs[k] = if unflagged {
                    runs[k] + point.time - last
                } else {
                    0.0
                };
                score.unflagged = score.unflagged.max(runs[k]);
            }
            last = point.time;
            score.states[consistency as usize] += 1.0;
            score.points += 1.0;
        }
        score.square_offset = sums.map(|sum| sum * sum / score.points.max(1.0));
        // The motion filter gives the mean over channels, the paper's the sum over its four.
        let seen = |nis: &f64| nis.is_finite();
        let by_channel = estimation
            .points
            .first()
            .is_some_and(|p| p.motion.is_some());
        let channels = if by_channel { 4.0 } else { 1.0 };
        score
            .nis
            .extend(Some(channels * estimation.report.nis_mean).filter(seen));
        let report = &estimation.report;
        score.paces.push(report.filter_s / report.duration_s);
        score.refused = f64::from(u8::from(estimation.report.doubt.is_some()));
        score
    }

    /// Adds other flights.
    pub(crate) fn merge(&mut self, other: &Self) {
        let add = |a: &mut [f64], b: &[f64]| a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
        add(&mut self.squares, &other.squares);
        add(&mut self.inside, &other.inside);
        add(&mut self.square_error, &other.square_error);
        add(&mut self.square_offset, &other.square_offset);
        add(&mut self.states, &other.states);
        add(self.zero.as_flattened_mut(), other.zero.as_flattened());
        self.flights += other.flights;
        self.points += other.points;
        self.refused += other.refused;
        self.nis.extend(&other.nis);
        self.paces.extend(&other.paces);
        self.unflagged = self.unflagged.max(other.unflagged);
    }

    /// Whether no flight was added.
    pub(crate) fn is_empty(&self) -> bool {
        self.flights == 0.0
    }

    /// Computing time for `flight` (s): minimum and median over flights, since machines are busy.
    pub(crate) fn time(&self, flight: f64) -> Option<[f64; 2]> {
        let mut paces = self.paces.clone();
        paces.sort_by(f64::total_cmp);
        let middle = paces.get(paces.len() / 2)?;
        Some([paces.first()?, middle].map(|pace| pace * flight))
    }

    /// A row of the table of reconstructions.
    pub(crate) fn reconstruction(&self, maneuver: &str, method: &str) -> String {
        let rms = SHOWN.iter().zip(self.squares).map(|(channel, sum)| {
            let rms = (sum / self.flights).sqrt();
            match channel {
                Channel::VerticalVelocity | Channel::HorizontalVelocity => format!("{rms:.2}"),
                _ => format!("{rms:.3}"),
            }
        });
        let numbers = rms.collect::<Vec<_>>().join(" | ");
        let least = self.nis.iter().copied().fold(f64::INFINITY, f64::min);
        let most = self.nis.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let nis = match self.nis.len() {
            0 => String::new(),
            _ if most < 99.5 => format!("{least:.1} to {most:.1}"),
            _ => format!("{least:.0} to {most:.0}"),
        };
        format!("| {maneuver} | {method} | {numbers} | {nis} |")
    }

    /// A row of the table of inputs.
    pub(crate) fn inputs(&self, maneuver: &str, method: &str) -> String {
        let percent = |sum: f64| format!("{:.0}", 100.0 * sum / self.points);
        let root = |sum: f64| format!("{:.2}", (sum / self.points).sqrt());
        let zero = self.zero.map(|[sum, number]| {
            let share = 100.0 * number / self.points;
            match number {
                0.0 => "-".to_owned(),
                _ => format!("{:.3} ({share:.0})", sum / number),
            }
        });
        format!(
            "| {maneuver} | {method} | {} | {}; {:.2}, {:.2} | {:.2}, {:.2} | {} | {} | {} of {} | {:.1} |",
            self.inside.map(percent).join(" "),
            self.square_error.map(root).join(" "),
            self.by_kind(&self.square_error)[0],
            self.by_kind(&self.square_error)[1],
            self.by_kind(&self.square_offset)[0],
            self.by_kind(&self.square_offset)[1],
            zero.join(", "),
            self.states.map(percent).join(" "),
            self.refused,
            self.flights,
            self.unflagged,
        )
    }

    /// Root mean square of muscle input and of damping, all axes.
    fn by_kind(&self, squares: &[f64; 6]) -> [f64; 2] {
        let (muscle, damping) = squares.split_at(3);
        [muscle, damping].map(|part| (part.iter().sum::<f64>() / (3.0 * self.points)).sqrt())
    }
}
