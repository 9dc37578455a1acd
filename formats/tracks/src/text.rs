//! Text in the encodings and dialects that spreadsheets and loggers write.

use std::borrow::Cow;

use bodyflight_io::text::{marked_utf_16, utf_16};

/// Number of bytes at the start by which the dialect is recognised.
const HEAD: usize = 4096;

/// The text of a file in UTF-8, without byte order mark and leading blanks. UTF-16 is recognised by its mark, or by its
/// zeros.
pub(crate) fn plain(bytes: &[u8]) -> Cow<'_, [u8]> {
    let head = &bytes[..bytes.len().min(HEAD)];
    let zeros = |odd: usize| {
        let bytes = head.iter().skip(odd).step_by(2);
        bytes.filter(|byte| **byte == 0).count() * 5 > head.len() * 2
    };
    let unmarked = |is_big_endian| utf_16(bytes, is_big_endian);
    let wide = match marked_utf_16(bytes) {
        None if head.len() > 8 && zeros(1) => Some(unmarked(false)),
        None if head.len() > 8 && zeros(0) => Some(unmarked(true)),
        marked => marked,
    };
    if let Some(text) = wide {
        return Cow::Owned(text.trim_start().as_bytes().to_vec());
    }
    let text = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
    let start = text.iter().position(|byte| !byte.is_ascii_whitespace());
    Cow::Borrowed(start.map_or(&[][..], |start| &text[start..]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_orders_of_utf_16_are_read_with_and_without_a_mark() {
        let text = "time,lat\n2020,46.5\n";
        let little: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
        let big: Vec<u8> = text.encode_utf16().flat_map(u16::to_be_bytes).collect();
        for bytes in [
            [&[0xFF, 0xFE], &little[..]].concat(),
            [&[0xFE, 0xFF], &big[..]].concat(),
            little,
            big,
            [b"\xEF\xBB\xBF\r\n", text.as_bytes()].concat(),
        ] {
            assert_eq!(&*plain(&bytes), text.as_bytes());
        }
    }
}
