//! A log on a chip whose power fails at any moment.
#![allow(clippy::cast_possible_truncation, reason = "small numbers of a test")]

mod battery;
mod chip;
mod damage;
mod erase_ahead;
mod setup;

use std::collections::BTreeMap;
use std::vec;
use std::vec::Vec;

use bodyflight_core::Posture;
use bodyflight_core::frame::{Rotation, Vector};
use bodyflight_core::link::{BlockReader, LogAction, Motion, Start, StreamMode};
use bodyflight_core::math::small_rotation;
use embassy_futures::poll_once;
use nalgebra::Vector3;
use proptest::prelude::*;

use super::storage::{Answer, Log};
use super::*;
use chip::{Chip, SECTOR, SECTORS, SETUP_SECTORS};

/// Times at which the exit, the opening of the canopy and the landing take place (s).
const EXIT: f32 = 3.0;
const OPENING: f32 = 45.0;
const LANDING: f32 = 60.0;

/// Sample `number` of a jump at 240 Hz: flight in the aircraft, fall, canopy, ground.
fn sample(number: u32) -> (Header, Message) {
    let seconds = number as f32 / 240.0;
    let up = match seconds {
        seconds if seconds < EXIT => 0.0,
        seconds if seconds < OPENING => (-9.8 * (seconds - EXIT)).max(-53.0),
        seconds if seconds < LANDING => (-53.0 + 20.0 * (seconds - OPENING)).min(-5.0),
        _ => 0.0,
    };
    let turn = Vector3::new(0.02 * (3.1 * seconds).sin(), 0.3 * seconds, 0.1);
    let motion = Motion {
        angular_velocity: Some(Vector::new(0.1, (2.0 * seconds).sin(), 0.2)),
        velocity: Some(Vector::new(30.0 - seconds, 1.0, up)),
        horizontal_speed: None,
    };
    let header = Header {
        session: 7,
        sequence: number,
        time: 77_000_000 + u64::from(number) * 4167,
    };
    let attitude = Rotation::from_quaternion(small_rotation(&turn));
    let sample = Sample::new(&Posture::h_pose(), &attitude, &motion);
    (header, sample.into())
}

fn preamble() -> [(Header, Message); 1] {
    let start = Start {
        mode: StreamMode::Sensor,
    };
    [(Header::default(), start.into())]
}

/// Flies `seconds` of the jump with a log on this chip, or until the power fails. Returns the number of the sample
/// processed last.
fn fly(chip: &Chip, seconds: f32) -> u32 {
    let recorder = Recorder::new(vec![Block::EMPTY; 64].leak());
    fly_with(&recorder, chip, seconds)
}

fn fly_with(recorder: &Recorder, chip: &Chip, seconds: f32) -> u32 {
    let mut storage = chip.log(recorder);
    let mut log = core::pin::pin!(storage.run(|_| {}));
    recorder.begin(preamble());
    let last = (seconds * 240.0) as u32;
    for number in 0..last {
        let (header, message) = sample(number);
        recorder.note(&header, &message);
        assert!(poll_once(log.as_mut()).is_pending());
        if !chip.has_power() {
            return number;
        }
    }
    recorder.end();
    assert!(poll_once(log.as_mut()).is_pending());
    assert_eq!(recorder.lost(), 0);
    last
}

/// Contents of a log as a host reads them.
fn read(chip: &Chip) -> Vec<(Header, Message)> {
    let (messages, damaged) = read_past_damage(chip);
    assert_eq!(damaged, 0);
    messages
}

/// The same, and the number of damaged blocks.
fn read_past_damage(chip: &Chip) -> (Vec<(Header, Message)>, usize) {
    let blocks = blocks(chip);
    let messages = blocks.iter().flat_map(|block| BlockReader::new(block));
    let all: Vec<_> = messages.collect();
    let damaged = all.iter().filter(|read| read.is_err()).count();
    (all.into_iter().flatten().collect(), damaged)
}

/// The blocks of a log, read through the task, one by one.
fn blocks(chip: &Chip) -> Vec<Vec<u8>> {
    chip.0.borrow_mut().power = usize::MAX;
    let recorder = Recorder::new(&mut []);
    let found = RefCell::new(BTreeMap::new());
    let answer = |answer: Answer<'_>| {
        let Answer::Block(number, bytes) = answer else {
            return;
        };
        found.borrow_mut().insert(number, bytes.to_vec());
    };
    let mut storage = chip.log(&recorder);
    let mut log = core::pin::pin!(storage.run(answer));
    for number in 0.. {
        recorder.ask(LogAction::Read, number);
        assert!(poll_once(log.as_mut()).is_pending());
        let found = found.borrow();
        if found.get(&number).expect("an answer").is_empty() {
            break;
        }
    }
    let blocks = found.take().into_values();
    blocks.filter(|block| !block.is_empty()).collect()
}

/// Numbers of the samples, after checking that each is as it was recorded.
fn samples_of(log: &[(Header, Message)]) -> Vec<u32> {
    let samples = log
        .iter()
        .filter(|(_, message)| matches!(message, Message::Sample(_)));
    samples
        .map(|read| {
            assert_eq!(*read, sample(read.0.sequence));
            read.0.sequence
        })
        .collect()
}

#[test]
fn a_jump_is_written_from_before_its_exit_to_after_its_landing() {
    let chip = Chip::new(usize::MAX, 1);
    fly(&chip, 90.0);
    let log = read(&chip);
    let found = samples_of(&log);
    assert!(found.windows(2).all(|pair| pair[1] == pair[0] + 1));
    let (first, last) = (
        found[0] as f32 / 240.0,
        *found.last().unwrap() as f32 / 240.0,
    );
    // The ring holds about half a minute; the oldest blocks are dropped.
    assert!(
        first > EXIT && (68.0..75.0).contains(&last),
        "{first} to {last} s"
    );

    let chip = Chip::new(usize::MAX, 1);
    fly(&chip, 20.0);
    let log = read(&chip);
    assert_eq!(log[0], preamble()[0]);
    let found = samples_of(&log);
    assert!(found[0] as f32 / 240.0 < EXIT, "{}", found[0]);
    assert_eq!(found.last(), Some(&(20 * 240 - 1)));
}

#[test]
fn small_storage_keeps_the_fall_and_not_the_way_down_under_the_canopy() {
    let chip = Chip::new(usize::MAX, 1);
    let recorder = Recorder::new(vec![Block::EMPTY; 64].leak()).until(Until::Canopy);
    fly_with(&recorder, &chip, 90.0);
    let found = samples_of(&read(&chip));
    let last = *found.last().unwrap() as f32 / 240.0;
    // The canopy is detected after 3 s below the fall's speed.
    assert!((OPENING + 3.0..OPENING + 8.0).contains(&last), "{last} s");
}

#[test]
fn nothing_is_written_on_the_ground() {
    let chip = Chip::new(usize::MAX, 1);
    fly(&chip, EXIT);
    assert!(read(&chip).is_empty());
}

/// Writes a flight of `seconds` without vertical velocity, all of which is recorded, as number `session`.
fn record(chip: &Chip, session: u16, seconds: u32) {
    let recorder = Recorder::new(vec![Block::EMPTY; 64].leak());
    let mut storage = chip.log(&recorder);
    let mut log = core::pin::pin!(storage.run(|_| {}));
    recorder.begin(preamble().map(|(header, message)| (Header { session, ..header }, message)));
    for number in 0..seconds * 240 {
        let (mut header, message) = sample(number);
        header.session = session;
        let Message::Sample(mut sample) = message else {
            unreachable!("a sample");
        };
        sample.valid.remove(Validity::VELOCITY);
        recorder.note(&header, &sample.into());
        assert!(poll_once(log.as_mut()).is_pending());
    }
    recorder.end();
    assert!(poll_once(log.as_mut()).is_pending());
    assert_eq!(recorder.lost(), 0);
}

#[test]
fn without_vertical_velocity_everything_is_written() {
    let chip = Chip::new(usize::MAX, 1);
    record(&chip, 7, 2);
    assert_eq!(read(&chip).len(), 481);
}

#[test]
fn blocks_are_read_in_any_order_and_again() {
    let chip = Chip::new(usize::MAX, 1);
    fly(&chip, 20.0);
    let recorder = Recorder::new(&mut []);
    let heard = RefCell::new(Vec::new());
    let answer = |answer: Answer<'_>| {
        if let Answer::Block(number, bytes) = answer {
            heard.borrow_mut().push((number, bytes.to_vec()));
        }
    };
    let mut storage = chip.log(&recorder);
    let mut log = core::pin::pin!(storage.run(answer));
    for number in [0, 1, 1, 5, 3, 3, 0, 1_000_000, 2] {
        recorder.ask(LogAction::Read, number);
        assert!(poll_once(log.as_mut()).is_pending());
    }
    let heard = heard.borrow();
    let numbers: Vec<_> = heard.iter().map(|(number, _)| *number).collect();
    assert_eq!(numbers, [0, 1, 1, 5, 3, 3, 0, 1_000_000, 2]);
    assert!(heard[1] == heard[2] && heard[0] == heard[6] && heard[1] != heard[3]);
    assert!(
        heard[7].1.is_empty() && heard.iter().filter(|(_, bytes)| bytes.is_empty()).count() == 1
    );
}

/// Number of the sample at which the fall is detected.
fn told() -> u32 {
    let mut watch = Watch::default();
    let falls = |number: &u32| {
        let (header, message) = sample(*number);
        let Message::Sample(sample) = message else {
            unreachable!("a sample");
        };
        watch.update(header.time, velocity_up(&sample), None) == Phase::Fall
    };
    (0..).find(falls).unwrap()
}

/// Power fails at random, two hundred times, with every second flight over the remains of the one before. Everything
/// recorded up to a second before the failure is read back, and nothing else. The exception is the moment at which the
/// exit is detected, since the seconds before it are written only then.
#[test]
fn a_power_failure_costs_at_most_a_second() {
    let random = Chip::new(0, 20_260_802);
    let noise = || random.0.borrow_mut().noise();
    let mut whole = Chip::new(usize::MAX, 1);
    whole.0.borrow_mut().power = 1 << 30;
    fly(&whole, 40.0);
    let spent = (1 << 30) - whole.0.borrow().power;
    whole = Chip::new(usize::MAX, 1);
    let told = told();
    let (mut cut, mut latest, mut cut_short) = (0, 0, 0);
    for round in 0..200_u32 {
        let chance = (0..4).fold(0_usize, |sum, _| sum << 8 | usize::from(noise()));
        // Every second flight is written over the remains of the one before.
        let chip = if round % 2 == 0 {
            Chip::new(0, round)
        } else {
            whole.clone()
        };
        chip.0.borrow_mut().power = 1 + chance % spent;
        let at = fly(&chip, 40.0);
        cut += u32::from(!chip.has_power());
        let (log, damaged) = read_past_damage(&chip);
        cut_short += damaged;
        let found = samples_of(&log);
        if at > told {
            let last = *found.last().expect("samples");
            latest = latest.max(at - last);
            assert!(at - last <= 240, "cut at sample {at}, read to {last}");
            // Numbers restart with each flight.
            let follows = |pair: &[u32]| pair[1] == pair[0] + 1 || pair[1] < pair[0];
            assert!(found.windows(2).all(follows), "a gap");
        }
        whole = chip;
    }
    assert!(cut >= 195, "{cut} cuts");
    // Only a header of 16 bytes that was written in part is taken for damage, and rarely.
    assert!(cut_short <= 4, "{cut_short} damaged blocks");
    std::println!("{cut} cuts, at most {latest} samples before them missing");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn a_chip_with_any_content_is_erased_and_written(bytes in prop::collection::vec(any::<u8>(), 64)) {
        let chip = Chip::new(usize::MAX, 1);
        for (place, cell) in chip.0.borrow_mut().bytes.iter_mut().enumerate() {
            *cell = bytes[place % 64] ^ (place / 64) as u8;
        }
        let recorder = Recorder::new(&mut []);
        recorder.ask(LogAction::Erase, 0);
        let mut storage = chip.log(&recorder);
        let mut log = core::pin::pin!(storage.run(|_| {}));
        assert!(poll_once(log.as_mut()).is_pending());
        prop_assert!(read(&chip).is_empty());
        fly(&chip, 15.0);
        let log = read(&chip);
        prop_assert_eq!(samples_of(&log).last().copied(), Some(15 * 240 - 1));
    }
}
