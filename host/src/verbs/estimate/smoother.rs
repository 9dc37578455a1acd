//! The whole flight at once: what later measurements say of earlier inputs.
//!
//! The filter goes forward and leaves at each interval its state, its covariance, the derivatives by which errors
//! crossed the interval, and the channels it took in. Going back over them, the modified Bryson-Frazier
//! smoother collects in an adjoint what the rest of the flight says of an error; no covariance is inverted, so
//! inputs that nothing sees do no harm. It is the fixed-interval smoother of the problem that the filter
//! linearized; with steps of 1/240 s its derivatives change too little for a second linearization to matter.
//!
//! The filter goes forward twice. The first time it finds out when each axis was moved on purpose, some
//! hundredths of a second too late; the second time it knows before.

use bodyflight_core::Real;
use bodyflight_core::estimator::motion::estimate::Recorder;
use bodyflight_core::estimator::motion::measurement::Row;
use bodyflight_core::estimator::motion::settings::Process;
use bodyflight_core::estimator::motion::state::{
    Covariance, Difference, FlightState, INPUT_STATES, MOTION_STATES, STATES,
};
use bodyflight_core::estimator::motion::transition::MotionSlope;
use bodyflight_core::estimator::motion::update::Innovation;
use nalgebra::SVector;

/// A channel as it was taken in.
struct Taken {
    slope: SVector<f64, 9>,
    spread: Difference<f64>,
    innovation: f64,
    variance: f64,
}

/// An interval as the filter left it.
struct Step {
    slope: MotionSlope<f64>,
    decay: SVector<f64, INPUT_STATES>,
    taken: Vec<Taken>,
    state: FlightState<f64>,
    covariance: Covariance<f64>,
}

/// What a filter leaves behind, and the way back over it.
#[derive(Default)]
pub struct Track {
    steps: Vec<Step>,
    /// Of the interval that is not settled yet.
    slope: Option<(MotionSlope<f64>, SVector<f64, INPUT_STATES>)>,
    taken: Vec<Taken>,
}

/// A state that knows of the whole flight.
pub struct Smoothed {
    /// The filter's state.
    pub filtered: FlightState<f64>,
    /// By how much it has to be moved.
    pub correction: Difference<f64>,
    /// Standard deviations of what is left.
    pub deviation: Difference<f64>,
}

impl<T: Real> Recorder<T> for Track {
    fn crossed(&mut self, slope: &MotionSlope<T>, process: &Process<T>) {
        self.slope = Some((slope.map(Real::to_f64), process.decay().map(Real::to_f64)));
        self.taken.clear();
    }

    fn taken(&mut self, row: &Row<T>, innovation: &Innovation<T>, spread: &Difference<T>) {
        self.taken.push(Taken {
            slope: row.slope.map(Real::to_f64),
            spread: spread.map(Real::to_f64),
            innovation: innovation.value.to_f64(),
            variance: innovation.variance.to_f64(),
        });
    }

    fn settled(&mut self, state: &FlightState<T>, covariance: &Covariance<T>) {
        let Some((slope, decay)) = self.slope.take() else {
            return;
        };
        self.steps.push(Step {
            slope,
            decay,
            taken: std::mem::take(&mut self.taken),
            state: state.cast(),
            covariance: covariance.map(Real::to_f64),
        });
    }
}

impl Track {
    /// Goes back over the flight: a smoothed state for each interval, in order of time; `wanted` says of which
    /// (counted from 0).
    pub fn smoothed(&self, wanted: impl Fn(usize) -> bool) -> Vec<(usize, Smoothed)> {
        let mut adjoint = Difference::<f64>::zeros();
        let mut information = Covariance::<f64>::zeros();
        let mut smoothed = Vec::new();
        for (index, step) in self.steps.iter().enumerate().rev() {
            if wanted(index) {
                let correction = -(step.covariance * adjoint);
                let known = step.covariance * information;
                let mut deviation = Difference::zeros();
                for k in 0..STATES {
                    let lost: f64 = (0..STATES)
                        .map(|j| known[(k, j)] * step.covariance[(j, k)])
                        .sum();
                    deviation[k] = (step.covariance[(k, k)] - lost).max(0.0).sqrt();
                }
                smoothed.push((
                    index,
                    Smoothed {
                        filtered: step.state,
                        correction,
                        deviation,
                    },
                ));
            }
            for taken in step.taken.iter().rev() {
                taken.back(&mut adjoint, &mut information);
            }
            step.back(&mut adjoint, &mut information);
        }
        smoothed.reverse();
        smoothed
    }
}

impl Taken {
    /// Back through the update: with `K = spread / variance`, `(1 - K H)^T` on what comes from later, and what
    /// the channel itself says.
    fn back(&self, adjoint: &mut Difference<f64>, information: &mut Covariance<f64>) {
        let inverse = 1.0 / self.variance;
        let gain = self.spread * inverse;
        let seen = gain.dot(adjoint) + self.innovation * inverse;
        let column = *information * gain;
        let known = gain.dot(&column) + inverse;
        for k in 0..MOTION_STATES {
            adjoint[k] -= self.slope[k] * seen;
        }
        for k in 0..MOTION_STATES {
            let slope = self.slope[k];
            if slope == 0.0 {
                continue;
            }
            for j in 0..STATES {
                information[(k, j)] -= slope * column[j];
                information[(j, k)] -= slope * column[j];
            }
            for j in 0..MOTION_STATES {
                information[(k, j)] += slope * known * self.slope[j];
            }
        }
    }
}

impl Step {
    /// Back over the interval.
    fn back(&self, adjoint: &mut Difference<f64>, information: &mut Covariance<f64>) {
        let motion = adjoint.fixed_rows::<MOTION_STATES>(0).into_owned();
        let inputs = adjoint
            .fixed_rows::<INPUT_STATES>(MOTION_STATES)
            .into_owned();
        *adjoint = self.slope.tr_mul(&motion);
        for k in 0..INPUT_STATES {
            adjoint[MOTION_STATES + k] += self.decay[k] * inputs[k];
        }
        // Phi = [slope; 0 decay]: Phi^T M Phi in the four blocks of M.
        let motion = information
            .fixed_view::<MOTION_STATES, MOTION_STATES>(0, 0)
            .into_owned();
        let mixed = information
            .fixed_view::<MOTION_STATES, INPUT_STATES>(0, MOTION_STATES)
            .into_owned();
        let inputs = information
            .fixed_view::<INPUT_STATES, INPUT_STATES>(MOTION_STATES, MOTION_STATES)
            .into_owned();
        *information = self.slope.tr_mul(&(motion * self.slope));
        let mixed = self.slope.tr_mul(&mixed);
        for j in 0..INPUT_STATES {
            for i in 0..STATES {
                let value = mixed[(i, j)] * self.decay[j];
                information[(i, MOTION_STATES + j)] += value;
                information[(MOTION_STATES + j, i)] += value;
            }
            for i in 0..INPUT_STATES {
                information[(MOTION_STATES + i, MOTION_STATES + j)] +=
                    inputs[(i, j)] * self.decay[i] * self.decay[j];
            }
        }
    }
}
