//! Channels with faults, one at a time.

use super::*;
use crate::synthetic::{Jump, jump};

const GIVEN: Given = Given {
    places: true,
    velocities: true,
    speeds: false,
};

/// A jump of which each sample is changed; what is found, and the mended samples beside the true ones.
fn changed(change: impl Fn(&mut Sample)) -> (Checked, Vec<Sample>) {
    let flown = jump(&Jump::default());
    let mut samples = flown.clone();
    samples.iter_mut().for_each(change);
    (checked(&samples, GIVEN), flown)
}

fn assert_mended(checked: &Checked, flown: &[Sample], channel: Channel, remedy: Remedy) {
    let [finding] = &checked.findings[..] else {
        panic!("{:?}", checked.findings);
    };
    assert_eq!((finding.channel, finding.remedy), (channel, remedy));
    let off = checked.samples.iter().zip(flown);
    let off = off.map(|(mended, flown)| (mended.velocity - flown.velocity).norm());
    assert!(crate::median(off).unwrap() < 1.5);
}

#[test]
fn a_good_track_is_left_unchanged() {
    let (checked, flown) = changed(|_| {});
    assert_eq!(checked.findings, []);
    assert_eq!(checked.samples, flown);
}

#[test]
fn units_are_recognised_by_the_other_channel() {
    let (checked, flown) = changed(|sample| sample.position.z /= 0.3048);
    assert_mended(&checked, &flown, Channel::Height, Remedy::Converted);
    for factor in [3.6, 1.0 / 0.514_444, 1.0 / 0.447_04] {
        let (checked, flown) = changed(|sample| {
            sample.velocity.x *= factor;
            sample.velocity.y *= factor;
        });
        assert_mended(
            &checked,
            &flown,
            Channel::HorizontalVelocity,
            Remedy::Converted,
        );
        let (checked, flown) = changed(|sample| sample.velocity.z *= factor);
        assert_mended(
            &checked,
            &flown,
            Channel::VerticalVelocity,
            Remedy::Converted,
        );
    }
}

#[test]
fn signs_and_axes_are_recognised() {
    let (checked, flown) = changed(|sample| sample.velocity.z *= -1.0);
    assert_mended(
        &checked,
        &flown,
        Channel::VerticalVelocity,
        Remedy::Converted,
    );
    let (checked, flown) = changed(|sample| sample.velocity.x *= -1.0);
    assert_mended(
        &checked,
        &flown,
        Channel::HorizontalVelocity,
        Remedy::Converted,
    );
    let (checked, flown) = changed(|sample| {
        let [north, west] = [sample.velocity.x, sample.velocity.y];
        (sample.velocity.x, sample.velocity.y) = (-west, -north);
    });
    assert_mended(
        &checked,
        &flown,
        Channel::HorizontalVelocity,
        Remedy::Converted,
    );
    let (checked, flown) = changed(|sample| {
        sample.velocity.x = sample.velocity.x.abs();
        sample.velocity.y = -sample.velocity.y.abs();
    });
    assert_mended(
        &checked,
        &flown,
        Channel::HorizontalVelocity,
        Remedy::NotUsed,
    );
}

#[test]
fn a_receiver_that_repeats_itself_is_not_believed() {
    let flown = jump(&Jump::default());
    for share in [20, 50] {
        let mut samples = flown.clone();
        let place = share * samples.len() / 100;
        let kept = samples[place];
        let until = samples.partition_point(|sample| sample.time < kept.time + 8.0);
        for sample in &mut samples[place..until] {
            *sample = Sample {
                time: sample.time,
                ..kept
            };
        }
        let checked = checked(&samples, GIVEN);
        let [finding] = &checked.findings[..] else {
            panic!("{share}: {:?}", checked.findings);
        };
        assert_eq!(
            (finding.channel, finding.remedy),
            (Channel::Position, Remedy::NotUsed)
        );
        assert_eq!(checked.samples.len(), flown.len() + place + 1 - until);
    }
}

#[test]
fn heights_that_jump_are_joined() {
    let flown = jump(&Jump::default());
    for share in [20, 40, 70] {
        for jump in [-400.0, -40.0, 60.0, 300.0] {
            let mut samples = flown.clone();
            let place = share * samples.len() / 100;
            for sample in &mut samples[place..] {
                sample.position.z += jump;
            }
            let checked = checked(&samples, GIVEN);
            let [finding] = &checked.findings[..] else {
                panic!("{share} {jump}: {:?}", checked.findings);
            };
            assert_eq!(
                (finding.channel, finding.remedy),
                (Channel::Height, Remedy::Converted)
            );
            let time = flown[place].time - flown[0].time;
            let said = format!(" m at {time:.1} s, and the vertical velocities do not");
            assert!(finding.sentence.contains(&said), "{}", finding.sentence);
            let apart = |index: usize| checked.samples[index].height() - flown[index].height();
            assert!((apart(0) - apart(flown.len() - 1)).abs() < 5.0);
        }
    }
    // A single wild row is no jump.
    let mut samples = flown.clone();
    samples[500].position.z += 300.0;
    assert_eq!(checked(&samples, GIVEN).findings, []);
}

#[test]
fn empty_channels_are_replaced() {
    let (checked, flown) = changed(|sample| sample.velocity.z *= 0.02);
    assert_mended(&checked, &flown, Channel::VerticalVelocity, Remedy::NotUsed);
    let (checked, flown) = changed(|sample| sample.position.z = 0.0);
    assert_mended(&checked, &flown, Channel::Height, Remedy::NotUsed);
    let top = checked.samples[0].height();
    assert!((top - 4000.0).abs() < 20.0, "{top}");
    let (checked, flown) = changed(|sample| {
        (sample.velocity.x, sample.velocity.y) = (0.0, 0.0);
    });
    assert_mended(
        &checked,
        &flown,
        Channel::HorizontalVelocity,
        Remedy::NotUsed,
    );
}

#[test]
fn heights_alone_have_no_horizontal_motion() {
    let given = Given {
        places: false,
        velocities: false,
        speeds: false,
    };
    let checked = checked(&jump(&Jump::default()), given);
    assert!(!checked.motion.has_horizontal);
}

/// Two channels of a logger that are further apart than any delay are of different times, and which of them is wrong is not known.
#[test]
fn channels_that_are_later_than_any_logger_are_doubted() {
    for (late, name, other) in [
        (7.0, "vertical velocities", "heights"),
        (20.0, "vertical velocities", "heights"),
        (-12.0, "heights", "vertical velocities"),
    ] {
        let flown = jump(&Jump::default());
        let at = |time: f64| {
            let next = flown.partition_point(|sample| sample.time < time);
            flown[next.min(flown.len() - 1)]
        };
        let shifted = |sample: &Sample| {
            let [place, velocity] =
                [f64::min(late, 0.0), -f64::max(late, 0.0)].map(|by| at(sample.time + by));
            Sample {
                position: place.position,
                velocity: velocity.velocity,
                ..*sample
            }
        };
        let samples: Vec<Sample> = flown.iter().map(shifted).collect();
        let checked = checked(&samples, GIVEN);
        assert!(checked.motion.is_doubted, "{:?}", checked.findings);
        let said = format!("the {name} are {:.1} s later than the {other}", late.abs());
        let is_said = |finding: &Finding| finding.sentence.contains(&said);
        assert!(
            checked.findings.iter().any(is_said),
            "{said}: {:?}",
            checked.findings
        );
    }
}

#[test]
fn positions_that_jump_are_joined() {
    let (checked, flown) = changed(|sample| {
        sample.position.x += if sample.time > 60.0 { 400.0 } else { 0.0 };
    });
    assert_mended(&checked, &flown, Channel::Position, Remedy::Converted);
    let sentence = &checked.findings[0].sentence;
    assert!(sentence.starts_with("the positions jump by "), "{sentence}");
    let first = checked.samples[0].position - flown[0].position;
    assert!((first.x - 400.0).abs() < 15.0, "{first}");
}

#[test]
fn rows_that_come_again_are_doubted() {
    let flown = jump(&Jump::default());
    let mut samples = flown.clone();
    let from = samples.partition_point(|sample| sample.time < 30.0);
    let rows = samples.partition_point(|sample| sample.time < 40.0) - from;
    for place in from..from + rows {
        samples[place + rows] = Sample {
            time: flown[place + rows].time,
            ..flown[place]
        };
    }
    let checked = checked(&samples, GIVEN);
    assert!(checked.motion.is_doubted);
    let said = "s are those from 30.0 s again";
    let is_said = |finding: &Finding| finding.sentence.contains(said);
    assert!(
        checked.findings.iter().any(is_said),
        "{:?}",
        checked.findings
    );
}
