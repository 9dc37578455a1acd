//! Priors on the errors of a flight.

use nalgebra::{DVector, SVector};

use super::nuisance::{GYRO, JOINTS, SUBJECT, Tolerances};

/// Variance components: four groups of sensors, the wander of the joints by degree, moment and force that push.
pub const COMPONENTS: usize = 9;
/// The wander of the joints.
pub const WANDER: [usize; 3] = [4, 5, 6];
/// Moment and force that push, each tenth of a second for itself.
pub const PUSH: [usize; 2] = [7, 8];
/// Constants of suit and gyroscope, which every flight has for itself.
pub const OWN: usize = 2 * JOINTS + GYRO;
/// All constants.
pub const CONSTANTS: usize = OWN + SUBJECT;

/// A number for each component.
pub type Components = SVector<f64, COMPONENTS>;

/// Priors on errors.
#[derive(Debug, Clone)]
pub struct Prior {
    /// Middle of the logarithm of each component's variance and its deviation; a deviation of zero holds it.
    pub sizes: [(f64, f64); COMPONENTS],
    /// Of the constants.
    pub tolerances: Tolerances,
    /// Numbers of the subject that an effect in the model stands for.
    pub held: Vec<usize>,
}

/// Deviations of the logarithms of variances: sensors that are seen in the recording, velocities (whose slow errors no
/// other sensor shows), wander, and what pushes.
const SEEN: f64 = 0.25;
const SEEN_VELOCITY: f64 = 0.7;
const WANDERS: f64 = 1.5;
const PUSHES: f64 = 2.0;
/// Middle of the sizes of what pushes: N m and N in a tenth of a second.
const PUSHING: [f64; 2] = [0.3, 3.0];
/// Start of the search for these sizes: it converges from above, but not from below.
const PUSHING_FIRST: [f64; 2] = [2.0, 20.0];

impl Prior {
    /// For sensors as noisy as they were recorded.
    pub fn new(noise: &[f64; 4], tolerances: &Tolerances) -> Self {
        let wander = tolerances.wander_deg.to_radians();
        let logarithm = |deviation: f64| 2.0 * deviation.ln();
        let sizes = core::array::from_fn(|k| match k {
            0 | 1 => (logarithm(noise[k]), SEEN),
            2 | 3 => (logarithm(noise[k]), SEEN_VELOCITY),
            4..=6 => (logarithm(wander * SHARES[k - 4]), WANDERS),
            _ => (logarithm(PUSHING[k - 7]), PUSHES),
        });
        Self {
            sizes,
            tolerances: *tolerances,
            held: Vec::new(),
        }
    }

    /// Start of the search for the sizes.
    pub fn start(&self) -> Components {
        Components::from_fn(|k, _| match k {
            7 | 8 if self.sizes[k].1 > 0.0 => PUSHING_FIRST[k - 7].powi(2),
            _ => self.sizes[k].0.exp(),
        })
    }

    /// The same where nothing pushes.
    pub fn without_push(&self) -> Self {
        let mut prior = self.clone();
        for (k, size) in PUSH.into_iter().zip(PUSHING) {
            prior.sizes[k] = (2.0 * (0.05 * size).ln(), 0.0);
        }
        prior
    }

    pub(super) fn penalty(&self, sizes: &Components) -> f64 {
        let each = self
            .sizes
            .iter()
            .zip(sizes)
            .filter(|(prior, _)| prior.1 > 0.0);
        each.map(|((middle, deviation), size)| 0.5 * ((size.ln() - middle) / deviation).powi(2))
            .sum()
    }
}

/// Of the wander: what degrees zero, one and two have of it.
const SHARES: [f64; 3] = [1.0, 0.5, 0.15];

/// Deviations of the constants: calibration and bend are estimated too.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spread {
    /// Calibration of a joint (rad).
    pub calibration: f64,
    /// Error of a joint with its bend (share).
    pub bend: f64,
}

impl Spread {
    pub(super) fn new(tolerances: &Tolerances) -> Self {
        Self {
            calibration: tolerances.joint_deg.to_radians(),
            bend: tolerances.bend,
        }
    }

    /// Of the constants that every flight has for itself.
    pub fn own_precision(&self, tolerances: &Tolerances) -> DVector<f64> {
        DVector::from_fn(OWN, |k, _| {
            let deviation = match k {
                _ if k < JOINTS => self.calibration,
                _ if k < 2 * JOINTS => self.bend,
                _ => tolerances.gyro_scale(),
            };
            deviation.powi(-2)
        })
    }
}

/// Precision of the subject: what an effect in the model stands for is held.
pub fn subject_precision(tolerances: &Tolerances, held: &[usize]) -> DVector<f64> {
    let mut precision = tolerances.of_subject().map(|deviation| deviation.powi(-2));
    for &k in held {
        precision[k] *= 1e8;
    }
    precision
}
