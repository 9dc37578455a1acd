//! TES, the binary format of Wintec loggers: records of 16 bytes with time, position and height.

use bodyflight_io::diagnostic::Result;

use crate::points::{Point, seconds_of, track};
use crate::track::Track;

/// Bytes of a record.
const RECORD: usize = 16;

/// Whether these bytes are whole records with plausible dates and places.
pub(crate) fn is_tes(bytes: &[u8]) -> bool {
    bytes.len() >= 2 * RECORD
        && bytes.len().is_multiple_of(RECORD)
        && bytes
            .chunks_exact(RECORD)
            .take(20)
            .all(|record| point(record).is_some())
}

pub(crate) fn read(bytes: &[u8]) -> Result<Track> {
    let records = bytes.chunks_exact(RECORD);
    let all = records.len();
    let points: Vec<Point> = records.filter_map(point).collect();
    let skipped = all - points.len();
    track("TES", points, skipped, true)
}

/// Flags (16 bits), date and time (seconds 6 bits, minutes 6, hours 5, day 5, month 4, years since 2000 6), latitude and
/// longitude (signed, 1e-7 degrees), height (signed, m); little endian.
fn point(record: &[u8]) -> Option<Point> {
    let four = |at: usize| record.get(at..at + 4)?.try_into().ok();
    let packed = u32::from_le_bytes(four(2)?);
    let bits = |from: u32, count: u32| (packed >> from) & ((1 << count) - 1);
    let [second, minute, hour] = [bits(0, 6), bits(6, 6), bits(12, 5)];
    let time_of_day = f64::from(3600 * hour + 60 * minute + second);
    let year = i32::try_from(2000 + bits(26, 6)).ok()?;
    let degrees = |at: usize| Some(f64::from(i32::from_le_bytes(four(at)?)) * 1e-7);
    let place = [degrees(6)?, degrees(10)?];
    let height = i16::from_le_bytes(record.get(14..16)?.try_into().ok()?);
    let is_plausible =
        place[0].abs() <= 90.0 && place[1].abs() <= 180.0 && hour < 24 && minute < 60;
    is_plausible.then_some(Point {
        time: seconds_of(year, bits(22, 4), bits(17, 5), time_of_day)?,
        place,
        height: f64::from(height),
        speed: None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_are_unpacked() {
        let record = |second: u32, height: i16| {
            let packed = second | 4 << 6 | 11 << 12 | 16 << 17 | 8 << 22 | 12 << 26;
            let mut bytes = vec![1, 0];
            bytes.extend(packed.to_le_bytes());
            bytes.extend(468_364_448_i32.to_le_bytes());
            bytes.extend((-181_133_440_i32).to_le_bytes());
            bytes.extend(height.to_le_bytes());
            bytes
        };
        let bytes = [record(32, 3825), record(36, 3810)].concat();
        assert!(is_tes(&bytes) && !is_tes(&[0; 32]) && !is_tes(&bytes[..31]));
        let track = read(&bytes).unwrap();
        assert_eq!(track.start, seconds_of(2012, 8, 16, 39_872.0));
        assert!((track.samples[1].time - 4.0).abs() < 1e-6);
        assert!((track.samples[1].height() - 3810.0).abs() < 1e-9);
    }
}
