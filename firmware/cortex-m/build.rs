//! Sets the build name of images, which is the source revision, or the version if there is none; and detects whether
//! the processor has a stack limit.

use std::process::Command;

fn main() {
    let revision = git(&["rev-parse", "--short=8", "HEAD"]);
    let version = std::env::var("CARGO_PKG_VERSION").map(|version| format!("v{version}"));
    let name = revision.or(version.ok()).unwrap_or_default();
    println!("cargo::rustc-env=BODYFLIGHT_REVISION={name}");
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rustc-check-cfg=cfg(armv8m)");
    if std::env::var("TARGET").is_ok_and(|target| target.starts_with("thumbv8m.main")) {
        println!("cargo::rustc-cfg=armv8m");
    }
    // These change with every commit and every switch of branches.
    for file in ["HEAD", "logs/HEAD"] {
        if let Some(path) = git(&["rev-parse", "--path-format=absolute", "--git-path", file]) {
            println!("cargo::rerun-if-changed={path}");
        }
    }
}

fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").args(arguments).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    output.status.success().then(|| text.trim().to_owned())
}
