//! A source opened with its mapping: each frame as the orientations of the mapped segments and the position of the
//! pelvis.

use std::path::Path;

use bodyflight_core::{Segment, SegmentArray};
use nalgebra::{Matrix3, Vector3};

use crate::mapping::{Kind, Mapping, Rest};
use crate::rest::{LIMBS, lay, out_of_order};
use crate::rows::Rows;
use crate::skeleton::{Skeleton, SourceFrame};
use crate::slip::Slip;
use crate::systems::{self, Content};
use crate::table::Table;
use crate::timing::Timing;
use crate::tree::Tree;
use crate::{bvh, names};
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::file_kind::FileKind;
use bodyflight_io::input;

/// Plausible lengths of a person's thigh (m).
const THIGH: core::ops::Range<f64> = 0.25..0.65;
/// Length of an average person's thigh (m).
const AVERAGE_THIGH: f64 = 0.42;
/// Units of files that do not state theirs (m): metres, centimetres, millimetres, inches, decimetres, feet, and that of
/// the CMU library, which is an inch over 0.45.
const UNITS: [f64; 7] = [1.0, 0.01, 0.001, 0.0254, 0.1, 0.3048, 0.0254 / 0.45];
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
    /// Lengths of the segments (m) that the source has.
    pub lengths_m: SegmentArray<Option<f64>>,
    /// Suspicious findings that do not prevent the import.
    pub warnings: Vec<String>,
    /// What contradicts itself in the file, so that it cannot be trusted.
    pub contradictions: Vec<String>,
    /// Time of its first frame in the file (s).
    pub first_s: f64,
    /// Markers that slipped and stayed there.
    pub slips: Vec<Slip>,
}

enum Motion {
    Joints(Tree, SegmentArray<Option<usize>>),
    Rows(Rows),
}

impl Source {
    /// Opens a file, or a folder of sensors, with a mapping; without one, a file whose system or joint names are known.
    ///
    /// # Errors
    /// Returns an error if the file cannot be used, or does not match the mapping.
    pub fn open(file: &Path, mapping: Option<&Mapping>) -> Result<Self> {
        Self::known(systems::read(file)?, file, mapping)
    }

    /// Same as [`Source::open`], for the bytes of a file that were already read from `file`.
    ///
    /// # Errors
    /// Same as [`Source::open`].
    pub fn parse(bytes: Vec<u8>, file: &Path, mapping: Option<&Mapping>) -> Result<Self> {
        Self::known(systems::parse(bytes, file)?, file, mapping)
    }

    fn known(
        read: core::result::Result<Content, Vec<u8>>,
        file: &Path,
        mapping: Option<&Mapping>,
    ) -> Result<Self> {
        let content = match read {
            Ok(content) => content,
            Err(bytes) => unknown(bytes, file, mapping)?,
        };
        Self::of(content, mapping).map_err(|problem| problem.in_file(file))
    }

    fn of(content: Content, mapping: Option<&Mapping>) -> Result<Self> {
        let own = content.mapping.as_ref();
        let mut source = match (content.motion, mapping.or(own)) {
            (systems::Motion::Joints(tree), None) => {
                let Some(mapping) = names::mapping(&tree) else {
                    return Err(Problem::bad_input(
                        "its joint names are not those of any known skeleton",
                    )
                    .help(format!(
                        "map them with --mapping; the file has {}",
                        joint_names(&tree)
                    )));
                };
                let [misplaced, missing] = names::ends(&tree);
                let mut source = Self::of_tree(tree, &mapping, content.has_lengths)?;
                source.contradictions.extend(misplaced);
                source.warnings.extend(missing);
                source
            }
            (systems::Motion::Joints(tree), Some(mapping)) if mapping.kind == Kind::Bvh => {
                Self::of_tree(tree, mapping, content.has_lengths)?
            }
            (systems::Motion::Table(table), Some(mapping)) if mapping.kind != Kind::Bvh => {
                Self::of_table(table, mapping)?
            }
            (systems::Motion::Joints(tree), Some(_)) => {
                return Err(Problem::bad_input(
                    "the file has joints: expected a mapping with kind = \"bvh\"",
                )
                .help(format!("it has {}", joint_names(&tree))));
            }
            (systems::Motion::Table(_), _) => {
                let message = format!(
                    "this is {}, with columns or points instead of joints",
                    content.kind
                );
                return Err(Problem::bad_input(message)
                    .help("use --mapping to say which of them belongs to which segment: kind = \"points\", \"quaternions\" or \"angles\""));
            }
        };
        source.warnings.splice(0..0, content.warnings);
        Ok(source)
    }

    /// Number of frames.
    pub fn frames(&self) -> usize {
        self.timing.indices.len()
    }

    /// A frame, by its position in [`Timing::indices`].
    ///
    /// # Errors
    /// Returns an error if its numbers do not define rotations.
    pub fn frame(&mut self, place: usize) -> Result<SourceFrame> {
        let frame = match &mut self.motion {
            Motion::Rows(rows) => rows.frame(place)?,
            Motion::Joints(bvh, joints) => {
                let placed = bvh.placed(place);
                let at = |segment: Segment| {
                    let joint = joints[segment].and_then(|joint| placed.get(joint));
                    joint.map_or_else(Vector3::zeros, |joint| joint.position)
                };
                let middle = (at(Segment::LeftThigh) + at(Segment::RightThigh)) * 0.5;
                SourceFrame {
                    world_from_segment: joints.map(|_, joint| {
                        joint
                            .and_then(|joint| placed.get(joint))
                            .map_or_else(Matrix3::identity, |joint| joint.orientation)
                    }),
                    position: Some(middle * self.unit_m),
                }
            }
        };
        let Some(what) = frame.too_large() else {
            return Ok(frame);
        };
        let message =
            format!("expected numbers of a person, found {what} too large to compute with");
        let problem = Problem::bad_input(message);
        Err(match &self.motion {
            Motion::Rows(rows) => problem.at_line(rows.line(place)),
            Motion::Joints(..) => problem.at(format!("frame {place}")),
        })
    }

    fn of_tree(mut bvh: Tree, mapping: &Mapping, has_lengths: bool) -> Result<Self> {
        if let Some(rate) = mapping.time.rate_hz {
            bvh.rate = rate;
        }
        let starts_at_rest = bvh.starts_at_rest();
        if starts_at_rest {
            bvh.drop_first();
        }
        let mut joints = SegmentArray::from_fn(|_| None);
        for (segment, joint) in joints.iter_mut() {
            let named = mapping.segments.get(segment.name());
            let Some(name) = named.and_then(|row| row.joint.as_deref()) else {
                continue;
            };
            let in_place = |message: String| {
                Problem::bad_input(message).at(format!("segments.{}", segment.name()))
            };
            *joint = Some(bvh.joint(name).ok_or_else(|| {
                in_place(format!("the file has no joint \"{name}\""))
                    .help(format!("it has {}", joint_names(&bvh)))
            })?);
            if bvh.joints.iter().filter(|other| other.name == name).count() > 1 {
                return Err(in_place(format!("several joints are called \"{name}\""))
                    .help("give each joint of the file a name of its own"));
            }
        }
        let mut skeleton = Skeleton::new(mapping)?;
        let bones = mapping.body.rest.is_none_or(|rest| rest == Rest::Bones);
        let mut warnings = lay(&mut skeleton, &bvh, &joints, bones)?;
        if starts_at_rest {
            warnings.push(
                "frame 0 is a rest posture from which the motion jumps: it was left out".to_owned(),
            );
        }
        let contradictions = out_of_order(&bvh, &joints);
        let lengths = bone_lengths(&bvh, &joints);
        let thigh = lengths[Segment::LeftThigh].unwrap_or(0.0);
        let unit_m = match mapping.world.unit_m {
            Some(unit_m) if !has_lengths => unit_m,
            said => unit(thigh, said, None, &mut warnings)?,
        };
        let lengths_m =
            lengths.map(|_, length| length.filter(|_| has_lengths).map(|own| own * unit_m));
        let timing = Timing {
            rate: bvh.rate,
            indices: (0..bvh.frames() as u64).collect(),
        };
        Ok(Self {
            names: joints.map(|_, joint| Some(bvh.joints.get((*joint)?)?.name.clone())),
            motion: Motion::Joints(bvh, joints),
            skeleton,
            timing,
            unit_m,
            skipped: 0,
            lengths_m,
            warnings,
            contradictions,
            first_s: 0.0,
            slips: Vec::new(),
        })
    }

    fn of_table(table: Table, mapping: &Mapping) -> Result<Self> {
        let mut warnings = table.angle_warnings(mapping);
        let said = mapping.world.unit_m.or(table.unit_m);
        let unit_name = table.unit_name.clone();
        let skeleton = Skeleton::new(mapping)?;
        if table.lacks_rate(mapping) {
            return Err(Problem::bad_input("the file states no frame rate")
                .at("time")
                .help("give it in the mapping: rate_hz under [time], in place of column"));
        }
        let header = table.header.clone();
        let [few, more] = header.other_frames(table.rows() as u64);
        let (rows, timing, skipped) =
            Rows::open(table, mapping, |thigh| match (said, thigh, &unit_name) {
                (Some(unit), _, _) => Ok(unit),
                (None, Some(thigh), Some(name)) => unit(thigh, None, Some(name), &mut warnings),
                (None, None, Some(name)) => {
                    let message = format!("expected a unit of mm, cm, m, in or ft, found {name}");
                    Err(Problem::bad_input(message)
                        .help("give the length of one unit in the mapping: [world] unit_m"))
                }
                (None, Some(thigh), None) if !THIGH.contains(&thigh) => {
                    unit(thigh, None, None, &mut warnings)
                }
                (None, _, None) => Ok(1.0),
            })?;
        warnings.extend(rows.faults.iter().map(ToString::to_string));
        warnings.extend(more);
        warnings.extend(rows.alike.remarks.iter().cloned());
        // Who gives the rate has decided.
        let other_rate = (mapping.time.rate_hz.is_none())
            .then(|| header.other_rate(timing.rate))
            .flatten();
        let of_file = header.contradictions.iter();
        let contradictions = (other_rate.into_iter().chain(few))
            .chain(of_file.chain(&rows.alike.contradictions).cloned())
            .collect();
        let (slips, first_s) = (rows.slips.clone(), rows.first_s());
        let (unit_m, lengths_m) = (rows.unit_m(), *rows.lengths_m);
        if let Some(thigh) = lengths_m[Segment::LeftThigh]
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
            lengths_m,
            warnings,
            contradictions,
            first_s,
            slips,
        })
    }
}

/// A file that no system claims: BVH, or a table if the mapping says so.
fn unknown(bytes: Vec<u8>, file: &Path, mapping: Option<&Mapping>) -> Result<Content> {
    let in_file = |problem: Problem| problem.in_file(file);
    if mapping.is_none() {
        let found = FileKind::of_head(&bytes);
        let other = [
            FileKind::Track,
            FileKind::Inputs,
            FileKind::Text,
            FileKind::Json,
        ];
        let found = found.filter(|found| other.contains(found));
        if let Some(problem) = FileKind::Motion.mistaken(found) {
            return Err(in_file(problem));
        }
    }
    let motion = if mapping.is_none_or(|mapping| mapping.kind == Kind::Bvh) {
        systems::Motion::Joints(bvh::parse(&bytes).map_err(in_file)?)
    } else {
        systems::Motion::Table(Table::parse(&input::utf_8(bytes, file)?).map_err(in_file)?)
    };
    Ok(Content {
        kind: "a table",
        motion,
        mapping: None,
        warnings: Vec::new(),
        has_lengths: true,
    })
}

fn joint_names(bvh: &Tree) -> String {
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

/// Lengths of the limbs' bones (units of the file).
fn bone_lengths(bvh: &Tree, joints: &SegmentArray<Option<usize>>) -> SegmentArray<Option<f64>> {
    let rest = bvh.at_rest();
    let place = |segment: Segment| Some(rest.get(joints[segment]?)?.position);
    let mut lengths = SegmentArray::from_fn(|_| None);
    for (segment, next) in LIMBS {
        let ends = place(segment).zip(place(next));
        lengths[segment] = ends.map(|(from, to)| (to - from).norm());
    }
    lengths
}

/// Length of one unit (m), as said or guessed from the length of a thigh in that unit.
///
/// `name` is that of a unit which the file states and nobody knows.
fn unit(
    thigh: f64,
    said: Option<f64>,
    name: Option<&str>,
    warnings: &mut Vec<String>,
) -> Result<f64> {
    if let Some(unit) = said {
        return (THIGH.contains(&(thigh * unit)))
            .then_some(unit)
            .ok_or_else(|| no_thigh(thigh * unit));
    }
    // The unit whose thigh is nearest to that of an average person.
    let off = |unit: &f64| (thigh * unit / AVERAGE_THIGH).ln().abs();
    let fits = UNITS
        .iter()
        .filter(|unit| THIGH.contains(&(thigh * **unit)));
    let known = fits.min_by(|a, b| off(a).total_cmp(&off(b))).copied();
    let unit = match known {
        Some(unit) => unit,
        None if thigh > 0.0 && thigh.is_finite() => AVERAGE_THIGH / thigh,
        None => return Err(no_thigh(thigh)),
    };
    let states = match name.filter(|name| !["none", ""].contains(name)) {
        Some(name) => format!("the file's unit of length, \"{name}\", is not known"),
        None => "the file states no unit".to_owned(),
    };
    warnings.push(format!(
        "{states}: one unit is taken as {unit:.6} m{}, which makes the thigh {:.3} m long; unit_m in a mapping says it otherwise",
        if known.is_some() { "" } else { ", as no common unit fits" },
        thigh * unit
    ));
    Ok(unit)
}
