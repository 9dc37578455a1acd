//! `budgets.toml`: the budgets of the unit, and of the program's first build.

use std::collections::BTreeMap;

use serde::Deserialize;

use crate::run::{Result, root};

/// The content of the file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Budgets {
    tolerance: f64,
    pub(crate) first_build: FirstBuild,
    board: BTreeMap<String, Board>,
    image: BTreeMap<String, Image>,
    /// Budgets of measured costs, by board and name: instructions and bytes of stack.
    cost: BTreeMap<String, BTreeMap<String, u64>>,
}

/// Budget of the README's first command.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct FirstBuild {
    /// Number of crates.
    pub(crate) crates: usize,
    /// Processor time, as a multiple of that of the core with what it depends on.
    pub(crate) times_the_core: f64,
}

/// Memory of a board.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Board {
    /// Start address of flash, where the vector table must be.
    pub(crate) flash_origin: u64,
    /// Size of the board's RAM (bytes).
    pub(crate) ram_bytes: u64,
}

/// Budget of an image.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Image {
    board: String,
    /// Budget of flash (bytes).
    pub(crate) flash_bytes: u64,
    /// Budget of RAM for static data (bytes).
    pub(crate) static_ram_bytes: u64,
}

impl Budgets {
    /// Reads the file.
    pub(crate) fn read() -> Result<Self> {
        let path = root().join("budgets.toml");
        let text =
            std::fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))?;
        toml::from_str(&text).map_err(|error| format!("budgets.toml: {error}"))
    }

    /// The budget of an image, and its board.
    pub(crate) fn image(&self, name: &str) -> Result<(&Image, &Board)> {
        let image = self
            .image
            .get(name)
            .ok_or_else(|| format!("budgets.toml has no image {name}"))?;
        let board = self
            .board
            .get(&image.board)
            .ok_or_else(|| format!("budgets.toml has no board {}", image.board))?;
        Ok((image, board))
    }

    /// Budgets of the costs measured on a board, by name.
    pub(crate) fn costs(&self, board: &str) -> Result<&BTreeMap<String, u64>> {
        let costs = self.cost.get(board);
        costs.ok_or_else(|| format!("budgets.toml has no costs of {board}"))
    }

    /// Whether a cost is within its budget.
    #[expect(clippy::cast_precision_loss, reason = "counts far below 2^53")]
    pub(crate) fn allows(&self, budget: u64, cost: u64) -> bool {
        cost as f64 <= budget as f64 * (1.0 + self.tolerance)
    }
}
