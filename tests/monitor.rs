//! What `monitor` says of streams that are not what they should be: real kinds of faults, and lines at a wrong speed.
#![expect(clippy::expect_used, reason = "a test fails by panicking")]

use bodyflight_core::link::fault::Random;
use bodyflight_core::xbus::{MessageId, PacketWriter};
use bodyflight_unit::monitor::{Xbus, XbusTotals};

fn watched(bytes: &[u8]) -> XbusTotals {
    let mut monitor = Xbus::new();
    for piece in bytes.chunks(61) {
        monitor.push(piece);
    }
    monitor.finish();
    monitor.totals()
}

/// The only finding of a stream.
fn finding(bytes: &[u8]) -> String {
    let findings = watched(bytes).findings;
    assert_eq!(findings.len(), 1, "{findings:?}");
    findings.into_iter().next().expect("one")
}

#[test]
fn faults_of_a_sensor_s_stream_are_named() {
    let Some(folder) = bodyflight_shared_data::shared("cases/xbus") else {
        return;
    };
    for (name, said) in [
        ("mtdata-legacy.bin", "legacy MTData"),
        ("mtdata2-reset.bin", "restarted once"),
        ("nan.bin", "no numbers"),
        ("utc-invalid.bin", "5 of 5 UTC times"),
        ("little-endian.bin", "little-endian"),
    ] {
        let bytes = std::fs::read(folder.join(name)).expect("readable");
        let found = finding(&bytes);
        assert!(found.contains(said), "{name}: {found}");
    }
    // The counter of a sensor that restarts misses nothing, and its rate stays what it was.
    let bytes = std::fs::read(folder.join("mtdata2-reset.bin")).expect("readable");
    let totals = watched(&bytes);
    assert_eq!(totals.missing_packets, 0);
    let rate = totals.items[0].rate_hz.expect("a clock");
    assert!((rate - 100.0).abs() < 3.0, "{rate}");
}

#[test]
fn a_line_at_another_speed_and_other_protocols_are_named() {
    let mut random = Random::new(7);
    let noise: Vec<u8> = (0..4000).map(|_| random.bits().to_le_bytes()[0]).collect();
    assert!(finding(&noise).contains("speed of the line"));
    let text = b"$GPRMC,120000.00,A,4500.0,N,00900.0,E,0.0,0.0,010124,,,A*68\r\n".repeat(20);
    assert!(finding(&text).contains("NMEA"));
    let mut ubx = Vec::new();
    for byte in 0..40 {
        ubx.extend([0xB5, 0x62, 0x01, 0x07, 4, 0, byte, 200, 3, 129, 7, 9]);
    }
    assert!(finding(&ubx).contains("UBX"));
}

#[test]
fn errors_that_a_sensor_reports_are_named() {
    let mut bytes = [0; 16];
    let writer = PacketWriter::new(&mut bytes, MessageId::ERROR);
    let length = writer.finish().expect("room");
    // A packet of one byte of data, 1E, with its checksum.
    let mut packet = bytes[..length].to_vec();
    packet[3] = 1;
    packet.insert(4, 0x1E);
    let last = packet.len() - 1;
    let sum = packet[1..last]
        .iter()
        .fold(0_u8, |sum, byte| sum.wrapping_add(*byte));
    packet[last] = sum.wrapping_neg();
    let found = finding(&packet.repeat(3));
    assert!(
        found.contains("error 1e 3 times: its timer overflowed"),
        "{found}"
    );
}

#[test]
fn a_good_stream_has_no_findings() {
    let mut all = Vec::new();
    for counter in 0..50_u16 {
        let mut bytes = [0; 64];
        let mut writer = PacketWriter::new(&mut bytes, MessageId::MT_DATA2);
        writer
            .item(
                bodyflight_core::xbus::DataId::PACKET_COUNTER,
                &counter.to_be_bytes(),
            )
            .expect("room");
        writer
            .reals(
                bodyflight_core::xbus::DataId::ACCELERATION,
                &[0.1, -0.2, 9.8],
            )
            .expect("room");
        let length = writer.finish().expect("room");
        all.extend_from_slice(&bytes[..length]);
    }
    let totals = watched(&all);
    assert_eq!((totals.packets, totals.findings), (50, Vec::new()));
}
