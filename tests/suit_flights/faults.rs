//! How often planted faults are named, and whether estimates are consistent while a posture is wrong, as a table.

use std::sync::Mutex;

use super::suit_maneuvers::MANEUVERS;
use super::{Jump, column, numbers};

/// Faults of `synth`, with how the table calls them.
const FAULTS: [[&str; 2]; 8] = [
    ["exchanged", "exchanged"],
    ["reversed=-6", "reversed before the exit"],
    ["reversed=3", "reversed in flight"],
    ["slipped=3", "slipped about the limb in flight"],
    ["dead=5", "dead from 5 s on"],
    ["saturated=100", "saturated at 100 deg/s"],
    ["late=0.06", "late by 60 ms"],
    ["mirrored", "mirrored"],
];

/// Sensors of trunk, legs and arms, in turn, each with one that it is exchanged with.
const PLACES: [&[[&str; 2]]; 3] = [
    &[["thorax", "r_upperarm"], ["pelvis", "thorax"]],
    &[
        ["l_thigh", "l_shank"],
        ["r_shank", "l_shank"],
        ["r_thigh", "l_thigh"],
        ["l_shank", "l_thigh"],
    ],
    &[
        ["l_upperarm", "l_forearm"],
        ["r_forearm", "l_forearm"],
        ["r_upperarm", "l_upperarm"],
        ["l_forearm", "r_forearm"],
    ],
];

/// Error of a direction (degrees) from which a posture is wrong, and time for which an estimate may be consistent
/// meanwhile (s).
const WRONG: f64 = 20.0;
const AT_MOST: f64 = 0.5;
/// Error that a fault must add to matter (degrees, root of the mean square).
const MATTERS: f64 = 3.0;

/// What became of a flight.
#[derive(Debug, Clone, Copy, Default)]
struct Outcome {
    is_named: bool,
    is_doubted: bool,
    /// Largest error of a direction, root of its mean square (degrees).
    error: f64,
    /// Time for which the estimate is consistent and the posture wrong (s).
    believed: f64,
}

fn outcome(seed: u64, fault: Option<&str>, names: &[&str]) -> Outcome {
    let folder = tempfile::tempdir().expect("a folder");
    let turn = usize::try_from(seed).expect("a small number");
    let name = MANEUVERS[turn % MANEUVERS.len()];
    let jump = Jump::new(folder.path(), name, seed, fault);
    let mut found = Outcome {
        is_named: names.iter().any(|name| jump.said.contains(name)),
        is_doubted: jump.is_doubted || !jump.is_imported,
        ..Outcome::default()
    };
    if jump.is_imported {
        let off = jump.off();
        let squares: f64 = off.iter().map(|(_, angle)| angle * angle).sum();
        found.error = (squares / off.len() as f64).sqrt();
        let (_, _, rows) = jump.estimate();
        let times = numbers(&rows, "time_s");
        let interval = times[1] - times[0];
        let believed = times.iter().zip(column(&rows, "consistency"));
        let believed = believed.filter(|(time, state)| {
            let at = off.partition_point(|(own, _)| own <= time).max(1) - 1;
            state == "consistent" && off[at].1 > WRONG
        });
        found.believed = believed.count() as f64 * interval;
    }
    if (!found.is_named && fault.is_some()) || found.believed > AT_MOST {
        println!("{name}, {seed}, {fault:?}: {found:?} {}", jump.said);
    }
    found
}

/// One cell of the table.
#[derive(Debug, Clone, Copy, Default)]
struct Cell {
    flights: usize,
    named: usize,
    /// Not named, and without an effect on the posture.
    harmless: usize,
    /// Estimates that are consistent although the posture is wrong.
    believed: usize,
}

impl Cell {
    fn add(&mut self, found: &Outcome, without: &Outcome) {
        self.flights += 1;
        self.named += usize::from(found.is_named);
        let is_harmless = !found.is_named && found.error < without.error + MATTERS;
        self.harmless += usize::from(is_harmless);
        self.believed += usize::from(found.believed > AT_MOST);
    }

    fn text(&self) -> String {
        format!("{}, {}, {}", self.named, self.harmless, self.believed)
    }

    fn missed(&self) -> usize {
        self.flights - self.named - self.harmless
    }
}

#[test]
#[ignore = "takes half an hour of processor time; run it after a change of what finds faults"]
fn the_table_of_faults() {
    let number = |name: &str, usual: u64| {
        let given = std::env::var(name).ok();
        given.map_or(usual, |given| given.parse().expect("a number"))
    };
    // One fault alone, as `synth` calls it.
    let only = std::env::var("BODYFLIGHT_SUIT_FAULT").ok();
    let is_asked = |fault: &str| only.as_ref().is_none_or(|only| only == fault);
    let first = number("BODYFLIGHT_SUIT_FIRST", 5100);
    let seeds: Vec<u64> = (first..first + number("BODYFLIGHT_SUIT_FLIGHTS", 20)).collect();
    let table = Mutex::new([[Cell::default(); PLACES.len()]; FAULTS.len()]);
    let without = Mutex::new((0, Cell::default()));
    let next = Mutex::new(seeds.iter().zip(0_usize..));
    std::thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(|| {
                loop {
                    let Some((seed, turn)) = next.lock().expect("no panic").next() else {
                        return;
                    };
                    let good = outcome(*seed, None, &[]);
                    {
                        let mut without = without.lock().expect("no panic");
                        without.0 += usize::from(good.is_doubted);
                        without.1.add(&good, &good);
                    }
                    let faults = FAULTS.iter().enumerate();
                    for (row, [fault, _]) in faults.filter(|(_, [fault, _])| is_asked(fault)) {
                        for (place, sensors) in PLACES.iter().enumerate() {
                            let [own, other] = sensors[turn % sensors.len()];
                            let (fault, names) = match *fault {
                                "exchanged" => {
                                    (format!("{own}:exchanged={other}"), vec![own, other])
                                }
                                _ => (format!("{own}:{fault}"), vec![own]),
                            };
                            let found = outcome(*seed, Some(&fault), &names);
                            table.lock().expect("no panic")[row][place].add(&found, &good);
                        }
                    }
                }
            });
        }
    });
    let (accused, good) = without.into_inner().expect("no panic");
    let table = table.into_inner().expect("no panic");
    println!("| fault | trunk | legs | arms |\n|---|---|---|---|");
    for ([_, called], cells) in FAULTS.iter().zip(&table) {
        let cells = cells.map(|cell| cell.text()).join(" | ");
        println!("| {called} | {cells} |");
    }
    println!(
        "no fault: {accused} of {} accused, {} believed",
        good.flights, good.believed
    );
    for ([_, called], cells) in FAULTS.iter().zip(&table) {
        for cell in &cells[..2] {
            assert!(20 * cell.missed() <= cell.flights, "{called}: {cell:?}");
            assert_eq!(cell.believed, 0, "{called}");
        }
    }
}
