//! `cargo xtask test`.

use crate::on_target::on_target;
use crate::run::{Result, cargo};

/// Every test of the project.
pub(crate) fn test() -> Result<()> {
    cargo(&["test", "--workspace", "--locked"])?;
    on_target()
}
