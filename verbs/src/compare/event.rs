//! Events on which recordings are aligned: the start of a turn, and the exit.

use bodyflight_core::air::GRAVITY;

use super::track::Track;

/// Time over which rates are averaged before events are looked for (s).
const SMOOTHED_OVER: f64 = 0.25;
/// Turn rate above which a body turns (rad/s), and for how long it must (s).
const TURNING: f64 = 0.5;
const TURNING_FOR: f64 = 0.5;
/// A turn has begun at this share of the fastest rate in its first seconds (s).
const BEGUN: f64 = 0.2;
const FIRST: f64 = 2.0;
/// Speed of a fall, speed of none (m/s), and for how long a fall must last (s).
const FALLING: f64 = 8.0;
const NOT_FALLING: f64 = 3.0;
const FALLING_FOR: f64 = 1.0;
/// Standard deviation of an exit: how a body leaves the aircraft differs (s).
const EXIT_DEVIATION: f64 = 0.1;

/// An event in a recording.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Event {
    /// When (s since frame 0).
    pub time: f64,
    /// Standard deviation (s).
    pub deviation: f64,
    /// For a turn, 1 to the left and -1 to the right; otherwise 0.
    pub sense: f64,
}

/// The first index from which `is` holds for `count` values.
fn sustained(values: &[f64], count: usize, is: impl Fn(f64) -> bool) -> Option<usize> {
    let mut held = 0;
    for (k, value) in values.iter().enumerate() {
        held = if is(*value) { held + 1 } else { 0 };
        if held >= count.max(1) {
            return Some(k + 1 - held);
        }
    }
    None
}

/// Where values cross a level upwards, last before `index` or first after it: time and slope per second.
fn crossing(track: &Track, values: &[f64], level: f64, index: usize) -> Option<(f64, f64)> {
    let after = if values[index] >= level {
        (1..=index).rev().find(|k| values[k - 1] < level)?
    } else {
        (index + 1..values.len()).find(|k| values[*k] >= level)?
    };
    let [from, to] = [after - 1, after].map(|k| (track.frames[k].time, values[k]));
    let share = (level - from.1) / (to.1 - from.1);
    // The slope over several frames, as that between two is noisy.
    let wide = track.half(SMOOTHED_OVER).max(1);
    let [low, high] = [
        after.saturating_sub(wide),
        (after + wide).min(values.len() - 1),
    ];
    let slope = (values[high] - values[low]) / (track.frames[high].time - track.frames[low].time);
    Some((from.0 + share * (to.0 - from.0), slope))
}

/// The start of the first sustained turn. None if the body turns already when the recording begins.
pub(super) fn turn(track: &Track) -> Option<Event> {
    let rates = track.smoothed(SMOOTHED_OVER, |seen| seen.yaw_rate);
    let count = 2 * track.half(TURNING_FOR);
    let of = |sense: f64| sustained(&rates, count, |rate| sense * rate > TURNING);
    let (begin, sense) = match (of(1.0), of(-1.0)) {
        (Some(left), Some(right)) if left > right => (right, -1.0),
        (Some(left), _) => (left, 1.0),
        (None, right) => (right?, -1.0),
    };
    let along: Vec<f64> = rates.iter().map(|rate| sense * rate).collect();
    let first = &along[begin..(begin + 2 * track.half(FIRST)).min(along.len())];
    let fastest = (first.iter().take_while(|rate| **rate > 0.0)).fold(0.0_f64, |a, b| a.max(*b));
    let (time, slope) = crossing(track, &along, BEGUN * fastest, begin)?;
    let raw = track.seen.iter().map(|seen| sense * seen.yaw_rate);
    let apart = raw.zip(&along).map(|(raw, smooth)| (raw - smooth).powi(2));
    let noise = (apart.sum::<f64>() / along.len() as f64).sqrt() / (count.max(1) as f64).sqrt();
    Some(Event {
        time,
        deviation: (noise / slope.max(1e-3)).hypot(track.intervals[1]),
        sense,
    })
}

/// The exit: the fall begins after a time without one. None if the body falls already when the recording begins.
pub(super) fn exit(track: &Track) -> Option<Event> {
    let speeds = track.smoothed(SMOOTHED_OVER, |seen| -seen.vertical_velocity);
    let falling = sustained(&speeds, 2 * track.half(FALLING_FOR), |speed| {
        speed > FALLING
    })?;
    let (time, _) = crossing(track, &speeds, NOT_FALLING, falling)?;
    Some(Event {
        time: (time - NOT_FALLING / GRAVITY).max(track.span()[0]),
        deviation: EXIT_DEVIATION.hypot(track.intervals[1]),
        sense: 0.0,
    })
}
