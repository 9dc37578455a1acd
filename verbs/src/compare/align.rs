//! Which times of two recordings belong together.

use bodyflight_io::diagnostic::{Problem, Result};
use serde::Serialize;

use super::event::{Event, exit, turn};
use super::track::Track;
use super::warp::{Movements, similarity, step, warped};

/// Least resemblance of movements that were warped onto each other; see docs/compare.md for what different maneuvers have.
pub const ALIKE: f64 = 0.85;
/// Least resemblance of movements that begin with the first frames; below it times that belong together are unknown.
pub const LIKE_ENOUGH: f64 = 0.3;
/// Standard deviation of warped times (s).
const WARP_DEVIATION: f64 = 0.1;

/// How to align.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Align {
    /// On the start of the turn if both turn, else on the exit if both have one, else on the first frames.
    #[default]
    Auto,
    /// On the first frames.
    Start,
    /// On the exit.
    Exit,
    /// On the start of the turn.
    Turn,
    /// On these times (s since frame 0).
    Times(f64, f64),
    /// By dynamic time warping of the movements.
    Warp,
}

impl Align {
    /// Reads `auto`, `start`, `exit`, `turn`, `warp` or `time=TA,TB`.
    ///
    /// # Errors
    /// Returns a sentence that says what was expected.
    pub fn parse(text: &str) -> core::result::Result<Self, String> {
        let number = |text: &str| {
            let number = text.trim().parse::<f64>().ok();
            number.filter(|number| number.is_finite())
        };
        let times = || {
            let (one, two) = text.strip_prefix("time=")?.split_once(',')?;
            Some(Self::Times(number(one)?, number(two)?))
        };
        match text {
            "auto" => Ok(Self::Auto),
            "start" => Ok(Self::Start),
            "exit" => Ok(Self::Exit),
            "turn" => Ok(Self::Turn),
            "warp" => Ok(Self::Warp),
            _ => times().ok_or_else(|| {
                "expected auto, start, exit, turn, warp, or seconds in both flights such as \
                 time=2.1,3.4"
                    .to_owned()
            }),
        }
    }
}

/// An alignment, as reported.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Alignment {
    /// What the flights are aligned on: `start`, `exit`, `turn`, `time` or `warp`.
    pub on: &'static str,
    /// Time of it in A (s since frame 0); times of the report are those of A relative to it.
    pub a_s: f64,
    /// Time of it in B (s since frame 0).
    pub b_s: f64,
    /// Standard deviation of the time in B that belongs to a time in A (s).
    pub deviation_s: f64,
    /// First and last time compared (s, relative to the event).
    pub compared_s: [f64; 2],
    /// Seconds of B to a second of A: smallest and largest, averaged over a second; 1 without warping.
    pub stretch: [f64; 2],
    /// Correlation of angular velocities and joints at the matched times, each relative to its mean: 1 for the same
    /// movements, about 0 for unrelated ones.
    pub similarity: f64,
}

/// An alignment with its matched times.
#[derive(Debug, Clone)]
pub struct Matched {
    /// For the report.
    pub alignment: Alignment,
    /// Times in A and in B (s since frame 0) that belong together, in ascending order.
    pub times: Vec<(f64, f64)>,
}

impl Matched {
    /// The time in B that belongs to a time in A.
    pub fn b_at(&self, a: f64) -> f64 {
        let after = self.times.partition_point(|(time, _)| *time <= a);
        let last = self.times.len() - 1;
        let from = self.times[after.saturating_sub(1).min(last.saturating_sub(1))];
        let to = self.times[after.clamp(1, last.max(1)).min(last)];
        if to.0 > from.0 {
            from.1 + (to.1 - from.1) * (a - from.0) / (to.0 - from.0)
        } else {
            from.1 + a - from.0
        }
    }

    /// First and last time in A (s since frame 0).
    pub fn span(&self) -> [f64; 2] {
        [self.times.first(), self.times.last()].map(|pair| pair.map_or(0.0, |pair| pair.0))
    }
}

fn not_found(what: &str, tracks: [&Track; 2], found: [Option<Event>; 2]) -> Problem {
    let missing: Vec<&str> = (tracks.iter().zip(found))
        .filter(|(_, event)| event.is_none())
        .map(|(track, _)| track.name.as_str())
        .collect();
    Problem::disagreement(format!(
        "cannot align on {what}: {} has none",
        missing.join(" and ")
    ))
    .help("give --align start, warp, or time=TA,TB with seconds in both flights")
}

fn turns(tracks: [&Track; 2]) -> [Option<Event>; 2] {
    tracks.map(turn)
}

/// Two turns in one sense.
fn same_sense([a, b]: [Event; 2], tracks: [&Track; 2]) -> Result<[Event; 2]> {
    if (a.sense - b.sense).abs() < 0.5 {
        return Ok([a, b]);
    }
    let side = |event: Event| if event.sense > 0.0 { "left" } else { "right" };
    Err(Problem::disagreement(format!(
        "cannot align on the turn: {} turns to the {} and {} to the {}",
        tracks[0].name,
        side(a),
        tracks[1].name,
        side(b)
    ))
    .help("give --align start, exit, or time=TA,TB to compare them nevertheless"))
}

/// Finds the times that belong together, between two times of A (s since frame 0) if they are given.
///
/// # Errors
/// Returns a disagreement if there is no such event, or if the maneuvers differ.
pub fn align(tracks: [&Track; 2], how: Align, between: [Option<f64>; 2]) -> Result<Matched> {
    let step = step(tracks);
    let movements = tracks.map(|track| Movements::of(track, step));
    let movements = [&movements[0], &movements[1]];
    let plain = |time: f64| Event {
        time,
        deviation: 0.0,
        sense: 0.0,
    };
    let first = || tracks.map(|track| plain(track.span()[0]));
    let (on, events) = match how {
        Align::Auto => match (turns(tracks), tracks.map(exit)) {
            ([Some(a), Some(b)], _) => ("turn", same_sense([a, b], tracks)?),
            (_, [Some(a), Some(b)]) => ("exit", [a, b]),
            _ => ("start", first()),
        },
        Align::Start => ("start", first()),
        Align::Exit => match tracks.map(exit) {
            [Some(a), Some(b)] => ("exit", [a, b]),
            found => return Err(not_found("the exit", tracks, found)),
        },
        Align::Turn => match turns(tracks) {
            [Some(a), Some(b)] => ("turn", same_sense([a, b], tracks)?),
            found => return Err(not_found("the start of a turn", tracks, found)),
        },
        Align::Times(a, b) => ("time", [plain(a), plain(b)]),
        Align::Warp => return warp(tracks, movements, between),
    };
    let [a, b] = events.map(|event| event.time);
    let [[a_begin, a_end], [b_begin, b_end]] = tracks.map(Track::span);
    let begin = a_begin.max(a + b_begin - b);
    let end = a_end.min(a + b_end - b);
    let times = vec![(begin, begin - a + b), (end, end - a + b)];
    let deviation = events[0].deviation.hypot(events[1].deviation);
    let matched = matched(on, [a, b], deviation, times, movements, between)?;
    let similarity = matched.alignment.similarity;
    if how == Align::Auto && on == "start" && similarity < LIKE_ENOUGH {
        return Err(Problem::disagreement(format!(
            "cannot align {} and {}: neither a turn nor an exit begins in both, and from the first frames on the \
             movements have little in common (similarity {similarity:.2})",
            tracks[0].name, tracks[1].name
        ))
        .help("give --align warp, or time=TA,TB with seconds in both flights; --align start compares them nevertheless"));
    }
    Ok(matched)
}

fn warp(
    tracks: [&Track; 2],
    movements: [&Movements; 2],
    between: [Option<f64>; 2],
) -> Result<Matched> {
    let times = warped(movements).filter(|times| times.len() > 1);
    let unlike = |similarity: Option<f64>| {
        let how = similarity.map_or(String::new(), |similarity| {
            format!(" (similarity {similarity:.2}, at least {ALIKE} is needed)")
        });
        Problem::disagreement(format!(
            "cannot align by warping: the movements of {} and {} differ too much{how}",
            tracks[0].name, tracks[1].name
        ))
        .help("are they the same maneuver? --align time=TA,TB compares them nevertheless")
    };
    let times = times.ok_or_else(|| unlike(None))?;
    let begin = times[0];
    let matched = matched(
        "warp",
        begin.into(),
        WARP_DEVIATION,
        times,
        movements,
        between,
    )?;
    let similarity = matched.alignment.similarity;
    if similarity < ALIKE {
        return Err(unlike(Some(similarity)));
    }
    Ok(matched)
}

/// Restricts matched times to those asked for, and describes them.
fn matched(
    on: &'static str,
    [a_s, b_s]: [f64; 2],
    deviation_s: f64,
    times: Vec<(f64, f64)>,
    movements: [&Movements; 2],
    [from, to]: [Option<f64>; 2],
) -> Result<Matched> {
    let alignment = Alignment {
        on,
        a_s,
        b_s,
        deviation_s,
        compared_s: [0.0; 2],
        stretch: [1.0; 2],
        similarity: 0.0,
    };
    let mut matched = Matched { alignment, times };
    let [begin, end] = matched.span();
    let (begin, end) = (from.unwrap_or(begin).max(begin), to.unwrap_or(end).min(end));
    if end - begin < 0.5 {
        return Err(Problem::disagreement(format!(
            "cannot compare: aligned on {on}, the flights overlap for {:.2} s and at least 0.5 s are needed",
            (end - begin).max(0.0)
        ))
        .help("choose another --align, or other --from and --to (seconds of A since frame 0)"));
    }
    let inside = (matched.times.iter().copied()).filter(|(a, _)| (begin..=end).contains(a));
    let mut times = vec![(begin, matched.b_at(begin))];
    times.extend(inside.filter(|(a, _)| *a > begin + 1e-9 && *a < end - 1e-9));
    times.push((end, matched.b_at(end)));
    matched.times = times;
    let count = super::track::whole((end - begin) * 10.0).clamp(10, 4000);
    let even: Vec<(f64, f64)> = (0..=count)
        .map(|k| {
            let a = begin + (end - begin) * k as f64 / count as f64;
            (a, matched.b_at(a))
        })
        .collect();
    let second = whole_second(&even);
    let slopes = (even.iter().zip(even.iter().skip(second)))
        .map(|(from, to)| (to.1 - from.1) / (to.0 - from.0));
    let stretch = slopes.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], slope| {
        [low.min(slope), high.max(slope)]
    });
    matched.alignment.stretch = stretch;
    matched.alignment.similarity = similarity(movements, &even);
    matched.alignment.compared_s = [begin - a_s, end - a_s];
    Ok(matched)
}

/// How many of these times make a second, or all of them.
fn whole_second(times: &[(f64, f64)]) -> usize {
    let begin = times[0].0;
    times
        .partition_point(|(time, _)| *time < begin + 1.0)
        .clamp(1, times.len() - 1)
}
