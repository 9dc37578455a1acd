//! Effects that change at random during a stretch: the derivatives with respect to their value in each tenth of a
//! second, and the covariance that they add.

use bodyflight_core::effect::random::{INPUT_TIME, Turbulence, decayed};
use bodyflight_core::effect::{Effect, Model};
use nalgebra::{DMatrix, Matrix3, Vector3};

use super::effect_set::EffectSet;
use super::error_prior::FIRST_RANDOM;
use super::linearization::Belief;
use super::prepared::{Prepared, Steps};
use super::stretch::{Channels, NUMBERS, ROWS, Stretch};
use super::track::Track;
use super::window::{Varied, components};

/// Time between neighbouring windows (s).
const WINDOW_S: f64 = 0.1;

/// The effects of a set that change at random.
pub fn random(effects: &EffectSet) -> EffectSet {
    let random = effects.iter().filter(|(effect, _)| effect.is_random());
    random.copied().collect()
}

/// Derivatives of a stretch with respect to an effect.
#[derive(Debug, Clone)]
pub struct Changes {
    /// The effect.
    pub effect: Effect,
    /// Derivatives in each window, about three axes.
    pub columns: DMatrix<f64>,
}

/// Correlation between the windows of a stretch, for a correlation time (s).
fn lasting(time: f64) -> DMatrix<f64> {
    DMatrix::from_fn(ROWS, ROWS, |i, j| {
        decayed(WINDOW_S * (i as f64 - j as f64).abs() / time)
    })
}

/// Covariance from the columns about one of three axes, given the correlation of the windows.
fn about(columns: &DMatrix<f64>, axis: usize, lasting: &DMatrix<f64>) -> DMatrix<f64> {
    let own = columns.columns_with_step(axis, ROWS, 2);
    own * lasting * own.transpose()
}

/// Components of a force and a moment in body axes that change at random, in place of the effects.
pub const LOADS: core::ops::Range<usize> = FIRST_RANDOM..FIRST_RANDOM + 6;

/// The effects that change at random in a stretch.
#[derive(Debug, Clone)]
pub struct Varying {
    /// The derivatives, one entry for each effect.
    pub changes: Vec<Changes>,
    /// Covariance of each component at unit strength.
    pub kernels: Vec<(usize, DMatrix<f64>)>,
    /// Velocity through the air (m/s), inertial axes.
    pub through_air: Vector3<f64>,
}

/// Covariance of an effect of unit strength, about three axes, between two instants this far apart in the air (m) and
/// in time (s).
pub fn covariance(effect: Effect, apart_m: &Vector3<f64>, apart_s: f64) -> Matrix3<f64> {
    if effect == Effect::Turbulence {
        let length = Effect::Turbulence.neutral()[1];
        return Turbulence::from_gusts(1.0, length).covariance(apart_m);
    }
    Matrix3::identity() * decayed(apart_s.abs() / INPUT_TIME)
}

impl Varying {
    /// Computes the derivatives around a belief; returns `None` if there are no such effects or a derivative is not
    /// finite.
    pub fn new(
        track: &Track,
        stretch: &Stretch,
        plain: &Model<f64>,
        belief: &Belief,
        effects: &EffectSet,
    ) -> Option<Self> {
        if effects.is_empty() {
            return None;
        }
        let model = belief.model(plain);
        let joints = belief.joints_in(stretch);
        let base = Prepared::new(track, stretch, &model, &joints, Steps::Long);
        let still = Channels::zeros();
        let flown = base.fly(&still, None);
        let start = &stretch.start;
        let air = model.dynamics.air.velocity_at(&start.position);
        let through_air = (start.velocity_inertial() - air).components;
        let of = |(effect, _): &(Effect, [f64; 3])| {
            let mut columns = DMatrix::zeros(NUMBERS, 3 * ROWS);
            for k in 0..3 * ROWS {
                let (varied, size) = Varied::new(*effect, k / 3, k % 3);
                let other = base.with_varied(varied).fly(&still, None);
                columns.set_column(k, &(other.less(&flown, track, stretch) / size));
            }
            Changes {
                effect: *effect,
                columns,
            }
        };
        let mut varying = Self {
            changes: effects.iter().map(of).collect(),
            kernels: Vec::new(),
            through_air,
        };
        varying.correlate();
        let finite = |changes: &Changes| changes.columns.iter().all(|value| value.is_finite());
        varying.changes.iter().all(finite).then_some(varying)
    }

    /// A force and a moment along each body axis that change at random with a correlation time (s), unlike any effect
    /// of the library.
    pub fn loads(pushes: &[DMatrix<f64>; 2], time: f64) -> Self {
        let lasting = lasting(time);
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
            let mut together = DMatrix::zeros(3 * ROWS, 3 * ROWS);
            for (i, j) in (0..ROWS).flat_map(|i| (0..ROWS).map(move |j| (i, j))) {
                let apart_s = WINDOW_S * (i as f64 - j as f64);
                let block = covariance(*effect, &(self.through_air * apart_s), apart_s);
                together.view_mut((3 * i, 3 * j), (3, 3)).copy_from(&block);
            }
            let places = components(*effect);
            if places.len() == 1 {
                let kernel = columns * &together * columns.transpose();
                kernels.push((places.start, kernel));
                continue;
            }
            let lasting = lasting(INPUT_TIME);
            for (axis, place) in places.enumerate() {
                kernels.push((place, about(columns, axis, &lasting)));
            }
        }
        self.kernels = kernels;
    }

    /// Derivatives with respect to an effect that stays constant throughout the stretch, about three axes.
    pub fn held(&self, effect: Effect) -> Option<DMatrix<f64>> {
        let changes = self
            .changes
            .iter()
            .find(|changes| changes.effect == effect)?;
        let mut held = DMatrix::zeros(NUMBERS, 3);
        for k in 0..3 * ROWS {
            let mut column = held.column_mut(k % 3);
            column += changes.columns.column(k);
        }
        Some(held)
    }
}
