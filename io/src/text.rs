//! Text and numbers in the encodings and dialects that spreadsheets write.

use std::borrow::Cow;

/// Text in UTF-16 that begins with a byte-order mark; `None` for anything else. What is not a character becomes U+FFFD.
///
/// ```
/// use bodyflight_io::text::marked_utf_16;
///
/// assert_eq!(marked_utf_16(b"\xFF\xFEa\0").as_deref(), Some("a"));
/// assert_eq!(marked_utf_16(b"a"), None);
/// ```
pub fn marked_utf_16(bytes: &[u8]) -> Option<String> {
    match bytes {
        [0xFF, 0xFE, rest @ ..] => Some(utf_16(rest, false)),
        [0xFE, 0xFF, rest @ ..] => Some(utf_16(rest, true)),
        _ => None,
    }
}

/// Text in UTF-16 without a mark, big-endian or little-endian.
pub fn utf_16(bytes: &[u8], is_big_endian: bool) -> String {
    let units = bytes.chunks_exact(2).map(|pair| match is_big_endian {
        true => u16::from_be_bytes([pair[0], pair[1]]),
        false => u16::from_le_bytes([pair[0], pair[1]]),
    });
    char::decode_utf16(units)
        .map(|read| read.unwrap_or(char::REPLACEMENT_CHARACTER))
        .collect()
}

/// A number with a decimal point or, where commas do not separate cells, a decimal comma.
pub fn decimal(text: &str) -> Option<f64> {
    let comma = || text.replace(',', ".").parse().ok();
    text.parse().ok().or_else(comma)
}

/// CSV with commas between fields and points in numbers, from a text with semicolons or tabs, and then perhaps decimal
/// commas.
///
/// ```
/// assert_eq!(&*bodyflight_io::text::with_commas(b"a;b\n1,5;2\n"), b"a,b\n1.5,2\n");
/// ```
pub fn with_commas(text: &[u8]) -> Cow<'_, [u8]> {
    let first = text.split(|byte| *byte == b'\n').next().unwrap_or(text);
    let count = |wanted: u8| first.iter().filter(|byte| **byte == wanted).count();
    let delimiter = if count(b';') > count(b',') {
        b';'
    } else if count(b'\t') > count(b',') {
        b'\t'
    } else {
        return Cow::Borrowed(text);
    };
    let converted = text.iter().map(|byte| match *byte {
        b',' => b'.',
        byte if byte == delimiter => b',',
        byte => byte,
    });
    Cow::Owned(converted.collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_points_or_commas() {
        assert_eq!(decimal("-1.5"), Some(-1.5));
        assert_eq!(decimal("1,5e2"), Some(150.0));
        assert_eq!(decimal("1,000.5"), None);
        assert_eq!(decimal(""), None);
    }

    #[test]
    fn what_is_no_character_is_replaced() {
        assert_eq!(utf_16(b"\xD8\x00\x00a\x00", true), "\u{FFFD}a");
    }

    #[test]
    fn semicolons_and_tabs_become_commas() {
        assert_eq!(&*with_commas(b"a;b\n1,5;2\n"), b"a,b\n1.5,2\n");
        assert_eq!(&*with_commas(b"a\tb\n1.5\t2\n"), b"a,b\n1.5,2\n");
        assert_eq!(&*with_commas(b"a,b\n1.5,2\n"), b"a,b\n1.5,2\n");
    }
}
