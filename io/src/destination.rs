//! Checks on output paths: an output never replaces an input or a device, and replaces an existing file only with
//! `force`.

use std::io;
use std::path::{Path, PathBuf};

use crate::diagnostic::{Problem, Result};
use crate::input;

/// Symbolic links followed before a cycle is assumed; the same limit as the system's.
const MOST_LINKS: usize = 40;

/// The file that `path` refers to after following symbolic links: writing there keeps the link.
///
/// # Errors
/// Returns an error if the path is a folder, a device or a pipe, if its parent folder does not exist, or if it is a
/// file that this process reads.
pub fn destination(path: &Path) -> Result<PathBuf> {
    let refused = |error: io::Error| Problem::system("create", path, error);
    let place = linked(path).map_err(refused)?;
    match std::fs::metadata(&place) {
        Ok(data) if data.is_dir() => return Err(refused(io::ErrorKind::IsADirectory.into())),
        Ok(data) if !data.is_file() => {
            return Err(
                Problem::bad_input("expected a file, found a device or a pipe")
                    .in_file(path)
                    .help("give a file; --json writes results to standard output"),
            );
        }
        Ok(_) if input::is_claimed(&place) => {
            return Err(
                Problem::bad_input("this is an input, and would be overwritten")
                    .in_file(path)
                    .help("give another name to the output"),
            );
        }
        Ok(_) => {}
        Err(error) if error.kind() == io::ErrorKind::NotFound => {}
        Err(error) => return Err(refused(error)),
    }
    Ok(place)
}

/// Checks before long work that its outputs can be written, and that each is either new or may be replaced because of
/// `force`.
///
/// # Errors
/// Returns an error for the reasons given at [`destination`], if the folder of an output does not exist or cannot be
/// written to, or if a file exists and `force` was not given.
pub fn check<P: AsRef<Path>>(paths: impl IntoIterator<Item = P>, force: bool) -> Result<()> {
    for path in paths {
        let path = path.as_ref();
        let place = destination(path)?;
        if !force && place.exists() {
            return Err(Problem::bad_input("this file exists")
                .in_file(path)
                .help("pass --force to replace it, or give another name"));
        }
        can_hold(folder_of(&place)).map_err(|error| Problem::system("create", path, error))?;
    }
    Ok(())
}

/// The ending of a file's name, one of `known`, in lower case.
///
/// # Errors
/// Returns an error that lists the endings known, since what is in the file would not be what its name says.
pub fn ending<'a>(path: &Path, known: &[&'a str], what: &str) -> Result<&'a str> {
    let end = path.extension().unwrap_or_default().to_string_lossy();
    let is = |one: &&&str| one.eq_ignore_ascii_case(&end);
    known.iter().find(is).copied().ok_or_else(|| {
        let found = if end.is_empty() {
            "no extension".to_owned()
        } else {
            format!(".{end}")
        };
        let dotted: Vec<String> = known.iter().map(|end| format!(".{end}")).collect();
        let listed = match dotted.split_last() {
            Some((last, [])) => last.clone(),
            Some((last, before)) => format!("{} or {last}", before.join(", ")),
            None => String::new(),
        };
        Problem::bad_input(format!(
            "expected {what} whose name ends in {listed}, found {found}"
        ))
        .in_file(path)
    })
}

/// Like [`check`], for files with these names in a folder that is created later if it does not exist.
///
/// # Errors
/// Returns an error for the reasons given at [`check`], or if the folder cannot be created.
pub fn check_in(folder: &Path, names: &[&str], force: bool) -> Result<()> {
    if folder.exists() {
        return check(names.iter().map(|name| folder.join(name)), force);
    }
    let is_there = folder.ancestors().map(named).find(|above| above.exists());
    can_hold(is_there.unwrap_or(Path::new(".")))
        .map_err(|error| Problem::system("create", folder, error))
}

/// Tests whether files can be created in a folder.
fn can_hold(folder: &Path) -> io::Result<()> {
    tempfile::tempfile_in(folder).map(|_| ())
}

/// The folder itself, or the current one if the path is empty.
fn named(folder: &Path) -> &Path {
    if folder.as_os_str().is_empty() {
        Path::new(".")
    } else {
        folder
    }
}

/// The folder that contains a file.
pub(crate) fn folder_of(path: &Path) -> &Path {
    named(path.parent().unwrap_or(Path::new("")))
}

fn linked(path: &Path) -> io::Result<PathBuf> {
    let mut place = path.to_path_buf();
    for _ in 0..MOST_LINKS {
        match std::fs::symlink_metadata(&place) {
            Ok(data) if data.is_symlink() => {
                let target = std::fs::read_link(&place)?;
                place = folder_of(&place).join(target);
            }
            _ => return Ok(place),
        }
    }
    Err(io::Error::other(
        "too many symbolic links, which may lead to one another",
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_exists_is_replaced_only_when_asked() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.csv");
        check([&path], false).unwrap();
        std::fs::write(&path, "old").unwrap();
        let problem = check([&path], false).unwrap_err();
        assert!(problem.help.unwrap().contains("--force"));
        check([&path], true).unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
    }

    #[test]
    fn a_name_ends_as_its_content_is() {
        let known = ["csv", "npz", "mcap"];
        assert_eq!(
            ending(Path::new("a/run.CSV"), &known, "a file").unwrap(),
            "csv"
        );
        for (wrong, found) in [
            ("run", "no extension"),
            ("a.csv/run.xyz", ".xyz"),
            (".csv", "no extension"),
        ] {
            let problem = ending(Path::new(wrong), &known, "a file")
                .unwrap_err()
                .to_string();
            let said = format!("a file whose name ends in .csv, .npz or .mcap, found {found}");
            assert!(problem.ends_with(&said), "{problem}");
        }
    }

    #[test]
    fn inputs_are_never_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("subject.toml");
        std::fs::write(&path, "mass = 80").unwrap();
        input::text(&path).unwrap();
        assert!(check([&path], true).is_err());
        assert!(destination(&folder.path().join("./subject.toml")).is_err());
    }

    #[test]
    fn a_folder_may_exist_or_be_created() {
        let folder = tempfile::tempdir().unwrap();
        check_in(&folder.path().join("a/b"), &["run.csv"], false).unwrap();
        check_in(folder.path(), &["run.csv"], false).unwrap();
        std::fs::write(folder.path().join("run.csv"), "old").unwrap();
        assert!(check_in(folder.path(), &["other", "run.csv"], false).is_err());
        assert!(check_in(&folder.path().join("run.csv"), &["x"], true).is_err());
        assert!(check([folder.path().join("missing/run.csv")], true).is_err());
        assert!(!folder.path().join("a").exists());
    }

    #[cfg(unix)]
    #[test]
    fn links_are_followed_and_cycles_detected() {
        use std::os::unix::fs::symlink;
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        symlink("data/run.csv", at("link")).unwrap();
        assert_eq!(destination(&at("link")).unwrap(), at("data/run.csv"));
        symlink("b", at("a")).unwrap();
        symlink("a", at("b")).unwrap();
        assert!(destination(&at("a")).is_err());
        assert!(destination(Path::new("/dev/null")).is_err());
    }
}
