//! What an update publishes: the estimate, each channel in the form that autopilots log, and the health of the filter.

use nalgebra::SMatrix;

use super::coefficients::StateVector;
use super::measurement::{CHANNELS, Measurement, Quantity};
use crate::dynamics::{Inputs, Motion};
use crate::math::Real;

/// Mean normalised innovation per channel above which predictions and measurements are considered inconsistent.
pub(super) const INCONSISTENT: f64 = 100.0;

/// Number of standard deviations at which the test ratio is one.
pub const TEST_RATIO_GATE: f64 = 5.0;

/// One channel of a measurement in an update.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Channel<T> {
    /// Measured quantity; `None` for a channel that the measurement model does not use.
    pub quantity: Option<Quantity>,
    /// Measured value (SI).
    pub observation: T,
    /// Predicted value (SI).
    pub predicted: T,
    /// Measured minus predicted, with angles wrapped; zero if the channel was not used.
    pub innovation: T,
    /// Variance of the innovation, including R.
    pub variance: T,
    /// Squared innovation divided by the square of [`TEST_RATIO_GATE`] standard deviations.
    pub test_ratio: T,
    /// Whether the channel was usable and fused; otherwise it was rejected.
    pub fused: bool,
}

/// Faults since the last estimate. The state remains finite after any of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Faults {
    /// A posture was not finite or not made of unit quaternions; the last good one was held.
    pub posture: bool,
    /// A channel of the measurement at the end of the window was not finite or not plausible; it was not used.
    pub measurement: bool,
    /// The prediction or the update was not finite; state and covariance were left unchanged.
    pub update: bool,
    /// The covariance had to be corrected to stay positive definite.
    pub covariance: bool,
    /// The reconstructed motion left its limits and was clamped, or was not finite and was held.
    pub motion: bool,
    /// Samples do not arrive at the configured rate: attitude and angular velocity disagree about how fast time passes.
    pub rate: bool,
}

impl Faults {
    /// Returns whether there was no fault.
    pub fn none(self) -> bool {
        self == Self::default()
    }

    /// Returns whether the filter itself failed, and not only a measurement or the rate of the samples.
    pub fn is_of_filter(self) -> bool {
        let outside = Self {
            measurement: self.measurement,
            rate: self.rate,
            ..Self::default()
        };
        self != outside
    }

    /// Returns the faults as bits in the order of the fields, lowest bit first, for links and logs.
    pub fn bits(self) -> u8 {
        let Self {
            posture,
            measurement,
            update,
            covariance,
            motion,
            rate,
        } = self;
        u8::from(posture)
            | u8::from(measurement) << 1
            | u8::from(update) << 2
            | u8::from(covariance) << 3
            | u8::from(motion) << 4
            | u8::from(rate) << 5
    }
}

/// How far an estimate can be trusted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Health {
    /// Less than one second of updates since the start; the coefficients still depend on their initial values.
    Settling,
    /// Predictions follow the measurements.
    Good,
    /// Predictions have missed the measurements by far more than their variance allows, for seconds.
    Inconsistent,
    /// The last update was not accepted.
    Failing,
}

/// Coefficients and reconstructed motion after an update.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate<T: Real> {
    /// First sample at which the coefficients apply; sample 0 is the start. The measurement that completed the
    /// estimate was taken [`delay`](super::Estimator::delay) later.
    pub sample: u32,
    /// Estimated coefficients.
    pub inputs: Inputs<T>,
    /// The coefficients in the order of paper eq. (ukf_state).
    pub state: StateVector<T>,
    /// Standard deviations of the coefficients.
    pub deviation: StateVector<T>,
    /// Sample at which the solution step ended.
    pub solved_sample: u32,
    /// Motion at the solved sample, as reconstructed by the model.
    pub motion: Motion<T>,
    /// What sensors would have measured of that motion.
    pub reconstructed: Measurement<T>,
    /// The channels of the measurement at the end of the window.
    pub channels: [Channel<T>; CHANNELS],
    /// Covariance of the innovation, C_z.
    pub innovation_covariance: SMatrix<T, CHANNELS, CHANNELS>,
    /// Normalised innovation squared, summed over the channels used.
    pub normalised_innovation: T,
    /// Mean of the normalised innovation over about a second, per channel. It is one where model and noise match
    /// reality; the paper's filter reaches 5 to 20, because the reconstructed motion has errors that R and P do not
    /// include.
    pub mean_normalised_innovation: T,
    /// How far the estimate can be trusted.
    pub health: Health,
    /// Faults since the last estimate.
    pub faults: Faults,
}
