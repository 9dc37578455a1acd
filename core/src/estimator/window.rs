//! The prediction window, and runs over it.

use heapless::Deque;
use nalgebra::SVector;

use super::measurement::{CHANNELS, Measurement, MeasurementModel};
use crate::dynamics::interval::Interval;
use crate::dynamics::{Dynamics, Inputs, State};
use crate::math::Real;

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
