//! A single packet: preamble, addresses, length, data, checksum.

use super::item::Items;

/// First byte of every packet; it may also occur in the data.
pub(super) const PREAMBLE: u8 = 0xFA;
/// Length byte which indicates that two bytes of extended length follow.
pub(super) const EXTENDED: u8 = 0xFF;

/// Bus address of a sensor that is alone on the line, or of the master.
const MASTER: u8 = 0xFF;

/// Highest bus address of a sensor: a station has up to 20. With any other address the preamble occurred by chance.
const SENSORS: u8 = 20;

/// Maximum number of data bytes in a packet.
pub const MAX_DATA_LENGTH: usize = 2048;
/// Length of the longest packet (bytes).
pub const MAX_PACKET_LENGTH: usize = MAX_DATA_LENGTH + 7;

/// Kind of a packet. The kind of an answer is that of the request plus one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct MessageId(pub u8);

#[expect(missing_docs, reason = "the names of the vendor's document")]
impl MessageId {
    pub const REQUEST_DEVICE_ID: Self = Self(0x00);
    pub const DEVICE_ID: Self = Self(0x01);
    pub const GOTO_MEASUREMENT: Self = Self(0x10);
    pub const GOTO_MEASUREMENT_ACK: Self = Self(0x11);
    pub const FIRMWARE_REVISION: Self = Self(0x13);
    pub const BAUDRATE: Self = Self(0x18);
    pub const BAUDRATE_ACK: Self = Self(0x19);
    pub const GOTO_CONFIG: Self = Self(0x30);
    pub const GOTO_CONFIG_ACK: Self = Self(0x31);
    pub const MT_DATA2: Self = Self(0x36);
    pub const WAKE_UP: Self = Self(0x3E);
    pub const WAKE_UP_ACK: Self = Self(0x3F);
    pub const RESET: Self = Self(0x40);
    pub const ERROR: Self = Self(0x42);
    pub const WARNING: Self = Self(0x43);
    pub const OUTPUT_CONFIGURATION: Self = Self(0xC0);
    pub const OUTPUT_CONFIGURATION_ACK: Self = Self(0xC1);
}

/// A packet with a correct checksum, borrowed from the buffer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Packet<'a> {
    /// Bus address: 0xFF or 0x01 for a sensor that is alone on the line, 1 to 20 for one of several.
    pub bus_id: u8,
    /// Kind of the packet.
    pub message_id: MessageId,
    /// Data, without header and checksum.
    pub data: &'a [u8],
}

impl<'a> Packet<'a> {
    /// Iterates over the measurements of an MTData2 packet; empty for any other packet.
    pub fn items(&self) -> Items<'a> {
        Items::new(if self.message_id == MessageId::MT_DATA2 {
            self.data
        } else {
            &[]
        })
    }
}

/// Result of examining the bytes at a preamble.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Candidate {
    /// A packet so far; it needs at least `total` bytes.
    Incomplete { total: usize },
    /// A complete packet of `total` bytes.
    Whole { total: usize },
    /// The address is not that of a sensor.
    BadAddress,
    /// The checksum does not match.
    BadChecksum,
    /// The length is impossible.
    BadLength,
    /// The checksum matches, but the items do not fill the data.
    BadItems,
}

/// Examines `bytes`, which start with a preamble.
pub(super) fn judge(bytes: &[u8]) -> Candidate {
    if let [_, address, ..] = bytes
        && *address != MASTER
        && !(1..=SENSORS).contains(address)
    {
        return Candidate::BadAddress;
    }
    // One of several sensors on a line is only heard with its measurements: a preamble that occurs by chance is then
    // rarely taken for one.
    if let [_, address, message, ..] = bytes
        && (2..=SENSORS).contains(address)
        && *message != MessageId::MT_DATA2.0
    {
        return Candidate::BadAddress;
    }
    let (header, length) = match extent(bytes) {
        Ok(extent) => extent,
        Err(candidate) => return candidate,
    };
    let total = header + length + 1;
    let Some(covered) = bytes.get(1..total) else {
        return Candidate::Incomplete { total };
    };
    if checksum(covered) != 0 {
        return Candidate::BadChecksum;
    }
    // The 8-bit sum accepts one damaged packet in 256, and a chance preamble inside such a packet could hide the next
    // packet. The address above and items that fill the data exactly are two additional checks at no cost.
    match view(bytes) {
        Some(packet) if packet.message_id == MessageId::MT_DATA2 && !Items::fill(packet.data) => {
            Candidate::BadItems
        }
        _ => Candidate::Whole { total },
    }
}

/// Returns the packet at the start of `bytes`, without checking its contents.
pub(super) fn view(bytes: &[u8]) -> Option<Packet<'_>> {
    let (header, length) = extent(bytes).ok()?;
    Some(Packet {
        bus_id: *bytes.get(1)?,
        message_id: MessageId(*bytes.get(2)?),
        data: bytes.get(header..header + length)?,
    })
}

/// Sum of all bytes modulo 256; 0 over a whole packet without its preamble.
pub(super) fn checksum(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0, |sum, &byte| sum.wrapping_add(byte))
}

/// Lengths of header and data (bytes).
fn extent(bytes: &[u8]) -> Result<(usize, usize), Candidate> {
    match bytes {
        [_, _, _, EXTENDED, high, low, ..] => {
            let length = usize::from(u16::from_be_bytes([*high, *low]));
            if (usize::from(EXTENDED)..=MAX_DATA_LENGTH).contains(&length) {
                Ok((6, length))
            } else {
                Err(Candidate::BadLength)
            }
        }
        [_, _, _, EXTENDED, ..] => Err(Candidate::Incomplete { total: 6 }),
        [_, _, _, length, ..] => Ok((4, usize::from(*length))),
        _ => Err(Candidate::Incomplete { total: 4 }),
    }
}
