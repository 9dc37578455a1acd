//! People whose jumps are public, and what the program reads of them.

use std::path::{Path, PathBuf};

use bodyflight_core::{Segment, SegmentArray};
use bodyflight_mocap::mapping::Mapping;
use bodyflight_replay::subject::{SEGMENTS_FILE, SUBJECT_FILE, Subject};
use bodyflight_tests::program::{plain, written};
use serde_json::{Map, Value, json};

use crate::faults::{Capture, frames};
use crate::{PROGRAM, acrobatics};

/// A recording as it was published: one of MVN, or one of another system, which is imported.
pub(super) enum Source {
    /// A bundled recording with the subject of its athlete.
    Bundled(&'static str, &'static str),
    /// A file below the folder of repositories, with the mapping that it needs.
    Foreign(PathBuf, Option<PathBuf>),
}

/// Recordings of one person; the search fits some of them, and is confirmed by the others.
pub(super) struct Person {
    pub(super) name: &'static str,
    pub(super) sources: Vec<Source>,
}

/// Lengths of the limbs that are known (m).
type Lengths = SegmentArray<Option<f64>>;

/// Drop jumps of a person in OpenCap's laboratory: the folder below that of the repositories, and the recordings.
type DropJumps = (&'static str, &'static str, &'static [&'static str]);

const DROP_JUMPS: [DropJumps; 4] = [
    (
        "Expert1",
        "AddBiomechanics/paper_data/Expert1",
        // The markers of a wrist are exchanged in DJAsym2, and in the last frame of DJ2, which the program says.
        &["DJ1", "DJ3", "DJAsym1", "DJAsym3"],
    ),
    (
        "Subject4",
        "nimblephysics/data/grf/Subject4/MarkerData",
        &["DJ1", "DJ2", "DJ3", "DJAsym1", "DJAsym2", "DJAsym3"],
    ),
    (
        "OpenCapUnfiltered",
        "nimblephysics/data/grf/OpenCapUnfiltered/MarkerData",
        &["DJ1", "DJ4", "DJ5"],
    ),
    (
        "LaiArnoldSubject5",
        "nimblephysics/data/osim/LaiArnoldSubject5",
        &["DJ1", "DJ2"],
    ),
];

/// Recordings of CMU's library below the folder of repositories.
const CMU: &str = "CMU-MOCAP-Data/data/CMU/asfamc/subjects";

const OTHER_DROP_JUMP: DropJumps = (
    "T",
    "AddBiomechanics/server/engine/tests/data/opencap_test_original/trials/DJ1",
    &["markers"],
);

/// The people with whose recordings the checks were made: one whose somersaults are bundled, one of CMU's library, four
/// of OpenCap's laboratory.
pub(super) fn people(folder: &Path) -> Vec<Person> {
    let mut people = vec![
        acrobat(),
        Person {
            name: "CMU 01",
            sources: vec![Source::Foreign(folder.join(CMU).join("01/01_01.amc"), None)],
        },
    ];
    people.extend(DROP_JUMPS.map(|jumps| dropping(folder, jumps)));
    people
}

fn acrobat() -> Person {
    Person {
        name: "Montreal",
        sources: vec![
            Source::Bundled("flight-1.mvnx.gz", "subject-1.toml"),
            Source::Bundled("flight-3.mvnx.gz", "subject-3.toml"),
        ],
    }
}

/// People whose recordings are part of the repository: of CMU's library, two of ten jumps.
pub(super) fn bundled() -> [Person; 2] {
    let jumps = acrobatics().join("../cmu/01_01.amc.gz");
    let of_cmu = Person {
        name: "CMU 01",
        sources: vec![Source::Foreign(jumps, None)],
    };
    [acrobat(), of_cmu]
}

/// People whose recordings were read only when the checks were finished.
pub(super) fn others(folder: &Path) -> Vec<Person> {
    let of_cmu = ["02/02_03.amc", "02/02_04.amc"];
    let cmu = of_cmu.map(|file| Source::Foreign(folder.join(CMU).join(file), None));
    vec![
        Person {
            name: "CMU 02",
            sources: cmu.into(),
        },
        dropping(folder, OTHER_DROP_JUMP),
    ]
}

fn dropping(folder: &Path, (name, below, jumps): DropJumps) -> Person {
    let mapping =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/airborne/table/opencap.toml");
    let file = |jump: &&str| folder.join(below).join(format!("{jump}.trc"));
    let foreign = |jump| Source::Foreign(file(jump), Some(mapping.clone()));
    Person {
        name,
        sources: jumps.iter().map(foreign).collect(),
    }
}

impl Source {
    /// Its frames; a recording of another system is imported.
    pub(super) fn captured(&self, folder: &Path) -> Capture {
        let (recording, subject) = match self {
            Self::Bundled(recording, own) => {
                (acrobatics().join(recording), Some(acrobatics().join(own)))
            }
            Self::Foreign(..) => {
                let (flight, _) = self.imported(folder, None);
                (Path::new(&flight).with_file_name("flight.mvnx"), None)
            }
        };
        let (frames, rate) = frames(&recording);
        Capture {
            name: "",
            frames,
            rate,
            subject,
        }
    }

    /// Imports a file, of a `subject` if the user names one: the flight, and what is said.
    fn imported(&self, folder: &Path, subject: Option<&Path>) -> (String, String) {
        let Self::Foreign(file, mapping) = self else {
            return Default::default();
        };
        let out = folder.join("imported");
        let mut arguments = vec!["import", plain(file), "--out", plain(&out)];
        let mapping = mapping.iter().flat_map(|path| ["--mapping", plain(path)]);
        arguments.extend(mapping);
        arguments.extend(subject.iter().flat_map(|path| ["--subject", plain(path)]));
        let (answer, _) = PROGRAM.answer(&arguments);
        let flight = out.join("flight.toml");
        (plain(&flight).to_owned(), answer["warnings"].to_string())
    }

    /// The lengths of the limbs in a file of another system (m).
    fn lengths(&self) -> Lengths {
        let Self::Foreign(file, mapping) = self else {
            return SegmentArray::from_fn(|_| None);
        };
        let mapping = mapping
            .as_deref()
            .map(|path| Mapping::read(path).expect("a mapping"));
        let source = bodyflight_mocap::source::Source::open(file, mapping.as_ref());
        source.expect("a source").lengths_m
    }

    /// The flight as it is, without a subject of its own.
    pub(super) fn flight(&self, folder: &Path) -> String {
        match self {
            Self::Bundled(recording, _) => plain(&acrobatics().join(recording)).to_owned(),
            Self::Foreign(..) => self.imported(folder, None).0,
        }
    }

    /// The flight of a user whose subject is wrong, and what the import says of it.
    pub(super) fn with_subject(&self, folder: &Path, subject: &Path) -> (String, String) {
        match self {
            Self::Bundled(recording, _) => {
                let recording = acrobatics().join(recording);
                let flight = format!(
                    "recording = \"{}\"\nsubject = \"{}\"\n",
                    plain(&recording),
                    plain(subject)
                );
                (written(folder, "flight.toml", &flight), String::new())
            }
            Self::Foreign(..) => self.imported(folder, Some(subject)),
        }
    }

    /// The subject of this person as a user knows it, with a limb that is wrong in it.
    pub(super) fn wrong_subject(&self, folder: &Path, wrong: Wrong) -> PathBuf {
        std::fs::create_dir_all(folder).expect("a folder");
        let known = match self {
            Self::Bundled(_, own) => Subject::read(&acrobatics().join(own)).expect("a subject"),
            Self::Foreign(..) => Subject::default(),
        };
        known.write_in(folder).expect("a file");
        let table = known.segments_json().map_or_else(
            || json!({"segments": []}),
            |text| serde_json::from_str(text).expect("a table"),
        );
        let table = wrong.in_table(&known, self.lengths(), table);
        written(folder, SEGMENTS_FILE, &table.to_string());
        let path = folder.join(SUBJECT_FILE);
        let text = std::fs::read_to_string(&path).expect("the subject");
        if !text.contains("segments =") {
            written(
                folder,
                SUBJECT_FILE,
                &format!("segments = \"{SEGMENTS_FILE}\"\n{text}"),
            );
        }
        path
    }
}

/// What is wrong with a limb of a subject, as a factor.
#[derive(Debug, Clone, Copy)]
pub(super) enum Wrong {
    /// The mass and the inertia of a segment.
    Mass(Segment, f64),
    /// The length of a segment. The other limbs are as long as in the recording: who lists lengths has measured them.
    Length(Segment, f64),
}

/// Bones of the limbs, with the segments whose joints are at their ends.
const BONES: [[Segment; 2]; 8] = [
    [Segment::LeftThigh, Segment::LeftShank],
    [Segment::RightThigh, Segment::RightShank],
    [Segment::LeftShank, Segment::LeftFoot],
    [Segment::RightShank, Segment::RightFoot],
    [Segment::LeftUpperArm, Segment::LeftForearm],
    [Segment::RightUpperArm, Segment::RightForearm],
    [Segment::LeftForearm, Segment::LeftHand],
    [Segment::RightForearm, Segment::RightHand],
];

impl Wrong {
    fn in_table(self, known: &Subject, lengths: Lengths, mut table: Value) -> Value {
        let body = known.body();
        let rows = table["segments"].as_array_mut().expect("rows");
        let mut set = |segment: Segment, field: &str, value: Value| {
            let at = rows.iter().position(|row| row["name"] == segment.name());
            let at = at.unwrap_or_else(|| {
                rows.push(Value::Object(Map::new()));
                rows.len() - 1
            });
            rows[at]["name"] = json!(segment.name());
            rows[at][field] = value;
        };
        match self {
            Self::Mass(segment, factor) => {
                let own = body.segments[segment];
                let inertia = own.inertia * factor;
                set(segment, "mass", json!(own.mass * factor));
                set(segment, "inertia", json!(<[[f64; 3]; 3]>::from(inertia)));
            }
            Self::Length(wrong, factor) => {
                for [segment, next] in BONES {
                    let joint = body.segments[next].joint_offset;
                    let known = lengths[segment].map_or(1.0, |length| length / joint.norm());
                    let factor = known * if segment == wrong { factor } else { 1.0 };
                    let own = body.segments[segment];
                    set(segment, "length", json!(joint.norm() * factor));
                    set(segment, "cg", json!(<[f64; 3]>::from(own.cg * factor)));
                    set(
                        next,
                        "joint_offset",
                        json!(<[f64; 3]>::from(joint * factor)),
                    );
                }
            }
        }
        table
    }
}
