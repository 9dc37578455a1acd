//! People whose jumps are public, and what the program reads of them.

use std::path::{Path, PathBuf};

use bodyflight_core::Segment;
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

/// Drop jumps of a person in OpenCap's laboratory: the folder below that of the repositories, and the recordings.
type DropJumps = (&'static str, &'static str, &'static [&'static str]);

const DROP_JUMPS: [DropJumps; 4] = [
    (
        "E1",
        "AddBiomechanics/paper_data/Expert1",
        // The markers of a wrist are exchanged in DJAsym2, and in the last frame of DJ2, which the program says.
        &["DJ1", "DJ3", "DJAsym1", "DJAsym3"],
    ),
    (
        "S4",
        "nimblephysics/data/grf/Subject4/MarkerData",
        &["DJ1", "DJ2", "DJ3", "DJAsym1", "DJAsym2", "DJAsym3"],
    ),
    (
        "U",
        "nimblephysics/data/grf/OpenCapUnfiltered/MarkerData",
        &["DJ1", "DJ4", "DJ5"],
    ),
    (
        "L5",
        "nimblephysics/data/osim/LaiArnoldSubject5",
        &["DJ1", "DJ2"],
    ),
];

/// The people of the table: one whose somersaults are bundled, one of CMU's library, four of OpenCap's laboratory.
pub(super) fn people(folder: &Path) -> Vec<Person> {
    let mapping =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/airborne/table/opencap.toml");
    let cmu = folder.join("CMU-MOCAP-Data/data/CMU/asfamc/subjects/01/01_01.amc");
    let mut people = vec![
        Person {
            name: "Montreal",
            sources: vec![
                Source::Bundled("flight-1.mvnx.gz", "subject-1.toml"),
                Source::Bundled("flight-3.mvnx.gz", "subject-3.toml"),
            ],
        },
        Person {
            name: "CMU 01",
            sources: vec![Source::Foreign(cmu, None)],
        },
    ];
    people.extend(DROP_JUMPS.map(|(name, below, jumps)| {
        let file = |jump: &&str| folder.join(below).join(format!("{jump}.trc"));
        let foreign = |jump| Source::Foreign(file(jump), Some(mapping.clone()));
        Person {
            name,
            sources: jumps.iter().map(foreign).collect(),
        }
    }));
    people
}

impl Source {
    /// Its frames. One of another system is imported, of a `subject` if the user names one; what the import doubts comes with
    /// it.
    pub(super) fn captured(&self, folder: &Path, subject: Option<&Path>) -> (Capture, String) {
        std::fs::create_dir_all(folder).expect("a folder");
        let capture = |path: &Path, subject: Option<PathBuf>| {
            let (frames, rate) = frames(path);
            Capture {
                name: "",
                frames,
                rate,
                subject,
            }
        };
        match self {
            Self::Bundled(recording, own) => {
                let subject = subject.map_or_else(|| acrobatics().join(own), Path::to_path_buf);
                let capture = capture(&acrobatics().join(recording), Some(subject));
                (capture, String::new())
            }
            Self::Foreign(file, mapping) => {
                let out = folder.join("imported");
                let mut arguments = vec!["import", plain(file), "--out", plain(&out)];
                let mapping = mapping.iter().flat_map(|path| ["--mapping", plain(path)]);
                arguments.extend(mapping);
                arguments.extend(subject.iter().flat_map(|path| ["--subject", plain(path)]));
                let (answer, _) = PROGRAM.answer(&arguments);
                let capture = capture(&out.join("flight.mvnx"), subject.map(Path::to_path_buf));
                (capture, answer["warnings"].to_string())
            }
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
        let table = wrong.in_table(&known, table);
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
    /// The length of a segment, with its centre of gravity and the joint at its end.
    Length(Segment, Segment, f64),
}

impl Wrong {
    fn in_table(self, known: &Subject, mut table: Value) -> Value {
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
            Self::Length(segment, next, factor) => {
                let own = body.segments[segment];
                let joint = body.segments[next].joint_offset * factor;
                set(segment, "length", json!(own.length * factor));
                set(segment, "cg", json!(<[f64; 3]>::from(own.cg * factor)));
                set(next, "joint_offset", json!(<[f64; 3]>::from(joint)));
            }
        }
        table
    }
}
