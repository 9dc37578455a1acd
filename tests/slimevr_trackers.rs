//! SlimeVR's trackers for tests: their packets, written from the description of the protocol, and recorded traffic.

use std::net::SocketAddr;

use nalgebra::{UnitQuaternion, Vector3};

/// How a tracker sends orientation and acceleration.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// A packet for each.
    Separate,
    /// Both in a bundle.
    Bundled,
    /// Both in 16 bits for each number, in a bundle with short heads.
    Compact,
}

/// A tracker that sends.
#[derive(Debug, Clone)]
pub struct Tracker {
    /// Address of its network card.
    pub mac: [u8; 6],
    /// Version of its protocol.
    pub protocol: u32,
    /// How it sends.
    pub form: Form,
    /// Number of the last packet.
    pub number: u64,
}

impl Tracker {
    /// A tracker with the newest firmware.
    pub fn new(last: u8, form: Form) -> Self {
        Self {
            mac: [0xA0, 0xB1, 0xC2, 0xD3, 0xE4, last],
            protocol: 22,
            form,
            number: 0,
        }
    }

    /// The address as users write it.
    pub fn name(&self) -> String {
        self.mac.map(|part| format!("{part:02X}")).join(":")
    }

    /// A packet of a type.
    pub fn packet(&mut self, kind: u32, payload: &[u8]) -> Vec<u8> {
        self.number += 1;
        [&kind.to_be_bytes()[..], &self.number.to_be_bytes(), payload].concat()
    }

    /// It looks for a server.
    pub fn handshake(&self, sensor_type: u32) -> Vec<u8> {
        let parts = [3, 0, 0, 4, sensor_type, 2, 0, 0, 0, self.protocol];
        let mut bytes: Vec<u8> = parts
            .iter()
            .flat_map(|part: &u32| part.to_be_bytes())
            .collect();
        bytes.extend(b"\x050.7.2");
        bytes.extend(self.mac);
        bytes.extend([0, 0, 0, 0, 0, 0]);
        bytes
    }

    /// What a sensor of it is.
    pub fn information(&mut self, sensor: u8, sensor_type: u8, has_magnetometer: bool) -> Vec<u8> {
        let settings = 2 + u8::from(has_magnetometer);
        self.packet(15, &[sensor, 1, sensor_type, 0, settings, 1, 0, 0])
    }

    /// The packets of a sample.
    pub fn sample(
        &mut self,
        sensor: u8,
        turn: &UnitQuaternion<f64>,
        acceleration: &Vector3<f64>,
    ) -> Vec<Vec<u8>> {
        let [x, y, z, w] = [turn.i, turn.j, turn.k, turn.w];
        let rotation = [&[sensor, 1][..], &floats(&[x, y, z, w]), &[0]].concat();
        let pushed = [&floats(acceleration.as_slice())[..], &[sensor]].concat();
        let inner = |kind: u32, payload: &[u8]| {
            let length = u16::try_from(payload.len() + 4).expect("short");
            [&length.to_be_bytes()[..], &kind.to_be_bytes(), payload].concat()
        };
        match self.form {
            Form::Separate => vec![self.packet(17, &rotation), self.packet(4, &pushed)],
            Form::Bundled => {
                let both = [inner(17, &rotation), inner(4, &pushed)].concat();
                vec![self.packet(100, &both)]
            }
            Form::Compact => {
                let mut payload = vec![16, 23, sensor];
                let turned = [x, y, z, w].map(|part| part * 32_767.0);
                let pushed = [0, 1, 2].map(|axis| acceleration[axis] * 128.0);
                for part in turned.into_iter().chain(pushed) {
                    #[expect(
                        clippy::cast_possible_truncation,
                        reason = "it saturates, as on a tracker"
                    )]
                    payload.extend((part.round() as i16).to_be_bytes());
                }
                vec![self.packet(101, &payload)]
            }
        }
    }
}

fn floats(values: &[f64]) -> Vec<u8> {
    let each = values.iter().flat_map(|value| {
        #[expect(
            clippy::cast_possible_truncation,
            reason = "trackers have single precision"
        )]
        (*value as f32).to_be_bytes()
    });
    each.collect()
}

/// Recorded traffic to port 6969: times (s), senders and contents, as a file of pcap with IP alone.
pub fn pcap(traffic: &[(f64, SocketAddr, Vec<u8>)]) -> Vec<u8> {
    let mut bytes = Vec::new();
    for number in [0xA1B2_C3D4_u32, 0x0004_0002, 0, 0, 65_535, 101] {
        bytes.extend(number.to_le_bytes());
    }
    for (time, from, content) in traffic {
        let SocketAddr::V4(from) = from else {
            continue;
        };
        let of_udp = u16::try_from(content.len() + 8).expect("short");
        let whole = of_udp + 20;
        let mut packet = vec![0x45, 0];
        packet.extend(whole.to_be_bytes());
        packet.extend([0, 0, 0x40, 0, 64, 17, 0, 0]);
        packet.extend(from.ip().octets());
        packet.extend([192, 168, 1, 2]);
        packet.extend(from.port().to_be_bytes());
        packet.extend(6969_u16.to_be_bytes());
        packet.extend(of_udp.to_be_bytes());
        packet.extend([0, 0]);
        packet.extend(content);
        let length = u32::from(whole);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "times of some minutes"
        )]
        let stamp = [time.floor() as u32, (time.fract() * 1e6) as u32];
        for number in [1_700_000_000 + stamp[0], stamp[1], length, length] {
            bytes.extend(number.to_le_bytes());
        }
        bytes.extend(packet);
    }
    bytes
}

/// A fusion of six axes: rates, and a slow correction towards the force as if it were that of gravity.
#[derive(Debug, Clone, Copy, Default)]
pub struct Fusion {
    turn: Option<UnitQuaternion<f64>>,
}

/// Time in which the correction acts (s): that of SlimeVR's firmware.
const CORRECTION: f64 = 2.0;

impl Fusion {
    /// Takes rates (rad/s) and specific force (m/s2) over a step (s); returns the orientation (level axes from sensor) and
    /// the acceleration without gravity in the sensor's axes.
    pub fn take(
        &mut self,
        rate: &Vector3<f64>,
        force: &Vector3<f64>,
        step: f64,
    ) -> (UnitQuaternion<f64>, Vector3<f64>) {
        let gravity = Vector3::z() * 9.806_65;
        let begin = || UnitQuaternion::rotation_between(force, &gravity).unwrap_or_default();
        let turn = self.turn.unwrap_or_else(begin);
        let up = turn.inverse() * Vector3::z();
        let tilt = force.normalize().cross(&up) / CORRECTION;
        let turn = turn * UnitQuaternion::from_scaled_axis((rate + tilt) * step);
        self.turn = Some(turn);
        (turn, force - turn.inverse() * gravity)
    }
}
