//! The unscented algebra in isolation: compared with a Kalman filter, tested for consistency and for robustness against
//! any input.

use bodyflight_core::estimator::unscented::{Moments, Root, Settings, SettingsError, Unscented};
use bodyflight_core::{Lanes, Real};
use bodyflight_tests::estimator_flights::Noise;
use nalgebra::{SMatrix, SVector};

type State<T> = SVector<T, 6>;
type Seen<T> = SVector<T, 4>;

/// The paper's tuning for tracking, with bounds too wide to have an effect.
fn settings<T: Real>(root: Root) -> Settings<T, 6> {
    let vector = |values: [f64; 6]| State::from(values.map(T::of));
    Settings {
        state: vector([0.5, 0.5, 0.5, 6.0, 6.0, 6.0]),
        variance: vector([0.0625, 0.0625, 0.0625, 36.0, 36.0, 36.0]),
        process_noise: vector([0.001, 0.001, 0.001, 0.004, 0.004, 0.004]),
        low: vector([-1e6; 6]),
        high: vector([1e6; 6]),
        central_weight: T::of(0.5),
        reflection: T::of(0.5),
        root,
    }
}

/// Predicts every sigma point with `h`; returns the moments.
fn moments<T: Real>(
    filter: &Unscented<T, 6>,
    h: impl Fn(&State<T>) -> Seen<T>,
) -> Moments<T, 6, 4> {
    let points = filter.sigma_points();
    let central = h(&points.centre);
    let plus = points.plus.map(|x| h(&x) - central);
    let minus = points.minus.map(|x| h(&x) - central);
    filter.moments(&points, &central, &plus, &minus)
}

/// A random slope that observes mixtures of all states but the last.
fn slope(noise: &mut Noise) -> SMatrix<f64, 4, 6> {
    SMatrix::from_fn(|_, j| if j == 5 { 0.0 } else { noise.normal(1.0) })
}

#[test]
fn on_a_linear_model_it_is_a_kalman_filter() {
    // Three hundred updates, each with a new slope, so that a wrong factor cannot go unnoticed.
    for root in [Root::Symmetric, Root::Cholesky] {
        let mut noise = Noise::new(7);
        let mut worst = 0.0f64;
        let mut filter = Unscented::<f64, 6>::new(settings(root)).unwrap();
        let (mut x, mut p) = (*filter.state(), *filter.covariance());
        // The noise is large enough for the plain form of the reference to keep its digits.
        let r = Seen::<f64>::from([0.5, 0.3, 0.2, 0.4]);
        for _ in 0..300 {
            let h = slope(&mut noise);
            let z = Seen::from_fn(|_, _| noise.normal(2.0));
            // A Kalman filter in the paper's order: process noise is added at the update.
            let s = h * p * h.transpose() + SMatrix::from_diagonal(&r);
            let gain = p * h.transpose() * s.try_inverse().unwrap();
            let innovation = z - h * x;
            let square = (innovation.transpose() * s.try_inverse().unwrap() * innovation)[0];
            x += gain * innovation;
            p = p - gain * s * gain.transpose()
                + SMatrix::from_diagonal(&filter.settings().process_noise);
            // The filter under test, with sigma points and with the slope.
            let by_points = moments(&filter, |x| h * x);
            let points = filter.sigma_points();
            let by_slope = filter.linear_moments(&points, &(h * points.centre), &h);
            let difference = by_points.prediction_covariance - by_slope.prediction_covariance;
            assert!(difference.norm() < 1e-9 * by_points.prediction_covariance.norm());
            let difference = by_points.cross_covariance - by_slope.cross_covariance;
            assert!(difference.norm() < 1e-9 * by_points.cross_covariance.norm());
            let innovation = z - by_points.prediction;
            let found = filter.update(&by_points, &innovation, &r, &[true; 4]);
            assert!(found.fused && !found.repaired);
            assert!((found.normalised_square - square).abs() < 1e-9 * (1.0 + square));
            let scale = p.norm();
            assert!((filter.covariance() - p).norm() < 1e-9 * scale);
            let error = (filter.state() - x).norm() / (1.0 + x.norm());
            worst = worst.max(error);
            assert!(error < 1e-10, "{error:e}");
        }
        println!("{root:?}: state within {worst:.1e} of the Kalman filter's");
    }
}

#[test]
fn channels_left_out_have_no_effect() {
    let mut noise = Noise::new(3);
    let h = slope(&mut noise);
    let start = Unscented::<f64, 6>::new(settings(Root::Symmetric)).unwrap();
    let r = Seen::<f64>::from([0.01, 0.0025, 1e-4, 1e-4]);
    let z = Seen::from([1.0, f64::NAN, 2.0, f64::INFINITY]);
    // An update with two channels out of four, compared with a measurement that has only these two.
    let mut partial = start;
    let all = moments(&partial, |x| h * x);
    let innovation = z - all.prediction;
    let found = partial.update(&all, &innovation, &r, &[true, false, true, false]);
    let two = Moments {
        state: all.state,
        covariance: all.covariance,
        prediction: SVector::from([all.prediction[0], all.prediction[2]]),
        prediction_covariance: SMatrix::<f64, 2, 2>::new(
            all.prediction_covariance[(0, 0)],
            all.prediction_covariance[(0, 2)],
            all.prediction_covariance[(2, 0)],
            all.prediction_covariance[(2, 2)],
        ),
        cross_covariance: SMatrix::from_columns(&[
            all.cross_covariance.column(0),
            all.cross_covariance.column(2),
        ]),
    };
    let mut alone = start;
    let small = SVector::from([innovation[0], innovation[2]]);
    let expected = alone.update(&two, &small, &SVector::from([r[0], r[2]]), &[true; 2]);
    assert!(found.fused && expected.fused);
    assert!((partial.state() - alone.state()).norm() < 1e-12);
    assert!((partial.covariance() - alone.covariance()).norm() < 1e-12);
    assert!((found.normalised_square - expected.normalised_square).abs() < 1e-12);
    // Without any channel, nothing changes.
    let before = partial;
    let found = partial.update(&all, &innovation, &r, &[false; 4]);
    assert!(!found.fused && partial == before);
}

/// A slightly nonlinear model, for which the unscented transform is exact to second order.
fn bent<T: Real>(h: &SMatrix<T, 4, 6>, x: &State<T>) -> Seen<T> {
    let straight = h * x;
    straight + straight.component_mul(&straight) * T::of(1e-3)
}

#[test]
fn two_hundred_runs_on_a_matched_model_are_consistent() {
    // The truth starts within the filter's initial covariance and moves by its process noise; measurements have noise
    // R.
    const RUNS: u32 = 200;
    const UPDATES: u32 = 50;
    let r = Seen::<f64>::from([0.01, 0.0025, 1e-4, 1e-4]);
    let (mut nees, mut nis) = (0.0, 0.0);
    for run in 0..RUNS {
        let mut noise = Noise::new(u64::from(run) + 1);
        let mut filter = Unscented::<f64, 6>::new(settings(Root::Symmetric)).unwrap();
        let start = *filter.settings();
        let mut truth = start.state + start.variance.map(|v| noise.normal(v.sqrt()));
        for _ in 0..UPDATES {
            let h = slope(&mut noise) * 0.1;
            let z = bent(&h, &truth) + r.map(|v| noise.normal(v.sqrt()));
            let moments = moments(&filter, |x| bent(&h, x));
            let innovation = z - moments.prediction;
            nis += filter
                .update(&moments, &innovation, &r, &[true; 4])
                .normalised_square;
            truth += start.process_noise.map(|q| noise.normal(q.sqrt()));
        }
        let error = truth - filter.state();
        let inverse = filter.covariance().try_inverse().unwrap();
        nees += (error.transpose() * inverse * error)[0];
    }
    // 95 % bands of chi-square means: n +- 1.96 sqrt(2 n / N).
    let anees = nees / f64::from(RUNS);
    let anis = nis / f64::from(RUNS * UPDATES);
    let band = |n: f64, samples: u32| 1.96 * (2.0 * n / f64::from(samples)).sqrt();
    println!(
        "ANEES {anees:.3} of 6 +- {:.3}, ANIS {anis:.4} of 4 +- {:.4}",
        band(6.0, RUNS),
        band(4.0, RUNS * UPDATES)
    );
    assert!((anees - 6.0).abs() < band(6.0, RUNS), "ANEES {anees}");
    assert!(
        (anis - 4.0).abs() < band(4.0, RUNS * UPDATES),
        "ANIS {anis}"
    );
}

#[test]
fn no_configuration_and_no_input_leaves_a_broken_filter() {
    // Random scales over many decades, outliers of up to 1e6, and NaN, in single precision.
    let runs = std::env::var("BODYFLIGHT_FUZZ").map_or(2_000, |n| n.parse().unwrap());
    let (mut refused, mut rejected, mut stuck) = (0, 0, 0);
    for run in 0..runs {
        let mut noise = Noise::new(run + 11);
        let mut decade = |low: f64, high: f64| 10f64.powf(low + (high - low) * noise.uniform());
        let mut tuning = settings::<f32>(if run % 2 == 0 {
            Root::Symmetric
        } else {
            Root::Cholesky
        });
        for k in 0..6 {
            tuning.variance[k] *= f32::of(decade(-4.0, 4.0));
            tuning.process_noise[k] *= f32::of(decade(-6.0, 3.0));
        }
        tuning.low = State::from([0.0, 0.0, 0.0, 0.01, 0.01, 0.01]);
        tuning.high = State::from([6.5, 6.5, 6.5, 24.0, 24.0, 24.0]);
        let r = Seen::from_fn(|_, _| f32::of(1e-2 * decade(-5.0, 5.0)));
        let Ok(mut filter) = Unscented::new(tuning) else {
            refused += 1;
            continue;
        };
        let h = slope(&mut noise).map(f32::of);
        let truth = State::from([1.0f32, 0.5, 2.0, 3.0, 8.0, 1.0]);
        let poisoned = noise.uniform() < 0.2;
        let mut last_good = true;
        for update in 0..200 {
            let mut z = bent(&h, &truth) + r.map(|v| f32::of(noise.normal(f64::from(v).sqrt())));
            let pick = noise.uniform();
            if pick < 0.015 {
                z[update % 4] = f32::of(noise.normal(1e6));
            }
            let bad = poisoned && pick > 0.95;
            if bad {
                z[update % 4] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY][update % 3];
            }
            let before = filter;
            let moments = moments(&filter, |x| bent(&h, x));
            let found = filter.update(&moments, &(z - moments.prediction), &r, &[true; 4]);
            if !found.fused {
                assert!(
                    filter == before,
                    "run {run}: a refused update changed the state"
                );
                rejected += 1;
            }
            assert!(!(bad && found.fused), "run {run}: took in {z:?}");
            last_good = found.fused || bad;
            assert!(filter.state().iter().all(|v| v.is_finite()), "run {run}");
            assert!(
                filter.covariance().iter().all(|v| v.is_finite()),
                "run {run}"
            );
            assert!(
                filter.covariance().diagonal().iter().all(|v| *v > 0.0),
                "run {run}"
            );
        }
        if !last_good {
            stuck += 1;
        }
    }
    println!(
        "{runs} runs: {refused} refused when built, {rejected} updates rejected, {stuck} stuck"
    );
    assert_eq!(stuck, 0);
}

#[test]
fn the_bounds_hold_and_points_do_not_collapse() {
    // A state on its bounds: points beyond a bound are reflected to the other side, at half the distance.
    let mut tuning = settings::<f64>(Root::Symmetric);
    tuning.low = State::from([0.5, 0.0, 0.0, 0.01, 0.01, 0.01]);
    tuning.high = State::from([6.5, 0.5, 6.5, 24.0, 24.0, 24.0]);
    let filter = Unscented::new(tuning).unwrap();
    let points = filter.sigma_points();
    let spread = filter.spread();
    assert!((spread - 12f64.sqrt()).abs() < 1e-12);
    // The first state is on its lower bound, the second on its upper one.
    assert!((points.plus[0][0] - (0.5 + 0.25 * spread)).abs() < 1e-12);
    assert!((points.minus[0][0] - (0.5 + 0.125 * spread)).abs() < 1e-12);
    assert!((points.plus[1][1] - (0.5 - 0.125 * spread).max(0.0)).abs() < 1e-12);
    // The third is within its bounds; its point is clipped at the lower one.
    assert!((points.minus[2][2] - 0.0).abs() < 1e-12);
    let differences = SMatrix::<f64, 6, 12>::from_fn(|i, j| {
        let point = if j < 6 {
            points.plus[j]
        } else {
            points.minus[j - 6]
        };
        point[i] - points.centre[i]
    });
    assert_eq!(differences.rank(1e-9), 6);
}

#[test]
fn unsafe_settings_are_refused_by_name() {
    let good = settings::<f32>(Root::Symmetric);
    type Change = fn(&mut Settings<f32, 6>);
    let cases: [(Change, SettingsError); 10] = [
        (|s| s.central_weight = -1e6, SettingsError::CentralWeight),
        (
            |s| s.central_weight = f32::NAN,
            SettingsError::CentralWeight,
        ),
        (|s| s.variance[2] = 0.0, SettingsError::Variance),
        (|s| s.variance[2] = f32::INFINITY, SettingsError::Variance),
        (|s| s.variance[0] = 1e-12, SettingsError::VarianceSpread),
        (|s| s.process_noise[1] = -1.0, SettingsError::ProcessNoise),
        (
            |s| s.process_noise[1] = f32::NAN,
            SettingsError::ProcessNoise,
        ),
        (|s| s.low[4] = 2e6, SettingsError::Bounds),
        (|s| s.state[5] = 2e6, SettingsError::State),
        (|s| s.reflection = 1.5, SettingsError::Reflection),
    ];
    assert!(Unscented::new(good).is_ok());
    for (change, reason) in cases {
        let mut bad = good;
        change(&mut bad);
        assert_eq!(Unscented::new(bad).unwrap_err(), reason);
        assert!(!reason.to_string().is_empty());
    }
}
