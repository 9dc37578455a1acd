//! A source opened with its mapping: each frame as the orientations of the mapped segments and the position of the
//! pelvis.

use std::path::Path;

use bodyflight_core::{Segment, SegmentArray};
use nalgebra::{Matrix3, Vector3};

use super::bvh::Bvh;
use super::mapping::{Kind, Mapping, Rest};
use super::names;
use super::rows::Rows;
use super::skeleton::{Skeleton, SourceFrame};
use super::table::Table;
use super::timing::{self, Timing};
use crate::diagnostic::{Problem, Result};

/// Plausible lengths of a person's thigh (m).
const THIGH: core::ops::Range<f64> = 0.25..0.65;
/// Units used in BVH files (m): the files do not state theirs.
const UNITS: [f64; 4] = [1.0, 0.01, 0.0254, 0.001];
/// Largest angle between the trunk of a rest posture and the vertical, and between the hips and the left direction
/// (rad).
const TRUNK: f64 = 0.6;
const HIPS: f64 = 0.8;
/// Angle between a limb and its direction in the rest posture (rad) above which the import warns.
const LIMB: f64 = 0.5;

/// Limbs whose direction is given by their bones, with the segment whose joint is at the far end.
const LIMBS: [(Segment, Segment); 8] = [
    (Segment::LeftUpperArm, Segment::LeftForearm),
    (Segment::LeftForearm, Segment::LeftHand),
    (Segment::RightUpperArm, Segment::RightForearm),
    (Segment::RightForearm, Segment::RightHand),
    (Segment::LeftThigh, Segment::LeftShank),
    (Segment::LeftShank, Segment::LeftFoot),
    (Segment::RightThigh, Segment::RightShank),
    (Segment::RightShank, Segment::RightFoot),
];

/// An open source.
pub struct Source {
    motion: Motion,
    /// Conversion of segment rotations.
    pub skeleton: Skeleton,
    /// Rate and indices of its frames.
    pub timing: Timing,
    /// Name of each segment in the source, `None` if it has none.
    pub names: SegmentArray<Option<String>>,
    /// Length of one unit (m).
    pub unit_m: f64,
    /// Rows that were skipped because of an empty cell.
    pub skipped: usize,
    /// Length of a thigh (m), if the source has it.
    pub thigh_m: Option<f64>,
    /// Suspicious findings that do not prevent the import.
    pub warnings: Vec<String>,
}

enum Motion {
    Joints(Bvh, SegmentArray<Option<usize>>),
    Rows(Rows),
}

impl Source {
    /// Opens a file with a mapping; without one, a BVH file with known joint names.
    ///
    /// # Errors
    /// Returns an error if the file cannot be used, or does not match the mapping.
    pub fn open(file: &Path, mapping: Option<&Mapping>) -> Result<Self> {
        match mapping {
            None => {
                let bvh = Bvh::read(file)?;
                let Some(mapping) = names::mapping(&bvh) else {
                    return Err(Problem::bad_input(
                        "its joint names are not those of any known skeleton",
                    )
                    .in_file(file)
                    .help(format!(
                        "map them with --mapping; the file has {}",
                        joint_names(&bvh)
                    )));
                };
                Self::of_bvh(bvh, &mapping).map_err(|problem| problem.in_file(file))
            }
            Some(mapping) if mapping.kind == Kind::Bvh => {
                Self::of_bvh(Bvh::read(file)?, mapping).map_err(|problem| problem.in_file(file))
            }
            Some(mapping) => {
                Self::of_table(Table::read(file)?, mapping).map_err(|problem| problem.in_file(file))
            }
        }
    }

    /// Number of frames.
    pub fn frames(&self) -> usize {
        self.timing.indices.len()
    }

    /// A frame, by its position in [`Timing::indices`].
    ///
    /// # Errors
    /// Returns an error if its numbers do not define rotations.
    pub fn frame(&self, place: usize) -> Result<SourceFrame> {
        match &self.motion {
            Motion::Rows(rows) => rows.frame(place, self.unit_m),
            Motion::Joints(bvh, joints) => {
                let placed = bvh.placed(place);
                let at = |segment: Segment| {
                    let joint = joints[segment].and_then(|joint| placed.get(joint));
                    joint.map_or_else(Vector3::zeros, |joint| joint.position)
                };
                let middle = (at(Segment::LeftThigh) + at(Segment::RightThigh)) * 0.5;
                Ok(SourceFrame {
                    world_from_segment: joints.map(|_, joint| {
                        joint
                            .and_then(|joint| placed.get(joint))
                            .map_or_else(Matrix3::identity, |joint| joint.orientation)
                    }),
                    position: Some(middle * self.unit_m),
                })
            }
        }
    }

    fn of_bvh(bvh: Bvh, mapping: &Mapping) -> Result<Self> {
        let mut joints = SegmentArray::from_fn(|_| None);
        for (segment, joint) in joints.iter_mut() {
            let named = mapping.segments.get(segment.name());
            let Some(name) = named.and_then(|row| row.joint.as_deref()) else {
                continue;
            };
            *joint = Some(bvh.joint(name).ok_or_else(|| {
                Problem::bad_input(format!("the file has no joint \"{name}\""))
                    .at(format!("segments.{}", segment.name()))
                    .help(format!("it has {}", joint_names(&bvh)))
            })?);
        }
        let mut skeleton = Skeleton::new(mapping)?;
        let bones = mapping.body.rest.is_none_or(|rest| rest == Rest::Bones);
        let warnings = lay(&mut skeleton, &bvh, &joints, bones)?;
        let (unit_m, thigh) = unit(&bvh, &joints, mapping.world.unit_m)?;
        let timing = Timing {
            rate: timing::whole_rate(1.0 / bvh.frame_time),
            indices: (0..bvh.frames() as u64).collect(),
        };
        Ok(Self {
            names: joints.map(|_, joint| Some(bvh.joints.get((*joint)?)?.name.clone())),
            motion: Motion::Joints(bvh, joints),
            skeleton,
            timing,
            unit_m,
            skipped: 0,
            thigh_m: Some(thigh),
            warnings,
        })
    }

    fn of_table(table: Table, mapping: &Mapping) -> Result<Self> {
        let unit_m = mapping.world.unit_m.or(table.unit_m).unwrap_or(1.0);
        let skeleton = Skeleton::new(mapping)?;
        let (rows, timing, skipped) = Rows::open(table, mapping)?;
        let thigh_m = rows.thigh(unit_m);
        if let Some(thigh) = thigh_m
            && !THIGH.contains(&thigh)
        {
            return Err(no_thigh(thigh));
        }
        Ok(Self {
            names: SegmentArray::from_fn(|segment| rows.name(segment)),
            motion: Motion::Rows(rows),
            skeleton,
            timing,
            unit_m,
            skipped,
            thigh_m,
            warnings: Vec::new(),
        })
    }
}

fn joint_names(bvh: &Bvh) -> String {
    let names: Vec<&str> = bvh.joints.iter().map(|joint| joint.name.as_str()).collect();
    names.join(", ")
}

fn no_thigh(thigh: f64) -> Problem {
    let message = format!(
        "expected a thigh of {} to {} m, found one of {thigh:.3} m",
        THIGH.start, THIGH.end
    );
    Problem::bad_input(message).at("world.unit_m").help(
        "give the length of one unit of the file: 0.01 for centimetres, 0.001 for millimetres",
    )
}

/// Length of one unit and of a thigh (m).
fn unit(bvh: &Bvh, joints: &SegmentArray<Option<usize>>, said: Option<f64>) -> Result<(f64, f64)> {
    let rest = bvh.at_rest();
    let place = |segment: Segment| Some(rest.get(joints[segment]?)?.position);
    let thigh = place(Segment::LeftThigh)
        .zip(place(Segment::LeftShank))
        .map_or(0.0, |(hip, knee)| (knee - hip).norm());
    let candidates = said
        .as_ref()
        .map_or(UNITS.as_slice(), core::slice::from_ref);
    let unit = candidates
        .iter()
        .find(|unit| THIGH.contains(&(thigh * **unit)));
    let unit = unit.ok_or_else(|| no_thigh(thigh * said.unwrap_or(1.0)))?;
    Ok((*unit, thigh * unit))
}

/// Checks the rest posture of a file against the mapping, and aligns limbs with their bones if `bones` is set.
fn lay(
    skeleton: &mut Skeleton,
    bvh: &Bvh,
    joints: &SegmentArray<Option<usize>>,
    bones: bool,
) -> Result<Vec<String>> {
    let rest = bvh.at_rest();
    let place = |segment: Segment| Some(rest.get(joints[segment]?)?.position);
    let middle = |left, right| Some((place(left)? + place(right)?) * 0.5);
    let way = |from: Option<Vector3<f64>>, to: Option<Vector3<f64>>| Some(to? - from?);
    let hips = middle(Segment::LeftThigh, Segment::RightThigh);
    let shoulders = middle(Segment::LeftUpperArm, Segment::RightUpperArm);
    let checks = [
        (
            "the shoulders are not above the hips",
            way(hips, shoulders),
            Vector3::z(),
            TRUNK,
        ),
        (
            "the left hip is not left of the right one",
            way(place(Segment::RightThigh), place(Segment::LeftThigh)),
            Vector3::x(),
            HIPS,
        ),
    ];
    for (what, way, expected, most) in checks {
        let (Some(way), Some(found)) = (way, way.and_then(|way| skeleton.in_body(&way))) else {
            continue;
        };
        if found.angle(&expected) > most {
            let [x, y, z]: [f64; 3] = way.normalize().into();
            let message = format!(
                "with all rotations zero, {what}, but at {x:.2}, {y:.2}, {z:.2} from there in the file's axes"
            );
            return Err(Problem::bad_input(message).at("body, axes").help(
                "use a mapping to say where the axes of the file point: [world] axes and [body] axes",
            ));
        }
    }
    let mut warnings = Vec::new();
    for (segment, next) in LIMBS {
        let Some(along) = way(place(segment), place(next)).filter(|way| way.norm() > 0.0) else {
            continue;
        };
        if bones {
            skeleton.align(segment, &along);
        } else if let Some(angle) = skeleton.angle_to(segment, &along)
            && angle > LIMB
        {
            warnings.push(format!(
                "{}: its bone is {:.0} degrees off the rest posture; rest = \"bones\" aligns the segment with its bone",
                segment.name(),
                angle.to_degrees()
            ));
        }
    }
    if bones {
        for (end, arm) in [
            (Segment::LeftHand, Segment::LeftForearm),
            (Segment::RightHand, Segment::RightForearm),
        ] {
            skeleton.follow(end, arm);
        }
    }
    Ok(warnings)
}
