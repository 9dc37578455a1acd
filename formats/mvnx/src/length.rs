//! The times of a recording, from its first and last frames without reading the rest; used for progress only.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

/// Bytes read at each end of the file: a frame with all fields takes 10 kB.
const LOOKED_AT: usize = 1 << 18;

/// Times of the first and the last frame (s since frame 0); `None` for standard input, compressed files, and files without
/// a frame near the end.
pub fn span(recording: &Path) -> Option<[f64; 2]> {
    let mut file = File::open(recording).ok()?;
    if !file.metadata().ok()?.is_file() {
        return None;
    }
    let size = file.seek(SeekFrom::End(0)).ok()?;
    let looked_at = u64::try_from(LOOKED_AT).ok()?.min(size);
    let mut at = |place: u64| {
        let mut bytes = Vec::with_capacity(LOOKED_AT);
        file.seek(SeekFrom::Start(place)).ok()?;
        let mut part = (&file).take(looked_at);
        part.read_to_end(&mut bytes).ok()?;
        Some(String::from_utf8_lossy(&bytes).into_owned())
    };
    of_ends(&at(0)?, &at(size - looked_at)?)
}

fn of_ends(head: &str, tail: &str) -> Option<[f64; 2]> {
    let rate = number_of(head, "frameRate")?;
    let (_, last) = tail.rsplit_once("<frame ")?;
    let last = number_of(last, "index")?;
    let first = head
        .split("<frame ")
        .skip(1)
        .find(|frame| attribute(frame, "type") == Some("normal"))
        .and_then(|frame| number_of(frame, "index"));
    let span = [first.unwrap_or(0.0) / rate, last / rate];
    let is_some = span[0].is_finite() && span[1].is_finite() && span[1] > span[0];
    is_some.then_some(span)
}

/// A number from the first tag that has the attribute.
fn number_of(text: &str, name: &str) -> Option<f64> {
    attribute(text, name)?.trim().parse().ok()
}

fn attribute<'a>(text: &'a str, name: &str) -> Option<&'a str> {
    let (_, rest) = text.split_once(&format!("{name}=\""))?;
    rest.split_once('"').map(|(value, _)| value)
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEAD: &str = "<subject frameRate=\"240\"><frames><frame time=\"0\" index=\"\" type=\"npose\"/>\
                        <frame time=\"0\" index=\"24\" type=\"normal\"><position>0</position></frame>";

    #[test]
    fn both_ends_of_a_file_give_its_duration() {
        let tail =
            "1 2 3</position></frame><frame time=\"9\" index=\"744\" type=\"normal\"><position>";
        let [first, last] = of_ends(HEAD, tail).unwrap();
        assert!((first - 0.1).abs() < 1e-12, "{first}");
        assert!((last - 3.1).abs() < 1e-12, "{last}");
    }

    #[test]
    fn an_unknown_length_is_none() {
        assert_eq!(of_ends(HEAD, "no frame"), None);
        assert_eq!(of_ends("", "<frame index=\"7\">"), None);
        assert_eq!(of_ends(HEAD, "<frame index=\"3\">"), None);
        assert_eq!(span(Path::new("nowhere.mvnx")), None);
        assert_eq!(span(Path::new("/dev/null")), None);
    }
}
