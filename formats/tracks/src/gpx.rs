//! GPX: track points with time and height, and their speed if it is there, in the point or in its extensions.

use bodyflight_io::diagnostic::Result;

use crate::points::{Point, seconds_of_text, track, within};
use crate::track::Track;
use crate::xml::{Part, attribute, parts};

/// A point of which not all is read yet.
#[derive(Default)]
struct Unfinished {
    place: Option<[f64; 2]>,
    time: Option<f64>,
    height: Option<f64>,
    speed: Option<f64>,
}

pub(crate) fn read(text: &[u8]) -> Result<Track> {
    let (mut points, mut skipped) = (Vec::new(), 0);
    let mut inside: Option<Unfinished> = None;
    let mut name = String::new();
    let ended = parts("GPX", text, |part| match part {
        Part::Begin("trkpt", element) => {
            let degrees = |name, most| within(&attribute(element, name)?, most);
            let place = degrees("lat", 90.0).zip(degrees("lon", 180.0));
            inside = Some(Unfinished {
                place: place.map(|(latitude, longitude)| [latitude, longitude]),
                ..Unfinished::default()
            });
        }
        Part::Begin(begun, _) => begun.clone_into(&mut name),
        Part::Text(text) => {
            if let Some(point) = &mut inside {
                match name.as_str() {
                    "time" => point.time = seconds_of_text(text),
                    "ele" => point.height = within(text, 50_000.0),
                    "speed" => point.speed = within(text, 1000.0),
                    _ => {}
                }
            }
        }
        Part::End("trkpt") => {
            let point = inside.take().and_then(|point| {
                Some(Point {
                    time: point.time?,
                    place: point.place?,
                    height: point.height?,
                    speed: point.speed,
                })
            });
            match point {
                Some(point) => points.push(point),
                None => skipped += 1,
            }
        }
        Part::End(_) => name.clear(),
    });
    // A file that was cut off still has its beginning.
    if points.is_empty() {
        ended?;
    }
    track("GPX", points, skipped, true)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_of_all_segments_and_their_speed_are_read() {
        let point = |second: u32, more: &str| {
            format!(
                "<trkpt lat=\"46.{second:03}\" lon=\"8.0\"><ele>{}</ele><time>2024-06-01T10:00:{second:02}Z</time>{more}</trkpt>",
                3000 - 50 * second
            )
        };
        let speed = "<extensions><x:TrackPointExtension><x:speed>111.2</x:speed></x:TrackPointExtension></extensions>";
        let text = format!(
            "<?xml version=\"1.0\"?><gpx><trk><trkseg>{}{}</trkseg><trkseg>{}<trkpt lat=\"1\" lon=\"2\"/></trkseg></trk></gpx>",
            point(0, speed),
            point(1, speed),
            point(2, "<speed>111.2</speed>")
        );
        let track = read(text.as_bytes()).unwrap();
        assert_eq!((track.samples.len(), track.skipped), (3, 1));
        assert!(track.given.speeds, "{:?}", track.notes);
        assert!((track.samples[1].velocity.x - 111.2).abs() < 0.5);
        assert!((track.samples[1].velocity.z + 50.0).abs() < 0.5);
        let start = track.start.unwrap();
        assert!((start - 1_717_236_000.0).abs() < 1e-6);
    }
}
