//! BNO08x in its UART-RVC mode: 19 bytes, a hundred times a second, at 115200 baud.
//!
//! `AA AA | index | yaw, pitch, roll | x, y, z acceleration | three reserved | checksum`, little-endian: hundredths of a
//! degree and milli-g. The checksum is the sum of the bytes between the header and itself. Source: CEVA, BNO08X data
//! sheet, chapter 1.3.5.2 (UART-RVC protocol).
//!
//! The angles are a vehicle's, whose X points ahead, along the chip's Y, whose Y points to the right, along the chip's X, and
//! whose Z points down: so yaw grows clockwise as seen from above. Accelerations are along the chip's axes. The data sheet
//! does not say so, but its example fits no other axes: its acceleration then points up by its angles, within 0.1 degrees.
//!
//! The mode gives neither angular velocity nor magnetometer, and its yaw drifts from an arbitrary start: a receiver must
//! give the direction of flight.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::reading::{Reading, from_angles};

const HEADER: u8 = 0xaa;

/// Length of a packet (bytes).
const LENGTH: usize = 19;

/// Ticks of 0.1 ms between packets.
const INTERVAL: u32 = 100;

/// Acceleration of a milli-g (m/s2).
const MILLI_G: f32 = 9.806_65e-3;

/// Finds packets in arbitrary bytes: after a wrong checksum the search resumes one byte later.
#[derive(Debug)]
pub(super) struct Decoder {
    bytes: [u8; LENGTH],
    length: usize,
    /// Index and unwrapped number of the last packet, from which its time follows.
    last: Option<(u8, u32)>,
}

impl Decoder {
    pub(super) const fn new() -> Self {
        Self {
            bytes: [0; LENGTH],
            length: 0,
            last: None,
        }
    }

    /// Returns the next packet's content and advances `input` past the bytes used.
    pub(super) fn next(&mut self, input: &mut &[u8]) -> Option<Reading> {
        while let Some((byte, rest)) = input.split_first() {
            *input = rest;
            if let Some(place) = self.bytes.get_mut(self.length) {
                *place = *byte;
                self.length += 1;
            }
            // Drops bytes from the front until what is left may be a packet.
            while self.length > 0 && !self.is_possible() {
                self.bytes.copy_within(1.., 0);
                self.length -= 1;
            }
            if self.length == LENGTH {
                self.length = 0;
                return Some(self.decode());
            }
        }
        None
    }

    /// Whether the bytes so far are the start of a packet, or a whole one with the right checksum.
    fn is_possible(&self) -> bool {
        let [first, second, content @ .., sum] = &self.bytes;
        let starts = *first == HEADER && (self.length < 2 || *second == HEADER);
        let found = content
            .iter()
            .fold(0_u8, |sum, byte| sum.wrapping_add(*byte));
        starts && (self.length < LENGTH || found == *sum)
    }

    fn decode(&mut self) -> Reading {
        let [
            _,
            _,
            index,
            y0,
            y1,
            p0,
            p1,
            r0,
            r1,
            fx0,
            fx1,
            fy0,
            fy1,
            fz0,
            fz1,
            ..,
        ] = self.bytes;
        let number = self.last.map_or(0, |(last, number)| {
            number.wrapping_add(u32::from(index.wrapping_sub(last)))
        });
        self.last = Some((index, number));
        let angle = |low, high| f32::from(i16::from_le_bytes([low, high])) * 0.01;
        let force = |low, high| f32::from(i16::from_le_bytes([low, high])) * MILLI_G;
        let [yaw, pitch, roll] = [angle(y0, y1), angle(p0, p1), angle(r0, r1)];
        // The start of the yaw is taken as north.
        let inertial_from_sensor = in_axes_of_chip(&from_angles([roll, pitch, yaw]));
        let [low, high, ..] = number.to_le_bytes();
        Reading {
            counter: Some(u16::from_le_bytes([low, high])),
            fine_time: Some(number.wrapping_mul(INTERVAL)),
            inertial_from_sensor: Some(inertial_from_sensor),
            specific_force: Some(Vector3::new(
                force(fx0, fx1),
                force(fy0, fy1),
                force(fz0, fz1),
            )),
            ..Reading::default()
        }
    }
}

/// A rotation in the vehicle's axes in those of the chip, or the other way round.
fn in_axes_of_chip(turn: &UnitQuaternion<f32>) -> UnitQuaternion<f32> {
    let Quaternion { coords } = **turn;
    // Of the same length.
    UnitQuaternion::new_unchecked(Quaternion::new(coords.w, coords.y, coords.x, -coords.z))
}

/// A packet as a sensor sends it, of an attitude and a specific force (m/s2).
#[cfg(test)]
pub(crate) fn packet(
    index: u8,
    inertial_from_sensor: &UnitQuaternion<f32>,
    force: &Vector3<f32>,
) -> [u8; LENGTH] {
    let (roll, pitch, yaw) = in_axes_of_chip(inertial_from_sensor).euler_angles();
    let angles = [yaw, pitch, roll].map(|angle| angle.to_degrees() * 100.0);
    let forces = [force.x, force.y, force.z].map(|force| force / MILLI_G);
    let mut packet = [0; LENGTH];
    packet[..3].copy_from_slice(&[HEADER, HEADER, index]);
    let numbers = angles.into_iter().chain(forces);
    for (bytes, number) in packet[3..].chunks_exact_mut(2).zip(numbers) {
        #[expect(clippy::cast_possible_truncation, reason = "saturates")]
        bytes.copy_from_slice(&((number + 0.5).floor() as i16).to_le_bytes());
    }
    packet[LENGTH - 1] = packet[2..LENGTH - 1]
        .iter()
        .fold(0, |sum: u8, byte| sum.wrapping_add(*byte));
    packet
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use proptest::prelude::*;

    use super::*;

    /// The example of the data sheet: index 0xDE, yaw 0.01 deg, pitch -1.10 deg, roll 20.85 deg, accelerations -371,
    /// -20 and 977 milli-g.
    const PUBLISHED: [u8; LENGTH] = [
        0xaa, 0xaa, 0xde, 0x01, 0x00, 0x92, 0xff, 0x25, 0x08, 0x8d, 0xfe, 0xec, 0xff, 0xd1, 0x03,
        0x00, 0x00, 0x00, 0xe7,
    ];

    fn sealed(mut packet: [u8; LENGTH]) -> [u8; LENGTH] {
        packet[LENGTH - 1] = packet[2..LENGTH - 1]
            .iter()
            .fold(0, |sum: u8, byte| sum.wrapping_add(*byte));
        packet
    }

    #[test]
    fn the_published_packet_is_read() {
        let mut decoder = Decoder::new();
        let reading = decoder.next(&mut PUBLISHED.as_slice()).unwrap();
        let turn = in_axes_of_chip(&reading.inertial_from_sensor.unwrap());
        let (roll, pitch, yaw) = turn.euler_angles();
        for (found, degrees) in [(yaw, 0.01_f32), (pitch, -1.10), (roll, 20.85)] {
            assert!(
                (found.to_degrees() - degrees).abs() < 1e-3,
                "{found} {degrees}"
            );
        }
        let force = reading.specific_force.unwrap() / MILLI_G;
        assert!(
            (force - Vector3::new(-371.0, -20.0, 977.0)).amax() < 0.1,
            "{force}"
        );
    }

    /// The acceleration in it, of a sensor at rest, points up by its angles.
    #[test]
    fn the_angles_of_the_published_packet_are_about_the_axes_of_its_acceleration() {
        let reading = Decoder::new().next(&mut PUBLISHED.as_slice()).unwrap();
        let force = reading.inertial_from_sensor.unwrap() * reading.specific_force.unwrap();
        let tilt = force.xy().norm().atan2(force.z).to_degrees();
        assert!(tilt < 0.1, "{tilt} degrees");
    }

    #[test]
    fn yaw_grows_clockwise_as_seen_from_above() {
        let mut packet = PUBLISHED;
        // 90 degrees, 0 and 0.
        packet[3..9].copy_from_slice(&[0x28, 0x23, 0, 0, 0, 0]);
        let reading = Decoder::new().next(&mut sealed(packet).as_slice()).unwrap();
        // What points ahead (X north, Y west) points east.
        let ahead = reading.inertial_from_sensor.unwrap() * Vector3::x();
        assert!((ahead + Vector3::y()).norm() < 1e-3, "{ahead}");
    }

    #[test]
    fn lost_packets_are_seen_in_the_time() {
        let mut decoder = Decoder::new();
        let times: Vec<_> = [250_u8, 251, 255, 3]
            .into_iter()
            .map(|index| {
                let mut packet = PUBLISHED;
                packet[2] = index;
                let reading = decoder.next(&mut sealed(packet).as_slice());
                reading.unwrap().fine_time.unwrap()
            })
            .collect();
        assert_eq!(times, [0, 100, 500, 900]);
    }

    proptest! {
        #[test]
        fn a_packet_is_found_after_anything(noise in prop::collection::vec(prop_oneof![Just(0xaa_u8), any::<u8>()], 0..60)) {
            let line = [&noise[..], &PUBLISHED, &PUBLISHED, &PUBLISHED].concat();
            let mut decoder = Decoder::new();
            let mut input = line.as_slice();
            let mut found = 0;
            while decoder.next(&mut input).is_some() {
                found += 1;
            }
            prop_assert!(found >= 2, "{found}");
        }
    }
}
