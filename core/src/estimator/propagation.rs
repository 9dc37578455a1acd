//! How sigma points become predicted measurements: the seam between the paper's filter and the reduced one.

use heapless::Deque;
use nalgebra::SVector;

use super::STATES;
use super::check::Check;
use super::measurement::{CHANNELS, Measurement, MeasurementModel};
use super::unscented::{Moments, Root, SigmaPoints, Unscented};
use crate::dynamics::interval::Interval;
use crate::dynamics::{Dynamics, Inputs, PostureSample, State};
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

    /// What becomes of an update before it is believed, and the state at the window's end: as it is, at `front`,
    /// unless the propagation checks it.
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

/// The prediction window: intervals in order of time, and what every run over them shares.
#[derive(Debug)]
pub struct Window<'a, T: Real, I, const N: usize> {
    /// What stays the same during a flight.
    pub dynamics: &'a Dynamics<T>,
    /// The intervals, earliest first.
    pub intervals: &'a Deque<I, N>,
    /// Duration of one interval (s).
    pub duration: T,
    /// Density of the air (kg/m3); it changes by less than 0.2 % over a window of 0.25 s.
    pub density: T,
}

impl<T: Real, I: Interval<T>, const N: usize> Window<'_, T, I, N> {
    /// States at the window's end of `R` runs from the same start with constant inputs each.
    ///
    /// All runs cross an interval before any crosses the next: its data are fetched once.
    pub fn run<const R: usize>(&self, start: &State<T>, inputs: &[Inputs<T>; R]) -> [State<T>; R] {
        let mut states = [*start; R];
        for interval in self.intervals {
            for (state, inputs) in states.iter_mut().zip(inputs) {
                *state = self.step(state, interval, inputs);
            }
        }
        states
    }

    /// One step over one interval.
    #[inline]
    pub fn step(&self, state: &State<T>, interval: &I, inputs: &Inputs<T>) -> State<T> {
        self.dynamics
            .step_at_density(state, interval, inputs, self.duration, self.density)
    }

    /// Predicted measurement vector of a state at the window's end.
    pub fn observe(&self, state: &State<T>, model: &MeasurementModel) -> SVector<T, CHANNELS> {
        match self.intervals.back() {
            Some(last) => model.vector(&Measurement::of(&state.motion(last))),
            None => SVector::zeros(),
        }
    }
}
