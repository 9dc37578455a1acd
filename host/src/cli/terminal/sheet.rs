//! Tables that fit the terminal: cells wrap between words, and columns that are less important are left out.

use std::fmt;

use comfy_table::{
    CellAlignment, ColumnConstraint, ContentArrangement, Table, Width, presets::UTF8_FULL_CONDENSED,
};
use console::{Term, measure_text_width};

/// Width of tables, unless the terminal is wider (columns).
const WIDTH: usize = 80;

/// Cells up to this length are kept in one line, such as a number with its unit.
const GLUED: usize = 16;

/// Stands for a space at which a cell must not be broken, while a table is laid out.
const GLUE: char = '\u{a0}';

/// Least width of a path that is shortened.
const LEAST_PATH: usize = 8;

/// A table in the program's style.
pub(in crate::cli) struct Sheet {
    heads: Vec<String>,
    rows: Vec<Vec<String>>,
    /// First column whose numbers are aligned at the right.
    right_from: usize,
    /// Columns that may be left out, the least important first.
    spare: Vec<usize>,
    /// A column of paths, of which the beginnings may be left out.
    path: Option<usize>,
}

impl Sheet {
    pub(in crate::cli) fn new(heads: &[&str]) -> Self {
        Self {
            heads: heads.iter().map(|head| (*head).to_owned()).collect(),
            rows: Vec::new(),
            right_from: heads.len(),
            spare: Vec::new(),
            path: None,
        }
    }

    /// Aligns columns at the right from this one on.
    pub(in crate::cli) fn right_from(mut self, column: usize) -> Self {
        self.right_from = column;
        self
    }

    /// Says which columns a narrow terminal may do without, the least important first.
    pub(in crate::cli) fn spare(mut self, columns: &[usize]) -> Self {
        self.spare = columns.to_vec();
        self
    }

    /// Says which column has paths.
    pub(in crate::cli) fn path(mut self, column: usize) -> Self {
        self.path = Some(column);
        self
    }

    pub(in crate::cli) fn add_row<T: Into<String>>(&mut self, cells: impl IntoIterator<Item = T>) {
        self.rows.push(cells.into_iter().map(Into::into).collect());
    }

    /// The narrowest and the natural width of a column: its longest word or glued cell, and its longest cell.
    fn widths(&self, column: usize) -> [usize; 2] {
        let words = |text: &str| text.split(' ').map(measure_text_width).max().unwrap_or(0);
        let cells = || self.rows.iter().filter_map(|row| row.get(column));
        let least = cells().map(|cell| match measure_text_width(cell) {
            width if width <= GLUED => width,
            _ => words(cell),
        });
        let natural = cells().map(|cell| measure_text_width(cell));
        let head = self.heads.get(column).map_or("", String::as_str);
        let least = match self.path {
            Some(path) if path == column => LEAST_PATH,
            _ => least.max().unwrap_or(0),
        };
        [
            least.max(words(head)),
            natural.max().unwrap_or(0).max(measure_text_width(head)),
        ]
    }

    /// The columns that are shown in this width, and how wide each is.
    fn shown(&self, width: usize) -> Vec<(usize, usize)> {
        let widths: Vec<[usize; 2]> = (0..self.heads.len()).map(|k| self.widths(k)).collect();
        let mut columns: Vec<usize> = (0..self.heads.len()).collect();
        // A cell has a space on both sides, and a frame.
        let needed =
            |columns: &[usize]| columns.iter().map(|k| widths[*k][0] + 3).sum::<usize>() + 1;
        for spare in &self.spare {
            if needed(&columns) > width {
                columns.retain(|k| k != spare);
            }
        }
        let mut room = width.saturating_sub(needed(&columns));
        // Those that lack least are served first.
        let mut order = columns.clone();
        order.sort_by_key(|k| widths[*k][1] - widths[*k][0]);
        let mut given: Vec<usize> = widths.iter().map(|[least, _]| *least).collect();
        for (place, k) in order.iter().enumerate() {
            let share = room / (order.len() - place);
            let lacking = widths[*k][1] - widths[*k][0];
            given[*k] += lacking.min(share);
            room -= lacking.min(share);
        }
        columns.into_iter().map(|k| (k, given[k])).collect()
    }

    /// The table in at most this width, as far as that is possible.
    fn laid_out(&self, width: usize) -> String {
        let shown = self.shown(width);
        let cell = |k: usize, wide: usize, text: &str| {
            if self.path == Some(k) {
                shortened(text, wide).replace(' ', &GLUE.to_string())
            } else if measure_text_width(text) <= GLUED {
                text.replace(' ', &GLUE.to_string())
            } else {
                text.to_owned()
            }
        };
        let mut table = Table::new();
        table.load_style(UTF8_FULL_CONDENSED);
        table.set_header(shown.iter().map(|(k, _)| self.heads[*k].as_str()));
        for row in &self.rows {
            let cells = shown
                .iter()
                .map(|(k, wide)| cell(*k, *wide, row.get(*k).map_or("", String::as_str)));
            table.add_row(cells.collect::<Vec<_>>());
        }
        table.set_content_arrangement(ContentArrangement::Dynamic);
        table.set_width(u16::try_from(width).unwrap_or(u16::MAX));
        for (column, (k, wide)) in table.column_iter_mut().zip(&shown) {
            let wide = u16::try_from(wide + 2).unwrap_or(u16::MAX);
            column.set_constraint(ColumnConstraint::Absolute(Width::Fixed(wide)));
            if *k >= self.right_from {
                column.set_cell_alignment(CellAlignment::Right);
            }
        }
        let mut text = table.to_string().replace(GLUE, " ");
        let is_left_out = |k: &&usize| shown.iter().all(|(column, _)| column != *k);
        let left_out = self.spare.iter().filter(is_left_out);
        let left_out: Vec<&str> = left_out.map(|k| self.heads[*k].as_str()).collect();
        if !left_out.is_empty() {
            text += &format!(
                "\nleft out to fit: {} (--json has all)",
                left_out.join(", ")
            );
        }
        text
    }
}

/// The end of a path, in this many columns.
fn shortened(path: &str, width: usize) -> String {
    let count = path.chars().count();
    if count <= width {
        return path.to_owned();
    }
    let end: String = path
        .chars()
        .skip((count + 1).saturating_sub(width))
        .collect();
    format!("…{end}")
}

impl fmt::Display for Sheet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let terminal = Term::stdout().size_checked();
        let columns = terminal.map_or(WIDTH, |(_, columns)| usize::from(columns).max(WIDTH));
        f.write_str(&self.laid_out(columns))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn widest(text: &str) -> usize {
        text.lines().map(measure_text_width).max().unwrap()
    }

    fn jumps() -> Sheet {
        let heads = ["track", "UTC", "exit", "mean", "normalised", "verdict"];
        let mut sheet = Sheet::new(&heads).spare(&[4, 3]).path(0);
        sheet.add_row([
            "card/2021-07-07/speed skydiving 411.csv",
            "2021-07-07 13:30:39",
            "4495 m",
            "85.5 m/s",
            "111.8 m/s",
            "explained",
        ]);
        sheet
    }

    #[test]
    fn a_narrow_terminal_loses_columns_and_beginnings_of_paths() {
        let wide = jumps().laid_out(200);
        assert!(
            wide.contains("card/2021-07-07/speed skydiving 411.csv") && !wide.contains("left out")
        );
        for width in [80, 70, 50] {
            let narrow = jumps().laid_out(width);
            assert!(widest(&narrow) <= width, "{width}:\n{narrow}");
            assert!(
                narrow.contains("4495 m") && narrow.contains("explained"),
                "{narrow}"
            );
            assert!(narrow.contains("1.csv"), "{narrow}");
        }
        let narrow = jumps().laid_out(50);
        assert!(
            narrow.contains("left out to fit: normalised, mean"),
            "{narrow}"
        );
    }

    #[test]
    fn words_and_short_cells_are_never_torn() {
        let gaps = {
            let mut gaps = Sheet::new(&["channel", "unit", "estimated", "free run", "amplitude"]);
            gaps.add_row(["horizontal velocity", "m/s", "0.098", "0.103", "0.818"]);
            gaps
        };
        // Exactly as wide as it is by nature.
        assert!(gaps.laid_out(65).contains("│ horizontal velocity ┆ m/s  ┆"));
        assert_eq!(widest(&gaps.laid_out(80)), 65);
        let mut sheet = Sheet::new(&["channel", "horizontal velocity", "measures"]).right_from(1);
        sheet.add_row([
            "horizontal velocity",
            "+12.25 m/s",
            "specific_force_pitch_mps2 heading_rad",
        ]);
        let text = sheet.laid_out(40);
        for word in ["+12.25 m/s", "specific_force_pitch_mps2", "heading_rad"] {
            assert!(text.contains(word), "{word} is torn:\n{text}");
        }
    }
}
