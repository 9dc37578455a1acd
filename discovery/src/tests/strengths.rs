//! Effects that change at random are named with their strengths; clean flights and similar disturbances are not
//! mistaken for them.

use bodyflight_core::dynamics::applied_load::factor::Factor;
use bodyflight_core::dynamics::applied_load::{AppliedLoad, Axis, Direction, Kind, Point};

use super::*;
use crate::laboratory::outside::Outside;
use crate::report::{Named, Report};
use crate::spectrum::{TRIED, scores};

const CONSTANT: Joints = Joints {
    constant_deg: 1.1,
    wander_deg: 0.0,
    wander_hz: 0.3,
    gain: 0.0,
};
const WANDER: Joints = Joints {
    constant_deg: 0.0,
    wander_deg: 1.1,
    ..CONSTANT
};
const MIXED: Joints = Joints {
    wander_deg: 0.9,
    gain: 0.05,
    ..CONSTANT
};
const WIDE: Joints = Joints {
    constant_deg: 2.9,
    wander_deg: 2.3,
    wander_hz: 0.3,
    gain: 0.08,
};

fn settings(seed: u64, joints: Joints) -> laboratory::Settings {
    laboratory::Settings {
        seed,
        person: Some(21),
        duration: 20.0,
        rate: 120.0,
        joints,
        ..laboratory::Settings::default()
    }
}

fn found(hidden: &[Hidden], joints: Joints) -> Report {
    let [one, other] = [21, 22].map(|seed| flown(hidden, &settings(seed, joints)));
    discover(&[one], &[other], &Settings::default(), &()).unwrap()
}

/// Asserts that the effect is the only one named, that its strengths are within three standard errors of the truth, and
/// that the held-out flight confirms it.
fn is_named(effect: Effect, values: [f64; 3], joints: Joints) {
    let report = found(&[Hidden::Effect(effect, values)], joints);
    assert_eq!(report.verdict, Outcome::Named, "{report:?}");
    assert_eq!(report.effects.len(), 1, "{:?}", report.effects);
    has_strengths(&report.effects[0], effect, &values);
    assert!(report.held_out[0].gain > 20.0, "{:?}", report.held_out);
    assert_eq!(report.model[0].0, report.effects[0].name);
}

fn has_strengths(named: &Named, effect: Effect, values: &[f64; 3]) {
    assert_eq!(named.name, effect.description().name, "{named:?}");
    for (k, (_, value)) in named.parameters.iter().enumerate() {
        let error = named.standard_errors[k].1;
        assert!((value - values[k]).abs() < 3.0 * error, "{named:?}");
        assert!(error < 0.6 * values[k], "{named:?}");
    }
}

/// The air's velocity has a standard deviation of 3 m/s here and of 3.5 m/s in the next test, with lengths of 120 m and
/// 200 m. The search does not know the length, so it can only find the gusts: the change of velocity over a short
/// distance.
#[test]
fn turbulence_is_named_by_its_gusts_where_joints_are_constant() {
    is_named(Effect::Turbulence, [2.0, 120.0, 0.0], CONSTANT);
}

#[test]
fn turbulence_is_named_by_its_gusts_where_joints_wander() {
    is_named(Effect::Turbulence, [1.85, 200.0, 0.0], WANDER);
}

#[test]
fn muscle_input_over_time_is_named_by_its_strength_in_mixed_joints() {
    is_named(Effect::MuscleOverTime, [0.4, 0.5, 0.4], MIXED);
}

#[test]
fn damping_over_time_is_named_by_its_strength() {
    is_named(Effect::DampingOverTime, [0.6, 0.6, 0.6], CONSTANT);
}

/// Loads outside the library get no name, whether a single one acts or so many at once that no description covers them.
#[test]
fn loads_outside_the_library_are_not_named_by_a_strength() {
    let all = Outside::ALL.map(Hidden::Outside);
    for hidden in [&[Hidden::Outside(Outside::Tow)][..], &all] {
        let report = found(hidden, MIXED);
        assert!(report.effects.is_empty(), "{report:?}");
    }
}

/// Four sines about each axis, which look random.
fn irregular(kind: Kind, direction: impl Fn(Axis) -> Direction, size: f64) -> Vec<Hidden> {
    let load = |(axis, k): (Axis, usize)| {
        let place = k as f64 + 4.0 * axis as usize as f64;
        Hidden::Load(AppliedLoad {
            kind,
            direction: direction(axis),
            size,
            factors: [
                Some(Factor::Sine {
                    frequency: 0.13 + 0.31 * k as f64 + 0.047 * place,
                    phase: 1.7 * place,
                }),
                None,
                None,
            ],
        })
    };
    let each = Axis::ALL
        .into_iter()
        .flat_map(|axis| (0..4).map(move |k| (axis, k)));
    each.map(load).collect()
}

/// A moment that changes irregularly is not a muscle input, and such a force is not turbulence.
#[test]
fn irregular_loads_are_not_named_by_a_strength() {
    let moments = irregular(Kind::Moment, Direction::Body, 3.0);
    let forces = irregular(Kind::Force(Point::Body), Direction::World, 25.0);
    for hidden in [moments, forces] {
        let report = found(&hidden, CONSTANT);
        assert!(report.effects.is_empty(), "{report:?}");
    }
}

/// Effects that are constant during a flight keep their names.
#[test]
fn a_constant_muscle_input_is_not_mistaken_for_a_changing_one() {
    let report = found(&[Hidden::Effect(Effect::Muscle, [0.6, 0.0, -0.3])], WANDER);
    let names: Vec<_> = report.effects.iter().map(|named| named.name).collect();
    assert_eq!(names, ["muscle"], "{report:?}");
}

/// No family of joint errors causes a slope in any strength, so none is fitted.
#[test]
fn joints_of_any_family_have_no_slope_in_any_strength() {
    for joints in [CONSTANT, WANDER, MIXED, WIDE] {
        let track = flown(&[], &settings(23, joints));
        let problem = Problem::new(&track, &Tolerances::default());
        let fitted = problem
            .fit(&Belief::files(), None, 2, &())
            .unwrap()
            .unwrap();
        let slopes = scores(&problem, &fitted, &TRIED.to_vec());
        assert!(
            slopes.iter().all(|slope| *slope < 3.0),
            "{joints:?}: {slopes:?}"
        );
    }
}
