//! How sigma points become predicted measurements: the seam between the paper's filter and the reduced one.

use super::check::Check;
use super::coefficients::STATES;
use super::measurement::{CHANNELS, MeasurementModel};
use super::unscented::{Moments, Root, SigmaPoints, Unscented};
use super::window::Window;
use crate::dynamics::interval::Interval;
use crate::dynamics::{Dynamics, PostureSample, State};
use crate::frame::{Body, Vector};
use crate::math::Real;

/// A way to predict the measurement at the end of the window for every sigma point.
pub trait Propagation<T: Real> {
    /// What the ring keeps of an interval.
    type Interval: Interval<T>;
    /// Samples that one interval spans.
    const STRIDE: usize;
    /// Square root of the covariance that spreads the sigma points.
    const ROOT: Root;

    /// What to keep of an interval that the central run crosses at about `velocity` (m/s, through the air).
    fn keep(
        dynamics: &Dynamics<T>,
        sample: &PostureSample<T>,
        velocity: &Vector<T, Body>,
    ) -> Self::Interval;

    /// Moments of the sigma points with their predictions from `start`, and the central run's state at the
    /// window's end.
    fn predict<const N: usize>(
        filter: &Unscented<T, STATES>,
        points: &SigmaPoints<T, STATES>,
        start: &State<T>,
        window: &Window<'_, T, Self::Interval, N>,
        model: &MeasurementModel,
    ) -> (Moments<T, STATES, CHANNELS>, State<T>);

    /// Hook that may check an update before it is accepted. Returns the state at the window's end; by default the
    /// update is kept, and the state is `front`.
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
