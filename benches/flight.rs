//! Cost of whole flights: 55 s of tracking with a solution window of 12 samples, posture computation included.

use core::hint::black_box;

use bodyflight_core::Real;
use bodyflight_core::body::posture::Posture;
use bodyflight_core::dynamics::Dynamics;
use bodyflight_core::dynamics::muscle_input::BACK_TRACKING;
use bodyflight_core::estimator::Estimator;
use bodyflight_core::estimator::full::Full;
use bodyflight_core::estimator::measurement::Measurement;
use bodyflight_core::estimator::preset::{Preset, TRACKING_ON_BACK};
use bodyflight_core::estimator::propagation::Propagation;
use bodyflight_core::estimator::reduced::Reduced;
use bodyflight_tests::estimator_flights::{ANGLE_FLYING, Record};
use bodyflight_tests::{reference, reference_body};
use criterion::{Criterion, criterion_group, criterion_main};

fn fly<T: Real, P: Propagation<T>, const N: usize>(c: &mut Criterion, name: &str, record: &Record) {
    let dynamics: Dynamics<T> = record.dynamics.cast();
    let preset = Preset {
        solution_window: 12,
        ..TRACKING_ON_BACK
    };
    let postures: Vec<Posture<T>> = record.postures.iter().map(Posture::cast).collect();
    let measured: Vec<Measurement<T>> = record.measured(1).iter().map(Measurement::cast).collect();
    let (Some(posture), Some(motion)) = (postures.first(), record.motions.first()) else {
        return;
    };
    let mut group = c.benchmark_group("55 s flight");
    group.sample_size(10);
    group.bench_function(name, |b| {
        b.iter(|| {
            let Ok(estimator) =
                Estimator::<T, P, N>::new(&preset, &dynamics, &motion.cast(), posture)
            else {
                return;
            };
            let mut estimator = Box::new(estimator);
            for (posture, measured) in postures.iter().zip(&measured).skip(1) {
                black_box(estimator.push(posture, measured));
            }
        });
    });
    group.finish();
}

fn flights(c: &mut Criterion) {
    let Some(table) = reference("segments.json") else {
        return;
    };
    let record = ANGLE_FLYING.fly(&reference_body(&table), BACK_TRACKING);
    fly::<f32, Full, 60>(c, "paper f32", &record);
    fly::<f64, Full, 60>(c, "paper f64", &record);
    fly::<f32, Reduced, 30>(c, "reduced f32", &record);
    fly::<f64, Reduced, 30>(c, "reduced f64", &record);
}

criterion_group!(benches, flights);
criterion_main!(benches);
