//! A flight as an MCAP file: a moving body, and topics for all the numbers.
//!
//! | topic | schema | rate |
//! |---|---|---|
//! | `/tf` | `foxglove.FrameTransforms`: every segment of both bodies in `world` (north, west, up) | every frame |
//! | `/body` | `foxglove.SceneUpdate`: the solids of both bodies, each in the frame of its segment | once |
//! | `/forces` | `foxglove.SceneUpdate`: the aerodynamic force on each segment as an arrow, 1 m per 100 N | 30 Hz |
//! | `/simulated/pose`, `/measured/pose` | `foxglove.PoseInFrame`: the pose of the pelvis | every frame |
//! | `/flight` | `bodyflight.Body`: all numbers of the body, by column name | every frame |
//! | `/segments` | `bodyflight.Segments`: all numbers of each segment that are not in `/tf` | every frame |

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use bodyflight_core::Segment;
use mcap::records::MessageHeader;
use mcap::{McapError, WriteOptions, Writer};
use serde::Serialize;

use super::messages::{
    Arrow, Color, FrameTransform, FrameTransforms, Number, Pose, PoseInFrame, Quaternion,
    SceneEntity, SceneUpdate, Sphere, Time,
};
use super::schemas::{self, Schema};
use crate::columns::quantity::{Of, Quantity, Sink};
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::files::AtomicFile;
use nalgebra::{UnitQuaternion, Vector3};

/// The two bodies, by the prefix of their quantities, with their colours.
const SIDES: [(&str, Color); 2] = [
    ("simulated", color(0.85, 0.45, 0.15, 1.0)),
    ("measured", color(0.35, 0.5, 0.75, 0.4)),
];
/// Colour of the arrows.
const FORCE: Color = color(0.2, 0.7, 0.3, 0.9);
/// Length of an arrow (m/N).
const ARROW_SCALE: f64 = 0.01;
/// Arrow updates per second (Hz): no more than the eye can follow.
const ARROW_RATE: f64 = 30.0;
/// Name of the world frame.
const WORLD: &str = "world";

const fn color(r: f64, g: f64, b: f64, a: f64) -> Color {
    Color { r, g, b, a }
}

/// The ellipsoid that is drawn for a segment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Solid {
    /// Half extents along the axes of the segment (m).
    pub half_extents: [f64; 3],
    /// Its centre relative to the joint, in the same axes (m).
    pub middle: [f64; 3],
}

/// A channel with the sequence number of its next message.
struct Channel {
    id: u16,
    sequence: u32,
}

/// The columns in a row that hold the segment poses of one body.
struct Side {
    name: &'static str,
    frames: Vec<String>,
    position: usize,
    attitude: usize,
}

/// A file being written.
pub struct McapRecording {
    writer: Writer<AtomicFile>,
    path: PathBuf,
    quantities: Vec<Quantity>,
    solids: Vec<Solid>,
    sides: Vec<Side>,
    time: usize,
    forces: usize,
    centres: usize,
    transforms: Channel,
    body: Channel,
    arrows: Channel,
    poses: Vec<Channel>,
    flight: Channel,
    segments: Channel,
    arrows_due: f64,
}

/// The first column of a quantity in a row.
fn place(quantities: &[Quantity], of: Of, name: &str) -> Result<usize> {
    let mut from = 0;
    for quantity in quantities {
        if quantity.of == of && quantity.name == name {
            return Ok(from);
        }
        from += quantity.width();
    }
    Err(Problem::internal(format!("there is no quantity {name}")))
}

/// `N` numbers of a row, starting at `from`; NaN past its end.
fn taken<const N: usize>(row: &[f64], from: usize) -> [f64; N] {
    core::array::from_fn(|k| row.get(from + k).copied().unwrap_or(f64::NAN))
}

/// Whether `/tf` already contains the quantity.
fn is_pose(quantity: &Quantity) -> bool {
    SIDES.iter().any(|(side, _)| {
        ["position", "attitude"]
            .iter()
            .any(|what| quantity.name == format!("{side}_{what}"))
    })
}

impl McapRecording {
    /// Creates the file; `solids` are in segment order.
    ///
    /// # Errors
    /// Returns an error if the folder cannot be written to.
    pub fn create(path: &Path, quantities: Vec<Quantity>, solids: Vec<Solid>) -> Result<Self> {
        let refused = |error| refused(path, error);
        let options = WriteOptions::new()
            .compression(None)
            .library(concat!("bodyflight ", env!("CARGO_PKG_VERSION")));
        let file = AtomicFile::create(path)?;
        let mut writer = options.create(file).map_err(refused)?;
        let mut channel = |topic: &str, schema: &Schema| -> Result<Channel> {
            let text = schema.schema.to_string();
            let schema = writer.add_schema(schema.name, "jsonschema", text.as_bytes());
            let about = BTreeMap::new();
            let id = writer
                .add_channel(schema.map_err(refused)?, topic, "json", &about)
                .map_err(refused)?;
            Ok(Channel { id, sequence: 0 })
        };
        let (scene, pose) = (schemas::scene_update(), schemas::pose_in_frame());
        let listed: Vec<&Quantity> = quantities
            .iter()
            .filter(|quantity| quantity.of == Of::Segments && !is_pose(quantity))
            .collect();
        let transforms = channel("/tf", &schemas::frame_transforms())?;
        let body = channel("/body", &scene)?;
        let arrows = channel("/forces", &scene)?;
        let poses = SIDES.map(|(side, _)| channel(&format!("/{side}/pose"), &pose));
        let poses = poses.into_iter().collect::<Result<_>>()?;
        let flight = channel("/flight", &schemas::of_body(&quantities))?;
        let segments = channel("/segments", &schemas::of_segments(&listed))?;
        let side = |(name, _): (&'static str, Color)| {
            let place = |what: &str| place(&quantities, Of::Segments, &format!("{name}_{what}"));
            Ok(Side {
                name,
                frames: Segment::ALL
                    .map(|segment| format!("{name}/{}", segment.name()))
                    .to_vec(),
                position: place("position")?,
                attitude: place("attitude")?,
            })
        };
        Ok(Self {
            sides: SIDES.into_iter().map(side).collect::<Result<_>>()?,
            time: place(&quantities, Of::Body, "time")?,
            forces: place(&quantities, Of::Segments, "force")?,
            centres: place(&quantities, Of::Segments, "cg")?,
            writer,
            path: path.to_path_buf(),
            quantities,
            solids,
            transforms,
            body,
            arrows,
            poses,
            flight,
            segments,
            arrows_due: f64::NEG_INFINITY,
        })
    }

    /// Pose of a segment of one body.
    fn pose(side: &Side, row: &[f64], segment: usize) -> Pose {
        Pose {
            position: taken::<3>(row, side.position + 3 * segment).into(),
            orientation: Quaternion::from_wxyz(taken(row, side.attitude + 4 * segment)),
        }
    }

    fn write_transforms(&mut self, row: &[f64], time: Time) -> Result<()> {
        let transforms = self.sides.iter().flat_map(|side| {
            side.frames.iter().enumerate().map(move |(segment, frame)| {
                let pose = Self::pose(side, row, segment);
                FrameTransform {
                    timestamp: time,
                    parent_frame_id: WORLD,
                    child_frame_id: frame,
                    translation: pose.position,
                    rotation: pose.orientation,
                }
            })
        });
        let message = FrameTransforms {
            transforms: transforms.collect(),
        };
        put(
            &mut self.writer,
            &self.path,
            &mut self.transforms,
            time,
            &message,
        )?;
        for (side, channel) in self.sides.iter().zip(&mut self.poses) {
            let message = PoseInFrame {
                timestamp: time,
                frame_id: WORLD,
                pose: Self::pose(side, row, 0),
            };
            put(&mut self.writer, &self.path, channel, time, &message)?;
        }
        Ok(())
    }

    /// Writes the solids once: they move with the frames of their segments.
    fn write_body(&mut self, time: Time) -> Result<()> {
        let entities = self.sides.iter().zip(SIDES).flat_map(|(side, (_, color))| {
            let solids = side.frames.iter().zip(&self.solids);
            solids.map(move |(frame, solid)| {
                let sphere = Sphere {
                    pose: Pose {
                        position: solid.middle.into(),
                        orientation: Quaternion::IDENTITY,
                    },
                    size: solid.half_extents.map(|half| 2.0 * half).into(),
                    color,
                };
                SceneEntity {
                    spheres: vec![sphere],
                    ..SceneEntity::new(time, frame.clone(), frame.clone())
                }
            })
        });
        let message = SceneUpdate {
            deletions: [],
            entities: entities.collect(),
        };
        put(&mut self.writer, &self.path, &mut self.body, time, &message)
    }

    fn write_arrows(&mut self, row: &[f64], time: Time) -> Result<()> {
        // Loads are in body axes, which are those of the pelvis.
        let Some((side, frame)) = self
            .sides
            .first()
            .and_then(|side| Some((side, side.frames.first()?)))
        else {
            return Ok(());
        };
        let arrows = (0..Segment::ALL.len()).map(|segment| {
            let force = Vector3::from(taken::<3>(row, self.forces + 3 * segment));
            let turn = UnitQuaternion::rotation_between(&Vector3::x(), &force)
                .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::y_axis(), 0.0));
            let length = ARROW_SCALE * force.norm();
            Arrow {
                pose: Pose {
                    position: taken::<3>(row, self.centres + 3 * segment).into(),
                    orientation: Quaternion::from_wxyz([turn.w, turn.i, turn.j, turn.k]),
                },
                shaft_length: length,
                shaft_diameter: 0.015,
                head_length: 0.04,
                head_diameter: 0.04,
                color: FORCE,
            }
        });
        let entity = SceneEntity {
            arrows: arrows.collect(),
            ..SceneEntity::new(time, frame.clone(), format!("{}/forces", side.name))
        };
        let message = SceneUpdate {
            deletions: [],
            entities: vec![entity],
        };
        put(
            &mut self.writer,
            &self.path,
            &mut self.arrows,
            time,
            &message,
        )
    }

    fn write_numbers(&mut self, row: &[f64], time: Time) -> Result<()> {
        let mut of_body = BTreeMap::new();
        let mut of_segments: BTreeMap<&str, BTreeMap<String, Number>> = BTreeMap::new();
        let mut numbers = row.iter().copied().map(Number);
        for quantity in &self.quantities {
            let tails = quantity.tails();
            if quantity.of == Of::Body {
                of_body.extend(tails.into_iter().zip(&mut numbers));
                continue;
            }
            let is_listed = !is_pose(quantity);
            for segment in Segment::ALL {
                let own = tails.iter().cloned().zip(&mut numbers);
                if is_listed {
                    of_segments.entry(segment.name()).or_default().extend(own);
                } else {
                    own.for_each(drop);
                }
            }
        }
        put(
            &mut self.writer,
            &self.path,
            &mut self.flight,
            time,
            &of_body,
        )?;
        put(
            &mut self.writer,
            &self.path,
            &mut self.segments,
            time,
            &of_segments,
        )
    }
}

/// Writes a message.
fn put(
    writer: &mut Writer<AtomicFile>,
    path: &Path,
    channel: &mut Channel,
    time: Time,
    message: &impl Serialize,
) -> Result<()> {
    let bytes = serde_json::to_vec(message)
        .map_err(|error| Problem::internal("cannot write JSON").caused_by(error))?;
    let header = MessageHeader {
        channel_id: channel.id,
        sequence: channel.sequence,
        log_time: time.nanoseconds(),
        publish_time: time.nanoseconds(),
    };
    channel.sequence = channel.sequence.wrapping_add(1);
    writer
        .write_to_known_channel(&header, &bytes)
        .map_err(|error| refused(path, error))
}

fn refused(path: &Path, error: McapError) -> Problem {
    Problem::refused("cannot write the recording")
        .in_file(path)
        .caused_by(error)
}

impl Sink for McapRecording {
    fn write(&mut self, row: &[f64]) -> Result<()> {
        let seconds = row.get(self.time).copied().unwrap_or(0.0);
        let time = Time::of(seconds);
        self.write_transforms(row, time)?;
        if self.body.sequence == 0 {
            self.write_body(time)?;
        }
        // A millisecond of tolerance: the frame rate need not be a multiple of the arrows' rate.
        if seconds >= self.arrows_due - 1e-3 {
            self.arrows_due = (self.arrows_due + 1.0 / ARROW_RATE).max(seconds);
            self.write_arrows(row, time)?;
        }
        self.write_numbers(row, time)
    }

    fn finish(mut self: Box<Self>) -> Result<()> {
        self.writer
            .finish()
            .map_err(|error| refused(&self.path, error))?;
        let Self { writer, .. } = *self;
        writer.into_inner().finish()
    }
}
