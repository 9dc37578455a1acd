//! Compares five logs of a real sensor with the output of another decoder.

use bodyflight_core::xbus::{GnssPvt, Item, UtcTime};

use super::{assert_numbers, items, read, recording};

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
    fields.extend(pvt.velocity_ned_mmps.map(i64::from));
    fields.extend([
        i64::from(pvt.ground_speed_mmps),
        pvt.heading_motion_e5.into(),
        pvt.speed_accuracy_mmps.into(),
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
    // The golden texts have this many titles.
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
        // Satellites are skipped by size: this only checks that the item is complete.
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
