//! The part of u-blox's UBX protocol that a flight needs: `NAV-PVT`, which combines position, velocity and time.
//!
//! A frame is `B5 62 | class | number | length | payload | two checksums`, little-endian. [`Decoder`] finds `NAV-PVT`
//! frames in arbitrary bytes and skips all others; a solution that the receiver itself marks as invalid is not used.
//!
//! The decoder keeps the last bytes of the line and asks after each whether a whole frame ends there. A false start or
//! a false length therefore hides nothing: every undamaged frame is found, whatever precedes it.
//!
//! Source: u-blox 8 / M8 receiver description, UBX-13003221, chapter 32; layouts of 84 bytes (protocol 14) and 92
//! bytes.
//!
//! ```
//! use bodyflight_core::ubx::Decoder;
//!
//! let mut decoder = Decoder::new();
//! assert!(b"$GNRMC,,V*".iter().all(|&byte| decoder.push(byte).is_none()));
//! ```

use nalgebra::Vector3;

use crate::math::Lanes;

/// Bytes at the start of a frame.
const SYNC: [u8; 2] = [0xb5, 0x62];

/// Message class and number of `NAV-PVT`.
const NAV_PVT: [u8; 2] = [0x01, 0x07];

/// Lengths of the payload in older and newer receivers (bytes); newer ones append fields.
const LENGTHS: [usize; 2] = [84, 92];

/// Longest payload (bytes).
const LONGEST: usize = 92;

/// Bytes of a frame before its payload, and after it.
const HEADER: usize = 6;
const TRAILER: usize = 2;

/// Length of a frame with the longest payload (bytes).
pub const FRAME_LENGTH: usize = HEADER + LONGEST + TRAILER;

/// Bytes kept of the line: at least the longest frame, and a power of two.
const KEPT: usize = 128;

/// Three-dimensional kinds of fix, without and with dead reckoning.
const THREE_DIMENSIONS: [u8; 2] = [3, 4];

/// A navigation solution of the receiver.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NavPvt {
    /// GPS time of week (ms).
    pub time_of_week_ms: u32,
    /// Kind of fix: 0 none, 1 dead reckoning only, 2 two-dimensional, 3 three-dimensional, 4 with dead reckoning, 5
    /// time only.
    pub fix: u8,
    /// Whether the receiver reports the solution to be within its accuracy limits.
    pub is_valid: bool,
    /// Height above the ellipsoid (m).
    pub height_m: f32,
    /// Velocity in inertial axes: north, west, up (m/s).
    pub velocity_mps: Vector3<f32>,
    /// Speed over the ground (m/s).
    pub ground_speed_mps: f32,
    /// Standard deviation of the speed as estimated by the receiver (m/s).
    pub speed_accuracy_mps: f32,
    /// Height above mean sea level (m).
    pub height_msl_m: f32,
    /// Standard deviation of the height as estimated by the receiver (m).
    pub vertical_accuracy_m: f32,
}

impl NavPvt {
    /// Returns the velocity in inertial axes (m/s), or `None` unless the fix is three-dimensional and marked as valid
    /// by the receiver.
    pub fn velocity(&self) -> Option<Vector3<f32>> {
        (self.is_valid && THREE_DIMENSIONS.contains(&self.fix)).then_some(self.velocity_mps)
    }

    /// Returns the frame that a receiver sends of this solution, with the longer payload. Lengths and speeds are rounded
    /// to millimetres; what this crate does not read is zero.
    pub fn encode(&self) -> [u8; FRAME_LENGTH] {
        let [north, west, up] = self.velocity_mps.into();
        let mut frame = [0; FRAME_LENGTH];
        let [low, high, ..] = LONGEST.to_le_bytes();
        let header = [SYNC[0], SYNC[1], NAV_PVT[0], NAV_PVT[1], low, high];
        let mut put = |at: usize, bytes: &[u8]| {
            let places = frame.iter_mut().skip(at);
            places.zip(bytes).for_each(|(place, byte)| *place = *byte);
        };
        put(0, &header);
        put(HEADER, &self.time_of_week_ms.to_le_bytes());
        put(HEADER + 20, &[self.fix, u8::from(self.is_valid)]);
        for (at, metres) in [
            (32, self.height_m),
            (36, self.height_msl_m),
            (44, self.vertical_accuracy_m),
            (48, north),
            (52, -west),
            (56, -up),
            (60, self.ground_speed_mps),
            (68, self.speed_accuracy_mps),
        ] {
            #[expect(clippy::cast_possible_truncation, reason = "saturates")]
            let millimetres = (metres * 1e3).nearest() as i32;
            put(HEADER + at, &millimetres.to_le_bytes());
        }
        let covered = frame.get(SYNC.len()..FRAME_LENGTH - TRAILER);
        let sums = checksums(covered.unwrap_or_default().iter().copied());
        if let Some(trailer) = frame.last_chunk_mut() {
            *trailer = sums;
        }
        frame
    }

    fn of(payload: &[u8]) -> Option<Self> {
        let word = |at: usize| {
            let bytes = payload.get(at..)?.first_chunk::<4>()?;
            Some(i32::from_le_bytes(*bytes))
        };
        // Millimetres fit exactly in single precision up to 16 km.
        let metres = |at: usize| Some(word(at)? as f32 / 1e3);
        Some(Self {
            time_of_week_ms: word(0)?.cast_unsigned(),
            fix: *payload.get(20)?,
            is_valid: payload.get(21)? & 1 != 0,
            height_m: metres(32)?,
            // The receiver's axes are north, east, down.
            velocity_mps: Vector3::new(metres(48)?, -metres(52)?, -metres(56)?),
            ground_speed_mps: metres(60)?,
            speed_accuracy_mps: word(68)?.cast_unsigned() as f32 / 1e3,
            height_msl_m: metres(36)?,
            vertical_accuracy_m: word(44)?.cast_unsigned() as f32 / 1e3,
        })
    }
}

/// Both checksums of a frame over everything between its start and them.
fn checksums(covered: impl Iterator<Item = u8>) -> [u8; TRAILER] {
    covered.fold([0; TRAILER], |[a, b], byte| {
        let a = a.wrapping_add(byte);
        [a, b.wrapping_add(a)]
    })
}

/// Counters of a decoder since its creation. All of them wrap.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counters {
    /// Solutions decoded.
    pub solutions: u32,
    /// Starts of a solution whose checksums do not match: damaged or cut short, or there by chance.
    pub bad_checksum: u32,
}

/// Decodes a stream of bytes to navigation solutions; bytes that belong to no solution are skipped.
#[derive(Debug)]
pub struct Decoder {
    /// The last bytes of the line, a ring.
    kept: [u8; KEPT],
    /// Where the next byte goes.
    next: usize,
    /// Number of bytes kept since the end of the last solution.
    length: usize,
    counters: Counters,
}

impl Default for Decoder {
    fn default() -> Self {
        Self::new()
    }
}

impl Decoder {
    /// Creates a decoder that waits for its first frame.
    pub const fn new() -> Self {
        Self {
            kept: [0; KEPT],
            next: 0,
            length: 0,
            counters: Counters {
                solutions: 0,
                bad_checksum: 0,
            },
        }
    }

    /// Returns the counters.
    pub const fn counters(&self) -> &Counters {
        &self.counters
    }

    /// Processes one byte; returns a solution if the byte completed one.
    pub fn push(&mut self, byte: u8) -> Option<NavPvt> {
        if let Some(place) = self.kept.get_mut(self.next) {
            *place = byte;
        }
        self.next = (self.next + 1) % KEPT;
        self.length = (self.length + 1).min(KEPT);
        LENGTHS.into_iter().find_map(|length| self.ending(length))
    }

    /// The byte that came `back` bytes before the next one.
    fn before(&self, back: usize) -> u8 {
        let place = (self.next + KEPT - back) % KEPT;
        self.kept.get(place).copied().unwrap_or_default()
    }

    /// Decodes a frame with a payload of `length` bytes that ends with the last byte, if there is one.
    fn ending(&mut self, length: usize) -> Option<NavPvt> {
        let total = HEADER + length + TRAILER;
        let [low, high, ..] = length.to_le_bytes();
        let header = [SYNC[0], SYNC[1], NAV_PVT[0], NAV_PVT[1], low, high];
        let starts = (0..HEADER)
            .zip(header)
            .all(|(at, expected)| self.before(total - at) == expected);
        if self.length < total || !starts {
            return None;
        }
        let covered = (TRAILER + 1..=total - SYNC.len()).rev();
        let sums = checksums(covered.map(|back| self.before(back)));
        if [self.before(2), self.before(1)] != sums {
            self.counters.bad_checksum = self.counters.bad_checksum.wrapping_add(1);
            return None;
        }
        self.counters.solutions = self.counters.solutions.wrapping_add(1);
        self.length = 0;
        let mut payload = [0; LONGEST];
        for (at, place) in payload.iter_mut().take(length).enumerate() {
            *place = self.before(length + TRAILER - at);
        }
        NavPvt::of(payload.get(..length)?)
    }
}

#[cfg(test)]
mod tests;
