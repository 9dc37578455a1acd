//! Kinds of nonsense, as changes of a good recording.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::recorded::{Frame, Kind, edited, frames, kept};

const SEGMENTS: usize = 23;
const LEFT_ARM: usize = 11;
const RIGHT_ARM: usize = 7;
pub(super) const RIGHT_FOREARM: usize = 9;
pub(super) const LEFT_HAND: usize = 14;
const RIGHT_LEG: usize = 15;
const LEFT_LEG: usize = 19;

pub(super) fn scale(of: &mut [Vector3<f64>], factor: f64) {
    of.iter_mut().for_each(|vector| *vector *= factor);
}

fn exchange<T>(of: &mut [T], first: usize, second: usize) {
    (0..4).for_each(|place| of.swap(first + place, second + place));
}

/// Small noise that differs from number to number.
pub(super) fn noise(frame: usize, place: usize) -> f64 {
    ((frame * 7919 + place * 104_729) as f64 * 0.618).sin()
}

/// The first posture of a recording, at rest with a pelvis turned and moved so.
pub(super) fn at_rest(
    index: usize,
    all: &[Frame],
    frame: &mut Frame,
    turned: UnitQuaternion<f64>,
    walks: f64,
) {
    let time = index as f64 / 240.0;
    let from = all[0].position[0];
    let place = Vector3::new(
        walks * time + 0.004 * (1.1 * time).sin(),
        0.003 * time.cos(),
        1.0,
    );
    let moves = Vector3::new(
        walks + 0.0044 * (1.1 * time).cos(),
        -0.003 * time.sin(),
        0.0,
    );
    for segment in 0..SEGMENTS {
        let [w, x, y, z] = all[0].orientation[segment];
        let q = turned * UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z));
        let jitter = 2e-5 * noise(index, segment);
        frame.orientation[segment] = [q.w, q.i + jitter, q.j - jitter, q.k];
        frame.position[segment] = turned * (all[0].position[segment] - from) + place;
        frame.velocity[segment] = moves + Vector3::repeat(0.01 * noise(index, 30 + segment));
        frame.rate[segment] = Vector3::repeat(0.01 * noise(index, 60 + segment));
    }
}

/// The turn that sets the first frame's pelvis upright.
pub(super) fn upright(all: &[Frame]) -> UnitQuaternion<f64> {
    let [w, x, y, z] = all[0].orientation[0];
    UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z)).inverse()
}

pub(super) const KINDS: [Kind; 41] = [
    frames("nothing", |_, _, _| {}),
    frames("velocities empty", |_, _, f| scale(&mut f.velocity, 0.0)),
    frames("velocities halved", |_, _, f| scale(&mut f.velocity, 0.5)),
    frames("velocities in km/h", |_, _, f| scale(&mut f.velocity, 3.6)),
    frames("velocities in knots", |_, _, f| {
        scale(&mut f.velocity, 1.943_84)
    }),
    frames("velocities 5 % high", |_, _, f| {
        scale(&mut f.velocity, 1.05)
    }),
    frames("vertical velocity positive down", |_, _, f| {
        f.velocity.iter_mut().for_each(|v| v.z = -v.z);
    }),
    frames("north and west velocity exchanged", |_, _, f| {
        f.velocity.iter_mut().for_each(|v| v.swap_rows(0, 1));
    }),
    frames("velocity off by 20 m/s from 6.25 s", |index, _, f| {
        if index >= 1500 {
            f.velocity.iter_mut().for_each(|v| v.x += 20.0);
        }
    }),
    frames("positions in feet", |_, _, f| {
        scale(&mut f.position, 3.280_84)
    }),
    frames("positions in millimetres", |_, _, f| {
        scale(&mut f.position, 1000.0)
    }),
    frames("positions frozen", |_, all, f| {
        f.position.clone_from(&all[0].position)
    }),
    frames("positions jump by 50 m", |index, _, f| {
        if index >= 1500 {
            f.position.iter_mut().for_each(|p| p.x += 50.0);
        }
    }),
    frames("rates in degrees", |_, _, f| scale(&mut f.rate, 57.295_78)),
    frames("rates empty", |_, _, f| scale(&mut f.rate, 0.0)),
    frames("rates halved", |_, _, f| scale(&mut f.rate, 0.5)),
    frames("rates of the other sense", |_, _, f| {
        scale(&mut f.rate, -1.0)
    }),
    frames("quaternions x y z w", |_, _, f| {
        f.orientation.iter_mut().for_each(|q| q.rotate_left(1));
    }),
    frames("quaternions inverse", |_, _, f| {
        f.orientation.iter_mut().for_each(|q| q[0] = -q[0]);
    }),
    frames("quaternions of length 2", |_, _, f| {
        f.orientation
            .iter_mut()
            .flatten()
            .for_each(|part| *part *= 2.0);
    }),
    frames("forearm frozen from 4 s", |index, all, f| {
        if index >= 960 {
            f.orientation[RIGHT_FOREARM] = all[960].orientation[RIGHT_FOREARM];
        }
    }),
    frames("thigh frozen with noise", |index, all, f| {
        if index >= 960 {
            f.orientation[RIGHT_LEG] =
                all[960].orientation[RIGHT_LEG].map(|part| part + 1e-4 * noise(index, 0));
        }
    }),
    frames("pelvis frozen for 1.8 s", |index, all, f| {
        if (960..1392).contains(&index) {
            f.orientation[0] = all[960].orientation[0];
        }
    }),
    frames("everything frozen for 1.2 s", |index, all, f| {
        if (1500..1788).contains(&index) {
            let open = f.open.clone();
            *f = Frame {
                open,
                ..all[1500].clone()
            };
        }
    }),
    frames("left and right leg exchanged", |_, _, f| {
        exchange(&mut f.orientation, RIGHT_LEG, LEFT_LEG);
        exchange(&mut f.position, RIGHT_LEG, LEFT_LEG);
        exchange(&mut f.velocity, RIGHT_LEG, LEFT_LEG);
        exchange(&mut f.rate, RIGHT_LEG, LEFT_LEG);
    }),
    frames("left and right arm turned as each other", |_, _, f| {
        exchange(&mut f.orientation, RIGHT_ARM, LEFT_ARM);
    }),
    frames("hand 0.3 m away for 1.2 s", |index, _, f| {
        if (900..1188).contains(&index) {
            f.position[LEFT_HAND].x += 0.3;
        }
    }),
    frames("heading jumps by 45 degrees", |index, _, f| {
        if index >= 1500 {
            let turn =
                UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 0.25 * std::f64::consts::PI);
            for q in &mut f.orientation {
                let [w, x, y, z] = *q;
                let turned = turn.quaternion() * Quaternion::new(w, x, y, z);
                *q = [turned.w, turned.i, turned.j, turned.k];
            }
        }
    }),
    frames("every second frame twice", |index, all, f| {
        let open = f.open.clone();
        *f = Frame {
            open,
            ..all[index - index % 2].clone()
        };
    }),
    edited(
        "header says 120 frames a second",
        "flight.mvnx",
        "frameRate=\"240\"",
        "frameRate=\"120\"",
    ),
    edited(
        "header says 252 frames a second",
        "flight.mvnx",
        "frameRate=\"240\"",
        "frameRate=\"252\"",
    ),
    frames("frame times 5 % fast", |_, _, f| {
        let (before, rest) = f.open.split_once("time=\"").unwrap_or_default();
        let (time, after) = rest.split_once('"').unwrap_or_default();
        let time = time.parse().unwrap_or(0.0) / 1.05;
        f.open = format!("{before}time=\"{time:.0}\"{after}");
    }),
    frames("the body stands", |index, all, f| {
        at_rest(index, all, f, upright(all), 0.0)
    }),
    frames("the body lies", |index, all, f| {
        at_rest(index, all, f, UnitQuaternion::identity(), 0.0)
    }),
    frames("the body walks", |index, all, f| {
        at_rest(index, all, f, upright(all), 1.3)
    }),
    frames("a wind tunnel without its air", |_, _, f| {
        let (falls, height) = (f.velocity[0].z, f.position[0].z);
        f.velocity.iter_mut().for_each(|v| v.z -= falls);
        f.position.iter_mut().for_each(|p| p.z -= height);
    }),
    edited(
        "a person of 1.20 m",
        "subject.toml",
        "height_m = 1.75",
        "height_m = 1.2",
    ),
    edited(
        "a person of 2.20 m",
        "subject.toml",
        "height_m = 1.75",
        "height_m = 2.2",
    ),
    edited(
        "a person of 20 kg",
        "subject.toml",
        "mass_kg = 75.0",
        "mass_kg = 20",
    ),
    frames("accelerations with gravity", |_, _, f| {
        f.acceleration.iter_mut().for_each(|a| a.z += 9.81);
    }),
    kept("0.1 s of flight", |index| index < 24),
];
