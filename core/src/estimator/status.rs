//! What an update publishes: the estimate, each channel as autopilots log it, and the filter's health.

use nalgebra::SMatrix;

use super::coefficients::StateVector;
use super::measurement::{CHANNELS, Measurement, Quantity};
use crate::dynamics::{Inputs, Motion};
use crate::math::Real;

/// Mean normalised innovation per channel above which predictions and measurements do not belong together.
pub(super) const INCONSISTENT: f64 = 100.0;

/// Deviations from the prediction at which the test ratio is one.
pub const TEST_RATIO_GATE: f64 = 5.0;

/// One channel of a measurement at an update.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Channel<T> {
    /// What is measured; `None` for a channel that the measurement model does not have.
    pub quantity: Option<Quantity>,
    /// Measured value (SI).
    pub observation: T,
    /// Predicted value (SI).
    pub predicted: T,
    /// Measured less predicted, angles on the short way; zero where it was not used.
    pub innovation: T,
    /// Variance of the innovation, with R.
    pub variance: T,
    /// Square of the innovation over that of [`TEST_RATIO_GATE`] deviations.
    pub test_ratio: T,
    /// Whether the channel was usable and taken in; otherwise it was rejected.
    pub fused: bool,
}

/// What went wrong since the last estimate. All of it leaves a finite state behind.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Faults {
    /// A posture was not finite or not of unit quaternions: the last good one was held.
    pub posture: bool,
    /// A channel of the measurement at the window's end was not finite or absurd: it was not used.
    pub measurement: bool,
    /// The prediction or the update was not finite: state and covariance were left as they were.
    pub update: bool,
    /// The covariance had to be kept from degenerating.
    pub covariance: bool,
    /// The reconstructed motion left its range and was limited, or was not finite and was held.
    pub motion: bool,
}

impl Faults {
    /// Whether nothing went wrong.
    pub fn none(self) -> bool {
        self == Self::default()
    }

    /// The faults as bits, in the order of the fields from the lowest bit: for links and logs.
    pub fn bits(self) -> u8 {
        let Self {
            posture,
            measurement,
            update,
            covariance,
            motion,
        } = self;
        u8::from(posture)
            | u8::from(measurement) << 1
            | u8::from(update) << 2
            | u8::from(covariance) << 3
            | u8::from(motion) << 4
    }
}

/// How much an estimate can be trusted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Health {
    /// Fewer updates than fill a second since the start: the coefficients still come from the start values.
    Settling,
    /// Predictions follow the measurements.
    Good,
    /// Predictions miss the measurements by far more than their variance, for seconds.
    Inconsistent,
    /// The last update was not accepted.
    Failing,
}

/// Coefficients and reconstructed motion after an update.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate<T: Real> {
    /// Sample from which on the coefficients act; sample 0 is the start. The measurement that brought the
    /// estimate is [`delay`](super::Estimator::delay) later.
    pub sample: u32,
    /// The coefficients.
    pub inputs: Inputs<T>,
    /// The coefficients in the order of paper eq. (ukf_state).
    pub state: StateVector<T>,
    /// Their standard deviations.
    pub deviation: StateVector<T>,
    /// Sample at which the solution step ended.
    pub solved_sample: u32,
    /// Motion there, as the model reconstructs it.
    pub motion: Motion<T>,
    /// What sensors would have seen of it.
    pub reconstructed: Measurement<T>,
    /// The channels of the measurement at the window's end.
    pub channels: [Channel<T>; CHANNELS],
    /// Covariance of the innovation, C_z.
    pub innovation_covariance: SMatrix<T, CHANNELS, CHANNELS>,
    /// Normalised innovation squared, summed over the channels used.
    pub normalised_innovation: T,
    /// Its mean over about a second, per channel. One where model and noise match reality; the paper's
    /// filter sits at 5 to 20, because the reconstructed motion has errors of its own that R and P do not
    /// know.
    pub mean_normalised_innovation: T,
    /// How much the estimate can be trusted.
    pub health: Health,
    /// What went wrong since the last estimate.
    pub faults: Faults,
}
