//! Fault injection: a link that loses, damages, duplicates and reorders frames, reproducibly for each seed.

use super::frame::MAX_FRAME_LENGTH;

/// Probability of each fault per frame, 0 to 1; besides reordering, at most one fault affects a frame.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Faults {
    /// The frame is lost.
    pub drop: f32,
    /// One bit is inverted.
    pub corrupt: f32,
    /// The frame is sent twice.
    pub duplicate: f32,
    /// The frame is sent after the next one.
    pub reorder: f32,
    /// A run of 2 to 32 bytes is overwritten.
    pub burst: f32,
    /// The end of the frame is cut off.
    pub truncate: f32,
    /// One byte is lost.
    pub slip: f32,
}

/// Number of frames affected by each fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[expect(missing_docs, reason = "documented in Faults")]
pub struct Struck {
    pub drop: u32,
    pub corrupt: u32,
    pub duplicate: u32,
    pub reorder: u32,
    pub burst: u32,
    pub truncate: u32,
    pub slip: u32,
}

/// Random number generator, PCG-XSH-RR 64/32 (O'Neill 2014).
///
/// It is implemented here rather than taken from a crate so that a seed in a bug report reproduces the same run
/// whatever the crate versions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Random(u64);

impl Random {
    /// Creates the generator for `seed`.
    pub const fn new(seed: u64) -> Self {
        let mut random = Self(seed.wrapping_add(Self::INCREMENT));
        random.0 = random.0.wrapping_mul(Self::MULTIPLIER);
        random
    }

    const MULTIPLIER: u64 = 6_364_136_223_846_793_005;
    const INCREMENT: u64 = 1_442_695_040_888_963_407;

    /// Returns 32 random bits.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "the generator folds 64 bits to 32"
    )]
    pub const fn bits(&mut self) -> u32 {
        let state = self.0;
        self.0 = state
            .wrapping_mul(Self::MULTIPLIER)
            .wrapping_add(Self::INCREMENT);
        let folded = (((state >> 18) ^ state) >> 27) as u32;
        folded.rotate_right((state >> 59) as u32)
    }

    /// Returns a number below `bound`, or 0 if `bound` is 0. The bias is below `bound` / 2^32.
    pub const fn below(&mut self, bound: usize) -> usize {
        ((self.bits() as u64).wrapping_mul(bound as u64) >> 32) as usize
    }

    /// Returns true with the given probability.
    pub fn chance(&mut self, probability: f32) -> bool {
        // A single-precision number holds 24 bits.
        #[expect(clippy::cast_precision_loss, reason = "24 bits")]
        let drawn = (self.bits() >> 8) as f32 / 16_777_216.0;
        drawn < probability
    }
}

#[derive(Clone, Copy)]
enum Kind {
    Drop,
    Corrupt,
    Duplicate,
    Burst,
    Truncate,
    Slip,
}

/// Passes frames on, injecting faults into some of them.
#[derive(Debug, Clone)]
pub struct Injector {
    faults: Faults,
    random: Random,
    held: [u8; MAX_FRAME_LENGTH],
    held_length: usize,
    struck: Struck,
}

impl Injector {
    /// Creates an injector whose faults are determined by `seed`.
    pub const fn new(faults: Faults, seed: u64) -> Self {
        Self {
            faults,
            random: Random::new(seed),
            held: [0; MAX_FRAME_LENGTH],
            held_length: 0,
            struck: Struck {
                drop: 0,
                corrupt: 0,
                duplicate: 0,
                reorder: 0,
                burst: 0,
                truncate: 0,
                slip: 0,
            },
        }
    }

    /// Returns the number of frames affected so far.
    pub const fn struck(&self) -> &Struck {
        &self.struck
    }

    /// Sends one frame; `line` is called for each piece of output, of which there may be none.
    pub fn pass(&mut self, frame: &[u8], mut line: impl FnMut(&[u8])) {
        if self.held_length > 0 {
            self.strike(frame, &mut line);
            self.flush(line);
        } else if self.random.chance(self.faults.reorder)
            && let Some(place) = self.held.get_mut(..frame.len())
        {
            place.copy_from_slice(frame);
            self.held_length = frame.len();
            self.struck.reorder = self.struck.reorder.wrapping_add(1);
        } else {
            self.strike(frame, &mut line);
        }
    }

    /// Sends the frame that is still held back, if there is one. Call it at the end of a stream.
    pub fn flush(&mut self, mut line: impl FnMut(&[u8])) {
        let length = core::mem::take(&mut self.held_length);
        if length > 0 {
            line(self.held.get(..length).unwrap_or_default());
        }
    }

    fn kind(&mut self) -> Option<Kind> {
        let faults = &self.faults;
        let kinds = [
            (faults.drop, Kind::Drop),
            (faults.corrupt, Kind::Corrupt),
            (faults.duplicate, Kind::Duplicate),
            (faults.burst, Kind::Burst),
            (faults.truncate, Kind::Truncate),
            (faults.slip, Kind::Slip),
        ];
        let random = &mut self.random;
        kinds
            .into_iter()
            .find(|&(probability, _)| probability > 0.0 && random.chance(probability))
            .map(|(_, kind)| kind)
    }

    fn strike(&mut self, frame: &[u8], line: &mut impl FnMut(&[u8])) {
        let Some(kind) = self.kind() else {
            line(frame);
            return;
        };
        let (random, struck) = (&mut self.random, &mut self.struck);
        let counter = match kind {
            Kind::Drop => &mut struck.drop,
            Kind::Corrupt => {
                let (at, bit) = (random.below(frame.len()), random.below(8));
                if let Some((before, [byte, after @ ..])) = frame.split_at_checked(at) {
                    line(before);
                    line(&[byte ^ 1 << bit]);
                    line(after);
                }
                &mut struck.corrupt
            }
            Kind::Duplicate => {
                line(frame);
                line(frame);
                &mut struck.duplicate
            }
            Kind::Burst => {
                let length = (2 + random.below(31)).min(frame.len());
                let at = random.below(frame.len() - length + 1);
                line(frame.get(..at).unwrap_or_default());
                for _ in 0..length {
                    let [byte, ..] = random.bits().to_le_bytes();
                    line(&[byte]);
                }
                line(frame.get(at + length..).unwrap_or_default());
                &mut struck.burst
            }
            Kind::Truncate => {
                line(frame.get(..random.below(frame.len())).unwrap_or_default());
                &mut struck.truncate
            }
            Kind::Slip => {
                let at = random.below(frame.len());
                line(frame.get(..at).unwrap_or_default());
                line(frame.get(at + 1..).unwrap_or_default());
                &mut struck.slip
            }
        };
        *counter = counter.wrapping_add(1);
    }
}
