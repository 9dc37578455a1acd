//! The status that a unit with a log records.

use bodyflight_core::link::{Hello, MAX_FRAME_LENGTH, SCHEMA_HASH, Stop};

use super::*;
use crate::board::{Board, Identity};
use crate::test_flight;
use crate::unit::Unit;

/// A board with a log and a battery.
struct Wearable<'a>(&'a Recorder);

impl Board for Wearable<'_> {
    fn now(&self) -> u64 {
        5
    }
    fn cycles(&self) -> u32 {
        0
    }
    fn stack_free(&self) -> u32 {
        0
    }
    fn line_errors(&self) -> [u32; 2] {
        [0; 2]
    }
    fn battery(&self) -> u16 {
        3712
    }
    fn recorder(&self) -> Option<&Recorder> {
        Some(self.0)
    }
    fn feed_watchdog(&self) {}
    fn note(&self, _: u32) {}
}

#[test]
fn the_log_contains_the_reported_battery_voltage() {
    let chip = Chip::new(usize::MAX, 1);
    let recorder = Recorder::new(vec![Block::EMPTY; 8].leak());
    let mut storage = chip.log(&recorder);
    let mut log = core::pin::pin!(storage.run(|_| {}));
    let mut unit = Unit::new(Wearable(&recorder), Identity::default());
    let mut tell = |sequence, message: Message| {
        let header = Header {
            session: 1,
            sequence,
            time: test_flight::time(sequence),
        };
        let mut frame = [0; MAX_FRAME_LENGTH];
        let length = message.encode(&header, &mut frame).unwrap();
        unit.receive(&frame[..length]);
        while unit.work() {}
        unit.report()
    };
    let hello = Hello {
        schema_hash: SCHEMA_HASH,
        max_frame_length: 200,
    };
    tell(0, hello.into());
    tell(0, test_flight::configure().into());
    for row in test_flight::table().rows() {
        tell(0, (*row).into());
    }
    let mode = StreamMode::Paced;
    tell(0, Start { mode }.into());
    for (sequence, mut sample) in (0..).zip(test_flight::samples(3)) {
        // If the phase is unknown, everything is written.
        sample.valid.remove(Validity::VELOCITY);
        assert_eq!(tell(sequence, sample.into()).battery, 3712);
    }
    tell(0, Stop { sent: 3 }.into());
    assert!(poll_once(log.as_mut()).is_pending());
    let log = read(&chip);
    let reports = log.iter().filter_map(|(header, message)| match message {
        Message::Status(status) => Some((header.time, status.used, status.battery)),
        _ => None,
    });
    let expected = (0..3).map(|k| (test_flight::time(k), k + 1, 3712));
    assert!(reports.eq(expected), "{log:?}");
}
