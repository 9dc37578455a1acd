//! Where the tests find recordings, reference numbers and flights that are not part of the repository: in the folder
//! `shared` beside the checkout, or in the one that `BODYFLIGHT_SHARED` names.
//!
//! A test without its data is skipped: it says so, and is counted by `cargo xtask test`. Where `CI` is set, it fails.

use std::io::Write;
use std::path::{Path, PathBuf};

/// Environment variable with the file that lists skipped tests, one line each.
pub const SKIPPED: &str = "BODYFLIGHT_SKIPPED";

/// Environment variable with the file that lists the documented commands which need a part that the light program was
/// built without. The tests of the light program write it, and those of the full program then try only these again.
pub const LEFT_OUT: &str = "BODYFLIGHT_LEFT_OUT";

/// A file or folder of the shared data; `None`, with a notice, if it is absent.
///
/// # Panics
/// Panics if it is absent and the environment variable `CI` is set: there, no test may be skipped.
pub fn shared(name: &str) -> Option<PathBuf> {
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared");
    let folder = std::env::var_os("BODYFLIGHT_SHARED").map_or_else(beside, PathBuf::from);
    let path = folder.join(name);
    if path.exists() {
        return Some(path);
    }
    skipped(&format!("{} is absent", path.display()));
    None
}

/// Says that a test is skipped, and why.
///
/// # Panics
/// Panics if the environment variable `CI` is set.
pub fn skipped(why: &str) {
    assert!(
        std::env::var_os("CI").is_none(),
        "{why}, and tests in CI may not be skipped"
    );
    let thread = std::thread::current();
    let test = thread.name().unwrap_or("a test");
    eprintln!("skipped: {test}: {why}");
    // The list only serves to count: a test does not fail for it.
    let _ = listed(SKIPPED, &format!("{test}: {why}"));
}

/// Appends a line to the list that an environment variable names, if it is set.
///
/// # Errors
/// Returns an error if the list cannot be written.
pub fn listed(variable: &str, line: &str) -> std::io::Result<()> {
    let Some(list) = std::env::var_os(variable) else {
        return Ok(());
    };
    let mut list = std::fs::File::options()
        .append(true)
        .create(true)
        .open(list)?;
    writeln!(list, "{line}")
}
