//! Compact series of numbers: rounded to an invisible step, delta-coded, variable-length, gzip, base64.

use std::io::Write;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::write::GzEncoder;
use serde::Serialize;

/// Rows per second of flight; the page interpolates linearly between them.
pub const RATE: f64 = 30.0;

/// A column of the series.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Column {
    /// Name.
    pub name: String,
    /// Count of numbers in a row.
    pub width: usize,
    /// Numbers are multiples of this.
    pub step: f64,
}

/// Columns over time, in the page's format.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Packed {
    /// The columns, in order.
    pub columns: Vec<Column>,
    /// Number of rows.
    pub rows: usize,
    /// For each number of each column, rounded to its step, the difference from the previous row: zigzag, seven bits
    /// per byte, low bits first; then gzip, then base64.
    pub data: String,
}

/// A series under construction.
#[derive(Debug, Clone, Default)]
pub struct Series {
    columns: Vec<Column>,
    numbers: Vec<Vec<f64>>,
    rows: usize,
}

/// Columns, given as name, count of numbers in a row, and step.
fn named(columns: &[(&str, usize, f64)]) -> Vec<Column> {
    let columns = columns.iter().map(|&(name, width, step)| Column {
        name: name.to_owned(),
        width,
        step,
    });
    columns.collect()
}

/// The step of each number in a row.
fn steps(columns: &[Column]) -> impl Iterator<Item = f64> {
    let columns = columns.iter();
    columns.flat_map(|column| std::iter::repeat_n(column.step, column.width))
}

impl Series {
    /// Creates a series of columns, given as name, count of numbers in a row, and step.
    pub fn new(columns: &[(&str, usize, f64)]) -> Self {
        let columns = named(columns);
        Self {
            numbers: vec![Vec::new(); steps(&columns).count()],
            columns,
            rows: 0,
        }
    }

    /// Adds a row, the numbers of all columns one after another. Numbers that are missing or not finite repeat the
    /// previous row.
    pub fn push(&mut self, row: impl IntoIterator<Item = f64>) {
        let mut row = row.into_iter();
        for numbers in &mut self.numbers {
            let before = numbers.last().copied().unwrap_or(0.0);
            let number = row.next().filter(|number| number.is_finite());
            numbers.push(number.unwrap_or(before));
        }
        self.rows += 1;
    }

    /// Number of rows.
    pub const fn rows(&self) -> usize {
        self.rows
    }

    /// The rows whose time is from `from` to `to` (s), by the column `time_s`.
    #[must_use]
    pub fn between(&self, from: f64, to: f64) -> Self {
        let kept: Vec<usize> = match self.column("time_s") {
            [times] => (0..self.rows)
                .filter(|&row| {
                    times
                        .get(row)
                        .is_some_and(|time| (from..=to).contains(time))
                })
                .collect(),
            _ => Vec::new(),
        };
        let of = |numbers: &Vec<f64>| {
            kept.iter()
                .filter_map(|&row| numbers.get(row))
                .copied()
                .collect()
        };
        Self {
            columns: self.columns.clone(),
            numbers: self.numbers.iter().map(of).collect(),
            rows: kept.len(),
        }
    }

    /// The numbers of a column, one list for each; empty if there is no such column.
    pub fn column(&self, name: &str) -> &[Vec<f64>] {
        let mut from = 0;
        for column in &self.columns {
            if column.name == name {
                return self.numbers.get(from..from + column.width).unwrap_or(&[]);
            }
            from += column.width;
        }
        &[]
    }

    /// Compresses the series.
    pub fn packed(&self) -> Packed {
        let numbers = self.numbers.iter().zip(steps(&self.columns));
        let encoded = numbers.map(|(numbers, step)| {
            let mut encoded = Encoded::new(step);
            numbers.iter().for_each(|number| encoded.push(*number));
            encoded
        });
        packed(self.columns.clone(), self.rows, encoded)
    }
}

/// A series that is only written: each number takes one or two bytes from the beginning.
#[derive(Debug, Clone)]
pub struct Recorded {
    columns: Vec<Column>,
    numbers: Vec<Encoded>,
    rows: usize,
}

impl Recorded {
    /// Same as [`Series::new`].
    pub fn new(columns: &[(&str, usize, f64)]) -> Self {
        let columns = named(columns);
        Self {
            numbers: steps(&columns).map(Encoded::new).collect(),
            columns,
            rows: 0,
        }
    }

    /// Same as [`Series::push`].
    pub fn push(&mut self, row: impl IntoIterator<Item = f64>) {
        let mut row = row.into_iter();
        for numbers in &mut self.numbers {
            let number = row.next().filter(|number| number.is_finite());
            numbers.push(number.unwrap_or(numbers.last));
        }
        self.rows += 1;
    }

    /// Compresses the series.
    pub fn packed(self) -> Packed {
        packed(self.columns, self.rows, self.numbers.into_iter())
    }
}

/// Numbers of a column as they are written, before compression.
#[derive(Debug, Clone)]
struct Encoded {
    step: f64,
    last: f64,
    /// The last number in steps.
    before: i32,
    bytes: Vec<u8>,
}

impl Encoded {
    const fn new(step: f64) -> Self {
        Self {
            step,
            last: 0.0,
            before: 0,
            bytes: Vec::new(),
        }
    }

    fn push(&mut self, number: f64) {
        #[expect(
            clippy::cast_possible_truncation,
            reason = "saturates: a number so large is off every axis"
        )]
        let now = (number / self.step).round() as i32;
        write_variable(&mut self.bytes, now.wrapping_sub(self.before));
        (self.last, self.before) = (number, now);
    }
}

fn packed(columns: Vec<Column>, rows: usize, numbers: impl Iterator<Item = Encoded>) -> Packed {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
    for numbers in numbers {
        // Writing to memory cannot fail.
        let _ = encoder.write_all(&numbers.bytes);
    }
    Packed {
        columns,
        rows,
        data: STANDARD.encode(encoder.finish().unwrap_or_default()),
    }
}

fn write_variable(bytes: &mut Vec<u8>, difference: i32) {
    let mut rest = (difference.cast_unsigned() << 1) ^ (difference >> 31).cast_unsigned();
    while rest >= 0x80 {
        bytes.push((rest & 0x7f) as u8 | 0x80);
        rest >>= 7;
    }
    bytes.push((rest & 0x7f) as u8);
}

#[cfg(test)]
mod tests {
    use super::*;
    use flate2::read::GzDecoder;
    use proptest::prelude::*;
    use std::io::Read;

    #[test]
    fn rows_between_two_times_are_kept() {
        let mut series = Series::new(&[("time_s", 1, 0.1), ("x", 2, 0.1)]);
        for row in 0..5 {
            series.push([f64::from(row), 1.0, f64::from(10 * row)]);
        }
        let kept = series.between(1.0, 2.5);
        assert_eq!(kept.rows(), 2);
        assert_eq!(kept.column("x")[1], [10.0, 20.0]);
        assert_eq!(series.between(9.0, 10.0).rows(), 0);
    }

    /// Decodes the series as the page does.
    fn unpacked(packed: &Packed) -> Vec<Vec<f64>> {
        let zipped = STANDARD.decode(&packed.data).unwrap();
        let mut bytes = Vec::new();
        GzDecoder::new(&zipped[..]).read_to_end(&mut bytes).unwrap();
        let mut bytes = bytes.into_iter();
        let mut next = || {
            let (mut value, mut shift) = (0u32, 0);
            loop {
                let byte = bytes.next().unwrap();
                value |= u32::from(byte & 0x7f) << shift;
                shift += 7;
                if byte < 0x80 {
                    return (value >> 1).cast_signed() ^ -(value & 1).cast_signed();
                }
            }
        };
        let steps = packed
            .columns
            .iter()
            .flat_map(|column| std::iter::repeat_n(column.step, column.width));
        steps
            .map(|step| {
                let mut sum = 0i32;
                let mut number = || {
                    sum = sum.wrapping_add(next());
                    f64::from(sum) * step
                };
                (0..packed.rows).map(|_| number()).collect()
            })
            .collect()
    }

    proptest! {
        #[test]
        fn numbers_are_restored_to_half_a_step(
            rows in prop::collection::vec(prop::array::uniform3(-1e4f64..1e4), 0..40),
        ) {
            let columns = [("a", 1, 0.01), ("b", 2, 0.5)];
            let (mut series, mut recorded) = (Series::new(&columns), Recorded::new(&columns));
            for row in &rows {
                series.push(*row);
                recorded.push(*row);
            }
            prop_assert_eq!(series.packed().data, recorded.packed().data);
            let back = unpacked(&series.packed());
            for (k, row) in rows.iter().enumerate() {
                for (column, number) in row.iter().enumerate() {
                    let step = if column == 0 { 0.01 } else { 0.5 };
                    prop_assert!((back[column][k] - number).abs() <= 0.5001 * step);
                }
            }
        }
    }

    #[test]
    fn numbers_that_are_not_finite_repeat_the_previous_row() {
        let mut series = Series::new(&[("a", 2, 1.0)]);
        series.push([1.0, f64::NAN]);
        series.push([f64::INFINITY, 3.0]);
        series.push([4.0]);
        let mut recorded = Recorded::new(&[("a", 2, 1.0)]);
        for row in [&[1.0, f64::NAN][..], &[f64::INFINITY, 3.0], &[4.0]] {
            recorded.push(row.iter().copied());
        }
        assert_eq!(series.packed().data, recorded.packed().data);
        assert_eq!(
            unpacked(&series.packed()),
            [[1.0, 1.0, 4.0], [0.0, 3.0, 3.0]]
        );
    }
}
