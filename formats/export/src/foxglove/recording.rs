//! A flight as an MCAP file: a moving body, and topics for all the numbers.
//!
//! | topic | schema | rate |
//! |---|---|---|
//! | `/tf` | `foxglove.FrameTransforms`: every segment of both bodies in its parent, the pelvis in `world` (north, west, up) | 60 Hz |
//! | `/simulated/pose`, `/measured/pose` | `foxglove.PoseInFrame`: the pose of the pelvis | 60 Hz |
//! | `/body` | `foxglove.SceneUpdate`: the solids of both bodies, each in the frame of its segment | once |
//! | `/forces` | `foxglove.SceneUpdate`: the aerodynamic force on each segment as an arrow, 1 m per 100 N | 30 Hz |
//! | `/flight` | `bodyflight.Body`: all numbers of the body, by column name; times and places in 64 bits, others in 32 | every frame |
//! | `/segments` | `bodyflight.Segments`: all numbers of each segment that are not poses, in 32 bits | every frame |
//!
//! What is drawn comes at the rate of a screen: the last digits of numbers are noise, which no compression makes smaller.

use std::path::{Path, PathBuf};
use std::time::Duration;

use bodyflight_core::Segment;

use super::messages::{
    Arrow, Color, Encode, FrameTransform, FrameTransforms, Pose, PoseInFrame, Quaternion,
    SceneEntity, SceneUpdate, Sphere, Vector3,
};
use super::schemas;
use crate::about::{About, PROGRAM};
use crate::columns::quantity::{Of, Quantity, Sink};
use crate::mcap::{ChannelId, McapFile};
use crate::protobuf::Message;
use crate::protobuf::descriptor::Kind;
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::files::AtomicFile;
use nalgebra::UnitQuaternion;

/// The two bodies, by the prefix of their quantities, with their colours.
const SIDES: [(&str, Color); 2] = [
    ("simulated", Color([0.85, 0.45, 0.15, 1.0])),
    ("measured", Color([0.35, 0.5, 0.75, 0.4])),
];
/// Colour of the arrows.
const FORCE: Color = Color([0.2, 0.7, 0.3, 0.9]);
/// Length of an arrow (m/N).
const ARROW_SCALE: f64 = 0.01;
/// Poses per second (Hz), as a screen shows them.
const POSE_RATE: f64 = 60.0;
/// Arrow updates per second (Hz): no more than the eye can follow.
const ARROW_RATE: f64 = 30.0;
/// Name of the world frame.
const WORLD: &str = "world";
/// Name of the metadata record.
const METADATA: &str = "bodyflight";

/// The ellipsoid that is drawn for a segment, and where the segment is in its parent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Solid {
    /// Half extents along the axes of the segment (m).
    pub half_extents: [f64; 3],
    /// Its centre relative to the joint, in the same axes (m).
    pub middle: [f64; 3],
    /// The joint in the axes of the parent (m).
    pub joint_offset: [f64; 3],
}

/// The columns in a row that hold one body's motion.
struct Side {
    name: &'static str,
    /// Frames of the segments, and those of their parents.
    frames: Vec<String>,
    parents: Vec<Option<String>>,
    pose: ChannelId,
    position: usize,
    attitude: usize,
}

/// The channels besides those of the bodies.
struct Channels {
    transforms: ChannelId,
    body: ChannelId,
    arrows: ChannelId,
    flight: ChannelId,
    segments: ChannelId,
}

/// The columns in a row that hold what is drawn.
struct Places {
    time: usize,
    joints: usize,
    forces: usize,
    centres: usize,
}

/// When the next messages at a lower rate than the frames' are due.
struct Timer {
    /// Seconds between messages.
    period: f64,
    due: f64,
}

impl Timer {
    const fn new(rate: f64) -> Self {
        Self {
            period: 1.0 / rate,
            due: f64::NEG_INFINITY,
        }
    }

    /// Whether messages are due at a time (s), with a millisecond of tolerance: the frame rate need not be a multiple of
    /// the messages'.
    fn rings(&mut self, seconds: f64) -> bool {
        let is_due = seconds >= self.due - 1e-3;
        if is_due {
            let next = self.due + self.period;
            self.due = if next > seconds {
                next
            } else {
                seconds + self.period
            };
        }
        is_due
    }
}

/// Columns of a quantity: the first, and how many belong to one segment or the body.
type Columns = (usize, usize);

/// A file being written.
pub struct McapRecording {
    file: McapFile<AtomicFile>,
    path: PathBuf,
    /// Unix time of frame 0, or zero.
    began: Duration,
    solids: Vec<Solid>,
    sides: Vec<Side>,
    channels: Channels,
    places: Places,
    of_body: Vec<(Columns, Kind)>,
    of_segments: Vec<Columns>,
    has_body: bool,
    next_poses: Timer,
    next_arrows: Timer,
}

/// Every quantity with its first column in a row.
fn placed(quantities: &[Quantity]) -> impl Iterator<Item = (usize, &Quantity)> {
    quantities.iter().scan(0, |next, quantity| {
        let from = *next;
        *next += quantity.width();
        Some((from, quantity))
    })
}

/// The first column of a quantity with this many components.
fn place(quantities: &[Quantity], of: Of, name: &str, parts: usize) -> Result<usize> {
    let is_it = |quantity: &Quantity| {
        quantity.of == of && quantity.name == name && quantity.parts.len() == parts
    };
    let found = placed(quantities).find(|(_, quantity)| is_it(quantity));
    found
        .map(|(from, _)| from)
        .ok_or_else(|| Problem::internal(format!("there is no quantity {name}")))
}

/// `N` numbers of a row, starting at `from`; NaN past its end.
fn taken<const N: usize>(row: &[f64], from: usize) -> [f64; N] {
    core::array::from_fn(|k| row.get(from + k).copied().unwrap_or(f64::NAN))
}

/// Name of the joints' rotations among the quantities.
const JOINT: &str = "joint";

/// Whether `/tf` already contains the quantity.
fn is_transform(quantity: &Quantity) -> bool {
    let is_pose = SIDES.iter().any(|(side, _)| {
        ["position", "attitude"]
            .iter()
            .any(|what| quantity.name == format!("{side}_{what}"))
    });
    is_pose || (quantity.name == JOINT && quantity.parts.len() == 4)
}

impl McapRecording {
    /// Creates the file; `solids` are in segment order.
    ///
    /// # Errors
    /// Returns an error if the folder cannot be written to.
    pub fn create(
        path: &Path,
        quantities: &[Quantity],
        solids: Vec<Solid>,
        about: &About,
    ) -> Result<Self> {
        let refused = |error| Problem::system("write", path, error);
        let mut file = McapFile::new(AtomicFile::create(path)?, PROGRAM).map_err(refused)?;
        file.metadata(METADATA, &about.facts).map_err(refused)?;
        let listed: Vec<(usize, &Quantity)> = placed(quantities)
            .filter(|(_, quantity)| quantity.of == Of::Segments && !is_transform(quantity))
            .collect();
        let of_segments: Vec<&Quantity> = listed.iter().map(|(_, quantity)| *quantity).collect();
        let mut channel = |topic: &str, schema: &schemas::Schema| {
            file.channel(topic, (schema.name, &schema.descriptors))
        };
        let (scene, pose) = (schemas::scene_update(), schemas::pose_in_frame());
        let channels = Channels {
            transforms: channel("/tf", &schemas::frame_transforms()),
            body: channel("/body", &scene),
            arrows: channel("/forces", &scene),
            flight: channel("/flight", &schemas::of_body(quantities)),
            segments: channel("/segments", &schemas::of_segments(&of_segments)),
        };
        let mut side = |(name, _): (&'static str, Color)| {
            let place =
                |what: &str, parts| place(quantities, Of::Body, &format!("{name}_{what}"), parts);
            let frame = |segment: Segment| format!("{name}/{}", segment.name());
            Ok(Side {
                name,
                frames: Segment::ALL.map(frame).to_vec(),
                parents: Segment::ALL
                    .map(|segment| segment.parent().map(frame))
                    .to_vec(),
                pose: channel(&format!("/{name}/pose"), &pose),
                position: place("position", 3)?,
                attitude: place("attitude", 4)?,
            })
        };
        let sides = SIDES.into_iter().map(&mut side).collect::<Result<_>>()?;
        let of_body = placed(quantities).filter(|(_, quantity)| quantity.of == Of::Body);
        Ok(Self {
            file,
            path: path.to_path_buf(),
            began: about.began.unwrap_or_default(),
            solids,
            sides,
            channels,
            places: Places {
                time: place(quantities, Of::Body, "time", 0)?,
                joints: place(quantities, Of::Segments, JOINT, 4)?,
                forces: place(quantities, Of::Segments, "force", 3)?,
                centres: place(quantities, Of::Segments, "cg", 3)?,
            },
            of_body: of_body
                .map(|(from, quantity)| ((from, quantity.width()), schemas::kind_of(quantity)))
                .collect(),
            of_segments: listed
                .into_iter()
                .map(|(from, quantity)| (from, quantity.parts.len().max(1)))
                .collect(),
            has_body: false,
            next_poses: Timer::new(POSE_RATE),
            next_arrows: Timer::new(ARROW_RATE),
        })
    }

    /// Writes a message.
    fn put(&mut self, channel: ChannelId, time: Duration, message: &impl Encode) -> Result<()> {
        let mut encoded = Message::default();
        message.encode(&mut encoded);
        self.put_encoded(channel, time, encoded)
    }

    fn put_encoded(&mut self, channel: ChannelId, time: Duration, message: Message) -> Result<()> {
        // Until the year 2554.
        let time = u64::try_from(time.as_nanos()).unwrap_or(u64::MAX);
        self.file
            .message(channel, time, &message.into_bytes())
            .map_err(|error| Problem::system("write", &self.path, error))
    }

    fn write_transforms(&mut self, row: &[f64], time: Duration) -> Result<()> {
        let root = |side: &Side| Pose {
            position: Vector3(taken(row, side.position)),
            orientation: Quaternion(taken(row, side.attitude)),
        };
        let mut transforms = Vec::new();
        for side in &self.sides {
            let segments = side.frames.iter().zip(&side.parents).zip(&self.solids);
            for (place, ((frame, parent), solid)) in segments.enumerate() {
                let joint = || Pose {
                    position: Vector3(solid.joint_offset),
                    orientation: Quaternion(taken(row, self.places.joints + 4 * place)),
                };
                transforms.push(FrameTransform {
                    timestamp: time,
                    parent_frame_id: parent.as_deref().unwrap_or(WORLD),
                    child_frame_id: frame,
                    pose: parent.as_ref().map_or_else(|| root(side), |_| joint()),
                });
            }
        }
        let mut message = Message::default();
        FrameTransforms(transforms).encode(&mut message);
        let poses: Vec<(ChannelId, Pose)> = self
            .sides
            .iter()
            .map(|side| (side.pose, root(side)))
            .collect();
        self.put_encoded(self.channels.transforms, time, message)?;
        poses.into_iter().try_for_each(|(channel, pose)| {
            let message = PoseInFrame {
                timestamp: time,
                frame_id: WORLD,
                pose,
            };
            self.put(channel, time, &message)
        })
    }

    /// Writes the solids once: they move with the frames of their segments.
    fn write_body(&mut self, time: Duration) -> Result<()> {
        let entities = self.sides.iter().zip(SIDES).flat_map(|(side, (_, color))| {
            let solids = side.frames.iter().zip(&self.solids);
            solids.map(move |(frame, solid)| SceneEntity {
                timestamp: time,
                frame_id: frame.clone(),
                id: frame.clone(),
                arrows: Vec::new(),
                spheres: vec![Sphere {
                    pose: Pose {
                        position: Vector3(solid.middle),
                        orientation: Quaternion::IDENTITY,
                    },
                    size: Vector3(solid.half_extents.map(|half| 2.0 * half)),
                    color,
                }],
            })
        });
        let message = SceneUpdate(entities.collect());
        self.put(self.channels.body, time, &message)
    }

    fn write_arrows(&mut self, row: &[f64], time: Duration) -> Result<()> {
        // Loads are in body axes, which are those of the pelvis.
        let Some((side, frame)) = self
            .sides
            .first()
            .and_then(|side| Some((side, side.frames.first()?)))
        else {
            return Ok(());
        };
        let arrows = (0..Segment::ALL.len()).map(|segment| {
            let force = nalgebra::Vector3::from(taken::<3>(row, self.places.forces + 3 * segment));
            let turn = UnitQuaternion::rotation_between(&nalgebra::Vector3::x(), &force)
                .unwrap_or_else(|| {
                    UnitQuaternion::from_axis_angle(&nalgebra::Vector3::y_axis(), 0.0)
                });
            let length = ARROW_SCALE * force.norm();
            Arrow {
                pose: Pose {
                    position: Vector3(taken(row, self.places.centres + 3 * segment)),
                    orientation: Quaternion([turn.w, turn.i, turn.j, turn.k]),
                },
                shaft_length: length,
                shaft_diameter: 0.015,
                head_length: 0.04,
                head_diameter: 0.04,
                color: FORCE,
            }
        });
        let entity = SceneEntity {
            timestamp: time,
            frame_id: frame.clone(),
            id: format!("{}/forces", side.name),
            arrows: arrows.collect(),
            spheres: Vec::new(),
        };
        self.put(self.channels.arrows, time, &SceneUpdate(vec![entity]))
    }

    fn write_numbers(&mut self, row: &[f64], time: Duration) -> Result<()> {
        let columns = |(from, width): Columns| row.get(from..from + width).unwrap_or_default();
        let mut body = Message::default();
        let numbers = self.of_body.iter().flat_map(|(place, kind)| {
            let numbers = columns(*place).iter();
            numbers.map(move |number| (*kind, *number))
        });
        for (field, (kind, number)) in (1..).zip(numbers) {
            match kind {
                Kind::Double => body.double(field, number),
                _ => body.float(field, number),
            }
        }
        let mut segments = Message::default();
        for (segment, place) in (0..Segment::ALL.len()).zip(1..) {
            let numbers = self
                .of_segments
                .iter()
                .flat_map(|(from, width)| columns((from + segment * width, *width)));
            segments.message(place, |out| {
                for (field, number) in (1..).zip(numbers) {
                    out.float(field, *number);
                }
            });
        }
        self.put_encoded(self.channels.flight, time, body)?;
        self.put_encoded(self.channels.segments, time, segments)
    }
}

impl Sink for McapRecording {
    fn write(&mut self, row: &[f64]) -> Result<()> {
        let seconds = row.get(self.places.time).copied().unwrap_or(0.0);
        let since = Duration::try_from_secs_f64(seconds).unwrap_or_default();
        let time = self.began + since;
        if self.next_poses.rings(seconds) {
            self.write_transforms(row, time)?;
        }
        if !self.has_body {
            self.has_body = true;
            self.write_body(time)?;
        }
        if self.next_arrows.rings(seconds) {
            self.write_arrows(row, time)?;
        }
        self.write_numbers(row, time)
    }

    fn finish(self: Box<Self>) -> Result<()> {
        let Self { file, path, .. } = *self;
        let out = file
            .finish()
            .map_err(|error| Problem::system("write", &path, error))?;
        out.finish()
    }
}
