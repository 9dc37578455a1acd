//! The boundary between decaying and growing pitch oscillations in belly flight: eigenvalues, compared with free runs.

use std::path::Path;

use bodyflight_core::dynamics::Dynamics;
use bodyflight_replay::flight::Flight;
use bodyflight_replay::subject::Subject;
use bodyflight_verbs::bifurcation::{self, growth_of_run, map, oscillation};

/// Damping at which the oscillation neither grows nor decays, interpolated between no damping and a damping of one.
fn threshold(dynamics: &Dynamics<f64>, arms: f64) -> f64 {
    let growth = |damping: f64| {
        let point = oscillation(dynamics, arms, damping).expect("an oscillation");
        point.growth_per_s
    };
    let (low, high) = (growth(0.0), growth(1.0));
    assert!(low > 0.0 && high < 0.0, "{arms}: {low} {high}");
    low / (low - high)
}

#[test]
fn damping_decides_and_lowered_arms_push_it_over_the_edge() {
    let dynamics = Flight::bare(Path::new("")).dynamics(0.0);
    let [raised, neutral, lowered, far] =
        [-0.4, 0.0, 0.25, 0.8].map(|arms| threshold(&dynamics, arms));
    println!(
        "thresholds: arms raised {raised:.3}, neutral {neutral:.3}, lowered {lowered:.3}, far {far:.3}"
    );
    // As in the paper: at some damping the neutral pose is stable and lowered arms make it oscillate.
    assert!(neutral + 0.01 < lowered);
    // Unlike in the paper, the window is narrow, and arms far down are stable again.
    assert!(lowered - neutral < 0.05 && far < neutral && raised < neutral);
    // The paper's damping of belly turns is far from the threshold.
    assert!(
        map(&dynamics)
            .iter()
            .all(|point| point.damping < 2.9 || point.growth_per_s < -0.9)
    );
}

#[test]
fn free_runs_grow_as_eigenvalues_say() {
    let dynamics = Flight::bare(Path::new("")).dynamics(0.0);
    for (arms, damping) in [(0.0, 0.5), (0.0, 3.0), (0.5, 0.5), (0.5, 1.0), (-0.3, 0.5)] {
        let mode = oscillation(&dynamics, arms, damping).expect("an oscillation");
        let run = growth_of_run(&dynamics, arms, damping, 1e-4, 6.0).expect("a run");
        println!("{mode:.3?} run {run:.3}");
        assert!((mode.growth_per_s - run).abs() < 0.03, "{mode:?} {run}");
    }
}

#[test]
fn an_arched_body_is_still_at_small_damping_until_its_arms_go_down() {
    let dynamics = Flight::bare(Path::new("")).dynamics(0.0);
    let threshold =
        |arms: f64| bifurcation::threshold(&dynamics, 0.2, arms).expect("a damping that decides");
    let [still, rocking] = [threshold(0.0), threshold(0.4)];
    println!("arched: neutral {still:.3}, arms down {rocking:.3}");
    // Between the two thresholds, the pose behaves as in the paper at any damping.
    assert!(still + 0.03 < rocking);
}

/// Paper "Insight into the Aerodynamic Model": in clown shoes a skydiver is unstable. The model's neutral fall is not: the
/// damping in pitch that it needs hardly depends on the shoes.
#[test]
fn larger_shoes_need_no_more_damping() {
    let threshold = |size: f64| {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("subject.toml");
        let text = format!(
            "height_m = 1.75\nmass_kg = 75\nsex = \"male\"\n[gear]\nshoe_size_eu = {size:.1}\n"
        );
        std::fs::write(&path, text).expect("a file");
        let flight = Flight {
            subject: Subject::read(&path).expect("a subject"),
            ..Flight::bare(Path::new(""))
        };
        bifurcation::threshold(&flight.dynamics(0.0), 0.0, 0.0).expect("a damping that decides")
    };
    let [small, large, clown] = [36.0, 44.0, 52.0].map(threshold);
    println!("shoes of size 36: {small:.3}, 44: {large:.3}, 52: {clown:.3}");
    assert!(small > large && large > clown && small - clown < 0.03);
}
