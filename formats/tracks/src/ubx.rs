//! UBX, the receivers' own protocol (`RAW.UBX` of a FlySight 2): NAV-PVT messages, which have time, position and
//! velocity. Messages with a bad checksum are skipped.

use bodyflight_falls::Sample;
use bodyflight_falls::channels::Given;
use bodyflight_io::diagnostic::Result;
use nalgebra::Vector3;

use crate::points::{Flat, HIGHEST, in_order, seconds_of};
use crate::track::Track;

/// Beginning of a message, and class and number of NAV-PVT.
const SYNC: [u8; 2] = [0xB5, 0x62];
const NAV_PVT: [u8; 2] = [0x01, 0x07];

/// Bytes of NAV-PVT without frame.
const LENGTH: usize = 92;

/// Whether these bytes begin with a message.
pub(crate) fn is_ubx(bytes: &[u8]) -> bool {
    bytes.starts_with(&SYNC)
}

pub(crate) fn read(bytes: &[u8]) -> Result<Track> {
    let (mut fixes, mut skipped, mut at) = (Vec::new(), 0, 0);
    while let Some(found) = bytes[at..].windows(2).position(|pair| pair == SYNC) {
        at += found;
        let Some(payload) = payload(&bytes[at..]) else {
            at += SYNC.len();
            continue;
        };
        if bytes[at + 2..].starts_with(&NAV_PVT) && payload.len() >= LENGTH {
            match fix(payload) {
                Some(fix) => fixes.push(fix),
                None => skipped += 1,
            }
        }
        at += payload.len() + 8;
    }
    let (fixes, out_of_order, notes) = in_order(fixes, |(time, ..): &mut Fix| time);
    let mut flat = Flat::default();
    let first = fixes.first().map(|(time, ..)| *time);
    let samples = fixes
        .iter()
        .map(|(time, place, height, velocity, ..)| Sample {
            time: time - first.unwrap_or(0.0),
            position: flat.position(*place, *height),
            velocity: *velocity,
        });
    Ok(Track {
        format: "UBX",
        samples: samples.collect(),
        speed_accuracy: fixes
            .iter()
            .map(|(.., [speed, _])| Some(*speed).filter(|speed| *speed > 0.0))
            .collect(),
        position_accuracy: fixes
            .iter()
            .map(|(.., [_, position])| Some(*position).filter(|position| *position > 0.0))
            .collect(),
        start: first,
        given: Given {
            places: true,
            velocities: true,
            speeds: false,
        },
        inertial: Vec::new(),
        pressure: Vec::new(),
        skipped: skipped + out_of_order,
        notes,
    })
}

/// The payload of the message at the start of these bytes; `None` if it is not complete or its checksum is wrong.
fn payload(bytes: &[u8]) -> Option<&[u8]> {
    let length = usize::from(u16::from_le_bytes([*bytes.get(4)?, *bytes.get(5)?]));
    let checked = bytes.get(2..6 + length)?;
    let sum = checked.iter().fold([0_u8; 2], |[a, b], byte| {
        let a = a.wrapping_add(*byte);
        [a, b.wrapping_add(a)]
    });
    (bytes.get(6 + length..8 + length)? == sum).then(|| &checked[4..])
}

/// Time (s since 1970), latitude and longitude (degrees), height above mean sea level (m), velocity north, west, up
/// and the accuracy of that and of the place or the height, whichever is worse (m).
type Fix = (f64, [f64; 2], f64, Vector3<f64>, [f64; 2]);

/// Reads a solution; `None` without a fix in three dimensions.
fn fix(payload: &[u8]) -> Option<Fix> {
    let four = |at: usize| {
        Some(f64::from(i32::from_le_bytes(
            payload.get(at..at + 4)?.try_into().ok()?,
        )))
    };
    let positive = |at: usize| {
        let bytes = payload.get(at..at + 4)?.try_into().ok()?;
        Some(f64::from(u32::from_le_bytes(bytes)))
    };
    let byte = |at: usize| payload.get(at).copied().map(u32::from);
    let is_fixed = payload[20] == 3 || payload[20] == 4;
    let year = u16::from_le_bytes([payload[4], payload[5]]);
    let time_of_day = f64::from(3600 * byte(8)? + 60 * byte(9)? + byte(10)?) + four(16)? * 1e-9;
    let time = seconds_of(i32::from(year), byte(6)?, byte(7)?, time_of_day)?;
    let velocity = Vector3::new(four(48)?, -four(52)?, -four(56)?) * 1e-3;
    let is_near = (four(36)? * 1e-3).abs() < HIGHEST;
    (is_fixed && is_near).then_some((
        time,
        [four(28)? * 1e-7, four(24)? * 1e-7],
        four(36)? * 1e-3,
        velocity,
        [four(68)? * 1e-3, positive(40)?.max(positive(44)?) * 1e-3],
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(second: u8, height: i32) -> Vec<u8> {
        let mut payload = vec![0; LENGTH];
        payload[4..6].copy_from_slice(&2024_u16.to_le_bytes());
        payload[6..11].copy_from_slice(&[6, 1, 10, 0, second]);
        payload[20] = 3;
        payload[24..28].copy_from_slice(&80_000_000_i32.to_le_bytes());
        payload[28..32].copy_from_slice(&465_000_000_i32.to_le_bytes());
        payload[36..40].copy_from_slice(&height.to_le_bytes());
        payload[56..60].copy_from_slice(&50_000_i32.to_le_bytes());
        payload[68..72].copy_from_slice(&310_i32.to_le_bytes());
        let mut bytes = [&SYNC[..], &NAV_PVT, &[92, 0], &payload].concat();
        let sum = bytes[2..].iter().fold([0_u8; 2], |[a, b], byte| {
            let a = a.wrapping_add(*byte);
            [a, b.wrapping_add(a)]
        });
        bytes.extend(sum);
        bytes
    }

    #[test]
    fn good_messages_are_read_between_others() {
        let mut bad = message(2, 2_900_000);
        bad[40] ^= 1;
        let bytes = [
            message(1, 3_000_000),
            vec![0xB5, 0x62, 7],
            bad,
            message(3, 2_850_000),
        ]
        .concat();
        assert!(is_ubx(&bytes));
        let track = read(&bytes).unwrap();
        assert_eq!(track.samples.len(), 2);
        assert_eq!(track.start, seconds_of(2024, 6, 1, 36_001.0));
        assert!((track.samples[1].height() - 2850.0).abs() < 1e-9);
        assert!((track.samples[1].velocity.z + 50.0).abs() < 1e-9);
        assert_eq!(track.speed_accuracy, [Some(0.31); 2]);
    }
}
