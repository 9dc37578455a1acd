//! Markers that slip along the skin and stay there.
//!
//! The distance between two points of one segment depends a little on the posture, since skin and muscles move. A marker
//! that slips changes it for the rest of the recording. The module `step` finds such changes in one distance; here they
//! are found in all of them, and assigned to the marker that explains most.

mod step;

use std::collections::BTreeSet;

use nalgebra::Vector3;

use crate::marker_set::{Points, Rod};
use step::{Change, Regression, Series, Step};

/// Smallest change that is a slip: in size (m), in standard errors, and relative to what soft tissue does in the recording.
const LEAST: f64 = 0.03;
const SURE: f64 = 6.0;
/// Standard errors of further slips: a slipped marker puts the posture off, which lengths depend on.
const SURE_OF_FURTHER: f64 = 10.0;
/// Slips of one marker within this time are one (s).
const TOGETHER: f64 = 0.5;
const ABOVE_TISSUE: f64 = 6.0;
/// The same for a second distance that confirms it.
const CONFIRMS: f64 = 0.01;
const SURE_OF_SECOND: f64 = 4.0;
/// Part of the best explanation that a second marker must reach to be named too.
const AS_GOOD: f64 = 0.8;
/// Most slips that are looked for.
const MOST: usize = 8;
/// Samples: at most so many, and so many a second, each the mean of at most so many rows.
const SAMPLES: usize = 1000;
const PER_SECOND: f64 = 50.0;
const ROWS: usize = 10;
/// Longest span of the trunk (m) that does not bend.
const STIFF: f64 = 0.25;

/// A marker that slipped and stayed there.
#[derive(Debug, Clone, PartialEq)]
pub struct Slip {
    /// The segment whose length shows it best.
    pub segment: String,
    /// The marker; several if the lengths do not tell which of them it is.
    pub markers: Vec<String>,
    /// When it begins (s).
    pub begin_s: f64,
    /// How long it takes (s).
    pub duration_s: f64,
    /// Change of the distance that shows it best (m), apart from what the posture does.
    pub change_m: f64,
    /// Its standard error (m).
    pub error_m: f64,
    /// What soft tissue does to that distance in this recording (m): the standard deviation of what posture leaves.
    pub tissue_m: f64,
}

impl core::fmt::Display for Slip {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let within = match self.duration_s {
            0.0 => "at once".to_owned(),
            duration => format!("within {duration:.1} s"),
        };
        let [change, error, tissue] =
            [self.change_m, self.error_m, self.tissue_m].map(|length| 100.0 * length);
        write!(
            f,
            "{}: {} slipped at {:.2} s, {within}, and stays there: a length of the segment changes by {change:+.1} +- \
             {error:.1} cm, while soft tissue changes it by {tissue:.1} cm; the attitude is off from then on",
            self.segment,
            self.markers.join(" or "),
            self.begin_s,
        )
    }
}

impl Slip {
    /// Whether another one is a rest of this one.
    fn is_same(&self, other: &Self) -> bool {
        let shared = self
            .markers
            .iter()
            .any(|marker| other.markers.contains(marker));
        let apart = self.begin_s + 0.5 * self.duration_s - other.begin_s - 0.5 * other.duration_s;
        shared && apart.abs() < TOGETHER.max(self.duration_s)
    }
}

/// A distance within one segment, between the midpoints of some markers.
struct Line {
    rod: usize,
    ends: [Vec<usize>; 2],
}

/// A distance with the series of its samples.
struct Measured {
    line: Line,
    series: Series,
}

/// The markers that slip, in order of time.
pub(crate) fn found(points: &Points<'_>) -> Vec<Slip> {
    let lines: Vec<Measured> = (lines(points).into_iter())
        .map(|line| Measured {
            series: sampled(points, &line),
            line,
        })
        .collect();
    let mut known: Vec<Step> = Vec::new();
    let mut slips: Vec<Slip> = Vec::new();
    for _ in 0..MOST {
        let regressions: Vec<Option<Regression<'_>>> = (lines.iter())
            .map(|measured| Regression::new(&measured.series, &known))
            .collect();
        let best = (regressions.iter().enumerate())
            .filter_map(|(k, regression)| Some((k, regression.as_ref()?.best()?)))
            .filter(|(_, change)| {
                is_slip(
                    change,
                    if slips.is_empty() {
                        SURE
                    } else {
                        SURE_OF_FURTHER
                    },
                )
            })
            .max_by(|(_, a), (_, b)| surprise(a).total_cmp(&surprise(b)));
        let Some((_, Change { step, .. })) = best else {
            break;
        };
        // The same step in the other distances tells which marker it is.
        let seen: Vec<(&Line, Change)> = (lines.iter().zip(&regressions))
            .filter_map(|(measured, regression)| {
                Some((&measured.line, regression.as_ref()?.with(step)?))
            })
            .filter(|(_, change)| confirms(change))
            .collect();
        let slip = assigned(points, &seen);
        let is_new = |slip: &Slip| !slips.iter().any(|other| other.is_same(slip));
        slips.extend(slip.filter(is_new));
        known.push(step);
    }
    slips.sort_by(|a, b| a.begin_s.total_cmp(&b.begin_s));
    slips
}

fn surprise(change: &Change) -> f64 {
    change.size.abs() / change.error.max(f64::MIN_POSITIVE)
}

fn is_slip(change: &Change, sure: f64) -> bool {
    let size = change.size.abs();
    size > LEAST && size > ABOVE_TISSUE * change.left && surprise(change) > sure
}

fn confirms(change: &Change) -> bool {
    change.size.abs() > CONFIRMS && surprise(change) > SURE_OF_SECOND
}

/// The slip that explains most of the changes of distances at one time.
fn assigned(points: &Points<'_>, seen: &[(&Line, Change)]) -> Option<Slip> {
    // A marker that is one of several at an end has its part of the change.
    let share = |line: &Line, marker: usize| {
        let has = line.ends.iter().find(|end| end.contains(&marker));
        has.map_or(0.0, |end| 1.0 / end.len() as f64)
    };
    let explained = |marker: usize| {
        let parts = seen
            .iter()
            .map(|(line, change)| share(line, marker) * change.size.abs());
        parts.sum::<f64>()
    };
    let all = (0..points.markers.len()).map(|marker| (marker, explained(marker)));
    let all: Vec<(usize, f64)> = all.collect();
    let most = all.iter().map(|(_, part)| *part).fold(0.0, f64::max);
    let named: Vec<usize> = (all.iter())
        .filter(|(_, part)| *part > AS_GOOD * most)
        .map(|(marker, _)| *marker)
        .collect();
    let own = seen.iter().filter(|(line, _)| {
        let mut of_line = line.ends.iter().flatten();
        of_line.any(|marker| named.contains(marker))
    });
    let (line, change) = own.max_by(|(_, a), (_, b)| a.size.abs().total_cmp(&b.size.abs()))?;
    Some(Slip {
        segment: points.rods[line.rod].segment.clone(),
        markers: (named.iter())
            .map(|marker| points.markers[*marker].name.clone())
            .collect(),
        begin_s: change.step.begin,
        duration_s: change.step.duration,
        change_m: change.size,
        error_m: change.error,
        tissue_m: change.left,
    })
}

/// The distances that a rigid segment keeps.
fn lines(points: &Points<'_>) -> Vec<Line> {
    let is_arm = |rod: &&Rod| rod.segment.ends_with("upperarm");
    // Shoulders move against the trunk, and fingers against the hand.
    let shoulders: Vec<usize> = (points.rods.iter().filter(is_arm))
        .flat_map(|rod| rod.ends[0].clone())
        .collect();
    let mut lines = Vec::new();
    let mut pairs = BTreeSet::new();
    for (k, rod) in points.rods.iter().enumerate() {
        let [from, to] = &rod.ends;
        let has_shoulder = || from.iter().chain(to).any(|own| shoulders.contains(own));
        let is_stiff = || rod.segment == "pelvis" && !has_shoulder() && is_short(points, rod);
        if rod.rigid && !rod.segment.ends_with("hand") || is_stiff() {
            let alone = |end: &Vec<usize>| {
                let each = end.iter().filter(|_| end.len() > 1);
                each.map(|own| vec![*own]).collect::<Vec<_>>()
            };
            let whole = [(from.clone(), to.clone())].into_iter();
            let near = alone(from).into_iter().map(|own| (own, to.clone()));
            let far = alone(to).into_iter().map(|own| (from.clone(), own));
            lines.extend(whole.chain(near).chain(far).map(|(from, to)| Line {
                rod: k,
                ends: [from, to],
            }));
        }
        for end in &rod.ends {
            for (at, one) in end.iter().enumerate() {
                for other in &end[at + 1..] {
                    let moves = shoulders.contains(one) || shoulders.contains(other);
                    if !moves && pairs.insert([*one.min(other), *one.max(other)]) {
                        lines.push(Line {
                            rod: k,
                            ends: [vec![*one], vec![*other]],
                        });
                    }
                }
            }
        }
    }
    lines
}

/// Whether a segment of the trunk is too short to bend.
fn is_short(points: &Points<'_>, rod: &Rod) -> bool {
    let every = points.rows().div_ceil(SAMPLES).max(1);
    let rows = (0..points.rows()).step_by(every);
    let mut lengths: Vec<f64> = rows
        .filter_map(|row| Some(between(points, row, &rod.ends)?.norm()))
        .collect();
    lengths.sort_by(f64::total_cmp);
    (lengths.get(lengths.len() / 2)).is_some_and(|length| *length < STIFF)
}

fn between(points: &Points<'_>, row: usize, ends: &[Vec<usize>; 2]) -> Option<Vector3<f64>> {
    Some(points.end(row, &ends[1])? - points.end(row, &ends[0])?)
}

/// A distance and its posture, in bins of rows.
fn sampled(points: &Points<'_>, line: &Line) -> Series {
    let mut series = Series::default();
    let (Some(first), Some(last)) = (points.times.first(), points.times.last()) else {
        return series;
    };
    let count = points.rows();
    let rate = (count as f64 - 1.0) / (last - first).max(f64::MIN_POSITIVE);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a small count of rows"
    )]
    let for_rate = (rate / PER_SECOND).round().clamp(1.0, 1e4) as usize;
    let bin = for_rate.max(count.div_ceil(SAMPLES));
    for begin in (0..count).step_by(bin) {
        let rows = (begin..(begin + bin).min(count)).step_by(bin.div_ceil(ROWS));
        let mut sum: Option<(f64, f64, Vec<f64>)> = None;
        let mut seen = 0.0;
        for row in rows {
            let Some(length) = between(points, row, &line.ends).map(|way| way.norm()) else {
                continue;
            };
            let Some(features) = posture(points, row, line.rod) else {
                continue;
            };
            seen += 1.0;
            let (time, total, all) =
                sum.get_or_insert_with(|| (0.0, 0.0, vec![0.0; features.len()]));
            *time += points.times[row];
            *total += length;
            for (all, own) in all.iter_mut().zip(features) {
                *all += own;
            }
        }
        if let Some((time, length, features)) = sum {
            series.times.push(time / seen);
            series.lengths.push(length / seen);
            let means = features.into_iter().map(|feature| feature / seen);
            series.features.push(means.collect());
        }
    }
    series
}

/// Features of the posture that move skin over a segment: where it points, seen from its parent, and where its children
/// point, seen from it.
fn posture(points: &Points<'_>, row: usize, rod: usize) -> Option<Vec<f64>> {
    let along = |rod: &Rod| Some(between(points, row, &rod.ends)?.try_normalize(0.0));
    let own = along(&points.rods[rod])??;
    let mut directions = Vec::new();
    if let Some(parent) = points.rods[rod].parent.map(|parent| &points.rods[parent]) {
        let up = along(parent)??;
        directions.push(up);
        if let Some(sides) = &parent.left {
            let left = between(points, row, sides)?.try_normalize(0.0)?;
            directions.extend([left, up.cross(&left)]);
        }
    }
    for child in points.rods.iter().filter(|other| other.parent == Some(rod)) {
        directions.push(along(child)??);
    }
    let cosines = directions.iter().map(|direction| own.dot(direction));
    let cosines: Vec<f64> = cosines.collect();
    let squares = cosines.iter().map(|cosine| cosine * cosine);
    Some(cosines.iter().copied().chain(squares).collect())
}
