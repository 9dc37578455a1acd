//! The estimator on synthetic flights: how well it reconstructs them, and what bad input does to it.
//!
//! `BODYFLIGHT_SEEDS` sets the number of noise seeds (default 3; the figures in docs/benchmarks are of 50).

use bodyflight_core::Real;
use bodyflight_core::body::Body;
use bodyflight_core::body::posture::Posture;
use bodyflight_core::dynamics::muscle_input::BACK_TRACKING;
use bodyflight_core::dynamics::step::TIME_STEP;
use bodyflight_core::dynamics::{Dynamics, Inputs, State};
use bodyflight_core::estimator::full::Full;
use bodyflight_core::estimator::measurement::Measurement;
use bodyflight_core::estimator::preset::{PRESETS, Preset};
use bodyflight_core::estimator::propagation::Propagation;
use bodyflight_core::estimator::reduced::Reduced;
use bodyflight_core::estimator::status::{Estimate, Faults, Health};
use bodyflight_core::estimator::unscented::Unsafe;
use bodyflight_core::estimator::{Estimator, PaperFilter, ReducedFilter};
use bodyflight_core::math::wrap_angle;
use bodyflight_tests::estimator_flights::{
    ANGLE_FLYING, FED_SPIN, Flight, Record, TRANSITIONS, TURNS,
};
use bodyflight_tests::{reference, reference_body};

/// Sums of squares of reconstructed less flown; [`Misfit::rms`] makes root mean squares of them.
#[derive(Debug, Clone, Copy, Default)]
struct Misfit {
    horizontal_speed: f64,
    pitch: f64,
    roll: f64,
    yaw_rate: f64,
    count: f64,
}

impl Misfit {
    fn add(&mut self, seen: &Measurement<f64>, flown: &Measurement<f64>) {
        let square = |x: f64| x * x;
        self.horizontal_speed += square(seen.horizontal_speed - flown.horizontal_speed);
        self.pitch += square(wrap_angle(seen.pitch - flown.pitch));
        self.roll += square(wrap_angle(seen.roll - flown.roll));
        self.yaw_rate += square(seen.yaw_rate - flown.yaw_rate);
        self.count += 1.0;
    }

    fn merge(&mut self, other: &Self) {
        self.horizontal_speed += other.horizontal_speed;
        self.pitch += other.pitch;
        self.roll += other.roll;
        self.yaw_rate += other.yaw_rate;
        self.count += other.count;
    }

    fn rms(self) -> Self {
        let mean = |x: f64| (x / self.count).sqrt();
        Self {
            horizontal_speed: mean(self.horizontal_speed),
            pitch: mean(self.pitch),
            roll: mean(self.roll),
            yaw_rate: mean(self.yaw_rate),
            count: self.count,
        }
    }

    fn print(&self, name: &str) {
        println!(
            "{name:24} V_hor {:.3} m/s, pitch {:.3}, roll {:.3} rad, yaw rate {:.3} rad/s",
            self.horizontal_speed, self.pitch, self.roll, self.yaw_rate
        );
    }
}

fn body() -> Option<Body<f64>> {
    reference("segments.json").map(|table| reference_body(&table))
}

fn preset(name: &str) -> Preset {
    *Preset::from_name(name).unwrap()
}

fn seeds() -> u64 {
    std::env::var("BODYFLIGHT_SEEDS").map_or(3, |n| n.parse().unwrap())
}

/// Runs an estimator over a flight; what it reconstructs against what was flown.
fn estimate<T: Real, P: Propagation<T>, const N: usize>(
    record: &Record,
    preset: &Preset,
    seed: u64,
    mut visit: impl FnMut(&Estimate<T>),
) -> Misfit {
    let dynamics: Dynamics<T> = Dynamics {
        muscles: preset.muscles,
        ..record.dynamics
    }
    .cast();
    let (posture, motion) = (record.postures[0].cast(), record.motions[0].cast());
    let mut estimator =
        Box::new(Estimator::<T, P, N>::new(preset, &dynamics, &motion, &posture).unwrap());
    let mut misfit = Misfit::default();
    let measured = record.measured(seed);
    for (posture, measured) in record.postures.iter().zip(&measured).skip(1) {
        let posture: Posture<T> = posture.cast();
        if let Some(estimate) = estimator.push(&dynamics, &posture, &measured.cast()) {
            visit(&estimate);
            let flown = &record.motions[estimate.solved_sample as usize];
            misfit.add(&estimate.reconstructed.cast(), &Measurement::of(flown));
        }
    }
    misfit
}

/// The same over several seeds.
fn over_seeds<P: Propagation<f32>, const N: usize>(record: &Record, preset: &Preset) -> Misfit {
    let mut all = Misfit::default();
    for seed in 1..=seeds() {
        all.merge(&estimate::<f32, P, N>(record, preset, seed, |_| ()));
    }
    all.rms()
}

/// The flight without estimation: the paper's constant coefficients of belly turns.
fn constant(record: &Record) -> Misfit {
    let inputs = Inputs::belly_turn();
    let dynamics = &record.dynamics;
    let start = dynamics.hold(&record.postures[0]);
    let mut state = State::from_motion(&record.motions[0], &start);
    let mut misfit = Misfit::default();
    for (ends, flown) in record
        .postures
        .windows(2)
        .zip(record.motions.iter().skip(1))
    {
        let sample = dynamics.between(&ends[0], &ends[1], TIME_STEP);
        state = dynamics.step(&state, &sample, &inputs, TIME_STEP);
        misfit.add(
            &Measurement::of(&state.motion(&sample)),
            &Measurement::of(flown),
        );
    }
    misfit.rms()
}

struct Comparison {
    constant: Misfit,
    paper: Misfit,
    reduced: Misfit,
}

fn compare(flight: &Flight, preset: &Preset) -> Option<Comparison> {
    let record = flight.fly(&body()?, BACK_TRACKING);
    let found = Comparison {
        constant: constant(&record),
        paper: over_seeds::<Full, 60>(&record, preset),
        reduced: over_seeds::<Reduced, 30>(&record, preset),
    };
    println!("{}, preset {}, {} seeds", flight.name, preset.name, seeds());
    found.constant.print("  constant coefficients");
    found.paper.print("  paper's filter");
    found.reduced.print("  reduced filter");
    Some(found)
}

#[test]
fn angle_flying_with_barrel_rolls_is_reconstructed() {
    let Some(found) = compare(&ANGLE_FLYING, &preset("tracking")) else {
        return;
    };
    for estimated in [found.paper, found.reduced] {
        assert!(estimated.pitch < 0.15 && estimated.roll < 0.15);
        assert!(estimated.horizontal_speed < 0.45);
        assert!(estimated.horizontal_speed < found.constant.horizontal_speed / 3.0);
    }
}

#[test]
fn transitions_are_reconstructed() {
    let Some(found) = compare(&TRANSITIONS, &preset("transitions")) else {
        return;
    };
    // Roll jumps by half a turn when the body passes the vertical: a flip that passes it a few samples early
    // or late dominates the mean.
    for estimated in [found.paper, found.reduced] {
        assert!(estimated.pitch < 0.2 && estimated.roll < 0.5);
        assert!(estimated.roll < found.constant.roll / 3.0);
    }
}

#[test]
fn aggressive_turns_are_reconstructed_alike_by_both_filters() {
    let Some(found) = compare(&TURNS, &preset("turning")) else {
        return;
    };
    for estimated in [found.paper, found.reduced] {
        assert!(estimated.pitch < 0.15 && estimated.roll < 0.15 && estimated.yaw_rate < 0.15);
        assert!(estimated.yaw_rate < found.constant.yaw_rate / 3.0);
    }
    let (paper, reduced) = (found.paper, found.reduced);
    for (a, b) in [
        (reduced.pitch, paper.pitch),
        (reduced.roll, paper.roll),
        (reduced.yaw_rate, paper.yaw_rate),
    ] {
        assert!(a < 1.1 * b, "reduced {a:.4}, paper {b:.4}");
    }
}

#[test]
fn a_negative_damping_bound_improves_a_spin_that_feeds_itself() {
    let bounded = preset("turning");
    let negative = Preset {
        low: preset("transitions-negative-damping").low,
        ..bounded
    };
    let both = compare(&FED_SPIN, &bounded).zip(compare(&FED_SPIN, &negative));
    let Some((bounded, free)) = both else { return };
    assert!(free.paper.yaw_rate < 0.8 * bounded.paper.yaw_rate);
    assert!(free.reduced.yaw_rate < 0.8 * bounded.reduced.yaw_rate);
}

#[test]
fn single_precision_reconstructs_as_double_does() {
    let Some(body) = body() else { return };
    let record = TURNS.fly(&body, BACK_TRACKING);
    let preset = preset("turning");
    fn reconstructed<T: Real, P: Propagation<T>, const N: usize>(
        record: &Record,
        preset: &Preset,
    ) -> Vec<Measurement<f64>> {
        let mut all = Vec::new();
        estimate::<T, P, N>(record, preset, 1, |e| all.push(e.reconstructed.cast()));
        all
    }
    let rms = |a: Vec<Measurement<f64>>, b: Vec<Measurement<f64>>| {
        let mut misfit = Misfit::default();
        for (a, b) in a.iter().zip(&b) {
            misfit.add(a, b);
        }
        misfit.rms()
    };
    for (name, found) in [
        (
            "paper",
            rms(
                reconstructed::<f32, Full, 60>(&record, &preset),
                reconstructed::<f64, Full, 60>(&record, &preset),
            ),
        ),
        (
            "reduced",
            rms(
                reconstructed::<f32, Reduced, 30>(&record, &preset),
                reconstructed::<f64, Reduced, 30>(&record, &preset),
            ),
        ),
    ] {
        println!(
            "{name}, f32 less f64: pitch {:.1e}, roll {:.1e} rad, yaw rate {:.1e} rad/s",
            found.pitch, found.roll, found.yaw_rate
        );
        // A tenth of the deviations of R.
        assert!(
            found.pitch < 1e-3 && found.roll < 1e-3 && found.yaw_rate < 1e-3,
            "{name}"
        );
    }
}

#[test]
fn estimates_come_on_time_and_name_their_samples() {
    let Some(body) = body() else { return };
    let record = TURNS.fly(&body, BACK_TRACKING);
    let preset = preset("tracking");
    let dynamics: Dynamics<f32> = record.dynamics.cast();
    let start = record.motions[0].cast();
    let mut estimator =
        ReducedFilter::<f32>::new(&preset, &dynamics, &start, &record.postures[0].cast()).unwrap();
    assert!((estimator.delay() - 0.25).abs() < 1e-6);
    assert_eq!(estimator.prediction_window(), 60);
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
        if let Some(estimate) = estimator.push(&dynamics, &posture.cast(), &measured.cast()) {
            assert_eq!(estimate.sample as usize + 60, k);
            assert_eq!(estimate.solved_sample, estimate.sample + 4);
            assert!(estimate.faults.none(), "{:?}", estimate.faults);
            arrivals.push(k);
        }
    }
    assert_eq!(arrivals[..4], [60, 64, 68, 72]);
    // After a restart the window fills anew, coefficients are kept.
    let kept = *estimator.filter().state();
    let (motion, posture) = (record.motions[100].cast(), record.postures[100].cast());
    estimator.restart(&dynamics, &motion, &posture).unwrap();
    assert_eq!(*estimator.filter().state(), kept);
    let mut broken = motion;
    broken.velocity.components.x = f32::NAN;
    assert_eq!(
        estimator.restart(&dynamics, &broken, &posture),
        Err(Unsafe::Start)
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
            // Every channel of the measurement is nonsense for half a second.
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
        if let Some(estimate) = estimator.push(&dynamics, &posture, &measured) {
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
fn absurd_postures_and_measurements_never_stick() {
    let Some(body) = body() else { return };
    // A tumbling body, outliers within the limits and beyond, faults at random: single precision, both filters.
    fn abuse<P: Propagation<f32>, const N: usize>(record: &Record, seed: u64) {
        let preset = *Preset::from_name("transitions-negative-damping").unwrap();
        let dynamics: Dynamics<f32> = record.dynamics.cast();
        let mut noise = bodyflight_tests::estimator_flights::Noise::new(seed);
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
            if let Some(estimate) = estimator.push(&dynamics, &record.postures[k].cast(), &measured)
            {
                let finite = estimate
                    .state
                    .iter()
                    .chain(&estimate.deviation)
                    .all(|v| v.is_finite());
                assert!(
                    finite && estimate.deviation.min() > 0.0,
                    "seed {seed}, sample {k}"
                );
                assert!(estimate.motion.velocity.components.norm() < 101.0);
                assert!(estimate.motion.angular_velocity.components.norm() < 36.0);
                fused = estimate.channels.iter().any(|c| c.fused);
            }
        }
        assert!(fused, "seed {seed}: stuck");
    }
    let short = Flight {
        duration: 8.0,
        ..TRANSITIONS
    };
    let record = short.fly(&body, BACK_TRACKING);
    for seed in 1..=4 * seeds() {
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
            assert_eq!(refused.err(), Some(Unsafe::SolutionWindow));
        }
        preset.solution_window = 4;
        preset.time_step = f64::NAN;
        assert!(PaperFilter::<f32>::new(&preset, &dynamics, &motion, &posture).is_err());
    }
    println!(
        "memory: paper's filter {} B, reduced {} B",
        size_of::<PaperFilter<f32>>(),
        size_of::<ReducedFilter<f32>>()
    );
}
