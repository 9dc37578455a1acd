//! Plain CSV: a header line with `time_s`; `north_m`, `east_m`, `height_m`, or `latitude_deg`, `longitude_deg`,
//! `height_m`, or `height_m` alone; and, if measured, `north_mps`, `east_mps`, `up_mps`. Other columns are ignored.

use bodyflight_falls::Sample;
use bodyflight_falls::channels::Given;
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::text::number;
use nalgebra::Vector3;

use crate::points::{Flat, in_order};
use crate::track::Track;

/// Most columns of an unknown header that are shown.
const MOST_SHOWN: usize = 12;

/// Names of the columns of plain CSV.
const PLACE: [&str; 3] = ["north_m", "east_m", "height_m"];
const GEOGRAPHIC: [&str; 3] = ["latitude_deg", "longitude_deg", "height_m"];
const VELOCITY: [&str; 3] = ["north_mps", "east_mps", "up_mps"];
const HEIGHT: &str = "height_m";

/// Indices of the columns of plain CSV.
struct Columns {
    time: usize,
    height: usize,
    places: Option<[usize; 2]>,
    /// Whether `places` are latitude and longitude.
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
        let flat = three(PLACE);
        let Some((time, height)) = column("time_s").zip(column(HEIGHT)) else {
            return Err(Problem::bad_input(format!(
                "expected the columns time_s and {} or {}, found: {}",
                PLACE.join(", "),
                GEOGRAPHIC.join(", "),
                header.iter().take(MOST_SHOWN).collect::<Vec<_>>().join(", ")
            ))
            .at_line(1)
            .help(
                "tracks are read as FlySight, GPX, KML, IGC, NMEA, FIT, UBX and TES, and as CSV with these columns; see \
                 docs/falls.md",
            ));
        };
        Ok(Self {
            time,
            height,
            places: flat.or_else(|| three(GEOGRAPHIC)).map(|[a, b, _]| [a, b]),
            is_geographic: flat.is_none(),
            velocities: three(VELOCITY),
        })
    }
}

pub(crate) fn read(text: &[u8]) -> Result<Track> {
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .flexible(true)
        .from_reader(text);
    let header = reader.byte_headers();
    let header = header.map_err(|error| Problem::bad_input(format!("bad header line: {error}")))?;
    let names = header
        .iter()
        .map(|name| String::from_utf8_lossy(name).into_owned());
    let columns = Columns::of(&names.collect())?;
    let mut flat = Flat::default();
    let (mut samples, mut skipped) = (Vec::<Sample>::new(), 0);
    let mut record = csv::ByteRecord::new();
    loop {
        let read = reader.read_byte_record(&mut record).map_err(|error| {
            let line = error.position().map_or(0, csv::Position::line);
            Problem::bad_input(format!("cannot read this row: {error}")).at_line(line)
        })?;
        if !read {
            break;
        }
        match columns.sample(&record, &mut flat) {
            Some(sample) => samples.push(sample),
            None => skipped += 1,
        }
    }
    let (mut samples, out_of_order, notes) = in_order(samples, |sample| &mut sample.time);
    let first = samples.first().map_or(0.0, |sample| sample.time);
    // Large times, such as seconds since 1970, would lose their digits.
    if first.abs() > 1e6 {
        for sample in &mut samples {
            sample.time -= first;
        }
    }
    Ok(Track {
        format: "CSV",
        samples,
        start: None,
        given: Given {
            places: columns.places.is_some(),
            velocities: columns.velocities.is_some(),
            speeds: false,
        },
        speed_accuracy: Vec::new(),
        position_accuracy: Vec::new(),
        inertial: Vec::new(),
        pressure: Vec::new(),
        skipped: skipped + out_of_order,
        notes,
    })
}

/// Largest position and height (m) and largest speed (m/s) of a track.
const FARTHEST: f64 = 1e7;
const HIGHEST: f64 = 200_000.0;
const FASTEST: f64 = 10_000.0;

impl Columns {
    fn sample(&self, record: &csv::ByteRecord, flat: &mut Flat) -> Option<Sample> {
        let within = |column: usize, most: f64| {
            let text = core::str::from_utf8(record.get(column)?).ok()?;
            let number = number(text)?;
            (number.abs() <= most).then_some(number)
        };
        let height = within(self.height, HIGHEST)?;
        let place = match self.places {
            Some([a, b]) => [within(a, FARTHEST)?, within(b, FARTHEST)?],
            None => [0.0; 2],
        };
        let velocity = match self.velocities {
            Some([north, east, up]) => Vector3::new(
                within(north, FASTEST)?,
                -within(east, FASTEST)?,
                within(up, FASTEST)?,
            ),
            None => Vector3::zeros(),
        };
        Some(Sample {
            time: within(self.time, 1e12)?,
            position: if self.is_geographic && self.places.is_some() {
                flat.position(place, height)
            } else {
                Vector3::new(place[0], -place[1], height)
            },
            velocity,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn velocities_and_places_are_read_as_far_as_they_are_there() {
        let mut text = "time_s,north_m,east_m,height_m\n".to_owned();
        let mut full =
            "time_s, x, north_m, east_m, height_m, north_mps, east_mps, up_mps\n".to_owned();
        let mut heights = "time_s,height_m\n".to_owned();
        for step in 0..50 {
            let time = f64::from(step) * 0.2;
            let [north, east, height] = [10.0 * time, -4.0 * time, 3000.0 - 50.0 * time];
            text += &format!("{time},{north},{east},{height}\n");
            full += &format!("{time},?,{north},{east},{height},10,-4,-50\n");
            heights += &format!("{time},{height}\n");
        }
        full += "oops,1,2\n";
        let track = read(text.as_bytes()).unwrap();
        assert!(!track.given.velocities && track.skipped == 0);
        let track = read(full.as_bytes()).unwrap();
        assert!(track.given.velocities && track.given.places && track.skipped == 1);
        assert_eq!(track.samples[7].velocity, Vector3::new(10.0, 4.0, -50.0));
        assert_eq!(track.samples[5].position, Vector3::new(10.0, 4.0, 2950.0));
        let track = read(heights.as_bytes()).unwrap();
        assert!(!track.given.velocities && !track.given.places);
        assert_eq!(track.samples.len(), 50);
    }

    #[test]
    fn other_columns_are_refused_with_the_expected_names() {
        let problem = read(b"a,b,c\n1,2,3\n").unwrap_err().to_string();
        assert!(
            problem.contains("time_s") && problem.contains("found: a, b, c"),
            "{problem}"
        );
    }
}
