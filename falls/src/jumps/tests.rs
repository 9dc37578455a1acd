//! Jumps on synthetic tracks.

use super::*;
use crate::phases::divided;
use crate::synthetic::{EXIT, Jump, jump};

fn found(samples: &[Sample]) -> Vec<Found> {
    jumps(samples, &divided(samples, true), Motion::default())
}

#[test]
fn a_jump_is_divided_at_its_true_phases() {
    let slow = Jump {
        rate: 1.0,
        ..Jump::default()
    };
    let head_down = Jump {
        drag: vec![(0.0, 1.0 / 153.0), (15.0, 1.0 / 320.0), (35.0, 1.0 / 150.0)],
        ..Jump::default()
    };
    for (jumped, allowed) in [(Jump::default(), 0.5), (head_down, 0.5), (slow, 1.0)] {
        let found = found(&jump(&jumped));
        let [Found { times, doubt, .. }] = &found[..] else {
            panic!("{found:?}");
        };
        assert_eq!(*doubt, None);
        let off = |time: Option<Boundary>, flown: f64| (time.unwrap().time - flown).abs();
        assert!(off(times.exit, EXIT) < allowed, "{times:?}");
        assert!(
            off(times.opening, EXIT + jumped.opening) < allowed + 0.3,
            "{times:?}"
        );
        let canopy = times.canopy.unwrap().time - EXIT - jumped.opening;
        assert!((1.0..6.0).contains(&canopy), "{times:?}");
        assert!(times.landing.is_some());
    }
}

#[test]
fn a_track_without_a_fall_has_no_jump() {
    let samples = jump(&Jump::default());
    let inside: Vec<Sample> = samples
        .into_iter()
        .filter(|sample| sample.time < EXIT)
        .collect();
    assert_eq!(found(&inside), []);
    assert_eq!(found(&[]), []);
}

#[test]
fn a_track_that_begins_in_the_fall_has_no_exit() {
    let samples = jump(&Jump::default());
    let late: Vec<Sample> = samples
        .into_iter()
        .filter(|sample| sample.time > EXIT + 20.0)
        .collect();
    let found = found(&late);
    assert_eq!(found[0].times.exit, None);
    assert!(found[0].times.opening.is_some());
}

#[test]
fn an_exit_without_a_fix_is_bracketed() {
    for (from, to) in [(-9.0, 6.0), (-1.0, 2.0), (-20.0, 12.0)] {
        let mut samples = jump(&Jump::default());
        samples.retain(|sample| !(EXIT + from..EXIT + to).contains(&sample.time));
        let found = found(&samples);
        let exit = found[0].times.exit.unwrap();
        assert!((exit.time - EXIT).abs() < 3.0 * exit.deviation, "{exit:?}");
        assert!(exit.deviation < 1.0, "{exit:?}");
    }
}

#[test]
fn each_of_two_jumps_has_its_own_part_of_the_track() {
    let mut samples = jump(&Jump::default());
    let last = samples.last().unwrap().time;
    let climb = (0..3000).map(|step| {
        let since = f64::from(step) * 0.2;
        Sample {
            time: last + 1.0 + since,
            position: nalgebra::Vector3::new(0.0, 0.0, (since * 7.0).min(4000.0)),
            velocity: nalgebra::Vector3::new(
                30.0,
                30.0,
                if since * 7.0 < 4000.0 { 7.0 } else { 0.0 },
            ),
        }
    });
    let again = jump(&Jump::default()).into_iter().map(|sample| Sample {
        time: sample.time + last + 602.0,
        ..sample
    });
    let climb: Vec<Sample> = climb.collect();
    samples.extend(climb);
    samples.extend(again);
    let found = found(&samples);
    assert_eq!(found.len(), 2, "{found:?}");
    assert_eq!(found[0].samples[1], found[1].samples[0]);
    let exit = found[1].times.exit.unwrap().time;
    assert!((exit - last - 602.0 - EXIT).abs() < 0.5, "{exit}");
}
