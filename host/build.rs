//! Takes the viewer's page in, where `cargo xtask viewer` has built it.

use std::io;
use std::path::PathBuf;

fn main() -> io::Result<()> {
    // The folder: watching a file that is not there would build the crate anew every time.
    println!("cargo:rerun-if-changed=viewer/dist");
    let page = std::fs::read("viewer/dist/viewer.html").unwrap_or_default();
    let folder = std::env::var_os("OUT_DIR").ok_or_else(|| io::Error::other("no OUT_DIR"))?;
    std::fs::write(PathBuf::from(folder).join("viewer.html"), page)
}
