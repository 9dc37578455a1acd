//! Kinds of nonsense in which the joints stay closed, and those of a while, of noise, and of bodies that do not fall: what
//! lengths alone do not show.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::kinds::{RIGHT_FOREARM, at_rest, noise, scale, upright};
use super::recorded::{Frame, Kind, edited, frames};

/// The segment that each hangs on.
const PARENTS: [usize; 23] = [
    0, 0, 1, 2, 3, 4, 5, 4, 7, 8, 9, 4, 11, 12, 13, 0, 15, 16, 17, 0, 19, 20, 21,
];
const PELVIS: usize = 0;
const HEAD: usize = 6;
const LEFT_UPPER_ARM: usize = 12;
const RIGHT_THIGH: usize = 15;
const RIGHT_SHANK: usize = 16;
const RIGHT_FOOT: usize = 17;
const LEFT_THIGH: usize = 19;
const LEG: usize = 4;

fn rotation([w, x, y, z]: [f64; 4]) -> UnitQuaternion<f64> {
    UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z))
}

fn numbers(of: UnitQuaternion<f64>) -> [f64; 4] {
    [of.w, of.i, of.j, of.k]
}

/// Turns segments, and moves all so that their joints close as in the unchanged frame.
fn closed(index: usize, all: &[Frame], frame: &mut Frame, turn: impl Fn(&mut Vec<[f64; 4]>)) {
    turn(&mut frame.orientation);
    let sound = &all[index];
    for (segment, parent) in PARENTS.into_iter().enumerate().skip(1) {
        let lever = rotation(sound.orientation[parent]).inverse()
            * (sound.position[segment] - sound.position[parent]);
        frame.position[segment] =
            frame.position[parent] + rotation(frame.orientation[parent]) * lever;
    }
}

/// Turns segments by a half about an axis of their own.
fn half_turn(of: &mut [[f64; 4]], axis: Vector3<f64>) {
    let turn = UnitQuaternion::from_scaled_axis(axis * std::f64::consts::PI);
    for q in of {
        *q = numbers(rotation(*q) * turn);
    }
}

/// Turns a limb against the segment at which it hangs, and brings it back within a second.
fn bent(
    index: usize,
    of: &mut [[f64; 4]],
    parent: usize,
    limb: core::ops::Range<usize>,
    turn: Vector3<f64>,
) {
    let share = (std::f64::consts::PI * (index as f64 - 960.0) / 240.0).sin();
    if !(960..1200).contains(&index) {
        return;
    }
    // At the middle of the second, the joint has this rotation alone.
    let (upper, own) = (rotation(of[parent]), rotation(of[limb.start]));
    let there = upper * UnitQuaternion::from_scaled_axis(turn);
    let moved = own.slerp(&there, share) * own.inverse();
    for q in &mut of[limb] {
        *q = numbers(moved * rotation(*q));
    }
}

/// Moves a body at rest with this velocity down (m/s).
fn sinks(index: usize, frame: &mut Frame, speed: f64) {
    let time = index as f64 / 240.0;
    frame.position.iter_mut().for_each(|p| p.z -= speed * time);
    frame.velocity.iter_mut().for_each(|v| v.z -= speed);
}

pub(super) const BODIES: [Kind; 33] = [
    frames("signs of quaternions at random", |index, _, f| {
        for (segment, q) in f.orientation.iter_mut().enumerate() {
            if noise(index, segment) > 0.0 {
                *q = q.map(|part| -part);
            }
        }
    }),
    frames("a kilometre away", |_, _, f| {
        f.position.iter_mut().for_each(|p| p.x += 1000.0);
    }),
    frames("a million kilometres away", |_, _, f| {
        f.position.iter_mut().for_each(|p| p.x += 1e9);
    }),
    frames("legs exchanged, joints closed", |index, all, f| {
        closed(index, all, f, |q| {
            (0..LEG).for_each(|at| q.swap(RIGHT_THIGH + at, LEFT_THIGH + at));
        });
    }),
    frames(
        "left leg a copy of the right, joints closed",
        |index, all, f| {
            closed(index, all, f, |q| {
                q.copy_within(RIGHT_THIGH..RIGHT_THIGH + LEG, LEFT_THIGH);
            });
        },
    ),
    frames(
        "thigh and shank exchanged, joints closed",
        |index, all, f| {
            closed(index, all, f, |q| q.swap(RIGHT_THIGH, RIGHT_SHANK));
        },
    ),
    frames("knee bent forwards, joints closed", |index, all, f| {
        closed(index, all, f, |q| {
            let thigh = rotation(q[RIGHT_THIGH]);
            let bend = thigh.inverse() * rotation(q[RIGHT_SHANK]);
            for own in &mut q[RIGHT_SHANK..RIGHT_THIGH + LEG] {
                *own = numbers(thigh * (bend * bend).inverse() * thigh.inverse() * rotation(*own));
            }
        });
    }),
    frames("elbow bent backwards for a second", |index, all, f| {
        closed(index, all, f, |q| {
            let arm = RIGHT_FOREARM..RIGHT_FOREARM + 2;
            bent(index, q, RIGHT_FOREARM - 1, arm, Vector3::z() * -1.3);
        });
    }),
    frames("elbow folded flat for a second", |index, all, f| {
        closed(index, all, f, |q| {
            let arm = RIGHT_FOREARM..RIGHT_FOREARM + 2;
            bent(
                index,
                q,
                RIGHT_FOREARM - 1,
                arm,
                Vector3::z() * std::f64::consts::PI,
            );
        });
    }),
    frames("knee bent forwards for a second", |index, all, f| {
        closed(index, all, f, |q| {
            let leg = RIGHT_SHANK..RIGHT_THIGH + LEG;
            bent(index, q, RIGHT_THIGH, leg, Vector3::y() * -1.3);
        });
    }),
    frames("arms and legs exchanged, joints closed", |index, all, f| {
        closed(index, all, f, |q| {
            for (arm, leg) in [
                (RIGHT_FOREARM - 1, RIGHT_THIGH),
                (LEFT_UPPER_ARM, LEFT_THIGH),
            ] {
                (0..3).for_each(|at| q.swap(arm + at, leg + at));
            }
        });
    }),
    frames("head turned round, joints closed", |index, all, f| {
        closed(index, all, f, |q| {
            half_turn(&mut q[HEAD..=HEAD], Vector3::z())
        });
    }),
    frames("pelvis turned round, joints closed", |index, all, f| {
        closed(index, all, f, |q| {
            half_turn(&mut q[PELVIS..=PELVIS], Vector3::z())
        });
    }),
    frames("foot turned round, joints closed", |index, all, f| {
        closed(index, all, f, |q| {
            half_turn(&mut q[RIGHT_FOOT..=RIGHT_FOOT + 1], Vector3::z());
        });
    }),
    frames("quaternions inverse, joints closed", |index, all, f| {
        closed(index, all, f, |q| q.iter_mut().for_each(|q| q[0] = -q[0]));
    }),
    frames("mirrored, joints closed", |index, all, f| {
        closed(index, all, f, |q| {
            q.iter_mut().for_each(|q| *q = [q[0], -q[1], q[2], -q[3]]);
        });
    }),
    frames("joint angles in radians, joints closed", |index, all, f| {
        let sound = &all[index].orientation;
        closed(index, all, f, |q| {
            for (segment, parent) in PARENTS.into_iter().enumerate().skip(1) {
                let bent = rotation(sound[parent]).inverse() * rotation(sound[segment]);
                let read =
                    UnitQuaternion::from_scaled_axis(bent.scaled_axis().map(f64::to_radians));
                q[segment] = numbers(rotation(q[parent]) * read);
            }
        });
    }),
    frames("no attitudes, joints closed", |index, all, f| {
        closed(index, all, f, |q| q.fill([1.0, 0.0, 0.0, 0.0]));
        scale(&mut f.rate, 0.0);
    }),
    frames(
        "forearm frozen for 0.3 s, joints closed",
        |index, all, f| {
            if (960..1032).contains(&index) {
                closed(index, all, f, |q| {
                    q[RIGHT_FOREARM] = all[960].orientation[RIGHT_FOREARM]
                });
            }
        },
    ),
    frames("under a canopy", |index, all, f| {
        at_rest(index, all, f, upright(all), 10.0);
        sinks(index, f, 5.0);
    }),
    frames("under a fast canopy", |index, all, f| {
        at_rest(index, all, f, upright(all), 14.0);
        sinks(index, f, 9.0);
    }),
    frames("an aircraft that descends", |index, all, f| {
        at_rest(index, all, f, upright(all), 60.0);
        sinks(index, f, 6.0);
    }),
    frames("a fall without air", |index, all, f| {
        let time = index as f64 / 240.0;
        let [up, fall] = [f.velocity[0].z, f.position[0].z - all[0].position[0].z];
        f.velocity.iter_mut().for_each(|v| v.z -= up + 9.81 * time);
        f.position
            .iter_mut()
            .for_each(|p| p.z -= fall + 4.905 * time * time);
    }),
    frames("rates empty for a second", |index, _, f| {
        if (1000..1240).contains(&index) {
            scale(&mut f.rate, 0.0);
        }
    }),
    frames("one rate in ten empty", |index, _, f| {
        if index % 10 == 3 {
            scale(&mut f.rate, 0.0);
        }
    }),
    frames("rates 20 % high", |_, _, f| scale(&mut f.rate, 1.2)),
    frames("rates noisy by 10 rad/s", |index, _, f| {
        f.rate[0] += Vector3::from_fn(|axis, _| 10.0 * noise(index * index % 997, axis));
    }),
    frames("positions noisy by 0.3 m", |index, _, f| {
        let shake = Vector3::from_fn(|axis, _| 0.3 * noise(index, axis));
        f.position.iter_mut().for_each(|p| *p += shake);
    }),
    frames("velocities noisy by 10 m/s", |index, _, f| {
        let shake = Vector3::from_fn(|axis, _| 10.0 * noise(index, axis));
        f.velocity.iter_mut().for_each(|v| *v += shake);
    }),
    frames("horizontal velocities empty", |_, _, f| {
        f.velocity.iter_mut().for_each(|v| (v.x, v.y) = (0.0, 0.0));
    }),
    frames("one velocity in fifty empty", |index, _, f| {
        if index % 50 == 3 {
            scale(&mut f.velocity, 0.0);
        }
    }),
    frames("one frame in twenty repeated", |index, all, f| {
        if index % 20 == 3 {
            let open = f.open.clone();
            *f = Frame {
                open,
                ..all[index - 1].clone()
            };
        }
    }),
    edited(
        "a person of 200 kg",
        "subject.toml",
        "mass_kg = 75.0",
        "mass_kg = 200",
    ),
];
