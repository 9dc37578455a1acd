//! The known flight as points, in the formats of several laboratories.

use std::fmt::Write;
use std::path::Path;

use bodyflight_core::Segment;
use bodyflight_core::body::posture::pose;
use bodyflight_replay::subject::Subject;
use bodyflight_tests::program::written;
use nalgebra::Vector3;

use crate::known::known;

/// Names of the points at both ends of each segment and of one to its left, and their positions in each frame (mm).
pub(crate) fn points() -> (Vec<String>, Vec<Vec<[f64; 3]>>) {
    let names = Segment::ALL.into_iter().flat_map(|segment| {
        ["from", "to", "left"].map(|point| format!("{}.{point}", segment.name()))
    });
    let body = Subject::default().body();
    let frames = known().into_iter().map(|frame| {
        let posed = pose(&body, &frame.posture);
        let attitude = *frame.pelvis.inertial_from_body.quaternion();
        let of = |segment: Segment| {
            let to = match segment {
                Segment::Pelvis | Segment::Abdomen | Segment::Thorax | Segment::Head => {
                    Vector3::z()
                }
                Segment::LeftFoot | Segment::RightFoot => -Vector3::y(),
                _ => -Vector3::z(),
            };
            // The position of the left point along the segment does not matter.
            let left = Vector3::x() * 0.1 + to * 0.03;
            [Vector3::zeros(), to * 0.4, left].map(|way| {
                let in_body = posed[segment].joint + posed[segment].body_from_segment * way;
                let place = frame.pelvis.position.components + attitude * in_body;
                (place * 1000.0).into()
            })
        };
        Segment::ALL.into_iter().flat_map(of).collect()
    });
    (names.collect(), frames.collect())
}

/// The points as Vicon Nexus exports them.
pub(crate) fn nexus(names: &[String], frames: &[Vec<[f64; 3]>]) -> String {
    let mut text = "Trajectories\n200\n,".to_owned();
    for name in names {
        let _ = write!(text, ",Athlete:{name},,");
    }
    let each = |cell: &str| cell.repeat(3 * names.len());
    let axes = ",X,Y,Z".repeat(names.len());
    let _ = writeln!(text, "\nFrame,Sub Frame{axes}\n,{}", each(",mm"));
    for (k, frame) in frames.iter().enumerate() {
        let _ = write!(text, "{},0", 101 + k);
        for [x, y, z] in frame {
            let _ = write!(text, ",{x:.3},{y:.3},{z:.3}");
        }
        text.push('\n');
    }
    text
}

/// The points as a TRC file.
pub(crate) fn trc(names: &[String], frames: &[Vec<[f64; 3]>]) -> String {
    let mut table = format!(
        "PathFileType\t4\t(X/Y/Z)\tjump.trc\nDataRate\tNumFrames\tNumMarkers\tUnits\n200\t{}\t{}\tmm\nFrame#\tTime",
        frames.len(),
        names.len()
    );
    for name in names {
        let _ = write!(table, "\t{name}\t\t");
    }
    table.push_str("\n\t\tX1\tY1\tZ1\n");
    for (k, frame) in frames.iter().enumerate() {
        let _ = write!(table, "{}\t{:.3}", k + 1, k as f64 * 0.005);
        for [x, y, z] in frame {
            let _ = write!(table, "\t{x:.2}\t{y:.2}\t{z:.2}");
        }
        table.push('\n');
    }
    table
}

/// Writes the mapping of the points.
pub(crate) fn points_mapping(folder: &Path) -> String {
    let mut map = "kind = \"points\"\n[world]\naxes = [\"north\", \"west\", \"up\"]\n[time]\ncolumn = \"Time\"\n".to_owned();
    for segment in Segment::ALL {
        let name = segment.name();
        let _ = write!(
            map,
            "[segments.{name}]\nfrom = \"{name}.from\"\nto = [\"{name}.to\"]\n"
        );
        let _ = writeln!(map, "left = [\"{name}.from\", \"{name}.left\"]");
    }
    written(folder, "points.toml", &map)
}
