//! A unit that no host ever greeted: power, a sensor's bytes, a receiver's.

use bodyflight_core::estimator::unit_preset::UnitPreset;
use bodyflight_core::link::{LimbTable, SensorKind, Setup};
use bodyflight_core::xbus::DataId;

use super::*;
use crate::test_line::{ATTITUDE, counted_packet, solution};

pub(super) fn setup() -> Setup {
    let configure = configure();
    let muscles = *UnitPreset::of(0).unwrap().muscles();
    let preset = UnitPreset::number("auto", &muscles).unwrap();
    Setup {
        configure: Configure {
            preset: u16::try_from(preset).unwrap(),
            ..configure
        },
        table: table(),
        limbs: LimbTable::new(),
    }
}

/// The packet of a sensor for a sample of the test's flight, with the sensor's clock at `ticks`.
fn packet(counter: u16, ticks: u32, sample: &Sample) -> Vec<u8> {
    let attitude = sample.inertial_from_body().wxyz();
    let turn = sample.motion().angular_velocity.unwrap().to_array();
    let items: [(DataId, &[f32]); 2] = [(ATTITUDE, &attitude), (DataId::RATE_OF_TURN, &turn)];
    counted_packet(counter, ticks, &items)
}

/// Feeds samples `range` of the flight with the sensor's clock beginning at `ticks`; returns the estimates.
fn fly(unit: &mut Unit<Bench>, flight: &[Sample], ticks: u32) -> Vec<Estimate> {
    let mut found = Vec::new();
    for (k, sample) in (0_u16..).zip(flight) {
        unit.board
            .now
            .set(u64::from(k) * 1_000_000 / 240 + 1_000_000);
        let ticks = ticks + u32::from(k) * 10_000 / 240;
        unit.receive_sensor(&packet(k, ticks, sample));
        // The solution describes the instant of 24 samples ago, and says so by its configured latency of 0.1 s.
        if let Some(old) = flight
            .get(usize::from(k).wrapping_sub(24))
            .filter(|_| k % 48 == 24)
        {
            let velocity = old.motion().velocity.unwrap().to_array();
            unit.receive_sensor(&solution(velocity, 0.3));
        }
        while unit.work() {}
        found.extend(estimates(&heard(unit)));
    }
    found
}

#[test]
fn a_stored_configuration_and_a_sensor_are_all_it_needs() {
    let mut unit = unit();
    assert!(unit.resume(&setup()));
    let flight = samples(1200);
    let found = fly(&mut unit, &flight, 0);
    let status = unit.status();
    assert_eq!(
        (status.sensor_samples, status.receiver_solutions),
        (1200, 25)
    );
    assert_eq!(
        (status.used, status.missing, status.estimates_bad),
        (1200, 0, 0)
    );
    assert!(found.len() > 230, "{}", found.len());
    let last = found.last().unwrap();
    assert!(
        last.flags
            .contains(EstimateFlags::MOTION | EstimateFlags::VALID)
    );
    // The same model flies here, in another posture than the H-pose that the unit assumes. Within three standard
    // deviations of the receiver, 0.45 m/s vertically.
    let truth = flight[1199].motion().velocity.unwrap().to_array();
    for (found, expected) in last.velocity.iter().zip(truth) {
        assert!(
            (found - expected).abs() < 1.5,
            "{:?} {truth:?}",
            last.velocity
        );
    }
    let attitude = last.inertial_from_body.unpack();
    let turn = attitude.angle_to(flight[1199].inertial_from_body().quaternion());
    assert!(turn < 0.1, "{turn}");
}

/// The sensor had been up for 40 minutes when it restarted: before, 240 000 samples were refused.
#[test]
fn a_restart_of_the_sensor_does_not_silence_the_unit() {
    let mut unit = unit();
    assert!(unit.resume(&setup()));
    let flight = samples(480);
    fly(&mut unit, &flight, 24_000_000);
    let after = fly(&mut unit, &flight, 0);
    assert!(after.len() > 80, "{}", after.len());
    let status = unit.status();
    assert_eq!((status.sensor_restarts, status.missing), (1, 0));
    assert!(status.used > 955, "{}", status.used);
}

#[test]
fn a_configuration_that_is_not_usable_leaves_the_unit_waiting_for_a_host() {
    let mut unit = unit();
    let mut setup = setup();
    setup.configure.preset = 999;
    assert!(!unit.resume(&setup));
    fly(&mut unit, &samples(48), 0);
    assert_eq!(unit.status().used, 0);
    tell(&mut unit, SESSION, hello());
    tell(&mut unit, SESSION, configure());
    let answers = heard(&mut unit);
    assert!(
        matches!(answers.last(), Some((_, Message::Configured(answer))) if answer.verdict == Verdict::Accepted),
        "{answers:?}"
    );
}

/// A sensor that falls silent gets one reset of the chip; a unit that never heard one is left alone.
#[test]
fn a_dead_receiver_is_seen_once() {
    let mut unit = unit();
    assert!(unit.resume(&setup()));
    let fed = |unit: &mut Unit<Bench>, seconds: u64| {
        let before = unit.board.fed.get();
        for beat in 0..seconds * 4 {
            unit.board
                .now
                .set(unit.board.now.get() + 250_000 * u64::from(beat > 0));
            unit.feed_watchdog();
        }
        unit.board.fed.get() - before
    };
    assert_eq!(fed(&mut unit, 10), 40);
    fly(&mut unit, &samples(48), 0);
    assert!(fed(&mut unit, 10) < 14);
    assert_eq!(unit.status().sensor_silences, 1);
    // A host that talks, for example to read the log after the flight, is not interrupted.
    tell(&mut unit, SESSION, hello());
    assert_eq!(fed(&mut unit, 9), 36);
    assert!(fed(&mut unit, 10) < 14);
}

#[test]
fn without_storage_a_request_to_store_says_so() {
    use bodyflight_core::link::{SetupAction, SetupAsk, SetupState, Stored};
    let mut unit = running(StreamMode::Paced);
    heard(&mut unit);
    let action = SetupAction::Store;
    tell(&mut unit, SESSION, SetupAsk { action });
    let [(_, Message::Stored(Stored { state, .. }))] = heard(&mut unit)[..] else {
        panic!("no answer");
    };
    assert_eq!(state, SetupState::NoStorage);
}

#[test]
fn the_line_of_the_sensor_has_the_rate_of_its_kind() {
    let mut unit = unit();
    let mut rate_with = |sensor| {
        let mut setup = setup();
        setup.configure.sensor = sensor;
        assert!(unit.resume(&setup));
        unit.board.rate.take()
    };
    // As it is from the start.
    assert_eq!(rate_with(SensorKind::Xbus), None);
    assert_eq!(rate_with(SensorKind::Bno08xRvc), Some(115_200));
    assert_eq!(rate_with(SensorKind::Bno08xRvc), None);
    assert_eq!(rate_with(SensorKind::Xbus), Some(460_800));
}
