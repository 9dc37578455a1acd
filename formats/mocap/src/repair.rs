//! Points that a laboratory's software lost or exchanged, and segments whose length changes.
//!
//! Segments are rigid, and points move continuously. A point at exactly 0, 0, 0 is a lost one. Two points that jump to
//! each other's place are exchanged, and are exchanged back. A point that changes the length of its segments is not
//! where the file says. Short gaps are bridged; all this is reported with segment and time.

use std::collections::BTreeMap;

use nalgebra::Vector3;

use crate::marker_set::{Points, Rod};
use crate::slip::{self, Slip};

/// Longest time without a point that is bridged (s).
pub const BRIDGE: f64 = 0.1;
/// Smallest jump in one frame that may be an exchange (m), and the largest ratio of the jumps that remain after
/// exchanging the points back.
const JUMP: f64 = 0.05;
const REMAINS: f64 = 0.3;
/// Ratio of the lengths of all bones of two points that tells which way they are exchanged.
const CLEAR: f64 = 0.99;
/// Relative and absolute change of a length (m) that a rigid segment with markers on the skin does not show.
const STRETCH: f64 = 0.2;
const LEAST_STRETCH: f64 = 0.03;
/// If more than this share of the frames is off, the points do not mark a rigid segment.
const SOFT: f64 = 0.3;

/// A run of frames with the same fault.
#[derive(Debug, Clone, PartialEq)]
pub struct Fault {
    /// The segments concerned.
    pub segments: Vec<String>,
    /// Time of its first and last frame (s).
    pub span_s: [f64; 2],
    /// Number of frames.
    pub frames: usize,
    /// What was found, and what was done about it.
    pub message: String,
}

impl core::fmt::Display for Fault {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let [from, to] = self.span_s;
        let segments = self.segments.join(", ");
        let (frames, message) = (self.frames, &self.message);
        write!(
            f,
            "{segments}: {from:.2} to {to:.2} s, {frames} frames: {message}"
        )
    }
}

impl Points<'_> {
    /// Repairs what can be repaired, and returns what was found, and the points that slipped. Points that are lost for
    /// longer are left empty.
    pub(crate) fn repair(mut self) -> (Vec<Fault>, Vec<Slip>) {
        self.drop_zeros();
        let mut faults = self.exchange_back();
        let slips = slip::found(&self);
        faults.extend(self.drop_stretched());
        faults.extend(self.bridge());
        (faults, slips)
    }

    fn put(&mut self, row: usize, marker: usize, place: Option<Vector3<f64>>) {
        let place = place.map_or([f64::NAN; 3], |place| (place / self.unit_m).into());
        for (column, value) in self.markers[marker].columns.into_iter().zip(place) {
            self.table.set(row, column, value);
        }
    }

    /// The segments that a point belongs to.
    fn segments(&self, markers: &[usize]) -> Vec<String> {
        let has = |rod: &&Rod| {
            let mut own = rod.ends.iter().flatten();
            own.any(|marker| markers.contains(marker))
        };
        let rods = self.rods.iter().filter(has);
        rods.map(|rod| rod.segment.clone()).collect()
    }

    /// One fault for each run of consecutive rows.
    fn runs(&self, rows: &[usize], markers: &[usize], message: &str) -> Vec<Fault> {
        let names: Vec<&str> = markers
            .iter()
            .map(|k| self.markers[*k].name.as_str())
            .collect();
        let runs = rows.chunk_by(|a, b| b - a == 1);
        runs.filter_map(|run| {
            Some(Fault {
                segments: self.segments(markers),
                span_s: [self.times[*run.first()?], self.times[*run.last()?]],
                frames: run.len(),
                message: format!("{} {message}", names.join(" and ")),
            })
        })
        .collect()
    }

    fn drop(&mut self, row: usize, marker: usize, why: &'static str) {
        self.put(row, marker, None);
        self.dropped.insert([marker, row], why);
    }

    fn drop_zeros(&mut self) {
        for marker in 0..self.markers.len() {
            for row in 0..self.rows() {
                if self
                    .at(row, marker)
                    .is_some_and(|at| at.iter().all(|value| *value == 0.0))
                {
                    self.drop(row, marker, "is at exactly 0, 0, 0");
                }
            }
        }
    }

    fn exchange_back(&mut self) -> Vec<Fault> {
        let count = self.markers.len();
        let mut last: Vec<Option<Vector3<f64>>> = vec![None; count];
        let mut exchanged: BTreeMap<[usize; 2], Vec<usize>> = BTreeMap::new();
        for row in 0..self.rows() {
            let here: Vec<_> = (0..count).map(|marker| self.at(row, marker)).collect();
            let jumps = |marker: usize| {
                let jump = (here[marker]? - last[marker]?).norm();
                (jump > JUMP).then_some((marker, jump))
            };
            let jumping: Vec<(usize, f64)> = (0..count).filter_map(jumps).collect();
            let mut pair = None;
            for (k, (one, far)) in jumping.iter().enumerate() {
                for (other, further) in &jumping[k + 1..] {
                    let crossed = |a: usize, b: usize| Some((here[a]? - last[b]?).norm());
                    let remains = crossed(*one, *other).zip(crossed(*other, *one));
                    let remains = remains.map_or(f64::INFINITY, |(a, b)| a + b);
                    if remains < REMAINS * (far + further) {
                        pair = Some([*one, *other]);
                    }
                }
            }
            if let Some([one, other]) = pair {
                self.put(row, one, here[other]);
                self.put(row, other, here[one]);
                exchanged.entry([one, other]).or_default().push(row);
            }
            for (marker, last) in last.iter_mut().enumerate() {
                *last = self.at(row, marker).or(*last);
            }
        }
        let mut faults = Vec::new();
        for (pair, mut rows) in exchanged {
            // Bones that lead to the right points are shorter. If that does not tell, the smaller part is exchanged.
            let [kept, crossed] = [false, true].map(|crosses| self.total(&pair, crosses));
            let is_most = 2 * rows.len() > self.rows();
            let is_rest = crossed < CLEAR * kept || is_most && kept >= CLEAR * crossed;
            if is_rest {
                for row in 0..self.rows() {
                    let [one, other] = pair.map(|marker| self.at(row, marker));
                    self.put(row, pair[0], other);
                    self.put(row, pair[1], one);
                }
                rows = (0..self.rows())
                    .filter(|row| rows.binary_search(row).is_err())
                    .collect();
            }
            faults.extend(self.runs(&rows, &pair, "are exchanged, and were exchanged back"));
        }
        faults
    }

    /// Length of all segments that end at one of two points, over all rows (m), perhaps with the points exchanged.
    fn total(&self, pair: &[usize; 2], crosses: bool) -> f64 {
        let other = |marker: usize| match pair.iter().position(|own| *own == marker) {
            Some(at) if crosses => pair[1 - at],
            _ => marker,
        };
        let concerned = |rod: &&Rod| rod.ends.iter().flatten().any(|own| pair.contains(own));
        let rods: Vec<[Vec<usize>; 2]> = (self.rods.iter().filter(concerned))
            .map(|rod| {
                let [from, to] = &rod.ends;
                [from, to].map(|end| end.iter().map(|marker| other(*marker)).collect())
            })
            .collect();
        let lengths = (0..self.rows()).flat_map(|row| {
            rods.iter().filter_map(move |[from, to]| {
                Some((self.end(row, to)? - self.end(row, from)?).norm())
            })
        });
        lengths.sum()
    }

    fn drop_stretched(&mut self) -> Vec<Fault> {
        let mut faults = Vec::new();
        // For each row, the rods that are off.
        let mut off: Vec<Vec<usize>> = vec![Vec::new(); self.rows()];
        for (k, rod) in self.rods.iter().enumerate().filter(|(_, rod)| rod.rigid) {
            let length = |row: usize| {
                let [from, to] = [0, 1].map(|end| self.end(row, &rod.ends[end]));
                Some((to? - from?).norm())
            };
            let lengths: Vec<Option<f64>> = (0..self.rows()).map(length).collect();
            let mut sorted: Vec<f64> = lengths.iter().copied().flatten().collect();
            sorted.sort_by(f64::total_cmp);
            let Some(usual) = sorted.get(sorted.len() / 2).copied() else {
                continue;
            };
            let is_off =
                |length: f64| (length - usual).abs() > (STRETCH * usual).max(LEAST_STRETCH);
            let rows: Vec<usize> = (0..self.rows())
                .filter(|row| lengths[*row].is_some_and(is_off))
                .collect();
            if rows.len() as f64 > SOFT * sorted.len() as f64 {
                faults.push(Fault {
                    segments: vec![rod.segment.clone()],
                    span_s: [self.times[0], self.times[self.rows() - 1]],
                    frames: rows.len(),
                    message: format!(
                        "its length varies from {:.2} to {:.2} m, so its points do not mark the ends of a bone",
                        sorted[0],
                        sorted[sorted.len() - 1]
                    ),
                });
                continue;
            }
            for row in rows {
                off[row].push(k);
            }
        }
        for (row, rods) in off.iter_mut().enumerate() {
            while let Some(marker) = self.blamed(rods) {
                self.drop(row, marker, "changes the length of a bone");
                rods.retain(|rod| {
                    !self.rods[*rod]
                        .ends
                        .iter()
                        .flatten()
                        .any(|own| *own == marker)
                });
            }
        }
        faults
    }

    /// The point that explains most of the rods that are off: the one with the largest share of its own.
    fn blamed(&self, off: &[usize]) -> Option<usize> {
        let count = |marker: usize, rods: &mut dyn Iterator<Item = &Rod>| {
            rods.filter(|rod| rod.rigid && rod.ends.iter().flatten().any(|own| *own == marker))
                .count()
        };
        let score = |marker: usize| {
            let bad = count(marker, &mut off.iter().map(|rod| &self.rods[*rod]));
            let all = count(marker, &mut self.rods.iter());
            (bad as f64 / all.max(1) as f64, bad)
        };
        let scored = (0..self.markers.len()).map(|marker| (score(marker), marker));
        let best = scored.max_by(|((a, m), _), ((b, n), _)| a.total_cmp(b).then(m.cmp(n)));
        best.filter(|((_, bad), _)| *bad > 0)
            .map(|(_, marker)| marker)
    }

    fn bridge(&mut self) -> Vec<Fault> {
        let mut faults = Vec::new();
        for marker in 0..self.markers.len() {
            let missing: Vec<usize> = (0..self.rows())
                .filter(|row| self.at(*row, marker).is_none())
                .collect();
            for run in missing.chunk_by(|a, b| b - a == 1) {
                let (first, last) = (run[0], run[run.len() - 1]);
                let ends = first
                    .checked_sub(1)
                    .zip((last + 1 < self.rows()).then_some(last + 1));
                let bridged =
                    ends.filter(|(a, b)| self.times[*b] - self.times[*a] <= BRIDGE + 1e-9);
                if let Some((before, after)) = bridged {
                    for row in run {
                        let place = self.between(marker, [before, after], *row);
                        self.put(*row, marker, place);
                    }
                }
                let why = run.iter().find_map(|row| self.dropped.get(&[marker, *row]));
                let what = format!(
                    "{}; {}",
                    why.copied().unwrap_or("is not there"),
                    if bridged.is_some() {
                        "bridged"
                    } else {
                        "these frames are left out"
                    }
                );
                faults.extend(self.runs(run, &[marker], &what));
            }
        }
        faults
    }

    /// A place between two rows with a known place: on the cubic that continues the motion on both sides.
    fn between(
        &self,
        marker: usize,
        [before, after]: [usize; 2],
        row: usize,
    ) -> Option<Vector3<f64>> {
        let (from, to) = (self.at(before, marker)?, self.at(after, marker)?);
        let duration = self.times[after] - self.times[before];
        let slope = |a: usize, b: usize| {
            let way = self.at(b, marker)? - self.at(a, marker)?;
            Some(way / (self.times[b] - self.times[a]) * duration)
        };
        let straight = to - from;
        let leaves = before.checked_sub(1).and_then(|more| slope(more, before));
        let arrives = (after + 1 < self.rows())
            .then(|| slope(after, after + 1))
            .flatten();
        let (leaves, arrives) = (leaves.unwrap_or(straight), arrives.unwrap_or(straight));
        let share = (self.times[row] - self.times[before]) / duration;
        let (square, cube) = (share * share, share * share * share);
        Some(
            from + straight * (3.0 * square - 2.0 * cube)
                + leaves * (cube - 2.0 * square + share)
                + arrives * (cube - square),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::marker_set::Marker;
    use crate::table::Table;

    const RATE: f64 = 100.0;

    /// An arm that swings at 100 Hz: shoulder, elbow, wrist, in millimetres, and a second elbow beside it.
    fn arm() -> Table {
        let mut text = "time".to_owned();
        for point in ["sho", "elb", "wri", "other"] {
            for axis in ["x", "y", "z"] {
                text.push_str(&format!(",{point}.{axis}"));
            }
        }
        for k in 0..200 {
            let time = f64::from(k) / RATE;
            let (a, b) = (2.0 * (3.0 * time).sin(), 1.0 + (5.0 * time).cos());
            let shoulder = Vector3::new(100.0 + 500.0 * time, 1400.0, 10.0);
            let elbow = shoulder + 300.0 * Vector3::new(a.sin(), 0.1, -a.cos()).normalize();
            let wrist = elbow + 250.0 * Vector3::new((a + b).sin(), 0.0, -(a + b).cos());
            let other = elbow + Vector3::new(0.0, 400.0, 0.0);
            text.push_str(&format!("\n{time}"));
            for place in [shoulder, elbow, wrist, other] {
                text.push_str(&format!(",{},{},{}", place.x, place.y, place.z));
            }
        }
        Table::parse(&text).unwrap()
    }

    fn repaired(table: &mut Table) -> Vec<String> {
        let names = ["sho", "elb", "wri", "other"]
            .into_iter()
            .zip([1, 4, 7, 10]);
        let markers = names.map(|(name, at)| Marker {
            name: name.to_owned(),
            columns: [at, at + 1, at + 2],
        });
        let rod = |segment: &str, from, to| Rod {
            segment: segment.to_owned(),
            ends: [vec![from], vec![to]],
            rigid: true,
            parent: None,
            left: None,
        };
        let points = Points {
            markers: markers.collect(),
            rods: vec![rod("l_upperarm", 0, 1), rod("l_forearm", 1, 2)],
            times: (0..table.rows()).map(|row| row as f64 / RATE).collect(),
            unit_m: 1e-3,
            dropped: BTreeMap::new(),
            table,
        };
        points.repair().0.iter().map(ToString::to_string).collect()
    }

    /// Largest difference of a coordinate from the arm's (mm); infinite if one is missing.
    fn off(table: &Table) -> f64 {
        let right = arm();
        let each = (0..right.rows()).flat_map(|row| (1..13).map(move |column| (row, column)));
        each.map(|(row, column)| (table.value(row, column) - right.value(row, column)).abs())
            .fold(
                0.0,
                |a, b| if b.is_nan() { f64::INFINITY } else { a.max(b) },
            )
    }

    #[test]
    fn a_clean_arm_is_left_alone() {
        let mut table = arm();
        assert!(repaired(&mut table).is_empty());
        assert!(off(&table) == 0.0);
    }

    #[test]
    fn short_losses_are_bridged_and_long_ones_left_out_with_segment_and_time() {
        let mut table = arm();
        for row in 50..56 {
            for column in 7..10 {
                table.set(row, column, 0.0);
            }
        }
        let said = repaired(&mut table);
        assert_eq!(
            said,
            ["l_forearm: 0.50 to 0.55 s, 6 frames: wri is at exactly 0, 0, 0; bridged"]
        );
        assert!(off(&table) < 5.0, "{} mm", off(&table));
        for row in 100..150 {
            table.set(row, 5, f64::NAN);
        }
        let said = repaired(&mut table);
        assert_eq!(
            said,
            [
                "l_upperarm, l_forearm: 1.00 to 1.49 s, 50 frames: elb is not there; these frames are left out"
            ]
        );
    }

    #[test]
    fn exchanged_points_are_exchanged_back_and_named() {
        // The last is most of the file: the bones show which part is right.
        let spans = [
            (30..90, "0.30 to 0.89 s"),
            (0..40, "0.00 to 0.39 s"),
            (60..200, "0.60 to 1.99 s"),
        ];
        for (rows, span) in spans {
            for pair in [[4, 7], [4, 10]] {
                let mut table = arm();
                for row in rows.clone() {
                    for axis in 0..3 {
                        let [a, b] = pair.map(|column| table.value(row, column + axis));
                        table.set(row, pair[0] + axis, b);
                        table.set(row, pair[1] + axis, a);
                    }
                }
                let said = repaired(&mut table);
                assert!(off(&table) < 1e-9, "{said:?}: {} mm", off(&table));
                assert_eq!(said.len(), 1, "{said:?}");
                assert!(
                    said[0].contains(span) && said[0].contains("exchanged back"),
                    "{said:?}"
                );
            }
        }
    }

    #[test]
    fn a_point_that_stretches_a_bone_is_not_used() {
        let mut table = arm();
        for row in 120..125 {
            table.set(row, 5, table.value(row, 5) + 300.0);
        }
        let said = repaired(&mut table);
        assert_eq!(
            said,
            [
                "l_upperarm, l_forearm: 1.20 to 1.24 s, 5 frames: elb changes the length of a bone; bridged"
            ]
        );
        assert!(off(&table) < 5.0, "{} mm", off(&table));
    }
}
