//! The prediction window, and model runs over it.

use heapless::Deque;
use nalgebra::SVector;

use super::measurement::{CHANNELS, Measurement, MeasurementModel};
use crate::dynamics::interval::Interval;
use crate::dynamics::{Dynamics, Inputs, State};
use crate::math::Real;

/// The prediction window: its intervals in order of time, and the data that every run over them shares.
#[derive(Debug)]
pub struct Window<'a, T: Real, I, const N: usize> {
    /// Everything that stays the same during a flight.
    pub dynamics: &'a Dynamics<T>,
    /// The intervals, earliest first.
    pub intervals: &'a Deque<I, N>,
    /// Duration of one interval (s).
    pub duration: T,
    /// Density of the air (kg/m3); it changes by less than 0.2 % over a window of 0.25 s.
    pub density: T,
}

impl<T: Real, I: Interval<T>, const N: usize> Window<'_, T, I, N> {
    /// Returns the states at the end of the window for `R` runs from the same start, each with its own constant
    /// inputs.
    ///
    /// All runs cross an interval before any of them crosses the next, so that its data are fetched only once.
    pub fn run<const R: usize>(&self, start: &State<T>, inputs: &[Inputs<T>; R]) -> [State<T>; R] {
        let mut states = [*start; R];
        for interval in self.intervals {
            for (state, inputs) in states.iter_mut().zip(inputs) {
                *state = self.step(state, interval, inputs);
            }
        }
        states
    }

    /// Crosses one interval in one step.
    #[inline]
    pub fn step(&self, state: &State<T>, interval: &I, inputs: &Inputs<T>) -> State<T> {
        self.dynamics
            .step_at_density(state, interval, inputs, self.duration, self.density)
    }

    /// Returns the predicted measurement vector of a state at the end of the window.
    pub fn observe(&self, state: &State<T>, model: &MeasurementModel) -> SVector<T, CHANNELS> {
        match self.intervals.back() {
            Some(last) => model.vector(&Measurement::of(&state.motion(last))),
            None => SVector::zeros(),
        }
    }
}
