//! A step in a length over time, apart from what the posture does to that length.
//!
//! The length is regressed on features of the posture and on a step, or a ramp, that stays to the end. The features have a
//! penalty, so that those which hardly vary explain nothing: a slipped marker moves them a little, too.

use nalgebra::{DMatrix, DVector};

/// Root mean square of a feature at which half of its share is believed.
const LEAST_VARIANCE: f64 = 0.01;
/// Durations of ramps that are tried (s).
const DURATIONS: [f64; 5] = [0.0, 0.25, 0.5, 1.0, 2.0];
/// Places that are tried first, for each duration.
const PLACES: i32 = 60;
/// Shortest time before and after a step (s), and the fewest samples.
const AROUND: f64 = 0.5;
const FEWEST: usize = 4;
/// Fewest samples.
const LEAST: usize = 24;
/// Smallest share of a step that the posture does not explain.
const OWN_SHARE: f64 = 0.1;
/// Largest correlation between neighbouring samples.
const MOST_ALIKE: f64 = 0.98;

/// A step that stays, reached along a ramp.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Step {
    /// When it begins (s).
    pub(super) begin: f64,
    /// How long it takes (s).
    pub(super) duration: f64,
}

impl Step {
    /// Its share at a time, from 0 to 1.
    pub(super) fn at(&self, time: f64) -> f64 {
        if self.duration > 0.0 {
            ((time - self.begin) / self.duration).clamp(0.0, 1.0)
        } else if time >= self.begin {
            1.0
        } else {
            0.0
        }
    }
}

/// What a step does to a length.
#[derive(Debug, Clone, Copy)]
pub(super) struct Change {
    pub(super) step: Step,
    /// The change (m).
    pub(super) size: f64,
    /// Its standard error (m), with errors that are alike from sample to sample.
    pub(super) error: f64,
    /// Standard deviation of what is left (m): what soft tissue does.
    pub(super) left: f64,
    /// How much of the squares it explains (m2).
    gain: f64,
}

/// A length over time, with what the posture is.
#[derive(Debug, Clone, Default)]
pub(super) struct Series {
    /// Times (s), in ascending order.
    pub(super) times: Vec<f64>,
    /// Lengths (m).
    pub(super) lengths: Vec<f64>,
    /// Features of the posture, as many for each time.
    pub(super) features: Vec<Vec<f64>>,
}

/// A series with its normal equations.
pub(super) struct Regression<'a> {
    times: &'a [f64],
    lengths: Vec<f64>,
    features: DMatrix<f64>,
    inverse: DMatrix<f64>,
    /// Sums from each sample to the end: of the lengths, and of the features.
    sums: Vec<f64>,
    sums_of_features: DMatrix<f64>,
    /// Products of features and lengths.
    products: DVector<f64>,
}

impl<'a> Regression<'a> {
    /// Prepares a series; steps that are known already count as features without a penalty. `None` if it is too short.
    pub(super) fn new(series: &'a Series, known: &[Step]) -> Option<Self> {
        let count = series.times.len();
        if count < LEAST {
            return None;
        }
        let own = series.features.first()?.len();
        if own == 0 {
            return None;
        }
        let mut features = DMatrix::from_fn(count, own + known.len(), |row, column| {
            match column.checked_sub(own) {
                Some(step) => known[step].at(series.times[row]),
                None => series.features[row][column],
            }
        });
        for mut column in features.column_iter_mut() {
            let mean = column.mean();
            column.add_scalar_mut(-mean);
        }
        let mean = series.lengths.iter().sum::<f64>() / count as f64;
        let lengths: Vec<f64> = series.lengths.iter().map(|length| length - mean).collect();
        let mut normal = features.transpose() * &features;
        for column in 0..own + known.len() {
            let share = if column < own { LEAST_VARIANCE } else { 1e-9 };
            normal[(column, column)] += share * count as f64;
        }
        let inverse = normal.try_inverse()?;
        let products = features.transpose() * DVector::from_column_slice(&lengths);
        let mut sums = vec![0.0; count + 1];
        let mut sums_of_features = DMatrix::zeros(own + known.len(), count + 1);
        for row in (0..count).rev() {
            sums[row] = sums[row + 1] + lengths[row];
            let next = sums_of_features.column(row + 1) + features.row(row).transpose();
            sums_of_features.set_column(row, &next);
        }
        Some(Self {
            times: &series.times,
            lengths,
            features,
            inverse,
            sums,
            sums_of_features,
            products,
        })
    }

    /// The step that explains most; `None` if none can be told from the posture.
    pub(super) fn best(&self) -> Option<Change> {
        let (first, last) = (*self.times.first()?, *self.times.last()?);
        let interval = (last - first) / (self.times.len() - 1) as f64;
        let around = AROUND.max(FEWEST as f64 * interval);
        let span = [first + around, last - around];
        let apart = (span[1] - span[0]) / f64::from(PLACES);
        let durations = DURATIONS.map(|duration| duration.min((last - first) / 3.0));
        let coarse = |duration: f64| {
            (0..=PLACES).map(move |place| Step {
                begin: span[0] + apart * f64::from(place),
                duration,
            })
        };
        let found = self.most(span, durations.into_iter().flat_map(coarse))?;
        let middle = found.step.begin + 0.5 * found.step.duration;
        let fine = |duration: f64| {
            (-PLACES..=PLACES).map(move |place| Step {
                begin: middle + apart * f64::from(place) / f64::from(PLACES) - 0.5 * duration,
                duration,
            })
        };
        let finer = self.most(span, durations.into_iter().flat_map(fine));
        let better = finer.filter(|finer| finer.gain > found.gain);
        Some(self.judged(better.unwrap_or(found)))
    }

    /// The one of these steps, if it is within a span, that explains most.
    fn most(&self, [from, to]: [f64; 2], steps: impl Iterator<Item = Step>) -> Option<Change> {
        let inside = steps.filter(|step| step.begin >= from && step.begin + step.duration <= to);
        let changes = inside.filter_map(|step| self.change(step));
        changes.max_by(|a, b| a.gain.total_cmp(&b.gain))
    }

    /// What a step at a given time does; `None` if it cannot be told from the posture.
    pub(super) fn with(&self, step: Step) -> Option<Change> {
        Some(self.judged(self.change(step)?))
    }

    /// A step without its errors.
    fn change(&self, step: Step) -> Option<Change> {
        let count = self.times.len();
        let from = self.times.partition_point(|time| *time < step.begin);
        let end = step.begin + step.duration;
        let full = self.times.partition_point(|time| *time < end).max(from);
        let mut sum = (count - full) as f64;
        let mut square = sum;
        let mut with_length = self.sums[full];
        let mut with_features: DVector<f64> = self.sums_of_features.column(full).into_owned();
        for row in from..full {
            let share = step.at(self.times[row]);
            sum += share;
            square += share * share;
            with_length += share * self.lengths[row];
            with_features += self.features.row(row).transpose() * share;
        }
        let whole = square - sum * sum / count as f64;
        let explained = &self.inverse * &with_features;
        let own = whole - with_features.dot(&explained);
        if !(own > OWN_SHARE * whole && own > 0.0) {
            return None;
        }
        let size = (with_length - explained.dot(&self.products)) / own;
        size.is_finite().then_some(Change {
            step,
            size,
            error: own.sqrt().recip(),
            left: 0.0,
            gain: size * size * own,
        })
    }

    /// A step with its errors.
    fn judged(&self, change: Change) -> Change {
        let count = self.times.len();
        let shares: Vec<f64> = self
            .times
            .iter()
            .map(|time| change.step.at(*time))
            .collect();
        let mean = shares.iter().sum::<f64>() / count as f64;
        let shares = DVector::from_iterator(count, shares.into_iter().map(|share| share - mean));
        let lengths = DVector::from_column_slice(&self.lengths);
        let rest = lengths - shares * change.size;
        let weights = &self.inverse * (self.features.transpose() * &rest);
        let rest = rest - &self.features * weights;
        let square = rest.norm_squared();
        let next: f64 = (0..count - 1).map(|k| rest[k] * rest[k + 1]).sum();
        let alike = (next / square.max(f64::MIN_POSITIVE)).clamp(0.0, MOST_ALIKE);
        let left = (square / count as f64).sqrt();
        Change {
            error: change.error * left * ((1.0 + alike) / (1.0 - alike)).sqrt(),
            left,
            ..change
        }
    }
}
