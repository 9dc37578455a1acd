//! The paper's prediction: the whole model is run over the whole window for every sigma point.

use super::coefficients::{STATES, inputs_of_filter};
use super::propagation::Propagation;
use super::unscented::{Moments, Root, SigmaPoints, Unscented};
use super::window::Window;
use crate::dynamics::{Dynamics, PostureSample, State};
use crate::estimator::measurement::{CHANNELS, MeasurementModel};
use crate::frame::{Body, Vector};
use crate::math::Real;

/// Number of sigma points, 2 n + 1.
const POINTS: usize = 2 * STATES + 1;

/// Thirteen runs of the full model, with one step per sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Full;

impl<T: Real> Propagation<T> for Full {
    type Interval = PostureSample<T>;
    const STRIDE: usize = 1;
    /// The symmetric root, as in the paper.
    const ROOT: Root = Root::Symmetric;

    fn keep(_: &Dynamics<T>, sample: &PostureSample<T>, _: &Vector<T, Body>) -> PostureSample<T> {
        *sample
    }

    fn predict<const N: usize>(
        filter: &Unscented<T, STATES>,
        points: &SigmaPoints<T, STATES>,
        start: &State<T>,
        window: &Window<'_, T, PostureSample<T>, N>,
        model: &MeasurementModel,
    ) -> (Moments<T, STATES, CHANNELS>, State<T>) {
        let mut coefficients = [points.centre; POINTS];
        let (plus, minus) = (points.plus.iter(), points.minus.iter());
        for (slot, point) in coefficients.iter_mut().skip(1).zip(plus.chain(minus)) {
            *slot = *point;
        }
        let runs = window.run(start, &coefficients.map(|x| inputs_of_filter(&x)));
        let seen = runs.map(|state| window.observe(&state, model));
        let differences = seen.map(|z| model.difference(&z, &seen[0]));
        let [_, p0, p1, p2, p3, p4, p5, m0, m1, m2, m3, m4, m5] = differences;
        let moments = filter.moments(
            points,
            &seen[0],
            &[p0, p1, p2, p3, p4, p5],
            &[m0, m1, m2, m3, m4, m5],
        );
        (moments, runs[0])
    }
}
