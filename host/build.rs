//! Includes the viewer's page if `cargo xtask viewer` has built it.

use std::io;
use std::path::PathBuf;

fn main() -> io::Result<()> {
    // Watch the folder: a watched file that does not exist would cause a rebuild every time.
    println!("cargo:rerun-if-changed=viewer/dist");
    let page = std::fs::read("viewer/dist/viewer.html").unwrap_or_default();
    let folder = std::env::var_os("OUT_DIR").ok_or_else(|| io::Error::other("no OUT_DIR"))?;
    std::fs::write(PathBuf::from(folder).join("viewer.html"), page)
}
