//! Openings that were taken for manoeuvres of a canopy.
//!
//! A wingsuit that pulls up is slowed as by an opening, and then glides on, at a sink speed that a canopy has too. Its
//! speed over ground alone does not tell it from a canopy that runs with the wind, but what follows does: the true
//! opening, and a canopy flight whose velocities lie around those of the wind. Seen from this wind, the part before was
//! much faster than any canopy. A wingsuit that pulls up until it stalls has the drag of an opening too, but then it
//! falls again, with less force than a canopy would have, and is pushed a second time.

use bodyflight_core::air::GRAVITY;
use nalgebra::Vector2;

use crate::force::{force_factor, specific_force};
use crate::phases::{Phase, Stretch};
use crate::{Sample, between, median, slopes};

/// Times around an opening at which speeds are compared (s).
const BEFORE: f64 = 4.0;
const OPENS: f64 = 5.0;
const AFTER: f64 = 15.0;

/// Shortest part between a pull-up and the opening (s).
const SHORTEST: f64 = 8.0;

/// Largest share of the speed that is left after an opening.
const LEFT: f64 = 0.7;

/// Least airspeed of a wingsuit (m/s), and its least ratio to that of the canopy.
const AIRSPEED: f64 = 20.0;
const FASTER: f64 = 1.6;

/// Least sink speed of a wingsuit (m/s), as the median over half a minute or so.
const SINKS: f64 = 5.5;

/// Deceleration along the path at an opening (m/s2).
const BRAKES: f64 = 6.0;

/// Returns the phases with each such opening moved to where it is.
pub(super) fn moved(samples: &[Sample], stretches: Vec<Stretch>) -> Vec<Stretch> {
    let mut moved: Vec<Stretch> = Vec::with_capacity(stretches.len());
    for stretch in stretches {
        let opening = moved.last().copied();
        match opening {
            Some(opening) if opening.phase == Phase::Opening && stretch.phase == Phase::Canopy => {
                let Some(late) = late_opening(&samples[stretch.first..stretch.end]) else {
                    moved.push(stretch);
                    continue;
                };
                let late = late.map(|index| stretch.first + index);
                moved.pop();
                match moved.last_mut() {
                    Some(fall) if fall.phase == Phase::Fall => fall.end = late[0],
                    _ => moved.push(Stretch {
                        phase: Phase::Fall,
                        first: opening.first,
                        end: late[0],
                    }),
                }
                moved.push(Stretch {
                    phase: Phase::Opening,
                    first: late[0],
                    end: late[1],
                });
                moved.push(Stretch {
                    first: late[1],
                    ..stretch
                });
            }
            _ => moved.push(stretch),
        }
    }
    without_stalls(samples, &moved)
}

/// Returns the phases with each opening that was the pull-up of a wingsuit moved behind the stall after it.
fn without_stalls(samples: &[Sample], stretches: &[Stretch]) -> Vec<Stretch> {
    let mut moved: Vec<Stretch> = Vec::with_capacity(stretches.len());
    for stretch in stretches {
        let opening = moved.last().copied().filter(|opening| {
            let fell = moved.iter().rev().skip(1);
            let fell = fell.take_while(|fell| matches!(fell.phase, Phase::Fall | Phase::Flare));
            let begin = fell.last().map_or(opening.first, |fell| fell.first);
            opening.phase == Phase::Opening
                && stretch.phase == Phase::Canopy
                && samples[opening.first].time - samples[begin].time > GLIDES
        });
        match opening.and_then(|opening| stalled(samples, opening.first, stretch.end)) {
            Some(stalled) => {
                moved.pop();
                moved.extend(stalled);
                moved.push(Stretch {
                    first: stalled[2].end,
                    ..*stretch
                });
            }
            None => moved.push(*stretch),
        }
    }
    moved
}

/// Indices at which the true opening begins and ends in what was taken for a canopy flight.
fn late_opening(canopy: &[Sample]) -> Option<[usize; 2]> {
    let (first, last) = (canopy.first()?.time, canopy.last()?.time);
    let within = |from: f64, to: f64| between(canopy, [from, to]);
    let speed = |part: &[Sample]| median(part.iter().map(|sample| sample.velocity.norm()));
    let mut best: Option<(f64, f64)> = None;
    let mut time = first + SHORTEST;
    while time + AFTER < last {
        let before = speed(within(time - BEFORE, time));
        let after = speed(within(time + OPENS, time + AFTER));
        if let (Some(before), Some(after)) = (before, after)
            && after < LEFT * before
            && best.is_none_or(|(most, _)| before - after > most)
        {
            best = Some((before - after, time));
        }
        time += 0.5;
    }
    let (_, time) = best?;
    let wind = |axis: usize| {
        let part = within(time + OPENS, last);
        median(part.iter().map(|sample| sample.velocity[axis]))
    };
    let wind = Vector2::new(wind(0)?, wind(1)?);
    let airspeed = |part: &[Sample]| {
        median(
            part.iter()
                .map(|sample| (sample.velocity.xy() - wind).norm()),
        )
    };
    let flown = within(first + BEFORE, time);
    let (before, after) = (airspeed(flown)?, airspeed(within(time + OPENS, last))?);
    let sinks = median(flown.iter().map(|sample| -sample.velocity.z))?;
    let around = within(time - 2.0, time + OPENS);
    let slowed = slopes(around, 0.6);
    let slowed = around.iter().zip(&slowed).map(|(sample, slope)| {
        let speed = sample.velocity.norm().max(1.0);
        (-slope.dot(&sample.velocity) / speed, sample.time)
    });
    let (brakes, hardest) = slowed.max_by(|a, b| a.0.total_cmp(&b.0))?;
    let is_wingsuit = before > AIRSPEED && before > FASTER * after && sinks > SINKS;
    if !is_wingsuit || brakes < BRAKES {
        return None;
    }
    let place = |time: f64| canopy.partition_point(|sample| sample.time < time);
    let [begin, end] = [place(hardest - 0.5), place(hardest + 2.0)];
    (0 < begin && begin < end && end < canopy.len()).then_some([begin, end])
}

/// Shortest fall of a wingsuit, without its exit (s): after a shorter one, the glide ratio is that of the aircraft.
const GLIDES: f64 = 10.0;

/// Longest time from a pull-up to the opening after it (s).
const SOON: f64 = 14.0;

/// Least gain of sink speed of a wingsuit that has stalled (m/s), and least ratio of its sink speed to that of the
/// canopy.
const GAINS: f64 = 6.0;
const TWICE: f64 = 2.0;

/// Aerodynamic force over mass and dynamic pressure (m2/kg), which a canopy exceeds even in a dive.
const OF_A_BODY: f64 = 0.035;

/// Specific force of an opening at the sink speed of a stalled wingsuit (multiples of gravity), and how long it lasts (s).
const PUSHES: f64 = 1.4;
const PUSHED: f64 = 4.0;

/// The phases from what was taken for an opening, at `first`, to the true one, if the wingsuit stalled between them:
/// the pull-up, the fall after it, and the opening. `end` is that of the canopy flight.
fn stalled(samples: &[Sample], first: usize, end: usize) -> Option<[Stretch; 3]> {
    let begin = samples.get(first)?.time;
    let sink = |sample: &Sample| -sample.velocity.z;
    let before = between(samples, [begin - 10.0, begin - 1.0]).iter();
    let glide = median(before.map(|sample| sample.across() / sink(sample).max(1.0)))?;
    if glide < 1.0 {
        return None;
    }
    let part = between(samples.get(first..end)?, [begin, begin + SOON + PUSHED]);
    let (mut level, mut fastest) = (0, None::<(usize, usize, f64)>);
    for (index, sample) in part.iter().enumerate() {
        if sample.time > begin + SOON {
            break;
        }
        if sink(sample) < sink(&part[level]) {
            level = index;
        }
        let gained = sink(sample) - sink(&part[level]);
        if fastest.is_none_or(|(_, _, most)| gained > most) {
            fastest = Some((level, index, gained));
        }
    }
    let (level, fastest, gained) = fastest?;
    let steady = between(samples.get(first..end)?, [begin + 20.0, begin + 45.0]);
    let steady = median(steady.iter().map(sink));
    let sinks = sink(&part[fastest]);
    if gained < GAINS || sinks < SINKS_AGAIN || steady.is_some_and(|steady| sinks < TWICE * steady)
    {
        return None;
    }
    let slopes = slopes(part, 0.6);
    let least = (level..=fastest).map(|index| force_factor(&part[index], &slopes[index], 1.0));
    let pushed = part.iter().zip(&slopes).skip(fastest);
    let pushed = pushed.take_while(|(sample, _)| sample.time < part[fastest].time + PUSHED);
    let pushed = pushed
        .map(|(_, slope)| specific_force(slope).norm())
        .fold(0.0, f64::max);
    if least.fold(f64::INFINITY, f64::min) > OF_A_BODY || pushed < PUSHES * GRAVITY {
        return None;
    }
    let place = |time: f64| part.partition_point(|sample| sample.time < time);
    let opens = place(part[fastest].time - 0.5).max(level + 1);
    let open = place(part[fastest].time + 2.0);
    (0 < level && opens < open && first + open < end).then(|| {
        [
            (Phase::Flare, 0, level),
            (Phase::Fall, level, opens),
            (Phase::Opening, opens, open),
        ]
        .map(|(phase, from, to)| Stretch {
            phase,
            first: first + from,
            end: first + to,
        })
    })
}

/// Time after an opening in which a wingsuit that pulled up falls again (s), and that after which its canopy flies
/// steadily.
const FALLS_AGAIN: f64 = 12.0;
const STEADY: [f64; 2] = [15.0, 40.0];

/// Largest sink speed at the top of a pull-up, and least one after it (m/s), and its ratio to that of the canopy.
const LEVEL: f64 = 2.0;
const SINKS_AGAIN: f64 = 9.0;
const LIKE_A_FALL: f64 = 1.5;

/// Whether what looks like the opening of a gliding fall at `opening` (s) may be a pull-up: the flight levels off, and
/// then sinks faster than it does later under canopy.
pub(super) fn may_be_pull_up(samples: &[Sample], opening: f64) -> bool {
    let within = |from: f64, to: f64| between(samples, [from, to]);
    let sink = |sample: &Sample| -sample.velocity.z;
    let before = within(opening - 10.0, opening - 1.0).iter();
    let glide = median(before.map(|sample| sample.across() / sink(sample).max(1.0)));
    let after = within(opening, opening + FALLS_AGAIN);
    let level = after.iter().min_by(|a, b| sink(a).total_cmp(&sink(b)));
    let (Some(glide), Some(level)) = (glide, level) else {
        return false;
    };
    let again = within(level.time, opening + FALLS_AGAIN);
    let again = again.iter().map(sink).fold(0.0, f64::max);
    let steady = within(opening + STEADY[0], opening + STEADY[1]);
    let steady = median(steady.iter().map(sink)).unwrap_or(0.0);
    glide > 1.0 && sink(level) < LEVEL && again > SINKS_AGAIN.max(LIKE_A_FALL * steady)
}
