//! Slips of markers planted in recordings of points: which are named, and what is named without any.
#![expect(clippy::expect_used, reason = "tests may panic: that is how they fail")]

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};

use bodyflight_mocap::mapping::{Kind, Mapping, Point};
use bodyflight_mocap::slip::Slip;
use bodyflight_mocap::source::Source;
use nalgebra::Vector3;
use serde::Deserialize;

/// A table of points as text, so that a slip can be written into it: TRC, or CSV with columns `point.x`.
struct Written {
    head: Vec<String>,
    rows: Vec<Vec<String>>,
    separator: char,
    /// First of three columns of each point.
    columns: BTreeMap<String, usize>,
    time: usize,
    unit_m: f64,
}

impl Written {
    fn read(path: &Path) -> Self {
        let text = std::fs::read_to_string(path).expect("a table");
        let is_trc = text.starts_with("PathFileType");
        let (separator, names_at, begin) = if is_trc { ('\t', 3, 5) } else { (',', 0, 1) };
        let lines: Vec<&str> = text.lines().collect();
        let cells = |line: &str| -> Vec<String> {
            let cells = line.split(separator).map(str::trim);
            cells.map(str::to_owned).collect()
        };
        let names = cells(lines[names_at]);
        let mut columns = BTreeMap::new();
        for (k, name) in names
            .iter()
            .enumerate()
            .filter(|(_, name)| !name.is_empty())
        {
            if is_trc {
                columns.insert(name.clone(), k);
            } else if let Some(name) = name.strip_suffix(".x") {
                columns.insert(name.to_owned(), k);
            }
        }
        let rows = lines[begin..].iter().filter(|line| !line.trim().is_empty());
        Self {
            head: lines[..begin]
                .iter()
                .map(|line| (*line).to_owned())
                .collect(),
            rows: rows.map(|line| cells(line)).collect(),
            separator,
            columns,
            time: usize::from(is_trc),
            unit_m: if is_trc && lines[2].contains("mm") {
                1e-3
            } else {
                1.0
            },
        }
    }

    fn time(&self, row: usize) -> f64 {
        self.rows[row][self.time].parse().expect("a time")
    }

    fn place(&self, row: usize, point: &str) -> Option<Vector3<f64>> {
        let at = *self.columns.get(point)?;
        let part = |axis: usize| self.rows[row].get(at + axis)?.parse::<f64>().ok();
        Some(Vector3::new(part(0)?, part(1)?, part(2)?) * self.unit_m)
    }

    fn middle(&self, row: usize, points: &Point) -> Option<Vector3<f64>> {
        let mut sum = Vector3::zeros();
        for point in points.names() {
            sum += self.place(row, point)?;
        }
        Some(sum / points.names().len() as f64)
    }

    /// Moves a point along its segment by a size (m), from a time on and within a duration (s).
    fn slip(&mut self, planted: &Planted, mapping: &Mapping) {
        let row_of = &mapping.segments[&planted.segment];
        let (Some(from), Some(to)) = (&row_of.from, &row_of.to) else {
            return;
        };
        for row in 0..self.rows.len() {
            let since = self.time(row) - planted.begin;
            let share = if planted.duration > 0.0 {
                (since / planted.duration).clamp(0.0, 1.0)
            } else {
                f64::from(u8::from(since >= 0.0))
            };
            let along = self.middle(row, to).zip(self.middle(row, from));
            let (Some((to, from)), Some(place)) = (along, self.place(row, &planted.point)) else {
                continue;
            };
            let moved = (place + (to - from).normalize() * (planted.size * share)) / self.unit_m;
            let at = self.columns[&planted.point];
            for axis in 0..3 {
                self.rows[row][at + axis] = format!("{:.6}", moved[axis]);
            }
        }
    }

    fn write(&self, path: &Path) {
        let mut text = self.head.join("\n");
        for row in &self.rows {
            let _ = write!(text, "\n{}", row.join(&self.separator.to_string()));
        }
        std::fs::write(path, text).expect("written");
    }
}

#[derive(Debug)]
struct Planted {
    segment: String,
    point: String,
    begin: f64,
    duration: f64,
    size: f64,
}

fn slips(path: &Path, mapping: &Mapping) -> Vec<Slip> {
    Source::open(path, Some(mapping)).expect("a source").slips
}

/// Numbers from 0 to 1, the same in each run.
struct Chance(u64);

impl Chance {
    fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn of<'a, T>(&mut self, all: &'a [T]) -> &'a T {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "an index"
        )]
        let at = (self.next() * all.len() as f64) as usize;
        &all[at.min(all.len() - 1)]
    }
}

/// A slip of a limb's marker, at a time with half a second and an eighth of the recording on both sides.
fn planted(chance: &mut Chance, table: &Written, mapping: &Mapping, size: f64) -> Planted {
    let limbs = mapping
        .segments
        .iter()
        .filter(|(name, _)| name.starts_with("l_") || name.starts_with("r_"));
    let all: Vec<(&String, &String)> = limbs
        .filter(|(name, _)| !name.ends_with("hand"))
        .flat_map(|(name, row)| {
            let ends = row.from.iter().chain(&row.to).flat_map(Point::names);
            ends.map(move |point| (name, point))
        })
        .collect();
    let (segment, point) = *chance.of(&all);
    let (first, last) = (table.time(0), table.time(table.rows.len() - 1));
    let around = (0.6_f64)
        .max((last - first) / 8.0)
        .min(0.45 * (last - first));
    let room = last - first - 2.0 * around;
    let durations: Vec<f64> = [0.0, 0.2, 0.5, 1.0, 2.0]
        .into_iter()
        .filter(|d| *d <= room)
        .collect();
    let duration = *chance.of(&durations);
    Planted {
        segment: segment.clone(),
        point: point.clone(),
        begin: first + around + (room - duration) * chance.next(),
        duration,
        size: if chance.next() < 0.5 { size } else { -size },
    }
}

/// Public captures of points, in a table as `validate` reads it.
#[derive(Deserialize)]
struct Captures {
    captures: Vec<Capture>,
}

#[derive(Deserialize)]
struct Capture {
    source: String,
    file: PathBuf,
    mapping: Option<PathBuf>,
}

/// The figures of docs/import.md. `BODYFLIGHT_CAPTURES` names the table of captures, `BODYFLIGHT_SLIP_M` the size (m).
#[test]
#[ignore = "measures public captures that are not part of the repository"]
fn slips_planted_in_public_captures() {
    let path = std::env::var_os("BODYFLIGHT_CAPTURES")
        .map(PathBuf::from)
        .expect("BODYFLIGHT_CAPTURES");
    let size =
        std::env::var("BODYFLIGHT_SLIP_M").map_or(0.05, |size| size.parse().expect("a number"));
    let text = std::fs::read_to_string(&path).expect("a table");
    let table: Captures = toml::from_str(&text).expect("a table");
    let folder = tempfile::tempdir().expect("a folder");
    let mut chance = Chance(1);
    let mut counts: BTreeMap<String, [usize; 6]> = BTreeMap::new();
    for capture in &table.captures {
        let file = path.with_file_name("").join(&capture.file);
        let Some(mapping) = &capture.mapping else {
            continue;
        };
        let mapping = Mapping::read(&path.with_file_name("").join(mapping)).expect("a mapping");
        let is_text = file
            .extension()
            .is_some_and(|end| end == "trc" || end == "csv");
        if mapping.kind != Kind::Points || !is_text {
            continue;
        }
        let count = counts.entry(capture.source.clone()).or_default();
        count[0] += 1;
        let clean = slips(&file, &mapping);
        for slip in &clean {
            println!("clean: {}: {slip}", capture.file.display());
        }
        count[1] += usize::from(!clean.is_empty());
        for _ in 0..5 {
            let mut table = Written::read(&file);
            let fault = planted(&mut chance, &table, &mapping, size);
            table.slip(&fault, &mapping);
            let changed = folder.path().join(file.file_name().expect("a name"));
            table.write(&changed);
            let known = |slip: &&Slip| !clean.iter().any(|clean| clean.markers == slip.markers);
            let found = slips(&changed, &mapping);
            let named: Vec<&Slip> = found.iter().filter(known).collect();
            let middle = fault.begin + 0.5 * fault.duration;
            let is_it = |slip: &&&Slip| {
                let off = slip.begin_s + 0.5 * slip.duration_s - middle;
                slip.markers.contains(&fault.point) && off.abs() < 0.5_f64.max(0.5 * fault.duration)
            };
            let right = named.iter().find(is_it);
            count[2] += 1;
            count[3] += usize::from(right.is_some());
            count[4] += usize::from(right.is_some_and(|slip| slip.markers.len() == 1));
            count[5] += named.len() - usize::from(right.is_some());
            println!("{}: {fault:?}", capture.file.display());
            for slip in named {
                println!("    {slip}");
            }
        }
    }
    for (source, [captures, blamed, planted, found, alone, wrong]) in counts {
        println!(
            "{source}: {captures} captures, {blamed} with a slip as they are; of {planted} planted slips of {size} m {found} found, \
             {alone} with a single marker, {wrong} others named"
        );
    }
}
