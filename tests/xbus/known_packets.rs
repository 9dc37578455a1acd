//! Packets from the vendor's manual and public logs, with their contents (`vectors.json`).

use core::fmt::Write as _;

use bodyflight_core::xbus::{GnssPvt, Item, MAX_PACKET_LENGTH, PacketWriter};

use super::{assert_numbers, items, read, recording};

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

        // The writer produces the same bytes.
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
    let [north, east, down] = pvt.velocity_ned_mmps;
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
        pvt.ground_speed_mmps,
        f64::from(pvt.heading_motion_e5) * 1e-5,
    )
}
