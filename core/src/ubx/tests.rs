//! Tests with frames as sent by receivers, intact and damaged.

extern crate std;

use std::vec;
use std::vec::Vec;

use proptest::prelude::*;

use super::*;

/// A frame with its checksums, computed by the algorithm of the receiver description.
fn frame(kind: [u8; 2], payload: &[u8]) -> Vec<u8> {
    let mut covered = kind.to_vec();
    covered.extend(u16::try_from(payload.len()).unwrap().to_le_bytes());
    covered.extend(payload);
    let (mut a, mut b) = (0_u32, 0_u32);
    for byte in &covered {
        a = (a + u32::from(*byte)) & 0xff;
        b = (b + a) & 0xff;
    }
    let mut frame = vec![0xb5, 0x62];
    frame.extend(covered);
    frame.extend([a, b].map(|sum| u8::try_from(sum).unwrap()));
    frame
}

fn decoded(bytes: &[u8]) -> (Vec<NavPvt>, Counters) {
    let mut decoder = Decoder::new();
    let found = bytes
        .iter()
        .filter_map(|&byte| decoder.push(byte))
        .collect();
    (found, *decoder.counters())
}

/// A fall at 53 m/s that drifts at 12 m/s north and 5 m/s east.
fn payload(length: usize) -> Vec<u8> {
    let mut payload = vec![0; length];
    let mut put = |at: usize, value: i32| payload[at..at + 4].copy_from_slice(&value.to_le_bytes());
    put(0, 123_456_789);
    put(32, 3_456_789);
    put(36, 3_412_500);
    put(44, 1_250);
    put(48, 12_000);
    put(52, 5_000);
    put(56, 53_250);
    put(60, 13_000);
    put(68, 310);
    payload[20] = 3;
    payload[21] = 1;
    payload
}

#[test]
fn a_solution_is_read_field_by_field_in_both_lengths() {
    for length in LENGTHS {
        let (found, counters) = decoded(&frame(NAV_PVT, &payload(length)));
        assert_eq!(counters.solutions, 1);
        let expected = NavPvt {
            time_of_week_ms: 123_456_789,
            fix: 3,
            is_valid: true,
            height_m: 3456.789,
            velocity_mps: Vector3::new(12.0, -5.0, -53.25),
            ground_speed_mps: 13.0,
            speed_accuracy_mps: 0.31,
            height_msl_m: 3412.5,
            vertical_accuracy_m: 1.25,
        };
        assert_eq!(found, [expected]);
        assert_eq!(found[0].velocity(), Some(expected.velocity_mps));
        let longest = frame(NAV_PVT, &payload(LONGEST));
        assert_eq!(expected.encode().as_slice(), longest);
    }
}

/// The acknowledgement of `CFG-PRT`, byte for byte as shown by u-blox's own tools, checks the test's own frames.
#[test]
fn checksums_are_those_of_published_frames() {
    let acknowledged = [0xb5, 0x62, 0x05, 0x01, 0x02, 0x00, 0x06, 0x00, 0x0e, 0x37];
    assert_eq!(frame([0x05, 0x01], &[0x06, 0x00]), acknowledged);
}

/// A false start, a false length, a frame cut short and one of another kind: what follows is found all the same.
#[test]
fn nothing_that_precedes_a_frame_hides_it() {
    let good = frame(NAV_PVT, &payload(92));
    for before in [
        &[0xb5, 0x62][..],
        &[0xb5],
        &[0xb5, 0x62, 0x01, 0x07],
        &[0xb5, 0x62, 0x01, 0x07, 92, 0],
        &[0xb5, 0x62, 0x01, 0x07, 84, 0, 1, 2, 3],
        &[0xb5, 0x62, 0x02, 0x15, 0xff, 0xff],
        &good[..50],
        &good[..99],
    ] {
        let (found, counters) = decoded(&[before, &good, &good].concat());
        assert_eq!(found.len(), 2, "{before:02x?}");
        assert_eq!(counters.solutions, 2);
    }
}

#[test]
fn without_a_fix_of_three_dimensions_there_is_no_velocity() {
    for (fix, flags) in [(3, 0), (2, 1), (0, 0), (5, 1)] {
        let mut payload = payload(92);
        (payload[20], payload[21]) = (fix, flags);
        let (found, _) = decoded(&frame(NAV_PVT, &payload));
        assert_eq!(found[0].velocity(), None, "fix {fix}, flags {flags}");
    }
}

proptest! {
    #[test]
    fn a_frame_after_arbitrary_garbage_is_found(
        noise in prop::collection::vec(any::<u8>(), 0..200),
        other in prop::collection::vec(any::<u8>(), 0..300),
    ) {
        let bytes = [&noise[..], &frame([0x01, 0x35], &other), b"$GNGGA,1*00\r\n", &frame(NAV_PVT, &payload(92))].concat();
        let (found, counters) = decoded(&bytes);
        prop_assert_eq!(found.len(), 1);
        prop_assert_eq!(counters.bad_checksum, 0);
    }

    #[test]
    fn a_damaged_frame_is_not_accepted(place in 0_usize..100, hit in 1_u8..) {
        let mut bytes = frame(NAV_PVT, &payload(92));
        bytes[place] ^= hit;
        let (found, _) = decoded(&bytes);
        prop_assert!(found.is_empty());
    }

    #[test]
    fn it_continues_after_any_bytes(bytes in prop::collection::vec(any::<u8>(), 0..2000)) {
        let mut decoder = Decoder::new();
        for byte in bytes {
            let _ = decoder.push(byte);
        }
        let found = frame(NAV_PVT, &payload(92)).into_iter().filter_map(|byte| decoder.push(byte)).count();
        prop_assert_eq!(found, 1);
    }
}
