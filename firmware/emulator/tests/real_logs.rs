//! The unit's application on the logs of real loggers: a FlySight 2 has a gyroscope, an accelerometer, a barometer and a
//! receiver, as the unit has.
//!
//! `BODYFLIGHT_FALLS=FOLDER cargo test --release -p bodyflight-emulator --test real_logs -- --ignored --nocapture` flies the
//! logs in a folder, for example `data` of `aibybrum/flysight`, and prints how well the velocity is predicted in their
//! falls.

use std::ops::Range;
use std::path::Path;

use bodyflight_core::estimator::motion::state::VELOCITY;
use bodyflight_core::link::{EstimateFlags, PackedQuaternion, Setup};
use bodyflight_core::ubx::NavPvt;
use bodyflight_emulator::sensed::{Sensed, is_consistent};
use bodyflight_emulator::tampered::{Sent, Told, estimates};
use bodyflight_falls::Sample;
use bodyflight_falls::fall::{Settings, analysed};
use bodyflight_laboratory::sensor_bytes::SensorBytes;
use bodyflight_shared_data::shared;
use bodyflight_tracks::flysight::{Fix, InertialSample, Track};
use bodyflight_tracks::folder;
use nalgebra::{UnitQuaternion, Vector3};

/// Rate to which the rows of the inertial sensor are interpolated (Hz): there are 13 a second, and the filter needs 40.
const RATE: f64 = 50.0;
/// Time from a solution to its arrival (s).
const LATENCY: f64 = 0.1;
/// Shortest fall that is used (s).
const SHORTEST: f64 = 30.0;
/// Time without a receiver (s), and the time with it between two of those.
const WITHOUT: f64 = 5.0;

/// Time before a fall from which the receiver is heard (s): a unit that has none in the aircraft may be levelled there.
const HEARD: f64 = 60.0;

/// A log on the clock of its inertial sensor's first row.
struct Log {
    fixes: Vec<(f64, Fix)>,
    sent: Vec<Sent>,
    /// Falls (s).
    falls: Vec<Range<f64>>,
    /// Mean specific force in the first of them (sensor axes).
    force: Vector3<f64>,
}

impl Log {
    fn read(path: &Path) -> Option<Self> {
        let track = Track::read(path).ok()?;
        let origin = track.inertial.first()?.time_of_week;
        let fixes: Vec<_> = (track.fixes.iter())
            .map(|fix| (fix.time_of_week() - origin, *fix))
            .collect();
        let samples: Vec<_> = (fixes.iter())
            .map(|(time, fix)| Sample {
                time: *time,
                position: fix.position.components,
                velocity: fix.velocity.components,
            })
            .collect();
        let jumps = analysed(&samples, &Settings::default());
        let falls = jumps.iter().map(|jump| {
            let [from, to] = jump.times.fall;
            from..to
        });
        let falls: Vec<_> = falls.filter(|f| f.end - f.start > SHORTEST).collect();
        let steady = falls
            .first()
            .map_or(0.0..1.0, |fall| fall.start + 12.0..fall.end - 3.0);
        let rows = (track.inertial.iter())
            .filter(|row| steady.contains(&(row.time_of_week - origin)))
            .map(|row| row.specific_force);
        let force = rows.fold(Vector3::zeros(), |sum, force| sum + force);
        Some(Self {
            sent: sent(&track, &fixes, origin),
            fixes,
            falls,
            force,
        })
    }
}

/// The packets of the logger as the unit would get them.
fn sent(track: &Track, fixes: &[(f64, Fix)], origin: f64) -> Vec<Sent> {
    let rows = &track.inertial;
    let length = rows.last().map_or(0.0, |row| row.time_of_week - origin);
    let mut waiting = fixes.iter().peekable();
    while waiting.next_if(|(time, _)| time + LATENCY < 0.0).is_some() {}
    let packet = |k: usize| {
        let time = k as f64 / RATE;
        let [turn, force] = between(rows, origin + time);
        let arrived = waiting.next_if(|(at, _)| at + LATENCY <= time);
        let heard = track
            .pressure
            .partition_point(|row| row.time_of_week <= origin + time);
        Sent {
            time,
            arrives: time,
            counter: k as u16,
            ticks: (time * 1e4).round() as u32,
            turn: Some(turn.cast::<f32>().into()),
            force: Some(force.cast::<f32>().into()),
            pressure: heard
                .checked_sub(1)
                .map(|row| track.pressure[row].pressure as u32),
            solution: arrived.map(|(_, fix)| solution(fix)),
            ..Sent::default()
        }
    };
    (0..(length * RATE) as usize).map(packet).collect()
}

/// Angular velocity and specific force between two rows.
fn between(rows: &[InertialSample], time: f64) -> [Vector3<f64>; 2] {
    let after = rows
        .partition_point(|row| row.time_of_week <= time)
        .clamp(1, rows.len() - 1);
    let [a, b] = [&rows[after - 1], &rows[after]];
    let share = ((time - a.time_of_week) / (b.time_of_week - a.time_of_week)).clamp(0.0, 1.0);
    [
        a.angular_velocity.lerp(&b.angular_velocity, share),
        a.specific_force.lerp(&b.specific_force, share),
    ]
}

fn solution(fix: &Fix) -> NavPvt {
    let velocity = fix.velocity.components.cast::<f32>();
    let height = fix.position.components.z as f32;
    NavPvt {
        time_of_week_ms: (fix.time_of_week() * 1e3).round() as u32,
        fix: 3,
        is_valid: true,
        height_m: height,
        velocity_mps: velocity,
        ground_speed_mps: velocity.xy().norm(),
        speed_accuracy_mps: fix.speed_accuracy.unwrap_or(1.0) as f32,
        height_msl_m: height,
        vertical_accuracy_m: 10.0,
    }
}

/// A unit for a person of whom nothing is known, with a sensor that measures `force` (its axes) in the fall: belly to earth,
/// so along the back.
fn setup(force: &Vector3<f64>) -> Setup {
    let sensed = Sensed::of_maneuver("exit-and-tracking", 0.1, &SensorBytes::TYPICAL).unwrap();
    let mut setup = sensed.setup;
    let level = UnitQuaternion::rotation_between(force, &Vector3::z()).unwrap_or_default();
    let quarter = -std::f64::consts::FRAC_PI_2;
    let mounting = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), quarter) * level;
    let configure = &mut setup.configure;
    let window = configure.sample_rate / configure.update_rate;
    configure.sample_rate = RATE as f32;
    configure.update_rate = RATE as f32 / window;
    configure.air_density = 1.0;
    configure.body_from_sensor = PackedQuaternion::pack(&mounting.cast());
    configure.receiver_latency = LATENCY as f32;
    setup
}

/// A velocity that was predicted, beside a fix.
struct Compared {
    time: f64,
    error: Vector3<f64>,
    deviation: Vector3<f64>,
    is_consistent: bool,
}

impl Compared {
    fn worst(&self) -> f64 {
        self.error.component_div(&self.deviation).amax()
    }
}

/// The estimates at the instants of the fixes within a time.
fn compared(log: &Log, found: &[Told], within: &Range<f64>) -> Vec<Compared> {
    let fixes = log.fixes.iter().filter(|(time, _)| within.contains(time));
    let at = fixes.filter_map(|(time, fix)| {
        let next = found.partition_point(|told| told.time < *time);
        let [a, b] = [found.get(next.checked_sub(1)?)?, found.get(next)?];
        let share = (time - a.time) / (b.time - a.time);
        let [from, to] = [a, b].map(|told| Vector3::from(told.estimate.velocity).cast::<f64>());
        let deviation = [0, 1, 2].map(|k| f64::from(a.deviation[VELOCITY + k]));
        Some(Compared {
            time: *time,
            error: from.lerp(&to, share) - fix.velocity.components,
            deviation: deviation.into(),
            is_consistent: is_consistent(&a.estimate),
        })
    });
    at.collect()
}

/// Longest time (s) for which estimates agreed with an error beyond five of their deviations.
fn longest_lie(all: &[Compared]) -> f64 {
    let (mut longest, mut since) = (0.0_f64, None);
    for one in all {
        if one.is_consistent && one.worst() > 5.0 {
            let begin = *since.get_or_insert(one.time);
            longest = longest.max(one.time - begin);
        } else {
            since = None;
        }
    }
    longest
}

/// The log without the receiver for a while again and again in a fall, and the times without it.
fn without_receiver(log: &Log, fall: &Range<f64>) -> (Vec<Sent>, Vec<Range<f64>>) {
    let mut windows = Vec::new();
    let mut start = fall.start + 5.0;
    while start + WITHOUT < fall.end {
        windows.push(start..start + WITHOUT);
        start += 2.0 * WITHOUT;
    }
    let mut sent = log.sent.clone();
    for one in &mut sent {
        if windows
            .iter()
            .any(|window| window.contains(&(one.time - LATENCY)))
        {
            one.solution = None;
        }
    }
    (sent, windows)
}

#[test]
#[ignore = "needs logs of real falls"]
fn the_velocity_of_real_falls_is_predicted_within_the_error_bars() {
    let folder = std::env::var("BODYFLIGHT_FALLS").expect("BODYFLIGHT_FALLS=FOLDER names logs");
    let mut squares = [[0.0_f64; 2]; 3];
    let (mut count, mut agreeing, mut beyond) = (0.0, 0.0, 0);
    for path in folder::tracks(Path::new(&folder)).unwrap() {
        let Some(mut log) = Log::read(&path) else {
            continue;
        };
        let setup = setup(&log.force);
        for fall in &log.falls.clone() {
            for one in &mut log.sent {
                if one.time < fall.start - HEARD {
                    one.solution = None;
                }
            }
            let whole = estimates(&setup, &log.sent);
            let all = compared(&log, &whole, fall);
            let share =
                all.iter().filter(|one| one.is_consistent).count() as f64 / all.len() as f64;
            let lost = (whole.iter())
                .filter(|told| fall.contains(&told.time))
                .filter(|told| told.estimate.flags.intersects(EstimateFlags::LOST))
                .count();
            let (sent, windows) = without_receiver(&log, fall);
            let found = estimates(&setup, &sent);
            let through = compared(&log, &found, fall);
            print!(
                "{}: {:.0} s, {share:.2} agree, {lost} lost, lie {:.1} {:.1} s;",
                path.display(),
                fall.end - fall.start,
                longest_lie(&all),
                longest_lie(&through)
            );
            for window in windows {
                let last = through.iter().rfind(|one| window.contains(&one.time));
                let before = log.fixes.iter().rfind(|(time, _)| *time < window.start);
                let (Some(last), Some((_, before))) = (last, before) else {
                    continue;
                };
                let (_, now) = log
                    .fixes
                    .iter()
                    .rfind(|(time, _)| *time <= last.time)
                    .unwrap();
                let held = before.velocity.components - now.velocity.components;
                print!(
                    " {:.1}/{:.1} {:.1}/{:.1} ({:.1} {:.1}){}",
                    last.error.xy().norm(),
                    last.deviation.xy().norm(),
                    last.error.z,
                    last.deviation.z,
                    held.xy().norm(),
                    held.z,
                    if last.is_consistent { "" } else { "?" }
                );
                count += 1.0;
                agreeing += f64::from(u8::from(last.is_consistent));
                beyond += u32::from(last.is_consistent && last.worst() > 3.0);
                let normalised = last.error.component_div(&last.deviation);
                for (sum, vector) in squares.iter_mut().zip([last.error, held, normalised]) {
                    sum[0] += vector.xy().norm_squared() / 2.0;
                    sum[1] += vector.z.powi(2);
                }
            }
            println!();
        }
    }
    let [error, held, normalised] = squares.map(|sums| sums.map(|sum| (sum / count).sqrt()));
    println!(
        "{count} predictions: error {error:.2?}, held {held:.2?}, in deviations {normalised:.2?}, {:.2} agree, {beyond} of them beyond three",
        agreeing / count
    );
}

/// A logger that lies on the ground and is carried about.
#[test]
fn a_logger_on_the_ground_is_not_estimated_as_falling() {
    let Some(path) = shared("data/flysight/yoleg-flysight2csv/TRACK.CSV") else {
        return;
    };
    let log = Log::read(&path).unwrap();
    let found = estimates(&setup(&Vector3::z()), &log.sent);
    let agreeing = found
        .iter()
        .filter(|told| is_consistent(&told.estimate))
        .count();
    println!("{agreeing} of {} agree", found.len());
    assert!(
        found.len() > 100 && agreeing == 0,
        "{agreeing} of {}",
        found.len()
    );
}
