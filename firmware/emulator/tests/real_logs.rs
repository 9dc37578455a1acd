//! The unit's application on the logs of real loggers: a FlySight 2 has a gyroscope, an accelerometer, a barometer and a
//! receiver, as the unit has.
//!
//! `BODYFLIGHT_FALLS=FOLDER cargo test --release -p bodyflight-emulator --test real_logs -- --ignored --nocapture` flies the
//! logs in a folder, for example `data` of `aibybrum/flysight`, and prints how well the velocity is predicted in their
//! falls.

use std::ops::Range;
use std::path::Path;

use bodyflight_core::air::STANDARD_GRAVITY;
use bodyflight_core::estimator::motion::state::VELOCITY;
use bodyflight_core::link::{PackedQuaternion, Setup};
use bodyflight_core::ubx::NavPvt;
use bodyflight_emulator::sensed::{Sensed, is_consistent};
use bodyflight_emulator::tampered::{Sent, Told, estimates};
use bodyflight_falls::Sample;
use bodyflight_falls::fall::{Settings, analysed};
use bodyflight_laboratory::sensor_bytes::SensorBytes;
use bodyflight_shared_data::shared;
use bodyflight_tracks::flysight::{Fix, InertialSample, Track};
use bodyflight_tracks::folder;
use nalgebra::{Matrix3, Matrix4, Quaternion, UnitQuaternion, Vector3};

/// Rate to which the rows of the inertial sensor are interpolated (Hz): there are 13 a second, and the filter needs 40.
const RATE: f64 = 50.0;
/// Time from a solution to its arrival (s).
const LATENCY: f64 = 0.1;
/// Shortest fall that is used (s).
const SHORTEST: f64 = 30.0;
/// Time without a receiver (s), and the time with it between two of those.
const WITHOUT: f64 = 5.0;
/// Largest sink rate of somebody who lies on the air (m/s).
const FLAT: f64 = 65.0;
/// Time before the opening that is left out (s): its beginning is not certain.
const OPENING: f64 = 2.0;

/// Half of the time over which an attitude is found (s), time over which a velocity changes, and time between two attitudes.
const AROUND: f64 = 5.0;
const CHANGE: f64 = 1.0;
const EVERY: f64 = 0.5;

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

/// Gives the packets from some time before a fall the attitude that a sensor with an orientation would have sent, and leaves
/// out what was before. The attitude is that in which the specific force explains the changes of the receiver's velocity, by
/// least squares over the time around it (Davenport's q method).
fn with_attitudes(log: &Log, fall: &Range<f64>) -> Vec<Sent> {
    let lead = fall.start - 3.0 * AROUND;
    let sent = log
        .sent
        .iter()
        .filter(|one| (lead..fall.end + AROUND).contains(&one.time));
    let mut sent: Vec<Sent> = sent.cloned().collect();
    // Over the whole log turns cancel.
    let turns = log
        .sent
        .iter()
        .filter_map(|one| one.turn.map(Vector3::from));
    let bias = turns.sum::<Vector3<f32>>() / log.sent.len() as f32;
    for one in &mut sent {
        one.turn = one.turn.map(|turn| (Vector3::from(turn) - bias).into());
    }
    // Attitudes relative to the first packet, and the integral of the force in those axes.
    let (mut turned, mut gained) = (vec![UnitQuaternion::identity()], vec![Vector3::zeros()]);
    for one in &sent {
        let [turn, force] = [one.turn, one.force].map(|v| Vector3::from(v.unwrap()).cast::<f64>());
        let (now, sum) = (*turned.last().unwrap(), *gained.last().unwrap());
        gained.push(sum + now * force / RATE);
        turned.push(now * UnitQuaternion::from_scaled_axis(turn / RATE));
    }
    let changes: Vec<_> = (0..sent.len().saturating_sub((CHANGE * RATE) as usize))
        .step_by((0.2 * RATE) as usize)
        .filter_map(|first| {
            let last = first + (CHANGE * RATE) as usize;
            let [from, to] = [first, last].map(|k| velocity_at(log, sent[k].time));
            let expected = to? - from? + Vector3::z() * STANDARD_GRAVITY * CHANGE;
            Some((
                sent[first].time + 0.5 * CHANGE,
                gained[last] - gained[first],
                expected,
            ))
        })
        .collect();
    let mut attitude = UnitQuaternion::identity();
    for k in 0..sent.len() {
        if k % (EVERY * RATE) as usize == 0 {
            let near = |time: f64| (time - sent[k].time).abs() < AROUND;
            let pairs = changes.iter().filter(|(time, ..)| near(*time));
            attitude = turning(pairs.map(|(_, seen, expected)| (*seen, *expected)));
        }
        let wxyz = (attitude * turned[k]).cast::<f32>();
        sent[k].attitude_wxyz = Some([wxyz.w, wxyz.i, wxyz.j, wxyz.k]);
    }
    sent
}

/// The rotation that takes the first vectors of pairs to the second ones, by least squares.
fn turning(pairs: impl Iterator<Item = (Vector3<f64>, Vector3<f64>)>) -> UnitQuaternion<f64> {
    let profile = pairs.fold(Matrix3::zeros(), |sum, (from, to)| {
        sum + to * from.transpose()
    });
    let z = Vector3::new(
        profile[(2, 1)] - profile[(1, 2)],
        profile[(0, 2)] - profile[(2, 0)],
        profile[(1, 0)] - profile[(0, 1)],
    );
    let mut davenport = Matrix4::zeros();
    davenport[(0, 0)] = profile.trace();
    davenport.fixed_view_mut::<3, 1>(1, 0).copy_from(&z);
    davenport
        .fixed_view_mut::<1, 3>(0, 1)
        .copy_from(&z.transpose());
    let square = profile + profile.transpose() - Matrix3::identity() * profile.trace();
    davenport.fixed_view_mut::<3, 3>(1, 1).copy_from(&square);
    let found = davenport.symmetric_eigen();
    let best = found.eigenvectors.column(found.eigenvalues.imax());
    UnitQuaternion::new_normalize(Quaternion::new(best[0], best[1], best[2], best[3]))
}

/// The receiver's velocity at a time (s).
fn velocity_at(log: &Log, time: f64) -> Option<Vector3<f64>> {
    let next = log.fixes.partition_point(|(at, _)| *at < time);
    let [(t0, a), (t1, b)] = [log.fixes.get(next.checked_sub(1)?)?, log.fixes.get(next)?];
    let share = (time - t0) / (t1 - t0);
    Some(a.velocity.components.lerp(&b.velocity.components, share))
}

/// The log without the receiver for a while again and again in a fall, and the times without it.
fn without_receiver(log: &Log, fall: &Range<f64>) -> (Vec<Sent>, Vec<Range<f64>>) {
    let mut windows = Vec::new();
    let mut start = fall.start + 5.0;
    while start + WITHOUT < fall.end - OPENING {
        windows.push(start..start + WITHOUT);
        start += 2.0 * WITHOUT;
    }
    let mut sent = with_attitudes(log, fall);
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

/// What is found in a log: how well the specific force explains the receiver's velocity, and the velocity after a while without
/// a receiver.
#[derive(Default)]
struct Sums {
    /// Squares of the error, of the change of the velocity meanwhile, and of the error in deviations: of each horizontal axis,
    /// and vertical.
    squares: [[f64; 2]; 3],
    count: f64,
    /// Estimates in falls with the receiver, and those of them that agree.
    estimates: [f64; 2],
    falls: u32,
    lie: f64,
}

impl Sums {
    fn take(&mut self, last: &Compared, held: Vector3<f64>) {
        let normalised = last.error.component_div(&last.deviation);
        for (sum, vector) in self.squares.iter_mut().zip([last.error, held, normalised]) {
            sum[0] += vector.xy().norm_squared() / 2.0;
            sum[1] += vector.z.powi(2);
        }
        self.count += 1.0;
    }

    fn fall(&mut self, log: &Log, fall: &Range<f64>) {
        self.falls += 1;
        let setup = setup(&log.force);
        let all = compared(log, &estimates(&setup, &with_attitudes(log, fall)), fall);
        self.estimates[0] += all.len() as f64;
        self.estimates[1] += all.iter().filter(|one| one.is_consistent).count() as f64;
        let (sent, windows) = without_receiver(log, fall);
        let through = compared(log, &estimates(&setup, &sent), fall);
        self.lie = self.lie.max(longest_lie(&all)).max(longest_lie(&through));
        for window in windows {
            let last = through.iter().rfind(|one| window.contains(&one.time));
            let before = velocity_at(log, window.start);
            let now = last.and_then(|last| velocity_at(log, last.time));
            if let (Some(last), Some(before), Some(now)) = (last, before, now) {
                self.take(last, before - now);
            }
        }
    }

    fn means(&self) -> [[f64; 2]; 3] {
        self.squares
            .map(|sums| sums.map(|sum| (sum / self.count).sqrt()))
    }
}

impl std::fmt::Display for Sums {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [error, held, normalised] = self.means();
        let agreeing = self.estimates[1] / self.estimates[0];
        write!(
            f,
            "{} falls, {} times {WITHOUT} s: error {error:.2?} m/s, {normalised:.2?} deviations, change {held:.2?} m/s; {agreeing:.2} \
             agree, longest lie {:.1} s",
            self.falls, self.count, self.lie
        )
    }
}

#[test]
#[ignore = "needs logs of real falls"]
fn the_velocity_of_real_falls_is_predicted_within_the_error_bars() {
    let folder = std::env::var("BODYFLIGHT_FALLS").expect("BODYFLIGHT_FALLS=FOLDER names logs");
    // Falls of somebody who lies on the air, and faster ones, in postures of another drag than the assumed one.
    let (mut flat, mut fast) = (Sums::default(), Sums::default());
    for path in folder::tracks(Path::new(&folder)).unwrap() {
        let Some(log) = Log::read(&path) else {
            continue;
        };
        for fall in &log.falls {
            let within = log.fixes.iter().filter(|(time, _)| fall.contains(time));
            let fastest = within
                .map(|(_, fix)| -fix.velocity.up())
                .fold(0.0, f64::max);
            let length = fall.end - fall.start;
            let sums = if fastest > FLAT { &mut fast } else { &mut flat };
            sums.fall(&log, fall);
            println!(
                "{}: {length:.0} s, up to {fastest:.0} m/s; so far {sums}",
                path.display()
            );
        }
    }
    println!("flat: {flat}\nfast: {fast}");
    let [[error, vertical], [change, sinking], [normalised, _]] = flat.means();
    assert!(
        error < 0.4 * change && vertical < 0.6 * sinking && normalised < 1.5,
        "{flat}"
    );
    assert!(flat.lie <= 0.5 && fast.lie <= 0.5, "{flat}, {fast}");
}

/// A logger that somebody carries about on the ground.
#[test]
fn a_logger_on_the_ground_is_not_estimated_as_falling() {
    let Some(path) = shared("data/flysight/yoleg-flysight2csv/TRACK.CSV") else {
        return;
    };
    let log = Log::read(&path).unwrap();
    let all = 3.0 * AROUND..log.sent.len() as f64 / RATE;
    let found = estimates(&setup(&Vector3::z()), &with_attitudes(&log, &all));
    let agreeing = found.iter().filter(|told| is_consistent(&told.estimate));
    let share = agreeing.count() as f64 / found.len() as f64;
    println!("{share:.3} of {} agree", found.len());
    assert!(
        found.len() > 300 && share < 0.01,
        "{share} of {}",
        found.len()
    );
}
