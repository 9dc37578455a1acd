//! Members of a zip archive, as far as other programs' recordings need: stored or deflated, with their checksums
//! verified. The crate `zip`, with which the full program writes archives, would add ten crates to the first build.

use std::io::Read;

use bodyflight_io::diagnostic::{Problem, Result};
use flate2::read::DeflateDecoder;

/// Signatures of the parts of an archive.
const MEMBER: &[u8] = b"PK\x03\x04";
const ENTRY: &[u8] = b"PK\x01\x02";
const END: &[u8] = b"PK\x05\x06";
/// Length of the fixed part of the end record, and of the remark that may follow it (bytes).
const END_LENGTH: usize = 22;
const REMARK: usize = 1 << 16;
/// Largest member (bytes).
const LARGEST: u32 = 1 << 30;

/// An archive in memory.
pub(crate) struct Archive<'a> {
    bytes: &'a [u8],
    entries: Vec<Entry>,
}

struct Entry {
    name: String,
    method: u16,
    checksum: u32,
    packed: u32,
    length: u32,
    offset: u32,
}

/// Whether a file is an archive.
pub(crate) fn is_archive(bytes: &[u8]) -> bool {
    bytes.starts_with(MEMBER)
}

fn damaged(what: impl Into<String>) -> Problem {
    Problem::bad_input(what).help("the archive is damaged or was cut off: copy the file again")
}

fn bytes_at<const N: usize>(bytes: &[u8], at: usize) -> Result<[u8; N]> {
    let found = bytes.get(at..).and_then(|rest| rest.first_chunk::<N>());
    found
        .copied()
        .ok_or_else(|| damaged("the archive ends early"))
}

fn two(bytes: &[u8], at: usize) -> Result<u16> {
    bytes_at(bytes, at).map(u16::from_le_bytes)
}

fn four(bytes: &[u8], at: usize) -> Result<u32> {
    bytes_at(bytes, at).map(u32::from_le_bytes)
}

impl<'a> Archive<'a> {
    /// Reads the list of members.
    ///
    /// # Errors
    /// Returns an error if it is damaged.
    pub(crate) fn read(bytes: &'a [u8]) -> Result<Self> {
        let from = bytes.len().saturating_sub(END_LENGTH + REMARK);
        let tail = bytes.get(from..).unwrap_or_default();
        let end = tail
            .windows(END.len())
            .rposition(|part| part == END)
            .ok_or_else(|| damaged("the archive has no list of members"))?;
        let end = from + end;
        if bytes.len() < end + END_LENGTH {
            return Err(damaged("the archive ends early"));
        }
        let count = two(bytes, end + 10)?;
        let mut at = four(bytes, end + 16)? as usize;
        let mut entries = Vec::new();
        for _ in 0..count {
            if !bytes.get(at..).is_some_and(|rest| rest.starts_with(ENTRY)) {
                return Err(damaged("the archive's list of members is damaged"));
            }
            let name_length = usize::from(two(bytes, at + 28)?);
            let more = usize::from(two(bytes, at + 30)?) + usize::from(two(bytes, at + 32)?);
            let name = bytes.get(at + 46..at + 46 + name_length);
            entries.push(Entry {
                name: String::from_utf8_lossy(name.unwrap_or_default()).into_owned(),
                method: two(bytes, at + 10)?,
                checksum: four(bytes, at + 16)?,
                packed: four(bytes, at + 20)?,
                length: four(bytes, at + 24)?,
                offset: four(bytes, at + 42)?,
            });
            at += 46 + name_length + more;
        }
        Ok(Self { bytes, entries })
    }

    /// Names of the members.
    pub(crate) fn names(&self) -> impl Iterator<Item = &str> {
        self.entries.iter().map(|entry| entry.name.as_str())
    }

    /// The content of a member, `None` if there is none of this name.
    ///
    /// # Errors
    /// Returns an error if it is damaged, encrypted, larger than 1 GiB, or compressed by another method than deflate.
    pub(crate) fn member(&self, name: &str) -> Result<Option<Vec<u8>>> {
        let Some(entry) = self.entries.iter().find(|entry| entry.name == name) else {
            return Ok(None);
        };
        self.content(entry)
            .map(Some)
            .map_err(|problem| problem.at(name.to_owned()))
    }

    fn content(&self, entry: &Entry) -> Result<Vec<u8>> {
        if entry.length > LARGEST || entry.packed > LARGEST {
            let message = format!("expected at most {} MiB, found more", LARGEST >> 20);
            return Err(Problem::bad_input(message));
        }
        let header = entry.offset as usize;
        if !self
            .bytes
            .get(header..)
            .is_some_and(|rest| rest.starts_with(MEMBER))
        {
            return Err(damaged(
                "expected the member where the list says, found other bytes",
            ));
        }
        if two(self.bytes, header + 6)? & 1 == 1 {
            return Err(Problem::bad_input("the member is encrypted"));
        }
        let skip =
            usize::from(two(self.bytes, header + 26)?) + usize::from(two(self.bytes, header + 28)?);
        let from = header + 30 + skip;
        let packed = (self.bytes.get(from..))
            .and_then(|rest| rest.get(..entry.packed as usize))
            .ok_or_else(|| damaged("the archive ends within the member"))?;
        let content = match entry.method {
            0 => packed.to_vec(),
            8 => {
                let mut content = Vec::new();
                DeflateDecoder::new(packed)
                    .take(u64::from(entry.length) + 1)
                    .read_to_end(&mut content)
                    .map_err(|error| {
                        damaged("the member cannot be decompressed").caused_by(error)
                    })?;
                content
            }
            method => {
                let message =
                    format!("expected a stored or deflated member, found method {method}");
                return Err(Problem::bad_input(message));
            }
        };
        let mut sum = flate2::Crc::new();
        sum.update(&content);
        if content.len() != entry.length as usize || sum.sum() != entry.checksum {
            return Err(damaged("the member's checksum does not hold"));
        }
        Ok(content)
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use std::io::Write;

    use super::*;

    /// An archive with these members, deflated.
    #[expect(clippy::cast_possible_truncation, reason = "small numbers")]
    pub(crate) fn packed(members: &[(&str, &[u8])]) -> Vec<u8> {
        let (mut bytes, mut list) = (Vec::new(), Vec::new());
        for (name, content) in members {
            let mut deflated =
                flate2::write::DeflateEncoder::new(Vec::new(), flate2::Compression::fast());
            deflated.write_all(content).unwrap();
            let deflated = deflated.finish().unwrap();
            let mut sum = flate2::Crc::new();
            sum.update(content);
            let offset = bytes.len() as u32;
            let mut common = vec![20, 0, 0, 0, 8, 0, 0, 0, 0, 0];
            for number in [sum.sum(), deflated.len() as u32, content.len() as u32] {
                common.extend(number.to_le_bytes());
            }
            common.extend((name.len() as u16).to_le_bytes());
            common.extend([0, 0]);
            bytes.extend(
                MEMBER
                    .iter()
                    .chain(&common)
                    .chain(name.as_bytes())
                    .chain(&deflated),
            );
            list.extend(ENTRY.iter().chain(&[20, 0]).chain(&common).chain(&[0; 10]));
            list.extend(offset.to_le_bytes());
            list.extend(name.as_bytes());
        }
        let (at, size) = (bytes.len() as u32, list.len() as u32);
        let count = (members.len() as u16).to_le_bytes();
        bytes.extend(list);
        bytes.extend(END.iter().chain(&[0; 4]).chain(&count).chain(&count));
        bytes.extend(
            size.to_le_bytes()
                .iter()
                .chain(&at.to_le_bytes())
                .chain(&[0, 0]),
        );
        bytes
    }

    #[test]
    fn members_are_read_and_a_flipped_bit_is_an_error() {
        let text = b"a recording of a movement".repeat(40);
        let bytes = packed(&[("a.npy", &text), ("b.npy", b"short")]);
        let archive = Archive::read(&bytes).unwrap();
        assert_eq!(archive.names().collect::<Vec<_>>(), ["a.npy", "b.npy"]);
        assert_eq!(archive.member("a.npy").unwrap(), Some(text.clone()));
        assert_eq!(archive.member("c.npy").unwrap(), None);
        let whole = |bytes: &[u8]| {
            let archive = Archive::read(bytes).ok()?;
            let members = ["a.npy", "b.npy"].map(|name| archive.member(name).ok().flatten());
            let [Some(a), Some(b)] = members else {
                return None;
            };
            Some((a, b))
        };
        let right = whole(&bytes).unwrap();
        for at in 0..bytes.len() {
            let mut changed = bytes.clone();
            changed[at] ^= 4;
            assert!(
                whole(&changed).is_none_or(|found| found == right),
                "byte {at}"
            );
            assert!(whole(&bytes[..at]).is_none(), "cut at {at}");
        }
    }
}
