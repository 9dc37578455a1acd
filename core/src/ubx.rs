//! The part of u-blox's UBX protocol that a flight needs: `NAV-PVT`, which combines position, velocity and time.
//!
//! A frame is `B5 62 | class | number | length | payload | two checksums`, little-endian. [`Decoder`] finds `NAV-PVT`
//! frames in arbitrary bytes and skips all others; a solution that the receiver itself marks as invalid is not used.
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

/// Bytes at the start of a frame.
const SYNC: [u8; 2] = [0xb5, 0x62];

/// Message class and number of `NAV-PVT`.
const NAV_PVT: [u8; 2] = [0x01, 0x07];

/// Lengths of the payload in older and newer receivers (bytes); newer ones append fields.
const LENGTHS: [usize; 2] = [84, 92];

/// Longest payload that is stored (bytes).
const LONGEST: usize = 92;

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
}

impl NavPvt {
    /// Returns the velocity in inertial axes (m/s), or `None` unless the fix is three-dimensional and marked as valid
    /// by the receiver.
    pub fn velocity(&self) -> Option<Vector3<f32>> {
        (self.is_valid && THREE_DIMENSIONS.contains(&self.fix)).then_some(self.velocity_mps)
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
        })
    }
}

/// Position of the next byte in a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Place {
    Sync,
    SecondSync,
    Class,
    Number,
    LowLength,
    HighLength,
    Payload,
    FirstChecksum,
    SecondChecksum,
}

/// Counters of a decoder since its creation. All of them wrap.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counters {
    /// Solutions decoded.
    pub solutions: u32,
    /// Undamaged frames of other kinds.
    pub others: u32,
    /// Frames whose checksums do not match.
    pub bad_checksum: u32,
}

/// Decodes a stream of bytes to navigation solutions; bytes that belong to no frame are skipped.
#[derive(Debug)]
pub struct Decoder {
    place: Place,
    kind: [u8; 2],
    length: usize,
    taken: usize,
    payload: [u8; LONGEST],
    sums: [u8; 2],
    first_sum: u8,
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
            place: Place::Sync,
            kind: [0; 2],
            length: 0,
            taken: 0,
            payload: [0; LONGEST],
            sums: [0; 2],
            first_sum: 0,
            counters: Counters {
                solutions: 0,
                others: 0,
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
        let [first, second] = SYNC;
        self.place = match self.place {
            Place::Sync if byte == first => Place::SecondSync,
            Place::Sync => Place::Sync,
            Place::SecondSync if byte == second => {
                self.sums = [0; 2];
                self.taken = 0;
                Place::Class
            }
            Place::SecondSync if byte == first => Place::SecondSync,
            Place::SecondSync => Place::Sync,
            Place::Class => {
                self.kind[0] = byte;
                self.cover(byte, Place::Number)
            }
            Place::Number => {
                self.kind[1] = byte;
                self.cover(byte, Place::LowLength)
            }
            Place::LowLength => {
                self.length = usize::from(byte);
                self.cover(byte, Place::HighLength)
            }
            Place::HighLength => {
                self.length |= usize::from(byte) << 8;
                let next = self.cover(byte, Place::Payload);
                // Frames of other kinds are not stored, so they may have any length; a `NAV-PVT` frame must have a
                // known one.
                match (self.kind == NAV_PVT, self.length) {
                    (true, length) if !LENGTHS.contains(&length) => Place::Sync,
                    (_, 0) => Place::FirstChecksum,
                    _ => next,
                }
            }
            Place::Payload => {
                if let Some(place) = self.payload.get_mut(self.taken) {
                    *place = byte;
                }
                self.taken += 1;
                let next = if self.taken == self.length {
                    Place::FirstChecksum
                } else {
                    Place::Payload
                };
                self.cover(byte, next)
            }
            Place::FirstChecksum => {
                self.first_sum = byte;
                Place::SecondChecksum
            }
            Place::SecondChecksum => {
                self.place = Place::Sync;
                return self.judge([self.first_sum, byte]);
            }
        };
        None
    }

    /// Adds a byte to the Fletcher checksums.
    fn cover(&mut self, byte: u8, next: Place) -> Place {
        let [a, b] = &mut self.sums;
        *a = a.wrapping_add(byte);
        *b = b.wrapping_add(*a);
        next
    }

    fn judge(&mut self, sums: [u8; 2]) -> Option<NavPvt> {
        let counters = &mut self.counters;
        let counter = match (sums == self.sums, self.kind == NAV_PVT) {
            (false, _) => &mut counters.bad_checksum,
            (true, false) => &mut counters.others,
            (true, true) => &mut counters.solutions,
        };
        *counter = counter.wrapping_add(1);
        let is_solution = sums == self.sums && self.kind == NAV_PVT;
        let payload = self.payload.get(..self.length).filter(|_| is_solution)?;
        NavPvt::of(payload)
    }
}

#[cfg(test)]
mod tests;
