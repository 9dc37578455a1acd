//! Payloads of the kinds that a flight needs: numbers and text, big-endian.

use nalgebra::{Quaternion, Vector3};

use super::datagram::Kind;
use bodyflight_mvnx::xsens::y_up;

/// Most bytes of a text that are kept: names and lines of metadata are shorter.
const LONGEST_TEXT: usize = 4096;

/// The decoded payload of one datagram, in the axes of MVN with Z up; lengths in m.
#[derive(Debug, Clone, PartialEq)]
pub enum Message {
    /// Kinds 01 and 02.
    Pose(Vec<SegmentPose>),
    /// Kind 12: tags and values.
    Metadata(Vec<(String, String)>),
    /// Kind 13.
    Scale(Scale),
    /// Kind 20.
    JointAngles(Vec<JointAngles>),
    /// Kind 21.
    LinearKinematics(Vec<LinearKinematics>),
    /// Kind 22.
    AngularKinematics(Vec<AngularKinematics>),
    /// Kind 24 (m).
    CentreOfMass(Vector3<f64>),
    /// Kind 25: `HH:MM:SS.mmm`.
    TimeCode(String),
}

/// Pose of a segment. The orientation is global from segment, and not normalised here.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SegmentPose {
    /// Number of the segment, from 1.
    pub id: u32,
    /// Origin (m).
    pub position: Vector3<f64>,
    /// Orientation.
    pub orientation: Quaternion<f64>,
}

/// The body in the null pose, or part of it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Scale {
    /// Name and origin (m) of each segment.
    pub segments: Vec<(String, Vector3<f64>)>,
    /// Points on segments.
    pub points: Vec<ScalePoint>,
}

/// A point on a segment.
#[derive(Debug, Clone, PartialEq)]
pub struct ScalePoint {
    /// Number of the segment, from 1.
    pub segment: u16,
    /// Number of the point on it.
    pub point: u16,
    /// Name.
    pub label: String,
    /// Flags as sent.
    pub flags: u32,
    /// Position on the segment (m).
    pub position: Vector3<f64>,
}

/// Angles of one joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointAngles {
    /// Point on the parent: 256 times the segment, plus the point.
    pub parent: u32,
    /// Point on the child.
    pub child: u32,
    /// Angles (deg).
    pub angles_deg: Vector3<f64>,
}

/// Motion of the origin of a segment, global axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinearKinematics {
    /// Number of the segment, from 1.
    pub id: u32,
    /// Position (m).
    pub position: Vector3<f64>,
    /// Velocity (m/s).
    pub velocity: Vector3<f64>,
    /// Acceleration (m/s2).
    pub acceleration: Vector3<f64>,
}

/// Rotation of a segment, global axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AngularKinematics {
    /// Number of the segment, from 1.
    pub id: u32,
    /// Orientation.
    pub orientation: Quaternion<f64>,
    /// Angular velocity, in the sender's unit: the protocol does not specify one.
    pub angular_velocity: Vector3<f64>,
    /// Angular acceleration, in the same unit per second.
    pub angular_acceleration: Vector3<f64>,
}

impl Message {
    /// Reads a payload of `items` items; `None` if it is too short or the kind is not known.
    pub fn decode(kind: Kind, items: u8, payload: &[u8]) -> Option<Self> {
        let mut reader = Reader(payload);
        Some(match kind {
            Kind::PoseEuler => Self::Pose(records(items, payload, |item| {
                let (id, position, angles) = (item.word()?, item.vector()?, item.vector()?);
                Some(SegmentPose {
                    id,
                    position: y_up::position(position),
                    orientation: *y_up::orientation(angles).quaternion(),
                })
            })?),
            Kind::Pose => Self::Pose(records(items, payload, |item| {
                Some(SegmentPose {
                    id: item.word()?,
                    position: item.vector()?,
                    orientation: item.quaternion()?,
                })
            })?),
            Kind::Metadata => Self::Metadata(metadata(&reader.text()?)),
            Kind::Scale => Self::Scale(scale(&mut reader)?),
            Kind::JointAngles => Self::JointAngles(records(items, payload, |item| {
                Some(JointAngles {
                    parent: item.word()?,
                    child: item.word()?,
                    angles_deg: item.vector()?,
                })
            })?),
            Kind::LinearKinematics => Self::LinearKinematics(records(items, payload, |item| {
                Some(LinearKinematics {
                    id: item.word()?,
                    position: item.vector()?,
                    velocity: item.vector()?,
                    acceleration: item.vector()?,
                })
            })?),
            Kind::AngularKinematics => Self::AngularKinematics(records(items, payload, |item| {
                Some(AngularKinematics {
                    id: item.word()?,
                    orientation: item.quaternion()?,
                    angular_velocity: item.vector()?,
                    angular_acceleration: item.vector()?,
                })
            })?),
            Kind::CentreOfMass => Self::CentreOfMass(reader.vector()?),
            Kind::TimeCode => Self::TimeCode(time_code(payload)?),
            Kind::Other(_) => return None,
        })
    }

    /// Appends the payload, and returns its kind and number of items. Poses are sent as quaternions, and of a list at
    /// most 255 items, which is all the header can count.
    pub fn encode(&self, out: &mut Vec<u8>) -> (Kind, u8) {
        match self {
            Self::Pose(poses) => {
                let items = each(poses, |pose| {
                    word(out, pose.id);
                    vector(out, &pose.position);
                    quaternion(out, &pose.orientation);
                });
                (Kind::Pose, items)
            }
            Self::Metadata(pairs) => {
                let lines = pairs.iter().map(|(tag, value)| format!("{tag}:{value}\n"));
                text(out, &lines.collect::<String>());
                (Kind::Metadata, 1)
            }
            Self::Scale(scale) => {
                scale.encode(out);
                (Kind::Scale, 0)
            }
            Self::JointAngles(joints) => {
                let items = each(joints, |joint| {
                    word(out, joint.parent);
                    word(out, joint.child);
                    vector(out, &joint.angles_deg);
                });
                (Kind::JointAngles, items)
            }
            Self::LinearKinematics(segments) => {
                let items = each(segments, |segment| {
                    word(out, segment.id);
                    vector(out, &segment.position);
                    vector(out, &segment.velocity);
                    vector(out, &segment.acceleration);
                });
                (Kind::LinearKinematics, items)
            }
            Self::AngularKinematics(segments) => {
                let items = each(segments, |segment| {
                    word(out, segment.id);
                    quaternion(out, &segment.orientation);
                    vector(out, &segment.angular_velocity);
                    vector(out, &segment.angular_acceleration);
                });
                (Kind::AngularKinematics, items)
            }
            Self::CentreOfMass(position) => {
                vector(out, position);
                (Kind::CentreOfMass, 1)
            }
            Self::TimeCode(time) => {
                text(out, time);
                (Kind::TimeCode, 1)
            }
        }
    }
}

impl Scale {
    fn encode(&self, out: &mut Vec<u8>) {
        length(out, self.segments.len());
        for (label, origin) in &self.segments {
            text(out, label);
            vector(out, origin);
        }
        length(out, self.points.len());
        for point in &self.points {
            out.extend_from_slice(&point.segment.to_be_bytes());
            out.extend_from_slice(&point.point.to_be_bytes());
            text(out, &point.label);
            word(out, point.flags);
            vector(out, &point.position);
        }
    }
}

/// Items of equal size. Each is given an equal share of the payload, so a later version may append fields to them.
fn records<T>(
    items: u8,
    payload: &[u8],
    mut read: impl FnMut(&mut Reader<'_>) -> Option<T>,
) -> Option<Vec<T>> {
    let size = payload
        .len()
        .checked_div(usize::from(items))
        .filter(|size| *size > 0)?;
    payload
        .chunks_exact(size)
        .take(usize::from(items))
        .map(|item| read(&mut Reader(item)))
        .collect()
}

/// Lines of `tag:value`; a value may contain further colons, and lines without a colon are skipped.
fn metadata(text: &str) -> Vec<(String, String)> {
    text.lines()
        .filter_map(|line| line.split_once(':'))
        .map(|(tag, value)| (tag.to_owned(), value.to_owned()))
        .collect()
}

fn scale(reader: &mut Reader<'_>) -> Option<Scale> {
    let mut scale = Scale::default();
    // The count is untrusted, so nothing is reserved for it; a short payload ends the loop.
    for _ in 0..reader.word()? {
        scale.segments.push((reader.text()?, reader.vector()?));
    }
    for _ in 0..reader.word()? {
        scale.points.push(ScalePoint {
            segment: reader.short()?,
            point: reader.short()?,
            label: reader.text()?,
            flags: reader.word()?,
            position: reader.vector()?,
        });
    }
    Some(scale)
}

/// With a length prefix, as MVN sends it, or without, as its documentation specifies.
fn time_code(payload: &[u8]) -> Option<String> {
    Reader(payload).text().or_else(|| {
        let bare = payload.get(..12).filter(|text| text.is_ascii())?;
        Some(String::from_utf8_lossy(bare).into_owned())
    })
}

/// The unread part of a payload.
struct Reader<'a>(&'a [u8]);

impl Reader<'_> {
    fn bytes<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (bytes, rest) = self.0.split_first_chunk::<N>()?;
        self.0 = rest;
        Some(*bytes)
    }

    fn short(&mut self) -> Option<u16> {
        self.bytes().map(u16::from_be_bytes)
    }

    fn word(&mut self) -> Option<u32> {
        self.bytes().map(u32::from_be_bytes)
    }

    fn real(&mut self) -> Option<f64> {
        self.bytes()
            .map(|bytes| f64::from(f32::from_be_bytes(bytes)))
    }

    fn vector(&mut self) -> Option<Vector3<f64>> {
        Some(Vector3::new(self.real()?, self.real()?, self.real()?))
    }

    /// Sent as w x y z.
    fn quaternion(&mut self) -> Option<Quaternion<f64>> {
        let (w, i, j, k) = (self.real()?, self.real()?, self.real()?, self.real()?);
        Some(Quaternion::new(w, i, j, k))
    }

    /// Length and UTF-8; invalid UTF-8 is replaced, and text longer than any name is cut.
    fn text(&mut self) -> Option<String> {
        let mut after = Self(self.0);
        let length = usize::try_from(after.word()?).ok()?;
        let (text, rest) = after.0.split_at_checked(length)?;
        self.0 = rest;
        let text = text.get(..LONGEST_TEXT).unwrap_or(text);
        Some(String::from_utf8_lossy(text).into_owned())
    }
}

fn word(out: &mut Vec<u8>, word: u32) {
    out.extend_from_slice(&word.to_be_bytes());
}

fn length(out: &mut Vec<u8>, length: usize) {
    word(out, u32::try_from(length).unwrap_or(u32::MAX));
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "the protocol has single precision"
)]
fn real(out: &mut Vec<u8>, number: f64) {
    out.extend_from_slice(&(number as f32).to_be_bytes());
}

fn vector(out: &mut Vec<u8>, vector: &Vector3<f64>) {
    vector.iter().for_each(|component| real(out, *component));
}

fn quaternion(out: &mut Vec<u8>, q: &Quaternion<f64>) {
    [q.w, q.i, q.j, q.k]
        .into_iter()
        .for_each(|component| real(out, component));
}

fn text(out: &mut Vec<u8>, text: &str) {
    length(out, text.len());
    out.extend_from_slice(text.as_bytes());
}

fn each<T>(items: &[T], write: impl FnMut(&T)) -> u8 {
    let count = u8::try_from(items.len()).unwrap_or(u8::MAX);
    items.iter().take(usize::from(count)).for_each(write);
    count
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn returned(message: &Message) -> Option<Message> {
        let mut payload = Vec::new();
        let (kind, items) = message.encode(&mut payload);
        Message::decode(kind, items, &payload)
    }

    /// Numbers that single precision can represent exactly.
    fn number() -> impl Strategy<Value = f64> {
        (-1e6f32..1e6).prop_map(f64::from)
    }

    fn any_vector() -> impl Strategy<Value = Vector3<f64>> {
        prop::array::uniform3(number()).prop_map(Vector3::from)
    }

    fn any_quaternion() -> impl Strategy<Value = Quaternion<f64>> {
        prop::array::uniform4(number()).prop_map(|[w, i, j, k]| Quaternion::new(w, i, j, k))
    }

    fn any_message() -> impl Strategy<Value = Message> {
        let list = 1..70usize;
        prop_oneof![
            prop::collection::vec((any::<u32>(), any_vector(), any_quaternion()), list.clone())
                .prop_map(|poses| Message::Pose(
                    poses
                        .into_iter()
                        .map(|(id, position, orientation)| SegmentPose {
                            id,
                            position,
                            orientation
                        })
                        .collect()
                )),
            prop::collection::vec(("[a-z]{1,8}", "[ -~]{0,12}"), 0..6).prop_map(Message::Metadata),
            (
                prop::collection::vec(("[A-Za-z0-9]{0,9}", any_vector()), 0..24),
                prop::collection::vec(
                    (
                        any::<[u16; 2]>(),
                        "[A-Za-z]{0,9}",
                        any::<u32>(),
                        any_vector()
                    ),
                    0..20
                ),
            )
                .prop_map(|(segments, points)| Message::Scale(Scale {
                    segments,
                    points: points
                        .into_iter()
                        .map(|([segment, point], label, flags, position)| ScalePoint {
                            segment,
                            point,
                            label,
                            flags,
                            position
                        })
                        .collect(),
                })),
            prop::collection::vec((any::<[u32; 2]>(), any_vector()), list.clone()).prop_map(
                |all| {
                    Message::JointAngles(
                        all.into_iter()
                            .map(|([parent, child], angles_deg)| JointAngles {
                                parent,
                                child,
                                angles_deg,
                            })
                            .collect(),
                    )
                }
            ),
            prop::collection::vec(
                (any::<u32>(), any_vector(), any_vector(), any_vector()),
                list.clone()
            )
            .prop_map(|all| Message::LinearKinematics(
                all.into_iter()
                    .map(|(id, position, velocity, acceleration)| LinearKinematics {
                        id,
                        position,
                        velocity,
                        acceleration
                    })
                    .collect()
            )),
            prop::collection::vec(
                (any::<u32>(), any_quaternion(), any_vector(), any_vector()),
                list
            )
            .prop_map(|all| Message::AngularKinematics(
                all.into_iter()
                    .map(
                        |(id, orientation, angular_velocity, angular_acceleration)| {
                            AngularKinematics {
                                id,
                                orientation,
                                angular_velocity,
                                angular_acceleration,
                            }
                        }
                    )
                    .collect()
            )),
            any_vector().prop_map(Message::CentreOfMass),
            "[0-9]{2}:[0-9]{2}:[0-9]{2}\\.[0-9]{3}".prop_map(Message::TimeCode),
        ]
    }

    #[test]
    fn sizes_are_those_of_the_protocol() {
        let pose = SegmentPose {
            id: 1,
            position: Vector3::new(1.0, 2.0, 3.0),
            orientation: Quaternion::identity(),
        };
        let mut payload = Vec::new();
        let kind = Message::Pose(vec![pose; 23]).encode(&mut payload);
        assert_eq!((kind, payload.len()), ((Kind::Pose, 23), 736));
        assert_eq!(payload[..8], [0, 0, 0, 1, 0x3F, 0x80, 0, 0]);
        payload.clear();
        Message::TimeCode("01:02:03.004".into()).encode(&mut payload);
        assert_eq!(payload.len(), 16);
        assert_eq!(
            Message::decode(Kind::TimeCode, 1, b"01:02:03.004"),
            Some(Message::TimeCode("01:02:03.004".into()))
        );
    }

    #[test]
    fn items_may_be_longer_than_known_but_not_shorter() {
        let mut payload = Vec::new();
        for id in 1..=3u32 {
            payload.extend_from_slice(&id.to_be_bytes());
            payload.extend_from_slice(&[0; 36]);
        }
        let poses = match Message::decode(Kind::Pose, 3, &payload) {
            Some(Message::Pose(poses)) => poses,
            other => panic!("{other:?}"),
        };
        let ids: Vec<u32> = poses.iter().map(|pose| pose.id).collect();
        assert_eq!(ids, [1, 2, 3]);
        assert_eq!(Message::decode(Kind::Pose, 4, &payload), None);
        assert_eq!(Message::decode(Kind::Pose, 0, &payload), None);
        assert_eq!(Message::decode(Kind::Pose, 255, &[]), None);
    }

    #[test]
    fn a_value_of_the_metadata_may_hold_colons() {
        let mut payload = Vec::new();
        text(&mut payload, "name:A: B\nno colon\ncolor:e96417\n");
        let pairs = [("name", "A: B"), ("color", "e96417")];
        assert_eq!(
            Message::decode(Kind::Metadata, 1, &payload),
            Some(Message::Metadata(
                pairs.map(|(a, b)| (a.to_owned(), b.to_owned())).to_vec()
            ))
        );
    }

    proptest! {
        #[test]
        fn messages_arrive_as_sent(message in any_message()) {
            prop_assert_eq!(returned(&message), Some(message));
        }

        #[test]
        fn a_truncated_payload_never_panics(message in any_message(), cut in 0.0..1.0f64) {
            let mut payload = Vec::new();
            let (kind, items) = message.encode(&mut payload);
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_precision_loss, reason = "a fraction of a length")]
            payload.truncate((payload.len() as f64 * cut) as usize);
            prop_assert_ne!(Message::decode(kind, items, &payload), Some(message));
        }
    }
}
