//! How sigma points become predicted measurements: the interface that separates the paper's filter from the reduced
//! one.

use super::check::Check;
use super::coefficients::STATES;
use super::measurement::{CHANNELS, MeasurementModel};
use super::unscented::{Moments, Root, SigmaPoints, Unscented};
use super::window::Window;
use crate::dynamics::interval::Interval;
use crate::dynamics::{Dynamics, PostureSample, State};
use crate::frame::{Body, Vector};
use crate::math::Real;

/// A method that predicts the measurement at the end of the window for every sigma point.
pub trait Propagation<T: Real> {
    /// The data stored for each interval of the window.
    type Interval: Interval<T>;
    /// Number of samples in one interval.
    const STRIDE: usize;
    /// Which square root of the covariance spreads the sigma points.
    const ROOT: Root;

    /// Extracts the data to store for an interval that the central run crosses at about `velocity` (m/s, through the
    /// air).
    fn keep(
        dynamics: &Dynamics<T>,
        sample: &PostureSample<T>,
        velocity: &Vector<T, Body>,
    ) -> Self::Interval;

    /// Returns the moments of the sigma points and their predictions from `start`, and the state of the central run at
    /// the end of the window.
    fn predict<const N: usize>(
        filter: &Unscented<T, STATES>,
        points: &SigmaPoints<T, STATES>,
        start: &State<T>,
        window: &Window<'_, T, Self::Interval, N>,
        model: &MeasurementModel,
    ) -> (Moments<T, STATES, CHANNELS>, State<T>);

    /// Hook that may check an update before it is accepted. Returns the state at the end of the window; by default the
    /// update is kept and the state is `front`.
    fn settle<const N: usize>(
        _check: &Check<'_, T>,
        _filter: &mut Unscented<T, STATES>,
        _start: &State<T>,
        _window: &Window<'_, T, Self::Interval, N>,
        front: State<T>,
    ) -> State<T> {
        front
    }
}
