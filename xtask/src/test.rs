//! `cargo xtask test`: every test of the project, on this machine and for the unit's processor.

use crate::f405::f405;
use crate::hil::hil;
use crate::on_target::on_target;
use crate::python::python;
use crate::run::{Result, cargo};
use crate::viewer;

/// Duration of the flight streamed in real time to each kind of unit (s).
const SECONDS_OF_STREAM: u32 = 10;

/// Runs every test of the project.
pub(crate) fn test() -> Result<()> {
    // The page comes first, since the program includes it.
    viewer::build()?;
    // Tests go on after a failure, so that one run shows all failures.
    cargo(&["test", "--workspace", "--locked", "--no-fail-fast"])?;
    // Features of the core that nothing in the workspace enables.
    let features = ["--package", "bodyflight-core", "--features", "serde,defmt"];
    cargo(
        &[
            &["test", "--locked", "--lib"],
            &features[..],
            &["serialization"],
        ]
        .concat(),
    )?;
    on_target()?;
    f405(false)?;
    hil(SECONDS_OF_STREAM)?;
    python()?;
    viewer::test()
}
