//! Axes of the sensor and of the earth are converted to those of the model; a receiver's solutions are attached to
//! samples.

use bodyflight_core::xbus::{CoordinateSystem, DataId, MessageId, NumberFormat, PacketWriter};
use std::vec::Vec;

use super::*;

fn packet(system: CoordinateSystem, wxyz: [f32; 4], turn: [f32; 3], velocity: [f32; 3]) -> Vec<u8> {
    let mut bytes = [0; 128];
    let mut writer = PacketWriter::new(&mut bytes, MessageId::MT_DATA2);
    writer
        .reals(
            DataId::QUATERNION.with(system, NumberFormat::Float32),
            &wxyz,
        )
        .unwrap();
    writer.reals(DataId::RATE_OF_TURN, &turn).unwrap();
    writer
        .reals(
            DataId::VELOCITY_XYZ.with(system, NumberFormat::Float32),
            &velocity,
        )
        .unwrap();
    let length = writer.finish().unwrap();
    bytes[..length].to_vec()
}

#[test]
fn every_earth_frame_is_converted_to_the_models() {
    // The same attitude and velocity, 30 m/s to the north, in the convention of each kind of sensor: X to the north.
    let half = core::f32::consts::FRAC_1_SQRT_2;
    for (system, wxyz, velocity) in [
        (
            CoordinateSystem::NorthWestUp,
            [1.0, 0.0, 0.0, 0.0],
            [30.0, 0.0, -50.0],
        ),
        (
            CoordinateSystem::EastNorthUp,
            [half, 0.0, 0.0, half],
            [0.0, 30.0, -50.0],
        ),
        (
            CoordinateSystem::NorthEastDown,
            [0.0, 1.0, 0.0, 0.0],
            [30.0, 0.0, 50.0],
        ),
    ] {
        let mut sensor = Sensor::new();
        let bytes = packet(system, wxyz, [0.1, 0.2, 0.3], velocity);
        let (header, sample) = sensor.next(&mut bytes.as_slice(), 42).unwrap();
        assert_eq!((header.sequence, header.time), (0, 42));
        let turn = sample.inertial_from_body().quaternion().angle();
        assert!(turn < 1e-3, "{system:?}: {turn}");
        let found = sample.motion().velocity.unwrap().components;
        assert!(
            (found - Vector3::new(30.0, 0.0, -50.0)).norm() < 0.01,
            "{system:?}: {found}"
        );
    }
}

#[test]
fn the_mounting_turns_attitude_and_angular_velocity() {
    // The sensor's X points along the body's Z.
    let body_from_sensor =
        UnitQuaternion::from_axis_angle(&Vector3::y_axis(), -core::f32::consts::FRAC_PI_2);
    let mut sensor = Sensor::new();
    sensor.mount(body_from_sensor);
    let bytes = packet(
        CoordinateSystem::NorthWestUp,
        [1.0, 0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0; 3],
    );
    let (_, sample) = sensor.next(&mut bytes.as_slice(), 0).unwrap();
    let spin = sample.motion().angular_velocity.unwrap().components;
    assert!((spin - Vector3::z()).norm() < 2e-3, "{spin}");
    // The body's Z points where the sensor's X does: to the north.
    let up = sample.inertial_from_body().quaternion() * Vector3::z();
    assert!((up - Vector3::x()).norm() < 1e-3, "{up}");
}

#[test]
fn packets_without_an_attitude_are_not_samples() {
    let mut bytes = [0; 64];
    let mut writer = PacketWriter::new(&mut bytes, MessageId::MT_DATA2);
    writer.reals(DataId::RATE_OF_TURN, &[0.0; 3]).unwrap();
    let length = writer.finish().unwrap();
    let mut sensor = Sensor::new();
    assert!(sensor.next(&mut &bytes[..length], 0).is_none());
    // A quaternion of zeros is not a rotation.
    let bytes = packet(CoordinateSystem::NorthWestUp, [0.0; 4], [0.0; 3], [0.0; 3]);
    assert!(sensor.next(&mut bytes.as_slice(), 0).is_none());
}

#[test]
fn a_receivers_solution_is_attached_to_the_next_sample() {
    let mut payload = [0; 92];
    let mut put = |at: usize, value: i32| payload[at..at + 4].copy_from_slice(&value.to_le_bytes());
    for (at, value) in [(48, 30_000), (52, -1_000), (56, 50_000), (60, 30_017)] {
        put(at, value);
    }
    (payload[20], payload[21]) = (3, 1);
    let mut covered = std::vec![0x01, 0x07, 92, 0];
    covered.extend(payload);
    let sums = covered.iter().fold([0_u8; 2], |[a, b], byte| {
        let a = a.wrapping_add(*byte);
        [a, b.wrapping_add(a)]
    });
    let solution = [&[0xb5, 0x62], &covered[..], &sums].concat();
    let mut sensor = Sensor::new();
    let mut bytes = [0; 64];
    let mut writer = PacketWriter::new(&mut bytes, MessageId::MT_DATA2);
    let attitude = DataId::QUATERNION.with(CoordinateSystem::NorthWestUp, NumberFormat::Float32);
    writer.reals(attitude, &[1.0, 0.0, 0.0, 0.0]).unwrap();
    let length = writer.finish().unwrap();
    // The solution arrives between two packets of the sensor, in two parts.
    let mut found = Vec::new();
    for line in [
        &bytes[..length],
        &solution[..40],
        &solution[40..],
        &bytes[..length],
        &bytes[..length],
    ] {
        sensor.receive_solutions(line);
        let mut input = line;
        while let Some((_, sample)) = sensor.next(&mut input, 0) {
            found.push(sample.motion());
        }
    }
    let velocities: Vec<_> = found
        .iter()
        .map(|motion| motion.velocity.map(Vector::to_array))
        .collect();
    assert_eq!(velocities, [None, Some([30.0, 1.0, -50.0]), None]);
    assert!((found[1].horizontal_speed.unwrap() - 30.017).abs() < 0.01);
}
