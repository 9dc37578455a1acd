//! What the motion filter publishes, and what it shows to who watches it.

use nalgebra::SVector;

use super::measurement::{CHANNELS, Row};
use super::state::{Difference, STATES};
use super::update::Innovation;
use super::watch::{Consistency, Watch};
use crate::dynamics::{Inputs, Motion};
use crate::estimator::status::Faults;
use crate::math::Real;

/// One channel at the last interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChannelEstimate<T> {
    /// Measured less predicted; zero where nothing was measured.
    pub innovation: T,
    /// Its variance; zero where nothing was measured.
    pub variance: T,
    /// Whether it was fused.
    pub fused: bool,
    /// Whether it was beyond the gate.
    pub rejected: bool,
}

/// The filter's output after a sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotionEstimate<T: Real> {
    /// The sample it stands for, the one just taken in; sample 0 is the start.
    pub sample: u32,
    /// Inputs at that sample.
    pub inputs: Inputs<T>,
    /// Standard deviations of all error coordinates, in the order of [`state`](super::state).
    pub deviation: SVector<T, STATES>,
    /// Motion at that sample.
    pub motion: Motion<T>,
    /// Channels at that sample.
    pub channels: [ChannelEstimate<T>; CHANNELS],
    /// Normalised innovation squared, the mean of a channel since the last estimate; one where model and noise
    /// match reality.
    pub normalised_innovation: T,
    /// Consistency of each channel.
    pub watch: Watch<T>,
    /// The worst of them.
    pub consistency: Consistency,
    /// What went wrong since the last estimate.
    pub faults: Faults,
}

/// What goes on inside a filter, for who wants to watch. A filter without one costs no more.
pub trait Recorder<T: Real> {
    /// A channel was taken in; `spread` is the covariance of the errors with the channel.
    fn taken(&mut self, _row: &Row<T>, _innovation: &Innovation<T>, _spread: &Difference<T>) {}
}

impl<T: Real> Recorder<T> for () {}
