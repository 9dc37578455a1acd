//! IGC, the format of gliding: a header, and B records with time, position and two heights.

use bodyflight_io::diagnostic::Result;

use crate::points::{Point, seconds_of, track};
use crate::track::Track;

/// Whether a text is IGC: a manufacturer's record first, and a header or a fix.
pub(crate) fn is_igc(text: &[u8]) -> bool {
    let mut lines = text.split(|byte| *byte == b'\n').take(200);
    let first = lines.next().unwrap_or_default();
    first.first() == Some(&b'A')
        && first.len() >= 4
        && !first.contains(&b',')
        && lines.any(|line| line.starts_with(b"HF") || line.starts_with(b"B") && line.len() >= 35)
}

pub(crate) fn read(text: &[u8]) -> Result<Track> {
    let text = String::from_utf8_lossy(text);
    let mut date = None;
    let (mut fixes, mut skipped) = (Vec::<(Point, f64)>::new(), 0);
    let (mut days, mut last) = (0.0, f64::NEG_INFINITY);
    for line in text.lines() {
        if let Some(rest) = line.strip_prefix("HFDTE") {
            date = date.or_else(|| date_of(rest.trim_start_matches("DATE:").trim()));
        } else if line.starts_with('B') {
            let Some((mut point, pressure_height)) = fix(line) else {
                skipped += 1;
                continue;
            };
            // Midnight.
            if point.time < last - 43_200.0 {
                days += 86_400.0;
            }
            last = point.time;
            point.time += days;
            fixes.push((point, pressure_height));
        }
    }
    let has_heights = fixes.iter().any(|(point, _)| point.height.abs() > 0.5);
    let points = fixes.into_iter().map(|(point, pressure_height)| Point {
        time: point.time + date.unwrap_or(0.0),
        height: if has_heights {
            point.height
        } else {
            pressure_height
        },
        ..point
    });
    track("IGC", points.collect(), skipped, date.is_some())
}

/// Midnight of `DDMMYY` (s since 1970).
fn date_of(text: &str) -> Option<f64> {
    let part = |from: usize| text.get(from..from + 2)?.parse::<u32>().ok();
    let year = part(4)?;
    let century = if year < 80 { 2000 } else { 1900 };
    seconds_of(century + i32::try_from(year).ok()?, part(2)?, part(0)?, 0.0)
}

/// A B record: `B` HHMMSS DDMMmmmN DDDMMmmmE A PPPPP GGGGG. Returns the point and the pressure height (m).
fn fix(line: &str) -> Option<(Point, f64)> {
    let number = |from: usize, to: usize| line.get(from..to)?.parse::<f64>().ok();
    let time = 3600.0 * number(1, 3)? + 60.0 * number(3, 5)? + number(5, 7)?;
    let degrees = |whole: f64, thousandths: f64, negative: bool| {
        let value = whole + thousandths / 60_000.0;
        if negative { -value } else { value }
    };
    let latitude = degrees(number(7, 9)?, number(9, 14)?, line.get(14..15)? == "S");
    let longitude = degrees(number(15, 18)?, number(18, 23)?, line.get(23..24)? == "W");
    if latitude.abs() > 90.0 || longitude.abs() > 180.0 {
        return None;
    }
    let point = Point {
        time,
        place: [latitude, longitude],
        height: number(30, 35)?,
        speed: None,
    };
    Some((point, number(25, 30)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fixes_have_date_place_and_height() {
        let text = b"AXXXABC\r\nHFDTE150724\r\nB2359590453000N00600000WA0150001600\r\nB0000000453030S00600000EA0149001590\r\nB00\r\n";
        assert!(is_igc(text));
        let track = read(text).unwrap();
        assert_eq!((track.samples.len(), track.skipped), (2, 1));
        assert!((track.samples[1].time - 1.0).abs() < 1e-6);
        assert!((track.samples[0].height() - 1600.0).abs() < 1e-9);
        assert_eq!(track.start, seconds_of(2024, 7, 15, 86_399.0));
        assert!(!is_igc(b"Alt,time\n"));
    }
}
