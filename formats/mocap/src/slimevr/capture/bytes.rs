//! Numbers in files whose order of bytes is that of the machine that wrote them.

use std::io::{ErrorKind, Read};

/// Reads bytes until all are there or the file ends; returns how many there were.
pub(super) fn filled(file: &mut impl Read, bytes: &mut [u8]) -> std::io::Result<usize> {
    let mut count = 0;
    while let Some(rest) = bytes.get_mut(count..).filter(|rest| !rest.is_empty()) {
        match file.read(rest) {
            Ok(0) => break,
            Ok(more) => count += more,
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(count)
}

/// The number at a place, zero beyond the end.
pub(super) fn number(bytes: &[u8], at: usize, is_little: bool) -> u32 {
    let part = bytes.get(at..).and_then(<[u8]>::first_chunk::<4>);
    let part = part.copied().unwrap_or_default();
    if is_little {
        u32::from_le_bytes(part)
    } else {
        u32::from_be_bytes(part)
    }
}

/// The number of 16 bits at a place, zero beyond the end.
pub(super) fn half(bytes: &[u8], at: usize, is_little: bool) -> u16 {
    let part = bytes.get(at..).and_then(<[u8]>::first_chunk::<2>);
    let part = part.copied().unwrap_or_default();
    if is_little {
        u16::from_le_bytes(part)
    } else {
        u16::from_be_bytes(part)
    }
}
