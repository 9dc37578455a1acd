//! The Xbus decoder on recordings of real sensors and on packets with known contents.
#![expect(
    clippy::expect_used,
    clippy::panic,
    reason = "a test fails by panicking"
)]

#[path = "xbus/golden_texts.rs"]
mod golden_texts;
#[path = "xbus/known_packets.rs"]
mod known_packets;

use std::fs;

use bodyflight_core::link::fault::Random;
use bodyflight_core::xbus::{
    Decoder, Item, MAX_PACKET_LENGTH, MessageId, PacketWriter, SampleClock,
};

/// A file of the shared data, or `None` with a visible notice if it is absent.
fn recording(name: &str) -> Option<Vec<u8>> {
    let path = bodyflight_shared_data::shared(&format!("data/{name}"))?;
    Some(fs::read(path).expect("readable"))
}

/// A packet that owns its data.
#[derive(Debug, Clone, PartialEq)]
struct Read {
    bus_id: u8,
    message_id: MessageId,
    data: Vec<u8>,
}

/// All packets decoded from `bytes` in chunks whose sizes come from `piece`, and the number of skipped bytes.
fn read_in_pieces(bytes: &[u8], mut piece: impl FnMut() -> usize) -> (Vec<Read>, u32) {
    let mut decoder = Decoder::<MAX_PACKET_LENGTH>::new();
    let (mut packets, mut rest) = (Vec::new(), bytes);
    while !rest.is_empty() {
        let (mut input, later) = rest.split_at(piece().min(rest.len()));
        rest = later;
        while let Some(packet) = decoder.next(&mut input) {
            packets.push(Read {
                bus_id: packet.bus_id,
                message_id: packet.message_id,
                data: packet.data.to_vec(),
            });
        }
    }
    (packets, decoder.counters().skipped_bytes)
}

fn read(bytes: &[u8]) -> (Vec<Read>, u32) {
    read_in_pieces(bytes, || usize::MAX)
}

/// The items of a packet as identifier, length and content, in the order sent.
fn items(packet: &Read) -> Vec<(u16, usize, Item<'_>)> {
    bodyflight_core::xbus::Packet {
        bus_id: packet.bus_id,
        message_id: packet.message_id,
        data: &packet.data,
    }
    .items()
    .map(|raw| {
        (
            raw.id.0,
            raw.data.len(),
            raw.decode().expect("a real sensor's item"),
        )
    })
    .collect()
}

/// The numbers of an item in both precisions.
fn numbers(item: &Item<'_>) -> (Vec<f64>, Vec<f32>) {
    macro_rules! both {
        ($reals:expr) => {
            ($reals.to_f64().to_vec(), $reals.to_f32().to_vec())
        };
    }
    match item {
        Item::Temperature(r) | Item::AltitudeEllipsoid(r) => both!(r),
        Item::LatLon(r) => both!(r),
        Item::Quaternion(_, r) | Item::DeltaQ(r) => both!(r),
        Item::RotationMatrix(_, r) => both!(r),
        Item::EulerAngles(_, r)
        | Item::VelocityXyz(_, r)
        | Item::DeltaV(r)
        | Item::Acceleration(r)
        | Item::FreeAcceleration(r)
        | Item::AccelerationHr(r)
        | Item::PositionEcef(r)
        | Item::RateOfTurn(r)
        | Item::RateOfTurnHr(r)
        | Item::MagneticField(r) => both!(r),
        Item::PacketCounter(n) => (vec![f64::from(*n)], vec![]),
        Item::SampleTimeFine(n) | Item::SampleTimeCoarse(n) | Item::BaroPressure(n) => {
            (vec![f64::from(*n)], vec![])
        }
        other => panic!("{other:?} has no numbers"),
    }
}

fn close(found: f64, expected: f64, tolerance: f64) -> bool {
    (found - expected).abs() <= tolerance * expected.abs().max(1e-30)
}

/// Compares numbers with those of a text with limited digits, and single precision with double.
fn assert_numbers(item: &Item<'_>, expected: &[f64], tolerance: f64) {
    let (double, single) = numbers(item);
    assert_eq!(double.len(), expected.len(), "{item:?}");
    for (found, expected) in double.iter().zip(expected) {
        assert!(
            close(*found, *expected, tolerance),
            "{item:?}: {found} for {expected}"
        );
    }
    for (single, double) in single.iter().zip(&double) {
        assert!(
            close(f64::from(*single), *double, 6e-8),
            "{single} for {double}"
        );
    }
}

const LONG: &str = "xbus/markvilar-xsensmti-py/20260503_204234_xsensmti_with_gnss_recording.bin";

#[test]
fn a_recording_that_starts_inside_a_packet_is_decoded_completely() {
    let Some(bytes) = recording(LONG) else { return };
    let (packets, skipped) = read(&bytes);
    assert_eq!((packets.len(), skipped), (4936, 22));
    let (mut counter, mut solutions, mut measured) = (None, 0, 0);
    let (mut clock, mut times) = (SampleClock::new(), Vec::new());
    for packet in &packets {
        let items = items(packet);
        let is_solution = items
            .iter()
            .any(|(_, _, item)| matches!(item, Item::GnssPvt(_)));
        for (_, _, item) in items {
            match item {
                Item::PacketCounter(number) => {
                    let expected = counter.map_or(number, |last: u16| last.wrapping_add(1));
                    assert_eq!(number, expected);
                    counter = Some(number);
                }
                Item::SampleTimeFine(fine) => {
                    let time = clock.time(fine);
                    if !is_solution {
                        times.push(time);
                    }
                }
                Item::GnssPvt(pvt) => {
                    assert_eq!((pvt.fix_type, pvt.horizontal_speed()), (0, None));
                    solutions += 1;
                }
                Item::Quaternion(_, quaternion) => {
                    let size: f32 = quaternion.to_f32().iter().map(|c| c * c).sum();
                    assert!((size - 1.0).abs() < 1e-5);
                    measured += 1;
                }
                _ => {}
            }
        }
    }
    assert_eq!((solutions, measured), (190, 4746));
    // The samples come at 100 Hz, without gaps.
    assert!(times.windows(2).all(|pair| pair[1] - pair[0] == 10_000));
    assert_eq!(times[times.len() - 1] - times[0], 47_450_000);
}

#[test]
fn pieces_of_any_size_give_the_same_packets() {
    let mut random = Random::new(5);
    for name in [LONG, "xbus/einride-xsens-go/4/output.bin"] {
        let Some(bytes) = recording(name) else { return };
        let whole = read(&bytes);
        assert_eq!(read_in_pieces(&bytes, || 1), whole);
        for longest in [2, 13, 90, 700] {
            assert_eq!(read_in_pieces(&bytes, || 1 + random.below(longest)), whole);
        }
    }
}

#[test]
fn any_changed_byte_costs_at_most_the_packet_it_is_in() {
    let (mut changes, mut invented) = (0, 0);
    for log in 1..=5 {
        let Some(bytes) = recording(&format!("xbus/einride-xsens-go/{log}/output.bin")) else {
            return;
        };
        let (packets, _) = read(&bytes);
        // The packet with a solution, which is the longest kind, and the one after it, followed by enough bytes to
        // complete any false length.
        let solution = |p: &Read| {
            items(p)
                .iter()
                .any(|(_, _, i)| matches!(i, Item::GnssPvt(_)))
        };
        let first = packets
            .iter()
            .position(solution)
            .expect("a solution in every log");
        let start: usize = packets[..first].iter().map(|p| p.data.len() + 5).sum();
        let stream = &bytes[start..(start + 9_000).min(bytes.len())];
        let (expected, _) = read(stream);
        let hit_length = expected[0].data.len() + 5 + expected[1].data.len() + 5;
        for at in 0..hit_length {
            let hit = usize::from(at >= expected[0].data.len() + 5);
            for mask in 1..=255u8 {
                let mut changed = stream.to_vec();
                changed[at] ^= mask;
                let (found, _) = read(&changed);
                let mut others = expected.clone();
                others.remove(hit);
                let lost = others
                    .iter()
                    .filter(|packet| !found.contains(packet))
                    .count();
                assert_eq!(lost, 0, "log {log}, byte {at}, mask {mask:#04x}");
                // An 8-bit checksum may accept damaged bytes as another packet, but never as a measurement.
                let odd = found.iter().filter(|packet| !others.contains(packet));
                for packet in odd {
                    assert_ne!(
                        packet.message_id,
                        MessageId::MT_DATA2,
                        "log {log}, byte {at}"
                    );
                    invented += 1;
                }
                changes += 1;
            }
        }
    }
    eprintln!("{changes} changes, {invented} packets that are no measurements");
    assert!(changes > 300_000 && invented * 100_000 < changes);
}

#[test]
fn golden_payloads_are_understood_to_the_last_item() {
    let Some(text) = recording("xbus/Scottapotamas-xsens-mti/mtmanager_packets.md") else {
        return;
    };
    let text = String::from_utf8(text).expect("the page is text");
    let (mut payloads, mut found_items) = (0, 0);
    for line in text.lines() {
        let words: Vec<&str> = line.split_whitespace().collect();
        let bytes: Option<Vec<u8>> = words
            .iter()
            .map(|word| {
                u8::from_str_radix(word, 16)
                    .ok()
                    .filter(|_| word.len() == 2)
            })
            .collect();
        let Some(payload) = bytes.filter(|bytes| bytes.len() > 30 && bytes[..3] == [0x10, 0x20, 2])
        else {
            continue;
        };
        let mut packet = [0; 300];
        let mut writer = PacketWriter::new(&mut packet, MessageId::MT_DATA2);
        writer.data(&payload).expect("it fits");
        let length = writer.finish().expect("it fits");
        let (found, _) = read(&packet[..length]);
        assert_eq!(found.len(), 1, "{line}");
        for (_, _, item) in items(&found[0]) {
            assert!(!matches!(item, Item::Unknown(_)), "{item:?}");
            if let Item::StatusWord(status) = item
                && status.0 == 0x0048_1401
            {
                assert_eq!(status.accelerometer_clipped(), [false, false, true]);
                assert_eq!(status.gyroscope_clipped(), [false, true, false]);
            }
            found_items += 1;
        }
        payloads += 1;
    }
    assert_eq!((payloads, found_items), (6, 11 + 10 + 9 + 12 + 11 + 4));
}

/// Solutions whose frames are intact, in either of the two layouts of NAV-PVT (84 and 92 bytes), found without a
/// decoder's state: a false start hides none of them.
fn intact_solutions(bytes: &[u8]) -> usize {
    let is_intact = |frame: &[u8]| {
        let sum = |[a, b]: [u8; 2], byte: &u8| {
            let a = a.wrapping_add(*byte);
            [a, b.wrapping_add(a)]
        };
        matches!(frame, [0xB5, 0x62, checked @ .., a, b] if checked.iter().fold([0; 2], sum) == [*a, *b])
    };
    let starts = (0..bytes.len()).filter_map(|start| bytes.get(start..));
    starts
        .filter(|rest| match rest {
            [0xB5, 0x62, 1, 7, length @ (84 | 92), 0, ..] => {
                rest.get(..usize::from(*length) + 8).is_some_and(is_intact)
            }
            _ => false,
        })
        .count()
}

#[test]
fn every_intact_solution_of_a_receiver_is_found() {
    let Some(folder) = bodyflight_shared_data::shared("cases/xbus") else {
        return;
    };
    for (name, number) in [("ubx-swallow.ubx", 603), ("ubx-falsesync.ubx", 20)] {
        let bytes = fs::read(folder.join(name)).expect("readable");
        let mut decoder = bodyflight_core::ubx::Decoder::new();
        let found = bytes.iter().filter_map(|byte| decoder.push(*byte)).count();
        assert_eq!([found, intact_solutions(&bytes)], [number; 2], "{name}");
    }
}
