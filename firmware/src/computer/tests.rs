//! The computer gives the same estimates as the filter alone, and reports bridged samples.

use std::vec::Vec;

use bodyflight_core::aerodynamics::ArchFactor;
use bodyflight_core::estimator::ReducedFilter;
use bodyflight_core::estimator::measurement::Measurement;
use bodyflight_core::estimator::preset::TRACKING_ON_BACK;
use bodyflight_core::link::ArchSource;

use super::*;
use crate::test_flight::{body, configure, samples, table, time};

fn computer() -> Computer {
    let mut computer = Computer::new();
    computer.configure(Configuration::new(&configure(), &table()).unwrap());
    computer
}

fn answers(computer: &mut Computer, sent: &[(u32, Sample)]) -> Vec<link::Estimate> {
    sent.iter()
        .filter_map(|(k, sample)| match computer.sample(*k, time(*k), sample) {
            Outcome::Used(answer) => answer,
            Outcome::Rejected => panic!("sample {k} was rejected"),
        })
        .collect()
}

fn numbered(samples: &[Sample]) -> Vec<(u32, Sample)> {
    (0..).zip(samples.iter().copied()).collect()
}

#[test]
fn complete_samples_give_the_estimator_s_results() {
    let samples = samples(240);
    let found = answers(&mut computer(), &numbered(&samples));

    let dynamics = Dynamics {
        muscles: TRACKING_ON_BACK.muscles,
        ..Dynamics::paper(body(), 1.0)
    };
    let [first, rest @ ..] = samples.as_slice() else {
        panic!("no samples");
    };
    let start = motion_of(first, Vector::zero());
    let mut filter =
        ReducedFilter::<f32>::new(&TRACKING_ON_BACK, &dynamics, &start, &first.posture()).unwrap();
    let expected = rest.iter().filter_map(|sample| {
        let seen = Measurement::of(&motion_of(sample, Vector::zero()));
        filter.push(&sample.posture(), &seen)
    });
    let expected: Vec<_> = expected.collect();
    assert_eq!(found.len(), expected.len());
    assert!(found.len() > 40);
    for (found, expected) in found.iter().zip(&expected) {
        let bits = |state: [f32; 6]| state.map(f32::to_bits);
        assert_eq!(bits(found.state), bits(expected.state.into()));
        assert_eq!(
            found.nis.to_bits(),
            expected.normalised_innovation.to_bits()
        );
        assert!(found.flags.contains(EstimateFlags::VALID));
    }
    assert!(found[0].flags.contains(EstimateFlags::RESTARTED));
    assert!(!found[1].flags.contains(EstimateFlags::RESTARTED));
}

#[test]
fn nothing_is_computed_before_the_request_is_valid() {
    let samples = samples(2);
    assert_eq!(Computer::new().sample(0, 0, &samples[0]), Outcome::Rejected);
    let nothing = Sample {
        valid: Validity::default(),
        ..samples[0]
    };
    let mut computer = computer();
    assert_eq!(computer.sample(0, 0, &nothing), Outcome::Rejected);
    assert_eq!(computer.sample(1, 0, &samples[0]), Outcome::Used(None));
    // Time does not advance, or goes back.
    assert_eq!(computer.sample(2, 0, &samples[1]), Outcome::Rejected);
    assert_eq!(
        computer.sample(3, time(1), &samples[1]),
        Outcome::Used(None)
    );
    assert_eq!(computer.sample(4, 0, &samples[1]), Outcome::Rejected);
}

#[test]
fn missing_samples_are_bridged_and_reported() {
    let samples = samples(480);
    let whole = answers(&mut computer(), &numbered(&samples));
    let lossy: Vec<_> = numbered(&samples)
        .into_iter()
        .filter(|(k, _)| k % 23 != 5)
        .collect();
    let bridged = answers(&mut computer(), &lossy);
    let told = |answer: &&link::Estimate| answer.flags.contains(EstimateFlags::BRIDGED);
    assert_eq!(whole.iter().filter(told).count(), 0);
    assert!(bridged.iter().filter(told).count() > 10);
    // Close to the estimates from the complete flight, in deviations.
    let (a, b) = (whole.last().unwrap(), bridged.last().unwrap());
    for i in 0..6 {
        let apart = (a.state[i] - b.state[i]).abs() / a.variance[i].sqrt();
        assert!(apart < 0.5, "state {i}: {apart} deviations");
    }
}

#[test]
fn a_long_gap_restarts_the_motion_and_keeps_the_coefficients() {
    let samples = samples(480);
    let mut computer = computer();
    let all = numbered(&samples);
    let before = answers(&mut computer, &all[..200]);
    let after = answers(&mut computer, &all[260..]);
    assert!(after[0].flags.contains(EstimateFlags::RESTARTED));
    assert_eq!(after[0].sample_sequence, 260 + 60);
    let moved = (after[0].state[0] - before.last().unwrap().state[0]).abs();
    assert!(moved < 0.5, "{moved}");
}

#[test]
fn rates_that_do_not_fit_are_refused() {
    let refused = |sample_rate, update_rate| {
        let asked = Configure {
            sample_rate,
            update_rate,
            ..configure()
        };
        Configuration::new(&asked, &table()).err()
    };
    assert_eq!(refused(240.0, 60.0), None);
    assert_eq!(refused(240.0, 120.0), None);
    assert_eq!(refused(120.0, 30.0), None);
    for (sample_rate, update_rate) in [
        (240.0, 240.0), // one sample: half an interval
        (240.0, 80.0),  // three
        (240.0, 70.0),
        (240.0, 2.0), // longer than the window
        (30.0, 15.0), // intervals too long
        (1.0, 2000.0),
        (2000.0, 1.0),
    ] {
        let verdict = refused(sample_rate, update_rate);
        assert_eq!(
            verdict,
            Some(Verdict::UnusableRates),
            "{sample_rate} {update_rate}"
        );
    }
    let asked = Configure {
        preset: 999,
        ..configure()
    };
    let verdict = Configuration::new(&asked, &table()).err();
    assert_eq!(verdict, Some(Verdict::UnknownPreset));
}

#[test]
fn the_unit_flies_the_model_that_was_sent() {
    let mut dynamics = Dynamics {
        muscles: TRACKING_ON_BACK.muscles,
        ..Dynamics::paper(body(), 0.9)
    };
    dynamics.air.velocity = Vector::new(3.0, -2.0, 0.5);
    dynamics.aerodynamics.coefficients[bodyflight_core::Segment::LeftThigh].lift = 2.5;
    for (arch_source, arch) in [
        (ArchSource::Posture, ArchFactor::FromPosture),
        (ArchSource::Scaled, ArchFactor::Scaled(1.5)),
        (ArchSource::Fixed, ArchFactor::Fixed(1.5)),
    ] {
        dynamics.aerodynamics.arch = arch;
        let table = SegmentTable::of(&dynamics.body, &dynamics.aerodynamics);
        let asked = Configure {
            air_density: 0.9,
            air_velocity: [3.0, -2.0, 0.5],
            arch_source,
            arch: 1.5,
            table_digest: table.digest(),
            ..configure()
        };
        let found = Configuration::new(&asked, &table).unwrap();
        assert_eq!(found.dynamics, dynamics);
    }
}

#[test]
fn the_same_configuration_does_not_disturb() {
    let samples = samples(200);
    let mut once = computer();
    let mut twice = computer();
    let all = numbered(&samples);
    let mut found = answers(&mut twice, &all[..100]);
    twice.configure(Configuration::new(&configure(), &table()).unwrap());
    found.extend(answers(&mut twice, &all[100..]));
    assert_eq!(found, answers(&mut once, &all));
}

/// A speed that nobody has is rejected; the light does not say that the filter has failed.
#[test]
fn a_rejected_channel_is_no_fault_of_the_filter() {
    let muscles = *UnitPreset::of(0).unwrap().muscles();
    let preset = UnitPreset::number("auto", &muscles).unwrap();
    let asked = Configure {
        preset: u16::try_from(preset).unwrap(),
        ..configure()
    };
    let mut computer = Computer::new();
    computer.configure(Configuration::new(&asked, &table()).unwrap());
    let mut flight = samples(480);
    for (k, sample) in flight.iter_mut().enumerate().skip(240) {
        if k % 40 < 2 {
            let seen = link::Motion {
                velocity: Some(Vector::new(120.0, 120.0, -120.0)),
                ..sample.motion()
            };
            *sample = Sample::new(&sample.posture(), &sample.inertial_from_body(), &seen);
        }
    }
    let found = answers(&mut computer, &numbered(&flight));
    assert!(found.len() > 110);
    for answer in found {
        assert!(!answer.flags.contains(EstimateFlags::FAULT));
    }
}
