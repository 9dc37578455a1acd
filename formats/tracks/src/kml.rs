//! KML: a track of times and coordinates. Lines without times cannot be analysed.

use bodyflight_io::diagnostic::{Problem, Result};

use crate::points::{Point, seconds_of_text, track, within};
use crate::track::Track;
use crate::xml::{Part, parts};

pub(crate) fn read(text: &[u8]) -> Result<Track> {
    let (mut times, mut places) = (Vec::new(), Vec::new());
    let mut has_line = false;
    let mut name = String::new();
    let ended = parts("KML", text, |part| match part {
        Part::Begin(begun, _) => {
            has_line |= begun == "LineString";
            begun.clone_into(&mut name);
        }
        Part::Text(text) => match name.as_str() {
            "when" => times.push(seconds_of_text(text)),
            "coord" => {
                let numbers = text
                    .split_ascii_whitespace()
                    .map(|part| within(part, 50_000.0));
                places.push(numbers.collect::<Option<Vec<f64>>>());
            }
            _ => {}
        },
        Part::End(_) => name.clear(),
    });
    let all = times.len().max(places.len());
    let points: Vec<Point> = times
        .into_iter()
        .zip(places)
        .filter_map(|(time, place)| match place?[..] {
            [longitude, latitude, height] => Some(Point {
                time: time?,
                place: [latitude, longitude],
                height,
                speed: None,
            }),
            _ => None,
        })
        .collect();
    if points.is_empty() {
        ended?;
        if has_line {
            return Err(Problem::bad_input(
                "this KML file has a line without times, which is no track",
            )
            .help("export the track as GPX, or as KML with <gx:Track>"));
        }
    }
    let skipped = all - points.len();
    track("KML", points, skipped, true)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_and_coordinates_are_joined() {
        let text = b"<kml xmlns:gx=\"x\"><Placemark><gx:Track><when>2015-08-26T11:53:36Z</when>\
                     <gx:coord>37.5 54.8 4000</gx:coord><when>2015-08-26T11:53:37Z</when>\
                     <gx:coord>37.5 54.8 3990</gx:coord></gx:Track></Placemark></kml>";
        let track = read(text).unwrap();
        assert_eq!(track.samples.len(), 2);
        assert!((track.samples[1].height() - 3990.0).abs() < 1e-9);
        let line = b"<kml><LineString><coordinates>1,2,3 4,5,6</coordinates></LineString></kml>";
        let problem = read(line).unwrap_err().to_string();
        assert!(problem.contains("without times"), "{problem}");
    }
}
