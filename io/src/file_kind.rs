//! What a file is, by its content, for the message about a file that is given where another kind belongs.

use crate::diagnostic::Problem;

/// A kind of file that users have at hand.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FileKind {
    /// MVNX.
    Recording,
    /// `flight.toml`.
    Flight,
    /// `subject.toml`.
    Subject,
    /// `model.toml`.
    Model,
    /// `preset.toml`.
    Preset,
    /// `mapping.toml`.
    Mapping,
    /// Inputs over time, as CSV.
    Inputs,
    /// A logger's track.
    Track,
    /// BVH.
    Bvh,
    /// C3D.
    C3d,
    /// A motion of another system, of any format.
    Motion,
    /// The result of `discover --json`, and JSON in general.
    Json,
    /// PNG, JPEG, GIF, TIFF, WebP or SVG.
    Picture,
    /// PDF.
    Pdf,
    /// HTML.
    WebPage,
    /// No bytes, or blanks only.
    Empty,
    /// Text of no known kind.
    Text,
}

/// How a kind is called in messages, and what to do with a file of it.
struct Row {
    kind: FileKind,
    /// With an article.
    name: &'static str,
    /// Without it.
    plain: &'static str,
    /// Where such a file is used: help for those who gave it elsewhere. Empty if no verb reads it.
    used: &'static str,
    /// How to get such a file: help for those who lack one.
    got: &'static str,
}

const ROWS: [Row; 17] = [
    Row {
        kind: FileKind::Recording,
        name: "an MVNX recording",
        plain: "MVNX",
        used: "compare it with the model: bodyflight simulate FILE; or name it as recording in a flight.toml",
        got: "give a recording exported from MVN as .mvnx",
    },
    Row {
        kind: FileKind::Flight,
        name: "a flight.toml",
        plain: "a flight.toml",
        used: "it names recording and subject; verbs on flights read it, as in bodyflight simulate FILE",
        got: "give a flight.toml, its folder, or the recording itself",
    },
    Row {
        kind: FileKind::Subject,
        name: "a subject",
        plain: "a subject.toml",
        used: "this is a subject; a flight.toml names it: subject = \"subject.toml\"; bodyflight trim FILE shows its fall",
        got: "docs/subject.md lists its fields; bodyflight synth and import write one",
    },
    Row {
        kind: FileKind::Model,
        name: "a model.toml",
        plain: "a model.toml",
        used: "it extends the model of a flight: bodyflight simulate FLIGHT --model FILE",
        got: "it has lines such as [[effect]] and name = \"wind\"; docs/effects.md lists all effects",
    },
    Row {
        kind: FileKind::Preset,
        name: "a preset.toml",
        plain: "a preset.toml",
        used: "it tunes the filter: bodyflight estimate FLIGHT --preset FILE",
        got: "it has lines such as base = \"auto\"; docs/estimator.md lists all fields",
    },
    Row {
        kind: FileKind::Mapping,
        name: "a mapping",
        plain: "a mapping.toml",
        used: "it explains a file of another system: bodyflight import FILE --mapping MAPPING.toml --out FOLDER",
        got: "docs/import.md describes mappings",
    },
    Row {
        kind: FileKind::Inputs,
        name: "a table of inputs",
        plain: "a table of inputs",
        used: "a flight.toml names it: inputs = \"inputs.csv\"",
        got: "bodyflight estimate FLIGHT --out inputs.csv writes one",
    },
    Row {
        kind: FileKind::Track,
        name: "the track of a logger",
        plain: "a track",
        used: "see what it says about the jump: bodyflight fall FILE; or name it as gnss in a flight.toml",
        got: "give the recording of a whole jump, as the logger wrote it; docs/falls.md lists the formats",
    },
    Row {
        kind: FileKind::Bvh,
        name: "a BVH file",
        plain: "BVH",
        used: "convert it to a recording: bodyflight import FILE --out FOLDER",
        got: "export BVH from the program that recorded the motion",
    },
    Row {
        kind: FileKind::C3d,
        name: "a C3D file",
        plain: "C3D",
        used: "convert its points to a recording: bodyflight import FILE --mapping MAPPING.toml --out FOLDER",
        got: "export C3D from the program that recorded the motion",
    },
    Row {
        kind: FileKind::Motion,
        name: "a motion",
        plain: "a motion of another system",
        used: "",
        got: "docs/import.md lists what bodyflight import reads",
    },
    Row {
        kind: FileKind::Json,
        name: "a JSON file",
        plain: "JSON",
        used: "",
        got: "bodyflight discover FLIGHT --json > discovery.json writes one",
    },
    Row {
        kind: FileKind::Picture,
        name: "a picture",
        plain: "a picture",
        used: "",
        got: "",
    },
    Row {
        kind: FileKind::Pdf,
        name: "a PDF document",
        plain: "PDF",
        used: "",
        got: "",
    },
    Row {
        kind: FileKind::WebPage,
        name: "a web page",
        plain: "a web page",
        used: "",
        got: "",
    },
    Row {
        kind: FileKind::Empty,
        name: "an empty file",
        plain: "an empty file",
        used: "",
        got: "",
    },
    Row {
        kind: FileKind::Text,
        name: "text of no known kind",
        plain: "text",
        used: "",
        got: "",
    },
];

/// First bytes of pictures; those of text may follow blanks.
const PICTURES: [&[u8]; 6] = [
    b"\x89PNG",
    b"\xFF\xD8\xFF",
    b"GIF8",
    b"II*\0",
    b"MM\0*",
    b"<svg",
];

/// First bytes of tracks of loggers.
const TRACKS: [&[u8]; 5] = [b"$FLYS", b"time,lat,lon", b"$GP", b"$GN", b"\xB5\x62"];

/// Bytes at the beginning of a file that show its kind.
pub const HEAD: usize = 1 << 14;

/// Keys of settings that only one kind has, at the top of the file or as tables.
const KEYS: [(FileKind, &[&str]); 5] = [
    (
        FileKind::Flight,
        &["recording", "inputs", "gnss", "muscles", "air", "suit"],
    ),
    (
        FileKind::Subject,
        &[
            "height_m",
            "mass_kg",
            "sex",
            "gear",
            "coefficients",
            "girths",
        ],
    ),
    (FileKind::Model, &["effect"]),
    (
        FileKind::Preset,
        &[
            "base",
            "muscle",
            "noise",
            "solution_window",
            "prediction_window",
            "joint_error_deg",
        ],
    ),
    (
        FileKind::Mapping,
        &[
            "kind",
            "world",
            "body",
            "angles",
            "quaternions",
            "points",
            "segments",
        ],
    ),
];

impl FileKind {
    fn row(self) -> &'static Row {
        // Every kind has a row, as a test checks.
        ROWS.iter().find(|row| row.kind == self).unwrap_or(&ROWS[0])
    }

    /// The kind of a file that begins with these bytes, at most [`HEAD`] of them.
    pub fn of_head(head: &[u8]) -> Option<Self> {
        let head = head.get(..HEAD).unwrap_or(head);
        let text = head.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(head);
        let text = text.trim_ascii_start();
        let begins = |marks: &[&[u8]]| marks.iter().any(|mark| text.starts_with(mark));
        if text.is_empty() {
            return Some(Self::Empty);
        }
        if begins(&PICTURES) {
            return Some(Self::Picture);
        }
        // The first byte says where the parameters start; in text it would be a letter.
        if let [first, b'P', ..] = head
            && (2..9).contains(first)
        {
            return Some(Self::C3d);
        }
        if begins(&[b"%PDF"]) {
            return Some(Self::Pdf);
        }
        if begins(&[b"HIERARCHY"]) {
            return Some(Self::Bvh);
        }
        if begins(&TRACKS) {
            return Some(Self::Track);
        }
        Self::of_text(core::str::from_utf8(text).or_else(|error| {
            // The last character may have been cut.
            let valid = error.valid_up_to();
            let is_cut = error.error_len().is_none();
            core::str::from_utf8(if is_cut { &text[..valid] } else { b"" })
        }))
    }

    fn of_text(text: Result<&str, core::str::Utf8Error>) -> Option<Self> {
        let text = text.ok().filter(|text| !text.is_empty())?;
        if text.contains('\0') {
            return None;
        }
        if text.starts_with('<') {
            let has = |root: &str| text.contains(root);
            let kinds = [
                (Self::Recording, "<mvnx"),
                (Self::Track, "<gpx"),
                (Self::Track, "<kml"),
                (Self::WebPage, "<html"),
                (Self::WebPage, "<!DOCTYPE html"),
                (Self::Picture, "<svg"),
            ];
            return kinds.iter().find(|(_, root)| has(root)).map(|kind| kind.0);
        }
        if text.starts_with('{') {
            return Some(Self::Json);
        }
        let first = text.lines().next().unwrap_or_default();
        let columns: Vec<&str> = first.split([',', ';', '\t']).map(str::trim).collect();
        let has = |names: &[&str]| names.iter().all(|name| columns.contains(name));
        if has(&["time_s", "pitch", "damp_pitch"]) {
            return Some(Self::Inputs);
        }
        if has(&["time_s", "height_m"]) || has(&["time", "lat", "lon"]) {
            return Some(Self::Track);
        }
        let settings = Self::of_keys(text, None);
        let is_plain = !text.contains('=') && !text.starts_with('[');
        settings.or_else(|| (is_plain && columns.len() == 1).then_some(Self::Text))
    }

    /// The kind of settings with these keys. A key of `wanted` decides: a file with keys of two kinds is most likely
    /// the one that was asked for, with a wrong key.
    fn of_keys(text: &str, wanted: Option<Self>) -> Option<Self> {
        let (mut is_top, mut keys) = (true, Vec::new());
        for line in text.lines().map(str::trim) {
            if let Some(table) = line.strip_prefix('[') {
                is_top = false;
                let name = table.trim_start_matches('[').split([']', '.']).next();
                keys.extend(name.map(str::trim));
            } else if is_top && let Some((key, _)) = line.split_once('=') {
                keys.push(key.trim());
            }
        }
        let is = |(_, own): &&(Self, &[&str])| keys.iter().any(|key| own.contains(key));
        let mut kinds = KEYS.iter().filter(is).map(|(kind, _)| *kind);
        match wanted {
            Some(wanted) if kinds.clone().any(|kind| kind == wanted) => Some(wanted),
            _ => kinds.next(),
        }
    }

    /// The problem of a file of the kind `found` that is given for one of this kind, if it certainly is another.
    pub fn mistaken(self, found: Option<Self>) -> Option<Problem> {
        let found = found.filter(|found| *found != self)?.row();
        let wanted = self.row();
        if found.kind == Self::Empty {
            return Some(Problem::bad_input("this file is empty").help(wanted.got));
        }
        let message = format!("this is {}, not {}", found.name, wanted.plain);
        let help = [found.used, wanted.got].into_iter().find(|t| !t.is_empty());
        Some(Problem::bad_input(message).help(help.unwrap_or_default()))
    }

    /// The problem of a text of another kind that is given for settings of this kind.
    pub(crate) fn mistaken_text(self, text: &str) -> Option<Problem> {
        let head = text.as_bytes();
        let found = Self::of_keys(text, Some(self)).or_else(|| Self::of_head(head));
        self.mistaken(found)
    }

    /// How to get a file of this kind.
    pub fn got(self) -> &'static str {
        self.row().got
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn content_shows_the_kind() {
        for (head, kind) in [
            (
                &b"<?xml version=\"1.0\"?>\n<mvnx version=\"4\">"[..],
                Some(FileKind::Recording),
            ),
            (
                b"\xEF\xBB\xBFrecording = \"a.mvnx\"\n[air]\ndensity = 1\n",
                Some(FileKind::Flight),
            ),
            (b"# me\nheight_m = 1.75\n[gear]\n", Some(FileKind::Subject)),
            (b"[[effect]]\nname = \"wind\"\n", Some(FileKind::Model)),
            (b"base = \"auto\"\n", Some(FileKind::Preset)),
            (b"kind = \"points\"\n[world]\n", Some(FileKind::Mapping)),
            (
                b"time_s;pitch;yaw;roll;damp_pitch\n",
                Some(FileKind::Inputs),
            ),
            (b"time_s,north_m,east_m,height_m\n", Some(FileKind::Track)),
            (b"<?xml?><gpx>", Some(FileKind::Track)),
            (b"HIERARCHY\n", Some(FileKind::Bvh)),
            (b"\x02P\x08\0", Some(FileKind::C3d)),
            (b"\x89PNG\r\n", Some(FileKind::Picture)),
            (b"%PDF-1.7", Some(FileKind::Pdf)),
            (b"<!DOCTYPE html>", Some(FileKind::WebPage)),
            (b"{\"a\": 1}", Some(FileKind::Json)),
            (b" \r\n", Some(FileKind::Empty)),
            (b"hello\n", Some(FileKind::Text)),
            (b"GPS,Speed\n1,2\n", None),
            (b"a = 1\n", None),
            (b"\0\0\0\0", None),
        ] {
            let name = String::from_utf8_lossy(head);
            assert_eq!(FileKind::of_head(head), kind, "{name}");
        }
    }

    #[test]
    fn each_kind_is_named_where_another_belongs() {
        for found in &ROWS {
            assert_eq!(found.kind.row().kind, found.kind);
            for wanted in &ROWS[..12] {
                let Some(problem) = wanted.kind.mistaken(Some(found.kind)) else {
                    assert_eq!(found.kind, wanted.kind);
                    continue;
                };
                assert!(problem.help.is_some_and(|help| !help.is_empty()));
            }
        }
        assert_eq!(FileKind::Subject.mistaken(None).map(|p| p.message), None);
    }

    #[test]
    fn a_wrong_key_does_not_make_another_kind() {
        let text = "height_m = 1.75\nrecording = \"a\"\n";
        assert!(FileKind::Subject.mistaken_text(text).is_none());
        assert!(FileKind::Flight.mistaken_text(text).is_none());
        let problem = FileKind::Model.mistaken_text(text).unwrap();
        assert_eq!(problem.message, "this is a flight.toml, not a model.toml");
    }
}
