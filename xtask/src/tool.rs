//! Programs from crates.io, installed in the target folder.

use std::path::PathBuf;

use crate::run::{Result, root, run_in, target_folder};

/// Path of a program of this version, which is installed if it is missing; `options` are those of `cargo install`.
pub(crate) fn tool(
    name: &str,
    version: &str,
    options: &[&str],
    variables: &[(&str, String)],
) -> Result<PathBuf> {
    let folder = target_folder()?.join("tools");
    let program = folder.join("bin").join(name);
    if !program.is_file() {
        let place = folder.display().to_string();
        let install = [
            "install",
            name,
            "--version",
            version,
            "--locked",
            "--root",
            &place,
        ];
        let arguments = [&install[..], options].concat();
        run_in(&root(), "cargo", &arguments, variables).map_err(|error| {
            format!("{error}\nthis task needs {name}; installing it needs a network")
        })?;
    }
    Ok(program)
}
