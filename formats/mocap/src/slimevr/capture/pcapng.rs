//! Files of Wireshark, pcapng: blocks with a type, their length at either end, and what the type says. Of these, networks and
//! packets with times are read.

use std::io::{Read, Result};

use super::bytes::{filled, half, number};

/// Type of a block that begins a section, which is the same in either order of bytes, and the number by which that is found.
pub(super) const SECTION: [u8; 4] = [0x0A, 0x0D, 0x0D, 0x0A];
const ORDER: u32 = 0x1A2B_3C4D;
/// Types of blocks that describe a network, and that hold a packet with its time.
const INTERFACE: u32 = 1;
const PACKET: u32 = 6;
/// Options of a network: the unit of its times, and what is added to them (s).
const UNIT: u16 = 9;
const OFFSET: u16 = 14;
/// Greatest length of a block (bytes).
const LONGEST: u32 = 1 << 24;

/// A network from which packets were recorded.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Interface {
    kind: u32,
    unit_s: f64,
    offset_s: f64,
}

/// What comes next in a file.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Next {
    /// A packet on a network of a kind, with its time (s since 1970).
    Packet(u32, f64, Vec<u8>),
    /// The end of the file.
    End,
    /// The same in the middle of a packet.
    Cut,
    /// A length that is none of a block.
    Damaged(u32),
}

/// Follows the blocks of a file.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Blocks {
    is_little: bool,
    /// Those of the section.
    interfaces: Vec<Interface>,
}

impl Blocks {
    /// Reads on to the next packet. `before` are bytes that were taken from the file already, at most four.
    pub(super) fn next(&mut self, file: &mut impl Read, before: &[u8]) -> Result<Next> {
        let mut file = before.chain(file);
        loop {
            let mut head = [0; 12];
            match filled(&mut file, &mut head)? {
                0 => return Ok(Next::End),
                12 => {}
                _ => return Ok(Next::Cut),
            }
            if head.starts_with(&SECTION) {
                self.is_little = number(&head, 8, true) == ORDER;
                self.interfaces.clear();
            }
            let length = number(&head, 4, self.is_little);
            if !(12..=LONGEST).contains(&length) || !length.is_multiple_of(4) {
                return Ok(Next::Damaged(length));
            }
            // The head has the first four bytes of the content, and the length follows it.
            let rest = usize::try_from(length).unwrap_or(0) - 12;
            let mut block = vec![0; rest + 4];
            if let Some(begin) = block.first_chunk_mut::<4>() {
                begin.copy_from_slice(&head[8..]);
            }
            if filled(&mut file, block.get_mut(4..).unwrap_or_default())? < rest {
                return Ok(Next::Cut);
            }
            block.truncate(rest);
            match number(&head, 0, self.is_little) {
                INTERFACE => self.interfaces.push(self.interface(&block)),
                PACKET => {
                    if let Some(packet) = self.packet(&block) {
                        return Ok(packet);
                    }
                }
                _ => {}
            }
        }
    }

    fn interface(&self, block: &[u8]) -> Interface {
        let mut found = Interface {
            kind: u32::from(half(block, 0, self.is_little)),
            unit_s: 1e-6,
            offset_s: 0.0,
        };
        let mut options = block.get(8..).unwrap_or_default();
        while let Some((head, rest)) = options.split_first_chunk::<4>() {
            let length = usize::from(half(head, 2, self.is_little));
            match (half(head, 0, self.is_little), rest.get(..length)) {
                (UNIT, Some([unit])) => {
                    let power = -i32::from(unit & 0x7F);
                    let base: f64 = if unit & 0x80 == 0 { 10.0 } else { 2.0 };
                    found.unit_s = base.powi(power);
                }
                (OFFSET, Some(value)) => found.offset_s = self.seconds(value),
                _ => {}
            }
            options = rest.get(length.next_multiple_of(4)..).unwrap_or_default();
        }
        found
    }

    /// The packet of a block, unless it is cut off or of a network that was not described.
    fn packet(&self, block: &[u8]) -> Option<Next> {
        let place = usize::try_from(number(block, 0, self.is_little)).ok()?;
        let interface = self.interfaces.get(place)?;
        let high = u64::from(number(block, 4, self.is_little));
        let ticks = high << 32 | u64::from(number(block, 8, self.is_little));
        let length = usize::try_from(number(block, 12, self.is_little)).ok()?;
        let bytes = block.get(20..)?.get(..length)?;
        let time_s = ticks as f64 * interface.unit_s + interface.offset_s;
        Some(Next::Packet(interface.kind, time_s, bytes.to_vec()))
    }

    /// A number of 64 bits with a sign.
    fn seconds(&self, bytes: &[u8]) -> f64 {
        let [first, second] = [0, 4].map(|at| u64::from(number(bytes, at, self.is_little)));
        let whole = match self.is_little {
            true => second << 32 | first,
            false => first << 32 | second,
        };
        whole.cast_signed() as f64
    }
}
