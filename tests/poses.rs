//! Speeds of every pose against published ones: the free-fly model meets them, the paper's only on belly and back.

use core::f64::consts::PI;

use bodyflight::verbs::poses::{
    DENSITY, FIRM, POSES, best_glide, dynamics, fall, modes_table, person, table,
};
use bodyflight_core::Segment;
use bodyflight_core::aerodynamics::load_model::LoadModel;
use bodyflight_core::body::pattern::{self, JointAngles};
use bodyflight_core::dynamics::steady::steady;
use bodyflight_core::dynamics::step::TIME_STEP;
use bodyflight_core::dynamics::trim::trim;
use bodyflight_core::dynamics::{Dynamics, Inputs, State};

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

const THIGHS: &JointAngles = &[
    (Segment::LeftThigh, [0.0, 0.0, 1.0]),
    (Segment::RightThigh, [0.0, 0.0, 1.0]),
];

/// Seconds, at most 20, for which a flyer holds a pose within 40 degrees: arms sway by 0.02 rad, and one pair of limbs answers the
/// tilt of 0.2 s ago and its rate, by at most 0.35 rad.
fn held(
    dynamics: &Dynamics<f64>,
    pose: (&JointAngles, f64),
    limbs: &JointAngles,
    gain: f64,
    lead: f64,
) -> f64 {
    let (angles, pitch) = pose;
    let inputs = Inputs {
        damping: FIRM,
        ..Inputs::belly_turn()
    };
    let base = pattern::posture(angles);
    let Some(balance) = steady(dynamics, &base, &inputs, pitch, DENSITY) else {
        return 0.0;
    };
    let upright = balance.motion.inertial_from_body.quaternion().inverse();
    let mut state = State::from_motion(&balance.motion, &dynamics.hold(&base));
    let (mut seen, mut before, mut answer) = (Vec::<(f64, f64)>::new(), base, 0.0);
    for step in 0..4800 {
        let time = f64::from(step) * TIME_STEP;
        let (tilt, rate) = seen.iter().rev().nth(47).copied().unwrap_or_default();
        let asked = (gain * (tilt + lead * rate)).clamp(-0.35, 0.35);
        answer += (asked - answer) * TIME_STEP / 0.15;
        let sway = 0.012 * (1.7 * time).sin() + 0.008 * (4.1 * time).sin();
        let posture = pattern::moved(&base, limbs, answer);
        let posture = pattern::moved(&posture, pattern::ARMS_DOWN, sway);
        let sample = dynamics.between(&before, &posture, TIME_STEP);
        state = dynamics.step(&state, &sample, &inputs, TIME_STEP);
        before = posture;
        let motion = state.motion(&sample);
        let tilt = (upright * motion.inertial_from_body.quaternion())
            .scaled_axis()
            .x;
        if tilt.abs() > 0.7 {
            return time;
        }
        seen.push((tilt, motion.angular_velocity.components.x));
    }
    20.0
}

#[test]
fn small_corrections_hold_a_sit_and_keep_head_down_longer() {
    let body = person().expect("a person");
    let longest = |pose: (&JointAngles, f64), model: LoadModel| {
        let dynamics = dynamics(body, model);
        let mut best = 0.0f64;
        for limbs in [pattern::ARMS_DOWN, THIGHS] {
            for gain in [-4.0, -2.0, -1.0, 1.0, 2.0, 4.0] {
                for lead in [0.1, 0.25, 1.0] {
                    best = best.max(held(&dynamics, pose, limbs, gain, lead));
                }
            }
        }
        println!("{}: {best:.1} s", model.name());
        best
    };
    assert!(longest((pattern::SIT, 0.0), LoadModel::FreeFly) >= 20.0);
    let [paper, free] = [LoadModel::Paper, LoadModel::FreeFly]
        .map(|model| longest((pattern::HEAD_DOWN, PI), model));
    assert!(paper < 4.0 && free > 1.5 * paper);
}
