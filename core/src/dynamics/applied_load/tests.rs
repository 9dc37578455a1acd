//! Tests of user-defined loads against closed-form results.

use nalgebra::Vector3;
use proptest::prelude::*;

use super::factor::Factor;
use super::*;
use crate::body::mass_properties::PostureRate;
use crate::body::pattern;
use crate::dynamics::Inputs;
use crate::dynamics::free_run::{Equations, FreeRun};
use crate::frame::Rotation;
use crate::math::Lanes;
use crate::test_body::reference_body;

const NONE: [Option<Factor<f64>>; FACTORS] = [None; FACTORS];

fn load(kind: Kind, direction: Direction, size: f64) -> AppliedLoad<f64> {
    AppliedLoad {
        kind,
        direction,
        size,
        factors: NONE,
    }
}

fn times(mut load: AppliedLoad<f64>, factor: Factor<f64>) -> AppliedLoad<f64> {
    let place = load.factors.iter_mut().find(|place| place.is_none());
    *place.unwrap() = Some(factor);
    load
}

fn loads(load: AppliedLoad<f64>) -> AppliedLoads<f64> {
    AppliedLoads::none().with(load).unwrap()
}

/// A model without air and gravity.
fn empty_space() -> Dynamics<f64> {
    Dynamics {
        gravity: 0.0,
        ..Dynamics::paper(reference_body(), 0.0)
    }
}

fn still() -> Motion<f64> {
    Motion {
        inertial_from_body: Rotation::identity(),
        position: Vector::zero(),
        velocity: Vector::zero(),
        angular_velocity: Vector::zero(),
    }
}

/// The motion after `steps` steps of 1/240 s.
fn flown(
    dynamics: &Dynamics<f64>,
    applied: &AppliedLoads<f64>,
    equations: Equations,
    steps: u32,
) -> Motion<f64> {
    let (posture, rate) = (pattern::neutral(), PostureRate::zero());
    let mut run = FreeRun::new(dynamics, equations, &still(), &posture, &rate);
    let inputs = Inputs::belly_turn();
    for step in 0..steps {
        let time = f64::from(step) / 240.0;
        run.advance_under((applied, time), dynamics, &inputs, &posture, 1.0 / 240.0);
    }
    run.motion(dynamics, &rate)
}

fn at(load: AppliedLoad<f64>, motion: &Motion<f64>, time: f64) -> Push<f64> {
    let dynamics = empty_space();
    let posture = pattern::neutral();
    let cg = Vector::from_components(dynamics.hold(&posture).mass.cg);
    loads(load).at(&dynamics, &posture, motion, &cg, time)
}

#[test]
fn a_force_moves_the_centre_of_gravity_alone_and_a_moment_turns_it() {
    let dynamics = empty_space();
    let sample = dynamics.hold(&pattern::neutral());
    let cg = Vector::from_components(sample.mass.cg);
    for equations in [Equations::Exact, Equations::AsPublished] {
        let force = loads(load(
            Kind::Force(Point::Body),
            Direction::World(Axis::Z),
            150.0,
        ));
        let motion = flown(&dynamics, &force, equations, 240);
        let velocity = motion.velocity + motion.angular_velocity.cross(&cg);
        let expected = Vector::new(0.0, 0.0, 150.0 / sample.mass.mass);
        assert!((velocity - expected).norm() < 1e-9, "{velocity:?}");
        assert!(motion.angular_velocity.norm() < 1e-9);

        let moment = loads(load(Kind::Moment, Direction::Body(Axis::Y), 5.0));
        let motion = flown(&dynamics, &moment, equations, 12);
        let expected = sample.inverse_inertia * Vector3::<f64>::new(0.0, 5.0 * 0.05, 0.0);
        let spin = motion.angular_velocity.components;
        assert!((spin - expected).norm() < 1e-4, "{spin:?} {expected:?}");
    }
}

#[test]
fn a_force_on_a_segment_has_an_arm() {
    let force = load(
        Kind::Force(Point::Segment(Segment::LeftHand)),
        Direction::Body(Axis::Y),
        10.0,
    );
    let push = at(force, &still(), 0.0);
    let dynamics = empty_space();
    let posture = pattern::neutral();
    let hand = pose(&dynamics.body, &posture)[Segment::LeftHand].cg;
    let cg = dynamics.hold(&posture).mass.cg;
    let expected = (hand - cg).cross(&Vector3::new(0.0, 10.0, 0.0));
    assert!((push.moment.components - expected).norm() < 1e-12);
    assert!(push.moment.z() > 1.0, "the left hand is left of the middle");

    let along = load(
        Kind::Moment,
        Direction::Segment(Segment::LeftHand, Axis::Z),
        3.0,
    );
    let axes = pose(&dynamics.body, &posture)[Segment::LeftHand].body_from_segment;
    let moment = at(along, &still(), 0.0).moment.components;
    assert!((moment - axes.column(2) * 3.0).norm() < 1e-12);
}

#[test]
fn factors_act_as_named() {
    let motion = Motion {
        position: Vector::new(0.0, 0.0, 2500.0),
        velocity: Vector::new(0.0, -30.0, 40.0),
        angular_velocity: Vector::new(0.5, -1.5, 0.0),
        ..still()
    };
    let plain = load(Kind::Moment, Direction::Body(Axis::X), 2.0);
    let thigh = pattern::neutral::<f64>()
        .parent_from_segment(Segment::LeftThigh)
        .scaled_axis()
        .x;
    let cases = [
        (Factor::Speed { reference: 25.0 }, 2.0),
        (Factor::SpeedSquared { reference: 25.0 }, 4.0),
        (
            Factor::Turn {
                axis: Axis::Y,
                reference: 3.0,
            },
            -0.5,
        ),
        (
            Factor::Height {
                from: 4000.0,
                reference: -1000.0,
            },
            1.5,
        ),
        (
            Factor::Joint {
                segment: Segment::LeftThigh,
                axis: Axis::X,
                from: 0.25,
                reference: 0.5,
            },
            (thigh - 0.25) / 0.5,
        ),
        (
            Factor::Sine {
                frequency: 0.25,
                phase: 0.0,
            },
            core::f64::consts::FRAC_1_SQRT_2,
        ),
    ];
    for (factor, expected) in cases {
        let moment = at(times(plain, factor), &motion, 0.5).moment.x();
        assert!(
            (moment - 2.0 * expected).abs() < 1e-9,
            "{factor:?}: {moment}"
        );
    }
    let both = times(times(plain, cases[0].0), cases[2].0);
    assert!((at(both, &motion, 0.5).moment.x() + 2.0).abs() < 1e-9);
    let stream = load(Kind::Force(Point::Body), Direction::Stream, 1.0);
    let along = at(stream, &motion, 0.0).force;
    assert!((along - Vector::new(0.0, 0.6, -0.8)).norm() < 1e-12);
    assert_eq!(at(stream, &still(), 0.0).force, Vector::zero());
}

#[test]
fn a_pulse_acts_once_or_repeatedly() {
    let pulse = |period| {
        let factor = Factor::Pulse {
            start: 1.0,
            duration: 0.5,
            period,
        };
        let load = times(load(Kind::Moment, Direction::Body(Axis::X), 1.0), factor);
        [0.9, 1.0, 1.49, 1.5, 2.9, 3.0, 3.4, 3.6]
            .map(|time| at(load, &still(), time).moment.x() > 0.5)
    };
    let (on, off) = (true, false);
    assert_eq!(pulse(0.0), [off, on, on, off, off, off, off, off]);
    assert_eq!(pulse(2.0), [off, on, on, off, off, on, on, off]);
}

#[test]
fn applied_loads_are_second_order_in_the_step() {
    // A moment that oscillates about one axis of a body that hardly rotates: its integral is known.
    let sine = Factor::Sine {
        frequency: 3.0,
        phase: 0.7,
    };
    let swinging = loads(times(
        load(Kind::Moment, Direction::Body(Axis::Y), 0.5),
        sine,
    ));
    let dynamics = empty_space();
    let sample = dynamics.hold(&pattern::neutral());
    let spin = flown(&dynamics, &swinging, Equations::Exact, 60).angular_velocity;
    let rate = 3.0 * core::f64::consts::TAU;
    let integral = (libm::cos(0.7) - libm::cos(0.7 + rate * 0.25)) / rate;
    let expected = sample.inverse_inertia * Vector3::new(0.0, 0.5 * integral, 0.0);
    assert!((spin.components - expected).norm() < 3e-3 * expected.norm());
}

#[test]
fn the_list_is_bounded() {
    let one = load(Kind::Moment, Direction::Stream, 1.0);
    let mut list = AppliedLoads::none();
    for _ in 0..APPLIED_LOADS {
        list = list.with(one).unwrap();
    }
    assert_eq!(list.iter().count(), APPLIED_LOADS);
    assert_eq!(list.with(one), Err(TooManyLoads));
}

proptest! {
    /// No input panics, and both precisions agree for plausible values.
    #[test]
    fn any_numbers_are_accepted(
        numbers in prop::array::uniform4(prop_oneof![
            Just(0.0), Just(f64::NAN), Just(f64::INFINITY), -1e9..1e9f64
        ]),
        time in prop_oneof![0.0..60.0f64, Just(f64::NAN), Just(-1e30)],
    ) {
        let [size, a, b, c] = numbers;
        let load = AppliedLoad {
            kind: Kind::Force(Point::Segment(Segment::Head)),
            direction: Direction::Stream,
            size,
            factors: [
                Some(Factor::Sine { frequency: a, phase: b }),
                Some(Factor::Pulse { start: a, duration: b, period: c }),
                Some(Factor::Height { from: b, reference: c }),
            ],
        };
        let _ = at(load, &still(), time);
        let single = loads(load).cast::<f32>().cast::<f64>();
        prop_assert_eq!(single.iter().count(), 1);
    }

    #[test]
    fn both_precisions_apply_the_same_load(size in -300.0..300.0f64, frequency in 0.1..6.0f64, time in 0.0..60.0f64) {
        let load = times(
            load(Kind::Force(Point::Segment(Segment::LeftFoot)), Direction::World(Axis::X), size),
            Factor::Sine { frequency, phase: 0.3 },
        );
        let dynamics = empty_space();
        let posture = pattern::neutral();
        let cg = Vector::from_components(dynamics.hold(&posture).mass.cg);
        let double = loads(load).at(&dynamics, &posture, &still(), &cg, time);
        let single = loads(load).cast::<f32>().at(
            &dynamics.cast(), &posture.cast(), &still().cast(),
            &Vector::from_components(cg.components.cast()), f32::of(time),
        );
        let apart = double.moment.components - single.moment.components.cast::<f64>();
        prop_assert!(apart.norm() < 1e-3 * (1.0 + size.abs()));
    }
}
