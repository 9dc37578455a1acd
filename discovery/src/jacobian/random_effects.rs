//! Effects that change at random during a stretch: the derivatives with respect to their value in each tenth of a
//! second, and the covariance that they add.

use bodyflight_core::effect::Effect;
use bodyflight_core::effect::random::{INPUT_TIME, Turbulence, decayed};
use nalgebra::{DMatrix, Matrix3, Vector3};

use crate::jacobian::layout::{FIRST_RANDOM, components};
use crate::jacobian::symmetric::Symmetric;
use crate::shooting::stretch::WINDOW;

/// Derivatives of a stretch with respect to an effect.
#[derive(Debug, Clone)]
pub struct Changes {
    /// The effect.
    pub effect: Effect,
    /// Derivatives in each window, about three axes.
    pub columns: DMatrix<f64>,
}

/// Correlation between the windows of a stretch, for a correlation time (s).
fn lasting(rows: usize, time: f64) -> DMatrix<f64> {
    DMatrix::from_fn(rows, rows, |i, j| {
        decayed(WINDOW * (i as f64 - j as f64).abs() / time)
    })
}

/// Covariance from the columns about one of three axes, given the correlation of the windows.
fn about(columns: &DMatrix<f64>, axis: usize, lasting: &DMatrix<f64>) -> Symmetric {
    let own = columns.columns_with_step(axis, lasting.nrows(), 2);
    Symmetric::of(&(own * lasting * own.transpose()))
}

/// Components of a force and a moment in body axes that change at random, in place of the effects.
pub(crate) const LOADS: core::ops::Range<usize> = FIRST_RANDOM..FIRST_RANDOM + 6;

/// The effects that change at random in a stretch.
#[derive(Debug, Clone)]
pub struct RandomEffectColumns {
    /// The derivatives, one entry for each effect.
    pub changes: Vec<Changes>,
    /// Covariance of each component at unit strength.
    pub kernels: Vec<(usize, Symmetric)>,
    /// Velocity through the air (m/s), inertial axes.
    pub through_air: Vector3<f64>,
}

/// Covariance of an effect of unit strength, about three axes, between two instants this far apart in the air (m) and
/// in time (s).
pub(crate) fn covariance(effect: Effect, apart_m: &Vector3<f64>, apart_s: f64) -> Matrix3<f64> {
    if effect == Effect::Turbulence {
        let length = Effect::Turbulence.neutral()[1];
        return Turbulence::from_gusts(1.0, length).covariance(apart_m);
    }
    Matrix3::identity() * decayed(apart_s.abs() / INPUT_TIME)
}

impl RandomEffectColumns {
    /// Correlates the derivatives between the windows. Returns `None` if there are none or one is not finite.
    pub(crate) fn new(changes: Vec<Changes>, through_air: Vector3<f64>) -> Option<Self> {
        let finite = |changes: &Changes| changes.columns.iter().all(|value| value.is_finite());
        if changes.is_empty() || !changes.iter().all(finite) {
            return None;
        }
        let mut varying = Self {
            changes,
            kernels: Vec::new(),
            through_air,
        };
        varying.correlate();
        Some(varying)
    }

    /// A force and a moment along each body axis that change at random with a correlation time (s), unlike any effect
    /// of the library.
    pub fn loads(pushes: &[DMatrix<f64>; 2], time: f64) -> Self {
        let lasting = lasting(pushes[0].ncols() / 3, time);
        let of = |k: usize| (LOADS.start + k, about(&pushes[k / 3], k % 3, &lasting));
        Self {
            changes: Vec::new(),
            kernels: (0..LOADS.len()).map(of).collect(),
            through_air: Vector3::zeros(),
        }
    }

    fn correlate(&mut self) {
        let mut kernels = Vec::new();
        for changes in &self.changes {
            let Changes { effect, columns } = changes;
            let rows = columns.ncols() / 3;
            let mut together = DMatrix::zeros(3 * rows, 3 * rows);
            for (i, j) in (0..rows).flat_map(|i| (0..rows).map(move |j| (i, j))) {
                let apart_s = WINDOW * (i as f64 - j as f64);
                let block = covariance(*effect, &(self.through_air * apart_s), apart_s);
                together.view_mut((3 * i, 3 * j), (3, 3)).copy_from(&block);
            }
            let places = components(*effect);
            if places.len() == 1 {
                let kernel = columns * &together * columns.transpose();
                kernels.push((places.start, Symmetric::of(&kernel)));
                continue;
            }
            let lasting = lasting(rows, INPUT_TIME);
            for (axis, place) in places.enumerate() {
                kernels.push((place, about(columns, axis, &lasting)));
            }
        }
        self.kernels = kernels;
    }

    /// Derivatives with respect to an effect that stays constant throughout the stretch, about three axes.
    pub fn fixed(&self, effect: Effect) -> Option<DMatrix<f64>> {
        let changes = self
            .changes
            .iter()
            .find(|changes| changes.effect == effect)?;
        let mut fixed = DMatrix::zeros(changes.columns.nrows(), 3);
        for k in 0..changes.columns.ncols() {
            let mut column = fixed.column_mut(k % 3);
            column += changes.columns.column(k);
        }
        Some(fixed)
    }
}
