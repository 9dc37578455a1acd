//! Axes of the sensor and of the earth are converted to those of the model; a receiver's solutions are attached to
//! samples.

use bodyflight_core::xbus::{CoordinateSystem, DataId, NumberFormat};
use std::vec::Vec;

use super::*;
use crate::test_line::{ATTITUDE, counted_packet, forwarded_solution, packet, solution};

fn moving_packet(
    system: CoordinateSystem,
    wxyz: [f32; 4],
    turn: [f32; 3],
    velocity: [f32; 3],
) -> Vec<u8> {
    let of = |id: DataId| id.with(system, NumberFormat::Float32);
    packet(&[
        (of(DataId::QUATERNION), &wxyz),
        (DataId::RATE_OF_TURN, &turn),
        (of(DataId::VELOCITY_XYZ), &velocity),
    ])
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
        let bytes = moving_packet(system, wxyz, [0.1, 0.2, 0.3], velocity);
        let Sensed { header, sample, .. } = sensor.next(&mut bytes.as_slice(), 42, None).unwrap();
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
    let bytes = moving_packet(
        CoordinateSystem::NorthWestUp,
        [1.0, 0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0; 3],
    );
    let Sensed { sample, .. } = sensor.next(&mut bytes.as_slice(), 0, None).unwrap();
    let spin = sample.motion().angular_velocity.unwrap().components;
    assert!((spin - Vector3::z()).norm() < 2e-3, "{spin}");
    // The body's Z points where the sensor's X does: to the north.
    let up = sample.inertial_from_body().quaternion() * Vector3::z();
    assert!((up - Vector3::x()).norm() < 1e-3, "{up}");
}

#[test]
fn packets_without_an_attitude_are_not_samples() {
    let mut sensor = Sensor::new();
    let bytes = packet(&[(DataId::RATE_OF_TURN, &[0.0; 3])]);
    assert!(sensor.next(&mut bytes.as_slice(), 0, None).is_none());
    // A quaternion of zeros is not a rotation.
    let bytes = moving_packet(CoordinateSystem::NorthWestUp, [0.0; 4], [0.0; 3], [0.0; 3]);
    assert!(sensor.next(&mut bytes.as_slice(), 0, None).is_none());
}

#[test]
fn a_receivers_solution_is_attached_to_the_next_sample() {
    let solution = solution([30.0, 1.0, -50.0], 0.24);
    let mut sensor = Sensor::new();
    let bytes = packet(&[(ATTITUDE, &[1.0, 0.0, 0.0, 0.0])]);
    // The solution arrives between two packets of the sensor, in two parts.
    let mut found = Vec::new();
    for line in [
        &bytes[..],
        &solution[..40],
        &solution[40..],
        &bytes[..],
        &bytes[..],
    ] {
        sensor.receive_solutions(line, 0);
        let mut input = line;
        while let Some(Sensed {
            sample, sensors, ..
        }) = sensor.next(&mut input, 0, None)
        {
            found.push((sample.motion(), sensors.receiver()));
        }
    }
    let velocities: Vec<_> = found
        .iter()
        .map(|(motion, _)| motion.velocity.map(Vector::to_array))
        .collect();
    assert_eq!(velocities, [None, Some([30.0, 1.0, -50.0]), None]);
    assert!((found[1].0.horizontal_speed.unwrap() - 30.017).abs() < 0.01);
}

/// An MTi sends its receiver's solution in a packet of its own, which has the time of the solution.
#[test]
fn a_solution_that_the_sensor_forwards_is_a_velocity_of_its_own_time() {
    let mut sensor = Sensor::new();
    let sample =
        |counter, ticks| counted_packet(counter, ticks, &[(ATTITUDE, &[1.0, 0.0, 0.0, 0.0])]);
    let line = [
        sample(0, 10_000),
        // 0.12 s before the sample.
        forwarded_solution(8_800, [30_000, -8_000, 50_000], 240),
        sample(1, 10_042),
    ]
    .concat();
    let mut input = line.as_slice();
    let mut found = Vec::new();
    while let Some(sensed) = sensor.next(&mut input, 0, None) {
        found.push(sensed.sensors.receiver());
    }
    let [None, Some(receiver)] = found[..] else {
        panic!("{found:?}");
    };
    // North, west and up.
    let expected = [30.0_f32, 8.0, -50.0];
    assert_eq!(
        receiver.velocity.to_array().map(f32::to_bits),
        expected.map(f32::to_bits)
    );
    assert!(
        (receiver.horizontal_deviation - 0.24).abs() < 0.01,
        "{receiver:?}"
    );
    assert!((receiver.age - 0.12).abs() < 0.006, "{receiver:?}");
}

#[test]
fn the_specific_force_is_turned_to_body_axes() {
    let body_from_sensor =
        UnitQuaternion::from_axis_angle(&Vector3::y_axis(), -core::f32::consts::FRAC_PI_2);
    let mut sensor = Sensor::new();
    sensor.mount(body_from_sensor);
    let items: [(DataId, &[f32]); 2] = [
        (ATTITUDE, &[1.0, 0.0, 0.0, 0.0]),
        (DataId::ACCELERATION, &[9.81, 0.0, 0.0]),
    ];
    let bytes = counted_packet(0, 0, &items);
    let sensed = sensor.next(&mut bytes.as_slice(), 0, None).unwrap();
    let force = sensed.sensors.specific_force().unwrap().force.components;
    assert!(
        (force - Vector3::new(0.0, 0.0, 9.81)).norm() < 0.02,
        "{force}"
    );
    assert_eq!(sensed.sensors.receiver(), None);
    // NaN is no measurement.
    let items: [(DataId, &[f32]); 2] = [
        (ATTITUDE, &[1.0, 0.0, 0.0, 0.0]),
        (DataId::ACCELERATION, &[f32::NAN, 0.0, 0.0]),
    ];
    let bytes = counted_packet(1, 100, &items);
    let sensed = sensor.next(&mut bytes.as_slice(), 0, None).unwrap();
    assert_eq!(sensed.sensors.specific_force(), None);
}

#[test]
fn a_sensor_with_an_orientation_knows_when_it_is_still() {
    // Whether one is still after three seconds of a rate of turn that swings this far (rad/s).
    let after = |swing: f32, has_force: bool, receiver_speed: f32| {
        let mut sensor = Sensor::new();
        let mut is_still = false;
        for count in 0..300_u16 {
            let turn = [0.0, if count % 2 == 0 { swing } else { -swing }, 0.0];
            let mut items: Vec<(DataId, &[f32])> = Vec::from([
                (ATTITUDE, &[1.0, 0.0, 0.0, 0.0][..]),
                (DataId::RATE_OF_TURN, &turn[..]),
            ]);
            if has_force {
                items.push((DataId::ACCELERATION, &[0.0, 0.0, 9.81]));
            }
            if count % 20 == 0 {
                let velocity = [receiver_speed, 0.01 * f32::from(count), 0.0];
                sensor.receive_solutions(&solution(velocity, 0.2), u64::from(count) * 10_000);
            }
            let bytes = counted_packet(count, u32::from(count) * 100, &items);
            let sensed = sensor.next(&mut bytes.as_slice(), u64::from(count) * 10_000, None);
            is_still = sensed.unwrap().sensors.is_still();
        }
        is_still
    };
    assert!(after(0.01, true, 0.0));
    assert!(!after(0.05, true, 0.0));
    assert!(!after(0.01, false, 0.0));
    // In a smooth flight, or in an aircraft.
    assert!(!after(0.01, true, 50.0));
}

#[test]
fn a_restart_of_the_sensor_loses_nothing_but_the_packets_until_it_is_seen() {
    let mut sensor = Sensor::new();
    let items: [(DataId, &[f32]); 1] = [(ATTITUDE, &[1.0, 0.0, 0.0, 0.0])];
    let mut seen = |counter: u16, ticks: u32| {
        let bytes = counted_packet(counter, ticks, &items);
        sensor.next(&mut bytes.as_slice(), 0, None).unwrap().header
    };
    // Up for 40 minutes at 100 Hz.
    let before = seen(43_000, 24_000_000);
    let headers: Vec<_> = (0..50).map(|k| seen(k, u32::from(k) * 100)).collect();
    assert!(headers[0].time >= before.time + RESTART);
    assert!(headers.is_sorted_by(|a, b| a.time < b.time && b.sequence == a.sequence + 1));
    assert_eq!(headers[0].sequence, before.sequence + 1);
    assert_eq!(sensor.counts()[0], 1);
}

/// Numbers of the samples from three sensors on one line that send these items in turn.
fn numbers_from_three(items: &[(DataId, &[f32])]) -> Vec<u32> {
    let mut sensor = Sensor::new();
    let of = |address: u8, counter| {
        let mut bytes = counted_packet(counter, 0, items);
        let last = bytes.len() - 1;
        bytes[last] = bytes[last].wrapping_sub(address.wrapping_sub(bytes[1]));
        bytes[1] = address;
        bytes
    };
    let line = [of(1, 0), of(2, 0), of(3, 0), of(1, 1), of(2, 1), of(3, 1)].concat();
    let mut input = line.as_slice();
    let mut numbers = Vec::new();
    while let Some(sensed) = sensor.next(&mut input, 0, None) {
        numbers.push(sensed.header.sequence);
    }
    numbers
}

#[test]
fn of_several_sensors_on_a_line_the_first_counts() {
    let oriented = numbers_from_three(&[(ATTITUDE, &[1.0, 0.0, 0.0, 0.0])]);
    assert_eq!(oriented, [0, 1]);
    let raw = numbers_from_three(&[
        (DataId::RATE_OF_TURN, &[0.0; 3]),
        (DataId::ACCELERATION, &[0.0, 0.0, 9.8]),
    ]);
    assert_eq!(raw, [0, 1]);
}

/// An MTi counts its packets of solutions too; they are no missing samples.
#[test]
fn packets_without_an_orientation_are_not_missing() {
    let mut sensor = Sensor::new();
    let mut numbers = Vec::new();
    for (counter, with_attitude) in [(65_534, true), (65_535, false), (0, true), (3, true)] {
        let attitude: [(DataId, &[f32]); 1] = [(ATTITUDE, &[1.0, 0.0, 0.0, 0.0])];
        let items = if with_attitude { &attitude[..] } else { &[] };
        let bytes = counted_packet(counter, 0, items);
        let sensed = sensor.next(&mut bytes.as_slice(), 0, None);
        numbers.extend(sensed.map(|sensed| sensed.header.sequence));
    }
    // The packets counted 1 and 2 are missing.
    assert_eq!(numbers, [0, 1, 4]);
}

/// The same attitude as a quaternion, as angles and as a matrix.
#[test]
fn every_form_of_an_orientation_is_read() {
    let sent = UnitQuaternion::from_euler_angles(0.3_f32, -0.7, 2.1);
    let (roll, pitch, yaw) = (0.3_f32, -0.7_f32, 2.1_f32);
    let matrix = sent.to_rotation_matrix().matrix().transpose();
    let north = CoordinateSystem::NorthWestUp;
    let angles = [roll, pitch, yaw].map(f32::to_degrees);
    for (id, numbers) in [
        (DataId::EULER_ANGLES, &angles[..]),
        (DataId::ROTATION_MATRIX, matrix.as_slice()),
    ] {
        let bytes = packet(&[(id.with(north, NumberFormat::Float32), numbers)]);
        let sensed = Sensor::new().next(&mut bytes.as_slice(), 0, None).unwrap();
        let found = sensed.sample.inertial_from_body();
        assert!(found.quaternion().angle_to(&sent) < 1e-3, "{found:?}");
    }
}
