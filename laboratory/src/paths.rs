//! Paths of effects that change at random in a simulated flight, drawn step by step by filters of white noise.
//!
//! The search uses covariances instead of these filters, so each checks the other.

use bodyflight_core::axis::AxisCoefficients;
use bodyflight_core::dynamics::Inputs;
use bodyflight_core::effect::random::{INPUT_TIME, Random};
use bodyflight_core::frame::{Inertial, Vector};
use nalgebra::Vector3;
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;

/// Distinguishes the seed of paths from that of a flight with the same number.
const PATHS: u64 = 0x9a77;

/// Time for which a new filter runs until its initial state of zero no longer matters, and the step used meanwhile
/// (both in correlation times).
const FORGOTTEN: f64 = 12.0;
const FORGETTING: f64 = 0.01;

/// A filter of unit variance with two states, advanced in fractions of its correlation time.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Filter {
    first: f64,
    second: f64,
}

impl Filter {
    fn settled(random: &mut ChaCha8Rng) -> Self {
        let mut filter = Self::default();
        let mut passed = 0.0;
        while passed < FORGOTTEN {
            filter.advance(FORGETTING, random);
            passed += FORGETTING;
        }
        filter
    }

    /// White noise passed twice through `1 / (1 + T s)`.
    pub(super) fn advance(&mut self, times: f64, random: &mut ChaCha8Rng) {
        let before = self.first;
        let kept = (-times).exp();
        let noise: f64 = random.sample(StandardNormal);
        self.first = before * kept + (1.0 - kept * kept).sqrt() * noise;
        let driven = 0.5 * (before + self.first);
        self.second += (driven - self.second) * (1.0 - kept);
    }

    /// Along the path: first order.
    pub(super) const fn along(&self) -> f64 {
        self.first
    }

    /// Across it: `(1 + sqrt(3) T s) / (1 + T s)^2`, scaled to a variance of one.
    pub(super) fn across(&self) -> f64 {
        let root = 3.0_f64.sqrt();
        (root * self.first + (1.0 - root) * self.second) * core::f64::consts::FRAC_1_SQRT_2
    }
}

/// The changing air and inputs of a flight.
pub(super) struct Paths {
    strengths: Random<f64>,
    random: ChaCha8Rng,
    /// North, west, up.
    air: [Filter; 3],
    muscle: [Filter; 3],
    /// Angles that perform a random walk (rad).
    damping: [f64; 3],
}

impl Paths {
    /// Returns `None` if nothing changes at random.
    pub(super) fn new(strengths: &Random<f64>, seed: u64) -> Option<Self> {
        if *strengths == Random::none() {
            return None;
        }
        let mut random = ChaCha8Rng::seed_from_u64(seed ^ PATHS);
        let turn = core::f64::consts::TAU;
        let damping = core::array::from_fn(|_| turn * random.random::<f64>());
        let mut filters = || core::array::from_fn(|_| Filter::settled(&mut random));
        Some(Self {
            strengths: *strengths,
            air: filters(),
            muscle: filters(),
            damping,
            random,
        })
    }

    /// Advances by `duration` (s) of a fall at `speed` (m/s) through the air.
    pub(super) fn advance(&mut self, speed: f64, duration: f64) {
        let random = &mut self.random;
        let lengths = speed * duration / self.strengths.turbulence.length;
        for filter in &mut self.air {
            filter.advance(lengths, random);
        }
        for filter in &mut self.muscle {
            filter.advance(duration / INPUT_TIME, random);
        }
        let spread = (2.0 * duration / INPUT_TIME).sqrt();
        for angle in &mut self.damping {
            *angle += spread * random.sample::<f64, _>(StandardNormal);
        }
    }

    /// Deviation of the air velocity from its mean; the path of a fall is taken as vertical.
    pub(super) fn gust(&self) -> Vector<f64, Inertial> {
        let [north, west, up] = &self.air;
        let gust = Vector3::new(north.across(), west.across(), up.along());
        Vector::from_components(gust * self.strengths.turbulence.strength)
    }

    /// The flight's `inputs` with the muscle input and damping that currently vary.
    pub(super) fn changed(&self, inputs: &Inputs<f64>) -> Inputs<f64> {
        let muscle = AxisCoefficients::from(self.muscle.each_ref().map(Filter::along));
        let muscle = muscle.zip_map(self.strengths.muscle, |path, size| path * size);
        // The sine of a random walk has the correlation of first-order noise, but is bounded: without positive damping
        // the body would tumble.
        let damping = AxisCoefficients::from(self.damping.map(f64::sin));
        let factor = damping.zip_map(self.strengths.damping, |path, size| {
            1.0 + core::f64::consts::SQRT_2 * size * path
        });
        Inputs {
            muscle: inputs.muscle.zip_map(muscle, |own, more| own + more),
            damping: inputs.damping.zip_map(factor, |own, factor| own * factor),
            residual: inputs.residual,
        }
    }
}

#[cfg(test)]
mod tests {
    use bodyflight_core::effect::random::Turbulence;

    use super::*;

    /// A long path, filtered in small steps, has the covariance that the search assumes.
    #[test]
    fn filtered_noise_has_the_covariance_of_the_spectrum() {
        let turbulence = Turbulence {
            strength: 1.0,
            length: 1.0,
        };
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let mut filter = Filter::settled(&mut random);
        let step = 0.02;
        let path: Vec<[f64; 2]> = (0..2_000_000)
            .map(|_| {
                filter.advance(step, &mut random);
                [filter.along(), filter.across()]
            })
            .collect();
        for lag in [0, 5, 15, 50, 100, 150] {
            let apart = Vector3::new(0.0, 0.0, lag as f64 * step);
            let expected = turbulence.covariance(&apart);
            let pairs = path.iter().zip(&path[lag..]);
            let sums = pairs.fold([0.0; 2], |sums, (a, b)| {
                [sums[0] + a[0] * b[0], sums[1] + a[1] * b[1]]
            });
            let [along, across] = sums.map(|sum| sum / (path.len() - lag) as f64);
            assert!((along - expected[(2, 2)]).abs() < 0.03, "{lag}: {along}");
            assert!((across - expected[(0, 0)]).abs() < 0.03, "{lag}: {across}");
        }
    }

    #[test]
    fn damping_stays_positive_with_its_mean_deviation_and_time() {
        let mut strengths = Random::none();
        strengths.damping = AxisCoefficients::new(0.0, 0.7, 0.0);
        let mut paths = Paths::new(&strengths, 1).unwrap();
        let mut off = Vec::new();
        let plain = Inputs::<f64>::belly_turn().damping;
        for _ in 0..400_000 {
            paths.advance(50.0, 0.1);
            let damping = paths.changed(&Inputs::belly_turn()).damping;
            assert!((damping.pitch - plain.pitch).abs() < 1e-12);
            off.push(damping.yaw / plain.yaw - 1.0);
        }
        assert!(off.iter().all(|off| *off > -1.0));
        let count = off.len() as f64;
        let mean = off.iter().sum::<f64>() / count;
        assert!(mean.abs() < 0.02, "{mean}");
        for lag in [0, 10, 20, 40] {
            let pairs = off.iter().zip(&off[lag..]);
            let found = pairs.map(|(a, b)| a * b).sum::<f64>() / count;
            let expected = 0.49 * (-0.1 * lag as f64 / INPUT_TIME).exp();
            assert!(
                (found - expected).abs() < 0.02,
                "{lag}: {found}, {expected}"
            );
        }
    }
}
