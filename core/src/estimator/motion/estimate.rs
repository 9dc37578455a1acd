//! The output of the motion filter, and the interface for observing it from outside.

use nalgebra::SVector;

use super::measurement::{CHANNELS, Row};
use super::state::{Difference, STATES};
use super::support::Situation;
use super::update::Innovation;
use super::watch::{Consistency, Watch};
use crate::dynamics::{Inputs, Motion};
use crate::estimator::status::Faults;
use crate::math::Real;

/// One channel since the last estimate; the last measurement if there were several.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChannelEstimate<T> {
    /// Measured minus predicted; zero if nothing was measured.
    pub innovation: T,
    /// Variance of the innovation; zero if nothing was measured.
    pub variance: T,
    /// Whether the channel was fused.
    pub fused: bool,
    /// Whether the innovation was beyond the gate.
    pub rejected: bool,
}

impl<T: Real> ChannelEstimate<T> {
    /// A channel that was not measured.
    pub(super) fn nothing() -> Self {
        Self {
            innovation: T::zero(),
            variance: T::zero(),
            fused: false,
            rejected: false,
        }
    }
}

/// Output of the filter after a sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotionEstimate<T: Real> {
    /// The sample that the estimate refers to, which is the one just processed; sample 0 is the start.
    pub sample: u32,
    /// Inputs at that sample.
    pub inputs: Inputs<T>,
    /// Standard deviations of all error coordinates, in the order of [`state`](super::state).
    pub deviation: SVector<T, STATES>,
    /// Motion at that sample.
    pub motion: Motion<T>,
    /// Channels at that sample.
    pub channels: [ChannelEstimate<T>; CHANNELS],
    /// Mean normalised innovation squared per channel since the last estimate; one if model and noise match reality.
    pub normalised_innovation: T,
    /// Consistency of each channel.
    pub watch: Watch<T>,
    /// Consistency of the worst channel or of the residual load, or of the largest error bar.
    pub consistency: Consistency,
    /// What carries the body; if it is not the air, the estimate is at least doubtful.
    pub situation: Situation,
    /// Faults since the last estimate.
    pub faults: Faults,
}

/// Callbacks from inside a filter. A filter without a recorder costs no more.
pub trait Recorder<T: Real> {
    /// Called when a channel was fused; `spread` is the covariance of the errors with the channel.
    fn taken(&mut self, _row: &Row<T>, _innovation: &Innovation<T>, _spread: &Difference<T>) {}

    /// Called for every channel that was fused, also one that depends on more than the motion, with the same `spread`.
    fn weighed(&mut self, _channel: usize, _innovation: &Innovation<T>, _spread: &Difference<T>) {}
}

impl<T: Real> Recorder<T> for () {}
