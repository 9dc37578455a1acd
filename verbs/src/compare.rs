//! `bodyflight compare`: recordings of one maneuver beside each other, and what their differences do by the model.
//!
//! `align` finds which times belong together, from events (`event`) or by time warping (`warp`); `joints` finds
//! the differences of joints that the errors of the suits do not explain, `effect` flies them, and `words` says it.

pub mod align;
pub mod difference;
pub mod effect;
mod event;
pub mod figure;
pub mod joints;
pub mod page;
pub mod table;
mod text;
mod track;
mod warp;
pub(crate) mod words;

use serde::Serialize;

use align::{Align, Alignment, LIKE_ENOUGH, Matched, align};
use bodyflight_io::diagnostic::Result;
use bodyflight_io::interrupt;
use bodyflight_mvnx::recording::Warning;
use bodyflight_replay::comparison::{Channel, PerChannel};
pub use difference::{Difference, Trust};
use difference::{lead, trust};
use effect::{Part, effect};
use joints::{Differences, Found, Summary, WINDOW};
pub use track::Track;

/// Most differences whose effects are simulated, and told.
const FLOWN: usize = 12;
/// Time for which the model flies before a difference begins (s).
const LEAD: f64 = 0.2;
/// Shortest time over which an effect is told (s), and longest interval between frames (s).
const SHORTEST: f64 = 0.3;
const SLOWEST: f64 = 0.06;
/// How to compare.
#[derive(Debug, Clone, Copy, Default)]
pub struct Settings {
    /// How to align.
    pub align: Align,
    /// First and last time of A (s since frame 0); without, all that both have.
    pub between: [Option<f64>; 2],
}

/// A flight, as reported.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Side {
    /// Readable name.
    pub name: String,
    /// Frames read.
    pub frames: u64,
    /// Length (s).
    pub duration_s: f64,
    /// Rate of the recording (Hz).
    pub rate_hz: f64,
    /// Rate at which it is compared (Hz).
    pub compared_rate_hz: f64,
    /// Inconsistencies of the recording.
    pub warnings: Vec<Warning>,
}

/// A channel of both flights over the time compared.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Channels {
    /// Mean in A.
    pub a: PerChannel,
    /// Mean in B.
    pub b: PerChannel,
    /// Root mean square of B minus A.
    pub rms_difference: PerChannel,
}

/// A flight compared with A.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Pair {
    /// The other flight, B.
    pub b: Side,
    /// Which times belong together.
    pub alignment: Alignment,
    /// Channels over the time compared.
    pub channels: Channels,
    /// Differences beyond the errors of the joints, in order of time.
    pub differences: Vec<Difference>,
    /// Places in `differences` by effect, largest first.
    pub by_effect: Vec<usize>,
    /// The first difference with a sound effect in words, or why none is told.
    pub first: String,
    /// Every angle over the time compared.
    pub joints: Vec<Summary>,
    /// Remarks.
    pub notes: Vec<String>,
}

/// The result of a comparison.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Report {
    /// The flight that others are compared with, A.
    pub a: Side,
    /// The others.
    pub pairs: Vec<Pair>,
}

/// A comparison with the data for figures and files.
#[derive(Debug, Clone)]
pub struct Compared {
    /// The numbers.
    pub pair: Pair,
    /// Matched times.
    pub matched: Matched,
    /// Angles over time.
    pub differences: Differences,
}

impl Side {
    /// Describes a recording.
    pub fn of(track: &Track) -> Self {
        let [begin, end] = track.span();
        let [recorded, kept] = track.intervals;
        Self {
            name: track.name.clone(),
            frames: track.read,
            duration_s: end - begin,
            rate_hz: 1.0 / recorded,
            compared_rate_hz: 1.0 / kept,
            warnings: track.warnings.clone(),
        }
    }
}

impl Pair {
    /// Why the effects should not be trusted, if the model reproduces neither flight as well as they would need.
    pub fn doubt(&self) -> Option<String> {
        let gap = |difference: &Difference| difference.trust == Trust::ModelGap;
        let sound = |difference: &Difference| difference.trust == Trust::Sound;
        (self.differences.iter().any(gap) && !self.differences.iter().any(sound)).then(|| {
            "the model misses these flights by more than any difference does: effects are not told apart from its errors"
                .to_owned()
        })
    }
}

/// Compares two recordings.
///
/// # Errors
/// Returns a disagreement if they cannot be aligned.
pub fn compare([a, b]: [&Track; 2], settings: Settings) -> Result<Compared> {
    let matched = align([a, b], settings.align, settings.between)?;
    let differences = Differences::of([a, b], &matched);
    let found = differences.found();
    let mut notes = Vec::new();
    if matched.alignment.similarity < LIKE_ENOUGH {
        notes.push(format!(
            "the movements have little in common (similarity {:.2}): the times that belong together may be others",
            matched.alignment.similarity
        ));
    }
    if found.len() > FLOWN {
        notes.push(format!(
            "{} angles differ beyond the errors of the joints; the {FLOWN} largest for their errors are told",
            found.len()
        ));
    }
    let mut told = found;
    told.sort_by(|x, y| ratio(y).total_cmp(&ratio(x)));
    told.truncate(FLOWN);
    told.sort_by(|x, y| x.span[0].total_cmp(&y.span[0]));
    let origin = matched.alignment.a_s;
    let mut list = Vec::new();
    for one in &told {
        interrupt::check()?;
        list.push(difference(
            [a, b],
            &matched,
            &differences,
            one,
            origin,
            &mut notes,
        )?);
    }
    let mut by_effect: Vec<usize> = (0..list.len()).collect();
    by_effect.sort_by(|x, y| rank(&list[*y]).total_cmp(&rank(&list[*x])));
    let first = words::first(&list, [&a.name, &b.name]);
    Ok(Compared {
        pair: Pair {
            b: Side::of(b),
            alignment: matched.alignment.clone(),
            channels: channels([a, b], &differences.times),
            differences: list,
            by_effect,
            first,
            joints: differences.summaries(),
            notes,
        },
        matched,
        differences,
    })
}

fn ratio(found: &Found) -> f64 {
    (found.mean / found.deviation).abs()
}

/// The size of an effect, for ranking: the largest of its parts; uncertain ones come last.
fn rank(difference: &Difference) -> f64 {
    let sound = if difference.trust == Trust::Sound {
        1e3
    } else {
        0.0
    };
    sound + difference.effect.map_or(0.0, |effect| lead(&effect).1)
}

fn difference(
    [a, b]: [&Track; 2],
    matched: &Matched,
    differences: &Differences,
    found: &Found,
    origin: f64,
    notes: &mut Vec<String>,
) -> Result<Difference> {
    let angle = differences.angles[found.angle];
    let [begin, end] = matched.span();
    let from = found.span[0];
    let window = [(from - LEAD).max(begin), (from + WINDOW).min(end)];
    let over_s = window[1] - from;
    let mut told = Difference {
        joint: angle.to_string(),
        time_s: found.span.map(|time| time - origin),
        difference_rad: found.mean,
        deviation_rad: found.deviation,
        effect: None,
        effect_deviation: None,
        over_s,
        measured: None,
        model_gap: None,
        trust: Trust::NotFlown,
        words: String::new(),
    };
    let slow = [a, b].iter().any(|track| track.intervals[1] > SLOWEST);
    if slow || over_s < SHORTEST {
        let why = if slow {
            "effects are not simulated, as the flights are too long to be kept at a rate that the model needs: give \
             shorter recordings"
        } else {
            "the effects of differences in the last 0.3 s are not simulated"
        };
        if !notes.iter().any(|note| note == why) {
            notes.push(why.to_owned());
        }
    } else {
        let frames = a.between(window[0], window[1]);
        let part = Part::new(&a.flight, frames, from)?;
        let curve: Vec<(f64, f64)> = (differences.curve(found.angle).into_iter())
            .filter(|(time, _)| (window[0]..=window[1]).contains(time))
            .collect();
        let seed = found.angle as u64;
        let (recorded, simulated) = (part.measured()?, part.run(&[])?);
        let [effect, deviation] = effect(&part, &simulated, angle, &curve, found.deviation, seed)?;
        let others = b.between(matched.b_at(window[0]), matched.b_at(window[1]));
        let other = Part::new(&b.flight, others, matched.b_at(from))?;
        let (recorded_b, simulated_b) = (other.measured()?, other.run(&[])?);
        told.measured = Some(recorded_b.minus(&recorded));
        let gaps = [simulated.minus(&recorded), simulated_b.minus(&recorded_b)];
        told.model_gap = Some(gaps);
        told.trust = trust(&effect, &deviation, &gaps);
        (told.effect, told.effect_deviation) = (Some(effect), Some(deviation));
    }
    let turning = a.turn_between(from, window[1]);
    told.words = words::difference(&told, angle, turning);
    Ok(told)
}

/// Means of channels, and their differences.
fn channels([a, b]: [&Track; 2], times: &[(f64, f64)]) -> Channels {
    let mut channels = Channels {
        a: PerChannel::default(),
        b: PerChannel::default(),
        rms_difference: PerChannel::default(),
    };
    let count = times.len().max(1) as f64;
    for channel in Channel::ALL {
        let k = channel as usize;
        let mut first = [None; 2];
        for (one, two) in times {
            let values = [a.channel(channel, *one), b.channel(channel, *two)];
            let [one, two] = [0, 1].map(|side: usize| {
                if !channel.is_angle() {
                    return values[side];
                }
                // Angles are averaged around their first value, since they wrap.
                let from: f64 = *first[side].get_or_insert(values[side]);
                from + bodyflight_core::math::wrap_angle(values[side] - from)
            });
            let apart = if channel.is_angle() {
                bodyflight_core::math::wrap_angle(two - one)
            } else {
                two - one
            };
            channels.a.0[k] += one / count;
            channels.b.0[k] += two / count;
            channels.rms_difference.0[k] += apart * apart / count;
        }
        channels.rms_difference.0[k] = channels.rms_difference.0[k].sqrt();
    }
    channels
}
