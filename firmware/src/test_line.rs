//! What a sensor and a receiver send, for the tests of this crate.

use std::vec::Vec;

use bodyflight_core::ubx::NavPvt;
use bodyflight_core::xbus::{
    CoordinateSystem, DataId, GnssPvt, MessageId, NumberFormat, PacketWriter,
};

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

/// A packet in which an MTi forwards its receiver's solution of the time `ticks`: velocity north, east and down, and its
/// accuracy (mm/s).
pub(crate) fn forwarded_solution(ticks: u32, velocity: [i32; 3], accuracy: u32) -> Vec<u8> {
    let mut solution = [0; GnssPvt::SIZE];
    // Kind of fix, flags, velocity, accuracy of the speed.
    solution[20..22].copy_from_slice(&[3, 1]);
    for (place, value) in velocity.into_iter().enumerate() {
        solution[48 + 4 * place..][..4].copy_from_slice(&value.to_be_bytes());
    }
    solution[68..72].copy_from_slice(&accuracy.to_be_bytes());
    let ticks = ticks.to_be_bytes();
    packet_of(
        &[
            (DataId::SAMPLE_TIME_FINE, &ticks),
            (DataId::GNSS_PVT, &solution),
        ],
        &[],
    )
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
