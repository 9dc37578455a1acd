//! A recording taken apart, so that it can be written with a change.

use core::fmt::Write;
use std::fs;
use std::path::Path;

use nalgebra::Vector3;

/// A change of a recording.
pub(super) enum Change {
    /// Of each frame by its number; the second argument is the unchanged recording.
    Frames(fn(usize, &[Frame], &mut Frame)),
    /// Of one text in a file for another.
    Text(&'static str, &'static str, &'static str),
    /// Only the frames with these numbers.
    Kept(fn(usize) -> bool),
}

/// A kind of nonsense.
pub(super) struct Kind {
    pub(super) name: &'static str,
    pub(super) change: Change,
}

pub(super) const fn frames(name: &'static str, change: fn(usize, &[Frame], &mut Frame)) -> Kind {
    Kind {
        name,
        change: Change::Frames(change),
    }
}

pub(super) const fn edited(
    name: &'static str,
    file: &'static str,
    from: &'static str,
    to: &'static str,
) -> Kind {
    Kind {
        name,
        change: Change::Text(file, from, to),
    }
}

pub(super) const fn kept(name: &'static str, keeps: fn(usize) -> bool) -> Kind {
    Kind {
        name,
        change: Change::Kept(keeps),
    }
}

/// Elements of a frame.
const ELEMENTS: [&str; 5] = [
    "orientation",
    "position",
    "velocity",
    "acceleration",
    "angularVelocity",
];
/// Frames that are read, enough for every change and every check.
const FRAMES: usize = 2000;

/// Numbers of a frame, element by element and segment by segment.
#[derive(Clone)]
pub(super) struct Frame {
    pub(super) open: String,
    pub(super) orientation: Vec<[f64; 4]>,
    pub(super) position: Vec<Vector3<f64>>,
    pub(super) velocity: Vec<Vector3<f64>>,
    pub(super) acceleration: Vec<Vector3<f64>>,
    pub(super) rate: Vec<Vector3<f64>>,
}

/// A recording taken apart.
pub(super) struct Recorded {
    before: String,
    frames: Vec<Frame>,
    after: String,
    files: Vec<(&'static str, String)>,
}

impl Recorded {
    pub(super) fn read(folder: &Path) -> Self {
        let read = |name: &str| fs::read_to_string(folder.join(name)).expect("text");
        let text = read("flight.mvnx");
        let first = text
            .match_indices("<frame ")
            .find(|(at, _)| {
                let tag = text[*at..].split('>').next().unwrap_or_default();
                tag.contains("type=\"normal\"")
            })
            .map_or(0, |(at, _)| at);
        let last = text.rfind("</frame>").map_or(0, |at| at + "</frame>".len());
        let frames = text[first..last]
            .split_terminator("</frame>")
            .take(FRAMES)
            .map(Frame::parse);
        Self {
            frames: frames.collect(),
            before: text[..first].to_owned(),
            after: text[last..].to_owned(),
            files: ["flight.toml", "subject.toml", "inputs.csv"]
                .map(|name| (name, read(name)))
                .into(),
        }
    }

    /// The frames with a change.
    pub(super) fn changed(&self, kind: &Kind) -> Vec<Frame> {
        let mut frames = self.frames.clone();
        match kind.change {
            Change::Frames(change) => {
                for (index, frame) in frames.iter_mut().enumerate() {
                    change(index, &self.frames, frame);
                }
            }
            Change::Kept(keeps) => {
                let mut index = 0..;
                frames.retain(|_| index.next().is_some_and(keeps));
            }
            Change::Text(..) => {}
        }
        frames
    }

    /// Writes the recording with a change, as a flight in a folder.
    pub(super) fn write(&self, folder: &Path, kind: &Kind) {
        fs::create_dir_all(folder).expect("a folder");
        let mut text = self.before.clone();
        for frame in self.changed(kind) {
            frame.add_to(&mut text);
        }
        text += &self.after;
        let recording = [("flight.mvnx", text)].into_iter();
        for (name, mut text) in recording.chain(self.files.clone()) {
            if let Change::Text(file, from, to) = kind.change
                && file == name
            {
                assert!(text.contains(from), "{name} has no {from}");
                text = text.replacen(from, to, 1);
            }
            fs::write(folder.join(name), text).expect("written");
        }
    }
}

impl Frame {
    fn parse(text: &str) -> Self {
        let text = text.trim();
        let open = text.split_inclusive('>').next().unwrap_or_default();
        let numbers = |element: &str| -> Vec<f64> {
            let from = text.find(&format!("<{element}>")).expect("an element") + element.len() + 2;
            let to = text[from..].find('<').expect("its end") + from;
            let words = text[from..to].split_whitespace();
            words.map(|word| word.parse().expect("a number")).collect()
        };
        let vectors = |element: &str| -> Vec<Vector3<f64>> {
            numbers(element)
                .chunks_exact(3)
                .map(Vector3::from_column_slice)
                .collect()
        };
        let quaternions = numbers("orientation");
        let quaternions = quaternions
            .chunks_exact(4)
            .map(|q| [q[0], q[1], q[2], q[3]]);
        Self {
            open: open.to_owned(),
            orientation: quaternions.collect(),
            position: vectors("position"),
            velocity: vectors("velocity"),
            acceleration: vectors("acceleration"),
            rate: vectors("angularVelocity"),
        }
    }

    fn add_to(&self, text: &mut String) {
        let vectors = |of: &[Vector3<f64>]| of.iter().flat_map(|v| [v.x, v.y, v.z]).collect();
        let all: [Vec<f64>; 5] = [
            self.orientation.iter().flatten().copied().collect(),
            vectors(&self.position),
            vectors(&self.velocity),
            vectors(&self.acceleration),
            vectors(&self.rate),
        ];
        *text += &self.open;
        for (element, numbers) in ELEMENTS.iter().zip(all) {
            let _ = write!(text, "<{element}>");
            numbers.iter().for_each(|number| decimal(*number, text));
            let _ = write!(text, "</{element}>");
        }
        *text += "</frame>\n";
    }
}

/// Adds a number with six decimals and a space: what takes most of the time of writing a recording.
pub(super) fn decimal(number: f64, text: &mut String) {
    let millionths = number.abs() * 1e6;
    // Also what is no number.
    if millionths.is_nan() || millionths >= 1e15 {
        let _ = write!(text, "{number:.6} ");
        return;
    }
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "below 10^15"
    )]
    let millionths = millionths.round() as u64;
    let sign = if number < 0.0 { "-" } else { "" };
    let (whole, rest) = (millionths / 1_000_000, millionths % 1_000_000);
    let _ = write!(text, "{sign}{whole}.{rest:06} ");
}
