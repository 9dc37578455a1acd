//! Finds the jumps among the phases of a track: from the exit, or the start of the track, to the landing or its end.

mod late;

use crate::boundary::{Boundary, Side, exit_in_gap, kink, opening, opening_in_gap};
use crate::channels::Motion;
use crate::force::force_factor;
use crate::phases::{Phase, SLOW, Stretch};
use crate::{Sample, longest_step, median, slopes};

/// Shortest fall (s).
const SHORTEST: f64 = 1.5;

/// Longest fall (s): several times that of a jump from the stratosphere.
const LONGEST: f64 = 900.0;

/// Smallest loss of height (m) and largest sink speed (m/s) that make a fall.
const LOSES: f64 = 12.0;
const SINKS: f64 = 9.0;

/// The times of a jump; `None` for what the track does not show.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Times {
    /// Exit from the aircraft.
    pub exit: Option<Boundary>,
    /// Start and end of the fall (s), as far as it is on the track.
    pub fall: [f64; 2],
    /// Start of the deceleration by the canopy.
    pub opening: Option<Boundary>,
    /// Time from which the canopy is open.
    pub canopy: Option<Boundary>,
    /// Landing under canopy.
    pub landing: Option<Boundary>,
}

/// A jump on a track.
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    /// Its times.
    pub times: Times,
    /// Why the phases are not certain, in a clause; `None` if they are.
    pub doubt: Option<String>,
    /// Indices of the samples that belong to this jump and to no other: the first, and the one after the last.
    pub samples: [usize; 2],
}

/// The jumps of a track, in order of time.
pub fn jumps(samples: &[Sample], stretches: &[Stretch], motion: Motion) -> Vec<Found> {
    let stretches = &late::moved(samples, stretches.to_vec());
    let runs = falling(samples, stretches);
    let mut found: Vec<Found> = Vec::with_capacity(runs.len());
    for run in &runs {
        found.push(Found {
            times: times(samples, stretches, *run, motion),
            doubt: None,
            samples: [0, samples.len()],
        });
    }
    divide(samples, stretches, &runs, &mut found);
    for jump in &mut found {
        let [from, to] = jump.samples;
        jump.doubt =
            doubt(&samples[from..to], &jump.times).or_else(|| dive_before(samples, &jump.times));
    }
    found
}

/// Places in `stretches` at which each fall begins and ends.
fn falling(samples: &[Sample], stretches: &[Stretch]) -> Vec<[usize; 2]> {
    // A deceleration as by a canopy that is followed by further fall is a wingsuit pulling out of a dive.
    let falls = |place: usize| match stretches[place].phase {
        Phase::Exit | Phase::Fall | Phase::Flare => true,
        Phase::Opening => stretches
            .get(place + 1)
            .is_some_and(|next| matches!(next.phase, Phase::Fall | Phase::Flare)),
        _ => false,
    };
    let mut runs: Vec<[usize; 2]> = Vec::new();
    for place in 0..stretches.len() {
        match runs.last_mut() {
            Some(last) if falls(place) && last[1] == place => last[1] = place + 1,
            _ if falls(place) => runs.push([place, place + 1]),
            _ => {}
        }
    }
    runs.retain(|[first, end]| {
        let begin = stretches[*first].first;
        let part = &samples[begin..stretches[end - 1].end];
        let (Some(top), Some(low)) = (part.first(), part.last()) else {
            return false;
        };
        let fastest = part.iter().map(|sample| -sample.velocity.z);
        (SHORTEST..LONGEST).contains(&(low.time - top.time))
            && top.height() - low.height() >= LOSES
            && fastest.fold(0.0, f64::max) >= SINKS
    });
    runs
}

fn times(
    samples: &[Sample],
    stretches: &[Stretch],
    [first, end]: [usize; 2],
    motion: Motion,
) -> Times {
    let gap = longest_step(samples);
    let time = |index: usize| samples[index.min(samples.len() - 1)].time;
    let is_gap =
        |index: usize| index > 0 && index < samples.len() && time(index) - time(index - 1) > gap;
    let start = stretches[first].first;
    let stop = stretches[end - 1].end;
    let before = first.checked_sub(1).map(|place| stretches[place].phase);
    // A head-down flyer who changes to belly flight resembles a second exit, so an exit must follow another phase.
    let exit = match before {
        Some(_) if is_gap(start) => exit_in_gap(samples, start - 1, start),
        Some(_) if stretches[first].phase == Phase::Exit => {
            let begins = time(begins(samples, start));
            kink(samples, begins, [4.0, 2.5], Side::After)
        }
        _ => None,
    };
    let begin = exit.map_or(time(start), |exit| exit.time);
    let after = stretches.get(end).map(|stretch| stretch.phase);
    // What brakes a wingsuit that pulls up is not yet its canopy.
    let flared = stretches[first..end]
        .iter()
        .rfind(|stretch| stretch.phase == Phase::Flare)
        .map_or(begin, |flare| time(flare.end - 1).max(begin));
    let opened = match after {
        Some(_) if is_gap(stop) => Some(opening_in_gap(&samples[stop - 1], &samples[stop])),
        // Too few fixes for a fit leave the place between two of them.
        Some(Phase::Opening | Phase::Canopy) => {
            let interval = time(stop) - time(stop - 1);
            opening(samples, time(stop), [begin, flared], motion.averaged).or(Some(Boundary {
                time: time(stop) - 0.5 * interval,
                deviation: interval.max(1.0),
            }))
        }
        _ => None,
    };
    let exit = exit.map(|exit| widened(exit, motion));
    let opened = opened
        .filter(|opened| opened.time > begin)
        .map(|opened| widened(opened, motion));
    let canopy_place =
        (end..stretches.len()).find(|place| stretches[*place].phase == Phase::Canopy);
    let canopy = canopy_place.and_then(|place| {
        let near = time(stretches[place].first);
        let placed = kink(samples, near, [2.0, 4.0], Side::Before).unwrap_or(Boundary {
            time: near,
            deviation: 1.0,
        });
        let is_after = opened.is_none_or(|opened| placed.time > opened.time);
        is_after.then_some(placed)
    });
    let landing = canopy_place.and_then(|place| {
        let ground = stretches[place..]
            .iter()
            .find(|stretch| stretch.phase != Phase::Canopy)
            .filter(|stretch| stretch.phase == Phase::Landed)?;
        Some(Boundary {
            time: time(ground.first),
            deviation: 1.0,
        })
    });
    let last = time(stop.saturating_sub(1).max(start));
    Times {
        exit,
        fall: [begin, opened.map_or(last, |opened| opened.time).max(begin)],
        opening: opened,
        canopy,
        landing,
    }
}

/// Speed of somebody who stands on a cliff (m/s), and sink speed at which a descent has begun (m/s); the longest time between
/// them (s), and the least gain of sink speed meanwhile (m/s2).
const STANDS: f64 = 3.0;
const SUNK: f64 = 5.0;
const BEGINS: f64 = 10.0;
const GAINS_LEAST: f64 = 1.5;

/// The sample near which the exit is, of which `start` is the first that looks like one: a wingsuit that leaves a cliff
/// gains speed slowly, and looks like a fall only seconds later.
fn begins(samples: &[Sample], start: usize) -> usize {
    let sinks = |sample: &Sample| -sample.velocity.z;
    let Some(first) = samples.get(start) else {
        return start;
    };
    if sinks(first) < SUNK {
        return start;
    }
    let level = samples[..start]
        .iter()
        .rposition(|sample| sample.velocity.norm() < STANDS);
    let is_near = |level: &usize| {
        let since = first.time - samples[*level].time;
        since < BEGINS && sinks(first) > GAINS_LEAST * since
    };
    level.filter(is_near).unwrap_or(start)
}

/// A boundary that velocities which are means over some time, or were late, may show anywhere within it.
fn widened(boundary: Boundary, motion: Motion) -> Boundary {
    let by_means = motion.averaged / 3.0_f64.sqrt();
    Boundary {
        deviation: boundary.deviation.hypot(by_means).hypot(motion.moved),
        ..boundary
    }
}

/// Gives each jump its own part of the track: from the end of the canopy flight before to that of its own.
fn divide(samples: &[Sample], stretches: &[Stretch], runs: &[[usize; 2]], found: &mut [Found]) {
    for place in 1..runs.len() {
        let (before, own) = (runs[place - 1][1], runs[place][0]);
        // The first stretch between them on the ground or in the aircraft; without one, a canopy was cut away.
        let between = stretches[before..own]
            .iter()
            .find(|stretch| {
                matches!(
                    stretch.phase,
                    Phase::Ground | Phase::Aircraft | Phase::Landed
                )
            })
            .or(stretches.get(own - 1))
            .map_or(0, |stretch| stretch.first);
        let landed = found[place - 1].times.landing;
        let border = landed.map_or(between, |landed| {
            let over = samples.partition_point(|sample| sample.time <= landed.time + 10.0);
            over.max(between).min(stretches[own].first)
        });
        found[place - 1].samples[1] = border;
        found[place].samples[0] = border;
    }
}

/// Smallest ratio of the sink speed before the opening to that under canopy.
const SLOWER: f64 = 1.5;

/// Time that an opening takes at most (s), and the largest deceleration that the mildest one has (m/s2).
const OPENS: f64 = 7.0;
const BRAKES: f64 = 2.5;

/// Loss of height within some time (s) after a landing at which it was none (m): a car may drive downhill later.
const LOSES_LATER: f64 = 60.0;
const LATER: f64 = 60.0;

/// Gain of sink speed within four seconds of an exit (m/s).
const GAINS: f64 = 7.0;

/// Largest sink speed of an aircraft just before the exit (m/s), and within some time (s) before.
const DESCENDS: f64 = 9.5;
const DIVES: f64 = 16.0;
const DIVE: f64 = 20.0;

/// Sink speed of a fall that needs no boundary to be recognised (m/s).
const PLAINLY: f64 = 35.0;

/// Force factor (m2/kg) below which a flight with a glide ratio above two, and without an exit and an opening, may be
/// that of an aircraft: few wingsuits have so little area for their weight.
const AIRCRAFT: f64 = 0.0055;

/// Length of a fall (s) that a fast canopy may surpass, if its exit and its opening are there.
const HOP: f64 = 8.0;

/// Time after an exit in which the aircraft's forward speed is lost (s).
const GATHERS: f64 = 8.0;

fn sinks_already(sinks: f64) -> String {
    format!("it sinks at {sinks:.0} m/s before the exit already")
}

/// Whether an exit follows a dive, on the whole track: then it may be a wingsuit that pulled up.
fn dive_before(samples: &[Sample], times: &Times) -> Option<String> {
    let exit = times.exit?.time;
    let before = samples
        .iter()
        .filter(|sample| (exit - DIVE..exit - 0.5).contains(&sample.time));
    let dived = before.map(|sample| -sample.velocity.z).fold(0.0, f64::max);
    (dived > DIVES).then(|| sinks_already(dived))
}

/// Why a jump's phases are not certain, in a clause; `None` if they are.
fn doubt(samples: &[Sample], times: &Times) -> Option<String> {
    let [begin, end] = times.fall;
    let within = |from: f64, to: f64| {
        let first = samples.partition_point(|sample| sample.time < from);
        let last = samples.partition_point(|sample| sample.time <= to);
        samples.get(first..last).unwrap_or(&[])
    };
    let sink = |part: &[Sample]| median(part.iter().map(|sample| -sample.velocity.z));
    let falling = within(begin, end);
    let most = |part: &[Sample]| {
        let sinks = part.iter().map(|sample| -sample.velocity.z);
        sinks.fold(0.0, f64::max)
    };
    let fastest = most(falling);
    let elsewhere =
        most(within(f64::NEG_INFINITY, begin)).max(most(within(end + 4.0, f64::INFINITY)));
    let has_both = times.exit.is_some() && times.opening.is_some();
    let is_hop = has_both && end - begin < HOP;
    if elsewhere > fastest + 2.0 && !is_hop {
        return Some(format!(
            "another part of the track is faster, {elsewhere:.0} instead of {fastest:.0} m/s downwards"
        ));
    }
    let steady = within(begin + GATHERS, end);
    let glide = median(
        steady
            .iter()
            .map(|sample| sample.across() / (-sample.velocity.z).max(1.0)),
    );
    let factors = steady.iter().zip(slopes(steady, 0.6));
    let factor = median(factors.map(|(sample, slope)| force_factor(sample, &slope, SLOW)));
    let glides = glide.is_some_and(|glide| glide > 2.0);
    if !has_both && glides && factor.is_some_and(|factor| factor < AIRCRAFT) {
        return Some(
            "it glides like an aircraft, and its exit or its opening is not on the track"
                .to_owned(),
        );
    }
    if let Some(exit) = times.exit {
        let before = sink(within(exit.time - 3.0, exit.time));
        let after = most(within(exit.time, exit.time + 4.0));
        if before.is_some_and(|before| after - before < GAINS) {
            return Some("the exit hardly changes the vertical speed".to_owned());
        }
        if let Some(before) = before.filter(|before| *before > DESCENDS) {
            return Some(sinks_already(before));
        }
    }
    if let Some(landing) = times.landing {
        let after = within(landing.time, landing.time + LATER)
            .iter()
            .map(Sample::height);
        let lowest = after.clone().fold(f64::INFINITY, f64::min);
        let lost = after.clone().next().map_or(0.0, |height| height - lowest);
        if lost > LOSES_LATER {
            return Some(format!(
                "the track sinks by another {lost:.0} m after what looks like the landing"
            ));
        }
    }
    match times.opening {
        Some(opening) if late::may_be_pull_up(samples, opening.time) => {
            Some("what looks like the opening may be a pull-up before it".to_owned())
        }
        Some(opening) => doubt_of_opening(samples, opening.time),
        None if fastest >= PLAINLY => None,
        None => Some("no opening follows it".to_owned()),
    }
}

/// Why an opening is not certain.
fn doubt_of_opening(samples: &[Sample], opening: f64) -> Option<String> {
    let within = |from: f64, to: f64| {
        let first = samples.partition_point(|sample| sample.time < from);
        let last = samples.partition_point(|sample| sample.time <= to);
        samples.get(first..last).unwrap_or(&[])
    };
    let sinks =
        |part: &[Sample]| -> Vec<f64> { part.iter().map(|sample| -sample.velocity.z).collect() };
    let before = sinks(within(opening - 3.0, opening + 0.5));
    let before = before.into_iter().fold(0.0, f64::max);
    let after = median(sinks(within(opening + 5.0, opening + 20.0)));
    let slowed = slopes(within(opening - 1.0, opening + OPENS), 0.6);
    let most_slowed = slowed.iter().map(|slope| slope.z).fold(0.0, f64::max);
    let is_mild = after.is_some_and(|after| before < SLOWER * after) || most_slowed < BRAKES;
    is_mild.then(|| "the opening hardly changes the vertical speed".to_owned())
}

#[cfg(test)]
mod tests;
