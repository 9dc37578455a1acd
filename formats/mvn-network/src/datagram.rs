//! One datagram: a header of 24 bytes and a payload; integers are big-endian.

/// Length of a header (bytes).
pub const HEADER_LENGTH: usize = 24;
/// First bytes of every datagram; two digits follow.
const MAGIC: [u8; 4] = *b"MXTP";
/// This bit is set in the fragment number of the last fragment.
const LAST: u8 = 0x80;

/// Type of the payload, given by the two digits in the header.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Kind {
    /// 01, pose as Euler angles (deg) in axes with Y up (cm).
    PoseEuler,
    /// 02, pose as quaternions in axes with Z up (m).
    Pose,
    /// 12, lines of tag and value.
    Metadata,
    /// 13, the body in the null pose.
    Scale,
    /// 20, joint angles (deg).
    JointAngles,
    /// 21, position, velocity and acceleration of the segments.
    LinearKinematics,
    /// 22, orientation, angular velocity and angular acceleration of the segments.
    AngularKinematics,
    /// 24, centre of mass.
    CentreOfMass,
    /// 25, time of day.
    TimeCode,
    /// Any other kind.
    Other(u8),
}

/// Numbers of the known kinds.
const NUMBERS: [(Kind, u8); 9] = [
    (Kind::PoseEuler, 1),
    (Kind::Pose, 2),
    (Kind::Metadata, 12),
    (Kind::Scale, 13),
    (Kind::JointAngles, 20),
    (Kind::LinearKinematics, 21),
    (Kind::AngularKinematics, 22),
    (Kind::CentreOfMass, 24),
    (Kind::TimeCode, 25),
];

impl Kind {
    /// The kind with a number of two digits.
    pub fn from_number(number: u8) -> Self {
        NUMBERS
            .into_iter()
            .find(|(_, known)| *known == number)
            .map_or(Self::Other(number), |(kind, _)| kind)
    }

    /// Its number, below 100.
    pub fn number(self) -> u8 {
        match self {
            Self::Other(number) => number % 100,
            _ => NUMBERS
                .into_iter()
                .find(|(kind, _)| *kind == self)
                .map_or(0, |(_, number)| number),
        }
    }
}

/// The header before the payload.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Header {
    /// Type of the payload.
    pub kind: Kind,
    /// Number of the sample; datagrams with the same number belong together.
    pub sample: u32,
    /// Number of the fragment, 0 to 127, within its sample and kind.
    pub fragment: u8,
    /// Whether it is the last fragment.
    pub last: bool,
    /// Number of items in the payload.
    pub items: u8,
    /// Time since the recording began (ms).
    pub time_ms: u32,
    /// Number of the person, from 0.
    pub character: u8,
    /// Number of body segments; 0 from senders before 2019.
    pub body_segments: u8,
    /// Number of props.
    pub props: u8,
    /// Number of finger segments, 0 or 40.
    pub finger_segments: u8,
}

/// A header with its payload.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Datagram<'a> {
    /// The header.
    pub header: Header,
    /// The bytes that follow it.
    pub payload: &'a [u8],
}

/// Bytes that are not an MVN datagram.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum BadDatagram {
    /// It does not start with "MXTP" and two digits.
    #[error("expected \"MXTP\" and two digits at the beginning")]
    NotMvn,
    /// It ends too early.
    #[error("expected at least {expected} bytes, found {found}")]
    Short {
        /// Bytes received.
        found: usize,
        /// Bytes that the header announces.
        expected: usize,
    },
}

impl<'a> Datagram<'a> {
    /// Reads the contents of one UDP packet. Senders before 2018 set the payload length to 0; the payload is then
    /// everything that follows.
    ///
    /// # Errors
    /// Returns [`BadDatagram`] if the bytes are not a datagram.
    pub fn parse(bytes: &'a [u8]) -> Result<Self, BadDatagram> {
        let short = |expected| BadDatagram::Short {
            found: bytes.len(),
            expected,
        };
        let (head, rest) = bytes
            .split_first_chunk::<HEADER_LENGTH>()
            .ok_or(short(HEADER_LENGTH))?;
        let [
            m0,
            m1,
            m2,
            m3,
            tens,
            ones,
            s0,
            s1,
            s2,
            s3,
            counter,
            items,
            t0,
            t1,
            t2,
            t3,
            character,
            body_segments,
            props,
            finger_segments,
            _,
            _,
            l0,
            l1,
        ] = *head;
        if [m0, m1, m2, m3] != MAGIC || !tens.is_ascii_digit() || !ones.is_ascii_digit() {
            return Err(BadDatagram::NotMvn);
        }
        let payload = match usize::from(u16::from_be_bytes([l0, l1])) {
            0 => rest,
            length => rest.get(..length).ok_or(short(HEADER_LENGTH + length))?,
        };
        Ok(Self {
            header: Header {
                kind: Kind::from_number((tens - b'0') * 10 + (ones - b'0')),
                sample: u32::from_be_bytes([s0, s1, s2, s3]),
                fragment: counter & !LAST,
                last: counter & LAST != 0,
                items,
                time_ms: u32::from_be_bytes([t0, t1, t2, t3]),
                character,
                body_segments,
                props,
                finger_segments,
            },
            payload,
        })
    }

    /// Writes the bytes to send into `out`, replacing its contents; `None` if the payload is longer than UDP allows:
    /// 65 507 bytes less the header.
    #[must_use]
    pub fn encode(&self, out: &mut Vec<u8>) -> Option<()> {
        let length = u16::try_from(self.payload.len())
            .ok()
            .filter(|length| *length <= 65_507 - 24)?;
        let Header { kind, .. } = self.header;
        let number = kind.number();
        out.clear();
        out.extend_from_slice(&MAGIC);
        out.extend_from_slice(&[b'0' + number / 10, b'0' + number % 10]);
        out.extend_from_slice(&self.header.sample.to_be_bytes());
        let last = if self.header.last { LAST } else { 0 };
        out.extend_from_slice(&[self.header.fragment & !LAST | last, self.header.items]);
        out.extend_from_slice(&self.header.time_ms.to_be_bytes());
        out.extend_from_slice(&[
            self.header.character,
            self.header.body_segments,
            self.header.props,
            self.header.finger_segments,
            0,
            0,
        ]);
        out.extend_from_slice(&length.to_be_bytes());
        out.extend_from_slice(self.payload);
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The header of a pose as MVN 2019 sends it, with a payload of three bytes.
    const EXAMPLE: [u8; 27] = [
        b'M', b'X', b'T', b'P', b'0', b'2', 0, 0, 0x1A, 0x19, 0x80, 23, 0, 0, 0x6C, 0xBD, 1, 23, 0,
        0, 0, 0, 0, 3, 7, 8, 9,
    ];

    #[test]
    fn the_fields_are_where_the_protocol_has_them() {
        let datagram = Datagram::parse(&EXAMPLE).unwrap();
        assert_eq!(
            datagram.header,
            Header {
                kind: Kind::Pose,
                sample: 6681,
                fragment: 0,
                last: true,
                items: 23,
                time_ms: 27_837,
                character: 1,
                body_segments: 23,
                props: 0,
                finger_segments: 0,
            }
        );
        assert_eq!(datagram.payload, [7, 8, 9]);
        let mut bytes = Vec::new();
        datagram.encode(&mut bytes).unwrap();
        assert_eq!(bytes, EXAMPLE);
        // The header of older senders ends with zeros.
        let mut old = EXAMPLE;
        old[17..24].fill(0);
        assert_eq!(Datagram::parse(&old).unwrap().payload, [7, 8, 9]);
    }

    #[test]
    fn a_truncated_datagram_is_refused_at_every_length() {
        for length in 0..EXAMPLE.len() {
            let expected = if length < HEADER_LENGTH { 24 } else { 27 };
            assert_eq!(
                Datagram::parse(&EXAMPLE[..length]),
                Err(BadDatagram::Short {
                    found: length,
                    expected
                })
            );
        }
        let mut other = EXAMPLE;
        other[4] = b'x';
        assert_eq!(Datagram::parse(&other), Err(BadDatagram::NotMvn));
        let payload = vec![0; 65_507 - 23];
        let datagram = Datagram {
            payload: &payload,
            ..Datagram::parse(&EXAMPLE).unwrap()
        };
        assert!(datagram.encode(&mut Vec::new()).is_none());
    }

    proptest! {
        #[test]
        fn datagrams_arrive_as_sent(
            number in 0u8..100,
            words in any::<[u32; 2]>(),
            bytes in any::<[u8; 5]>(),
            fragment in 0u8..128,
            last: bool,
            payload in prop::collection::vec(any::<u8>(), 1..200),
        ) {
            let [items, character, body_segments, props, finger_segments] = bytes;
            let sent = Datagram {
                header: Header {
                    kind: Kind::from_number(number),
                    sample: words[0],
                    fragment,
                    last,
                    items,
                    time_ms: words[1],
                    character,
                    body_segments,
                    props,
                    finger_segments,
                },
                payload: &payload,
            };
            let mut bytes = Vec::new();
            sent.encode(&mut bytes).unwrap();
            prop_assert_eq!(Datagram::parse(&bytes), Ok(sent));
        }
    }
}
