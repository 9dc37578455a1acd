//! What a sensor and a receiver send, for the tests of this crate.

use std::vec::Vec;

use bodyflight_core::ubx::NavPvt;
use bodyflight_core::xbus::{CoordinateSystem, DataId, MessageId, NumberFormat, PacketWriter};

/// An attitude in the model's inertial axes.
pub(crate) const ATTITUDE: DataId =
    DataId::QUATERNION.with(CoordinateSystem::NorthWestUp, NumberFormat::Float32);

/// A packet of measurements with these items.
pub(crate) fn packet(items: &[(DataId, &[f32])]) -> Vec<u8> {
    packet_of(&[], items)
}

/// The same with the sensor's counter, and its clock at `ticks`.
pub(crate) fn counted_packet(counter: u16, ticks: u32, items: &[(DataId, &[f32])]) -> Vec<u8> {
    let (counter, ticks) = (counter.to_be_bytes(), ticks.to_be_bytes());
    let head: [(DataId, &[u8]); 2] = [
        (DataId::PACKET_COUNTER, &counter),
        (DataId::SAMPLE_TIME_FINE, &ticks),
    ];
    packet_of(&head, items)
}

fn packet_of(head: &[(DataId, &[u8])], items: &[(DataId, &[f32])]) -> Vec<u8> {
    let mut bytes = [0; 256];
    let mut writer = PacketWriter::new(&mut bytes, MessageId::MT_DATA2);
    for (id, value) in head {
        writer.item(*id, value).unwrap();
    }
    for (id, values) in items {
        writer.reals(*id, values).unwrap();
    }
    let length = writer.finish().unwrap();
    bytes[..length].to_vec()
}

/// A receiver's solution with this velocity (north, west, up), whose ground speed is accurate to `accuracy` (m/s).
pub(crate) fn solution([north, west, up]: [f32; 3], accuracy: f32) -> Vec<u8> {
    let solution = NavPvt {
        time_of_week_ms: 0,
        fix: 3,
        is_valid: true,
        height_m: 0.0,
        velocity_mps: [north, west, up].into(),
        ground_speed_mps: north.hypot(west),
        speed_accuracy_mps: accuracy,
        height_msl_m: 0.0,
        vertical_accuracy_m: 0.0,
    };
    solution.encode().to_vec()
}
