//! Numbers that hardly change during a flight and act on all of it: the wind and the biases of the gyroscope.
//!
//! They are separate from the state, after Friedland (1969): beside the filter runs the effect of each constant on the
//! state's errors, and a small covariance of the constants. Together they are what one larger filter would hold, for a
//! third of its work; a constant that no sensor concerns costs nothing.

use nalgebra::{SMatrix, SVector, Vector3};

use super::measurement::{RATE_CHANNELS, SensorMeasurement};
use super::process::Process;
use super::settings::MotionPreset;
use super::state::{Difference, INPUT_STATES, MOTION_STATES, STATES, VELOCITY};
use super::transition::MotionSlope;
use crate::estimator::ud::{Seen, Ud};
use crate::math::{Lanes, Real};

/// Number of constants: wind to the north and west (m/s), gyroscope bias about each body axis (rad/s).
pub const CONSTANTS: usize = 5;
/// Index of the wind.
pub const WIND: usize = 0;
/// Index of the gyroscope bias.
pub const BIAS: usize = 2;

/// One number for each constant.
pub type Constant<T> = SVector<T, CONSTANTS>;

/// The errors of the constants, and their effect on the errors of the state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Constants<T: Real> {
    effect: SMatrix<T, STATES, CONSTANTS>,
    factors: Ud<T, CONSTANTS>,
    /// Initial variance of wind and bias, and the variance by which each grows per interval.
    start: [T; 2],
    noise: [T; 2],
    /// Whether wind and bias are estimated.
    awake: [bool; 2],
    /// Bias as estimated (rad/s).
    bias: Vector3<T>,
}

/// How a channel sees the constants.
#[derive(Debug, Clone, Copy)]
pub struct ConstantSeen<T: Real> {
    /// Derivative of the channel with respect to each constant, directly and through the state.
    pub slope: Constant<T>,
    seen: Option<Seen<T, CONSTANTS>>,
}

impl<T: Real> ConstantSeen<T> {
    /// Variance of the channel that is due to the constants.
    pub fn variance(&self) -> T {
        self.seen.map_or_else(T::zero, |seen| seen.variance)
    }
}

impl<T: Real> Constants<T> {
    /// Creates constants that no sensor has concerned yet.
    pub fn new(preset: &MotionPreset, duration: T) -> Self {
        let square = |value: f32| T::single(value * value);
        Self {
            effect: SMatrix::zeros(),
            factors: Ud::diagonal(&SVector::zeros()),
            start: [square(preset.wind_deviation), square(preset.gyroscope_bias)],
            noise: [preset.wind_noise, preset.gyroscope_bias_noise]
                .map(|noise| square(noise) * duration),
            awake: [false; 2],
            bias: Vector3::zeros(),
        }
    }

    /// Whether any constant is estimated.
    pub fn is_awake(&self) -> bool {
        self.awake.contains(&true)
    }

    /// Bias of the gyroscope as estimated (rad/s, body axes).
    pub fn bias(&self) -> Vector3<T> {
        self.bias
    }

    /// Standard deviations of the constants; zero for those that are not estimated.
    pub fn deviations(&self) -> Constant<T> {
        let variances = self.factors.variances().map(Lanes::root);
        SVector::from_fn(|k, _| {
            if self.awake[usize::from(k >= BIAS)] {
                variances[k]
            } else {
                T::zero()
            }
        })
    }

    /// Begins to estimate the constants that a measurement concerns: a receiver measures the velocity over the ground,
    /// so the wind matters; a gyroscope has a bias.
    pub fn concern(&mut self, measured: &SensorMeasurement<T>) {
        self.wake([measured.receiver.is_some(), measured.gyroscope.is_some()]);
    }

    /// Begins to estimate the wind, because a measured velocity contradicts the air's.
    pub fn concern_wind(&mut self) {
        self.wake([true, false]);
    }

    fn wake(&mut self, concerned: [bool; 2]) {
        for (which, first, last) in [(0, WIND, BIAS), (1, BIAS, CONSTANTS)] {
            if concerned[which] && !self.awake[which] && self.start[which] > T::zero() {
                self.awake[which] = true;
                for k in first..last {
                    self.factors.add_to(k, self.start[which]);
                }
            }
        }
    }

    /// Forgets how the constants' errors are connected with those of the state, after these were renewed, and widens
    /// them.
    pub fn disconnect(&mut self) {
        self.effect = SMatrix::zeros();
        for k in 0..CONSTANTS {
            let which = usize::from(k >= BIAS);
            if self.awake[which] && self.factors.variance(k) < self.start[which] {
                self.factors.add_to(k, self.start[which]);
            }
        }
    }

    /// Propagates over an interval. The air's velocity acts like the opposite velocity of the body, except that the
    /// body's own velocity also remains.
    #[inline(never)]
    pub fn cross(&mut self, slope: &MotionSlope<T>, process: &Process<T>) {
        if !self.is_awake() {
            return;
        }
        let decay = process.decay();
        for constant in 0..CONSTANTS {
            // The effect of one that no measurement corrects would grow without bounds.
            let which = usize::from(constant >= BIAS);
            if !self.awake[which] {
                continue;
            }
            let before = self.effect.column(constant).into_owned();
            let mut motion = SVector::<T, MOTION_STATES>::zeros();
            for k in 0..STATES {
                for i in 0..MOTION_STATES {
                    motion[i] += slope[(i, k)] * before[k];
                }
            }
            if constant < BIAS {
                motion -= slope.column(VELOCITY + constant);
                motion[VELOCITY + constant] += T::one();
            }
            for i in 0..MOTION_STATES {
                self.effect[(i, constant)] = motion[i];
            }
            for i in 0..INPUT_STATES {
                self.effect[(MOTION_STATES + i, constant)] *= decay[i];
            }
            self.factors.add_to(constant, self.noise[which]);
        }
    }

    /// How a channel whose derivative is `slope` sees the constants; `direct` is the derivative with respect to the
    /// constants themselves.
    pub fn see(&self, slope: &[T], direct: &Constant<T>) -> ConstantSeen<T> {
        if !self.is_awake() {
            return ConstantSeen {
                slope: Constant::zeros(),
                seen: None,
            };
        }
        let mut total = *direct;
        for (k, slope) in slope.iter().enumerate() {
            for constant in 0..CONSTANTS {
                total[constant] += self.effect[(k, constant)] * *slope;
            }
        }
        for constant in 0..CONSTANTS {
            if !self.awake[usize::from(constant >= BIAS)] {
                total[constant] = T::zero();
            }
        }
        ConstantSeen {
            slope: total,
            seen: Some(self.factors.see(total.as_slice())),
        }
    }

    /// Updates with a channel whose innovation has the variance `own` without the constants' errors; `spread` is the
    /// covariance of the state's errors with the channel, again without them. Returns the covariance of the constants
    /// and adds their share to `spread`.
    pub fn update(
        &mut self,
        seen: &ConstantSeen<T>,
        own: T,
        spread: &mut Difference<T>,
    ) -> Constant<T> {
        let Some(constants) = &seen.seen else {
            return Constant::zeros();
        };
        let gain = *spread * (T::one() / own);
        let through = self.factors.update(constants, own);
        *spread += self.effect * through;
        for constant in 0..CONSTANTS {
            let slope = seen.slope[constant];
            for k in 0..STATES {
                self.effect[(k, constant)] -= gain[k] * slope;
            }
        }
        through
    }

    /// Corrects the bias, and clamps the factors; returns whether that was necessary.
    pub fn settle(&mut self, moved: &Constant<T>) -> bool {
        self.bias += moved.fixed_rows::<3>(BIAS);
        let broken = !self.effect.iter().all(|v| v.is_finite());
        if broken {
            self.effect = SMatrix::zeros();
        }
        self.is_awake() && (self.factors.keep_positive() || broken)
    }

    /// Adds the part of the state's variances that is due to the constants.
    pub fn add_variances(&self, variances: &mut Difference<T>) {
        if !self.is_awake() {
            return;
        }
        for k in 0..STATES {
            let row = self.effect.row(k).transpose();
            variances[k] += self.factors.see(row.as_slice()).variance;
        }
    }

    /// Direct derivative of a channel with respect to the constants; `slope` is its derivative with respect to the
    /// state.
    pub fn direct(channel: usize, slope: &[T], gyroscope: bool, airflow: bool) -> Constant<T> {
        let mut direct = Constant::zeros();
        if gyroscope && RATE_CHANNELS.contains(&channel) {
            direct[BIAS + channel - RATE_CHANNELS.start] = T::one();
        }
        if airflow {
            for k in WIND..BIAS {
                direct[k] = slope
                    .get(VELOCITY + k)
                    .map_or_else(T::zero, |slope| -*slope);
            }
        }
        direct
    }
}
