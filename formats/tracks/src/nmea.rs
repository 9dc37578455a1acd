//! NMEA 0183: RMC sentences with date and speed, GGA sentences with the height.

use bodyflight_io::diagnostic::{Problem, Result};

use crate::points::{Point, seconds_of, track};
use crate::track::Track;

/// Metres per second of a knot.
const KNOT: f64 = 1852.0 / 3600.0;

/// Whether a text is NMEA: a sentence of any talker with a comma.
pub(crate) fn is_nmea(text: &[u8]) -> bool {
    let first = text.split(|byte| *byte == b'\n').next().unwrap_or_default();
    first.starts_with(b"$G")
        && first.get(3..6).is_some_and(|kind| kind.is_ascii())
        && first.get(6) == Some(&b',')
}

/// What the sentences of one instant say.
#[derive(Default, Clone, Copy)]
struct Instant {
    time_of_day: f64,
    place: Option<[f64; 2]>,
    height: Option<f64>,
    speed: Option<f64>,
    midnight: Option<f64>,
}

pub(crate) fn read(text: &[u8]) -> Result<Track> {
    let text = String::from_utf8_lossy(text);
    let (mut instants, mut skipped) = (Vec::<Instant>::new(), 0);
    for line in text.lines() {
        let Some(fields) = fields(line) else {
            skipped += usize::from(!line.trim().is_empty());
            continue;
        };
        let kind = fields[0].get(3..6).unwrap_or_default();
        let (place_at, is_valid) = match kind {
            "RMC" => (3, fields.get(2) == Some(&"A")),
            "GGA" => (
                2,
                fields
                    .get(6)
                    .is_some_and(|fix| *fix != "0" && !fix.is_empty()),
            ),
            _ => continue,
        };
        let read = || {
            Some((
                time_of_day(fields.get(1)?)?,
                place(fields.get(place_at..)?)?,
            ))
        };
        let Some((time_of_day, place)) = read().filter(|_| is_valid) else {
            skipped += 1;
            continue;
        };
        let is_same = |last: &&mut Instant| (last.time_of_day - time_of_day).abs() < 1e-3;
        if instants.last_mut().filter(is_same).is_none() {
            instants.push(Instant {
                time_of_day,
                ..Instant::default()
            });
        }
        let Some(own) = instants.last_mut() else {
            continue;
        };
        own.place = Some(place);
        let number = |at: usize| {
            fields
                .get(at)?
                .parse::<f64>()
                .ok()
                .filter(|n| n.is_finite())
        };
        if kind == "RMC" {
            own.speed = number(7).map(|knots| knots * KNOT);
            own.midnight = fields.get(9).and_then(|date| midnight(date));
        } else {
            own.height = number(9);
        }
    }
    points(&instants, skipped)
}

fn points(instants: &[Instant], mut skipped: usize) -> Result<Track> {
    let is_without_heights = instants.iter().all(|instant| instant.height.is_none());
    if !instants.is_empty() && is_without_heights {
        return Err(
            Problem::bad_input("this NMEA file has positions without heights")
                .help("let the logger write GGA sentences beside RMC, or export the track as GPX"),
        );
    }
    let has_date = instants.iter().any(|instant| instant.midnight.is_some());
    let mut midnight = instants
        .iter()
        .find_map(|instant| instant.midnight)
        .unwrap_or(0.0);
    let mut last = f64::NEG_INFINITY;
    let mut points = Vec::with_capacity(instants.len());
    for instant in instants {
        match instant.midnight {
            Some(own) => midnight = own,
            None if instant.time_of_day < last - 43_200.0 => midnight += 86_400.0,
            None => {}
        }
        last = instant.time_of_day;
        match (instant.place, instant.height) {
            (Some(place), Some(height)) => points.push(Point {
                time: midnight + instant.time_of_day,
                place,
                height,
                speed: instant.speed,
            }),
            _ => skipped += 1,
        }
    }
    track("NMEA", points, skipped, has_date)
}

/// The fields of a sentence; `None` if its checksum is wrong.
fn fields(line: &str) -> Option<Vec<&str>> {
    let body = line.trim().strip_prefix('$')?;
    let body = match body.split_once('*') {
        Some((body, sum)) => {
            let expected = u8::from_str_radix(sum.trim(), 16).ok()?;
            let found = body.bytes().fold(0, |sum, byte| sum ^ byte);
            (found == expected).then_some(body)?
        }
        None => body,
    };
    // The talker is kept with a letter before it, so that kinds are at the same place as in the line.
    let start = line.find('$')?;
    let whole = line.get(start..start + 1 + body.len())?;
    Some(whole.split(',').collect())
}

/// Seconds of `hhmmss.ss`.
fn time_of_day(text: &str) -> Option<f64> {
    let number = |from: usize, to: usize| text.get(from..to)?.parse::<f64>().ok();
    let seconds: f64 = text.get(4..)?.parse().ok()?;
    let time = 3600.0 * number(0, 2)? + 60.0 * number(2, 4)? + seconds;
    (0.0..86_401.0).contains(&time).then_some(time)
}

/// Midnight of `ddmmyy` (s since 1970).
fn midnight(text: &str) -> Option<f64> {
    let part = |from: usize| text.get(from..from + 2)?.parse::<u32>().ok();
    seconds_of(
        2000 + i32::try_from(part(4)?).ok()?,
        part(2)?,
        part(0)?,
        0.0,
    )
}

/// Latitude and longitude (degrees) of `ddmm.mm,N,dddmm.mm,E`.
fn place(fields: &[&str]) -> Option<[f64; 2]> {
    let [latitude, north, longitude, east, ..] = fields else {
        return None;
    };
    let degrees = |text: &str, digits: usize, most: f64| {
        let whole: f64 = text.get(..digits)?.parse().ok()?;
        let minutes: f64 = text.get(digits..)?.parse().ok()?;
        let value = whole + minutes / 60.0;
        (0.0..=most).contains(&value).then_some(value)
    };
    let sign = |name: &str| {
        if name == "S" || name == "W" {
            -1.0
        } else {
            1.0
        }
    };
    Some([
        sign(north) * degrees(latitude, 2, 90.0)?,
        sign(east) * degrees(longitude, 3, 180.0)?,
    ])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sentences_of_one_instant_are_one_point() {
        let text = b"$GPGGA,063645.000,5316.5411,N,00150.4023,W,1,08,1.0,3000.0,M,50.0,M,,\n\
                     $GPRMC,063645.000,A,5316.5411,N,00150.4023,W,28.72,256.14,080416,,,A*4F\n\
                     $GPRMC,063645.000,A,5316.5411,N,00150.4023,W,28.72,256.14,080416,,,A*00\n\
                     $GPGGA,063646.000,5316.5411,N,00150.4023,W,1,08,1.0,2995.0,M,50.0,M,,\n";
        assert!(is_nmea(text));
        let track = read(text).unwrap();
        assert_eq!((track.samples.len(), track.skipped), (2, 1));
        assert_eq!(track.start, seconds_of(2016, 4, 8, 23_805.0));
        assert!((track.samples[1].height() - 2995.0).abs() < 1e-9);
    }

    #[test]
    fn a_file_without_heights_is_refused_with_the_way_out() {
        let text = b"$GPRMC,063645.000,A,5316.5411,N,00150.4023,W,28.72,256.14,080416,,,A*4F\n";
        let problem = read(text).unwrap_err().to_string();
        assert!(problem.contains("without heights"), "{problem}");
    }
}
