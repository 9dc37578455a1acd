//! The estimator sample by sample: timing, restart, and the effect of bad input.

use bodyflight_core::Lanes;
use bodyflight_core::body::Body;
use bodyflight_core::body::posture::Posture;
use bodyflight_core::dynamics::Dynamics;
use bodyflight_core::dynamics::muscle_input::BACK_TRACKING;
use bodyflight_core::estimator::full::Full;
use bodyflight_core::estimator::measurement::Measurement;
use bodyflight_core::estimator::preset::{PRESETS, Preset};
use bodyflight_core::estimator::propagation::Propagation;
use bodyflight_core::estimator::reduced::Reduced;
use bodyflight_core::estimator::status::{Faults, Health};
use bodyflight_core::estimator::unscented::SettingsError;
use bodyflight_core::estimator::{Estimator, PaperFilter, ReducedFilter};
use bodyflight_tests::estimator_flights::{FLIPS_AND_ROLLS, Flight, Noise, Record, TURNS};
use bodyflight_tests::{reference, reference_body};

/// Number of runs of the last test.
const RUNS: u64 = 12;

fn body() -> Option<Body<f64>> {
    reference("segments.json").map(|table| reference_body(&table))
}

fn preset(name: &str) -> Preset {
    *Preset::from_name(name).unwrap()
}

#[test]
fn estimates_come_on_time_and_name_their_samples() {
    let Some(body) = body() else { return };
    let record = TURNS.fly(&body, BACK_TRACKING);
    come_on_time(&record, &preset("tracking"), 60);
    come_on_time(&record, &preset("tracking-agile"), 20);
}

fn come_on_time(record: &Record, preset: &Preset, window: usize) {
    let dynamics: Dynamics<f32> = record.dynamics.cast();
    let start = record.motions[0].cast();
    let mut estimator =
        ReducedFilter::<f32>::new(preset, &dynamics, &start, &record.postures[0].cast()).unwrap();
    assert!((estimator.delay() - window as f32 / 240.0).abs() < 1e-6);
    assert_eq!(estimator.prediction_window(), window);
    let measured = record.measured(1);
    let mut arrivals = Vec::new();
    for (k, (posture, measured)) in record
        .postures
        .iter()
        .zip(&measured)
        .enumerate()
        .skip(1)
        .take(100)
    {
        if let Some(estimate) = estimator.push(&posture.cast(), &measured.cast()) {
            assert_eq!(estimate.sample as usize + window, k);
            assert_eq!(estimate.solved_sample, estimate.sample + 4);
            assert!(estimate.faults.none(), "{:?}", estimate.faults);
            arrivals.push(k);
        }
    }
    assert_eq!(arrivals[..4], [0, 4, 8, 12].map(|k| window + k));
    // After a restart the window fills again; coefficients are kept.
    let kept = *estimator.filter().state();
    let (motion, posture) = (record.motions[100].cast(), record.postures[100].cast());
    estimator.restart(&motion, &posture).unwrap();
    assert_eq!(*estimator.filter().state(), kept);
    let mut broken = motion;
    broken.velocity.components.x = f32::NAN;
    assert_eq!(
        estimator.restart(&broken, &posture),
        Err(SettingsError::Start)
    );
}

#[test]
fn bad_input_raises_a_flag_and_changes_nothing() {
    let Some(body) = body() else { return };
    let record = TURNS.fly(&body, BACK_TRACKING);
    let preset = preset("turning");
    let dynamics: Dynamics<f32> = record.dynamics.cast();
    let measured: Vec<Measurement<f32>> =
        record.measured(1).iter().map(Measurement::cast).collect();
    let start = record.motions[0].cast();
    let mut estimator =
        ReducedFilter::<f32>::new(&preset, &dynamics, &start, &record.postures[0].cast()).unwrap();
    let mut seen = Faults::default();
    let mut last = None;
    for (k, measured) in measured.iter().enumerate().skip(1).take(2400) {
        let mut posture: Posture<f32> = record.postures[k].cast();
        let mut measured = *measured;
        let dead = (600..720).contains(&k);
        if dead {
            // Every channel of the measurement is garbage for half a second.
            (measured.yaw_rate, measured.pitch, measured.roll) =
                (f32::NAN, 1e30, f32::NEG_INFINITY);
        }
        if (900..910).contains(&k) {
            let broken = nalgebra::Quaternion::new(f32::NAN, 0.0, 0.0, 0.0);
            posture.set(
                bodyflight_core::Segment::Thorax,
                nalgebra::UnitQuaternion::new_unchecked(broken),
            );
        }
        let before = *estimator.filter();
        if let Some(estimate) = estimator.push(&posture, &measured) {
            if dead {
                assert_eq!(*estimator.filter(), before, "sample {k} changed the filter");
                assert_eq!(estimate.health, Health::Failing);
            }
            seen.posture |= estimate.faults.posture;
            seen.measurement |= estimate.faults.measurement;
            assert!(
                estimate
                    .state
                    .iter()
                    .chain(&estimate.deviation)
                    .all(|v| v.is_finite())
            );
            assert!(estimate.reconstructed.pitch.is_finite());
            last = Some(estimate);
        }
    }
    assert!(seen.posture && seen.measurement && !seen.update);
    let last = last.unwrap();
    assert!(last.channels.iter().take(3).all(|c| c.fused), "{last:?}");
    assert!(last.health == Health::Good, "{last:?}");
}

#[test]
fn absurd_postures_and_measurements_have_no_lasting_effect() {
    let Some(body) = body() else { return };
    // A tumbling body, outliers within and beyond the limits, and random faults, in single precision with both filters.
    fn abuse<P: Propagation<f32>, const N: usize>(record: &Record, seed: u64) {
        let preset = *Preset::from_name("transitions-negative-damping").unwrap();
        let dynamics: Dynamics<f32> = record.dynamics.cast();
        let mut noise = Noise::new(seed);
        let mut start = record.motions[0].cast::<f32>();
        start.angular_velocity.components.x = f32::of(noise.normal(8.0));
        let posture = record.postures[0].cast();
        let mut estimator =
            Box::new(Estimator::<f32, P, N>::new(&preset, &dynamics, &start, &posture).unwrap());
        let mut fused = false;
        for (k, measured) in record.measured(seed).iter().enumerate().skip(1) {
            let mut measured: Measurement<f32> = measured.cast();
            match noise.uniform() {
                x if x < 0.02 => measured.pitch = f32::of(noise.normal(30.0)),
                x if x < 0.04 => measured.roll = f32::from_bits(0x7fc0_0001),
                x if x < 0.06 => measured.heading = f32::of(noise.normal(1e30)),
                _ => (),
            }
            if let Some(estimate) = estimator.push(&record.postures[k].cast(), &measured) {
                let finite = estimate
                    .state
                    .iter()
                    .chain(&estimate.deviation)
                    .all(|v| v.is_finite());
                assert!(
                    finite && estimate.deviation.min() > 0.0,
                    "seed {seed}, sample {k}"
                );
                assert!(estimate.motion.velocity.norm() < 101.0);
                assert!(estimate.motion.angular_velocity.norm() < 36.0);
                fused = estimate.channels.iter().any(|c| c.fused);
            }
        }
        assert!(fused, "seed {seed}: stuck");
    }
    let short = Flight {
        duration: 8.0,
        ..FLIPS_AND_ROLLS
    };
    let record = short.fly(&body, BACK_TRACKING);
    for seed in 1..=RUNS {
        abuse::<Reduced, 30>(&record, seed);
    }
    abuse::<Full, 60>(&record, 1);
}

#[test]
fn every_preset_builds_and_odd_windows_are_refused() {
    let Some(body) = body() else { return };
    let dynamics = Dynamics::<f32>::paper(body.cast(), 1.0);
    let record = Flight {
        duration: 0.1,
        ..TURNS
    }
    .fly(&body, BACK_TRACKING);
    let (motion, posture) = (record.motions[0].cast(), record.postures[0].cast());
    for mut preset in PRESETS {
        assert!(PaperFilter::<f32>::new(&preset, &dynamics, &motion, &posture).is_ok());
        assert!(ReducedFilter::<f32>::new(&preset, &dynamics, &motion, &posture).is_ok());
        for window in [0, 3, 62] {
            preset.solution_window = window;
            let refused = ReducedFilter::<f32>::new(&preset, &dynamics, &motion, &posture);
            assert_eq!(refused.err(), Some(SettingsError::SolutionWindow));
        }
        preset.solution_window = 4;
        for (window, verdict) in [
            (0, SettingsError::PredictionWindow),
            (21, SettingsError::PredictionWindow),
            (62, SettingsError::PredictionWindow),
            (2, SettingsError::SolutionWindow),
        ] {
            preset.prediction_window = window;
            let refused = ReducedFilter::<f32>::new(&preset, &dynamics, &motion, &posture);
            assert_eq!(refused.err(), Some(verdict), "{window}");
        }
        preset.prediction_window = 20;
        preset.sample_rate = f32::NAN;
        assert!(PaperFilter::<f32>::new(&preset, &dynamics, &motion, &posture).is_err());
    }
    println!(
        "memory: paper's filter {} B, reduced {} B",
        size_of::<PaperFilter<f32>>(),
        size_of::<ReducedFilter<f32>>()
    );
}
