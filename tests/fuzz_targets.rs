//! What is fuzzed: one function for each border over which bytes of strangers come.
//!
//! Each takes any bytes and panics where something that must hold does not. `fuzz/` drives them by coverage (nightly), the test
//! `fuzz_corpus` replays the corpora on stable.

mod choices;
mod files;
mod line;
mod network;
mod recording;

/// A target: it must not panic, whatever it is given.
pub type Target = fn(&[u8]);

/// All targets by name; each has a file in `fuzz/fuzz_targets` and a folder in `fuzz/corpus`.
pub const TARGETS: [(&str, Target); 7] = [
    ("mvnx", recording::mvnx),
    ("xbus", line::xbus),
    ("unit", line::unit),
    ("mxtp", network::mxtp),
    ("flysight", files::flysight),
    ("toml", files::toml),
    ("csv", files::csv),
];

/// Runs the target of that name.
///
/// # Panics
/// Where there is none, or where it finds something.
pub fn run(name: &str, bytes: &[u8]) {
    let (_, target) = TARGETS
        .iter()
        .find(|(known, _)| *known == name)
        .expect("a target");
    target(bytes);
}
