//! Examples of every message, shared by the tests below.

extern crate std;

mod damage;
mod documentation;
mod golden;
mod injected;

use super::*;
use crate::body::Segment;
use crate::body::posture::Posture;
use crate::frame::{Rotation, Vector};

fn header() -> Header {
    Header {
        session: 0x0102,
        sequence: 0xFFFF_FFFE,
        time: 4_166_667,
    }
}

fn equal_quaternion() -> nalgebra::UnitQuaternion<f32> {
    nalgebra::UnitQuaternion::new_unchecked(nalgebra::Quaternion::new(0.5, -0.5, 0.5, -0.5))
}

fn sample() -> Sample {
    let half = core::f32::consts::FRAC_1_SQRT_2;
    // These are exact in single precision on every machine: identity, half turns, and four equal components.
    let quarter = nalgebra::Quaternion::new(half, -half, 0.0, 0.0);
    let unit = nalgebra::UnitQuaternion::new_unchecked;
    let posture = Posture::h_pose()
        .with(Segment::LeftUpperArm, unit(quarter))
        .with(Segment::RightFoot, equal_quaternion());
    let attitude = Rotation::from_quaternion(unit(nalgebra::Quaternion::new(0.0, 0.0, -1.0, 0.0)));
    let motion = Motion {
        angular_velocity: Some(Vector::new(0.5, -1.25, 31.0)),
        velocity: Some(Vector::new(-2.0, 0.0, -55.5)),
        horizontal_speed: None,
    };
    Sample::new(&posture, &attitude, &motion)
}

fn examples() -> std::vec::Vec<Message> {
    [commands(), answers()].concat()
}

/// Messages that a host sends.
fn commands() -> std::vec::Vec<Message> {
    std::vec![
        Message::Hello(Hello {
            schema_hash: 0x0123_4567_89AB_CDEF,
            max_frame_length: 144,
        }),
        Message::HelloAcknowledge(HelloAcknowledge {
            schema_hash: 0x0123_4567_89AB_CDEF,
            build: *b"\x93\x0b\xf8\x58\0\0\0\0",
            core_version: [0, 1, 0],
            boot_id: 0xDEAD_0001,
            max_frame_length: 144,
            queue_length: 8,
            reset_cause: 3,
            fault_resets: 1,
            fault_kind: 2,
            fault_address: 0x0800_1234,
            fault_sequence: 240,
        }),
        Message::Configure(Configure {
            preset: 1,
            sample_rate: 240.0,
            update_rate: 60.0,
            height: 1.75,
            air_density: 1.0,
            air_velocity: [3.0, -2.0, 0.0],
            arch_source: ArchSource::Scaled,
            arch: 1.5,
            body_from_sensor: PackedQuaternion::pack(&equal_quaternion()),
            receiver_latency: 0.1,
            sensor: SensorKind::Xbus,
            table_digest: 0x8765_4321,
        }),
        Message::SegmentValues(SegmentValues {
            segment: Segment::LeftThigh,
            mass: 10.5,
            length: 0.42,
            joint_offset: [0.09, 0.0, -0.05],
            cg: [0.0, 0.01, -0.18],
            inertia: [0.16, 0.17, 0.04, 0.0, -0.001, 0.002],
            area: [0.06, 0.07, 0.02],
            moment_arm: 0.42,
            coefficients: [1.2, 1.8, 3.5],
        }),
        Message::Configured(Configured {
            preset: 1,
            verdict: Verdict::Incomplete,
            segments: 0x7FFF,
            table_digest: 0,
        }),
        Message::Start(Start {
            mode: StreamMode::Credit,
        }),
        Message::Stop(Stop { sent: 7_200 }),
        Message::ResetFilter(ResetFilter {}),
        Message::Credit(Credit { granted: 32 }),
        Message::TimeSync(TimeSync {
            asked: 1,
            received: 0x0100_0000_0000,
            answered: u64::MAX,
        }),
        Message::LogAsk(LogAsk {
            action: LogAction::Erase,
            block: 0x0001_0203,
        }),
        Message::SetupAsk(SetupAsk {
            action: SetupAction::Read,
        }),
        Message::LimbSensor(LimbSensor {
            segment: Segment::LeftShank,
            place: [0.01, -0.02, -0.15],
            bias: [0.0025, -0.005, 0.01],
            bias_deviation: 0.0005,
            gain: [1.0, 0.996, 1.004],
            gain_deviation: [0.001, 0.001, 0.005],
            segment_from_sensor: PackedQuaternion::pack(&equal_quaternion()),
            tilt_deviation: 0.0625,
            heading_deviation: 0.125,
        }),
        Message::Calibrate(Calibrate {}),
    ]
}

/// Samples, and what a unit answers.
fn answers() -> std::vec::Vec<Message> {
    std::vec![
        Message::Sample(sample()),
        Message::Estimate(Estimate {
            sample_sequence: 77,
            flags: EstimateFlags::VALID | EstimateFlags::INCONSISTENT,
            state: [0.25, -55.0, 3.5, 0.0, -0.125, 2.0],
            variance: [0.01, 0.04, 0.01, 1e-4, 1e-4, 1e-4],
            measurement: [9.5, -1.5, 0.1, 0.0],
            nis: 3.75,
            cycles: 312_000,
            inertial_from_body: PackedQuaternion::pack(&equal_quaternion()),
            velocity: [1.5, -2.5, -51.0],
        }),
        Message::Status(Status {
            uptime: 60_000_000,
            received_bytes: 1,
            received_frames: 2,
            crc_bad: 3,
            cobs_bad: 4,
            too_long: 5,
            unknown: 6,
            value_bad: 7,
            wrong_session: 8,
            duplicate: 9,
            late: 10,
            gap_events: 11,
            missing: 12,
            used: 13,
            rejected: 14,
            dropped_oldest: 15,
            uart_overrun: 16,
            uart_framing: 17,
            queue_high_water: 18,
            deadline_missed: 19,
            cycles_max: 20,
            innovation_rejected: 21,
            transmit_dropped: 22,
            stack_free: 23,
            watchdog_resets: 24,
            sensor_overrun: 25,
            sensor_framing: 26,
            fault_place: *b"/src/unit/outbox.rs:1230",
            battery: 3712,
            estimates_bad: 27,
            sensor_restarts: 28,
            sensor_samples: 29,
            receiver_solutions: 30,
            sensor_silences: 31,
        }),
        Message::LogPiece(LogPiece {
            block: 5,
            length: 1008,
            offset: 96,
            bytes: core::array::from_fn(|place| u8::try_from(place * 7 % 256).unwrap()),
        }),
        Message::Sensors(Sensors {
            valid: SensorParts::RECEIVER | SensorParts::PRESSURE,
            specific_force: [1, -2, 1255],
            receiver_velocity: [2560, -256, -13_000],
            receiver_horizontal_deviation: 120,
            receiver_vertical_deviation: 180,
            receiver_age: 95,
            pressure: 81_234,
        }),
        Message::Stored(Stored {
            state: SetupState::Present,
            table_digest: 0x1234_5678,
        }),
        Message::Calibration(Calibration {
            stage: CalibrationStage::Poses,
            verdict: CalibrationVerdict::NoHeading,
            segment: Segment::RightForearm,
            rests: 3,
            heard: 0x1234,
            turned: 0x00FF,
        }),
        Message::SegmentErrors(SegmentErrors {
            deviation: core::array::from_fn(|place| u8::try_from(place * 9 + 1).unwrap()),
            failed: 0x0800,
        }),
        Message::ChainReport(ChainReport {
            packets: 60_000,
            skipped: 1234,
            missing: core::array::from_fn(|place| u32::try_from(place * 3).unwrap()),
            late: core::array::from_fn(|place| u16::try_from(place * 300).unwrap()),
            age: core::array::from_fn(|place| u8::try_from(place * 10).unwrap()),
        }),
    ]
}

/// The frame of a message as sent over the wire.
fn frame_of(header: &Header, message: &Message) -> heapless::Vec<u8, MAX_FRAME_LENGTH> {
    let mut frame = heapless::Vec::new();
    frame.resize_default(MAX_FRAME_LENGTH).unwrap();
    let length = message.encode(header, &mut frame).unwrap();
    frame.truncate(length);
    frame
}

/// A frame with arbitrary header and body bytes and a correct checksum.
fn sealed(content: &[u8]) -> std::vec::Vec<u8> {
    let mut packet = content.to_vec();
    packet.extend(checksum([content]).to_le_bytes());
    let mut stuffed = std::vec![0; cobs::max_encoding_length(packet.len())];
    let length = cobs::encode(&packet, &mut stuffed);
    stuffed.truncate(length);
    stuffed.insert(0, 0);
    stuffed.push(0);
    stuffed
}
