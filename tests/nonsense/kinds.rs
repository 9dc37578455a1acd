//! Kinds of nonsense, as changes of a good recording.

use std::fs;
use std::path::Path;

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

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
const SEGMENTS: usize = 23;
const LEFT_ARM: usize = 11;
const RIGHT_ARM: usize = 7;
const RIGHT_FOREARM: usize = 9;
const LEFT_HAND: usize = 14;
const RIGHT_LEG: usize = 15;
const LEFT_LEG: usize = 19;

/// Numbers of a frame, element by element and segment by segment.
#[derive(Clone)]
pub(super) struct Frame {
    open: String,
    orientation: Vec<[f64; 4]>,
    position: Vec<Vector3<f64>>,
    velocity: Vec<Vector3<f64>>,
    acceleration: Vec<Vector3<f64>>,
    rate: Vec<Vector3<f64>>,
}

/// A change of a recording.
pub(super) enum Change {
    /// Of each frame by its number; the second argument is the unchanged recording.
    Frames(fn(usize, &[Frame], &mut Frame)),
    /// Of one text in a file for another.
    Text(&'static str, &'static str, &'static str),
    /// Only so many frames.
    Length(usize),
}

/// A kind of nonsense.
pub(super) struct Kind {
    pub(super) name: &'static str,
    pub(super) change: Change,
}

const fn frames(name: &'static str, change: fn(usize, &[Frame], &mut Frame)) -> Kind {
    Kind {
        name,
        change: Change::Frames(change),
    }
}

const fn edited(
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

fn scale(of: &mut [Vector3<f64>], factor: f64) {
    of.iter_mut().for_each(|vector| *vector *= factor);
}

fn exchange<T>(of: &mut [T], first: usize, second: usize) {
    (0..4).for_each(|place| of.swap(first + place, second + place));
}

/// Small noise that differs from number to number.
fn noise(frame: usize, place: usize) -> f64 {
    ((frame * 7919 + place * 104_729) as f64 * 0.618).sin()
}

/// The first posture of a recording, at rest with a pelvis turned and moved so.
fn at_rest(
    index: usize,
    all: &[Frame],
    frame: &mut Frame,
    turned: UnitQuaternion<f64>,
    walks: f64,
) {
    let time = index as f64 / 240.0;
    let from = all[0].position[0];
    let place = Vector3::new(
        walks * time + 0.004 * (1.1 * time).sin(),
        0.003 * time.cos(),
        1.0,
    );
    let moves = Vector3::new(
        walks + 0.0044 * (1.1 * time).cos(),
        -0.003 * time.sin(),
        0.0,
    );
    for segment in 0..SEGMENTS {
        let [w, x, y, z] = all[0].orientation[segment];
        let q = turned * UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z));
        let jitter = 2e-5 * noise(index, segment);
        frame.orientation[segment] = [q.w, q.i + jitter, q.j - jitter, q.k];
        frame.position[segment] = turned * (all[0].position[segment] - from) + place;
        frame.velocity[segment] = moves + Vector3::repeat(0.01 * noise(index, 30 + segment));
        frame.rate[segment] = Vector3::repeat(0.01 * noise(index, 60 + segment));
    }
}

/// The turn that sets the first frame's pelvis upright.
fn upright(all: &[Frame]) -> UnitQuaternion<f64> {
    let [w, x, y, z] = all[0].orientation[0];
    UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z)).inverse()
}

pub(super) const KINDS: [Kind; 41] = [
    frames("nothing", |_, _, _| {}),
    frames("velocities empty", |_, _, f| scale(&mut f.velocity, 0.0)),
    frames("velocities halved", |_, _, f| scale(&mut f.velocity, 0.5)),
    frames("velocities in km/h", |_, _, f| scale(&mut f.velocity, 3.6)),
    frames("velocities in knots", |_, _, f| {
        scale(&mut f.velocity, 1.943_84)
    }),
    frames("velocities 5 % high", |_, _, f| {
        scale(&mut f.velocity, 1.05)
    }),
    frames("vertical velocity positive down", |_, _, f| {
        f.velocity.iter_mut().for_each(|v| v.z = -v.z);
    }),
    frames("north and west velocity exchanged", |_, _, f| {
        f.velocity.iter_mut().for_each(|v| v.swap_rows(0, 1));
    }),
    frames("velocity off by 20 m/s from 6.25 s", |index, _, f| {
        if index >= 1500 {
            f.velocity.iter_mut().for_each(|v| v.x += 20.0);
        }
    }),
    frames("positions in feet", |_, _, f| {
        scale(&mut f.position, 3.280_84)
    }),
    frames("positions in millimetres", |_, _, f| {
        scale(&mut f.position, 1000.0)
    }),
    frames("positions frozen", |_, all, f| {
        f.position.clone_from(&all[0].position)
    }),
    frames("positions jump by 50 m", |index, _, f| {
        if index >= 1500 {
            f.position.iter_mut().for_each(|p| p.x += 50.0);
        }
    }),
    frames("rates in degrees", |_, _, f| scale(&mut f.rate, 57.295_78)),
    frames("rates empty", |_, _, f| scale(&mut f.rate, 0.0)),
    frames("rates halved", |_, _, f| scale(&mut f.rate, 0.5)),
    frames("rates of the other sense", |_, _, f| {
        scale(&mut f.rate, -1.0)
    }),
    frames("quaternions x y z w", |_, _, f| {
        f.orientation.iter_mut().for_each(|q| q.rotate_left(1));
    }),
    frames("quaternions inverse", |_, _, f| {
        f.orientation.iter_mut().for_each(|q| q[0] = -q[0]);
    }),
    frames("quaternions of length 2", |_, _, f| {
        f.orientation
            .iter_mut()
            .flatten()
            .for_each(|part| *part *= 2.0);
    }),
    frames("forearm frozen from 4 s", |index, all, f| {
        if index >= 960 {
            f.orientation[RIGHT_FOREARM] = all[960].orientation[RIGHT_FOREARM];
        }
    }),
    frames("thigh frozen with noise", |index, all, f| {
        if index >= 960 {
            f.orientation[RIGHT_LEG] =
                all[960].orientation[RIGHT_LEG].map(|part| part + 1e-4 * noise(index, 0));
        }
    }),
    frames("pelvis frozen for 1.8 s", |index, all, f| {
        if (960..1392).contains(&index) {
            f.orientation[0] = all[960].orientation[0];
        }
    }),
    frames("everything frozen for 1.2 s", |index, all, f| {
        if (1500..1788).contains(&index) {
            let open = f.open.clone();
            *f = Frame {
                open,
                ..all[1500].clone()
            };
        }
    }),
    frames("left and right leg exchanged", |_, _, f| {
        exchange(&mut f.orientation, RIGHT_LEG, LEFT_LEG);
        exchange(&mut f.position, RIGHT_LEG, LEFT_LEG);
        exchange(&mut f.velocity, RIGHT_LEG, LEFT_LEG);
        exchange(&mut f.rate, RIGHT_LEG, LEFT_LEG);
    }),
    frames("left and right arm turned as each other", |_, _, f| {
        exchange(&mut f.orientation, RIGHT_ARM, LEFT_ARM);
    }),
    frames("hand 0.3 m away for 1.2 s", |index, _, f| {
        if (900..1188).contains(&index) {
            f.position[LEFT_HAND].x += 0.3;
        }
    }),
    frames("heading jumps by 45 degrees", |index, _, f| {
        if index >= 1500 {
            let turn =
                UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 0.25 * std::f64::consts::PI);
            for q in &mut f.orientation {
                let [w, x, y, z] = *q;
                let turned = turn.quaternion() * Quaternion::new(w, x, y, z);
                *q = [turned.w, turned.i, turned.j, turned.k];
            }
        }
    }),
    frames("every second frame twice", |index, all, f| {
        let open = f.open.clone();
        *f = Frame {
            open,
            ..all[index - index % 2].clone()
        };
    }),
    edited(
        "header says 120 frames a second",
        "flight.mvnx",
        "frameRate=\"240\"",
        "frameRate=\"120\"",
    ),
    edited(
        "header says 252 frames a second",
        "flight.mvnx",
        "frameRate=\"240\"",
        "frameRate=\"252\"",
    ),
    frames("frame times 5 % fast", |_, _, f| {
        let (before, rest) = f.open.split_once("time=\"").unwrap_or_default();
        let (time, after) = rest.split_once('"').unwrap_or_default();
        let time = time.parse().unwrap_or(0.0) / 1.05;
        f.open = format!("{before}time=\"{time:.0}\"{after}");
    }),
    frames("the body stands", |index, all, f| {
        at_rest(index, all, f, upright(all), 0.0)
    }),
    frames("the body lies", |index, all, f| {
        at_rest(index, all, f, UnitQuaternion::identity(), 0.0)
    }),
    frames("the body walks", |index, all, f| {
        at_rest(index, all, f, upright(all), 1.3)
    }),
    frames("a wind tunnel without its air", |_, _, f| {
        let (falls, height) = (f.velocity[0].z, f.position[0].z);
        f.velocity.iter_mut().for_each(|v| v.z -= falls);
        f.position.iter_mut().for_each(|p| p.z -= height);
    }),
    edited(
        "a person of 1.20 m",
        "subject.toml",
        "height_m = 1.75",
        "height_m = 1.2",
    ),
    edited(
        "a person of 2.20 m",
        "subject.toml",
        "height_m = 1.75",
        "height_m = 2.2",
    ),
    edited(
        "a person of 20 kg",
        "subject.toml",
        "mass_kg = 75.0",
        "mass_kg = 20",
    ),
    frames("accelerations with gravity", |_, _, f| {
        f.acceleration.iter_mut().for_each(|a| a.z += 9.81);
    }),
    Kind {
        name: "0.1 s of flight",
        change: Change::Length(24),
    },
];

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

    /// Writes the recording with a change, as a flight in a folder.
    pub(super) fn write(&self, folder: &Path, kind: &Kind) {
        fs::create_dir_all(folder).expect("a folder");
        let mut frames = self.frames.clone();
        match kind.change {
            Change::Frames(change) => {
                for (index, frame) in frames.iter_mut().enumerate() {
                    change(index, &self.frames, frame);
                }
            }
            Change::Length(length) => frames.truncate(length),
            Change::Text(..) => {}
        }
        let mut text = self.before.clone();
        frames.iter().for_each(|frame| frame.add_to(&mut text));
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
        let flat = |of: &[Vector3<f64>]| of.iter().flat_map(|v| [v.x, v.y, v.z]).collect();
        let all: [Vec<f64>; 5] = [
            self.orientation.iter().flatten().copied().collect(),
            flat(&self.position),
            flat(&self.velocity),
            flat(&self.acceleration),
            flat(&self.rate),
        ];
        *text += &self.open;
        for (element, numbers) in ELEMENTS.iter().zip(all) {
            let words: Vec<String> = numbers
                .iter()
                .map(|number| format!("{number:.6}"))
                .collect();
            *text += &format!("<{element}>{}</{element}>", words.join(" "));
        }
        *text += "</frame>\n";
    }
}
