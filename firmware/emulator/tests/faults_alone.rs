//! Sensors and receivers that say something wrong for a while, through the unit's application without a host.

use std::f32::consts::PI;
use std::ops::Range;

use bodyflight_emulator::sensed::Sensed;
use bodyflight_emulator::tampered::{Judged, Sent, fly, longest_lie};
use bodyflight_laboratory::sensor_bytes::{Raw, SensorBytes};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

type Tamper = fn(&mut [Sent], usize);

fn mul(q: [f32; 4], turn: UnitQuaternion<f32>, left: bool) -> [f32; 4] {
    let [w, x, y, z] = q;
    let q = UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z));
    let q = if left { turn * q } else { q * turn };
    [q.w, q.i, q.j, q.k]
}

fn about(axis: Vector3<f32>, angle: f32) -> UnitQuaternion<f32> {
    UnitQuaternion::from_scaled_axis(axis * angle)
}

fn random(k: usize) -> f32 {
    let x = (k as u64 + 1).wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
    let x = (x ^ (x >> 29)).wrapping_mul(0xbf58476d1ce4e5b9);
    ((x >> 40) as f32) / (1u64 << 24) as f32
}

macro_rules! each {
    ($sent:ident, $k:ident, $body:expr) => {
        |all: &mut [Sent], _first: usize| {
            for ($k, $sent) in all.iter_mut().enumerate() {
                let _ = $k;
                $body;
            }
        }
    };
}
macro_rules! velocity {
    ($v:ident, $k:ident, $body:expr) => {
        |all: &mut [Sent], _first: usize| {
            for ($k, sent) in all.iter_mut().enumerate() {
                let _ = $k;
                if let Some(solution) = &mut sent.solution {
                    let $v = &mut solution.velocity_mps;
                    $body;
                    solution.ground_speed_mps = solution.velocity_mps.xy().norm();
                }
            }
        }
    };
}

fn tampers() -> Vec<(&'static str, Tamper)> {
    vec![
        ("clean", |_, _| ()),
        ("line dead", each!(s, k, s.is_silent = true)),
        ("a third of the packets lost", each!(s, k, s.is_silent = random(k) < 0.33)),
        ("bursts of 20 lost", each!(s, k, s.is_silent = (k / 20) % 3 == 0)),
        ("every packet twice", |all, _| {
            for k in (0..all.len() - 1).step_by(2) {
                let (time, arrives) = (all[k + 1].time, all[k + 1].arrives);
                all[k + 1] = Sent { time, arrives, ..all[k].clone() };
            }
        }),
        ("pairs swapped", |all, _| {
            for k in (0..all.len() - 1).step_by(2) {
                let (a, b) = all.split_at_mut(k + 1);
                let (a, b) = (&mut a[k], &mut b[0]);
                std::mem::swap(a, b);
                std::mem::swap(&mut a.time, &mut b.time);
                std::mem::swap(&mut a.arrives, &mut b.arrives);
            }
        }),
        ("noise between the packets", each!(s, k, s.noise = (0..(random(k) * 40.0) as usize).map(|i| (random(k * 64 + i) * 256.0) as u8).collect())),
        ("preambles between the packets", each!(s, k, s.noise = vec![0xfa, 0xff, 0x36, 0xff])),
        ("accuracy zero", each!(s, k, if let Some(x) = &mut s.solution { x.speed_accuracy_mps = 0.0; })),
        ("accuracy 0.03", each!(s, k, if let Some(x) = &mut s.solution { x.speed_accuracy_mps = 0.03; })),
        ("accuracy 20", each!(s, k, if let Some(x) = &mut s.solution { x.speed_accuracy_mps = 20.0; })),
        ("accuracy negative", each!(s, k, if let Some(x) = &mut s.solution { x.speed_accuracy_mps = -1.0; })),
        ("solutions 0.5 s late", |all, _| late(all, 120)),
        ("solutions 1.5 s late", |all, _| late(all, 360)),
        ("solutions frozen", |all, _| {
            let held = all.iter().find_map(|s| s.solution);
            for s in all { if s.solution.is_some() { s.solution = held; } }
        }),
        ("velocity frozen", |all, _| {
            let held = all.iter().find_map(|s| s.solution).map(|s| s.velocity_mps);
            for s in all { if let (Some(x), Some(h)) = (&mut s.solution, held) { x.velocity_mps = h; } }
        }),
        ("no solutions", each!(s, k, s.solution = None)),
        ("no fix", each!(s, k, if let Some(x) = &mut s.solution { x.fix = 0; x.is_valid = false; x.velocity_mps.fill(0.0); })),
        ("zero velocity, valid", velocity!(v, k, v.fill(0.0))),
        ("north reversed", velocity!(v, k, v.x = -v.x)),
        ("west reversed", velocity!(v, k, v.y = -v.y)),
        ("up reversed", velocity!(v, k, v.z = -v.z)),
        ("north and west swapped", velocity!(v, k, v.swap_rows(0, 1))),
        ("velocity in km/h", velocity!(v, k, *v *= 3.6)),
        ("velocity 5 % too large", velocity!(v, k, *v *= 1.05)),
        ("velocity random", velocity!(v, k, *v = Vector3::new(random(3*k), random(3*k+1), random(3*k+2)) * 200.0 - Vector3::repeat(100.0))),
        ("velocity jumps 15 m/s", velocity!(v, k, v.x += 15.0)),
        ("velocity drifts 1 m/s2", velocity!(v, k, v.y += k as f32 / 240.0)),
        ("every third solution an outlier", velocity!(v, k, if (k / 48) % 3 == 0 { v.z += 20.0 })),
        ("gyroscope saturates at 0.3 rad/s", each!(s, k, s.turn = s.turn.map(|t| t.map(|v| v.clamp(-0.3, 0.3))))),
        ("gyroscope axis stuck", |all, _| {
            let held = all[0].turn.unwrap()[1];
            for s in all { if let Some(t) = &mut s.turn { t[1] = held; } }
        }),
        ("gyroscope axis zero", each!(s, k, if let Some(t) = &mut s.turn { t[0] = 0.0; })),
        ("gyroscope stuck", |all, _| {
            let held = all[0].turn;
            for s in all { s.turn = held; }
        }),
        ("gyroscope axes reversed", each!(s, k, s.turn = s.turn.map(|t| t.map(|v| -v)))),
        ("gyroscope in deg/s", each!(s, k, s.turn = s.turn.map(|t| t.map(|v| v * 180.0 / PI)))),
        ("gyroscope bias 0.3", each!(s, k, if let Some(t) = &mut s.turn { t[1] += 0.3; })),
        ("gyroscope 10 % too large", each!(s, k, s.turn = s.turn.map(|t| t.map(|v| v * 1.1)))),
        ("gyroscope random", each!(s, k, s.turn = Some([0,1,2].map(|i| random(3*k+i) * 60.0 - 30.0)))),
        ("no rates", each!(s, k, s.turn = None)),
        ("accelerometer in g", each!(s, k, s.force = s.force.map(|f| f.map(|v| v / 9.80665)))),
        ("accelerometer reversed", each!(s, k, s.force = s.force.map(|f| f.map(|v| -v)))),
        ("accelerometer axes permuted", each!(s, k, s.force = s.force.map(|[x, y, z]| [y, z, x]))),
        ("accelerometer zero", each!(s, k, s.force = Some([0.0; 3]))),
        ("accelerometer stuck", |all, _| {
            let held = all[0].force;
            for s in all { s.force = held; }
        }),
        ("accelerometer axis stuck at 16 g", each!(s, k, if let Some(f) = &mut s.force { f[2] = 157.0; })),
        ("accelerometer saturates at 8 m/s2", each!(s, k, s.force = s.force.map(|t| t.map(|v| v.clamp(-8.0, 8.0))))),
        ("accelerometer bias 2 m/s2", each!(s, k, if let Some(f) = &mut s.force { f[1] += 2.0; })),
        ("accelerometer random", each!(s, k, s.force = Some([0,1,2].map(|i| random(3*k+i) * 60.0 - 30.0)))),
        ("accelerometer without gravity", each!(s, k, if let (Some(f), Some(q)) = (&mut s.force, s.attitude_wxyz) {
            let q = UnitQuaternion::new_normalize(Quaternion::new(q[0], q[1], q[2], q[3]));
            let g = q.inverse() * Vector3::new(0.0, 0.0, 9.80665);
            for i in 0..3 { f[i] -= g[i]; }
        })),
        ("no forces", each!(s, k, s.force = None)),
        ("attitude stuck", |all, _| {
            let held = all[0].attitude_wxyz;
            for s in all { s.attitude_wxyz = held; }
        }),
        ("attitude inverse", each!(s, k, s.attitude_wxyz = s.attitude_wxyz.map(|[w, x, y, z]| [w, -x, -y, -z]))),
        ("attitude mirrored", each!(s, k, s.attitude_wxyz = s.attitude_wxyz.map(|[w, x, y, z]| [w, x, -y, -z]))),
        ("heading 0.5 rad off", each!(s, k, s.attitude_wxyz = s.attitude_wxyz.map(|q| mul(q, about(Vector3::z(), 0.5), true)))),
        ("heading 2 rad off", each!(s, k, s.attitude_wxyz = s.attitude_wxyz.map(|q| mul(q, about(Vector3::z(), 2.0), true)))),
        ("tilt 0.2 rad off", each!(s, k, s.attitude_wxyz = s.attitude_wxyz.map(|q| mul(q, about(Vector3::x(), 0.2), true)))),
        ("heading drifts 0.05 rad/s", each!(s, k, s.attitude_wxyz = s.attitude_wxyz.map(|q| mul(q, about(Vector3::z(), 0.05 * k as f32 / 240.0), true)))),
        ("tilt drifts 0.05 rad/s", each!(s, k, s.attitude_wxyz = s.attitude_wxyz.map(|q| mul(q, about(Vector3::x(), 0.05 * k as f32 / 240.0), true)))),
        ("attitude random", each!(s, k, s.attitude_wxyz = Some(mul([1.0, 0.0, 0.0, 0.0], UnitQuaternion::from_euler_angles(random(3*k)*6.0, random(3*k+1)*6.0, random(3*k+2)*6.0), true)))),
        ("no attitude", each!(s, k, s.attitude_wxyz = None)),
        ("attitude NaN", each!(s, k, s.attitude_wxyz = Some([f32::NAN; 4]))),
        ("sensor turned by 90 degrees", each!(s, k, {
            let turn = about(Vector3::y(), PI / 2.0);
            s.attitude_wxyz = s.attitude_wxyz.map(|q| mul(q, turn.inverse(), false));
            s.turn = s.turn.map(|t| (turn * Vector3::from(t)).into());
            s.force = s.force.map(|t| (turn * Vector3::from(t)).into());
        })),
        ("all packets frozen but the clock", |all, _| {
            let held = all[0].clone();
            for s in all {
                (s.attitude_wxyz, s.turn, s.force, s.pressure) = (held.attitude_wxyz, held.turn, held.force, held.pressure);
            }
        }),
        ("pressure random", each!(s, k, s.pressure = Some(60_000 + (random(k) * 40_000.0) as u32))),
        ("pressure stuck", |all, _| {
            let held = all[0].pressure;
            for s in all { s.pressure = held; }
        }),
        ("pressure zero", each!(s, k, s.pressure = Some(0))),
        ("pressure jumps", each!(s, k, s.pressure = s.pressure.map(|p| p + 1_000))),
        ("pressure in a vacuum", each!(s, k, s.pressure = s.pressure.map(|p| p / 2))),
        ("pressure and receiver wrong alike", each!(s, k, { if let Some(x) = &mut s.solution { x.velocity_mps.z += 10.0; } s.pressure = s.pressure.map(|p| p - (k as f32 / 240.0 * 10.0 * 10.0) as u32); })),
    ]
}

fn late(all: &mut [Sent], by: usize) {
    let solutions: Vec<_> = all.iter().map(|s| s.solution).collect();
    for (k, s) in all.iter_mut().enumerate() {
        s.solution = k.checked_sub(by).and_then(|k| solutions[k]);
    }
}

/// Faults of clock and counter, which last: from `first` on.
fn clocks() -> Vec<(&'static str, Tamper)> {
    vec![
        ("restart, silent for 0.7 s", |all, first| restart(all, first, 168)),
        ("restart at once", |all, first| restart(all, first, 0)),
        ("restart, silent for 3 s", |all, first| restart(all, first, 720)),
        ("counter to zero, clock goes on", |all, first| { for (k, s) in all[first..].iter_mut().enumerate() { s.counter = k as u16; } }),
        ("clock to zero, counter goes on", |all, first| { let b = all[first].ticks; for s in &mut all[first..] { s.ticks -= b; } }),
        ("clock wraps", |all, first| { let o = u32::MAX - all[first].ticks; for s in all { s.ticks = s.ticks.wrapping_add(o); } }),
        ("clock of a day wraps", |all, first| { let o = 864_000_000 - all[first].ticks; for s in all { s.ticks = (s.ticks + o) % 864_000_000; } }),
        ("counter wraps", |all, first| { let o = u16::MAX - all[first].counter; for s in all { s.counter = s.counter.wrapping_add(o); } }),
        ("clock jumps 10 s ahead", |all, first| for s in &mut all[first..] { s.ticks += 100_000; }),
        ("clock jumps 0.3 s ahead", |all, first| for s in &mut all[first..] { s.ticks += 3_000; }),
        ("clock jumps 0.02 s ahead", |all, first| for s in &mut all[first..] { s.ticks += 200; }),
        ("clock jumps 0.5 s back", |all, first| for s in &mut all[first..] { s.ticks = s.ticks.saturating_sub(5_000); }),
        ("clock jumps 5 s back", |all, first| for s in &mut all[first..] { s.ticks = s.ticks.saturating_sub(50_000); }),
        ("clock stops", |all, first| { let h = all[first].ticks; for s in &mut all[first..] { s.ticks = h; } }),
        ("60 s of silence", |all, first| silence(all, first, 60.0)),
        ("4 s of silence", |all, first| silence(all, first, 4.0)),
        ("clock 2 % fast", |all, _| for s in all { s.ticks = (f64::from(s.ticks) * 1.02) as u32; }),
        ("clock 5 % fast", |all, _| for s in all { s.ticks = (f64::from(s.ticks) * 1.05) as u32; }),
        ("clock 5 % slow", |all, _| for s in all { s.ticks = (f64::from(s.ticks) * 0.95) as u32; }),
        ("clock 20 % fast", |all, _| for s in all { s.ticks = (f64::from(s.ticks) * 1.20) as u32; }),
        ("clock 20 % slow", |all, _| for s in all { s.ticks = (f64::from(s.ticks) * 0.80) as u32; }),
        ("clock twice as fast", |all, _| for s in all { s.ticks *= 2; }),
        ("clock half as fast", |all, _| for s in all { s.ticks /= 2; }),
        ("clock jitters 3 ms", |all, _| for (k, s) in all.iter_mut().enumerate() { s.ticks += 40 + (random(k) * 30.0) as u32; }),
        ("every second packet", |all, _| for (k, s) in all.iter_mut().enumerate() { s.is_silent = k % 2 == 1; s.counter /= 2; }),
        ("every second packet, with a hole in the counter", |all, _| for (k, s) in all.iter_mut().enumerate() { s.is_silent = k % 2 == 1; }),
        ("5 of 6 packets, counted on", |all, _| { let mut c = 0; for (k, s) in all.iter_mut().enumerate() { s.is_silent = k % 6 == 5; s.counter = c; c += u16::from(k % 6 != 5); } }),
        ("receiver's frames break in the middle", |_, _| ()),
    ]
}

fn restart(all: &mut [Sent], first: usize, silent: usize) {
    let (ticks, counter) = (all[first + silent].ticks, all[first + silent].counter);
    for (k, s) in all[first..].iter_mut().enumerate() {
        s.is_silent = k < silent;
        s.ticks = s.ticks.saturating_sub(ticks);
        s.counter = s.counter.wrapping_sub(counter);
    }
}

fn silence(all: &mut [Sent], first: usize, seconds: f64) {
    for s in &mut all[first..] {
        s.arrives += seconds;
        if let Some(x) = &mut s.solution { x.time_of_week_ms += (seconds * 1e3) as u32; }
        s.ticks += (seconds * 1e4) as u32;
        s.counter = s.counter.wrapping_add((seconds * 240.0) as u16);
    }
}

fn row(name: &str, flight: &str, found: &[Judged], window: &Range<f64>) -> String {
    let all = 0.0..100.0;
    let lie = longest_lie(found, &all);
    let back = found.iter().find(|j| j.time > window.end && j.is_consistent()).map_or(f64::INFINITY, |j| j.time - window.end);
    let after: Vec<_> = found.iter().filter(|j| j.time > window.end + 2.0).collect();
    let share = after.iter().filter(|j| j.is_consistent()).count() as f64 / after.len().max(1) as f64;
    let during: Vec<_> = found.iter().filter(|j| window.contains(&j.time)).collect();
    let shared = during.iter().filter(|j| j.is_consistent()).count() as f64 / during.len().max(1) as f64;
    let worst = |k: usize| found.iter().filter(|j| j.is_consistent()).map(|j| Vector3::from(j.error[k]).norm()).fold(0.0, f32::max);
    let mark = if lie.0 > 0.5 { "LIE" } else if back > 2.0 { "LATE" } else if share < 0.9 { "DOUBT" } else { "" };
    let bars = found.iter().filter(|j| j.is_consistent()).map(|j| j.worst().0).fold(0.0, f32::max);
    format!("{mark:6}{name:45} {flight:18} lie {:5.2} {:12} back {back:5.2} during {:4.0}% after {:4.0}%  worst {:6.2} m/s {:5.2} rad  {bars:.1} sd", lie.0, lie.1, shared * 100.0, share * 100.0, worst(1), worst(0))
}

#[test]
fn explore() {
    let wanted = std::env::var("FAULT").unwrap_or_default();
    let which = std::env::var("FLIGHTS").unwrap_or("exit,none-mixed-102,none-wide-103,wind-slow-104".into());
    let raw = std::env::var("RAW").is_ok();
    let sensor = SensorBytes { raw: raw.then_some(Raw { rest: 3.0, bias: 0.01, scale: 0.005 }), ..SensorBytes::TYPICAL };
    for flight in which.split(',') {
        let sensed = if flight == "exit" { Sensed::of_maneuver("exit-and-tracking", 20.0, &sensor).unwrap() }
            else { Sensed::of(&format!("{flight}/flight-0"), 20.0, &sensor).unwrap().unwrap() };
        let clean = Sent::of(&sensed.bytes);
        let window = 9.0..13.0;
        let [first, last] = [window.start, window.end].map(|t| clean.partition_point(|s| s.time < t));
        for (name, tamper) in tampers() {
            if !name.contains(&wanted) { continue; }
            let mut sent = clean.clone();
            tamper(&mut sent[first..last], 0);
            println!("{}", row(name, flight, &fly(&sensed, &sent), &window));
        }
        for (name, tamper) in clocks() {
            if !name.contains(&wanted) { continue; }
            let mut sent = clean.clone();
            tamper(&mut sent, first);
            println!("{}", row(name, flight, &fly(&sensed, &sent), &(9.0..9.7)));
        }
    }
}
