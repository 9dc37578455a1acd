//! FIT, the format of sports watches: only the records of an activity, with time, position, height and speed.

use bodyflight_io::diagnostic::{Problem, Result};

use crate::points::{Point, track};
use crate::track::Track;

/// 1989-12-31, from which FIT counts (s since 1970).
const EPOCH: f64 = 631_065_600.0;

/// Number of the message that holds a record, and those of its fields.
const RECORD: u16 = 20;
const LATITUDE: u8 = 0;
const LONGITUDE: u8 = 1;
const ALTITUDE: u8 = 2;
const SPEED: u8 = 6;
const ENHANCED_SPEED: u8 = 73;
const ENHANCED_ALTITUDE: u8 = 78;
const TIMESTAMP: u8 = 253;

/// Whether these bytes are a FIT file.
pub(crate) fn is_fit(bytes: &[u8]) -> bool {
    bytes.get(8..12) == Some(b".FIT")
}

/// The layout of a message: number, byte order, its fields (number and size), and the bytes of developers' fields.
#[derive(Clone)]
struct Definition {
    message: u16,
    is_big: bool,
    fields: Vec<(u8, usize)>,
    more: usize,
}

/// Reads bytes from the front.
struct Bytes<'a>(&'a [u8]);

impl<'a> Bytes<'a> {
    fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(taken)
    }

    fn byte(&mut self) -> Option<u8> {
        self.take(1).map(|byte| byte[0])
    }
}

pub(crate) fn read(bytes: &[u8]) -> Result<Track> {
    let header = usize::from(bytes.first().copied().unwrap_or(0));
    let size = bytes.get(4..8).and_then(|size| size.try_into().ok());
    let size = size.map_or(0, |size| u32::from_le_bytes(size) as usize);
    let end = header.saturating_add(size).min(bytes.len());
    let mut rest = Bytes(bytes.get(header..end).unwrap_or(&[]));
    let mut definitions: [Option<Definition>; 16] = Default::default();
    let (mut points, mut skipped, mut clock) = (Vec::new(), 0, None);
    // A file that was cut off still has its beginning.
    while let Some(Some(read)) =
        (!rest.0.is_empty()).then(|| message(&mut rest, &mut definitions, &mut clock))
    {
        match read {
            Read::Point(point) => points.push(point),
            Read::Unusable => skipped += 1,
            Read::Other => {}
        }
    }
    if points.is_empty() && skipped > 0 {
        return Err(Problem::bad_input(format!(
            "this FIT file has {skipped} records, but none with time, position and height"
        ))
        .help("let the watch record satellite positions, or export the activity as GPX"));
    }
    track("FIT", points, skipped, true)
}

enum Read {
    Point(Point),
    Unusable,
    Other,
}

/// Reads the next message; `None` at the end or if the file is damaged.
fn message(
    rest: &mut Bytes<'_>,
    definitions: &mut [Option<Definition>; 16],
    clock: &mut Option<u32>,
) -> Option<Read> {
    let head = rest.byte()?;
    let is_compressed = head & 0x80 != 0;
    let local = usize::from(if is_compressed {
        head >> 5 & 3
    } else {
        head & 15
    });
    if !is_compressed && head & 0x40 != 0 {
        definitions[local] = Some(definition(rest, head & 0x20 != 0)?);
        return Some(Read::Other);
    }
    let definition = definitions[local].clone()?;
    let mut values = [None; 256];
    for (field, size) in &definition.fields {
        values[usize::from(*field)] = number(rest.take(*size)?, definition.is_big);
    }
    rest.take(definition.more)?;
    let value = |field: u8| values[usize::from(field)];
    if let Some(time) = value(TIMESTAMP) {
        *clock = Some(time);
    } else if let (true, Some(last)) = (is_compressed, *clock) {
        let ahead = u32::from(head & 31).wrapping_sub(last) & 31;
        *clock = Some(last.wrapping_add(ahead));
    }
    if definition.message != RECORD {
        return Some(Read::Other);
    }
    let degrees =
        |field: u8| Some(f64::from(value(field)?.cast_signed()) * 180.0 / 2_147_483_648.0);
    let either = |one: u8, other: u8| value(one).or_else(|| value(other)).map(f64::from);
    let point = || {
        Some(Point {
            time: f64::from((*clock)?) + EPOCH,
            place: [degrees(LATITUDE)?, degrees(LONGITUDE)?],
            height: either(ENHANCED_ALTITUDE, ALTITUDE)? / 5.0 - 500.0,
            speed: either(ENHANCED_SPEED, SPEED).map(|speed| speed / 1000.0),
        })
    };
    Some(point().map_or(Read::Unusable, Read::Point))
}

fn definition(rest: &mut Bytes<'_>, has_more: bool) -> Option<Definition> {
    rest.byte()?;
    let is_big = rest.byte()? != 0;
    let message = rest.take(2)?.try_into().ok()?;
    let count = rest.byte()?;
    let mut fields = Vec::new();
    for _ in 0..count {
        let field = rest.take(3)?;
        fields.push((field[0], usize::from(field[1])));
    }
    let mut more = 0;
    if has_more {
        for _ in 0..rest.byte()? {
            more += usize::from(rest.take(3)?[1]);
        }
    }
    Some(Definition {
        message: if is_big {
            u16::from_be_bytes(message)
        } else {
            u16::from_le_bytes(message)
        },
        is_big,
        fields,
        more,
    })
}

/// A number of two or four bytes; `None` for the values that mean that there is none.
fn number(bytes: &[u8], is_big: bool) -> Option<u32> {
    match *bytes {
        [a, b] => {
            let value = if is_big {
                u16::from_be_bytes([a, b])
            } else {
                u16::from_le_bytes([a, b])
            };
            (value != u16::MAX).then_some(u32::from(value))
        }
        [a, b, c, d] => {
            let value = if is_big {
                u32::from_be_bytes([a, b, c, d])
            } else {
                u32::from_le_bytes([a, b, c, d])
            };
            (value != u32::MAX && value != 0x7FFF_FFFF).then_some(value)
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_with_both_kinds_of_clock_are_read() {
        let mut data = vec![0x40, 0, 0, 20, 0, 4];
        data.extend([
            TIMESTAMP, 4, 0x86, LATITUDE, 4, 0x85, LONGITUDE, 4, 0x85, ALTITUDE, 2, 0x84,
        ]);
        // 46.5 degrees north, 8 degrees west.
        let place = [554_766_336_i32, -95_443_718]
            .map(i32::to_le_bytes)
            .concat();
        data.push(0);
        data.extend(1_000_000_000_u32.to_le_bytes());
        data.extend(&place);
        data.extend(17_500_u16.to_le_bytes());
        // The same without a time of its own: 1 s later by the five bits of its head.
        data.extend([0x41, 0, 0, 20, 0, 3]);
        data.extend([LATITUDE, 4, 0x85, LONGITUDE, 4, 0x85, ALTITUDE, 2, 0x84]);
        data.push(0x80 | 1 << 5 | ((1_000_000_001_u32 & 31) as u8));
        data.extend(&place);
        data.extend(17_250_u16.to_le_bytes());
        let mut file = vec![12, 16, 0, 0];
        file.extend(u32::try_from(data.len()).unwrap().to_le_bytes());
        file.extend(b".FIT");
        file.extend(&data);
        assert!(is_fit(&file));
        let track = read(&file).unwrap();
        assert_eq!((track.samples.len(), track.skipped), (2, 0));
        assert!((track.samples[1].time - 1.0).abs() < 1e-9);
        assert!((track.samples[0].height() - 3000.0).abs() < 1e-9);
        assert!((track.samples[1].height() - 2950.0).abs() < 1e-9);
        for cut in 0..file.len() {
            let _ = read(&file[..cut]);
        }
    }
}
