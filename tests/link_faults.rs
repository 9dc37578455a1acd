//! Statistics of the link under faults: no false delivery, and a fault destroys at most one good frame besides the
//! damaged one.
//!
//! `BODYFLIGHT_FAULTED_FRAMES=100000000 cargo test --release -p bodyflight-tests --test link_faults` runs the number
//! required for a release; `BODYFLIGHT_FAULT_SEED` repeats a run.
#![expect(
    clippy::expect_used,
    clippy::panic,
    reason = "a test fails by panicking"
)]

use std::time::Instant;

use bodyflight_core::frame::{Rotation, Vector};
use bodyflight_core::link::fault::Random;
use bodyflight_core::link::{
    Credit, Decoder, Estimate, EstimateFlags, Event, Header, MAX_FRAME_LENGTH, Message, Motion,
    PackedQuaternion, Sample, Stop, TimeSync,
};
use bodyflight_core::{Posture, Segment};

const KINDS: [&str; 17] = [
    "1 bit",
    "2 bits",
    "3 bits",
    "4 bits",
    "6 bits",
    "2 bytes",
    "burst of up to 32 bits",
    "1 byte lost",
    "2-16 bytes lost",
    "cut at the end",
    "cut at the start",
    "1-4 bytes inserted",
    "adjacent bytes swapped",
    "run of zeros",
    "part repeated",
    "1 line bit",
    "2 line bits",
];

/// A message and its frame.
struct Sent {
    header: Header,
    message: Message,
    frame: Vec<u8>,
}

fn number(name: &str, otherwise: u64) -> u64 {
    std::env::var(name).map_or(otherwise, |text| {
        text.parse()
            .unwrap_or_else(|_| panic!("{name}={text}: expected a whole number"))
    })
}

fn signed_unit(random: &mut Random) -> f32 {
    f32::from_bits(random.bits() >> 9 | 0x4000_0000) - 3.0
}

fn any_sample(random: &mut Random) -> Message {
    let mut wxyz = || core::array::from_fn(|_| signed_unit(random));
    let mut posture = Posture::h_pose();
    for segment in Segment::ALL {
        if let Some(joint) = Rotation::<f32, (), ()>::from_wxyz(wxyz()) {
            posture.set(segment, *joint.quaternion());
        }
    }
    let attitude = Rotation::from_wxyz(wxyz()).unwrap_or(Rotation::identity());
    let [x, y, z, v] = wxyz().map(|value: f32| value * 20.0);
    let motion = Motion {
        angular_velocity: Some(Vector::new(x, y, z)),
        velocity: Some(Vector::new(z, v, x)),
        horizontal_speed: Some(v.abs()),
    };
    Message::Sample(Sample::new(&posture, &attitude, &motion))
}

fn any_message(random: &mut Random) -> Sent {
    let mut value = || signed_unit(random);
    let estimate = Estimate {
        sample_sequence: 1,
        flags: EstimateFlags::VALID,
        state: core::array::from_fn(|_| value()),
        variance: core::array::from_fn(|_| value().abs()),
        measurement: core::array::from_fn(|_| value()),
        nis: 0.5,
        cycles: 300_000,
        inertial_from_body: PackedQuaternion::default(),
        velocity: core::array::from_fn(|_| value()),
    };
    // Mostly samples, as on a real link.
    let message = match random.below(8) {
        0 => Message::Estimate(estimate),
        1 => Message::Credit(Credit {
            granted: random.bits(),
        }),
        2 => Message::Stop(Stop {
            sent: random.bits(),
        }),
        3 => Message::TimeSync(TimeSync {
            asked: 1,
            received: 2,
            answered: 3,
        }),
        _ => any_sample(random),
    };
    let header = Header {
        session: 7,
        sequence: random.bits(),
        time: u64::from(random.bits()) << 10,
    };
    let mut frame = vec![0; MAX_FRAME_LENGTH];
    let length = message
        .encode(&header, &mut frame)
        .expect("the buffer is the longest frame");
    frame.truncate(length);
    Sent {
        header,
        message,
        frame,
    }
}

fn flip(bytes: &mut [u8], bit: usize) {
    bytes[bit / 8] ^= 1 << (bit % 8);
}

/// Bytes that an 8N1 receiver decodes from two frames back to back, with `hits` inverted line bits in the first.
fn over_the_line(first: &[u8], second: &[u8], hits: usize, random: &mut Random) -> Vec<u8> {
    let mut line = Vec::with_capacity((first.len() + second.len()) * 10 + 20);
    for byte in first.iter().chain(second) {
        line.push(false);
        line.extend((0..8).map(|bit| byte >> bit & 1 == 1));
        line.push(true);
    }
    // The line is idle after the second frame.
    line.extend([true; 20]);
    for _ in 0..hits {
        let at = random.below(first.len() * 10);
        line[at] = !line[at];
    }
    let (mut bytes, mut at) = (Vec::with_capacity(first.len() + second.len()), 0);
    while at + 10 <= line.len() {
        if line[at] {
            at += 1;
        } else if line[at + 9] {
            bytes.push((0..8).fold(0, |byte, bit| byte | u8::from(line[at + 1 + bit]) << bit));
            at += 10;
        } else {
            // Framing error: the byte is lost, and the next start bit is the next falling edge.
            at += 9;
            while at < line.len() && !line[at] {
                at += 1;
            }
        }
    }
    bytes
}

/// Writes `frame` with a fault of this kind to `out`. Faults of line bits are applied by [`over_the_line`].
fn damage(kind: usize, frame: &[u8], random: &mut Random, out: &mut Vec<u8>) {
    out.clear();
    out.extend_from_slice(frame);
    let (length, bits) = (frame.len(), frame.len() * 8);
    match kind {
        0..=4 => {
            for _ in 0..[1, 2, 3, 4, 6][kind] {
                let bit = random.below(bits);
                flip(out, bit);
            }
        }
        5 => {
            for _ in 0..2 {
                let at = random.below(length);
                out[at] = random.bits().to_le_bytes()[0];
            }
        }
        6 => {
            let pattern = random.bits();
            let start = random.below(bits - 31);
            for bit in (0..32).filter(|bit| pattern >> bit & 1 == 1) {
                flip(out, start + bit);
            }
        }
        7 => drop(out.remove(random.below(length))),
        8 => {
            let lost = 2 + random.below(15);
            let at = random.below(length - lost);
            out.drain(at..at + lost);
        }
        9 => out.truncate(random.below(length)),
        10 => drop(out.drain(..1 + random.below(length - 1))),
        11 => {
            for _ in 0..=random.below(4) {
                let at = random.below(length);
                out.insert(at, random.bits().to_le_bytes()[0]);
            }
        }
        12 => {
            let at = random.below(length - 1);
            out.swap(at, at + 1);
        }
        13 => {
            let run = 1 + random.below(16);
            let at = random.below(length - run);
            out[at..at + run].fill(0);
        }
        _ => {
            let part = 1 + random.below(length / 2);
            let at = random.below(length - part);
            let again = out[at..at + part].to_vec();
            out.splice(at..at, again);
        }
    }
}

#[derive(Default, Clone, Copy)]
struct Tally {
    trials: u64,
    harmless: u64,
    false_deliveries: u64,
    extra_lost: u64,
    extra_lost_max: u64,
}

#[test]
fn a_fault_delivers_no_wrong_frame_and_costs_at_most_one_good_one() {
    let trials = number("BODYFLIGHT_FAULTED_FRAMES", 5_000_000);
    let seed = number("BODYFLIGHT_FAULT_SEED", 1);
    let mut random = Random::new(seed);
    let mut decoder = Decoder::new();
    let mut tally = [Tally::default(); KINDS.len()];
    let (mut pool, mut stream) = (Vec::new(), Vec::new());
    let began = Instant::now();

    for trial in 0..trials {
        // The pool is renewed occasionally; each trial uses two random frames from it.
        if trial % 4096 == 0 {
            pool = (0..64)
                .map(|_| any_message(&mut random))
                .collect::<Vec<_>>();
        }
        let (struck, good) = (&pool[random.below(64)], &pool[random.below(64)]);
        let kind = random.below(KINDS.len());
        if kind >= 15 {
            stream = over_the_line(&struck.frame, &good.frame, kind - 14, &mut random);
        } else {
            damage(kind, &struck.frame, &mut random, &mut stream);
            stream.extend_from_slice(&good.frame);
        }

        let result = &mut tally[kind];
        result.trials += 1;
        let (mut got_good, mut got_struck) = (false, false);
        let mut extra_lost = 0;
        let mut bytes: &[u8] = &stream;
        loop {
            for &byte in bytes {
                let Some(Event::Frame(header, message)) = decoder.push(byte) else {
                    continue;
                };
                let is = |sent: &Sent| sent.header == header && sent.message == message;
                if is(good) {
                    got_good = true;
                } else if is(struck) {
                    got_struck = true;
                } else {
                    result.false_deliveries += 1;
                }
            }
            if got_good {
                break;
            }
            extra_lost += 1;
            assert!(
                extra_lost < 10,
                "seed {seed}, trial {trial}: the decoder is stuck"
            );
            bytes = &good.frame;
        }
        result.harmless += u64::from(got_struck);
        result.extra_lost += extra_lost;
        result.extra_lost_max = result.extra_lost_max.max(extra_lost);
    }

    let seconds = began.elapsed().as_secs_f64();
    eprintln!("{trials} faulted frames, seed {seed}, {seconds:.1} s");
    eprintln!(
        "{:<24} {:>10} {:>10} {:>6} {:>10} {:>4}",
        "fault", "frames", "harmless", "false", "extra lost", "max"
    );
    for (kind, t) in KINDS.iter().zip(&tally) {
        eprintln!(
            "{kind:<24} {:>10} {:>10} {:>6} {:>10} {:>4}",
            t.trials, t.harmless, t.false_deliveries, t.extra_lost, t.extra_lost_max
        );
    }
    assert!(
        tally.iter().all(|t| t.trials > 0),
        "every kind of fault has struck"
    );
    assert!(
        tally.iter().all(|t| t.harmless < t.trials),
        "faults do harm"
    );
    assert_eq!(tally.iter().map(|t| t.false_deliveries).sum::<u64>(), 0);
    assert!(tally.iter().all(|t| t.extra_lost_max <= 1));
}
