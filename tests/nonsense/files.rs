//! The recording as files of other systems, in which header, names or sides contradict the rest.

use core::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

use super::c3d;
use super::recorded::{Frame, Kind, Recorded, frames};

/// A file of one kind.
pub(super) struct Other {
    pub(super) name: &'static str,
    write: fn(&[Frame], &Path) -> PathBuf,
}

const fn other(name: &'static str, write: fn(&[Frame], &Path) -> PathBuf) -> Other {
    Other { name, write }
}

/// Frames a second of the files, which have every second frame of the recording.
const RATE: f64 = 120.0;

impl Other {
    /// Writes the file, and its mapping if it needs one; returns the arguments of `import`.
    pub(super) fn written(&self, recorded: &Recorded, folder: &Path) -> Vec<String> {
        const UNCHANGED: Kind = frames("nothing", |_, _, _| {});
        let frames: Vec<Frame> = recorded
            .changed(&UNCHANGED)
            .into_iter()
            .step_by(2)
            .collect();
        let file = (self.write)(&frames, folder);
        let plain = |path: &Path| path.to_str().expect("plain").to_owned();
        if file.extension().is_some_and(|ending| ending == "bvh") {
            return vec![plain(&file)];
        }
        let map = folder.join("points.toml");
        fs::write(&map, points_mapping()).expect("written");
        vec![plain(&file), "--mapping".to_owned(), plain(&map)]
    }
}

pub(super) const OTHERS: [Other; 25] = [
    other("BVH: nothing", |frames, folder| {
        bvh(frames, folder, |text| text)
    }),
    other(
        "BVH: order of rotations X Y Z for Z X Y",
        |frames, folder| told(frames, folder, "Xrotation Yrotation Zrotation"),
    ),
    other(
        "BVH: order of rotations X Z Y for Z X Y",
        |frames, folder| told(frames, folder, "Xrotation Zrotation Yrotation"),
    ),
    other(
        "BVH: order of rotations Y X Z for Z X Y",
        |frames, folder| told(frames, folder, "Yrotation Xrotation Zrotation"),
    ),
    other(
        "BVH: order of rotations Y Z X for Z X Y",
        |frames, folder| told(frames, folder, "Yrotation Zrotation Xrotation"),
    ),
    other(
        "BVH: order of rotations Z Y X for Z X Y",
        |frames, folder| told(frames, folder, "Zrotation Yrotation Xrotation"),
    ),
    other("BVH: sides of the arms exchanged", |frames, folder| {
        bvh(frames, folder, |text| {
            let pairs = ["Shoulder", "Arm", "ForeArm", "Hand"];
            pairs.into_iter().fold(text, |text, part| {
                swapped(
                    text,
                    &format!("JOINT Left{part}\n"),
                    &format!("JOINT Right{part}\n"),
                )
            })
        })
    }),
    other("BVH: forearm and hand exchanged", |frames, folder| {
        bvh(frames, folder, |text| {
            swapped(text, "LeftForeArm", "LeftHand")
        })
    }),
    other("BVH: a hand misspelt", |frames, folder| {
        bvh(frames, folder, |text| text.replace("LeftHand", "LeftHnd"))
    }),
    other("BVH: a name twice", |frames, folder| {
        bvh(frames, folder, |text| {
            text.replace("LeftHand", "LeftForeArm")
        })
    }),
    other("BVH: a position of 10^308", |frames, folder| {
        bvh(frames, folder, |text| {
            let (head, rows) = text.split_once("Frame Time").expect("rows");
            let mut lines: Vec<String> = rows.lines().map(str::to_owned).collect();
            let (_, rest) = lines[5].split_once(' ').expect("numbers");
            lines[5] = format!("1e308 {rest}");
            format!("{head}Frame Time{}\n", lines.join("\n"))
        })
    }),
    other("TRC: nothing", |frames, folder| {
        trc(frames, folder, |text| text)
    }),
    other("TRC: a rate of 60 Hz for 120", |frames, folder| {
        trc(frames, folder, |text| text.replacen("\n120\t", "\n60\t", 1))
    }),
    other("TRC: cut off", |frames, folder| {
        trc(frames, folder, |text| {
            let lines: Vec<&str> = text.lines().collect();
            lines[..lines.len() - 300].join("\n") + "\n"
        })
    }),
    other("TRC: fewer frames stated", |frames, folder| {
        trc(frames, folder, |text| {
            text.replacen("\t1000\t", "\t900\t", 1)
        })
    }),
    other("TRC: an unknown unit", |frames, folder| {
        trc(frames, folder, |text| {
            text.replacen("\tmm\n", "\tfurlong\n", 1)
        })
    }),
    other("TRC: elbow and wrist exchanged", |frames, folder| {
        trc(frames, folder, |text| swapped(text, "LELB", "LWRI"))
    }),
    other("TRC: shoulder and elbow exchanged", |frames, folder| {
        trc(frames, folder, |text| swapped(text, "RSHO", "RELB"))
    }),
    other("TRC: wrists exchanged", |frames, folder| {
        trc(frames, folder, |text| swapped(text, "LWRI", "RWRI"))
    }),
    other("TRC: ankles exchanged", |frames, folder| {
        trc(frames, folder, |text| swapped(text, "LANK", "RANK"))
    }),
    other("TRC: toes exchanged", |frames, folder| {
        trc(frames, folder, |text| swapped(text, "LTOE", "RTOE"))
    }),
    other("TRC: a marker misspelt", |frames, folder| {
        trc(frames, folder, |text| text.replace("LELB", "LEBL"))
    }),
    other("C3D: nothing", |frames, folder| {
        points_in_c3d(frames, folder, |_| {})
    }),
    other("C3D: a rate of 60 Hz in the header", |frames, folder| {
        points_in_c3d(frames, folder, |bytes| {
            bytes[20..24].copy_from_slice(&60.0_f32.to_le_bytes());
            let rate = bytes.windows(4).position(|name| name == b"RATE");
            assert!(rate.is_some(), "the rate among the parameters");
        })
    }),
    other("C3D: no rate", |frames, folder| {
        points_in_c3d(frames, folder, |bytes| {
            bytes[20..24].fill(0);
            let rate = bytes.windows(4).position(|name| name == b"RATE");
            bytes[rate.expect("a rate") + 8..][..4].fill(0);
        })
    }),
];

fn swapped(text: String, one: &str, other: &str) -> String {
    text.replace(one, "\u{1}")
        .replace(other, one)
        .replace('\u{1}', other)
}

/// Joints of a BVH file: name, segment of the recording, and parent.
const JOINTS: [(&str, usize, Option<usize>); 19] = [
    ("Hips", 0, None),
    ("Spine", 2, Some(0)),
    ("Spine1", 4, Some(1)),
    ("Neck", 5, Some(2)),
    ("Head", 6, Some(3)),
    ("LeftShoulder", 11, Some(2)),
    ("LeftArm", 12, Some(5)),
    ("LeftForeArm", 13, Some(6)),
    ("LeftHand", 14, Some(7)),
    ("RightShoulder", 7, Some(2)),
    ("RightArm", 8, Some(9)),
    ("RightForeArm", 9, Some(10)),
    ("RightHand", 10, Some(11)),
    ("LeftUpLeg", 19, Some(0)),
    ("LeftLeg", 20, Some(13)),
    ("LeftFoot", 21, Some(14)),
    ("RightUpLeg", 15, Some(0)),
    ("RightLeg", 16, Some(16)),
    ("RightFoot", 17, Some(17)),
];

/// From the recording's axes, forward, left, up, to those of most BVH files: left, up, forward.
fn axes() -> Matrix3<f64> {
    Matrix3::new(0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0)
}

fn turned(frame: &Frame, segment: usize) -> Matrix3<f64> {
    let [w, x, y, z] = frame.orientation[segment];
    let turned = UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z));
    axes() * turned.to_rotation_matrix().matrix() * axes().transpose()
}

fn hierarchy(text: &mut String, first: &Frame, joint: usize) {
    let (name, own, parent) = JOINTS[joint];
    // The axes of all segments are parallel in the T-pose, which is the rest posture.
    let offset = parent.map_or_else(Vector3::zeros, |parent| {
        let from = JOINTS[parent].1;
        let way = axes() * (first.position[own] - first.position[from]);
        100.0 * turned(first, from).transpose() * way
    });
    let (word, places) = match parent {
        None => ("ROOT", "6 Xposition Yposition Zposition "),
        Some(_) => ("JOINT", "3 "),
    };
    let _ = write!(
        text,
        "{word} {name}\n{{\nOFFSET {:.4} {:.4} {:.4}\nCHANNELS {places}Zrotation Xrotation Yrotation\n",
        offset.x, offset.y, offset.z
    );
    let children = (0..JOINTS.len()).filter(|other| JOINTS[*other].2 == Some(joint));
    let children: Vec<usize> = children.collect();
    if children.is_empty() {
        *text += "End Site\n{\nOFFSET 0 0 5\n}\n";
    }
    for child in children {
        hierarchy(text, first, child);
    }
    *text += "}\n";
}

/// A BVH file in centimetres, changed as text.
fn bvh(frames: &[Frame], folder: &Path, change: impl Fn(String) -> String) -> PathBuf {
    let mut text = "HIERARCHY\n".to_owned();
    hierarchy(&mut text, &frames[0], 0);
    let _ = write!(
        text,
        "MOTION\nFrames: {}\nFrame Time: {:.7}\n",
        frames.len(),
        1.0 / RATE
    );
    for frame in frames {
        let place = 100.0 * axes() * frame.position[0];
        let _ = write!(text, "{:.4} {:.4} {:.4}", place.x, place.y, place.z);
        for (_, own, parent) in JOINTS {
            let own = turned(frame, own);
            let m = match parent {
                Some(parent) => turned(frame, JOINTS[parent].1).transpose() * own,
                None => own,
            };
            let z = (-m[(0, 1)]).atan2(m[(1, 1)]);
            let x = m[(2, 1)].clamp(-1.0, 1.0).asin();
            let y = (-m[(2, 0)]).atan2(m[(2, 2)]);
            for angle in [z, x, y] {
                let _ = write!(text, " {:.4}", angle.to_degrees());
            }
        }
        text.push('\n');
    }
    let path = folder.join("motion.bvh");
    fs::write(&path, change(text)).expect("written");
    path
}

/// The angles as they are, about other axes by the header.
fn told(frames: &[Frame], folder: &Path, order: &str) -> PathBuf {
    bvh(frames, folder, |text| {
        text.replace("Zrotation Xrotation Yrotation", order)
    })
}

/// Markers at joints, by the segment of the recording that begins there.
const MARKERS: [(&str, usize); 18] = [
    ("LHIP", 19),
    ("RHIP", 15),
    ("LKNE", 20),
    ("RKNE", 16),
    ("LANK", 21),
    ("RANK", 17),
    ("LTOE", 22),
    ("RTOE", 18),
    ("LSHO", 12),
    ("RSHO", 8),
    ("LELB", 13),
    ("RELB", 9),
    ("LWRI", 14),
    ("RWRI", 10),
    ("NECK", 5),
    ("HEAD", 6),
    ("CHES", 4),
    ("BACK", 1),
];

fn points_mapping() -> String {
    let mut text = "kind = \"points\"\n[world]\naxes = [\"north\", \"west\", \"up\"]\n[time]\ncolumn = \"Time\"\n\
        [segments.pelvis]\nfrom = [\"LHIP\", \"RHIP\"]\nto = \"BACK\"\nleft = [\"RHIP\", \"LHIP\"]\n\
        [segments.thorax]\nfrom = \"CHES\"\nto = \"NECK\"\nleft = [\"RSHO\", \"LSHO\"]\n"
        .to_owned();
    for (side, letter) in [("l", 'L'), ("r", 'R')] {
        for (segment, from, to) in [
            ("upperarm", "SHO", "ELB"),
            ("forearm", "ELB", "WRI"),
            ("thigh", "HIP", "KNE"),
            ("shank", "KNE", "ANK"),
            ("foot", "ANK", "TOE"),
        ] {
            let _ = write!(
                text,
                "[segments.{side}_{segment}]\nfrom = \"{letter}{from}\"\nto = \"{letter}{to}\"\n"
            );
        }
    }
    text
}

/// The places of all markers in each frame (mm).
fn places(frames: &[Frame]) -> Vec<Vec<[f64; 3]>> {
    let of = |frame: &Frame| {
        let each = MARKERS.map(|(_, segment)| (1000.0 * frame.position[segment]).into());
        each.to_vec()
    };
    frames.iter().map(of).collect()
}

/// A TRC file in millimetres, changed as text.
fn trc(frames: &[Frame], folder: &Path, change: impl Fn(String) -> String) -> PathBuf {
    let count = frames.len();
    let mut text = format!(
        "PathFileType\t4\t(X/Y/Z)\tmotion.trc\nDataRate\tNumFrames\tNumMarkers\tUnits\n120\t{count}\t18\tmm\nFrame#\tTime"
    );
    for (name, _) in MARKERS {
        let _ = write!(text, "\t{name}\t\t");
    }
    text.push_str("\n\t\tX1\tY1\tZ1\n");
    for (index, places) in places(frames).iter().enumerate() {
        let _ = write!(text, "{}\t{:.6}", index + 1, index as f64 / RATE);
        for place in places.iter().flatten() {
            let _ = write!(text, "\t{place:.3}");
        }
        text.push('\n');
    }
    let path = folder.join("motion.trc");
    fs::write(&path, change(text)).expect("written");
    path
}

/// A C3D file in millimetres, changed as bytes.
fn points_in_c3d(frames: &[Frame], folder: &Path, change: impl Fn(&mut [u8])) -> PathBuf {
    let names = MARKERS.map(|(name, _)| name.to_owned());
    let mut bytes = c3d::written(&names, &places(frames), 120.0);
    change(&mut bytes);
    let path = folder.join("motion.c3d");
    fs::write(&path, bytes).expect("written");
    path
}
