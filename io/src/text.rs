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

/// Most digits of a number that is computed here: any of them fit into 64 bits.
const DIGITS: usize = 19;

/// Powers of ten that are exact in double precision, as far as decimals need them.
const POWERS: [f64; DIGITS + 1] = [
    1.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16,
    1e17, 1e18, 1e19,
];

/// Powers of ten for each number of digits that are read at once.
const TENS: [u64; 9] = [
    1,
    10,
    100,
    1000,
    10_000,
    100_000,
    1_000_000,
    10_000_000,
    100_000_000,
];

/// The number of the digits that eight bytes begin with, and how many there are, without a branch for each.
#[inline]
fn leading_digits(eight: [u8; 8]) -> (u64, usize) {
    const ZEROS: u64 = 0x3030_3030_3030_3030;
    const PAIRS: u64 = 0x0000_00FF_0000_00FF;
    let values = u64::from_le_bytes(eight) ^ ZEROS;
    // Only digits have an upper half of zero, with and without six added.
    let others = (values.wrapping_add(0x0606_0606_0606_0606) | values) & 0xF0F0_F0F0_F0F0_F0F0;
    let count = (others.trailing_zeros() / 8) as usize;
    if count == 0 {
        return (0, 0);
    }
    // As the last of eight digits, whose first are zero: then in pairs, then in fours, then all.
    let digits = values << (64 - 8 * count);
    let pairs = digits.wrapping_mul(10).wrapping_add(digits >> 8);
    let upper = (pairs & PAIRS).wrapping_mul(100 + (1_000_000 << 32));
    let lower = ((pairs >> 16) & PAIRS).wrapping_mul(1 + (10_000 << 32));
    (upper.wrapping_add(lower) >> 32, count)
}

/// The number of digits with or without a point that a text begins with, and its length; `None` if there is none, or
/// if it has too many digits for this. Whoever calls this checks what follows, such as an exponent.
///
/// Its bits are those of [`str::parse`]: an integer below 2^53 and the power of ten are exact, so that their quotient
/// is rounded once.
#[inline]
pub fn leading_number(text: &[u8]) -> Option<(f64, usize)> {
    let digits = |from: usize, integer: &mut u64| {
        let mut at = from;
        while let Some(eight) = text.get(at..).and_then(<[u8]>::first_chunk) {
            let (value, count) = leading_digits(*eight);
            *integer = integer.wrapping_mul(TENS[count]).wrapping_add(value);
            at += count;
            if count < eight.len() {
                return at;
            }
        }
        while let Some(digit) = text.get(at).map(|byte| byte.wrapping_sub(b'0'))
            && digit < 10
        {
            *integer = integer.wrapping_mul(10).wrapping_add(u64::from(digit));
            at += 1;
        }
        at
    };
    let begin = usize::from(matches!(text.first(), Some(b'-' | b'+')));
    let mut integer = 0;
    let mut end = digits(begin, &mut integer);
    let (mut count, mut decimals) = (end - begin, 0);
    if text.get(end) == Some(&b'.') {
        let point = end + 1;
        end = digits(point, &mut integer);
        decimals = end - point;
        count += decimals;
    }
    if count == 0 || count > DIGITS || integer > 1 << 53 {
        return None;
    }
    #[expect(clippy::cast_precision_loss, reason = "exact up to 2^53")]
    let number = integer as f64 / POWERS[decimals];
    Some((if text[0] == b'-' { -number } else { number }, end))
}

/// The number that a text is, with the bits of [`str::parse`].
#[inline]
pub fn number(text: &str) -> Option<f64> {
    match leading_number(text.as_bytes()) {
        Some((number, length)) if length == text.len() => Some(number),
        _ => text.parse().ok(),
    }
}

/// The finite numbers of a text with blanks between them; of a word that is none, the word.
///
/// ```
/// use bodyflight_io::text::numbers;
///
/// let found: Vec<_> = numbers("0.5  -1e3 one").collect();
/// assert_eq!(found, [Ok(0.5), Ok(-1000.0), Err("one")]);
/// ```
#[inline]
pub fn numbers(text: &str) -> impl Iterator<Item = Result<f64, &str>> {
    let bytes = text.as_bytes();
    let mut at = 0;
    core::iter::from_fn(move || {
        let is_blank = |byte: &u8| byte.is_ascii_whitespace();
        while bytes.get(at).is_some_and(is_blank) {
            at += 1;
        }
        let rest = bytes.get(at..).filter(|rest| !rest.is_empty())?;
        let begin = at;
        if let Some((number, length)) = leading_number(rest)
            && rest.get(length).is_none_or(is_blank)
        {
            at += length;
            return Some(Ok(number));
        }
        at += rest.iter().position(is_blank).unwrap_or(rest.len());
        let word = text.get(begin..at).unwrap_or_default();
        let number = word.parse().ok().filter(|number: &f64| number.is_finite());
        Some(number.ok_or(word))
    })
}

/// A number with a decimal point or, where commas do not separate cells, a decimal comma.
pub fn decimal(text: &str) -> Option<f64> {
    let comma = || text.replace(',', ".").parse().ok();
    number(text).or_else(comma)
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
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn numbers_have_the_bits_of_the_standard_library(
            sign in "[-+]?",
            text in prop_oneof![
                4 => "[0-9]{0,3}[.]?[0-9]{0,7}",
                2 => "[0-9]{0,12}[.]?[0-9]{0,22}",
                1 => "0{0,20}900719925474099[0-9]{1,2}[.]?[0-9]{0,2}",
                1 => "[0-9]{1,3}[.]?[0-9]{0,3}[eE][-+]?[0-9]{1,3}",
                1 => "[-+0-9.eEinfa_, x]{0,6}",
            ],
        ) {
            let text = format!("{sign}{text}");
            let wanted = text.parse().ok().map(f64::to_bits);
            prop_assert_eq!(number(&text).map(f64::to_bits), wanted);
            let words = text.split_ascii_whitespace();
            let is_number = |word: &str| word.parse().is_ok_and(f64::is_finite);
            let found: Vec<_> = numbers(&text).collect();
            prop_assert_eq!(found.len(), words.clone().count());
            for (found, word) in found.into_iter().zip(words) {
                match found {
                    Ok(number) => prop_assert_eq!(Ok(number.to_bits()), word.parse().map(f64::to_bits)),
                    Err(refused) => prop_assert!(refused == word && !is_number(word)),
                }
            }
        }
    }

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
