//! Live streams through the real binary, over the network and pseudo-terminals of this machine.
#![expect(
    clippy::expect_used,
    clippy::panic,
    reason = "tests may panic: that is how they fail"
)]

#[path = "live/monitor.rs"]
mod monitor;
#[path = "live/network.rs"]
mod network;
#[path = "live/slimevr.rs"]
mod slimevr;

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

const BINARY: &str = env!("CARGO_BIN_EXE_bodyflight");

fn bodyflight(arguments: &[&str]) -> Output {
    Command::new(BINARY)
        .args(arguments)
        .stdin(Stdio::null())
        .output()
        .expect("the binary starts")
}

fn fails(arguments: &[&str], code: i32) -> String {
    let output = bodyflight(arguments);
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {message}");
    assert!(!message.contains("panicked"), "{message}");
    let words = message.split_whitespace().filter(|word| *word != "│");
    words.collect::<Vec<_>>().join(" ")
}

fn plain(path: &Path) -> &str {
    path.to_str().expect("a plain path")
}

/// A file of the shared data, or `None` with a visible notice if it is absent.
fn shared(name: &str) -> Option<PathBuf> {
    bodyflight_shared_data::shared(&format!("data/{name}"))
}
