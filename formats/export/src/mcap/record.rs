//! Records of an MCAP file.

use std::collections::BTreeMap;

/// Kinds of records.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub(super) enum Kind {
    Header = 0x01,
    Footer = 0x02,
    Schema = 0x03,
    Channel = 0x04,
    Message = 0x05,
    Chunk = 0x06,
    MessageIndex = 0x07,
    ChunkIndex = 0x08,
    Statistics = 0x0b,
    Metadata = 0x0c,
    MetadataIndex = 0x0d,
    SummaryOffset = 0x0e,
    DataEnd = 0x0f,
}

/// Bytes of a record before its content: kind and length.
const PREFIX: usize = 9;

/// A record that is being written; numbers are little-endian.
pub(super) struct Record(Vec<u8>);

impl Record {
    pub(super) fn new(kind: Kind) -> Self {
        Self([&[kind as u8][..], &[0; PREFIX - 1]].concat())
    }

    pub(super) fn u8(mut self, number: u8) -> Self {
        self.0.push(number);
        self
    }

    pub(super) fn u16(self, number: u16) -> Self {
        self.bytes(&number.to_le_bytes())
    }

    pub(super) fn u32(self, number: u32) -> Self {
        self.bytes(&number.to_le_bytes())
    }

    pub(super) fn u64(self, number: u64) -> Self {
        self.bytes(&number.to_le_bytes())
    }

    pub(super) fn bytes(mut self, bytes: &[u8]) -> Self {
        self.0.extend(bytes);
        self
    }

    /// Text or bytes after their length.
    pub(super) fn counted(self, bytes: &[u8]) -> Self {
        self.u32(length(bytes.len())).bytes(bytes)
    }

    pub(super) fn texts(self, texts: &BTreeMap<String, String>) -> Self {
        self.list(texts, |list, (name, text)| {
            list.counted(name.as_bytes()).counted(text.as_bytes())
        })
    }

    /// A list after its length in bytes.
    pub(super) fn list<T>(
        mut self,
        items: impl IntoIterator<Item = T>,
        write: impl Fn(Self, T) -> Self,
    ) -> Self {
        let place = self.0.len();
        self = items.into_iter().fold(self.u32(0), write);
        let written = length(self.0.len() - place - 4);
        if let Some(count) = self.0.get_mut(place..place + 4) {
            count.copy_from_slice(&written.to_le_bytes());
        }
        self
    }

    /// The whole record.
    pub(super) fn done(mut self) -> Vec<u8> {
        let content = (self.0.len() - PREFIX) as u64;
        if let Some(count) = self.0.get_mut(1..PREFIX) {
            count.copy_from_slice(&content.to_le_bytes());
        }
        self.0
    }
}

/// A length as the format has it; lists and texts are far shorter than 4 GiB.
fn length(bytes: usize) -> u32 {
    u32::try_from(bytes).unwrap_or(u32::MAX)
}
