//! Tests of the protocol, in virtual time.

mod alone;
mod bench;
mod credit;
mod raw;

use core::cell::Cell;
use std::vec::Vec;

use bodyflight_core::Segment;
use bodyflight_core::link::{
    Configure, Configured, Credit, Estimate, EstimateFlags, ResetFilter, Sample, Start, Stop,
    Verdict,
};
use proptest::prelude::*;

use super::*;
use crate::board::Identity;
use crate::test_flight::{configure, samples, table, time};
use bench::Bench;

fn unit() -> Unit<Bench> {
    let bench = Bench {
        now: Cell::new(0),
        step: 10,
        fed: Cell::new(0),
        rate: Cell::new(None),
    };
    Unit::new(bench, Identity::default())
}

const SESSION: u16 = 77;

fn tell(unit: &mut Unit<Bench>, session: u16, message: impl Into<Message>) {
    tell_numbered(unit, session, 0, 0, message);
}

fn tell_numbered(
    unit: &mut Unit<Bench>,
    session: u16,
    sequence: u32,
    time: u64,
    message: impl Into<Message>,
) {
    let header = Header {
        session,
        sequence,
        time,
    };
    let mut frame = [0; MAX_FRAME_LENGTH];
    let length = message.into().encode(&header, &mut frame).unwrap();
    unit.receive(&frame[..length]);
}

fn heard(unit: &mut Unit<Bench>) -> Vec<(Header, Message)> {
    let mut frame = [0; MAX_FRAME_LENGTH];
    let mut messages = Vec::new();
    while let Some(length) = unit.transmit(&mut frame) {
        messages.push(Message::decode(&frame[..length]).unwrap());
    }
    messages
}

fn hello() -> Hello {
    Hello {
        schema_hash: SCHEMA_HASH,
        max_frame_length: 200,
    }
}

/// A unit in a running session.
fn running(mode: StreamMode) -> Unit<Bench> {
    let mut unit = unit();
    tell(&mut unit, SESSION, hello());
    tell(&mut unit, SESSION, configure());
    for row in table().rows() {
        tell(&mut unit, SESSION, *row);
    }
    let verdicts = heard(&mut unit);
    let last = verdicts.last().unwrap();
    assert!(
        matches!(
            last.1,
            Message::Configured(Configured {
                verdict: Verdict::Accepted,
                ..
            })
        ),
        "{last:?}"
    );
    tell(&mut unit, SESSION, Start { mode });
    unit
}

fn estimates(messages: &[(Header, Message)]) -> Vec<Estimate> {
    let estimate = |(_, message): &(Header, Message)| match message {
        Message::Estimate(estimate) => Some(*estimate),
        _ => None,
    };
    messages.iter().filter_map(estimate).collect()
}

#[test]
fn nothing_is_served_before_the_greeting() {
    let mut unit = unit();
    tell(&mut unit, SESSION, configure());
    tell(
        &mut unit,
        SESSION,
        Start {
            mode: StreamMode::Paced,
        },
    );
    assert_eq!(heard(&mut unit), []);
    let other = Hello {
        schema_hash: SCHEMA_HASH ^ 1,
        ..hello()
    };
    tell(&mut unit, SESSION, other);
    let answers = heard(&mut unit);
    assert!(matches!(answers[..], [(_, Message::HelloAcknowledge(_))]));
    tell(&mut unit, SESSION, configure());
    assert_eq!(heard(&mut unit), []);
    tell(&mut unit, SESSION, hello());
    tell(&mut unit, SESSION, configure());
    assert_eq!(heard(&mut unit).len(), 2);
}

#[test]
fn a_start_without_a_configuration_says_what_is_missing() {
    let mut unit = unit();
    tell(&mut unit, SESSION, hello());
    tell(&mut unit, SESSION, configure());
    heard(&mut unit);
    tell(
        &mut unit,
        SESSION,
        Start {
            mode: StreamMode::Paced,
        },
    );
    let answers = heard(&mut unit);
    let [(_, Message::Configured(answer))] = answers[..] else {
        panic!("{answers:?}");
    };
    assert_eq!((answer.verdict, answer.segments), (Verdict::Incomplete, 0));
}

#[test]
fn samples_yield_estimates_and_each_is_accounted_for() {
    let mut unit = running(StreamMode::Paced);
    let [(header, Message::Status(_))] = heard(&mut unit)[..] else {
        panic!("a start is answered by the status");
    };
    assert_eq!(header.session, SESSION);
    let samples = samples(200);
    let mut found = Vec::new();
    for (k, sample) in (0..).zip(&samples) {
        tell_numbered(&mut unit, SESSION, k, time(k), *sample);
        while unit.work() {}
        found.extend(heard(&mut unit));
    }
    let found = estimates(&found);
    assert_eq!(found.len(), 35);
    assert!(
        found
            .iter()
            .all(|e| e.cycles == 0 && !e.flags.contains(EstimateFlags::LATE))
    );
    tell(&mut unit, SESSION, Stop { sent: 201 });
    let [(_, Message::Status(status))] = heard(&mut unit)[..] else {
        panic!("an end is answered by the status");
    };
    assert_eq!((status.used, status.missing, status.rejected), (200, 1, 0));
    assert_eq!(
        (status.stack_free, status.uart_overrun, status.uart_framing),
        (1234, 3, 4)
    );
    assert_eq!((status.sensor_overrun, status.sensor_framing), (5, 6));
    // The session is over.
    tell_numbered(&mut unit, SESSION, 201, time(201), samples[0]);
    unit.report();
    let [(_, Message::Status(status))] = heard(&mut unit)[..] else {
        panic!("no status");
    };
    assert_eq!(status.wrong_session, 1);
}

#[test]
fn an_overrun_drops_the_oldest_and_is_counted() {
    let mut unit = running(StreamMode::Paced);
    for (k, sample) in (0..).zip(&samples(50)) {
        tell_numbered(&mut unit, SESSION, k, time(k), *sample);
    }
    tell(&mut unit, SESSION, Stop { sent: 50 });
    let waiting = u32::from(SAMPLES);
    assert_eq!(unit.status().dropped_oldest, 50 - waiting);
    while unit.work() {}
    let status = unit.status();
    assert_eq!(status.used + status.dropped_oldest, 50);
    assert_eq!(status.queue_high_water, waiting);
    // The end is reported when all samples are processed.
    let last = heard(&mut unit).pop().unwrap().1;
    assert!(matches!(last, Message::Status(end) if end.used == status.used));
}

#[test]
fn a_slow_update_is_late_and_reported() {
    let mut unit = running(StreamMode::Paced);
    unit.board.step = 20_000;
    let mut found = Vec::new();
    for (k, sample) in (0..).zip(&samples(80)) {
        tell_numbered(&mut unit, SESSION, k, time(k), *sample);
        while unit.work() {}
        found.extend(heard(&mut unit));
    }
    let found = estimates(&found);
    assert!(!found.is_empty());
    assert!(found.iter().all(|e| e.flags.contains(EstimateFlags::LATE)));
    assert_eq!(unit.status().deadline_missed as usize, found.len());
}

#[test]
fn a_host_that_does_not_read_never_stops_the_unit() {
    let mut unit = running(StreamMode::Paced);
    for (k, sample) in (0..).zip(&samples(400)) {
        tell_numbered(&mut unit, SESSION, k, time(k), *sample);
        while unit.work() {}
    }
    let status = unit.status();
    assert_eq!(status.used, 400);
    assert!(status.transmit_dropped > 40);
    // The newest samples are queued.
    let last = estimates(&heard(&mut unit)).last().unwrap().sample_sequence;
    assert!(last > 390);
}

#[test]
fn commands_may_be_repeated() {
    let mut unit = running(StreamMode::Paced);
    let samples = samples(120);
    for (k, sample) in (0..).zip(&samples) {
        tell_numbered(&mut unit, SESSION, k, time(k), *sample);
        // A host that has lost its answers asks again during the stream.
        tell(&mut unit, SESSION, hello());
        tell(&mut unit, SESSION, configure());
        tell(
            &mut unit,
            SESSION,
            Start {
                mode: StreamMode::Paced,
            },
        );
        while unit.work() {}
        heard(&mut unit);
    }
    assert_eq!(unit.status().used, 120);
    assert_eq!(unit.status().rejected, 0);
    tell(&mut unit, SESSION, ResetFilter {});
    tell_numbered(&mut unit, SESSION, 120, time(120), samples[119]);
    while unit.work() {}
    assert_eq!(unit.status().used, 121);
    // Another session starts from scratch.
    tell(
        &mut unit,
        SESSION + 1,
        Start {
            mode: StreamMode::Paced,
        },
    );
    assert_eq!(unit.status().used, 0);
}

#[test]
fn clocks_are_compared() {
    let mut unit = running(StreamMode::Paced);
    heard(&mut unit);
    let question = TimeSync {
        asked: 5,
        received: 0,
        answered: 0,
    };
    tell(&mut unit, SESSION, question);
    let [(_, Message::TimeSync(answer))] = heard(&mut unit)[..] else {
        panic!("no answer");
    };
    assert_eq!(answer.asked, 5);
    assert!(answer.received > 0 && answer.answered > answer.received);
}

#[test]
fn a_sensor_on_its_own_port_feeds_the_filter() {
    use bodyflight_core::xbus::{CoordinateSystem, DataId, MessageId, NumberFormat, PacketWriter};
    let mut unit = running(StreamMode::Sensor);
    let samples = samples(120);
    for (k, sample) in (0u16..).zip(&samples) {
        // The host sets the posture occasionally.
        if k % 24 == 0 {
            tell_numbered(&mut unit, SESSION, u32::from(k / 24), 0, *sample);
        }
        let mut packet = [0; 128];
        let [w, x, y, z] = sample.inertial_from_body().wxyz();
        let north_west_up =
            |id: DataId| id.with(CoordinateSystem::NorthWestUp, NumberFormat::Float32);
        let turn = sample.motion().angular_velocity.unwrap().components;
        let velocity = sample.motion().velocity.unwrap().components;
        let mut writer = PacketWriter::new(&mut packet, MessageId::MT_DATA2);
        writer
            .item(
                DataId::PACKET_COUNTER,
                &(k.wrapping_add(65_500)).to_be_bytes(),
            )
            .unwrap();
        let fine = u32::try_from(time(u32::from(k)) / 100).unwrap();
        writer
            .item(DataId::SAMPLE_TIME_FINE, &fine.to_be_bytes())
            .unwrap();
        writer
            .reals(north_west_up(DataId::QUATERNION), &[w, x, y, z])
            .unwrap();
        writer.reals(DataId::RATE_OF_TURN, turn.as_slice()).unwrap();
        writer
            .reals(north_west_up(DataId::VELOCITY_XYZ), velocity.as_slice())
            .unwrap();
        let length = writer.finish().unwrap();
        unit.receive_sensor(&packet[..length]);
        while unit.work() {}
    }
    let status = unit.status();
    assert_eq!((status.used, status.missing, status.rejected), (120, 0, 0));
    let found = estimates(&heard(&mut unit));
    assert!(
        found.last().unwrap().flags.contains(EstimateFlags::VALID),
        "{found:?}"
    );
    assert_eq!(found.last().unwrap().sample_sequence, 116);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn it_still_answers_after_arbitrary_bytes(
        garbage in prop::collection::vec(any::<u8>(), 0..4000),
        cut in 0usize..100,
    ) {
        let mut unit = running(StreamMode::Paced);
        unit.receive(&garbage);
        let mut frame = [0; MAX_FRAME_LENGTH];
        let row = *table().rows().find(|row| row.segment == Segment::Head).unwrap();
        let length = Message::from(row).encode(&Header::default(), &mut frame).unwrap();
        unit.receive(&frame[..cut.min(length)]);
        while unit.work() {}
        heard(&mut unit);
        tell(&mut unit, SESSION, hello());
        // The frame may have lacked only its delimiter, which the greeting supplies.
        let last = heard(&mut unit).pop();
        prop_assert!(matches!(last, Some((_, Message::HelloAcknowledge(_)))), "{last:?}");
    }

    #[test]
    fn it_still_answers_after_any_message(
        codes in prop::collection::vec((0u8..16, any::<u16>(), any::<u32>(), any::<u64>()), 1..200),
    ) {
        let mut unit = running(StreamMode::Paced);
        let samples = samples(16);
        for (kind, session, sequence, time) in codes {
            let session = if session & 1 == 0 { SESSION } else { session };
            let message: Message = match kind {
                0 => Stop { sent: sequence }.into(),
                1 => Start { mode: StreamMode::Credit }.into(),
                2 => Start { mode: StreamMode::Sensor }.into(),
                3 => ResetFilter {}.into(),
                4 => Configure { preset: session, ..configure() }.into(),
                5 => Credit { granted: sequence }.into(),
                6 => Start { mode: StreamMode::Paced }.into(),
                k => samples[usize::from(k)].into(),
            };
            tell_numbered(&mut unit, session, sequence, time, message);
            unit.work();
        }
        heard(&mut unit);
        tell(&mut unit, SESSION, hello());
        prop_assert_eq!(heard(&mut unit).len(), 1);
    }
}

#[test]
fn the_watchdog_is_fed_while_samples_are_processed_and_not_while_they_wait() {
    let samples = samples(3);
    let mut unit = running(StreamMode::Paced);
    let fed = |unit: &mut Unit<Bench>| {
        let before = unit.board().fed.get();
        unit.feed_watchdog();
        unit.board().fed.get() - before
    };
    assert_eq!(fed(&mut unit), 1, "nothing to do");
    tell_numbered(&mut unit, SESSION, 0, time(0), samples[0]);
    assert_eq!(fed(&mut unit), 0, "it waits");
    assert_eq!(fed(&mut unit), 0, "it still does");
    tell_numbered(&mut unit, SESSION, 1, time(1), samples[1]);
    tell_numbered(&mut unit, SESSION, 2, time(2), samples[2]);
    assert!(unit.work());
    assert_eq!(fed(&mut unit), 1, "one of three was processed");
    assert_eq!(fed(&mut unit), 0, "two wait");
    while unit.work() {}
    assert_eq!(fed(&mut unit), 1);
}
