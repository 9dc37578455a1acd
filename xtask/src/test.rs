//! `cargo xtask test`: every test of the project, on this machine and for the unit's processor.

use bodyflight_shared_data::{LEFT_OUT, SKIPPED};

use crate::f405::f405;
use crate::first_build::{count_crates, first_build};
use crate::hil::hil;
use crate::on_target::on_target;
use crate::python::python;
use crate::run::{LIBRARIES, Result, cargo, cargo_in, root, say, target_folder};
use crate::supply;
use crate::viewer;

/// Duration of the flight streamed in real time to each kind of unit (s).
const SECONDS_OF_STREAM: u32 = 10;

/// Tests of the program that need, or also try, what the first build leaves out.
const FULL_ONLY: [&str; 4] = ["exports", "live", "outputs", "transcripts"];

/// Runs every test of the project.
pub(crate) fn test() -> Result<()> {
    count_crates()?;
    viewer::check()?;
    supply::list_parts()?;
    with_cargo()?;
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
    // It installs the browser, which an example of the Python package needs too.
    viewer::test()?;
    python()
}

/// The tests that cargo runs. They go on after a failure, so that one run shows all failures, and end with the number of
/// those that were skipped because their data is absent.
fn with_cargo() -> Result<()> {
    let list = target_folder()?.join("skipped-tests.txt");
    let left_out = target_folder()?.join("commands-left-out.txt");
    for old in [&list, &left_out] {
        let _ = std::fs::remove_file(old);
    }
    let variables = [(SKIPPED, &list), (LEFT_OUT, &left_out)]
        .map(|(name, path)| (name, path.display().to_string()));
    let run = |parts: &[&[&str]]| {
        let test = ["test", "--locked", "--no-fail-fast"];
        cargo_in(&root(), &[&test, &parts.concat()[..]].concat(), &variables)
    };
    let libraries = run(&[&LIBRARIES]);
    let light = first_build();
    // End to end with the program that the README's first command builds, and then with everything built in.
    let program: &[&str] = &["--release", "--package", "bodyflight"];
    let first = run(&[program]);
    let rest = FULL_ONLY.map(|name| ["--test", name]).concat();
    // With the schemas' types, from which the test of `schema` makes them again.
    let features = ["--features", "full,schema", "--lib"];
    // The transcripts are those of the light program.
    let known = ["--", "--skip", "transcripts_in_the_documentation"];
    let full = run(&[program, &features, &rest, &known]);
    let skipped = std::fs::read_to_string(&list).unwrap_or_default();
    let count = skipped.lines().count();
    say(&format!(
        "{skipped}{count} tests were skipped because their data is absent"
    ));
    libraries.and(light).and(first).and(full)
}
