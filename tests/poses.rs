//! Speeds of every pose against published ones: the free-fly model meets them, the paper's only on belly and back.

use bodyflight::verbs::poses::{POSES, best_glide, dynamics, fall, person, table};
use bodyflight_core::aerodynamics::load_model::LoadModel;
use bodyflight_core::body::pattern;
use bodyflight_core::dynamics::trim::trim;

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
fn the_page_has_the_table() {
    let page = include_str!("../docs/poses.md");
    let table = table().expect("a table");
    assert!(page.contains(&table), "docs/poses.md lacks\n{table}");
}
