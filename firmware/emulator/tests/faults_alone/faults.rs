//! What a sensor or a receiver may say wrong.

use std::f32::consts::{FRAC_PI_2, PI};

use bodyflight_emulator::tampered::Sent;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use crate::delays::{late, later_and_later, stale};

/// How what is sent changes.
pub enum Change {
    /// Each packet, with its number.
    Each(fn(&mut Sent, usize)),
    /// Each velocity of the receiver.
    Velocity(fn(&mut Vector3<f32>, usize)),
    /// All together.
    All(fn(&mut [Sent])),
}

use Change::{All, Each, Velocity};

impl Change {
    pub fn apply(&self, sent: &mut [Sent]) {
        match self {
            All(change) => change(sent),
            Each(change) => (sent.iter_mut().enumerate()).for_each(|(k, sent)| change(sent, k)),
            Velocity(change) => {
                for (k, sent) in sent.iter_mut().enumerate() {
                    if let Some(solution) = &mut sent.solution {
                        change(&mut solution.velocity_mps, k);
                        solution.ground_speed_mps = solution.velocity_mps.xy().norm();
                    }
                }
            }
        }
    }
}

/// A number from 0 to 1.
pub fn random(k: usize) -> f32 {
    let mixed = (k as u64 + 1).wrapping_mul(6_364_136_223_846_793_005) ^ 0x9e37_79b9;
    let mixed = (mixed ^ (mixed >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    (mixed >> 40) as f32 / (1 << 24) as f32
}

fn vector(k: usize, half: f32) -> Vector3<f32> {
    Vector3::from_fn(|i, _| (2.0 * random(3 * k + i) - 1.0) * half)
}

fn turned(sent: &mut Sent, by: fn(UnitQuaternion<f32>, f32) -> UnitQuaternion<f32>, k: usize) {
    let [w, x, y, z] = sent.attitude_wxyz.unwrap_or([1.0, 0.0, 0.0, 0.0]);
    let attitude = UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z));
    let turned = by(attitude, k as f32 / 240.0);
    sent.attitude_wxyz = Some([turned.w, turned.i, turned.j, turned.k]);
}

fn about(x: f32, y: f32, z: f32) -> UnitQuaternion<f32> {
    UnitQuaternion::from_scaled_axis(Vector3::new(x, y, z))
}

fn accuracy(sent: &mut Sent, stated: f32) {
    if let Some(solution) = &mut sent.solution {
        solution.speed_accuracy_mps = stated;
    }
}

fn rates(sent: &mut Sent, change: fn(f32) -> f32) {
    sent.turn = sent.turn.map(|turn| turn.map(change));
}

fn forces(sent: &mut Sent, change: fn(f32) -> f32) {
    sent.force = sent.force.map(|force| force.map(change));
}

fn time_of_week(sent: &mut Sent, change: fn(u32) -> u32) {
    if let Some(solution) = &mut sent.solution {
        solution.time_of_week_ms = change(solution.time_of_week_ms);
    }
}

/// Faults of a few seconds, after which everything is as before.
pub const FAULTS: [(&str, Change); 81] = [
    ("line dead", Each(|s, _| s.is_silent = true)),
    (
        "a third of the packets lost",
        Each(|s, k| s.is_silent = random(k) < 0.33),
    ),
    (
        "bursts of 20 packets lost",
        Each(|s, k| s.is_silent = (k / 20) % 3 == 0),
    ),
    (
        "every packet twice",
        All(|all| {
            for k in (1..all.len()).step_by(2) {
                let (time, arrives) = (all[k].time, all[k].arrives);
                all[k] = Sent {
                    time,
                    arrives,
                    ..all[k - 1].clone()
                };
            }
        }),
    ),
    (
        "pairs of packets swapped",
        All(|all| {
            for k in (1..all.len()).step_by(2) {
                all.swap(k - 1, k);
                let [a, b] = [k - 1, k].map(|k| (all[k].time, all[k].arrives));
                (all[k].time, all[k].arrives) = a;
                (all[k - 1].time, all[k - 1].arrives) = b;
            }
        }),
    ),
    (
        "noise between the packets",
        Each(|s, k| {
            s.noise = (0..40)
                .map(|i| (random(k * 64 + i) * 256.0) as u8)
                .collect();
        }),
    ),
    (
        "preambles between the packets",
        Each(|s, _| s.noise = vec![0xfa, 0xff, 0x36, 0xff]),
    ),
    ("accuracy stated as 0", Each(|s, _| accuracy(s, 0.0))),
    (
        "accuracy stated as 0.03 m/s",
        Each(|s, _| accuracy(s, 0.03)),
    ),
    ("accuracy stated as 20 m/s", Each(|s, _| accuracy(s, 20.0))),
    ("accuracy stated as -1 m/s", Each(|s, _| accuracy(s, -1.0))),
    ("solutions 0.5 s late", All(|all| late(all, 120))),
    ("solutions 1.5 s late", All(|all| late(all, 360))),
    (
        "solutions frozen",
        All(|all| {
            let held = all.iter().find_map(|s| s.solution);
            all.iter_mut()
                .for_each(|s| s.solution = s.solution.and(held));
        }),
    ),
    (
        "velocity frozen",
        All(|all| {
            let held = all
                .iter()
                .find_map(|s| s.solution)
                .map_or(Vector3::zeros(), |s| s.velocity_mps);
            for solution in all.iter_mut().filter_map(|s| s.solution.as_mut()) {
                solution.velocity_mps = held;
            }
        }),
    ),
    (
        "north frozen",
        All(|all| {
            let held = all.iter().find_map(|s| s.solution);
            for solution in all.iter_mut().filter_map(|s| s.solution.as_mut()) {
                solution.velocity_mps.x = held.map_or(0.0, |held| held.velocity_mps.x);
            }
        }),
    ),
    ("solutions later and later", All(later_and_later)),
    (
        "accuracy stated as 1000 km/s",
        Each(|s, _| accuracy(s, 1e6)),
    ),
    (
        "accuracy stated as 0.03 m/s, up 2 m/s off",
        Each(|s, _| {
            accuracy(s, 0.03);
            if let Some(solution) = &mut s.solution {
                solution.velocity_mps.z += 2.0;
            }
        }),
    ),
    (
        "two receivers, 4 m/s apart",
        Velocity(|v, k| v.y += if (k / 48) % 2 == 0 { 4.0 } else { 0.0 }),
    ),
    (
        "time of week stuck",
        Each(|s, _| time_of_week(s, |_| 100_000)),
    ),
    (
        "time of week an hour back",
        Each(|s, _| time_of_week(s, |time| time.wrapping_sub(3_600_000))),
    ),
    ("no solutions", Each(|s, _| s.solution = None)),
    (
        "no fix",
        Each(|s, _| {
            if let Some(solution) = &mut s.solution {
                (solution.fix, solution.is_valid) = (0, false);
            }
        }),
    ),
    ("velocity zero", Velocity(|v, _| v.fill(0.0))),
    ("north reversed", Velocity(|v, _| v.x = -v.x)),
    ("west reversed", Velocity(|v, _| v.y = -v.y)),
    ("up reversed", Velocity(|v, _| v.z = -v.z)),
    ("north and west swapped", Velocity(|v, _| v.swap_rows(0, 1))),
    ("velocity in km/h", Velocity(|v, _| *v *= 3.6)),
    ("velocity 5 % too large", Velocity(|v, _| *v *= 1.05)),
    ("velocity random", Velocity(|v, k| *v = vector(k, 100.0))),
    ("velocity 15 m/s off", Velocity(|v, _| v.x += 15.0)),
    (
        "velocity drifts by 1 m/s2",
        Velocity(|v, k| v.y += k as f32 / 240.0),
    ),
    (
        "solutions of which some are outliers",
        Velocity(|v, k| v.z += if (k / 48) % 3 == 0 { 20.0 } else { 0.0 }),
    ),
    (
        "gyroscope saturated at 0.3 rad/s",
        Each(|s, _| rates(s, |v| v.clamp(-0.3, 0.3))),
    ),
    (
        "gyroscope's axis stuck",
        All(|all| {
            let held = all[0].turn;
            for (turn, held) in all.iter_mut().filter_map(|s| s.turn.as_mut().zip(held)) {
                turn[1] = held[1];
            }
        }),
    ),
    (
        "gyroscope's axis zero",
        Each(|s, _| s.turn = s.turn.map(|[_, y, z]| [0.0, y, z])),
    ),
    (
        "gyroscope stuck",
        All(|all| {
            let held = all[0].turn;
            all.iter_mut().for_each(|s| s.turn = held);
        }),
    ),
    ("gyroscope's axes reversed", Each(|s, _| rates(s, |v| -v))),
    (
        "gyroscope's axes exchanged",
        Each(|s, _| s.turn = s.turn.map(|[x, y, z]| [y, x, z])),
    ),
    (
        "gyroscope 0.1 s late",
        All(|all| stale(all, 24, |sent| &mut sent.turn)),
    ),
    (
        "gyroscope in deg/s",
        Each(|s, _| rates(s, |v| v * 180.0 / PI)),
    ),
    (
        "gyroscope's bias 0.3 rad/s",
        Each(|s, _| s.turn = s.turn.map(|[x, y, z]| [x, y + 0.3, z])),
    ),
    (
        "gyroscope 10 % too large",
        Each(|s, _| rates(s, |v| 1.1 * v)),
    ),
    (
        "gyroscope random",
        Each(|s, k| s.turn = Some(vector(k, 30.0).into())),
    ),
    ("no rates", Each(|s, _| s.turn = None)),
    (
        "accelerometer in g",
        Each(|s, _| forces(s, |v| v / 9.806_65)),
    ),
    ("accelerometer reversed", Each(|s, _| forces(s, |v| -v))),
    (
        "accelerometer's axes exchanged",
        Each(|s, _| s.force = s.force.map(|[x, y, z]| [y, x, z])),
    ),
    (
        "accelerometer's axes permuted",
        Each(|s, _| s.force = s.force.map(|[x, y, z]| [y, z, x])),
    ),
    ("accelerometer zero", Each(|s, _| forces(s, |_| 0.0))),
    (
        "accelerometer stuck",
        All(|all| {
            let held = all[0].force;
            all.iter_mut().for_each(|s| s.force = held);
        }),
    ),
    (
        "accelerometer's axis at its limit",
        Each(|s, _| s.force = s.force.map(|[x, y, _]| [x, y, 157.0])),
    ),
    (
        "accelerometer saturated at 8 m/s2",
        Each(|s, _| forces(s, |v| v.clamp(-8.0, 8.0))),
    ),
    (
        "accelerometer's bias 2 m/s2",
        Each(|s, _| s.force = s.force.map(|[x, y, z]| [x, y + 2.0, z])),
    ),
    (
        "accelerometer random",
        Each(|s, k| s.force = Some(vector(k, 30.0).into())),
    ),
    ("no forces", Each(|s, _| s.force = None)),
    (
        "attitude stuck",
        All(|all| {
            let held = all[0].attitude_wxyz;
            all.iter_mut().for_each(|s| s.attitude_wxyz = held);
        }),
    ),
    (
        "attitude's sign alternating",
        Each(|s, k| {
            let sign = if k % 2 == 0 { -1.0 } else { 1.0 };
            s.attitude_wxyz = s.attitude_wxyz.map(|wxyz| wxyz.map(|v| sign * v));
        }),
    ),
    (
        "attitude 0.3 s late",
        All(|all| stale(all, 72, |sent| &mut sent.attitude_wxyz)),
    ),
    (
        "attitude inverse",
        Each(|s, k| turned(s, |q, _| q.inverse(), k)),
    ),
    (
        "attitude mirrored",
        Each(|s, _| s.attitude_wxyz = s.attitude_wxyz.map(|[w, x, y, z]| [w, x, -y, -z])),
    ),
    (
        "heading 0.5 rad off",
        Each(|s, k| turned(s, |q, _| about(0.0, 0.0, 0.5) * q, k)),
    ),
    (
        "heading 2 rad off",
        Each(|s, k| turned(s, |q, _| about(0.0, 0.0, 2.0) * q, k)),
    ),
    (
        "tilt 0.2 rad off",
        Each(|s, k| turned(s, |q, _| about(0.2, 0.0, 0.0) * q, k)),
    ),
    (
        "heading drifts by 0.05 rad/s",
        Each(|s, k| turned(s, |q, t| about(0.0, 0.0, 0.05 * t) * q, k)),
    ),
    (
        "tilt drifts by 0.05 rad/s",
        Each(|s, k| turned(s, |q, t| about(0.05 * t, 0.0, 0.0) * q, k)),
    ),
    (
        "attitude random",
        Each(|s, k| {
            let [x, y, z] = vector(k, 3.0).into();
            let random = about(x, y, z);
            s.attitude_wxyz = Some([random.w, random.i, random.j, random.k]);
        }),
    ),
    ("no attitude", Each(|s, _| s.attitude_wxyz = None)),
    (
        "attitude not a number",
        Each(|s, _| s.attitude_wxyz = Some([f32::NAN; 4])),
    ),
    (
        "sensor slipped by a quarter turn",
        Each(|s, k| {
            let slip = about(0.0, FRAC_PI_2, 0.0);
            turned(s, |q, _| q * about(0.0, -FRAC_PI_2, 0.0), k);
            s.turn = s.turn.map(|turn| (slip * Vector3::from(turn)).into());
            s.force = s.force.map(|force| (slip * Vector3::from(force)).into());
        }),
    ),
    (
        "everything frozen but the clock",
        All(|all| {
            let held = all[0].clone();
            for s in all {
                (s.attitude_wxyz, s.turn) = (held.attitude_wxyz, held.turn);
                (s.force, s.pressure) = (held.force, held.pressure);
            }
        }),
    ),
    (
        "pressure random",
        Each(|s, k| s.pressure = Some(60_000 + (random(k) * 40_000.0) as u32)),
    ),
    (
        "pressure stuck",
        All(|all| {
            let held = all[0].pressure;
            all.iter_mut().for_each(|s| s.pressure = held);
        }),
    ),
    (
        "pressure in steps of 200 Pa",
        Each(|s, _| s.pressure = s.pressure.map(|p| p / 200 * 200)),
    ),
    ("pressure zero", Each(|s, _| s.pressure = Some(0))),
    (
        "pressure 1000 Pa off",
        Each(|s, _| s.pressure = s.pressure.map(|p| p + 1_000)),
    ),
    (
        "pressure halved",
        Each(|s, _| s.pressure = s.pressure.map(|p| p / 2)),
    ),
    (
        "counter stuck",
        All(|all| {
            let held = all[0].counter;
            all.iter_mut().for_each(|s| s.counter = held);
        }),
    ),
    (
        "clock random",
        Each(|s, k| s.ticks = (random(k) * 4e9) as u32),
    ),
];
