//! The fault record: data with a checksum in memory that a reset does not clear.
//!
//! The board stores the words; this module decides whether they are a valid record or random contents after power-on.

use crc::{CRC_32_ISCSI, Crc, Table};

use crate::board::{Identity, PLACE_BYTES};

/// Length of a record in words.
pub const WORDS: usize = 13;

static CHECKSUM: Crc<u32, Table<0>> = Crc::<u32, Table<0>>::new(&CRC_32_ISCSI);

/// Kind of a fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Kind {
    /// A panic.
    Panic = 1,
    /// A processor fault for none of the reasons below.
    HardFault = 2,
    /// Stack overflow.
    StackOverflow = 3,
    /// Bus error: there is nothing at the address.
    Bus = 4,
    /// Undefined instruction.
    Undefined = 5,
    /// Unaligned access, such as two words at once from an address that is not a multiple of four.
    Unaligned = 6,
    /// Integer division by zero.
    DivisionByZero = 7,
    /// Memory protection violation, such as executing from a region without instructions.
    Memory = 8,
    /// Watchdog: the unit hung.
    Watchdog = 9,
}

/// Cause of a reset, as reported by the chip.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reset {
    /// Power was applied.
    Power,
    /// Brown-out: the supply voltage was too low for a moment.
    BrownOut,
    /// Requested by the program, as after a fault.
    Software,
    /// The watchdog was not fed.
    Watchdog,
    /// The reset pin, or another cause.
    Other,
}

/// History of the starts since power was applied.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Record {
    starts: u32,
    fault_resets: u16,
    kind: u8,
    /// Why the unit started last, as in [`Identity`].
    cause: u8,
    /// Whether a fault was recorded and the start after it has not happened yet.
    pending: bool,
    address: u32,
    sequence: u32,
    watchdog_resets: u32,
    place: [u8; PLACE_BYTES],
}

impl Record {
    /// Decodes the record in `words`; returns an empty one if they are not valid, as after power-on.
    pub fn read(words: &[u32; WORDS]) -> Self {
        let [
            starts,
            counts,
            address,
            sequence,
            watchdog_resets,
            pending,
            rest @ ..,
            sum,
        ] = words;
        if checksum(words) != *sum {
            return Self::default();
        }
        let [low, high, kind, cause] = counts.to_le_bytes();
        let mut place = [0; PLACE_BYTES];
        for (bytes, word) in place.chunks_exact_mut(4).zip(rest) {
            bytes.copy_from_slice(&word.to_le_bytes());
        }
        Self {
            starts: *starts,
            fault_resets: u16::from_le_bytes([low, high]),
            kind,
            cause,
            pending: *pending != 0,
            address: *address,
            sequence: *sequence,
            watchdog_resets: *watchdog_resets,
            place,
        }
    }

    /// Encodes the record with its checksum.
    pub fn words(&self) -> [u32; WORDS] {
        let [low, high] = self.fault_resets.to_le_bytes();
        let mut words = [0; WORDS];
        let head = [
            self.starts,
            u32::from_le_bytes([low, high, self.kind, self.cause]),
            self.address,
            self.sequence,
            self.watchdog_resets,
            u32::from(self.pending),
        ];
        let place = self.place.as_chunks().0.iter().copied();
        let all = head.into_iter().chain(place.map(u32::from_le_bytes));
        for (word, value) in words.iter_mut().zip(all) {
            *word = value;
        }
        words[WORDS - 1] = checksum(&words);
        words
    }

    /// Records a start; `sequence` is the sample that was being processed before it.
    pub fn start(&mut self, reset: Reset, sequence: u32) {
        if reset == Reset::Power {
            *self = Self::default();
        }
        self.cause = match reset {
            Reset::Power => 0,
            Reset::Software if self.pending => 1,
            Reset::Watchdog => 2,
            Reset::Software | Reset::Other => 3,
            Reset::BrownOut => 4,
        };
        if reset == Reset::Watchdog {
            self.watchdog_resets = self.watchdog_resets.wrapping_add(1);
            // A fault whose handler hung keeps its original kind.
            if !self.pending {
                (self.kind, self.address) = (Kind::Watchdog as u8, 0);
                (self.sequence, self.place) = (sequence, [0; PLACE_BYTES]);
            }
        }
        self.pending = false;
        self.starts = self.starts.wrapping_add(1);
    }

    /// Records a fault at `address`, 0 if unknown, and the sample that was being processed.
    pub fn fault(&mut self, kind: Kind, address: u32, sequence: u32) {
        self.sequence = sequence;
        self.fault_resets = self.fault_resets.saturating_add(1);
        self.kind = kind as u8;
        self.address = address;
        self.place = [0; PLACE_BYTES];
        self.pending = true;
    }

    /// Records the location of a panic: the end of `file:line`, as much as fits.
    pub fn place(&mut self, file: &str, line: u32) {
        let mut places = self.place.iter_mut().rev();
        let mut rest = line;
        for place in places.by_ref() {
            // The remainder is a digit, so the conversion cannot fail.
            *place = b'0' + u8::try_from(rest % 10).unwrap_or_default();
            rest /= 10;
            if rest == 0 {
                break;
            }
        }
        for (place, byte) in places.zip(b":".iter().chain(file.as_bytes().iter().rev())) {
            *place = *byte;
        }
    }

    /// The identity that the unit reports after this start.
    pub fn identity(&self, build: [u8; 8], boot_id: u32) -> Identity {
        Identity {
            build,
            boot_id: boot_id ^ self.starts,
            reset_cause: self.cause,
            fault_resets: self.fault_resets,
            fault_kind: self.kind,
            fault_address: self.address,
            fault_sequence: self.sequence,
            fault_place: self.place,
            watchdog_resets: self.watchdog_resets,
        }
    }
}

fn checksum(words: &[u32; WORDS]) -> u32 {
    let mut digest = CHECKSUM.digest();
    for word in &words[..WORDS - 1] {
        digest.update(&word.to_le_bytes());
    }
    digest.finalize()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn again(record: &Record) -> Record {
        Record::read(&record.words())
    }

    #[test]
    fn a_fault_is_reported_after_the_reset() {
        let mut record = Record::read(&[0xA5A5_A5A5; WORDS]);
        assert_eq!(record, Record::default());
        record.start(Reset::Power, 0);
        record.fault(Kind::HardFault, 0x0800_1234, 1234);
        let mut record = again(&record);
        record.start(Reset::Software, 7);
        let identity = record.identity(*b"abc\0\0\0\0\0", 0);
        assert_eq!(identity.boot_id, 2);
        assert_eq!((identity.fault_resets, identity.fault_kind), (1, 2));
        assert_eq!(identity.fault_address, 0x0800_1234);
        assert_eq!(identity.fault_sequence, 1234);
        assert_eq!(identity.reset_cause, 1);
    }

    #[test]
    fn the_place_of_a_panic_is_the_end_of_its_path() {
        for (file, line, place) in [
            ("a.rs", 7, "\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0a.rs:7"),
            (
                "firmware/src/unit/outbox.rs",
                1230,
                "e/src/unit/outbox.rs:1230",
            ),
        ] {
            let mut record = Record::default();
            record.fault(Kind::Panic, 0, 0);
            record.place(file, line);
            let found = again(&record).identity([0; 8], 0).fault_place;
            let expected = &place.as_bytes()[place.len() - PLACE_BYTES..];
            assert_eq!(found, expected, "{file}");
        }
    }

    #[test]
    fn every_reset_is_reported_with_its_cause() {
        let mut record = Record::default();
        let mut told = |reset| {
            let mut now = again(&record);
            now.start(reset, 55);
            record = now;
            let identity = record.identity([0; 8], 0);
            (identity.reset_cause, identity.watchdog_resets)
        };
        assert_eq!(told(Reset::Power), (0, 0));
        assert_eq!(told(Reset::Watchdog), (2, 1));
        assert_eq!(told(Reset::Software), (3, 1), "a debugger's");
        assert_eq!(told(Reset::BrownOut), (4, 1));
        assert_eq!(told(Reset::Other), (3, 1));
        assert_eq!(told(Reset::Watchdog), (2, 2));
        let identity = record.identity([0; 8], 0);
        assert_eq!(identity.fault_kind, Kind::Watchdog as u8);
        assert_eq!(identity.fault_sequence, 55);
        assert_eq!(told_after_power(&mut record), (0, 0));
    }

    fn told_after_power(record: &mut Record) -> (u8, u32) {
        record.start(Reset::Power, 0);
        let identity = record.identity([0; 8], 0);
        (identity.fault_kind, identity.watchdog_resets)
    }

    proptest! {
        #[test]
        fn memory_after_power_on_is_not_a_valid_record(words in prop::array::uniform13(any::<u32>())) {
            prop_assume!(checksum(&words) != words[WORDS - 1]);
            prop_assert_eq!(Record::read(&words), Record::default());
        }
    }
}
