//! Orientations that resemble what they should not: those of another sensor, their own of the row before, or those of a
//! sensor that nobody wears.

use bodyflight_mvnx::recording::{LOST, REPEATED};
use nalgebra::{Quaternion, UnitQuaternion};

use crate::links::{Link, Turn};
use crate::mapping::{Mapping, Mounting};
use crate::table::Table;

/// Rotation from row to row (rad) of a segment that certainly moves, well above the last digit of a file.
const MOVES: f64 = 0.01;
/// Share of the rows with motion in which two sensors that are one are equal: some rows of either are filled.
const EQUAL: f64 = 0.9;
/// Fewest rows with motion that are judged.
const LEAST: usize = 30;
/// Rotation (rad) that a sensor which lies somewhere keeps to, and by which most others turn meanwhile.
const STILL: f64 = 0.1;
const TURNS: f64 = 1.0;

/// What was found.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Found {
    /// What contradicts itself.
    pub contradictions: Vec<String>,
    /// What makes the rows no worse than they are.
    pub remarks: Vec<String>,
}

/// The orientations of a link in the complete rows.
struct Turns<'a> {
    name: &'a str,
    turns: Vec<UnitQuaternion<f64>>,
}

impl Turns<'_> {
    /// Rotation from the row before to this one (rad), none if they are the same.
    fn step(&self, row: usize) -> Option<f64> {
        let before = self.turns.get(row.checked_sub(1)?)?;
        Some(before.angle_to(self.turns.get(row)?))
    }

    fn is_repeated(&self, row: usize) -> bool {
        row > 0 && self.turns.get(row - 1) == self.turns.get(row)
    }

    fn moves(&self, row: usize) -> bool {
        self.step(row).is_some_and(|step| step > MOVES)
    }

    /// Rows that repeat the one before between two in which it moves, among those and the rows in which it moves. A sensor
    /// that is frozen is none that repeats itself: it moves on neither side.
    fn repeated(&self) -> [usize; 2] {
        let rows = 1..self.turns.len();
        let moving = rows.clone().filter(|row| self.moves(*row)).count();
        let repeats = |row: &usize| {
            let begins = self.moves(*row - 1) && self.is_repeated(*row);
            let next = (*row + 1..self.turns.len()).find(|next| !self.is_repeated(*next));
            begins && next.is_some_and(|next| self.moves(next))
        };
        let repeated = rows.filter(repeats).count();
        [repeated, repeated + moving]
    }

    /// Largest rotation from the first row (rad).
    fn largest(&self) -> f64 {
        let first = self.turns.first();
        let turned = first.map(|first| self.turns.iter().map(|turn| first.angle_to(turn)));
        turned.into_iter().flatten().fold(0.0, f64::max)
    }
}

/// Looks for such orientations in the complete rows of a table with quaternions.
pub(crate) fn found(table: &Table, links: &[Link], rows: &[usize], mapping: &Mapping) -> Found {
    let of_link = |link: &'_ Link| match &link.turn {
        Turn::Quaternion(columns, _) => Some(
            (rows.iter())
                .map(|row| {
                    let [w, x, y, z] = columns.map(|column| table.value(*row, column));
                    UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z))
                })
                .collect(),
        ),
        _ => None,
    };
    let turns = links.iter().filter_map(|link| {
        Some(Turns {
            name: &link.name,
            turns: of_link(link)?,
        })
    });
    let turns: Vec<Turns<'_>> = turns.collect();
    let mut found = Found::default();
    repetitions(&turns, &mut found);
    // Segments may be rigid in other programs; sensors that lie anyhow never have the same orientation.
    if mapping.quaternions.mounting == Mounting::FirstRow {
        found.contradictions.extend(copies(&turns));
        found.contradictions.extend(lying(&turns));
    }
    found
}

/// Sensors that repeat themselves while others do not.
fn repetitions(all: &[Turns<'_>], found: &mut Found) {
    let counted = all.iter().map(|own| (own, own.repeated()));
    let share = |[repeated, rows]: [usize; 2]| repeated as f64 / rows.max(1) as f64;
    let often: Vec<_> = counted
        .filter(|(_, counts)| counts[1] >= LEAST && share(*counts) > LOST)
        .collect();
    // What all do is a matter of the whole recording, and told there.
    if 2 * often.len() > all.len() {
        return;
    }
    for (own, counts) in often {
        let is_slower = share(counts) > REPEATED;
        let [repeated, rows] = counts;
        let why = if is_slower {
            "its sensor is slower than the others, or most of its samples were lost and filled"
        } else {
            "samples were lost and filled"
        };
        let message = format!(
            "{} repeats the row before in {repeated} of {rows} rows while it moves, and others do not: {why}",
            own.name
        );
        if is_slower {
            found.contradictions.push(message);
        } else {
            found.remarks.push(message);
        }
    }
}

/// Sensors of which one is a copy of the other.
fn copies(all: &[Turns<'_>]) -> Vec<String> {
    let mut said = Vec::new();
    for (place, own) in all.iter().enumerate() {
        let rows: Vec<usize> = (1..own.turns.len()).filter(|row| own.moves(*row)).collect();
        if rows.len() < LEAST {
            continue;
        }
        for other in all.iter().skip(place + 1) {
            let same = |row: &&usize| own.turns.get(**row) == other.turns.get(**row);
            let equal = rows.iter().filter(same).count();
            if equal as f64 > EQUAL * rows.len() as f64 {
                said.push(format!(
                    "{} and {} have the same orientation in {equal} of {} rows in which they move: one sensor was taken for both",
                    own.name,
                    other.name,
                    rows.len()
                ));
            }
        }
    }
    said
}

/// Sensors that keep their orientation while most of the others turn.
fn lying(all: &[Turns<'_>]) -> Vec<String> {
    let largest: Vec<f64> = all.iter().map(Turns::largest).collect();
    let turning = largest.iter().filter(|angle| **angle > TURNS).count();
    if 2 * turning <= all.len() {
        return Vec::new();
    }
    let still = all
        .iter()
        .zip(&largest)
        .filter(|(_, angle)| **angle < STILL);
    let said = still.map(|(own, angle)| {
        format!(
            "the sensor of {} turns by no more than {:.1} degrees while {turning} others turn by more than {:.0}: it was not worn, or is frozen",
            own.name,
            angle.to_degrees(),
            TURNS.to_degrees()
        )
    });
    said.collect()
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;

    /// Four sensors that turn, each about its own axis; `change` spoils rows of one.
    fn said(
        change: impl Fn(
            usize,
            usize,
            &dyn Fn(usize, usize) -> UnitQuaternion<f64>,
        ) -> UnitQuaternion<f64>,
    ) -> [Vec<String>; 3] {
        let good = |sensor: usize, row: usize| {
            let axis = Vector3::new(sensor as f64, 1.0, 2.0).normalize();
            UnitQuaternion::from_scaled_axis(axis * (1.5 * (0.05 * row as f64).sin()))
        };
        let names = ["a", "b", "c", "d"];
        let all: Vec<Turns<'_>> = (names.into_iter().enumerate())
            .map(|(sensor, name)| Turns {
                name,
                turns: (0..300).map(|row| change(sensor, row, &good)).collect(),
            })
            .collect();
        let mut found = Found::default();
        repetitions(&all, &mut found);
        let mut contradictions = found.contradictions;
        contradictions.extend(copies(&all));
        [contradictions, found.remarks, lying(&all)]
    }

    #[test]
    fn sensors_that_are_worn_are_sound() {
        let nothing: [Vec<String>; 3] = Default::default();
        assert_eq!(said(|sensor, row, good| good(sensor, row)), nothing);
        // Frozen is not repeated, and what all do is told elsewhere.
        let frozen =
            said(|sensor, row, good| good(sensor, if sensor == 1 { row.min(150) } else { row }));
        assert_eq!(frozen, nothing);
        assert_eq!(
            said(|sensor, row, good| good(sensor, row - row % 2)),
            nothing
        );
    }

    #[test]
    fn what_no_sensor_does_is_named() {
        let [slow, remarks, lying] =
            said(|sensor, row, good| good(sensor, if sensor == 2 { row - row % 2 } else { row }));
        assert_eq!((slow.len(), remarks.len(), lying.len()), (1, 0, 0));
        assert!(
            slow[0].contains("c repeats the row before in 1"),
            "{slow:?}"
        );
        let [slow, remarks, _] = said(|sensor, row, good| {
            good(
                sensor,
                if sensor == 2 && row % 20 == 9 {
                    row - 1
                } else {
                    row
                },
            )
        });
        assert_eq!(slow.len(), 0);
        assert!(remarks[0].contains("were lost and filled"), "{remarks:?}");
        let [copied, ..] =
            said(|sensor, row, good| good(if sensor == 3 { 1 } else { sensor }, row));
        assert_eq!(copied.len(), 1);
        assert!(copied[0].contains("b and d have the same"), "{copied:?}");
        let [none, _, lying] = said(|sensor, row, good| {
            if sensor == 0 {
                let noise = Vector3::new((row * row) as f64, row as f64, 1.0).map(f64::sin);
                return UnitQuaternion::from_scaled_axis(noise * 0.01);
            }
            good(sensor, row)
        });
        assert_eq!(none.len(), 0);
        assert!(
            lying[0].contains("sensor of a turns by no more than"),
            "{lying:?}"
        );
    }
}
