//! UBX, the protocol of u-blox receivers, as far as a flight needs it: `NAV-PVT`, position, velocity and time in one.
//!
//! A frame is `B5 62 | class | number | length | payload | two checksums`, little-endian. [`Decoder`] finds frames of `NAV-PVT` in
//! bytes of any quality and steps over all others; of a solution that the receiver itself does not vouch for nothing is used.
//! Source: u-blox 8 / M8 receiver description, UBX-13003221, chapter 32; layouts of 84 bytes (protocol 14) and 92 bytes.
//!
//! ```
//! use bodyflight_core::ubx::Decoder;
//!
//! let mut decoder = Decoder::new();
//! assert!(b"$GNRMC,,V*".iter().all(|&byte| decoder.push(byte).is_none()));
//! ```

use nalgebra::Vector3;

/// Start of a frame.
const SYNC: [u8; 2] = [0xb5, 0x62];

/// Class and number of `NAV-PVT`.
const NAV_PVT: [u8; 2] = [0x01, 0x07];

/// Lengths of its payload, of older and of younger receivers; the younger adds at the end.
const LENGTHS: [usize; 2] = [84, 92];

/// Longest payload that is kept.
const LONGEST: usize = 92;

/// A kind of fix in three dimensions, alone or with dead reckoning.
const THREE_DIMENSIONS: [u8; 2] = [3, 4];

/// A solution of the receiver.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NavPvt {
    /// Time of the week of GPS (ms).
    pub time_of_week_ms: u32,
    /// Kind of fix: 0 none, 2 and 3 in so many dimensions, 4 with dead reckoning, 5 time only.
    pub fix: u8,
    /// The receiver holds its solution to be within its own limits.
    pub is_valid: bool,
    /// Height above the ellipsoid (m).
    pub height_m: f32,
    /// Velocity in inertial axes: north, west, up (m/s).
    pub velocity_mps: Vector3<f32>,
    /// Speed over ground (m/s).
    pub ground_speed_mps: f32,
    /// Standard deviation of the speed, as the receiver sees it (m/s).
    pub speed_accuracy_mps: f32,
}

impl NavPvt {
    /// Velocity in inertial axes (m/s), where the fix has three dimensions and the receiver vouches for it.
    pub fn velocity(&self) -> Option<Vector3<f32>> {
        (self.is_valid && THREE_DIMENSIONS.contains(&self.fix)).then_some(self.velocity_mps)
    }

    fn of(payload: &[u8]) -> Option<Self> {
        let word = |at: usize| {
            let bytes = payload.get(at..)?.first_chunk::<4>()?;
            Some(i32::from_le_bytes(*bytes))
        };
        // Millimetres, exact up to 16 km.
        let metres = |at: usize| Some(word(at)? as f32 / 1e3);
        Some(Self {
            time_of_week_ms: word(0)?.cast_unsigned(),
            fix: *payload.get(20)?,
            is_valid: payload.get(21)? & 1 != 0,
            height_m: metres(32)?,
            // The receiver says north, east, down.
            velocity_mps: Vector3::new(metres(48)?, -metres(52)?, -metres(56)?),
            ground_speed_mps: metres(60)?,
            speed_accuracy_mps: word(68)?.cast_unsigned() as f32 / 1e3,
        })
    }
}

/// Where in a frame the next byte belongs.
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

/// What a decoder has seen since it was made. All counters wrap.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counters {
    /// Solutions given out.
    pub solutions: u32,
    /// Whole frames of other kinds.
    pub others: u32,
    /// Frames whose checksums differ.
    pub bad_checksum: u32,
}

/// Takes bytes as they come and gives solutions.
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
    /// Nothing received yet.
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

    /// What was seen so far.
    pub const fn counters(&self) -> &Counters {
        &self.counters
    }

    /// Takes one byte; a solution where it completed one.
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
                // Of a frame of another kind nothing is kept, so its length may be anything; of this kind it may not.
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

    /// Adds a byte to the checksums of Fletcher's kind.
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
