//! Simulated falls with known effects.

use bodyflight_core::body::pattern;
use bodyflight_core::dynamics::Dynamics;
use bodyflight_core::dynamics::point_mass::PointMass;
use bodyflight_core::effect::{Effect, Model, PARAMETER_COUNT};
use bodyflight_core::frame::Vector;
use nalgebra::Vector3;
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;

use super::fall::FALLING;
use super::search::discover;
use super::track::{Fix, Track};
use crate::effect_set::{EffectSet, extended};
use crate::report::Outcome;
use crate::test_subject;

fn dynamics(_height: f64) -> Dynamics<f64> {
    test_subject::dynamics()
}

/// A fall from 4000 m with given effects, by a skydiver who changes posture every ten seconds, as recorded by a noisy
/// receiver.
fn recorded(effects: &EffectSet, seed: u64, duration: f64) -> Track {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut normal = |deviation: f64| random.sample::<f64, _>(StandardNormal) * deviation;
    let model = extended(&Model::new(dynamics(4000.0), 4000.0), effects);
    let point = PointMass::of(&model.dynamics, &pattern::neutral());
    let mut position = Vector::new(0.0, 0.0, 4000.0);
    let mut velocity = Vector::new(30.0, 10.0, -FALLING - 1.0);
    let (mut area, mut lift) = (1.0, Vector3::zeros());
    let mut fixes = Vec::new();
    let step = 0.01;
    for k in 0.. {
        let time = f64::from(k) * step;
        if time > duration {
            break;
        }
        if k % 1000 == 0 {
            area = 1.0 + normal(0.05);
            lift = Vector3::new(normal(0.03), normal(0.03), 0.0) * model.dynamics.gravity;
        }
        if k % 20 == 0 {
            let noise = Vector3::new(normal(0.1), normal(0.1), normal(0.1));
            fixes.push(Fix {
                time,
                position,
                velocity: Vector::from_components(velocity.components + noise),
            });
        }
        let posed = PointMass {
            drag_area: point.drag_area * area,
            ..point
        };
        let pull = posed.acceleration(&position, &velocity).components + lift;
        velocity = Vector::from_components(velocity.components + pull * step);
        position = Vector::from_components(position.components + velocity.components * step);
    }
    Track {
        fixes,
        ..Track::default()
    }
}

#[test]
fn effects_without_posture_are_found_and_improve_another_fall() {
    let hidden: [(Effect, [f64; PARAMETER_COUNT]); 3] = [
        (Effect::Drag, [1.5, 1.5, 1.5]),
        (Effect::Wind, [12.0, -8.0, 0.0]),
        (Effect::DensityGradient, [0.26, 0.0, 0.0]),
    ];
    for one in hidden {
        let (mut parameters, mut within) = (0, 0);
        for seed in 0..5 {
            let flown = recorded(&vec![one], seed, 50.0);
            let other = recorded(&vec![one], seed + 100, 50.0);
            let report = discover(&flown, &[other], &dynamics, 3).unwrap();
            assert_eq!(report.verdict, Outcome::Named, "{one:?} {report:?}");
            let names: Vec<&str> = report.effects.iter().map(|named| named.name).collect();
            assert_eq!(names, [one.0.description().name], "seed {seed}");
            let named = &report.effects[0];
            for ((found, (_, error)), truth) in named
                .parameters
                .iter()
                .zip(&named.standard_errors)
                .zip(one.1)
            {
                parameters += 1;
                within += usize::from((found.1 - truth).abs() <= 3.0 * error);
            }
            assert!(report.held_out[0].closed_share > 0.9, "{one:?} seed {seed}");
        }
        assert!(
            10 * within >= 9 * parameters,
            "{one:?}: {within} of {parameters}"
        );
    }
}

#[test]
fn no_effect_is_named_where_none_is_missing() {
    for seed in 0..10 {
        let flown = recorded(&EffectSet::new(), seed, 50.0);
        let other = recorded(&EffectSet::new(), seed + 100, 50.0);
        let report = discover(&flown, &[other], &dynamics, 3).unwrap();
        assert_eq!(report.verdict, Outcome::None, "seed {seed}: {report:?}");
    }
}

#[test]
fn several_effects_are_found_one_after_another() {
    let hidden = vec![
        (Effect::Drag, [0.6, 0.6, 0.6]),
        (Effect::Wind, [-10.0, 6.0, 0.0]),
    ];
    let flown = recorded(&hidden, 1, 55.0);
    let report = discover(&flown, &[recorded(&hidden, 2, 55.0)], &dynamics, 3).unwrap();
    let mut names: Vec<&str> = report.effects.iter().map(|named| named.name).collect();
    names.sort_unstable();
    assert_eq!(names, ["drag", "wind"]);
    assert!(report.model.iter().any(|(name, _)| *name == "drag"));
}

#[test]
fn no_effect_is_named_in_a_short_fall_and_no_fall_is_an_error() {
    let wind = vec![(Effect::Wind, [15.0, 0.0, 0.0])];
    let report = discover(&recorded(&wind, 0, 12.0), &[], &dynamics, 3).unwrap();
    assert_eq!(report.verdict, Outcome::Thin);
    assert!(report.effects.is_empty() && report.model.is_empty());
    let problem = discover(&recorded(&wind, 0, 3.0), &[], &dynamics, 3).unwrap_err();
    assert!(problem.to_string().contains("free fall"), "{problem}");
}

#[test]
fn late_velocities_are_found_from_the_positions() {
    let flown = recorded(&EffectSet::new(), 4, 40.0);
    let mut late = flown.clone();
    for (fix, before) in late.fixes[2..].iter_mut().zip(&flown.fixes) {
        fix.velocity = before.velocity;
    }
    let found = discover(&late, &[], &dynamics, 3).unwrap().latency.unwrap();
    assert!(
        (found.latency_s - 0.4).abs() < 3.0 * found.standard_error_s + 0.02,
        "{found:?}"
    );
    let found = discover(&flown, &[], &dynamics, 3)
        .unwrap()
        .latency
        .unwrap();
    assert!(
        found.latency_s.abs() < 4.0 * found.standard_error_s,
        "{found:?}"
    );
}
