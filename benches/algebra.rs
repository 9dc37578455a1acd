//! Filter algebra alone: one update of six states by four channels.

use core::hint::black_box;

use bodyflight_benches::{Filter, Kfilter, Multicalc, Own, measurement, minikalman};
use bodyflight_core::estimator::unscented::Root;
use criterion::{Criterion, criterion_group, criterion_main};

fn run(c: &mut Criterion, name: &str, mut update: impl FnMut(&[f32; 4])) {
    let measurements: Vec<_> = (0..256).map(measurement).collect();
    let mut next = measurements.iter().cycle();
    c.bench_function(name, |b| {
        b.iter(|| {
            if let Some(z) = next.next() {
                update(black_box(z));
            }
        });
    });
}

fn algebra(c: &mut Criterion) {
    let filters: [(&str, Option<Box<dyn Filter>>); 4] = [
        (
            "own, symmetric root",
            Own::new(Root::Symmetric).map(|f| Box::new(f) as _),
        ),
        (
            "own, Cholesky",
            Own::new(Root::Cholesky).map(|f| Box::new(f) as _),
        ),
        ("multicalc", Multicalc::new().map(|f| Box::new(f) as _)),
        ("kfilter", Kfilter::new().map(|f| Box::new(f) as _)),
    ];
    for (name, filter) in filters {
        if let Some(mut filter) = filter {
            run(c, name, |z| {
                black_box(filter.update(z));
            });
        }
    }
    let mut mini = minikalman();
    run(c, "minikalman", |z| {
        black_box(mini(z));
    });
}

criterion_group!(benches, algebra);
criterion_main!(benches);
