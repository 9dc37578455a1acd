//! The messages; commands are absolute and may be repeated, so a lost answer is resolved by asking again.

use super::decode_error::DecodeError;
use super::flags::{EstimateFlags, Validity};
use super::layout::MessageLayout;
use super::packed_quaternion::PackedQuaternion;
use super::wire::{BadValue, Body, Reader, Writer, body, code};
use crate::body::{SEGMENT_COUNT, Segment};

body! {
    /// Host to unit: who speaks which protocol. Nothing else is served before it was answered.
    Hello {
        /// Hash of the message table the host was built with
        schema_hash: u64 = "",
        /// Longest frame the host accepts, delimiters included
        max_frame_length: u16 = "bytes",
    }
}

body! {
    /// Unit to host: answer to [`Hello`], also sent once after each start of the unit.
    HelloAcknowledge {
        /// Hash of the message table the unit was built with
        schema_hash: u64 = "",
        /// Build: the first bytes of the source revision, zero where unknown
        build: [u8; 8] = "",
        /// Version of the core: major, minor, patch
        core_version: [u16; 3] = "",
        /// Changes at each start of the unit
        boot_id: u32 = "",
        /// Longest frame the unit accepts, delimiters included
        max_frame_length: u16 = "bytes",
        /// Samples the unit queues; the oldest gives way in paced mode
        queue_length: u16 = "samples",
        /// Why the unit started last: power, fault, watchdog, other, brown-out
        reset_cause: u8 = "",
        /// Starts after a fault since power was applied
        fault_resets: u16 = "",
        /// Kind of the last fault, 0 for none: panic, hard fault, stack, bus, instruction, alignment, division, memory, watchdog
        fault_kind: u8 = "",
        /// Program counter at the last fault, of a panic the address of its location, 0 where unknown
        fault_address: u32 = "",
        /// Sequence number of the sample in work at the last fault
        fault_sequence: u32 = "",
    }
}

code! {
    /// What makes the arch factor on the drag.
    ArchSource {
        /// The arch area of the posture, paper eq. (arch_eq)
        Posture = 0,
        /// The same, its distance from one as many times as large as `arch` says
        Scaled = 1,
        /// `arch` itself
        Fixed = 2,
    }
}

body! {
    /// Host to unit: what to compute. The segment table follows as one [`SegmentValues`] for each segment.
    Configure {
        /// Filter preset by its number
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
        /// Where the arch factor on the drag comes from
        arch_source: ArchSource = "",
        /// Number for it, 1 where it needs none
        arch: f32 = "" in -10.0..=10.0,
        /// Mounting of the inertial sensor on the pelvis: sensor axes to body axes
        body_from_sensor: PackedQuaternion = "",
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
        /// Coefficients of the air's loads: drag, force across the stream, moment
        coefficients: [f32; 3] = "" in -20.0..=20.0,
    }
}

code! {
    /// What became of a configuration.
    Verdict {
        /// In force
        Accepted = 0,
        /// Segments are missing, see the bitmap
        Incomplete = 1,
        /// The unit has no such preset
        UnknownPreset = 2,
        /// The digest differs from the table received
        DigestMismatch = 3,
        /// The table is whole but no body: mass or inertia is not positive
        NotABody = 4,
        /// The filter cannot run at these rates: an update takes an even number of samples, up to its window
        UnusableRates = 5,
    }
}

body! {
    /// Unit to host: answer to [`Configure`] and to each [`SegmentValues`].
    Configured {
        /// Preset in force or asked for
        preset: u16 = "",
        /// What became of it
        verdict: Verdict = "",
        /// Segments received, bit 0 for the first
        segments: u16 = "",
        /// CRC-32C over the table the unit holds
        table_digest: u32 = "",
    }
}

code! {
    /// Who sets the pace of the samples.
    StreamMode {
        /// The source: the unit drops the oldest sample when it falls behind, and counts it
        Paced = 0,
        /// The unit: the host sends only what was granted by credit, nothing is dropped
        Credit = 1,
        /// The inertial sensor on the unit's own port; samples of the host only set the posture
        Sensor = 2,
    }
}

body! {
    /// Host to unit: begin the session named in the header; answered by [`Status`]. A session already running
    /// goes on.
    Start {
        /// Who sets the pace
        mode: StreamMode = "",
    }
}

body! {
    /// Host to unit: the session ends; answered by [`Status`] when all samples are worked off.
    Stop {
        /// Samples sent in the session, which closes the ledger
        sent: u32 = "samples",
    }
}

body! {
    /// Host to unit: the filter starts anew with the next sample.
    ResetFilter {}
}

body! {
    /// Unit to host, credit mode: how many samples of the session may have been sent in all.
    Credit {
        /// Samples granted since the session began, wraps
        granted: u32 = "samples",
    }
}

body! {
    /// Clock comparison: the host fills in its time, the unit sends it back with its own two.
    TimeSync {
        /// Host clock when the question left
        asked: u64 = "us",
        /// Unit clock when it arrived, 0 in the question
        received: u64 = "us",
        /// Unit clock when the answer left, 0 in the question
        answered: u64 = "us",
    }
}

body! {
    /// Host to unit: posture and motion of the pelvis at the sensor time in the header.
    ///
    /// Made by [`Sample::new`], read by its methods: the fields are wire counts.
    Sample {
        /// Which parts below hold a measurement
        valid: Validity = "",
        /// Pelvis to inertial first, then each segment to its parent in table order
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
    /// Unit to host: the filter's answer to the sample whose time and number it repeats.
    ///
    /// Sent for each sample that brings an update. The order of the measurements is that of the preset in force.
    Estimate {
        /// Sequence number of the sample
        sample_sequence: u32 = "",
        /// What to know before using it
        flags: EstimateFlags = "",
        /// Muscle input in pitch, yaw, roll, then damping in pitch, yaw, roll
        state: [f32; 6] = "",
        /// Variances of the states
        variance: [f32; 6] = "" in 0.0..=1.0e30,
        /// Predicted measurement, zeros where there is none
        measurement: [f32; 4] = "SI",
        /// Normalised innovation squared
        nis: f32 = "" in 0.0..=1.0e30,
        /// Processor cycles of the update
        cycles: u32 = "cycles",
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
        /// Frames whose checksum is wrong
        crc_bad: u32 = "frames",
        /// Frames that are no COBS
        cobs_bad: u32 = "frames",
        /// Frames longer than the buffer
        too_long: u32 = "frames",
        /// Whole frames of another version, type or length
        unknown: u32 = "frames",
        /// Whole frames with a number that is not finite or out of range
        value_bad: u32 = "frames",
        /// Samples of a session that is not running
        wrong_session: u32 = "frames",
        /// Samples that came again
        duplicate: u32 = "frames",
        /// Samples that came after a later one; the filter only goes forward
        late: u32 = "frames",
        /// Times at which sequence numbers were skipped
        gap_events: u32 = "",
        /// Samples missing by their sequence number
        missing: u32 = "samples",
        /// Samples given to the filter
        used: u32 = "samples",
        /// Samples refused by the estimator
        rejected: u32 = "samples",
        /// Samples that gave way to newer ones
        dropped_oldest: u32 = "samples",
        /// Bytes lost by the receiver of the host's line, as its driver reports them
        uart_overrun: u32 = "",
        /// Noise and framing errors of the host's line, as its driver reports them
        uart_framing: u32 = "",
        /// Most samples ever queued
        queue_high_water: u32 = "samples",
        /// Updates not finished within a period
        deadline_missed: u32 = "",
        /// Longest update
        cycles_max: u32 = "cycles",
        /// Updates that took no measurement in
        innovation_rejected: u32 = "",
        /// Frames not sent because the host did not read
        transmit_dropped: u32 = "frames",
        /// Stack never touched
        stack_free: u32 = "bytes",
        /// Starts by the watchdog
        watchdog_resets: u32 = "",
        /// Bytes lost by the receiver of the sensor's line
        sensor_overrun: u32 = "",
        /// Noise and framing errors of the sensor's line
        sensor_framing: u32 = "",
        /// Where the last fault was a panic: the end of `file:line`, zeros before it
        fault_place: [u8; 24] = "",
        /// Voltage of the battery, 0 where none is measured
        battery: u16 = "mV",
    }
}

code! {
    /// What to do with the log on board.
    LogAction {
        /// Read a block
        Read = 0,
        /// Erase it all
        Erase = 1,
    }
}

body! {
    /// Host to unit: read a block of the log on board; answered by all its [`LogPiece`]s. Or erase the log; answered by the piece of
    /// a block that is not there.
    LogAsk {
        /// What to do
        action: LogAction = "",
        /// Number of the block, 0 the oldest
        block: u32 = "",
    }
}

/// Number of block bytes in one [`LogPiece`].
pub const PIECE_LENGTH: usize = 96;

body! {
    /// Unit to host: a piece of a block of the log.
    LogPiece {
        /// Number of the block, 0 the oldest
        block: u32 = "",
        /// Bytes of the block, 0 where there is none of that number
        length: u16 = "bytes",
        /// Where the piece begins in the block
        offset: u16 = "bytes",
        /// The piece, zeros behind the end of the block
        bytes: [u8; 96] = "",
    }
}

macro_rules! messages {
    ($( $code:literal $name:ident $wire_name:literal ),* $(,)?) => {
        /// Any message of the link.
        #[derive(Debug, Clone, Copy, PartialEq)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        #[expect(missing_docs, reason = "the bodies say it")]
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
    0x10 Sample "SAMPLE",
    0x11 Estimate "ESTIMATE",
    0x12 Status "STATUS",
    0x13 LogPiece "LOG_PIECE",
}

fn take_body<B: Body>(body: &[u8]) -> Result<B, DecodeError> {
    if body.len() != B::SIZE {
        return Err(DecodeError::Length {
            found: body.len(),
            expected: B::SIZE,
        });
    }
    B::take(&mut Reader::new(body)).map_err(|(field, why)| match why {
        BadValue::NotFinite => DecodeError::NotFinite { field },
        BadValue::OutOfRange => DecodeError::OutOfRange { field },
    })
}
