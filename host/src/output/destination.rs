//! Where an output may lie: never in place of what is read, of a device, or unasked of what is there.

use std::io;
use std::path::{Path, PathBuf};

use crate::diagnostic::{Problem, Result};
use crate::formats::input;

/// Links followed before they are taken for a circle, as the system does.
const MOST_LINKS: usize = 40;

/// The file that `path` names, links followed: written there, the link stays.
///
/// # Errors
/// Returns an error if it is a folder, a device or a pipe, if the folder it is in is not there, or if it is a file that this
/// process reads.
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

/// Checks before long work that its outputs can be written, and that each is new, or may be replaced with `force`.
///
/// # Errors
/// Returns an error as [`destination`] does, if the folder of an output is not there or cannot be written to, or if a file
/// is there and `force` was not given.
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

/// As [`check`], of files of these names in a folder, which is made later where it is not there.
///
/// # Errors
/// Returns an error as [`check`] does, or if the folder cannot be made.
pub fn check_in(folder: &Path, names: &[&str], force: bool) -> Result<()> {
    if folder.exists() {
        return check(names.iter().map(|name| folder.join(name)), force);
    }
    let is_there = folder.ancestors().map(named).find(|above| above.exists());
    can_hold(is_there.unwrap_or(Path::new(".")))
        .map_err(|error| Problem::system("create", folder, error))
}

/// Tries whether files can be made in a folder.
fn can_hold(folder: &Path) -> io::Result<()> {
    tempfile::tempfile_in(folder).map(|_| ())
}

/// The folder that an empty path means.
fn named(folder: &Path) -> &Path {
    if folder.as_os_str().is_empty() {
        Path::new(".")
    } else {
        folder
    }
}

/// The folder that a file is in.
pub(super) fn folder_of(path: &Path) -> &Path {
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
    Err(io::Error::other("links that lead to one another"))
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
    fn what_is_read_is_never_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("subject.toml");
        std::fs::write(&path, "mass = 80").unwrap();
        input::text(&path).unwrap();
        assert!(check([&path], true).is_err());
        assert!(destination(&folder.path().join("./subject.toml")).is_err());
    }

    #[test]
    fn a_folder_may_be_there_or_be_made() {
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
    fn links_are_followed_and_circles_found() {
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
