//! Xbus decoder against recordings of real sensors and packets with known contents.
#![expect(
    clippy::expect_used,
    clippy::panic,
    reason = "a test fails by panicking"
)]

use core::fmt::Write as _;
use std::fs;
use std::path::PathBuf;

use bodyflight_core::link::fault::Random;
use bodyflight_core::xbus::{
    Decoder, GnssPvt, Item, MAX_PACKET_LENGTH, MessageId, PacketWriter, SampleClock, UtcTime,
};

/// A file of the recordings, or a visible note that it is not there.
fn recording(name: &str) -> Option<Vec<u8>> {
    let path: PathBuf = [env!("CARGO_MANIFEST_DIR"), "../../shared/data", name]
        .iter()
        .collect();
    let bytes = fs::read(&path).ok();
    if bytes.is_none() {
        eprintln!("skipped: {} is not there", path.display());
    }
    bytes
}

/// A packet that owns its data.
#[derive(Debug, Clone, PartialEq)]
struct Read {
    bus_id: u8,
    message_id: MessageId,
    data: Vec<u8>,
}

/// All packets of `bytes` in pieces whose sizes come from `piece`, and the bytes skipped.
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

/// The items of one packet as name and numbers, in the order sent.
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

/// Numbers against text of so many digits, and single precision against double.
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

fn utc_text(time: &UtcTime) -> String {
    let mut text = format!(
        "{:04}-{:02}-{:02}T{:02}:{:02}:{:02}",
        time.year, time.month, time.day, time.hour, time.minute, time.second
    );
    if time.nanosecond > 0 {
        let fraction = format!(".{:09}", time.nanosecond);
        text.push_str(fraction.trim_end_matches('0'));
    }
    text + "Z"
}

#[test]
fn every_known_packet_decodes_to_its_known_contents() {
    let Some(text) = recording("vectors.json") else {
        return;
    };
    let vectors: serde_json::Value = serde_json::from_slice(&text).expect("vectors.json is JSON");
    let packets = vectors["xbus"].as_array().expect("a list of packets");
    assert_eq!(packets.len(), 34);
    let mut compared = 0;
    for vector in packets {
        let (name, hex) = (&vector["name"], vector["hex"].as_str().expect("hex"));
        let bytes: Vec<u8> = (0..hex.len() / 2)
            .map(|i| u8::from_str_radix(&hex[2 * i..2 * i + 2], 16).expect("hex digits"))
            .collect();
        let (found, skipped) = read(&bytes);
        assert_eq!((found.len(), skipped), (1, 0), "{name}");
        let packet = &found[0];
        assert_eq!(vector["bid"], packet.bus_id, "{name}");
        assert_eq!(vector["mid"], packet.message_id.0, "{name}");
        assert_eq!(vector["len"], packet.data.len(), "{name}");

        // The writer makes the same bytes.
        let mut again = [0; MAX_PACKET_LENGTH];
        let mut writer = PacketWriter::new(&mut again, packet.message_id);
        writer.data(&packet.data).expect("it fits");
        let length = writer.finish().expect("it fits");
        assert_eq!(&again[..length], bytes, "{name}");

        let Some(expected) = vector["items"].as_array() else {
            continue;
        };
        let found = items(packet);
        assert_eq!(found.len(), expected.len(), "{name}");
        for ((id, size, item), expected) in found.iter().zip(expected) {
            assert_eq!(expected["did"], format!("{id:04x}"), "{name}");
            assert_eq!(expected["len"], *size, "{name}");
            let text = expected["decoded"].as_str().expect("text");
            assert_vector(item, text);
            compared += 1;
        }
    }
    assert_eq!(compared, 150);
}

fn assert_vector(item: &Item<'_>, text: &str) {
    let (kind, rest) = text.split_once(' ').unwrap_or((text, ""));
    match (item, kind) {
        (Item::Unknown(raw), _) => {
            let mut hex = String::new();
            for byte in raw.data {
                write!(hex, "{byte:02x} ").expect("a string takes all");
            }
            assert_eq!(hex.trim_end(), text);
        }
        (Item::StatusWord(status) | Item::StatusByte(status), _) => {
            let digits = rest.trim_start_matches("0x");
            assert_eq!(u32::from_str_radix(digits, 16), Ok(status.0));
        }
        (Item::UtcTime(time), "UTC") => {
            let found = format!(
                "ns={} {:04}-{:02}-{:02} {:02}:{:02}:{:02} flags=0x{:02x}",
                time.nanosecond,
                time.year,
                time.month,
                time.day,
                time.hour,
                time.minute,
                time.second,
                time.flags
            );
            assert_eq!(found, rest);
        }
        (Item::GnssPvt(pvt), "PVT") => assert_eq!(pvt_text(pvt), rest),
        _ => {
            let expected: Vec<f64> = rest
                .split(' ')
                .filter_map(|word| word.parse().ok())
                .collect();
            assert_numbers(item, &expected, 1e-8);
        }
    }
}

fn pvt_text(pvt: &GnssPvt) -> String {
    let [north, east, down] = pvt.velocity_ned_mm_s;
    format!(
        "itow={} {:04}-{:02}-{:02} {:02}:{:02}:{:02} valid={:02x} fix={} flags={:02x} nSV={} \
         lon={:.7} lat={:.7} h={}mm hMSL={}mm hAcc={} vAcc={} velNED=({north}, {east}, {down}) \
         gS={} head={:.5}",
        pvt.time_of_week_ms,
        pvt.year,
        pvt.month,
        pvt.day,
        pvt.hour,
        pvt.minute,
        pvt.second,
        pvt.valid,
        pvt.fix_type,
        pvt.flags,
        pvt.satellites,
        f64::from(pvt.longitude_e7) * 1e-7,
        f64::from(pvt.latitude_e7) * 1e-7,
        pvt.height_mm,
        pvt.height_msl_mm,
        pvt.horizontal_accuracy_mm,
        pvt.vertical_accuracy_mm,
        pvt.ground_speed_mm_s,
        f64::from(pvt.heading_motion_e5) * 1e-5,
    )
}

/// Fields of a solution in the order of the golden text.
fn pvt_fields(pvt: &GnssPvt) -> Vec<i64> {
    let mut fields: Vec<i64> = vec![
        pvt.time_of_week_ms.into(),
        pvt.year.into(),
        pvt.month.into(),
        pvt.day.into(),
        pvt.hour.into(),
        pvt.minute.into(),
        pvt.second.into(),
        pvt.valid.into(),
        pvt.time_accuracy_ns.into(),
        pvt.nanosecond.into(),
        pvt.fix_type.into(),
        pvt.flags.into(),
        pvt.satellites.into(),
        0,
        pvt.longitude_e7.into(),
        pvt.latitude_e7.into(),
        pvt.height_mm.into(),
        pvt.height_msl_mm.into(),
        pvt.horizontal_accuracy_mm.into(),
        pvt.vertical_accuracy_mm.into(),
    ];
    fields.extend(pvt.velocity_ned_mm_s.map(i64::from));
    fields.extend([
        i64::from(pvt.ground_speed_mm_s),
        pvt.heading_motion_e5.into(),
        pvt.speed_accuracy_mm_s.into(),
        pvt.heading_accuracy_e5.into(),
        pvt.heading_vehicle_e5.into(),
    ]);
    fields.extend(pvt.dilution_e2.map(i64::from));
    fields
}

/// Name of an item in the golden texts.
fn golden_name(item: &Item<'_>) -> &'static str {
    match item {
        Item::PacketCounter(_) => "PacketCounter",
        Item::SampleTimeFine(_) => "SampleTimeFine",
        Item::SampleTimeCoarse(_) => "SampleTimeCoarse",
        Item::UtcTime(_) => "UTCTime",
        Item::StatusByte(_) => "StatusByte",
        Item::StatusWord(_) => "StatusWord",
        Item::Quaternion(..) => "Quaternion",
        Item::RotationMatrix(..) => "RotationMatrix",
        Item::EulerAngles(..) => "EulerAngles",
        Item::Acceleration(_) => "Acceleration",
        Item::FreeAcceleration(_) => "FreeAcceleration",
        Item::DeltaV(_) => "DeltaV",
        Item::RateOfTurn(_) => "RateOfTurn",
        Item::DeltaQ(_) => "DeltaQ",
        Item::LatLon(_) => "LatLon",
        Item::AltitudeEllipsoid(_) => "AltitudeEllipsoid",
        Item::PositionEcef(_) => "PositionECEF",
        Item::VelocityXyz(..) => "VelocityXYZ",
        Item::Temperature(_) => "Temperature",
        Item::MagneticField(_) => "MagneticField",
        Item::BaroPressure(_) => "BaroPressure",
        Item::GnssPvt(_) => "GNSSPVTData",
        Item::Unknown(raw) if raw.id.0 == 0x7020 => "GNSSSatInfo",
        other => panic!("{other:?} is not in the recordings"),
    }
}

#[test]
fn five_recordings_decode_to_their_golden_texts() {
    let (mut compared, mut solutions) = (0, 0);
    for log in 1..=5 {
        let folder = format!("xbus/einride-xsens-go/{log}");
        let (Some(bytes), Some(golden)) = (
            recording(&format!("{folder}/output.bin")),
            recording(&format!("{folder}/output.golden")),
        ) else {
            return;
        };
        let golden = String::from_utf8(golden).expect("the golden text is text");
        let (packets, skipped) = read(&bytes);
        assert_eq!((packets.len(), skipped), (100, 0), "log {log}");
        let blocks: Vec<&str> = golden
            .split("\n\n")
            .filter(|b| !b.trim().is_empty())
            .collect();
        assert_eq!(blocks.len(), 100, "log {log}");
        for (packet, block) in packets.iter().zip(blocks) {
            let mut lines = block.lines().peekable();
            for (_, _, item) in items(packet) {
                let title = lines.next().expect("an item in the golden text");
                let name = title.trim_end_matches(':').split('(').next();
                assert_eq!(name, Some(golden_name(&item)), "log {log}");
                let mut values = Vec::new();
                while let Some(line) = lines.next_if(|line| line.starts_with(' ')) {
                    values.push(line.trim());
                }
                assert_golden(&item, &values);
                compared += 1;
                solutions += usize::from(matches!(item, Item::GnssPvt(_)));
            }
            assert_eq!(lines.next(), None, "log {log}: an item was not decoded");
        }
    }
    // As many as there are titles in the golden texts.
    assert_eq!((compared, solutions), (5_588, 19));
}

fn assert_golden(item: &Item<'_>, values: &[&str]) {
    let after_colon = |value: &str| value.rsplit(':').next().map(str::to_owned);
    let whole = || -> Vec<i64> {
        values
            .iter()
            .filter_map(|value| after_colon(value)?.parse().ok())
            .collect()
    };
    match item {
        Item::UtcTime(time) => assert_eq!(values, [utc_text(time)]),
        Item::StatusByte(status) => {
            assert_eq!(u32::from_str_radix(values[0], 2), Ok(status.0));
        }
        Item::StatusWord(status) => {
            assert_eq!(u32::from_str_radix(values[0], 2), Ok(status.0));
        }
        Item::GnssPvt(pvt) => assert_eq!(pvt_fields(pvt), whole()),
        // Satellites are stepped over by size: here only that the item is whole.
        Item::Unknown(raw) => assert_eq!(raw.data.len(), 8 + 4 * usize::from(raw.data[4])),
        _ => {
            let expected: Vec<f64> = values
                .iter()
                .filter_map(|value| after_colon(value)?.parse().ok())
                .collect();
            assert_numbers(item, &expected, 1e-12);
        }
    }
}

const LONG: &str = "xbus/markvilar-xsensmti-py/20260503_204234_xsensmti_with_gnss_recording.bin";

#[test]
fn a_recording_that_starts_inside_a_packet_decodes_whole() {
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
    // 100 Hz without a gap.
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
        // The packet with a solution, the longest kind, and the one after it; enough behind them to end any
        // false length.
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
                // A sum of 8 bits may make some other packet of damaged bytes, but never a measurement.
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
