//! Times of day with a date.

use bodyflight_io::text::leading_number;
use chrono::NaiveDate;

/// Length of a date such as `2023-10-08`.
const DATE: usize = 10;

/// Reads times and remembers the latest date, since the rows of a track have one or two.
#[derive(Debug, Default)]
pub(super) struct Calendar {
    /// The date, and when it begins (s since 1970).
    latest: Option<([u8; DATE], f64)>,
}

impl Calendar {
    /// Seconds since 1970 of `2023-10-08T21:36:27.798Z`; milliseconds may be negative.
    pub(super) fn seconds(&mut self, text: &[u8]) -> Option<f64> {
        let (date, clock) = text.split_first_chunk::<DATE>()?;
        if let Some((latest, midnight)) = self.latest
            && latest == *date
            && let Some((whole, part)) = of_clock(clock)
        {
            return Some(midnight + whole + part);
        }
        let text = core::str::from_utf8(text).ok()?;
        let midnight = text.get(..DATE).map(|date| format!("{date}T00:00:00"));
        if let Some(midnight) = midnight.and_then(|text| seconds(&text)) {
            self.latest = Some((*date, midnight));
        }
        seconds(text)
    }
}

/// Whole seconds and the rest of a second of a clock such as `T21:36:27.798Z`; `None` for unusual ones.
fn of_clock(clock: &[u8]) -> Option<(f64, f64)> {
    let [b'T', h, hh, b':', m, mm, b':', s, ss, rest @ ..] = clock else {
        return None;
    };
    let two = |tens: u8, ones: u8, below: u32| {
        let [tens, ones] = [tens, ones].map(|digit| u32::from(digit.wrapping_sub(b'0')));
        (tens < 10 && ones < 10 && 10 * tens + ones < below).then_some(10 * tens + ones)
    };
    let [hour, minute, second] = [two(*h, *hh, 24)?, two(*m, *mm, 60)?, two(*s, *ss, 60)?];
    let whole = f64::from(3600 * hour + 60 * minute + second);
    let rest = rest.strip_suffix(b"Z").unwrap_or(rest);
    let part = match leading_number(rest) {
        Some((part, length)) if rest[0] == b'.' && length == rest.len() && length <= 10 => part,
        None if rest.is_empty() => 0.0,
        _ => return None,
    };
    Some((whole, part))
}

/// Seconds since 1970 of `2023-10-08T21:36:27.798Z`; milliseconds may be negative.
fn seconds(text: &str) -> Option<f64> {
    let text = text.trim_end_matches('Z');
    let (whole, part) = text.split_once('.').unwrap_or((text, "0"));
    let (date, clock) = whole.split_once('T')?;
    let [year, month, day] = numbers(date, '-')?;
    let [hour, minute, second] = numbers(clock, ':')?;
    let day = NaiveDate::from_ymd_opt(i32::try_from(year).ok()?, month, day)?;
    // A leap second has the time of the one before it.
    let second = if second == 60 { 59 } else { second };
    let whole = day.and_hms_opt(hour, minute, second)?;
    let (sign, digits) = match part.strip_prefix('-') {
        Some(digits) => (-1.0, digits),
        None => (1.0, part),
    };
    if digits.is_empty() || digits.len() > 9 || !digits.bytes().all(|byte| byte.is_ascii_digit()) {
        return None;
    }
    let count: u32 = digits.parse().ok()?;
    let parts = 10_u32.pow(u32::try_from(digits.len()).ok()?);
    #[expect(
        clippy::cast_precision_loss,
        reason = "exact for any date of the calendar"
    )]
    Some(whole.and_utc().timestamp() as f64 + sign * (f64::from(count) / f64::from(parts)))
}

/// Three whole numbers with a separator between them.
fn numbers(text: &str, separator: char) -> Option<[u32; 3]> {
    let mut parts = text.split(separator).map(|part| part.parse().ok());
    let found = [parts.next()??, parts.next()??, parts.next()??];
    parts.next().is_none().then_some(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn negative_milliseconds_are_before_the_full_second() {
        let mut calendar = Calendar::default();
        let before = calendar.seconds(b"2023-10-08T21:36:27.899Z").unwrap();
        let negative = calendar.seconds(b"2023-10-08T21:36:28.-001Z").unwrap();
        let after = calendar.seconds(b"2023-10-08T21:36:28.101Z").unwrap();
        assert!((negative - before - 0.1).abs() < 1e-6 && (after - negative - 0.102).abs() < 1e-6);
        for bad in [
            "",
            "2023-10-08",
            "2023-10-08T21:36:28.Z",
            "2023-10-08T21:36:28.--1Z",
            "2023-10-08T24:36:28Z",
            "2023-10-08T21:36:28.1234567890Z",
            "x.1Z",
        ] {
            assert_eq!(calendar.seconds(bad.as_bytes()), None, "{bad}");
        }
    }

    #[test]
    fn no_bytes_are_a_date_before_the_first() {
        let zeros = b"\0\0\0\0\0\0\0\0\0\0T21:36:27Z";
        assert_eq!(Calendar::default().seconds(zeros), None);
    }

    #[test]
    fn a_remembered_date_gives_the_same_bits() {
        let mut calendar = Calendar::default();
        for text in [
            "2023-10-08T21:36:27.899Z",
            "2023-10-08T21:36:27.9Z",
            "2023-10-08T23:59:60.20Z",
            "2023-10-09T00:00:00Z",
            "2023-10-09T00:00:00.123456789",
            "2023-10-9T00:00:01Z",
            "2023-10-09T0:00:02Z",
        ] {
            let found = calendar.seconds(text.as_bytes()).map(f64::to_bits);
            assert!(
                found.is_some() && found == seconds(text).map(f64::to_bits),
                "{text}"
            );
        }
    }
}
