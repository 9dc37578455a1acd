//! The estimator on synthetic flights: accuracy of the reconstruction, and the effect of bad input.
//!
//! `BODYFLIGHT_SEEDS` sets the number of noise seeds (default 3; docs/benchmarks.md uses 50).

use bodyflight_core::Real;
use bodyflight_core::body::Body;
use bodyflight_core::body::posture::Posture;
use bodyflight_core::dynamics::muscle_input::BACK_TRACKING;
use bodyflight_core::dynamics::step::TIME_STEP;
use bodyflight_core::dynamics::{Dynamics, Inputs, State};
use bodyflight_core::estimator::Estimator;
use bodyflight_core::estimator::full::Full;
use bodyflight_core::estimator::measurement::Measurement;
use bodyflight_core::estimator::preset::Preset;
use bodyflight_core::estimator::propagation::Propagation;
use bodyflight_core::estimator::reduced::Reduced;
use bodyflight_core::estimator::status::Estimate;
use bodyflight_core::math::wrap_angle;
use bodyflight_tests::estimator_flights::{
    ANGLE_FLYING, FED_SPIN, FLIPS_AND_ROLLS, Flight, Record, TURNS,
};
use bodyflight_tests::transitions::STYLES;
use bodyflight_tests::{reference, reference_body};

/// Sums of squared reconstruction errors; [`Misfit::rms`] converts them to root mean squares.
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

/// Runs an estimator over a flight and compares the reconstruction with the true flight.
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
        if let Some(estimate) = estimator.push(&posture, &measured.cast()) {
            visit(&estimate);
            let flown = &record.motions[estimate.solved_sample as usize];
            misfit.add(&estimate.reconstructed.cast(), &Measurement::of(flown));
        }
    }
    misfit
}

/// Runs an estimator over several seeds.
fn over_seeds<P: Propagation<f32>, const N: usize>(record: &Record, preset: &Preset) -> Misfit {
    let mut all = Misfit::default();
    for seed in 1..=seeds() {
        all.merge(&estimate::<f32, P, N>(record, preset, seed, |_| ()));
    }
    all
}

/// Medians over at least nine seeds. With some seeds an unstable motion takes another branch for a second, which would
/// dominate a mean; which seeds these are depends on the last bits.
fn typical<P: Propagation<f32>, const N: usize>(record: &Record, preset: &Preset) -> Misfit {
    let each: Vec<Misfit> = (1..=seeds().max(9))
        .map(|seed| estimate::<f32, P, N>(record, preset, seed, |_| ()).rms())
        .collect();
    let median = |figure: fn(&Misfit) -> f64| {
        let mut figures: Vec<f64> = each.iter().map(figure).collect();
        figures.sort_by(f64::total_cmp);
        figures[figures.len() / 2]
    };
    Misfit {
        horizontal_speed: median(|one| one.horizontal_speed),
        pitch: median(|one| one.pitch),
        roll: median(|one| one.roll),
        yaw_rate: median(|one| one.yaw_rate),
        count: 1.0,
    }
}

/// Misfit without estimation, with the paper's constant coefficients for belly turns.
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
    misfit
}

struct Comparison {
    constant: Misfit,
    paper: Misfit,
    reduced: Misfit,
}

fn compare(flight: &Flight, preset: &Preset) -> Option<Comparison> {
    compare_all(core::slice::from_ref(flight), preset)
}

/// Compares the reconstructions of several flights together.
fn compare_all(flights: &[Flight], preset: &Preset) -> Option<Comparison> {
    let body = body()?;
    let fly = |flight: &Flight| flight.fly(&body, BACK_TRACKING);
    let records: Vec<Record> = flights.iter().map(fly).collect();
    let mean = |misfit: fn(&Record, &Preset) -> Misfit| {
        let mut all = Misfit::default();
        for record in &records {
            all.merge(&misfit(record, preset));
        }
        all.rms()
    };
    let found = Comparison {
        constant: mean(|record, _| constant(record)),
        paper: mean(over_seeds::<Full, 60>),
        reduced: mean(over_seeds::<Reduced, 30>),
    };
    println!(
        "{}, {} script(s), preset {}, {} seeds",
        flights.first()?.name,
        flights.len(),
        preset.name,
        seeds()
    );
    found.constant.print("  constant coefficients");
    found.paper.print("  paper's filter");
    found.reduced.print("  reduced filter");
    Some(found)
}

#[test]
fn angle_flying_with_barrel_rolls_is_reconstructed() {
    let preset = preset("tracking");
    let (Some(body), Some(means)) = (body(), compare(&ANGLE_FLYING, &preset)) else {
        return;
    };
    let record = ANGLE_FLYING.fly(&body, BACK_TRACKING);
    let paper = typical::<Full, 60>(&record, &preset);
    let reduced = typical::<Reduced, 30>(&record, &preset);
    for (name, typical) in [("paper's filter", paper), ("reduced filter", reduced)] {
        typical.print(&format!("  {name}, median"));
        assert!(typical.pitch < 0.15 && typical.roll < 0.15);
    }
    for estimated in [means.paper, means.reduced] {
        assert!(estimated.horizontal_speed < means.constant.horizontal_speed / 3.0);
    }
    // With most seeds, the paper's filter reaches the paper's 0.45 m/s. The reduced one does not (docs/benchmarks.md).
    assert!(means.paper.horizontal_speed < 0.8);
    assert!(means.reduced.horizontal_speed < 0.6);
}

#[test]
fn agile_angle_flying_is_within_the_papers_accuracy() {
    let Some(found) = compare(&ANGLE_FLYING, &preset("tracking-agile")) else {
        return;
    };
    let constant = found.constant;
    for estimated in [found.paper, found.reduced] {
        assert!(estimated.pitch < 0.15 && estimated.roll < 0.15);
        assert!(estimated.horizontal_speed < 0.45);
        assert!(estimated.roll < constant.roll / 3.0);
        assert!(estimated.horizontal_speed < constant.horizontal_speed / 3.0);
    }
}

#[test]
fn fourteen_transitions_are_within_the_papers_accuracy() {
    let flights = STYLES.map(|style| style.flight());
    let Some(found) = compare_all(&flights, &preset("transitions-agile")) else {
        return;
    };
    for estimated in [found.paper, found.reduced] {
        assert!(estimated.pitch < 0.15 && estimated.pitch < found.constant.pitch / 3.0);
        assert!(estimated.roll < 0.15 && estimated.roll < found.constant.roll / 3.0);
    }
}

#[test]
fn every_transition_changes_sides_once() {
    let Some(body) = body() else { return };
    for flight in STYLES.map(|style| style.flight()) {
        let record = flight.fly(&body, BACK_TRACKING);
        let changes = record.course.changes_of_side();
        assert_eq!(changes.len(), 14);
        for (change, pulse) in changes.iter().zip(flight.pulses.iter()) {
            let [begin, end] = pulse.during;
            assert!((begin..end + 0.4).contains(change), "{change} s, {begin} s");
        }
    }
}

#[test]
fn flips_and_rolls_with_satellites_are_reconstructed_with_their_speed() {
    let Some(found) = compare(&FLIPS_AND_ROLLS, &preset("transitions-gnss")) else {
        return;
    };
    for estimated in [found.paper, found.reduced] {
        assert!(estimated.pitch < 0.15 && estimated.pitch < found.constant.pitch / 3.0);
        assert!(estimated.roll < 0.25 && estimated.roll < found.constant.roll / 3.0);
        assert!(estimated.horizontal_speed < found.constant.horizontal_speed / 3.0);
    }
}

#[test]
fn flips_and_rolls_are_reconstructed() {
    let Some(found) = compare(&FLIPS_AND_ROLLS, &preset("transitions")) else {
        return;
    };
    // Roll jumps by half a turn when the body passes the vertical, so a flip that passes it a few samples early or late
    // dominates the mean. Flips are also unstable motions: the last bit can select another branch.
    for estimated in [found.paper, found.reduced] {
        assert!(estimated.pitch < 0.2 && estimated.pitch < found.constant.pitch);
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

/// Root mean square differences between single and double precision, for the paper's filter and for the reduced one.
fn precisions_apart(record: &Record, preset: &Preset) -> [Misfit; 2] {
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
    [
        rms(
            reconstructed::<f32, Full, 60>(record, preset),
            reconstructed::<f64, Full, 60>(record, preset),
        ),
        rms(
            reconstructed::<f32, Reduced, 30>(record, preset),
            reconstructed::<f64, Reduced, 30>(record, preset),
        ),
    ]
}

#[test]
fn single_precision_reconstructs_as_double_does() {
    let Some(body) = body() else { return };
    // Not for transitions: flips are unstable motions in which the last bit selects another branch
    // (docs/benchmarks.md).
    for (flight, name) in [
        (&TURNS, "turning"),
        (&ANGLE_FLYING, "tracking"),
        (&ANGLE_FLYING, "tracking-agile"),
    ] {
        let preset = preset(name);
        let record = flight.fly(&body, BACK_TRACKING);
        for (filter, found) in ["paper", "reduced"]
            .iter()
            .zip(precisions_apart(&record, &preset))
        {
            println!(
                "{name}, {filter}, f32 less f64: horizontal speed {:.1e} m/s, pitch {:.1e}, roll {:.1e} rad, yaw rate {:.1e} rad/s",
                found.horizontal_speed, found.pitch, found.roll, found.yaw_rate
            );
            // A tenth of the standard deviations in R, which is as close as rounding allows in flights that do not
            // amplify it. Angle flying over the paper's window of 0.25 s does amplify it, but stays within R
            // (docs/benchmarks.md). R does not apply to the yaw rate if a preset does not measure it.
            let share = if name == "tracking" { 1.0 } else { 0.1 };
            let yaw_rate = if name == "turning" {
                0.01 * share
            } else {
                f64::INFINITY
            };
            assert!(
                found.pitch < 0.01 * share
                    && found.roll < 0.01 * share
                    && found.yaw_rate < yaw_rate,
                "{name}, {filter}"
            );
            assert!(found.horizontal_speed < 0.1 * share, "{name}, {filter}");
        }
    }
}
