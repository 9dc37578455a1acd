//! The messages; commands are absolute and may be repeated, so a lost answer is resolved by asking again.

use super::calibration::{Calibrate, Calibration, ChainReport, LimbSensor, SegmentErrors};
use super::decode_error::DecodeError;
use super::flags::{EstimateFlags, SensorParts, Validity};
use super::kept::{LogAsk, LogPiece, SetupAsk, Stored};
use super::layout::MessageLayout;
use super::packed_quaternion::PackedQuaternion;
use super::wire::{Body, Writer, body, code, take_body};
use crate::body::{SEGMENT_COUNT, Segment};

body! {
    /// Host to unit: greeting with the protocol in use. Nothing else is served before it has been answered.
    Hello {
        /// Hash of the message table that the host was built with
        schema_hash: u64 = "",
        /// Longest frame that the host accepts, including delimiters
        max_frame_length: u16 = "bytes",
    }
}

body! {
    /// Unit to host: answer to [`Hello`], also sent once after each start of the unit.
    HelloAcknowledge {
        /// Hash of the message table that the unit was built with
        schema_hash: u64 = "",
        /// Build: first bytes of the source revision, zero if unknown
        build: [u8; 8] = "",
        /// Version of the core: major, minor, patch
        core_version: [u16; 3] = "",
        /// Changes at each start of the unit
        boot_id: u32 = "",
        /// Longest frame that the unit accepts, including delimiters
        max_frame_length: u16 = "bytes",
        /// Capacity of the sample queue; in paced mode the oldest sample is dropped when it is full
        queue_length: u16 = "samples",
        /// Cause of the last start: power, fault, watchdog, other, brown-out
        reset_cause: u8 = "",
        /// Number of starts after a fault since power was applied
        fault_resets: u16 = "",
        /// Kind of the last fault, 0 for none: panic, hard fault, stack, bus, instruction, alignment, division, memory, watchdog
        fault_kind: u8 = "",
        /// Program counter at the last fault, 0 if unknown; for a panic, the address of its location
        fault_address: u32 = "",
        /// Sequence number of the sample being processed at the last fault
        fault_sequence: u32 = "",
    }
}

code! {
    /// Source of the arch factor on the drag.
    ArchSource {
        /// From the arch area of the posture, paper eq. (arch_eq)
        Posture = 0,
        /// The same, with its difference from one multiplied by `arch`
        Scaled = 1,
        /// The constant `arch`
        Fixed = 2,
    }
}

code! {
    /// The protocol of the sensor on the unit's own port.
    SensorKind {
        /// Xbus packets of an Xsens MTi, with the UBX solutions of a receiver between them
        Xbus = 0,
        /// A BNO08x in its UART-RVC mode, 115200 baud
        Bno08xRvc = 1,
        /// Sensors on the limbs on one line, 1000000 baud, with the UBX solutions of a receiver after them
        Chain = 2,
    }
}

body! {
    /// Host to unit: configures the computation. The segment table follows as one [`SegmentValues`] for each segment.
    Configure {
        /// Number of the filter preset
        preset: u16 = "",
        /// Rate of the samples
        sample_rate: f32 = "Hz" in 1.0..=2000.0,
        /// Rate of the filter's updates
        update_rate: f32 = "Hz" in 1.0..=2000.0,
        /// Stature
        height: f32 = "m" in 0.5..=3.0,
        /// Air density
        air_density: f32 = "kg/m3" in 0.1..=2.0,
        /// Velocity of the air in inertial axes: north, west, up
        air_velocity: [f32; 3] = "m/s" in -100.0..=100.0,
        /// Source of the arch factor on the drag
        arch_source: ArchSource = "",
        /// Parameter of the arch factor, 1 if it needs none
        arch: f32 = "" in -10.0..=10.0,
        /// Mounting of the inertial sensor on the pelvis: sensor axes to body axes
        body_from_sensor: PackedQuaternion = "",
        /// Time from the instant that a receiver's solution describes to its arrival, unless the solution says it
        receiver_latency: f32 = "s" in 0.0..=2.0,
        /// Protocol of the sensor on the unit's own port
        sensor: SensorKind = "",
        /// CRC-32C over the bodies of the 16 segment messages in order
        table_digest: u32 = "",
    }
}

body! {
    /// Host to unit: one row of the segment table, all values in the segment's frame.
    SegmentValues {
        /// Segment, 0 pelvis to 15 right foot
        segment: Segment = "",
        /// Mass
        mass: f32 = "kg" in 0.0..=300.0,
        /// Length along Z
        length: f32 = "m" in 0.0..=3.0,
        /// Proximal joint in the frame of the parent: x, y, z
        joint_offset: [f32; 3] = "m" in -3.0..=3.0,
        /// Centre of gravity: x, y, z
        cg: [f32; 3] = "m" in -3.0..=3.0,
        /// Inertia about the centre of gravity: xx, yy, zz, xy, xz, yz
        inertia: [f32; 6] = "kg m2" in -100.0..=100.0,
        /// Silhouette areas normal to x, y, z
        area: [f32; 3] = "m2" in 0.0..=10.0,
        /// Characteristic length of the aerodynamic moment
        moment_arm: f32 = "m" in 0.0..=3.0,
        /// Aerodynamic coefficients: drag, force across the stream, moment
        coefficients: [f32; 3] = "" in -20.0..=20.0,
    }
}

code! {
    /// The outcome of a configuration.
    Verdict {
        /// The configuration is in use
        Accepted = 0,
        /// Segments are missing, see the bitmap
        Incomplete = 1,
        /// The unit has no such preset
        UnknownPreset = 2,
        /// The digest differs from the table received
        DigestMismatch = 3,
        /// The table is complete but not a possible body: mass or inertia is not positive
        NotABody = 4,
        /// The filter cannot run at these rates: an update needs an even number of samples, up to its window
        UnusableRates = 5,
        /// This unit was built without sensors on the limbs
        NoChain = 6,
    }
}

body! {
    /// Unit to host: answer to [`Configure`] and to each [`SegmentValues`].
    Configured {
        /// Preset in use or requested
        preset: u16 = "",
        /// Outcome of the configuration
        verdict: Verdict = "",
        /// Segments received, bit 0 for the first
        segments: u16 = "",
        /// CRC-32C over the table that the unit has
        table_digest: u32 = "",
    }
}

code! {
    /// What determines the pace of the samples.
    StreamMode {
        /// The source: the unit drops the oldest sample when it falls behind, and counts it
        Paced = 0,
        /// The unit: the host sends only what was granted as credit, and nothing is dropped
        Credit = 1,
        /// The inertial sensor on the unit's own port; samples of the host only set the posture
        Sensor = 2,
    }
}

body! {
    /// Host to unit: starts the session given in the header; answered by [`Status`]. A session that is already running
    /// continues.
    Start {
        /// What determines the pace
        mode: StreamMode = "",
    }
}

body! {
    /// Host to unit: ends the session; answered by [`Status`] when all samples have been processed.
    Stop {
        /// Number of samples sent in the session, which completes the ledger
        sent: u32 = "samples",
    }
}

body! {
    /// Host to unit: restarts the filter with the next sample.
    ResetFilter {}
}

body! {
    /// Unit to host, credit mode: how many samples of the session may be sent in total.
    Credit {
        /// Number of samples granted since the session began, wraps
        granted: u32 = "samples",
    }
}

body! {
    /// Clock comparison: the host sends its time, and the unit returns it with two times of its own.
    TimeSync {
        /// Host clock when the request was sent
        asked: u64 = "us",
        /// Unit clock when it arrived, 0 in the request
        received: u64 = "us",
        /// Unit clock when the answer was sent, 0 in the request
        answered: u64 = "us",
    }
}

body! {
    /// Host to unit: posture and motion of the pelvis at the sensor time in the header.
    ///
    /// Created by [`Sample::new`] and read by its methods; the fields are integers as on the wire.
    Sample {
        /// Which of the following fields hold a measurement
        valid: Validity = "",
        /// First from pelvis to inertial axes, then from each segment to its parent, in table order
        rotations: [PackedQuaternion; SEGMENT_COUNT] = "",
        /// Angular velocity of the pelvis in body axes: x, y, z
        angular_velocity: [i16; 3] = "1/1024 rad/s",
        /// Velocity of the pelvis in inertial axes: north, west, up
        velocity: [i16; 3] = "1/256 m/s",
        /// Horizontal speed from GNSS
        horizontal_speed: u16 = "1/256 m/s",
    }
}

body! {
    /// Unit to host: the filter's result for a sample, with that sample's time and sequence number.
    ///
    /// Sent for each sample that triggers an update. Measurements are in the order of the preset in use.
    Estimate {
        /// Sequence number of the sample
        sample_sequence: u32 = "",
        /// Conditions to check before using the estimate
        flags: EstimateFlags = "",
        /// Muscle input in pitch, yaw, roll, then damping in pitch, yaw, roll
        state: [f32; 6] = "",
        /// Variances of the states
        variance: [f32; 6] = "" in 0.0..=1.0e30,
        /// Predicted measurement, zero if there is none
        measurement: [f32; 4] = "SI",
        /// Normalised innovation squared
        nis: f32 = "" in 0.0..=1.0e30,
        /// Processor cycles of the update
        cycles: u32 = "cycles",
        /// Attitude, body axes to inertial axes; only if the flags say that there is a motion
        inertial_from_body: PackedQuaternion = "",
        /// Velocity of the pelvis in inertial axes: north, west, up; only if the flags say that there is a motion
        velocity: [f32; 3] = "m/s",
    }
}

body! {
    /// What sensors other than a suit measured at the instant of the [`Sample`] with the same number.
    ///
    /// Written to the log before that sample. Created by [`Sensors::new`] and read by its methods.
    Sensors {
        /// Which of the following fields hold a measurement
        valid: SensorParts = "",
        /// Specific force of the accelerometer in body axes: x, y, z
        specific_force: [i16; 3] = "1/128 m/s2",
        /// Velocity of the receiver in inertial axes: north, west, up
        receiver_velocity: [i16; 3] = "1/256 m/s",
        /// Standard deviation of each horizontal component of it
        receiver_horizontal_deviation: u16 = "mm/s",
        /// Standard deviation of its vertical component
        receiver_vertical_deviation: u16 = "mm/s",
        /// Time from the instant that the receiver's solution describes to the sample
        receiver_age: u16 = "ms",
        /// Air pressure
        pressure: u32 = "Pa",
    }
}

body! {
    /// Unit to host, once a second and in answer to [`Start`] and [`Stop`]: what happened since the unit started;
    /// `duplicate` to `dropped_oldest` since the session began. All counters wrap.
    Status {
        /// Time since the start
        uptime: u64 = "us",
        /// Bytes received
        received_bytes: u32 = "bytes",
        /// Good frames received
        received_frames: u32 = "frames",
        /// Frames with a wrong checksum
        crc_bad: u32 = "frames",
        /// Frames with invalid COBS encoding
        cobs_bad: u32 = "frames",
        /// Frames longer than the buffer
        too_long: u32 = "frames",
        /// Complete frames of another version, type or length
        unknown: u32 = "frames",
        /// Complete frames with a number that is not finite or out of range
        value_bad: u32 = "frames",
        /// Samples of a session that is not running
        wrong_session: u32 = "frames",
        /// Samples received more than once
        duplicate: u32 = "frames",
        /// Samples received after a later one, which the filter cannot use
        late: u32 = "frames",
        /// Number of times that sequence numbers were skipped
        gap_events: u32 = "",
        /// Samples missing according to the sequence numbers
        missing: u32 = "samples",
        /// Samples given to the filter
        used: u32 = "samples",
        /// Samples rejected by the estimator
        rejected: u32 = "samples",
        /// Samples dropped in favour of newer ones
        dropped_oldest: u32 = "samples",
        /// Bytes lost by the receiver of the host's line, as its driver reports them
        uart_overrun: u32 = "",
        /// Noise and framing errors of the host's line, as its driver reports them
        uart_framing: u32 = "",
        /// Largest number of samples ever queued
        queue_high_water: u32 = "samples",
        /// Updates not finished within a period
        deadline_missed: u32 = "",
        /// Longest update
        cycles_max: u32 = "cycles",
        /// Updates whose measurement was rejected
        innovation_rejected: u32 = "",
        /// Frames not sent because the host did not read
        transmit_dropped: u32 = "frames",
        /// Bytes of stack never used
        stack_free: u32 = "bytes",
        /// Number of resets by the watchdog
        watchdog_resets: u32 = "",
        /// Bytes lost by the receiver of the sensor's line
        sensor_overrun: u32 = "",
        /// Noise and framing errors of the sensor's line
        sensor_framing: u32 = "",
        /// End of `file:line` if the last fault was a panic, preceded by zeros
        fault_place: [u8; 24] = "",
        /// Voltage of the battery, 0 if not measured
        battery: u16 = "mV",
        /// Estimates with a number that is not finite or out of range, which were not sent
        estimates_bad: u32 = "",
        /// Number of times that the sensor on the unit's own port restarted
        sensor_restarts: u32 = "",
        /// Samples of that sensor
        sensor_samples: u32 = "samples",
        /// Solutions of a receiver on that port
        receiver_solutions: u32 = "",
        /// Number of times that the sensor fell silent in a session
        sensor_silences: u32 = "",
    }
}

macro_rules! messages {
    ($( $code:literal $name:ident $wire_name:literal ),* $(,)?) => {
        /// Any message of the link.
        #[derive(Debug, Clone, Copy, PartialEq)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        #[expect(missing_docs, reason = "the message types are documented")]
        pub enum Message { $( $name($name), )* }

        pub(super) const LAYOUTS: &[MessageLayout] = &[$(
            MessageLayout {
                name: $wire_name,
                code: $code,
                size: <$name as Body>::SIZE,
                fields: <$name as Body>::FIELDS,
            }
        ),*];

        impl Message {
            /// Second byte of the header.
            pub const fn code(&self) -> u8 {
                match self { $( Self::$name(_) => $code, )* }
            }

            /// Name in the byte table.
            pub const fn name(&self) -> &'static str {
                match self { $( Self::$name(_) => $wire_name, )* }
            }

            pub(super) fn put(&self, writer: &mut Writer<'_>) -> Option<()> {
                match self { $( Self::$name(body) => body.put(writer), )* }
            }

            /// Decodes a message of type `code` from a body whose checksum is correct.
            pub(super) fn take(code: u8, body: &[u8]) -> Result<Self, DecodeError> {
                match code {
                    $( $code => take_body(body).map(Self::$name), )*
                    _ => Err(DecodeError::UnknownType { code }),
                }
            }
        }

        $( impl From<$name> for Message {
            fn from(body: $name) -> Self {
                Self::$name(body)
            }
        } )*
    };
}

messages! {
    0x01 Hello "HELLO",
    0x02 HelloAcknowledge "HELLO_ACK",
    0x03 Configure "CONFIGURE",
    0x04 SegmentValues "SEGMENT",
    0x05 Configured "CONFIGURED",
    0x06 Start "START",
    0x07 Stop "STOP",
    0x08 ResetFilter "RESET_FILTER",
    0x09 Credit "CREDIT",
    0x0A TimeSync "TIMESYNC",
    0x0B LogAsk "LOG_ASK",
    0x0C SetupAsk "SETUP_ASK",
    0x0D LimbSensor "LIMB_SENSOR",
    0x0E Calibrate "CALIBRATE",
    0x10 Sample "SAMPLE",
    0x11 Estimate "ESTIMATE",
    0x12 Status "STATUS",
    0x13 LogPiece "LOG_PIECE",
    0x14 Sensors "SENSORS",
    0x15 Stored "STORED",
    0x16 Calibration "CALIBRATION",
    0x17 SegmentErrors "SEGMENT_ERRORS",
    0x18 ChainReport "CHAIN",
}
