//! Checks that every number of a motion filter stays in its declared range, in the tests that run one.

use bodyflight_core::Real;
use bodyflight_core::estimator::motion::MotionFilter;
use bodyflight_core::estimator::motion::estimate::Recorder;
use bodyflight_core::estimator::motion::state::{
    Difference, MOTION_STATES, RESIDUAL_FORCE, RESIDUAL_MOMENT, STATES, input_vector,
};
use bodyflight_core::estimator::motion::update::Innovation;
use bodyflight_core::estimator::propagation::Propagation;
use bodyflight_core::estimator::ranges::{
    ANGULAR_MOMENTUM, ATTITUDE, DAMPING, GAIN, INNOVATION, INNOVATION_DEVIATION, LINEAR_MOMENTUM,
    MUSCLE_INPUT, PIVOT, RESIDUAL_FORCE as FORCE, RESIDUAL_MOMENT as MOMENT, Range, SLOPE, UNIT,
    scale,
};

/// The largest magnitude of each number so far.
#[derive(Debug, Clone)]
pub struct RangeWatch {
    largest: Vec<(Range, f64)>,
    least_pivot: f64,
}

impl Default for RangeWatch {
    fn default() -> Self {
        Self {
            largest: Vec::new(),
            least_pivot: f64::INFINITY,
        }
    }
}

impl RangeWatch {
    fn note(&mut self, range: &Range, value: f64) {
        assert!(
            range.holds(value),
            "{}: {value} of {}",
            range.name,
            range.limit
        );
        match self.largest.iter_mut().find(|(r, _)| r == range) {
            Some((_, largest)) => *largest = largest.max(value.abs()),
            None => self.largest.push((*range, value.abs())),
        }
    }

    /// Checks the state, the factors of the covariance and the last transition of a filter.
    ///
    /// # Panics
    /// Panics if one has left its range.
    pub fn see<T: Real, P: Propagation<T>>(&mut self, filter: &MotionFilter<T, P>) {
        let state = filter.state();
        let motion = &state.motion;
        for part in motion.inertial_from_body.wxyz() {
            self.note(&ATTITUDE, part.to_f64());
        }
        for (range, vector) in [
            (&LINEAR_MOMENTUM, motion.linear_momentum.to_array()),
            (&ANGULAR_MOMENTUM, motion.angular_momentum.to_array()),
        ] {
            vector
                .iter()
                .for_each(|part| self.note(range, part.to_f64()));
        }
        for (k, part) in input_vector(&state.inputs).iter().enumerate() {
            let range = match MOTION_STATES + k {
                RESIDUAL_MOMENT.. => &MOMENT,
                RESIDUAL_FORCE.. => &FORCE,
                12.. => &DAMPING,
                _ => &MUSCLE_INPUT,
            };
            self.note(range, part.to_f64());
        }
        let factors = filter.factors().elements();
        for j in 0..STATES {
            let pivot = factors[(j, j)].to_f64() / (scale(j) * scale(j));
            self.note(&PIVOT, pivot);
            self.least_pivot = self.least_pivot.min(pivot);
            for i in 0..j {
                self.note(&UNIT, factors[(i, j)].to_f64() * scale(j) / scale(i));
            }
            for i in 0..MOTION_STATES {
                let slope = filter.transition()[(i, j)].to_f64();
                self.note(&SLOPE, slope * scale(j) / scale(i));
            }
        }
    }

    /// The largest magnitudes, a line each.
    pub fn report(&self) -> String {
        let mut text = format!("least {}: {:.1e}\n", PIVOT.name, self.least_pivot);
        for (range, largest) in &self.largest {
            text.push_str(&format!(
                "{:24} reached {largest:12.4} of {}\n",
                range.name, range.limit
            ));
        }
        text
    }
}

impl<T: Real> Recorder<T> for RangeWatch {
    fn weighed(&mut self, _channel: usize, innovation: &Innovation<T>, spread: &Difference<T>) {
        let variance = innovation.variance.to_f64();
        self.note(&INNOVATION, innovation.value.to_f64());
        self.note(&INNOVATION_DEVIATION, variance.sqrt());
        for (k, spread) in spread.iter().enumerate() {
            self.note(&GAIN, spread.to_f64() / variance / scale(k));
        }
    }
}
