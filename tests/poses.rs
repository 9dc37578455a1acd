//! Speeds of every pose compared with published ones: the free-fly model meets them all, the paper's model only those
//! of belly and back.

#[path = "poses/flyer.rs"]
mod flyer;

use bodyflight_core::aerodynamics::BELLY_TURN_DAMPING;
use bodyflight_core::aerodynamics::load_model::LoadModel;
use bodyflight_core::body::anthropometry::{Person, Sex};
use bodyflight_core::body::gear::Gear;
use bodyflight_core::body::pattern;
use bodyflight_core::dynamics::step::TIME_STEP;
use bodyflight_core::dynamics::trim::trim;
use bodyflight_core::dynamics::{Dynamics, Inputs, Motion, State};
use bodyflight_core::frame::{Vector, facing_north};
use bodyflight_core::{AxisCoefficients, Body, Segment};
use bodyflight_verbs::poses::{
    FIRM, Fall, POSES, Pose, best_glide, dynamics, fall, modes_table, person, table,
};
use flyer::Flyer;

#[test]
fn free_fly_meets_the_published_speeds_and_the_paper_s_model_does_not() {
    let body = person().expect("a person");
    for pose in &POSES {
        let [paper, free] =
            [LoadModel::Paper, LoadModel::FreeFly].map(|model| fall(&dynamics(body, model), pose));
        println!("{}: {paper:.3?}\n   {free:.3?}", pose.name);
        let [low, high] = pose.published;
        assert!(
            (low..=high).contains(&free.speed_mps),
            "{}: {} m/s",
            pose.name,
            free.speed_mps
        );
        let upright = pose.name != "belly" && pose.name != "back";
        assert_eq!(paper.speed_mps < 60.0 && upright, upright, "{}", pose.name);
    }
    let glides =
        [LoadModel::Paper, LoadModel::FreeFly].map(|model| best_glide(&dynamics(body, model)));
    println!("tracking: {glides:.2?}");
    assert!((0.7..=1.2).contains(&glides[1].0) && glides[0].0 > 1.2);
}

#[test]
fn belly_flight_is_the_paper_s_within_a_hundredth() {
    let body = person().expect("a person");
    let [paper, free] = [LoadModel::Paper, LoadModel::FreeFly]
        .map(|model| trim(&dynamics(body, model), &pattern::neutral(), 0.0).expect("a balance"));
    println!("{paper:?}\n{free:?}");
    assert!((free.terminal_speed / paper.terminal_speed - 1.0).abs() < 0.01);
    assert!((free.body_pitch / paper.body_pitch - 1.0).abs() < 0.01);
    assert!((free.knee / paper.knee - 1.0).abs() < 0.01);
    assert!((free.pitch_stiffness / paper.pitch_stiffness - 1.0).abs() < 0.015);
}

#[test]
fn the_page_has_the_tables() {
    let page = include_str!("../docs/poses.md");
    for table in [table(), modes_table()] {
        let table = table.expect("a table");
        assert!(page.contains(&table), "docs/poses.md lacks\n{table}");
    }
}

/// Result of holding a pose for a minute.
#[derive(Debug)]
struct Held {
    /// Time until the body leaned more than 40 degrees from the attitude of the pose (s); 60 if it never did.
    time: f64,
    /// Largest lean (deg).
    lean: f64,
    /// Largest correction (deg).
    correction: f64,
}

/// Holds a pose for a minute, starting with its attitude and speed, with or without a flyer who corrects. One forearm
/// and one shank sway, and after 30 s the left forearm is moved by 0.3 rad for half a second.
fn held(
    dynamics: &Dynamics<f64>,
    pose: &Pose,
    damping: AxisCoefficients<f64>,
    flown: bool,
) -> Held {
    let inputs = Inputs {
        damping,
        ..Inputs::belly_turn()
    };
    let base = pattern::posture(pose.angles);
    let attitude = facing_north(pose.pitch);
    let falls = Vector::new(0.0, 0.0, -fall(dynamics, pose).speed_mps);
    let motion = Motion {
        inertial_from_body: attitude,
        position: Vector::zero(),
        velocity: attitude.inverse() * falls,
        angular_velocity: Vector::zero(),
    };
    let mut flyer = Flyer::of(dynamics, &base, pose.pitch);
    let mut state = State::from_motion(&motion, &dynamics.hold(&base));
    let (mut before, mut seen) = (base, motion);
    let mut held = Held {
        time: 60.0,
        lean: 0.0,
        correction: 0.0,
    };
    for step in 0..240 * 60 {
        let time = f64::from(step) * TIME_STEP;
        let answered = if flown {
            flyer.hold(&base, &seen)
        } else {
            base
        };
        let push = if (30.0..30.5).contains(&time) {
            0.3
        } else {
            0.0
        };
        let forearm = 0.012 * (1.7 * time).sin() + 0.008 * (4.1 * time).sin() + push;
        let wander = [
            (Segment::LeftForearm, [0.0, 0.0, forearm]),
            (Segment::RightShank, [0.0, 0.0, 0.015 * (1.3 * time).sin()]),
        ];
        let posture = pattern::moved(&answered, &wander, 1.0);
        let sample = dynamics.between(&before, &posture, TIME_STEP);
        state = dynamics.step(&state, &sample, &inputs, TIME_STEP);
        before = posture;
        seen = state.motion(&sample);
        held.lean = held.lean.max(flyer.tilt(&seen).to_degrees());
        held.correction = held.correction.max(flyer.correction().to_degrees());
        if held.lean > 40.0 {
            held.time = time;
            break;
        }
    }
    held
}

/// People from 1.62 m to 1.92 m, all but one with a rig.
fn people() -> [Body<f64>; 4] {
    [
        (1.80, 80.0, Sex::Male, 10.0),
        (1.75, 75.0, Sex::Male, 0.0),
        (1.62, 58.0, Sex::Female, 9.0),
        (1.92, 98.0, Sex::Male, 12.0),
    ]
    .map(|(height, mass, sex, rig)| {
        let person = Person::new(height, mass, sex).body().expect("a person");
        let gear = Gear {
            rig,
            ..Gear::default()
        };
        gear.fit(&person).expect("a rig")
    })
}

fn pose(name: &str) -> &'static Pose {
    POSES.iter().find(|pose| pose.name == name).expect("a pose")
}

#[test]
fn the_air_holds_head_down() {
    let body = person().expect("a person");
    let found = fall(&dynamics(body, LoadModel::FreeFly), pose("head-down"));
    let balance = found.balance_pitch_deg.expect("a balance");
    assert!((balance.abs() - 180.0).abs() < 2.0, "{balance}");
    let grows = |fall: &Fall| fall.modes.iter().any(|mode| mode.growth_per_s > 0.0);
    assert!(!grows(&found), "{found:?}");
    let paper = fall(&dynamics(body, LoadModel::Paper), pose("head-down"));
    assert!(grows(&paper), "{paper:?}");
    for body in people() {
        let dynamics = dynamics(body, LoadModel::FreeFly);
        for damping in [BELLY_TURN_DAMPING, FIRM] {
            let alone = held(&dynamics, pose("head-down"), damping, false);
            println!("head-down, nobody corrects: {alone:.1?}");
            assert!(alone.time >= 60.0 && alone.lean < 15.0, "{alone:?}");
        }
    }
}

#[test]
fn small_corrections_hold_a_sit_that_otherwise_falls_over() {
    for body in people() {
        let dynamics = dynamics(body, LoadModel::FreeFly);
        for damping in [BELLY_TURN_DAMPING, FIRM] {
            let [alone, flown] =
                [false, true].map(|flown| held(&dynamics, pose("sit"), damping, flown));
            println!("sit, nobody corrects: {alone:.1?}\n     a flyer does: {flown:.1?}");
            assert!(alone.time < 15.0, "{alone:?}");
            if damping == FIRM {
                assert!(flown.time >= 60.0 && flown.lean < 10.0, "{flown:?}");
            } else {
                // With low damping, one of the four people oscillates with growing amplitude.
                assert!(flown.time > 8.0 * alone.time, "{flown:?}");
            }
            let down = held(&dynamics, pose("head-down"), damping, true);
            println!("head-down, a flyer corrects: {down:.1?}");
            assert!(down.time >= 60.0 && down.lean < 15.0, "{down:?}");
        }
    }
}

#[test]
fn in_the_paper_s_model_sit_and_head_down_fall_over_despite_corrections() {
    let dynamics = dynamics(person().expect("a person"), LoadModel::Paper);
    for name in ["sit", "head-down"] {
        let flown = held(&dynamics, pose(name), FIRM, true);
        println!("{name}, paper: {flown:.1?}");
        assert!(flown.time < 10.0, "{flown:?}");
    }
}
