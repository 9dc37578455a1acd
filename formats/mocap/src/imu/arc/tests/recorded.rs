//! Sensors of the arms of a real person, also with turns on the spot that are planted. The recording, 13 sensors of a suit at
//! 60 Hz (TotalCapture, acting), is not part of the repository.

use std::path::Path;

use nalgebra::{Matrix6, Quaternion, UnitQuaternion, Vector6};

use super::*;

/// Samples per second.
const RATE: f64 = 60.0;
/// Each arm's sensor and its neighbour, by the columns of the file, with the place of the sensor below its joint in the model (m).
const PAIRS: [([&str; 2], f64); 4] = [
    (["LeftArm", "Spine3"], 0.14),
    (["LeftForeArm", "LeftArm"], 0.12),
    (["RightArm", "Spine3"], 0.14),
    (["RightForeArm", "RightArm"], 0.12),
];

/// A sensor's attitudes and forces (m/s2, its axes).
type Track = Vec<(UnitQuaternion<f64>, Vector3<f64>)>;

/// The sensors of a table of quaternions X, Y, Z, W and accelerations, each in one cell.
fn track(text: &str, name: &str) -> Track {
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    let place = |part: &str| {
        let name = format!("{name}_{part}");
        names.iter().position(|own| *own == name).unwrap()
    };
    let (turn, force) = (place("quat"), place("accel"));
    let rows = lines.map(|line| {
        let cells: Vec<&str> = line.split(',').collect();
        let numbers = |place: usize| {
            let numbers = cells[place]
                .split_whitespace()
                .map(|cell| cell.parse().unwrap());
            numbers.collect::<Vec<f64>>()
        };
        let (turn, force) = (numbers(turn), numbers(force));
        let turn = Quaternion::new(turn[3], turn[0], turn[1], turn[2]);
        (
            UnitQuaternion::from_quaternion(turn),
            Vector3::from_row_slice(&force),
        )
    });
    // The first samples are not those of a worn sensor.
    rows.skip(5).collect()
}

/// What a sensor feels at each sample but the first and the last, with the joint at a place in its axes (m).
fn felt(track: &Track, joint: &Vector3<f64>) -> Vec<Felt<f64>> {
    let each = track.windows(3).map(|three| {
        let [before, (attitude, force), after] = three else {
            unreachable!()
        };
        let rate = (before.0.inverse() * after.0).scaled_axis() * (0.5 * RATE);
        Felt {
            attitude: *attitude,
            force: attitude * force,
            to_joint: attitude * joint,
            rate: attitude * rate,
        }
    });
    each.collect()
}

/// Where the joint of two sensors is, in the axes of each (m): where both feel the same.
fn joint(own: &Track, neighbour: &Track) -> [Vector3<f64>; 2] {
    let sides = [own, neighbour].map(|track| felt(track, &Vector3::zeros()));
    let turning = |felt: &Felt<f64>| {
        felt.rate.cross_matrix() * felt.attitude.to_rotation_matrix().into_inner()
    };
    let (mut square, mut product) = (Matrix6::identity(), Vector6::zeros());
    for at in 3..sides[0].len() - 3 {
        let [own, other] = [0, 1].map(|of| {
            let change = turning(&sides[of][at + 3]) - turning(&sides[of][at - 3]);
            (
                sides[of][at - 3..=at + 3]
                    .iter()
                    .map(|felt| felt.force)
                    .sum::<Vector3<f64>>()
                    / 7.0,
                change * (RATE / 6.0),
            )
        });
        for axis in 0..3 {
            let mut row = Vector6::zeros();
            row.fixed_rows_mut::<3>(0)
                .copy_from(&own.1.row(axis).transpose());
            row.fixed_rows_mut::<3>(3)
                .copy_from(&-other.1.row(axis).transpose());
            square += row * row.transpose();
            product += row * (other.0[axis] - own.0[axis]);
        }
    }
    let found = square.try_inverse().unwrap() * product;
    [0, 3].map(|from| found.fixed_rows::<3>(from).into_owned())
}

/// The same with the sensor turned end for end on the spot from a sample on, within a duration (s).
fn turned(track: &Track, from: usize, duration: f64, about: &Vector3<f64>) -> Track {
    let each = track.iter().enumerate().map(|(at, (attitude, force))| {
        let share = ((at as f64 - from as f64) / RATE / duration).clamp(0.0, 1.0);
        let angle = core::f64::consts::PI * share * share * (3.0 - 2.0 * share);
        let turn = UnitQuaternion::from_scaled_axis(about * angle);
        (attitude * turn, turn.inverse() * force)
    });
    each.collect()
}

/// Whether an arm's sensor is said to have turned within samples, if it moved before as in the second ones.
fn is_told([own, neighbour]: [&Track; 2], before: [&Track; 2], joint: &[Vector3<f64>; 2]) -> bool {
    let mut arm = Arm::default();
    let sound = felt(before[0], &joint[0])
        .into_iter()
        .zip(felt(before[1], &joint[1]));
    for (own, neighbour) in sound {
        arm.take(0.0, 1.0 / RATE, Some([own, neighbour]), false);
    }
    arm.fly();
    let sides = felt(own, &joint[0])
        .into_iter()
        .zip(felt(neighbour, &joint[1]));
    for (at, (own, neighbour)) in sides.enumerate() {
        arm.take(at as f64 / RATE, 1.0 / RATE, Some([own, neighbour]), true);
    }
    arm.turned.is_some()
}

#[test]
#[ignore = "needs the file output_quat_accel.csv in the folder named by BODYFLIGHT_TOTALCAPTURE"]
fn arms_of_a_real_person_are_told_only_if_their_sensors_turn() {
    let folder = std::env::var_os("BODYFLIGHT_TOTALCAPTURE").expect("BODYFLIGHT_TOTALCAPTURE");
    let file = Path::new(&folder).join("output_quat_accel.csv");
    let text = std::fs::read_to_string(file).expect("the file");
    let durations = [0.2, 0.3, 0.5, 1.0, 2.0];
    let (mut named, mut all) = ([0; 5], 0);
    for ([own, neighbour], length) in PAIRS {
        let name = own;
        let [own, neighbour] = [own, neighbour].map(|name| track(&text, name));
        let found = joint(&own, &neighbour);
        println!(
            "{name}: the joint is {:.2} m from the sensor, and {:.2} m from its neighbour",
            found[0].norm(),
            found[1].norm()
        );
        let joint = [found[0].normalize() * length, found[1]];
        let first = [&own, &neighbour].map(|track| track[..600].to_vec());
        let before = [&first[0], &first[1]];
        assert!(
            !is_told([&own, &neighbour], before, &joint),
            "{name} without a fault"
        );
        for from in (660..own.len() - 300).step_by(50) {
            all += 1;
            let skew = Vector3::new(
                (from as f64).sin(),
                (2.0 * from as f64).cos(),
                (3.0 * from as f64).sin(),
            );
            let about = joint[0].cross(&skew).normalize();
            for (named, duration) in named.iter_mut().zip(durations) {
                let turned = turned(&own, from, duration, &about);
                let part = from - 60..from + 240;
                let cut = |track: &Track| track[part.clone()].to_vec();
                *named += i32::from(is_told([&cut(&turned), &cut(&neighbour)], before, &joint));
            }
        }
    }
    for (named, duration) in named.into_iter().zip(durations) {
        println!("end for end within {duration} s: {named} of {all} named");
        assert!(
            duration > 1.0 || 20 * named >= 19 * all,
            "{duration}: {named} of {all}"
        );
    }
}
