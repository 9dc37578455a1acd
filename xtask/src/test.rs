//! `cargo xtask test`.

use crate::hil::hil;
use crate::on_target::on_target;
use crate::run::{Result, cargo};

/// Flight streamed in real time, to each kind of unit (s).
const SECONDS_OF_STREAM: u32 = 10;

/// Every test of the project.
pub(crate) fn test() -> Result<()> {
    cargo(&["test", "--workspace", "--locked"])?;
    on_target()?;
    hil(SECONDS_OF_STREAM)
}
