//! The unit on a bad line, in virtual time: it recovers and always answers.

use std::cell::Cell;

use bodyflight_core::aerodynamics::Aerodynamics;
use bodyflight_core::link::fault::{Faults, Injector, Random};
use bodyflight_core::link::{
    Estimate, Header, MAX_FRAME_LENGTH, Message, Sample, SegmentTable, Start, Stop, StreamMode,
};
use bodyflight_firmware::{Board, Identity, Unit};
use bodyflight_tests::arm_swing::{RATE, body, samples};
use bodyflight_tests::greeting::{configure, hello};

const SESSION: u16 = 9;

/// A board whose clock is set by the test.
#[derive(Default)]
struct Bench(Cell<u64>);

impl Board for Bench {
    fn now(&self) -> u64 {
        self.0.get()
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
    fn feed_watchdog(&self) {}
    fn note(&self, _: u32) {}
}

fn frame(header: &Header, message: impl Into<Message>) -> Vec<u8> {
    let mut frame = vec![0; MAX_FRAME_LENGTH];
    let length = message.into().encode(header, &mut frame).unwrap();
    frame.truncate(length);
    frame
}

fn tell(unit: &mut Unit<Bench>, message: impl Into<Message>) {
    let header = Header {
        session: SESSION,
        ..Header::default()
    };
    unit.receive(&frame(&header, message));
}

fn heard(unit: &mut Unit<Bench>) -> Vec<Message> {
    let mut bytes = [0; MAX_FRAME_LENGTH];
    let mut messages = Vec::new();
    while let Some(length) = unit.transmit(&mut bytes) {
        messages.push(Message::decode(&bytes[..length]).unwrap().1);
    }
    messages
}

fn running() -> Unit<Bench> {
    let mut unit = Unit::new(Bench::default(), Identity::default());
    let table = SegmentTable::of(&body::<f32>(), &Aerodynamics::paper());
    tell(&mut unit, hello());
    tell(&mut unit, configure(0, &table));
    for row in table.rows() {
        tell(&mut unit, *row);
    }
    tell(
        &mut unit,
        Start {
            mode: StreamMode::Paced,
        },
    );
    heard(&mut unit);
    unit
}

/// Streams a flight, with faults from `bad.0` to `bad.1` (s). Returns the estimates and the unit.
fn fly(
    samples: &[Sample],
    faults: Faults,
    bad: (u32, u32),
    seed: u64,
) -> (Vec<Estimate>, Unit<Bench>) {
    let mut unit = running();
    let mut injector = Injector::new(faults, seed);
    let mut estimates = Vec::new();
    for (k, sample) in (0..).zip(samples) {
        let time = u64::from(k) * 1_000_000 / u64::from(RATE);
        unit.board().0.set(time);
        let header = Header {
            session: SESSION,
            sequence: k,
            time,
        };
        let bytes = frame(&header, *sample);
        if (bad.0 * RATE..bad.1 * RATE).contains(&k) {
            injector.pass(&bytes, |piece| unit.receive(piece));
        } else {
            injector.flush(|piece| unit.receive(piece));
            unit.receive(&bytes);
        }
        while unit.work() {}
        estimates.extend(heard(&mut unit).into_iter().filter_map(|m| match m {
            Message::Estimate(estimate) => Some(estimate),
            _ => None,
        }));
    }
    let sent = u32::try_from(samples.len()).unwrap();
    tell(&mut unit, Stop { sent });
    (estimates, unit)
}

/// Largest distance between two estimates, in standard deviations of the states.
fn distance(a: &Estimate, b: &Estimate) -> f32 {
    (0..6)
        .map(|i| (a.state[i] - b.state[i]).abs() / a.variance[i].sqrt())
        .fold(0.0, f32::max)
}

#[test]
fn estimates_are_back_within_noise_half_a_second_after_the_faults() {
    let samples = samples(8 * RATE);
    let (clean, _) = fly(&samples, Faults::default(), (0, 0), 0);
    let faults = Faults {
        drop: 0.05,
        corrupt: 0.05,
        reorder: 0.02,
        ..Faults::default()
    };
    let mut worst = 0.0f32;
    for seed in 0..10 {
        let (found, unit) = fly(&samples, faults, (2, 5), seed);
        let status = unit.status();
        let sent = u32::try_from(samples.len()).unwrap();
        assert_eq!(status.accounted(), sent);
        assert!(status.missing > 30 && status.crc_bad > 10);
        assert!(found.iter().all(|e| e.state.iter().all(|x| x.is_finite())));
        // Compared after half a second of clean samples. Updates may refer to other samples than in the clean flight.
        let from = 5 * RATE + RATE / 2;
        let mut compared = 0;
        for estimate in found.iter().filter(|e| e.sample_sequence >= from) {
            let nearest = clean
                .iter()
                .min_by_key(|e| e.sample_sequence.abs_diff(estimate.sample_sequence))
                .unwrap();
            worst = worst.max(distance(nearest, estimate));
            compared += 1;
        }
        assert!(compared > 100);
    }
    println!("largest distance from the clean flight: {worst:.2} standard deviations");
    assert!(worst < 1.0, "{worst} standard deviations");
}

#[test]
fn ten_minutes_of_garbage_leave_the_unit_answering() {
    // The unit receives as many bytes as a line of 460800 baud carries in ten minutes; the environment can set another
    // time.
    let minutes = std::env::var("BODYFLIGHT_GARBAGE_MIN").map_or(10, |text| text.parse().unwrap());
    let mut unit = running();
    let mut random = Random::new(4);
    let mut bytes = [0u8; 4608];
    for _ in 0..minutes * 600u32 {
        for chunk in bytes.chunks_exact_mut(4) {
            chunk.copy_from_slice(&random.bits().to_le_bytes());
        }
        unit.receive(&bytes);
        assert!(!unit.work());
        // Random bytes are never mistaken for a command.
        assert_eq!(heard(&mut unit), []);
    }
    let status = unit.status();
    println!(
        "{} bytes: {} frames taken, {} refused by the checksum, {} cut",
        status.received_bytes, status.received_frames, status.crc_bad, status.cobs_bad
    );
    let frames = status.received_frames;
    tell(&mut unit, hello());
    assert!(matches!(
        heard(&mut unit)[..],
        [Message::HelloAcknowledge(_)]
    ));
    assert_eq!(
        frames, 19,
        "greeting, configuration, 16 segments, start: nothing else"
    );
}

#[test]
fn the_host_may_restart_in_mid_stream() {
    let samples = samples(2 * RATE);
    let mut unit = running();
    let mut last = None;
    for session in [SESSION, SESSION + 1, SESSION + 2] {
        // The host was killed in the middle of a frame and starts over with its greeting.
        unit.receive(&frame(&Header::default(), samples[0])[..50]);
        tell(&mut unit, hello());
        let header = Header {
            session,
            ..Header::default()
        };
        unit.receive(&frame(
            &header,
            Start {
                mode: StreamMode::Paced,
            },
        ));
        heard(&mut unit);
        let mut estimates = Vec::new();
        for (k, sample) in (0..).zip(&samples) {
            let header = Header {
                session,
                sequence: k,
                time: u64::from(k) * 1_000_000 / u64::from(RATE),
            };
            unit.receive(&frame(&header, *sample));
            while unit.work() {}
            estimates.extend(heard(&mut unit));
        }
        // The same flight gives the same answers: nothing of the last session remains.
        assert!(last.is_none_or(|last| last == estimates));
        last = Some(estimates);
    }
}
