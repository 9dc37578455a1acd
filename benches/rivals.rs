//! One estimation problem for this crate's filter and for others: six constant states, four channels that measure
//! polynomials of them, the paper's weights (W_0 = 0.5; as scaled weights alpha 1, beta 0, kappa 6).

use core::ops::{Add, Mul};

use bodyflight_core::estimator::unscented::{Root, Settings, Unscented};
use kfilter::ukf::{UKFParameters, UnscentedKalman};
use kfilter::{KalmanFilter as _, KalmanPredict as _, KalmanUpdate as _};
use minikalman::prelude::*;
use multicalc::{Numeric, UnscentedKalmanFilter, VectorFn};
use nalgebra::SVector;

/// Initial variance.
pub const VARIANCE: [f32; 6] = [0.0625, 0.0625, 0.0625, 36.0, 36.0, 36.0];
/// Initial state.
pub const START: [f32; 6] = [0.5, 0.5, 0.5, 6.0, 6.0, 6.0];
/// Process noise of an update.
pub const PROCESS_NOISE: [f32; 6] = [0.001, 0.001, 0.001, 0.004, 0.004, 0.004];
/// Measurement noise.
pub const NOISE: [f32; 4] = [0.01, 0.0025, 0.0001, 0.0001];
/// True state.
pub const TRUTH: [f32; 6] = [1.0, 0.6, 0.8, 4.0, 8.0, 5.0];

/// The measurement model: polynomials of the six states; `share` is the weight of the damping.
#[inline]
pub fn seen<S: Copy + Add<Output = S> + Mul<Output = S>>(x: &[S; 6], share: S) -> [S; 4] {
    [
        x[0] + x[3] * share + x[1] * x[4] * share,
        x[1] + x[4] * share + x[2] * share,
        x[2] + x[5] * share + x[0] * x[3] * share,
        x[0] * x[1] + x[5] * share,
    ]
}

/// Weight of the damping in the measurements.
const SHARE: f32 = 0.05;

/// Measurement number `k`: the truth with a fixed pattern of noise.
pub fn measurement(k: usize) -> [f32; 4] {
    let mut z = seen(&TRUTH, SHARE);
    for (channel, value) in z.iter_mut().enumerate() {
        let hash = (k * 4 + channel).wrapping_mul(0x9e37_79b9) >> 8 & 0xffff;
        let uniform = f32::from(u16::try_from(hash).unwrap_or(0)) / 65_536.0 - 0.5;
        *value += uniform * 3.46 * NOISE[channel].sqrt();
    }
    z
}

/// A filter of the problem.
pub trait Filter {
    /// Predicts and updates with a measurement; returns whether that succeeded.
    fn update(&mut self, measurement: &[f32; 4]) -> bool;
    /// The estimated state.
    fn state(&self) -> [f32; 6];
}

/// This crate's filter, with bounds that never apply.
pub struct Own {
    filter: Unscented<f32, 6>,
}

impl Own {
    /// Creates the filter at the initial state, with either matrix root.
    pub fn new(root: Root) -> Option<Self> {
        let settings = Settings {
            state: START.into(),
            variance: VARIANCE.into(),
            process_noise: PROCESS_NOISE.into(),
            low: [-1e6; 6].into(),
            high: [1e6; 6].into(),
            central_weight: 0.5,
            reflection: 0.5,
            root,
        };
        Some(Self {
            filter: Unscented::new(settings).ok()?,
        })
    }
}

impl Filter for Own {
    fn update(&mut self, measurement: &[f32; 4]) -> bool {
        let points = self.filter.sigma_points();
        let h = |x: &SVector<f32, 6>| SVector::from(seen(&x.data.0[0], SHARE));
        let central = h(&points.centre);
        let plus = points.plus.map(|x| h(&x) - central);
        let minus = points.minus.map(|x| h(&x) - central);
        let moments = self.filter.moments(&points, &central, &plus, &minus);
        let innovation = SVector::from(*measurement) - moments.prediction;
        self.filter
            .update(&moments, &innovation, &NOISE.into(), &[true; 4])
            .fused
    }
    fn state(&self) -> [f32; 6] {
        self.filter.state().data.0[0]
    }
}

/// `multicalc`.
pub struct Multicalc(UnscentedKalmanFilter<6, 4, f32>);

struct Stay;
struct See;

impl VectorFn<6, 6> for Stay {
    fn eval<S: Numeric>(&self, point: &[S; 6]) -> [S; 6] {
        *point
    }
}

impl VectorFn<6, 4> for See {
    fn eval<S: Numeric>(&self, point: &[S; 6]) -> [S; 4] {
        seen(point, S::from_f64(f64::from(SHARE)))
    }
}

impl Multicalc {
    /// Creates the filter at the initial state.
    pub fn new() -> Option<Self> {
        let diagonal =
            |v: [f32; 6]| multicalc::Matrix::from_fn(|i, j| if i == j { v[i] } else { 0.0 });
        let noise = multicalc::Matrix::from_fn(|i, j| if i == j { NOISE[i] } else { 0.0 });
        let start = multicalc::Vector::new(START);
        UnscentedKalmanFilter::new(start, diagonal(VARIANCE), diagonal(PROCESS_NOISE), noise)
            .with_scaling(1.0, 0.0, 6.0)
            .ok()
            .map(Self)
    }
}

impl Filter for Multicalc {
    fn update(&mut self, measurement: &[f32; 4]) -> bool {
        self.0.predict(&Stay).is_ok()
            && self
                .0
                .update(&See, multicalc::Vector::new(*measurement))
                .is_ok()
    }
    fn state(&self) -> [f32; 6] {
        *self.0.state().as_array()
    }
}

/// `kfilter`.
pub struct Kfilter(UnscentedKalman<f32, 6, 0, 13, kfilter::system::LinearNoInputSystem<f32, 6>>);

struct KfilterSee {
    value: nalgebra_034::SVector<f32, 4>,
    noise: nalgebra_034::SMatrix<f32, 4, 4>,
}

impl kfilter::measurement::Measurement<f32, 6, 4> for KfilterSee {
    fn predict(&self, x: &nalgebra_034::SVector<f32, 6>) -> nalgebra_034::SVector<f32, 4> {
        seen(&x.data.0[0], SHARE).into()
    }
    fn measurement(&self) -> &nalgebra_034::SVector<f32, 4> {
        &self.value
    }
    fn covariance(&self) -> &nalgebra_034::SMatrix<f32, 4, 4> {
        &self.noise
    }
    fn set_measurement(&mut self, z: nalgebra_034::SVector<f32, 4>) {
        self.value = z;
    }
}

impl Kfilter {
    /// Creates the filter at the initial state.
    pub fn new() -> Option<Self> {
        use nalgebra_034::SMatrix;
        let diagonal = |v: [f32; 6]| SMatrix::<f32, 6, 6>::from_diagonal(&v.into());
        let system = kfilter::system::LinearNoInputSystem::new(
            SMatrix::identity(),
            diagonal(PROCESS_NOISE),
            START.into(),
        );
        let parameters = UKFParameters::new(1.0, 0.0, 6.0).ok()?;
        Some(Self(UnscentedKalman::new_custom_with_params(
            system,
            diagonal(VARIANCE),
            parameters,
        )))
    }
}

impl Filter for Kfilter {
    fn update(&mut self, measurement: &[f32; 4]) -> bool {
        let seen = KfilterSee {
            value: (*measurement).into(),
            noise: nalgebra_034::SMatrix::from_diagonal(&NOISE.into()),
        };
        self.0.predict().is_ok() && self.0.update(&seen).is_ok()
    }
    fn state(&self) -> [f32; 6] {
        self.0.state().data.0[0]
    }
}

/// `minikalman`, as a closure that updates and returns the state, because its types are impractical to name.
pub fn minikalman() -> impl FnMut(&[f32; 4]) -> [f32; 6] {
    const POINTS: usize = 13;
    let builder = minikalman::unscented::builder::KalmanFilterBuilder::<6, f32>::default();
    let mut filter = builder.build::<POINTS>();
    let mut observation = builder.observations().build::<4, POINTS>();
    filter.set_alpha(1.0);
    filter.set_beta(0.0);
    filter.set_kappa(6.0);
    filter.state_vector_mut().apply(|x| {
        for (k, value) in START.into_iter().enumerate() {
            x.set_row(k, value);
        }
    });
    filter.estimate_covariance_mut().apply(|p| {
        for (k, value) in VARIANCE.into_iter().enumerate() {
            p.set_at(k, k, value);
        }
    });
    filter.direct_process_noise_mut().apply(|q| {
        for (k, value) in PROCESS_NOISE.into_iter().enumerate() {
            q.set_at(k, k, value);
        }
    });
    observation.measurement_noise_covariance_mut().apply(|r| {
        for (k, value) in NOISE.into_iter().enumerate() {
            r.set_at(k, k, value);
        }
    });
    move |measurement| {
        filter.predict_nonlinear(|_| ());
        observation.measurement_vector_mut().apply(|z| {
            for (k, value) in measurement.iter().enumerate() {
                z.set_row(k, *value);
            }
        });
        filter.correct_sigma_point(&mut observation, |points, observed| {
            for j in 0..POINTS {
                let x = core::array::from_fn(|k| points[k * POINTS + j]);
                for (channel, value) in seen(&x, SHARE).into_iter().enumerate() {
                    observed[channel * POINTS + j] = value;
                }
            }
        });
        core::array::from_fn(|k| filter.state_vector().as_matrix().get_at(k, 0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Error in terms of the measurements, since the states are only weakly distinguishable.
    fn misfit(state: &[f32; 6]) -> f32 {
        let pairs = seen(state, SHARE).into_iter().zip(seen(&TRUTH, SHARE));
        pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
    }

    #[test]
    fn all_filters_solve_the_problem() {
        let mut own = Own::new(Root::Symmetric).unwrap();
        let mut lower = Own::new(Root::Cholesky).unwrap();
        let mut multicalc = Multicalc::new().unwrap();
        let mut kfilter = Kfilter::new().unwrap();
        let mut mini = minikalman();
        let mut state = [0.0; 6];
        for k in 0..2000 {
            let z = measurement(k);
            assert!(
                own.update(&z) && lower.update(&z) && multicalc.update(&z) && kfilter.update(&z)
            );
            state = mini(&z);
        }
        let misfits = [
            own.state(),
            lower.state(),
            multicalc.state(),
            kfilter.state(),
            state,
        ]
        .map(|state| misfit(&state));
        println!("own, own Cholesky, multicalc, kfilter, minikalman: {misfits:?}");
        assert!(misfits.iter().all(|m| *m < 0.1), "{misfits:?}");
    }
}
