//! Kinds of nonsense that concern a part of the recording: a limb, a time, a column, or all that moves against all else.

use core::ops::Range;

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::kinds::{LEFT_HAND, RIGHT_FOREARM, scale};
use super::recorded::{Frame, Kind, edited, frames, kept};

const HEAD: usize = 6;
const LEFT_FOREARM: usize = 13;
const RIGHT_UPPER_ARM: usize = 8;
const RIGHT_HAND: usize = 10;
const LEFT_ARM: Range<usize> = 11..15;
/// Frames in 0.3 s.
const LATE: usize = 72;

fn rotation([w, x, y, z]: [f64; 4]) -> UnitQuaternion<f64> {
    UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z))
}

fn numbers(of: &UnitQuaternion<f64>) -> [f64; 4] {
    [of.w, of.i, of.j, of.k]
}

/// The same frame number with what another frame contains.
fn becomes(frame: &mut Frame, other: &Frame) {
    let open = frame.open.clone();
    *frame = Frame {
        open,
        ..other.clone()
    };
}

/// The frame 0.3 s before, or the first.
fn before(index: usize, all: &[Frame]) -> &Frame {
    &all[index.saturating_sub(LATE)]
}

/// Turns everything about the first frame's pelvis.
fn turned(all: &[Frame], frame: &mut Frame, by: UnitQuaternion<f64>) {
    let origin = all[0].position[0];
    for place in &mut frame.position {
        *place = origin + by * (*place - origin);
    }
    for vectors in [
        &mut frame.velocity,
        &mut frame.acceleration,
        &mut frame.rate,
    ] {
        vectors.iter_mut().for_each(|vector| *vector = by * *vector);
    }
    for q in &mut frame.orientation {
        *q = numbers(&(by * rotation(*q)));
    }
}

/// Changes the path and the velocities of the whole body in the same way, and leaves its posture.
fn path(all: &[Frame], frame: &mut Frame, change: fn(Vector3<f64>) -> Vector3<f64>) {
    let (origin, here, moves) = (all[0].position[0], frame.position[0], frame.velocity[0]);
    let there = origin + change(here - origin);
    frame.position.iter_mut().for_each(|p| *p += there - here);
    frame
        .velocity
        .iter_mut()
        .for_each(|v| *v += change(moves) - moves);
}

/// Replaces the time of a frame (ms).
fn timed(frame: &mut Frame, change: impl Fn(f64) -> f64) {
    let (before, rest) = frame.open.split_once("time=\"").unwrap_or_default();
    let (time, after) = rest.split_once('"').unwrap_or_default();
    let time = change(time.parse().unwrap_or(0.0));
    frame.open = format!("{before}time=\"{time:.0}\"{after}");
}

/// The forearm keeps its angle to the upper arm, and hangs together with it.
fn stiff(frame: &mut Frame, all: &[Frame], from: usize) {
    let [upper, fore] =
        [RIGHT_UPPER_ARM, RIGHT_FOREARM].map(|at| rotation(all[from].orientation[at]));
    let own = rotation(frame.orientation[RIGHT_FOREARM]);
    let turned = rotation(frame.orientation[RIGHT_UPPER_ARM]) * upper.inverse() * fore;
    let elbow = frame.position[RIGHT_FOREARM];
    let hand = frame.position[RIGHT_HAND] - elbow;
    frame.position[RIGHT_HAND] = elbow + turned * own.inverse() * hand;
    frame.orientation[RIGHT_FOREARM] = numbers(&turned);
}

pub(super) const MIXED: [Kind; 42] = [
    frames("one forearm turned as the other", |_, _, f| {
        f.orientation.swap(RIGHT_FOREARM, LEFT_FOREARM);
    }),
    frames("head frozen for 0.3 s", |index, all, f| {
        if (960..1032).contains(&index) {
            f.orientation[HEAD] = all[960].orientation[HEAD];
        }
    }),
    frames("elbow frozen from 4 s", |index, all, f| {
        if index >= 960 {
            stiff(f, all, 960);
        }
    }),
    kept("half a second missing", |index| {
        !(1000..1120).contains(&index)
    }),
    frames("half a second cut out", |index, all, f| {
        if index >= 1000 {
            becomes(f, &all[(index + 120).min(all.len() - 1)]);
        }
    }),
    frames("backwards for a second", |index, all, f| {
        if (1000..1240).contains(&index) {
            becomes(f, &all[2239 - index]);
        }
    }),
    frames("one second twice", |index, all, f| {
        if (1240..1480).contains(&index) {
            becomes(f, &all[index - 240]);
        }
    }),
    frames("frame times backwards for a second", |index, _, f| {
        if (1000..1240).contains(&index) {
            timed(f, |time| 9330.0 - time);
        }
    }),
    frames("frame times off by a minute from 4 s", |index, _, f| {
        if index >= 960 {
            timed(f, |time| time + 60_000.0);
        }
    }),
    frames("velocities of the pelvis no numbers", |_, _, f| {
        f.velocity[0] = Vector3::repeat(f64::NAN);
    }),
    frames("positions of a hand no numbers", |_, _, f| {
        f.position[LEFT_HAND].z = f64::NAN;
    }),
    frames("rates no numbers from 4 s", |index, _, f| {
        if index >= 960 {
            f.rate[0].x = f64::NAN;
        }
    }),
    frames("velocities in body axes", |_, _, f| {
        let to_body = rotation(f.orientation[0]).inverse();
        f.velocity.iter_mut().for_each(|v| *v = to_body * *v);
    }),
    frames("rates in body axes", |_, _, f| {
        let to_body = rotation(f.orientation[0]).inverse();
        f.rate.iter_mut().for_each(|v| *v = to_body * *v);
    }),
    frames("mirrored", |_, _, f| {
        for vectors in [&mut f.position, &mut f.velocity, &mut f.acceleration] {
            vectors.iter_mut().for_each(|v| v.y = -v.y);
        }
        f.rate
            .iter_mut()
            .for_each(|v| *v = Vector3::new(-v.x, v.y, -v.z));
        f.orientation
            .iter_mut()
            .for_each(|q| *q = [q[0], -q[1], q[2], -q[3]]);
    }),
    frames("positions mirrored", |_, _, f| {
        f.position.iter_mut().for_each(|v| v.y = -v.y);
    }),
    frames("Y up", |_, all, f| {
        let by = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), -std::f64::consts::FRAC_PI_2);
        turned(all, f, by);
    }),
    frames("path with Y up", |_, all, f| {
        path(all, f, |v| Vector3::new(v.x, v.z, -v.y));
    }),
    frames("upside down", |_, all, f| {
        let by = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
        turned(all, f, by);
    }),
    frames("path positive down", |_, all, f| {
        path(all, f, |v| Vector3::new(v.x, v.y, -v.z));
    }),
    frames("path in feet", |_, all, f| path(all, f, |v| 3.280_84 * v)),
    frames("path of twice the speed", |_, all, f| {
        path(all, f, |v| 2.0 * v)
    }),
    frames("path in millimetres", |_, all, f| {
        path(all, f, |v| 1000.0 * v)
    }),
    frames("path in kilometres", |_, all, f| {
        path(all, f, |v| 0.001 * v)
    }),
    frames("velocities in mm/s", |_, _, f| {
        scale(&mut f.velocity, 1000.0)
    }),
    frames("accelerations in mm/s2", |_, _, f| {
        scale(&mut f.acceleration, 1000.0)
    }),
    frames("posture 0.3 s late", |index, all, f| {
        let late = before(index, all);
        let turn = rotation(f.orientation[0]) * rotation(late.orientation[0]).inverse();
        for segment in 1..f.orientation.len() {
            f.orientation[segment] = numbers(&(turn * rotation(late.orientation[segment])));
            f.position[segment] =
                f.position[0] + turn * (late.position[segment] - late.position[0]);
        }
    }),
    frames("attitudes of the limbs 0.3 s late", |index, all, f| {
        f.orientation[1..].copy_from_slice(&before(index, all).orientation[1..]);
    }),
    frames("rates 0.3 s late", |index, all, f| {
        f.rate.clone_from(&before(index, all).rate);
    }),
    frames("rates of the other sense about west", |_, _, f| {
        f.rate.iter_mut().for_each(|v| v.y = -v.y);
    }),
    frames(
        "clock 3 % fast from 4 s, by the velocities",
        |index, _, f| {
            if index >= 960 {
                scale(&mut f.velocity, 1.0 / 1.03);
            }
        },
    ),
    frames("frame times that stand", |_, _, f| timed(f, |_| 0.0)),
    frames("accelerations of 10^5 m/s2", |_, _, f| {
        f.acceleration.fill(Vector3::repeat(1e5));
    }),
    frames("accelerations of 10^6 m/s2", |_, _, f| {
        f.acceleration.fill(Vector3::repeat(1e6));
    }),
    frames("rates of an arm empty", |_, _, f| {
        scale(&mut f.rate[LEFT_ARM], 0.0)
    }),
    frames("rates of an arm in degrees", |_, _, f| {
        scale(&mut f.rate[LEFT_ARM], 57.295_78)
    }),
    frames("velocities of an arm empty", |_, _, f| {
        scale(&mut f.velocity[LEFT_ARM], 0.0)
    }),
    frames("two persons by turns", |index, all, f| {
        if index % 2 == 1 {
            becomes(f, &all[(index + 700) % all.len()]);
            f.position.iter_mut().for_each(|p| p.x += 3.0);
        }
    }),
    frames("another person from 6.25 s", |index, all, f| {
        if index >= 1500 {
            let (here, moves) = (f.position[0], f.velocity[0]);
            becomes(f, &all[index - 1000]);
            let (other, moved) = (f.position[0], f.velocity[0]);
            f.position.iter_mut().for_each(|p| *p += here - other);
            f.velocity.iter_mut().for_each(|v| *v += moves - moved);
        }
    }),
    frames("in an aircraft", |index, all, f| {
        super::kinds::at_rest(index, all, f, super::kinds::upright(all), 50.0)
    }),
    frames("every second frame left out", |index, all, f| {
        becomes(f, &all[(2 * index).min(all.len() - 1)]);
    }),
    edited(
        "mass in pounds",
        "subject.toml",
        "mass_kg = 75.0",
        "mass_kg = 165",
    ),
];
