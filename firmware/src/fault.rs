//! What survives a fault: a record in memory that a reset leaves alone, with a checksum.
//!
//! The board keeps the words and hands them over; whether they are a record or what power-on left behind is
//! decided here.

use crc::{CRC_32_ISCSI, Crc, Table};

use crate::board::Identity;

/// Words of a record.
pub const WORDS: usize = 6;

static CHECKSUM: Crc<u32, Table<0>> = Crc::<u32, Table<0>>::new(&CRC_32_ISCSI);

/// Why a unit stopped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Kind {
    /// The program found itself in a state that cannot be.
    Panic = 1,
    /// The processor could not go on.
    HardFault = 2,
}

/// What is known of the starts since power was applied.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Record {
    starts: u32,
    fault_resets: u16,
    kind: u8,
    address: u32,
    sequence: u32,
}

impl Record {
    /// The record in `words`; an empty one where they are none, as after power-on.
    pub fn read(words: &[u32; WORDS]) -> Self {
        let [starts, counts, address, sequence, _, sum] = *words;
        if checksum(words) != sum {
            return Self::default();
        }
        let [low, high, kind, _] = counts.to_le_bytes();
        Self {
            starts,
            fault_resets: u16::from_le_bytes([low, high]),
            kind,
            address,
            sequence,
        }
    }

    /// The record with its checksum.
    pub fn words(&self) -> [u32; WORDS] {
        let [low, high] = self.fault_resets.to_le_bytes();
        let counts = u32::from_le_bytes([low, high, self.kind, 0]);
        let mut words = [self.starts, counts, self.address, self.sequence, 0, 0];
        words[WORDS - 1] = checksum(&words);
        words
    }

    /// One more start.
    pub fn start(&mut self) {
        self.starts = self.starts.wrapping_add(1);
    }

    /// A fault, at `address` of the program where it is known, with the sample that was in work.
    pub fn fault(&mut self, kind: Kind, address: u32, sequence: u32) {
        self.sequence = sequence;
        self.fault_resets = self.fault_resets.saturating_add(1);
        self.kind = kind as u8;
        self.address = address;
    }

    /// What the unit says of itself after this start.
    pub fn identity(&self, build: [u8; 8], boot_id: u32) -> Identity {
        Identity {
            build,
            boot_id: boot_id ^ self.starts,
            reset_cause: u8::from(self.fault_resets > 0),
            fault_resets: self.fault_resets,
            fault_kind: self.kind,
            fault_address: self.address,
            fault_sequence: self.sequence,
            watchdog_resets: 0,
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

    #[test]
    fn a_fault_is_told_after_the_reset() {
        let mut record = Record::read(&[0xA5A5_A5A5; WORDS]);
        assert_eq!(record, Record::default());
        record.start();
        record.fault(Kind::HardFault, 0x0800_1234, 1234);
        let mut record = Record::read(&record.words());
        record.start();
        let identity = record.identity(*b"abc\0\0\0\0\0", 0);
        assert_eq!(identity.boot_id, 2);
        assert_eq!((identity.fault_resets, identity.fault_kind), (1, 2));
        assert_eq!(identity.fault_address, 0x0800_1234);
        assert_eq!(identity.fault_sequence, 1234);
        assert_eq!(identity.reset_cause, 1);
    }

    proptest! {
        #[test]
        fn what_power_on_left_is_no_record(words in prop::array::uniform6(any::<u32>())) {
            prop_assume!(checksum(&words) != words[WORDS - 1]);
            prop_assert_eq!(Record::read(&words), Record::default());
        }
    }
}
