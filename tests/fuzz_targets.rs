//! Fuzz targets: one function for each interface that receives untrusted bytes.
//!
//! Each accepts any bytes and panics if an invariant is violated. `fuzz/` runs them guided by coverage (nightly); the
//! test `fuzz_corpus` replays the corpora on stable.

mod capture;
mod choices;
mod files;
mod jump;
mod line;
mod memory;
mod network;
mod numbers;
mod recording;

/// A target. It must not panic on any input.
pub type Target = fn(&[u8]);

/// All targets by name; each has a file in `fuzz/fuzz_targets` and a folder in `fuzz/corpus`.
pub const TARGETS: [(&str, Target); 13] = [
    ("mvnx", recording::mvnx),
    ("numbers", numbers::numbers),
    ("xbus", line::xbus),
    ("unit", line::unit),
    ("flash", memory::flash),
    ("setup", memory::setup),
    ("mxtp", network::mxtp),
    ("slimevr", network::slimevr),
    ("flysight", files::flysight),
    ("toml", files::toml),
    ("csv", files::csv),
    ("jump", jump::jump),
    ("capture", capture::capture),
];

/// Runs the target of this name.
///
/// # Panics
/// Panics if there is no such target, or if it finds a fault.
pub fn run(name: &str, bytes: &[u8]) {
    let (_, target) = TARGETS
        .iter()
        .find(|(known, _)| *known == name)
        .expect("a target");
    target(bytes);
}
