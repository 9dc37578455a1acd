//! Tracks of a point in the formats that loggers write: FlySight, GPX and plain CSV.
//!
//! Plain CSV has a header line: `time_s`; either `north_m`, `east_m`, `height_m` or `latitude_deg`, `longitude_deg`,
//! `height_m`; and, if measured, `north_mps`, `east_mps`, `up_mps`. If a track has no velocities, they are derived from
//! its positions.

use std::path::Path;

use bodyflight_falls::Sample;
use nalgebra::{Matrix3, Vector3};

use crate::diagnostic::{Problem, Result};
use crate::formats::flysight::{self, InertialSample, PressureSample};
use crate::formats::input;

/// Metres per degree of latitude, for the mean radius of the Earth.
const METRES_PER_DEGREE: f64 = 6_371_008.8 * core::f64::consts::PI / 180.0;

/// A track, with the data of the logger's other sensors.
#[derive(Debug, Clone, PartialEq)]
pub struct Track {
    /// In order of time.
    pub samples: Vec<Sample>,
    /// Time of the first sample since 1970 (s, UTC); `None` if the file has no date.
    pub start: Option<f64>,
    /// Whether the velocities were measured rather than derived from the positions.
    pub has_velocities: bool,
    /// Samples of the inertial sensor, each with its time (s) on the clock of `samples`.
    pub inertial: Vec<(f64, InertialSample)>,
    /// Samples of the barometer: time (s) on the clock of `samples`, and pressure (Pa).
    pub pressure: Vec<(f64, f64)>,
    /// Number of rows skipped: unusable, or not later than the row before.
    pub skipped: usize,
}

/// Reads a track. Its format is recognised by the first bytes and the names of the columns.
///
/// # Errors
/// Returns an error if the file cannot be read, has no known format, or has fewer than two usable rows.
pub fn read(path: &Path) -> Result<Track> {
    parse(&input::bytes(path)?, path)
}

/// Like [`read`], for bytes already read from `path`.
///
/// # Errors
/// Same as [`read`].
pub fn parse(bytes: &[u8], path: &Path) -> Result<Track> {
    let start = bytes.iter().position(|byte| !byte.is_ascii_whitespace());
    let text = start.map_or(&[][..], |start| &bytes[start..]);
    let text = text.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(text);
    let track = if text.starts_with(b"<") {
        read_gpx(text, path)?
    } else if text.starts_with(b"$FLYS") || text.starts_with(b"time,") {
        flysight_track(path, bytes)?
    } else {
        read_csv(text, path)?
    };
    if track.samples.len() < 2 {
        return Err(Problem::bad_input(format!(
            "expected a track of at least two rows, found {}",
            track.samples.len()
        ))
        .in_file(path));
    }
    Ok(track)
}

fn flysight_track(path: &Path, bytes: &[u8]) -> Result<Track> {
    let track = flysight::Track::parse(bytes, path)?;
    let first = track.fixes.first().copied();
    let samples = track.fixes.iter().map(|fix| Sample {
        time: fix.time - first.map_or(0.0, |first| first.time),
        position: fix.position.components,
        velocity: fix.velocity.components,
    });
    let week = first.map_or(0.0, |first| first.time_of_week());
    Ok(Track {
        samples: samples.collect(),
        start: first.map(|first| first.time),
        has_velocities: true,
        inertial: track
            .inertial
            .iter()
            .map(|sample| (sample.time_of_week - week, *sample))
            .collect(),
        pressure: track
            .pressure
            .iter()
            .map(
                |PressureSample {
                     time_of_week,
                     pressure,
                 }| (time_of_week - week, *pressure),
            )
            .collect(),
        skipped: track.skipped.count,
    })
}

/// Converts latitudes and longitudes (degrees) to positions north and west of the first one (m).
struct Flat {
    origin: Option<[f64; 2]>,
}

impl Flat {
    fn position(&mut self, latitude: f64, longitude: f64, height: f64) -> Vector3<f64> {
        let [first_latitude, first_longitude] = *self.origin.get_or_insert([latitude, longitude]);
        // Also correct across the date line.
        let east = (longitude - first_longitude + 540.0).rem_euclid(360.0) - 180.0;
        let narrower = first_latitude.to_radians().cos();
        Vector3::new(
            (latitude - first_latitude) * METRES_PER_DEGREE,
            -east * METRES_PER_DEGREE * narrower,
            height,
        )
    }
}

/// Number of bytes at the start of an XML file that are searched for its root element.
const HEAD: usize = 1024;

fn read_gpx(text: &[u8], path: &Path) -> Result<Track> {
    let refused = |what: String| Problem::bad_input(what).in_file(path);
    if text.windows(5).take(HEAD).any(|part| part == b"<mvnx") {
        return Err(refused("this is an MVNX recording, not a track".into())
            .help("compare it with the model: bodyflight simulate FILE"));
    }
    let gpx = gpx::read(text).map_err(|error| {
        refused(format!("cannot read this as GPX: {error}"))
            .help("give the GPX file as written by the logger or its software")
    })?;
    let points = gpx
        .tracks
        .iter()
        .flat_map(|track| &track.segments)
        .flat_map(|part| &part.points);
    let mut flat = Flat { origin: None };
    let (mut samples, mut start, mut skipped) = (Vec::<Sample>::new(), None, 0);
    for point in points {
        let time = point
            .time
            .and_then(|time| time.format().ok())
            .and_then(|text| chrono::DateTime::parse_from_rfc3339(&text).ok());
        let (Some(time), Some(height)) = (time, point.elevation) else {
            skipped += 1;
            continue;
        };
        #[expect(
            clippy::cast_precision_loss,
            reason = "exact for dates before the year 2255"
        )]
        let seconds = time.timestamp_micros() as f64 * 1e-6;
        let time = seconds - *start.get_or_insert(seconds);
        if samples.last().is_some_and(|last| time <= last.time) {
            skipped += 1;
            continue;
        }
        samples.push(Sample {
            time,
            position: flat.position(point.point().y(), point.point().x(), height),
            velocity: Vector3::zeros(),
        });
    }
    if samples.is_empty() {
        return Err(
            refused("expected track points with <time> and <ele>, found none".into())
                .help("routes and waypoints have no times; export the track"),
        );
    }
    with_velocities(&mut samples);
    Ok(Track {
        samples,
        start,
        has_velocities: false,
        inertial: Vec::new(),
        pressure: Vec::new(),
        skipped,
    })
}

/// Names of the columns of plain CSV.
const PLACE: [&str; 3] = ["north_m", "east_m", "height_m"];
const GEOGRAPHIC: [&str; 3] = ["latitude_deg", "longitude_deg", "height_m"];
const VELOCITY: [&str; 3] = ["north_mps", "east_mps", "up_mps"];

/// Indices of the columns of plain CSV.
struct Columns {
    time: usize,
    places: [usize; 3],
    /// Whether `places` are latitude, longitude and height.
    is_geographic: bool,
    velocities: Option<[usize; 3]>,
}

impl Columns {
    fn of(header: &csv::StringRecord) -> Result<Self> {
        let column = |name: &str| header.iter().position(|column| column == name);
        let three = |names: [&str; 3]| {
            let [a, b, c] = names.map(column);
            Some([a?, b?, c?])
        };
        let place = three(PLACE);
        let Some((time, places)) = column("time_s").zip(place.or_else(|| three(GEOGRAPHIC))) else {
            return Err(Problem::bad_input(format!(
                "expected the columns time_s and {} or {}, found: {}",
                PLACE.join(", "),
                GEOGRAPHIC.join(", "),
                header.iter().collect::<Vec<_>>().join(", ")
            ))
            .at_line(1)
            .help("a track is a FlySight CSV file, a GPX file, or a CSV file with these columns; see docs/falls.md"));
        };
        Ok(Self {
            time,
            places,
            is_geographic: place.is_none(),
            velocities: three(VELOCITY),
        })
    }
}

fn read_csv(text: &[u8], path: &Path) -> Result<Track> {
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .flexible(true)
        .from_reader(text);
    let header = reader
        .headers()
        .map_err(|error| Problem::bad_input(format!("bad header line: {error}")).in_file(path))?
        .clone();
    let Columns {
        time,
        places,
        is_geographic,
        velocities,
    } = Columns::of(&header).map_err(|problem| problem.in_file(path))?;
    let mut flat = Flat { origin: None };
    let (mut samples, mut skipped) = (Vec::<Sample>::new(), 0);
    for record in reader.records() {
        let record = record.map_err(|error| {
            let line = error.position().map_or(0, csv::Position::line);
            Problem::bad_input(format!("cannot read this row: {error}"))
                .in_file(path)
                .at_line(line)
        })?;
        let number = |column: usize| {
            let number: f64 = record.get(column)?.parse().ok()?;
            number.is_finite().then_some(number)
        };
        let vector = |columns: [usize; 3]| {
            let [a, b, c] = columns.map(number);
            Some(Vector3::new(a?, b?, c?))
        };
        let velocity = velocities.map_or(Some(Vector3::zeros()), vector);
        let (Some(time), Some(at), Some(velocity)) = (number(time), vector(places), velocity)
        else {
            skipped += 1;
            continue;
        };
        if samples.last().is_some_and(|last| time <= last.time) {
            skipped += 1;
            continue;
        }
        samples.push(Sample {
            time,
            position: if is_geographic {
                flat.position(at.x, at.y, at.z)
            } else {
                Vector3::new(at.x, -at.y, at.z)
            },
            velocity: Vector3::new(velocity.x, -velocity.y, velocity.z),
        });
    }
    if velocities.is_none() {
        with_velocities(&mut samples);
    }
    Ok(Track {
        samples,
        start: None,
        has_velocities: velocities.is_some(),
        inertial: Vec::new(),
        pressure: Vec::new(),
        skipped,
    })
}

/// Time before and after a sample over which its velocity is derived from positions (s).
const REACH: f64 = 1.0;

/// Sets each velocity to the slope of a parabola fitted to the surrounding positions.
fn with_velocities(samples: &mut [Sample]) {
    let velocities: Vec<Vector3<f64>> = (0..samples.len())
        .map(|index| {
            let time = samples[index].time;
            let first = samples.partition_point(|sample| sample.time < time - REACH);
            let end = samples.partition_point(|sample| sample.time <= time + REACH);
            let last = samples.len();
            parabola(
                &samples[first.min(index.saturating_sub(1))..end.max(index + 2).min(last)],
                time,
            )
        })
        .collect();
    for (sample, velocity) in samples.iter_mut().zip(velocities) {
        sample.velocity = velocity;
    }
}

/// Slope at `time` (s) of the parabola that fits the positions best (least squares); if they do not determine one, of
/// the line from the first to the last.
fn parabola(part: &[Sample], time: f64) -> Vector3<f64> {
    let mut normal = Matrix3::zeros();
    let mut right = Matrix3::zeros();
    for sample in part {
        let since = sample.time - time;
        let row = Vector3::new(1.0, since, since * since);
        normal += row * row.transpose();
        right += row * sample.position.transpose();
    }
    if part.len() > 2
        && let Some(inverse) = normal.try_inverse()
    {
        return (inverse * right).row(1).transpose();
    }
    match part {
        [first, .., last] => (last.position - first.position) / (last.time - first.time),
        _ => Vector3::zeros(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn falling(time: f64) -> [f64; 3] {
        [10.0 * time, -4.0 * time, 3000.0 - 50.0 * time]
    }

    fn written(name: &str, text: &str) -> Result<Track> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        read(&path)
    }

    fn moves(track: &Track) {
        for sample in &track.samples {
            let off = sample.velocity - Vector3::new(10.0, 4.0, -50.0);
            assert!(off.norm() < 0.3, "{sample:?}");
        }
    }

    #[test]
    fn plain_csv_has_its_own_velocities_or_those_of_its_positions() {
        let mut text = "time_s,north_m,east_m,height_m\n".to_owned();
        let mut full =
            "time_s, north_m, east_m, height_m, north_mps, east_mps, up_mps\n".to_owned();
        for step in 0..50 {
            let time = f64::from(step) * 0.2;
            let [north, east, height] = falling(time);
            text += &format!("{time},{north},{east},{height}\n");
            full += &format!("{time},{north},{east},{height},10,-4,-50\n");
        }
        full += "oops,1,2\n";
        let track = written("track.csv", &text).unwrap();
        assert!(!track.has_velocities && track.skipped == 0);
        moves(&track);
        let track = written("track.csv", &full).unwrap();
        assert!(track.has_velocities && track.skipped == 1);
        moves(&track);
    }

    #[test]
    fn gpx_of_a_logger_is_read() {
        let mut text = "<?xml version=\"1.0\"?>\n<gpx version=\"1.1\" creator=\"logger\" \
                        xmlns=\"http://www.topografix.com/GPX/1/1\"><trk><trkseg>"
            .to_owned();
        for second in 0..30 {
            let [north, east, height] = falling(f64::from(second));
            let latitude = 46.0 + north / METRES_PER_DEGREE;
            let longitude = 8.0 + east / METRES_PER_DEGREE / 46.0_f64.to_radians().cos();
            text += &format!(
                "<trkpt lat=\"{latitude:.8}\" lon=\"{longitude:.8}\"><ele>{height}</ele>\
                 <time>2023-07-29T13:46:{second:02}.250Z</time></trkpt>"
            );
        }
        let track = written("track.gpx", &(text + "</trkseg></trk></gpx>")).unwrap();
        assert_eq!(track.samples.len(), 30);
        moves(&track);
    }

    #[test]
    fn other_files_are_refused_with_the_expected_names() {
        let problem = written("track.csv", "a,b,c\n1,2,3\n")
            .unwrap_err()
            .to_string();
        assert!(
            problem.contains("time_s") && problem.contains("found: a, b, c"),
            "{problem}"
        );
        let problem = written("track.gpx", "<gpx></html>")
            .unwrap_err()
            .to_string();
        assert!(problem.contains("GPX"), "{problem}");
        let problem =
            written("track.csv", "time_s,north_m,east_m,height_m\n1,2,3,4\n").unwrap_err();
        assert!(
            problem.to_string().contains("at least two rows"),
            "{problem}"
        );
    }
}
