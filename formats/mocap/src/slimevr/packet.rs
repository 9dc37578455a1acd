//! The packets of trackers, as bytes: a type (4 bytes, big-endian), a number (8 bytes) and what the type says.
//!
//! Packets that lack their end are damaged; whatever follows what is understood is left unread, since later firmware adds
//! fields at the end.

/// Bytes of type and number.
const HEAD: usize = 12;
/// Greatest type of a packet.
const GREATEST_TYPE: u32 = 255;
/// One unit of a component of the orientation in packets of type 23.
const Q15: f64 = 1.0 / 32_768.0;
/// One unit of the acceleration in packets of type 23 (m/s2).
const ACCELERATION_UNIT: f64 = 1.0 / 128.0;
/// Deviation of the length of an orientation from 1 from which it is none.
const OFF_LENGTH: f64 = 0.01;
/// Greatest acceleration that is believed (m/s2).
const GREATEST_ACCELERATION: f64 = 1000.0;
/// Text from `kind` 17 that says that the orientation is that of the fusion, not a correction of it.
const NORMAL: u8 = 1;

/// Types of packets that are understood or known to be without use here.
pub mod kind {
    /// A sign of life.
    pub const HEARTBEAT: u32 = 0;
    /// A tracker's orientation without a sensor's number, as old firmware sends it; from a server, a sign of life.
    pub const ROTATION: u32 = 1;
    /// A tracker looks for a server.
    pub const HANDSHAKE: u32 = 3;
    /// Acceleration without gravity.
    pub const ACCELERATION: u32 = 4;
    /// A server's question that is sent back as it is.
    pub const PING: u32 = 10;
    /// Voltage and charge of the battery.
    pub const BATTERY: u32 = 12;
    /// A sensor failed.
    pub const ERROR: u32 = 14;
    /// Which sensor it is, and whether it works.
    pub const SENSOR_INFO: u32 = 15;
    /// Orientation of the second sensor, as old firmware sends it.
    pub const ROTATION_2: u32 = 16;
    /// Orientation of a sensor.
    pub const ROTATION_DATA: u32 = 17;
    /// What firmware and server can do.
    pub const FEATURES: u32 = 22;
    /// Orientation and acceleration of a sensor in 16 bits each.
    pub const ROTATION_AND_ACCELERATION: u32 = 23;
    /// Several packets in one.
    pub const BUNDLE: u32 = 100;
    /// The same with heads of two bytes.
    pub const COMPACT_BUNDLE: u32 = 101;
    /// Text, tap, magnetometer, signal strength, temperature, button, settings, flexion, position, inspection and change of
    /// protocol: known, and of no use here.
    pub const UNUSED: [u32; 13] = [2, 11, 13, 18, 19, 20, 21, 24, 25, 26, 27, 105, 200];
}

/// What a tracker says when it looks for a server.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Handshake {
    /// Type of the first sensor; 0 if it is not known.
    pub sensor_type: u32,
    /// Version of the protocol; 0 if it is not sent.
    pub protocol: u32,
    /// Name of the firmware; empty if it is not sent.
    pub firmware: String,
    /// Address of its network card; `None` if it is not sent or zero.
    pub mac: Option<[u8; 6]>,
}

/// One message of a tracker.
#[derive(Debug, Clone, PartialEq)]
pub enum Message {
    /// A sign of life.
    Heartbeat,
    /// It looks for a server.
    Handshake(Handshake),
    /// Orientation of a sensor, a quaternion w, x, y, z of length 1 from the tracker's axes to axes of which Z is up.
    Rotation {
        /// Number of the sensor in the tracker.
        sensor: u8,
        /// The quaternion.
        orientation: [f64; 4],
        /// Acceleration without gravity in the tracker's axes (m/s2), if it is in the same packet.
        acceleration: Option<[f64; 3]>,
    },
    /// Acceleration without gravity in the tracker's axes (m/s2).
    Acceleration {
        /// Number of the sensor in the tracker.
        sensor: u8,
        /// The acceleration.
        acceleration: [f64; 3],
    },
    /// A question that comes back.
    Pong([u8; 4]),
    /// Voltage of the battery (V), and its charge as a share.
    Battery {
        /// Voltage; `None` if it is not sent.
        volts: Option<f64>,
        /// Charge, 0 to 1.
        charge: f64,
    },
    /// A sensor failed, with a code of its maker.
    Error {
        /// Number of the sensor.
        sensor: u8,
        /// The code.
        code: u8,
    },
    /// Which sensor it is.
    SensorInfo {
        /// Number of the sensor.
        sensor: u8,
        /// 0 for absent, 1 for working, 2 for failed.
        status: u8,
        /// Its type; 0 if it is not known.
        sensor_type: u8,
        /// Whether its magnetometer is used.
        has_magnetometer: bool,
        /// Whether it measures how it is turned, and not how a finger bends.
        is_inertial: bool,
    },
    /// It asks what the server can do.
    Features,
    /// A type that is known and of no use here.
    Unused(u32),
    /// A type that is not known.
    Unknown(u32),
    /// Numbers that are none of an orientation or an acceleration.
    Impossible,
    /// A packet that ends too early.
    Damaged,
}

/// A datagram of a tracker.
#[derive(Debug, Clone, PartialEq)]
pub struct Datagram {
    /// Its number; 0 for packets without one.
    pub number: u64,
    /// What is in it, in order.
    pub messages: Vec<Message>,
}

impl Datagram {
    /// Decodes a datagram; `None` if it is none of a tracker.
    pub fn parse(bytes: &[u8]) -> Option<Self> {
        let mut rest = Bytes(bytes);
        let kind = u32::from_be_bytes(rest.take()?);
        let number = u64::from_be_bytes(rest.take()?);
        if kind > GREATEST_TYPE {
            return None;
        }
        let mut messages = Vec::new();
        match kind {
            kind::BUNDLE => rest.each(&mut messages, |rest| {
                let length = u16::from_be_bytes(rest.take()?);
                let mut inner = Bytes(rest.some(usize::from(length))?);
                let kind = inner.take().map(u32::from_be_bytes);
                Some(kind.map_or(Message::Damaged, |kind| inner.message(kind)))
            }),
            kind::COMPACT_BUNDLE => rest.each(&mut messages, |rest| {
                let [length] = rest.take()?;
                let mut inner = Bytes(rest.some(usize::from(length))?);
                let kind = inner.take().map(|[kind]| u32::from(kind));
                Some(kind.map_or(Message::Damaged, |kind| inner.message(kind)))
            }),
            kind => messages.push(rest.message(kind)),
        }
        Some(Self { number, messages })
    }

    /// Whether a datagram is a tracker's, by its head alone.
    pub fn is_likely(bytes: &[u8]) -> bool {
        bytes.len() >= HEAD && bytes.starts_with(&[0, 0, 0])
    }
}

/// What is left of a packet.
struct Bytes<'a>(&'a [u8]);

impl<'a> Bytes<'a> {
    /// The next bytes.
    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (taken, rest) = self.0.split_first_chunk::<N>()?;
        self.0 = rest;
        Some(*taken)
    }

    /// The next bytes, of a length that is sent.
    fn some(&mut self, length: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(length)?;
        self.0 = rest;
        Some(taken)
    }

    /// Takes parts until nothing is left.
    fn each(
        &mut self,
        into: &mut Vec<Message>,
        mut part: impl FnMut(&mut Self) -> Option<Message>,
    ) {
        while !self.0.is_empty() {
            match part(self) {
                Some(message) => into.push(message),
                None => {
                    into.push(Message::Damaged);
                    return;
                }
            }
        }
    }

    fn message(&mut self, kind: u32) -> Message {
        self.understood(kind).unwrap_or(Message::Damaged)
    }

    /// The message of a type; `None` if it ends too early.
    fn understood(&mut self, kind: u32) -> Option<Message> {
        Some(match kind {
            kind::HEARTBEAT => Message::Heartbeat,
            kind::HANDSHAKE => Message::Handshake(self.handshake()),
            kind::ROTATION => self.rotation(0)?,
            kind::ROTATION_2 => self.rotation(1)?,
            kind::ROTATION_DATA => {
                let [sensor, data] = self.take()?;
                match self.rotation(sensor)? {
                    rotation if data == NORMAL => rotation,
                    _ => Message::Unused(kind),
                }
            }
            kind::ACCELERATION => {
                let acceleration = [self.float()?, self.float()?, self.float()?];
                // Telephones have one sensor, and do not say so.
                let [sensor] = self.take().unwrap_or([0]);
                match is_acceleration(&acceleration) {
                    true => Message::Acceleration {
                        sensor,
                        acceleration,
                    },
                    false => Message::Impossible,
                }
            }
            kind::ROTATION_AND_ACCELERATION => {
                let [sensor] = self.take()?;
                let [x, y, z, w] = self.shorts()?.map(|part| f64::from(part) * Q15);
                let acceleration = self.shorts()?;
                let acceleration = acceleration.map(|part| f64::from(part) * ACCELERATION_UNIT);
                oriented(sensor, [w, x, y, z], Some(acceleration))
            }
            kind::PING => Message::Pong(self.take()?),
            kind::BATTERY => {
                let first = self.float()?;
                match self.float() {
                    Some(charge) => Message::Battery {
                        volts: Some(first),
                        charge,
                    },
                    None => Message::Battery {
                        volts: None,
                        charge: first,
                    },
                }
            }
            kind::ERROR => {
                let [sensor, code] = self.take()?;
                Message::Error { sensor, code }
            }
            kind::SENSOR_INFO => self.sensor_info()?,
            kind::FEATURES => Message::Features,
            kind if kind::UNUSED.contains(&kind) => Message::Unused(kind),
            kind => Message::Unknown(kind),
        })
    }

    /// Old firmware sends less, telephones almost nothing.
    fn handshake(&mut self) -> Handshake {
        let mut found = Handshake::default();
        let _board = self.take::<4>();
        found.sensor_type = self.take().map_or(0, u32::from_be_bytes);
        let _controller_and_unused = self.take::<16>();
        found.protocol = self.take().map_or(0, u32::from_be_bytes);
        let [length] = self.take().unwrap_or([0]);
        let name = self.some(usize::from(length)).unwrap_or_default();
        let name = name.split(|byte| *byte == 0).next().unwrap_or_default();
        found.firmware = String::from_utf8_lossy(name).into_owned();
        found.mac = self.take().filter(|mac| *mac != [0; 6]);
        found
    }

    fn sensor_info(&mut self) -> Option<Message> {
        let [sensor, status] = self.take()?;
        let [sensor_type] = self.take().unwrap_or([0]);
        let [_, settings] = self.take().unwrap_or([0; 2]);
        let [_is_calibrated, _position] = self.take().unwrap_or([0; 2]);
        let [data] = self.take().unwrap_or([0]);
        Some(Message::SensorInfo {
            sensor,
            status,
            sensor_type,
            has_magnetometer: settings & 1 != 0,
            is_inertial: data == 0,
        })
    }

    fn rotation(&mut self, sensor: u8) -> Option<Message> {
        let [x, y, z, w] = [self.float()?, self.float()?, self.float()?, self.float()?];
        Some(oriented(sensor, [w, x, y, z], None))
    }

    fn float(&mut self) -> Option<f64> {
        Some(f64::from(f32::from_be_bytes(self.take()?)))
    }

    fn shorts<const N: usize>(&mut self) -> Option<[i16; N]> {
        let mut parts = [0; N];
        for part in &mut parts {
            *part = i16::from_be_bytes(self.take()?);
        }
        Some(parts)
    }
}

/// A message with a quaternion w, x, y, z, if it is one.
fn oriented(sensor: u8, parts: [f64; 4], acceleration: Option<[f64; 3]>) -> Message {
    let length = parts.iter().map(|part| part * part).sum::<f64>().sqrt();
    let is_possible = acceleration.as_ref().is_none_or(is_acceleration);
    if !((length - 1.0).abs() <= OFF_LENGTH && is_possible) {
        return Message::Impossible;
    }
    Message::Rotation {
        sensor,
        orientation: parts.map(|part| part / length),
        acceleration,
    }
}

fn is_acceleration(parts: &[f64; 3]) -> bool {
    parts.iter().all(|part| part.abs() <= GREATEST_ACCELERATION)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn packet(kind: u32, number: u64, payload: &[u8]) -> Vec<u8> {
        [&kind.to_be_bytes()[..], &number.to_be_bytes(), payload].concat()
    }

    fn floats(values: &[f32]) -> Vec<u8> {
        values
            .iter()
            .flat_map(|value| value.to_be_bytes())
            .collect()
    }

    /// The bytes of a tracker of the SlimeVR project as its server logged them (pull request 1424 of SlimeVR-Server).
    #[test]
    fn a_logged_packet_of_a_real_tracker_is_understood() {
        let logged = [
            0, 0, 0, 0x0f, 0, 0, 0, 0, 0, 0, 0x07, 0x1e, 0x00, 0x01, 0x0b, 0x00, 0x3c, 0x01, 0, 0,
            0, 0, 0, 0, 0x3e, 0x0c, 0xd5, 0x5d,
        ];
        let found = Datagram::parse(&logged).unwrap();
        assert_eq!(found.number, 1822);
        let info = Message::SensorInfo {
            sensor: 0,
            status: 1,
            sensor_type: 11,
            has_magnetometer: false,
            is_inertial: true,
        };
        assert_eq!(found.messages, [info]);
    }

    #[test]
    fn orientations_are_understood_in_every_form() {
        let turned = floats(&[0.0, 0.6, 0.0, 0.8]);
        let with = |head: &[u8], tail: &[u8]| [head, &turned, tail].concat();
        let bundled = |parts: &[Vec<u8>]| {
            let each = parts.iter().flat_map(|part| {
                let length = u16::try_from(part.len()).unwrap();
                [&length.to_be_bytes()[..], part].concat()
            });
            packet(100, 7, &each.collect::<Vec<u8>>())
        };
        let inner = |kind: u32, payload: &[u8]| [&kind.to_be_bytes()[..], payload].concat();
        let shorts: Vec<u8> = [0_i16, 19_661, 0, 26_214, 128, -256, 0]
            .iter()
            .flat_map(|part| part.to_be_bytes())
            .collect();
        let short = [&[2][..], &shorts].concat();
        let compact = [&[16, 23][..], &short].concat();
        let pushed = floats(&[1.0, -2.0, 0.0]);
        for (bytes, sensor) in [
            (packet(1, 7, &turned), 0),
            (packet(16, 7, &turned), 1),
            (packet(17, 7, &with(&[5, 1], &[3])), 5),
            (packet(23, 7, &short), 2),
            (packet(101, 7, &compact), 2),
            (bundled(&[inner(17, &with(&[4, 1], &[0]))]), 4),
        ] {
            let found = Datagram::parse(&bytes).unwrap();
            assert_eq!(found.number, 7);
            let [
                Message::Rotation {
                    sensor: own,
                    orientation: [w, x, y, z],
                    acceleration,
                },
            ] = found.messages[..]
            else {
                panic!("{found:?}");
            };
            assert_eq!(own, sensor);
            for (found, expected) in [(w, 0.8), (x, 0.0), (y, 0.6), (z, 0.0)] {
                assert!((found - expected).abs() < 1e-4, "{found} {expected}");
            }
            assert_eq!(acceleration, (sensor == 2).then_some([1.0, -2.0, 0.0]));
        }
        let both = bundled(&[
            inner(17, &with(&[0, 1], &[0])),
            inner(4, &[&pushed[..], &[0]].concat()),
        ]);
        let found = Datagram::parse(&both).unwrap().messages;
        assert!(
            matches!(found[1], Message::Acceleration { sensor: 0, acceleration: [x, ..] } if (x - 1.0).abs() < 1e-9)
        );
        // A correction is not an orientation.
        let correction = Datagram::parse(&packet(17, 7, &with(&[0, 2], &[0]))).unwrap();
        assert_eq!(correction.messages, [Message::Unused(17)]);
    }

    #[test]
    fn what_is_none_of_a_tracker_or_impossible_is_told_apart() {
        assert_eq!(Datagram::parse(b"MXTP02 and more of it"), None);
        assert_eq!(Datagram::parse(&[0; 11]), None);
        let only = |bytes: &[u8]| Datagram::parse(bytes).unwrap().messages.pop();
        assert_eq!(only(&packet(77, 1, &[])), Some(Message::Unknown(77)));
        assert_eq!(only(&packet(17, 1, &[0, 1, 0])), Some(Message::Damaged));
        assert_eq!(only(&packet(100, 1, &[0, 9, 0])), Some(Message::Damaged));
        for parts in [[0.0; 4], [f32::NAN; 4], [1.0, 1.0, 0.0, 0.0]] {
            let bytes = packet(1, 1, &floats(&parts));
            assert_eq!(only(&bytes), Some(Message::Impossible), "{parts:?}");
        }
        let far = packet(4, 1, &floats(&[f32::INFINITY, 0.0, 0.0]));
        assert_eq!(only(&far), Some(Message::Impossible));
    }

    #[test]
    fn handshakes_of_old_and_new_firmware_are_understood() {
        let mut payload = Vec::new();
        for part in [9_u32, 4, 1, 0, 0, 0, 22] {
            payload.extend(part.to_be_bytes());
        }
        payload.extend(b"\x050.7.2\x02\xAB\xCD\x00\x01\x02\x00\x04Name");
        let full = Handshake {
            sensor_type: 4,
            protocol: 22,
            firmware: "0.7.2".to_owned(),
            mac: Some([2, 0xAB, 0xCD, 0, 1, 2]),
        };
        let of = |payload: &[u8]| match Datagram::parse(&packet(3, 0, payload)).unwrap().messages[..]
        {
            [Message::Handshake(ref found)] => found.clone(),
            ref other => panic!("{other:?}"),
        };
        assert_eq!(of(&payload), full);
        assert_eq!(of(&[]), Handshake::default());
        for length in 0..payload.len() {
            let found = of(&payload[..length]);
            assert!(found.mac.is_none() || length >= 40, "{length}: {found:?}");
        }
    }

    proptest! {
        #[test]
        fn no_bytes_stop_it(kind in 0_u8..=110, bytes: Vec<u8>) {
            let _ = Datagram::parse(&bytes);
            let found = Datagram::parse(&packet(u32::from(kind), 1, &bytes)).unwrap();
            for message in found.messages {
                if let Message::Rotation { orientation, .. } = message {
                    let square: f64 = orientation.iter().map(|part| part * part).sum();
                    prop_assert!((square - 1.0).abs() < 1e-9);
                }
            }
        }
    }
}
