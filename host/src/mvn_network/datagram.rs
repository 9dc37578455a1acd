//! The bytes of MXTP datagrams. Source: MVN real-time network streaming protocol specification; big-endian.

use nalgebra::Vector3;

use crate::recording::FlightFrame;
use crate::xsens::{self, MVN_SEGMENT_COUNT, MvnSegment};

/// Kind 02: position (m) and orientation of each segment, Z up.
pub const POSE: u8 = 2;
/// Kind 21: position, velocity (m/s), acceleration of each segment.
pub const LINEAR: u8 = 21;
/// Kind 22: orientation, angular velocity (rad/s), angular acceleration of each segment, global axes.
pub const ANGULAR: u8 = 22;

const HEADER_LENGTH: usize = 24;
/// The only datagram of its kind in a sample.
const LAST: u8 = 0x80;

/// What stands before the items.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Header {
    /// Kind by its two digits.
    pub kind: u8,
    /// Number of the sample; kinds of one sample share it.
    pub sample: u32,
    /// Time since the recording began (ms).
    pub time_ms: u32,
    /// Items in the datagram.
    pub items: u8,
}

impl Header {
    /// Header and items of a datagram; `None` where it is none of MVN.
    pub fn read(bytes: &[u8]) -> Option<(Self, &[u8])> {
        let (header, payload) = bytes.split_first_chunk::<HEADER_LENGTH>()?;
        let (name, _) = header.split_first_chunk::<6>()?;
        let [
            b'M',
            b'X',
            b'T',
            b'P',
            tens @ b'0'..=b'9',
            ones @ b'0'..=b'9',
        ] = *name
        else {
            return None;
        };
        let header = Self {
            kind: (tens - b'0') * 10 + (ones - b'0'),
            sample: words(&header[6..]),
            time_ms: words(&header[12..]),
            items: header[11],
        };
        Some((header, payload))
    }

    fn write(&self, datagram: &mut Vec<u8>, payload: u16) {
        let segments = MVN_SEGMENT_COUNT.to_le_bytes()[0];
        datagram.extend(format!("MXTP{:02}", self.kind).into_bytes());
        datagram.extend(self.sample.to_be_bytes());
        datagram.extend([LAST, self.items]);
        datagram.extend(self.time_ms.to_be_bytes());
        datagram.extend([0, segments, 0, 0, 0, 0]);
        datagram.extend(payload.to_be_bytes());
    }
}

/// The first four bytes as a number; missing ones are zero.
pub fn words(bytes: &[u8]) -> u32 {
    bytes
        .first_chunk()
        .map_or(0, |word| u32::from_be_bytes(*word))
}

/// Single precision numbers in a row; missing ones are not a number.
pub fn numbers<const N: usize>(bytes: &[u8]) -> [f64; N] {
    let mut numbers = [f64::NAN; N];
    for (number, bytes) in numbers.iter_mut().zip(bytes.as_chunks::<4>().0) {
        *number = f64::from(f32::from_be_bytes(*bytes));
    }
    numbers
}

/// The datagrams of a frame: pose, and the kinematics that the frame has.
pub fn of_frame(frame: &FlightFrame, sample: u32) -> Vec<Vec<u8>> {
    let orientations = xsens::mvn_orientations(frame.pelvis.inertial_from_body, &frame.posture);
    let position = xsens::xsens_vector(frame.pelvis.position);
    let velocity = frame.pelvis.velocity.map(xsens::xsens_vector);
    let turn = frame.pelvis.angular_velocity.map(xsens::xsens_vector);
    let nothing = Vector3::zeros();
    // Positions and velocities are those of the pelvis: a frame knows no others.
    let wxyz = |segment: MvnSegment| orientations[segment.part_of()].wxyz();
    let mut datagrams = vec![datagram(POSE, sample, frame, |segment, put| {
        put(position.as_slice());
        put(&wxyz(segment));
    })];
    if let Some(velocity) = velocity {
        datagrams.push(datagram(LINEAR, sample, frame, |segment, put| {
            let own = if segment == MvnSegment::Pelvis {
                velocity
            } else {
                nothing
            };
            put(position.as_slice());
            put(own.as_slice());
            put(nothing.as_slice());
        }));
    }
    if let Some(turn) = turn {
        datagrams.push(datagram(ANGULAR, sample, frame, |segment, put| {
            let own = if segment == MvnSegment::Pelvis {
                turn
            } else {
                nothing
            };
            put(&wxyz(segment));
            put(own.as_slice());
            put(nothing.as_slice());
        }));
    }
    datagrams
}

fn datagram(
    kind: u8,
    sample: u32,
    frame: &FlightFrame,
    item: impl Fn(MvnSegment, &mut dyn FnMut(&[f64])),
) -> Vec<u8> {
    let mut items = Vec::new();
    for (id, segment) in (1u32..).zip(MvnSegment::ALL) {
        items.extend(id.to_be_bytes());
        item(segment, &mut |values| {
            #[expect(
                clippy::cast_possible_truncation,
                reason = "single precision on the wire"
            )]
            items.extend(
                values
                    .iter()
                    .flat_map(|&value| (value as f32).to_be_bytes()),
            );
        });
    }
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "saturates; frames begin at 0"
    )]
    let time_ms = (frame.time * 1e3).round() as u32;
    let header = Header {
        kind,
        sample,
        time_ms,
        items: MVN_SEGMENT_COUNT.to_le_bytes()[0],
    };
    let mut datagram = Vec::with_capacity(HEADER_LENGTH + items.len());
    header.write(&mut datagram, u16::try_from(items.len()).unwrap_or(0));
    datagram.extend(items);
    datagram
}
