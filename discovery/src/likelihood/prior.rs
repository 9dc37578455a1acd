//! Priors of the errors of a flight.

use crate::named_effect::EffectSet;
use bodyflight_core::tolerances::Tolerances;
use nalgebra::DVector;

use crate::jacobian::layout::{COMPONENTS, Components, WANDER, WRENCH, components};
use crate::jacobian::linearization_point::{LinearizationPoint, OWN};
use crate::jacobian::subject_error::{GYRO_SCALE, aliased, subject_deviations};
use crate::shooting::joint_error::JOINTS;

/// Priors of the errors.
#[derive(Debug, Clone)]
pub struct Prior {
    /// Mean and standard deviation of the logarithm of each variance. A deviation of zero fixes it.
    pub sizes: [(f64, f64); COMPONENTS],
    /// Tolerances of the constants.
    pub tolerances: Tolerances,
    /// Parameters of the subject that are held fixed because an effect in the model replaces them.
    pub fixed: Vec<usize>,
}

/// Standard deviations of the log-variances: sensors whose noise shows in the recording, the same in short flights (motion
/// capture is smoothed, which hides noise from the differences of neighbouring frames), velocities (whose slow errors
/// no other sensor reveals), wander, and forces and moments.
const SEEN: f64 = 0.25;
const SEEN_IN_SHORT: f64 = 1.0;
const SEEN_VELOCITY: f64 = 0.7;
const WANDERS: f64 = 1.5;
const WRENCHES: f64 = 2.0;
/// Prior scale of moments (N m) and forces (N) in a tenth of a second.
const PUSHING: [f64; 2] = [0.3, 3.0];
/// Starting values for these scales: the search converges from above, but not from below.
const PUSHING_FIRST: [f64; 2] = [2.0, 20.0];

impl Prior {
    /// Creates the priors for sensors with the noise found in the recording, which may be a short one.
    pub(crate) fn new(noise: &[f64; 4], tolerances: &Tolerances, is_short: bool) -> Self {
        let wander = tolerances.wander_deg.to_radians();
        let logarithm = |deviation: f64| 2.0 * deviation.ln();
        let seen = if is_short { SEEN_IN_SHORT } else { SEEN };
        let sizes = core::array::from_fn(|k| match k {
            0 | 1 => (logarithm(noise[k]), seen),
            2 | 3 => (logarithm(noise[k]), SEEN_VELOCITY),
            4..=6 => (logarithm(wander * SHARES[k - 4]), WANDERS),
            7 | 8 => (logarithm(PUSHING[k - 7]), WRENCHES),
            _ => (f64::NEG_INFINITY, 0.0),
        });
        Self {
            sizes,
            tolerances: *tolerances,
            fixed: Vec::new(),
        }
    }

    /// The prior given some effects: constants that would do the same are held fixed.
    pub fn given(&self, effects: &EffectSet) -> Self {
        let mut prior = self.clone();
        prior.fixed = fixed_by(effects);
        for (effect, values) in effects {
            for (k, value) in components(*effect).zip(values) {
                prior.sizes[k] = (2.0 * value.ln(), 0.0);
            }
        }
        prior
    }

    /// Starting values of the variances.
    pub fn start(&self) -> Components {
        Components::from_fn(|k, _| match k {
            7 | 8 if self.sizes[k].1 > 0.0 => PUSHING_FIRST[k - 7].powi(2),
            _ => self.sizes[k].0.exp(),
        })
    }

    /// The same priors without forces and moments.
    pub fn without_wrench(&self) -> Self {
        let mut prior = self.clone();
        for (k, size) in WRENCH.into_iter().zip(PUSHING) {
            prior.sizes[k] = (2.0 * (0.05 * size).ln(), 0.0);
        }
        prior
    }

    /// Limits the wander of the joints to what a suit can plausibly do. Without a limit, a fit of flights with a strong
    /// missing effect ends where joints are off by tens of degrees and explain everything.
    pub(crate) fn limited(&self, mut sizes: Components) -> Components {
        let excess = wander(&sizes) / self.tolerances.joint_limit_deg().to_radians();
        if excess > 1.0 {
            for k in WANDER {
                sizes[k] /= excess * excess;
            }
        }
        sizes
    }

    pub(crate) fn penalty(&self, sizes: &Components) -> f64 {
        let each = self
            .sizes
            .iter()
            .zip(sizes)
            .filter(|(prior, _)| prior.1 > 0.0);
        each.map(|((middle, deviation), size)| 0.5 * ((size.ln() - middle) / deviation).powi(2))
            .sum()
    }
}

/// Root mean square of the wander of a joint about an axis (rad).
pub(crate) fn wander(sizes: &Components) -> f64 {
    let squares = WANDER.iter().zip([1.0, 3.0, 5.0]);
    squares
        .map(|(k, norm)| sizes[*k] / norm)
        .sum::<f64>()
        .sqrt()
}

/// Relative size of the wander's polynomials of degree zero, one and two.
const SHARES: [f64; 3] = [1.0, 0.5, 0.15];

/// Standard deviations of calibration and bend errors, which are estimated too.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PriorDeviations {
    /// Calibration of a joint (rad).
    pub calibration: f64,
    /// Joint error proportional to the bend (fraction).
    pub bend: f64,
}

impl PriorDeviations {
    pub(crate) fn new(tolerances: &Tolerances) -> Self {
        Self {
            calibration: tolerances.joint_deg.to_radians(),
            bend: tolerances.bend,
        }
    }

    /// Precision of the constants that differ between flights.
    pub fn own_precision(&self) -> DVector<f64> {
        DVector::from_fn(OWN, |k, _| {
            let deviation = match k {
                _ if k < JOINTS => self.calibration,
                _ if k < 2 * JOINTS => self.bend,
                _ => GYRO_SCALE,
            };
            deviation.powi(-2)
        })
    }
}

/// Precision of the subject's parameters. Those that an effect in the model replaces are held fixed.
pub(crate) fn subject_precision(tolerances: &Tolerances, fixed: &[usize]) -> DVector<f64> {
    let mut precision = subject_deviations(tolerances).map(|deviation| deviation.powi(-2));
    for &k in fixed {
        precision[k] *= 1e8;
    }
    precision
}

/// Parameters of the subject that some effects replace.
pub(crate) fn fixed_by(effects: &EffectSet) -> Vec<usize> {
    let each = effects.iter();
    each.flat_map(|(effect, _)| aliased(*effect)).collect()
}

/// The point without errors of the subject that its effects stand for.
pub(crate) fn unaliased(mut point: LinearizationPoint) -> LinearizationPoint {
    for k in fixed_by(&point.effects) {
        point.subject.0[k] = 0.0;
    }
    point
}
