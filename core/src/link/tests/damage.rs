//! Exhaustive tests of damaged frames: no false message is accepted, and the next good frame always is.

use std::vec::Vec;

use proptest::prelude::*;

use super::*;

/// Decodes `bytes` with a new decoder.
fn decoded(bytes: &[u8]) -> (Vec<(Header, Message)>, Counters) {
    let mut decoder = Decoder::new();
    let messages = bytes
        .iter()
        .filter_map(|&byte| match decoder.push(byte) {
            Some(Event::Frame(header, message)) => Some((header, message)),
            _ => None,
        })
        .collect();
    (messages, *decoder.counters())
}

/// Asserts that a damaged frame followed by a good one yields only genuine messages, and certainly the last one.
fn check(damaged: &[u8], whole: &(Header, Message), next: &(Header, Message), what: &str) {
    let mut stream = damaged.to_vec();
    stream.extend_from_slice(&frame_of(&next.0, &next.1));
    let (messages, _) = decoded(&stream);
    assert_eq!(
        messages.last(),
        Some(next),
        "{what}: the next frame is lost"
    );
    for message in &messages {
        assert!(message == whole || message == next, "{what}: {message:?}");
    }
}

fn next() -> (Header, Message) {
    let header = Header {
        session: 0x0102,
        sequence: 5,
        time: 9,
    };
    (header, Message::Credit(Credit { granted: 3 }))
}

#[test]
fn every_message_survives_its_frame() {
    for message in examples() {
        let frame = frame_of(&header(), &message);
        assert_eq!(Message::decode(&frame), Ok((header(), message)));
        assert_eq!(
            Message::decode(&frame[1..frame.len() - 1]),
            Ok((header(), message))
        );
        for short in 0..frame.len() {
            assert!(
                message
                    .encode(&header(), &mut [0; MAX_FRAME_LENGTH][..short])
                    .is_err()
            );
        }
    }
}

#[test]
fn every_one_bit_and_adjacent_two_bit_error_is_found() {
    for message in examples() {
        let (whole, frame) = ((header(), message), frame_of(&header(), &message));
        for bit in 0..frame.len() * 8 {
            for mask in [1u16, 3] {
                let mut damaged = frame.clone();
                for (i, byte) in damaged.iter_mut().enumerate().skip(bit / 8).take(2) {
                    let shifted = (mask << (bit % 8)).to_le_bytes();
                    *byte ^= shifted[i - bit / 8];
                }
                check(&damaged, &whole, &next(), "bits");
                // Any change before the last delimiter must be rejected.
                if (8..(frame.len() - 1) * 8 - 1).contains(&bit) {
                    assert_ne!(Message::decode(&damaged), Ok(whole));
                }
            }
        }
    }
}

#[test]
fn every_two_bit_error_in_a_sample_is_found() {
    let message = Message::Sample(sample());
    let frame = frame_of(&header(), &message);
    let bits = 8..(frame.len() - 1) * 8;
    let mut decoder = Decoder::new();
    let mut damaged = frame;
    for first in bits.clone() {
        damaged[first / 8] ^= 1 << (first % 8);
        for second in first + 1..bits.end {
            damaged[second / 8] ^= 1 << (second % 8);
            let passed = damaged
                .iter()
                .filter_map(|&byte| decoder.push(byte))
                .any(|event| matches!(event, Event::Frame(..)));
            assert!(!passed, "bits {first} and {second}");
            damaged[second / 8] ^= 1 << (second % 8);
        }
        damaged[first / 8] ^= 1 << (first % 8);
    }
    assert_eq!(decoder.counters().frames, 0);
}

#[test]
fn truncated_shortened_and_lengthened_frames_cost_only_themselves() {
    for message in examples() {
        let (whole, frame) = ((header(), message), frame_of(&header(), &message));
        for at in 0..=frame.len() {
            check(&frame[..at], &whole, &next(), "cut at the end");
            check(&frame[at..], &whole, &next(), "cut at the start");
            for length in 1..=16 {
                let after = (at + length).min(frame.len());
                let lost = [&frame[..at], &frame[after..]].concat();
                check(&lost, &whole, &next(), "lost bytes");
            }
            for extra in [0x00, 0x01, 0x55, 0xFF] {
                let longer = [&frame[..at], &[extra][..], &frame[at..]].concat();
                check(&longer, &whole, &next(), "inserted byte");
            }
        }
        for at in 0..frame.len() - 1 {
            let mut swapped = frame.clone();
            swapped.swap(at, at + 1);
            check(&swapped, &whole, &next(), "swapped bytes");
            for value in 0..=255 {
                let mut changed = frame.clone();
                changed[at] = value;
                check(&changed, &whole, &next(), "changed byte");
            }
        }
    }
}

#[test]
fn each_refusal_has_its_reason_and_its_counter() {
    let plain = |version: u8, code: u8, body: &[u8]| {
        let mut content = std::vec![version, code];
        content.extend([0; 14]);
        content.extend_from_slice(body);
        sealed(&content)
    };
    let not_finite: Vec<u8> = [0x00, 0x01]
        .into_iter()
        .chain(f32::NAN.to_le_bytes())
        .chain([0; 44])
        .collect();
    let mut quaternion = [0xFF; 111];
    quaternion[0] = 0;
    let cases = [
        (plain(1, 0x08, &[]), None),
        (plain(2, 0x08, &[]), Some(DecodeError::Version { found: 2 })),
        (
            plain(1, 0x99, &[]),
            Some(DecodeError::UnknownType { code: 0x99 }),
        ),
        (
            plain(1, 0x08, &[0]),
            Some(DecodeError::Length {
                found: 1,
                expected: 0,
            }),
        ),
        (
            plain(1, 0x06, &[3]),
            Some(DecodeError::OutOfRange { field: "mode" }),
        ),
        (
            plain(1, 0x04, &[16; 85]),
            Some(DecodeError::OutOfRange { field: "segment" }),
        ),
        (
            plain(1, 0x10, &[0x20; 111]),
            Some(DecodeError::OutOfRange { field: "valid" }),
        ),
        (
            plain(1, 0x10, &quaternion),
            Some(DecodeError::OutOfRange { field: "rotations" }),
        ),
        (
            plain(1, 0x03, &not_finite),
            Some(DecodeError::NotFinite {
                field: "sample_rate",
            }),
        ),
        (sealed(&[1, 8, 0]), Some(DecodeError::TooShort)),
        (std::vec![0, 5, 1, 0], Some(DecodeError::Cobs)),
        (std::vec![0, 2, 1, 0], Some(DecodeError::TooShort)),
        (
            [&[0][..], &[1; 300], &[0]].concat(),
            Some(DecodeError::TooLong),
        ),
    ];
    let mut decoder = Decoder::new();
    for (frame, expected) in &cases {
        let mut events = Vec::new();
        for &byte in frame {
            events.extend(decoder.push(byte));
        }
        assert_eq!(events.len(), 1, "{expected:?}");
        match (events[0], expected) {
            (Event::Frame(..), None) => {}
            (Event::Refused(found), Some(expected)) => assert_eq!(found, *expected),
            other => panic!("{other:?}"),
        }
    }
    let counters = decoder.counters();
    let expected = Counters {
        bytes: counters.bytes,
        frames: 1,
        crc_bad: 0,
        cobs_bad: 3,
        too_long: 1,
        wrong_version: 1,
        unknown_type: 1,
        wrong_length: 1,
        not_finite: 1,
        out_of_range: 4,
    };
    assert_eq!(*counters, expected);
    let mut damaged = frame_of(&header(), &next().1);
    damaged[9] ^= 0x40;
    assert_eq!(Message::decode(&damaged), Err(DecodeError::Checksum));
    assert_eq!(Message::decode(&[]), Err(DecodeError::Incomplete));
}

#[test]
fn every_exponent_in_every_float_is_checked() {
    let is_estimate = |message: &Message| matches!(message, Message::Estimate(_));
    let message = examples().into_iter().find(is_estimate).unwrap();
    let frame = frame_of(&header(), &message);
    let mut packet = [0; MAX_PACKET_LENGTH];
    let length = cobs::decode(&frame[1..], &mut packet).unwrap().frame_size();
    for float in 0..17 {
        let at = 16 + 6 + float * 4;
        for exponent in 0..=255u32 {
            for sign in [0, 1u32 << 31] {
                let value = f32::from_bits(sign | exponent << 23 | 0x0040_0000);
                let mut changed = packet[..length - 4].to_vec();
                changed[at..at + 4].copy_from_slice(&value.to_le_bytes());
                let read = Message::decode(&sealed(&changed));
                let bounded = (6..12).contains(&float) || float == 16;
                let good = value.is_finite() && (!bounded || (0.0..=1.0e30).contains(&value));
                assert_eq!(read.is_ok(), good, "float {float} = {value}");
            }
        }
    }
}

#[test]
fn a_receiver_error_costs_the_frame_it_hits() {
    let frame = frame_of(&header(), &next().1);
    for at in 0..frame.len() {
        let mut decoder = Decoder::new();
        for &byte in &frame[..at] {
            assert_eq!(decoder.push(byte), None);
        }
        decoder.discard_partial();
        let rest = frame[at..].iter().chain(&frame);
        let events: Vec<_> = rest.filter_map(|&byte| decoder.push(byte)).collect();
        assert!(matches!(events.last(), Some(Event::Frame(..))), "{at}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2_000))]

    #[test]
    fn garbage_is_rejected_and_leaves_no_trace(garbage in prop::collection::vec(any::<u8>(), 0..2_000)) {
        let (messages, _) = decoded(&garbage);
        prop_assert!(messages.is_empty());
        let mut stream = garbage;
        stream.extend_from_slice(&frame_of(&next().0, &next().1));
        prop_assert_eq!(decoded(&stream).0, [next()]);
    }

    #[test]
    fn garbage_with_a_valid_checksum_never_breaks_the_decoder(
        code in 0u8..0x14,
        body in prop::collection::vec(any::<u8>(), 0..120),
    ) {
        let mut content = std::vec![PROTOCOL_VERSION, code];
        content.extend([0; 14]);
        content.extend(body);
        if let Ok((header, message)) = Message::decode(&sealed(&content)) {
            // Whatever is accepted encodes to the same bytes.
            let frame = frame_of(&header, &message);
            prop_assert_eq!(&frame[..], &sealed(&content)[..]);
        }
    }
}
