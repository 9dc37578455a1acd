//! A tree of joints that turn, as BVH, ASF/AMC and SMPL files have it.
//!
//! At zero, every joint has the axes of the file. Channels apply in order, each in the axes resulting from the previous
//! ones.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

/// Rotation (rad) below which a joint is at zero.
const ZERO: f64 = 1e-4;
/// Smallest jump out of a rest posture (rad), and its smallest ratio to the steps after it: if all joints are at zero
/// there, and from any other posture.
const FROM_ZERO: (f64, f64) = (0.05, 3.0);
const FROM_POSTURE: (f64, f64) = (0.3, 10.0);

/// The meaning of a number in a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Channel {
    /// Position along an axis of the parent, which replaces the offset.
    Position(usize),
    /// Rotation about an axis (degrees).
    Rotation(usize),
    /// A component of a rotation vector (rad), which is applied last.
    Vector(usize),
}

/// A joint with its bone.
#[derive(Debug, Clone, PartialEq)]
pub struct Joint {
    /// Its name in the file.
    pub name: String,
    /// Index of its parent, `None` for the root.
    pub parent: Option<usize>,
    /// Offset from the parent, in the parent's axes (units of the file).
    pub offset: Vector3<f64>,
    pub(crate) channels: Vec<Channel>,
    /// Index of its first channel in a frame.
    pub(crate) first: usize,
}

/// The pose of a joint in the axes of the file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placed {
    /// Rotation from joint axes to the axes of the file.
    pub orientation: Matrix3<f64>,
    /// Position (units of the file).
    pub position: Vector3<f64>,
}

/// A tree of joints with its motion.
#[derive(Debug, Clone, PartialEq)]
pub struct Tree {
    /// The joints, parents before children.
    pub joints: Vec<Joint>,
    /// Frames per second (Hz).
    pub rate: f64,
    /// Numbers in a frame.
    pub(crate) channels: usize,
    /// The numbers of all frames.
    pub(crate) values: Vec<f64>,
}

impl Tree {
    /// A tree whose root moves and whose joints all turn by rotation vectors: a frame has the position of the root
    /// (units of the file), then a rotation vector (rad) for each joint. `joints` are names, parents and offsets.
    pub(crate) fn of_vectors(
        joints: Vec<(String, Option<usize>, Vector3<f64>)>,
        rate: f64,
        values: Vec<f64>,
    ) -> Self {
        let channels = 3 * (joints.len() + 1);
        let joints = joints.into_iter().enumerate();
        let joints = joints.map(|(k, (name, parent, offset))| {
            let places = (0..3).map(Channel::Position).filter(|_| k == 0);
            Joint {
                name,
                parent,
                offset,
                channels: places.chain((0..3).map(Channel::Vector)).collect(),
                first: if k == 0 { 0 } else { 3 * (k + 1) },
            }
        });
        Self {
            joints: joints.collect(),
            rate,
            channels,
            values,
        }
    }

    /// Number of frames.
    pub fn frames(&self) -> usize {
        self.values.len() / self.channels.max(1)
    }

    /// Index of the joint with this name.
    pub fn joint(&self, name: &str) -> Option<usize> {
        self.joints.iter().position(|joint| joint.name == name)
    }

    /// The poses of all joints in a frame.
    pub fn placed(&self, frame: usize) -> Vec<Placed> {
        let from = frame * self.channels;
        self.place(self.values.get(from..from + self.channels).unwrap_or(&[]))
    }

    /// Rotation of every joint relative to its parent in a frame.
    fn turns(&self, frame: usize) -> Vec<UnitQuaternion<f64>> {
        let placed = self.placed(frame);
        let relative = self.joints.iter().zip(&placed).map(|(joint, own)| {
            let parent = joint.parent.and_then(|parent| placed.get(parent));
            let turned = parent.map_or(own.orientation, |parent| {
                parent.orientation.transpose() * own.orientation
            });
            UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(turned))
        });
        relative.collect()
    }

    /// Whether frame 0 is a rest posture that does not belong to the motion: many programs put one there. Then all
    /// joints are at zero, or in a posture from which they jump into the motion.
    pub fn starts_at_rest(&self) -> bool {
        if self.frames() < 4 {
            return false;
        }
        let turns: Vec<_> = (0..4).map(|frame| self.turns(frame)).collect();
        let jump = |frame: usize| {
            let pairs = turns[frame].iter().zip(&turns[frame + 1]);
            pairs.map(|(a, b)| a.angle_to(b)).fold(0.0, f64::max)
        };
        let (first, usual) = (jump(0), jump(1).max(jump(2)));
        let limbs = turns[0].iter().zip(&self.joints);
        let at_zero = limbs
            .filter(|(_, joint)| joint.parent.is_some())
            .all(|(turn, _)| turn.angle() < ZERO);
        let (least, steps) = if at_zero { FROM_ZERO } else { FROM_POSTURE };
        first > least && first > steps * usual
    }

    /// Leaves out frame 0.
    pub fn drop_first(&mut self) {
        self.values.drain(..self.channels.min(self.values.len()));
    }

    /// Whether `joint` hangs from `ancestor`, directly or not.
    pub fn hangs_from(&self, joint: usize, ancestor: usize) -> bool {
        self.chain(joint).skip(1).any(|above| above == ancestor)
    }

    /// A joint, its parent, and so on up to the root.
    pub fn chain(&self, joint: usize) -> impl Iterator<Item = usize> + '_ {
        core::iter::successors(Some(joint), |joint| self.joints.get(*joint)?.parent)
    }

    /// The poses of all joints in the rest posture: at their offsets, all rotations zero.
    pub fn at_rest(&self) -> Vec<Placed> {
        let mut values = vec![0.0; self.channels];
        for joint in &self.joints {
            for (k, channel) in joint.channels.iter().enumerate() {
                if let (Channel::Position(axis), Some(value)) =
                    (channel, values.get_mut(joint.first + k))
                {
                    *value = joint.offset[*axis];
                }
            }
        }
        self.place(&values)
    }

    fn place(&self, values: &[f64]) -> Vec<Placed> {
        let mut placed: Vec<Placed> = Vec::with_capacity(self.joints.len());
        for joint in &self.joints {
            let mut moved = joint.offset;
            let mut turned = Matrix3::identity();
            let mut vector = Vector3::zeros();
            for (k, channel) in joint.channels.iter().enumerate() {
                let value = values.get(joint.first + k).copied().unwrap_or(0.0);
                match *channel {
                    // This is the position of the joint, not its displacement: the value includes the offset.
                    Channel::Position(axis) => moved[axis] = value,
                    Channel::Rotation(axis) => {
                        let mut about = Vector3::zeros();
                        about[axis] = value.to_radians();
                        turned *= Rotation3::new(about).matrix();
                    }
                    Channel::Vector(axis) => vector[axis] = value,
                }
            }
            turned *= Rotation3::new(vector).matrix();
            placed.push(match joint.parent.and_then(|parent| placed.get(parent)) {
                Some(parent) => Placed {
                    orientation: parent.orientation * turned,
                    position: parent.position + parent.orientation * moved,
                },
                None => Placed {
                    orientation: turned,
                    position: moved,
                },
            });
        }
        placed
    }
}
