//! A file under construction, which another process cannot see or which can be told from a finished one.
//!
//! On Linux it has no name until it is finished, so that not even a killed process leaves it behind. A file that replaces
//! another has a temporary name between two system calls; should the process be killed just then, a later run removes it.
//! Elsewhere, and on file systems without nameless files, it has a temporary name from the beginning.

use std::fs::{DirEntry, File};
use std::io::{self, Seek, SeekFrom, Write};
use std::path::Path;
use std::time::Duration;

use tempfile::{NamedTempFile, TempDir};

use crate::interrupt::Unfinished;

/// The file.
pub(crate) enum Scratch {
    #[cfg(target_os = "linux")]
    Nameless(File),
    Named(NamedTempFile<File>, Unfinished),
}

impl Scratch {
    /// Starts a file in a folder.
    pub(crate) fn create(folder: &Path) -> io::Result<Self> {
        #[cfg(target_os = "linux")]
        if let Some(file) = nameless::create(folder) {
            return Ok(Self::Nameless(file));
        }
        Self::named(folder)
    }

    fn named(folder: &Path) -> io::Result<Self> {
        sweep(folder);
        let prefix = prefix();
        let mut builder = tempfile::Builder::new();
        builder.prefix(&prefix);
        // Temporary files are private otherwise; the system takes away what the user does not want to give.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        let file = builder.make_in(folder, |path| {
            File::options()
                .read(true)
                .write(true)
                .create_new(true)
                .open(path)
        })?;
        let unfinished = Unfinished::new(file.path());
        Ok(Self::Named(file, unfinished))
    }

    /// Gives the file its name; replaces a file that has it.
    pub(crate) fn finish(self, place: &Path, folder: &Path) -> io::Result<()> {
        match self {
            #[cfg(target_os = "linux")]
            Self::Nameless(file) => {
                file.sync_all()?;
                match nameless::link(&file, place) {
                    Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {
                        sweep(folder);
                        let link = |path: &Path| nameless::link(&file, path);
                        let named = tempfile::Builder::new()
                            .prefix(&prefix())
                            .make_in(folder, link)?;
                        named.persist(place).map_err(|error| error.error)
                    }
                    linked => linked,
                }
            }
            Self::Named(file, _unfinished) => {
                file.as_file().sync_all()?;
                file.persist(place).map_err(|error| error.error)?;
                Ok(())
            }
        }
    }

    fn file(&mut self) -> &mut File {
        match self {
            #[cfg(target_os = "linux")]
            Self::Nameless(file) => file,
            Self::Named(file, _) => file.as_file_mut(),
        }
    }
}

/// First part of temporary names, before the number of the process.
const PREFIX: &str = ".bodyflight-";

/// Age from which a temporary file may be an orphan: processes of other machines, which cannot be seen, have finished
/// theirs by then.
const ORPHAN: Duration = Duration::from_secs(60);

fn prefix() -> String {
    format!("{PREFIX}{}-", std::process::id())
}

/// Removes temporary files and folders of processes that were killed. Whatever cannot be told or removed stays.
fn sweep(folder: &Path) {
    let Ok(entries) = std::fs::read_dir(folder) else {
        return;
    };
    for entry in entries.flatten() {
        if is_orphan(&entry).unwrap_or(false) {
            let path = entry.path();
            let _ = std::fs::remove_file(&path).or_else(|_| std::fs::remove_dir_all(&path));
        }
    }
}

fn is_orphan(entry: &DirEntry) -> Option<bool> {
    let name = entry.file_name();
    let process = name.to_str()?.strip_prefix(PREFIX)?.split('-').next()?;
    let process: u32 = process.parse().ok()?;
    let age = entry.metadata().ok()?.modified().ok()?.elapsed().ok()?;
    let processes = Path::new("/proc");
    let is_alive = !processes.join("self").exists() || processes.join(process.to_string()).exists();
    Some(age > ORPHAN && !is_alive)
}

/// Starts a folder beside its later place.
pub(crate) fn folder(above: &Path) -> io::Result<TempDir> {
    sweep(above);
    tempfile::Builder::new().prefix(&prefix()).tempdir_in(above)
}

impl Write for Scratch {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file().write(bytes)
    }
    fn flush(&mut self) -> io::Result<()> {
        self.file().flush()
    }
}

impl Seek for Scratch {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.file().seek(to)
    }
}

#[cfg(target_os = "linux")]
mod nameless {
    use std::fs::File;
    use std::io;
    use std::os::fd::AsRawFd;
    use std::path::Path;

    use rustix::fs::{AtFlags, CWD, Mode, OFlags, linkat, openat};

    /// Where the system gives open files a name.
    const OPEN: &str = "/proc/self/fd";

    /// Creates a file without a name; `None` if the file system has none, or it could not be named later.
    pub(super) fn create(folder: &Path) -> Option<File> {
        let flags = OFlags::TMPFILE | OFlags::RDWR | OFlags::CLOEXEC;
        let file = openat(CWD, folder, flags, Mode::from_raw_mode(0o666)).ok()?;
        Path::new(OPEN).is_dir().then(|| file.into())
    }

    /// Gives it a name that no file has.
    pub(super) fn link(file: &File, path: &Path) -> io::Result<()> {
        let open = format!("{OPEN}/{}", file.as_raw_fd());
        Ok(linkat(CWD, open, CWD, path, AtFlags::SYMLINK_FOLLOW)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let entries = std::fs::read_dir(folder).unwrap();
        let mut names: Vec<String> = entries
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn both_kinds_appear_whole_and_replace_what_was_there() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let place = folder.join("run.csv");
        for create in [Scratch::create, Scratch::named] {
            for content in ["first", "second, longer", "3"] {
                let mut scratch = create(folder).unwrap();
                scratch.file().write_all(content.as_bytes()).unwrap();
                let before = std::fs::read(&place).unwrap_or_default();
                assert_ne!(before, content.as_bytes());
                scratch.finish(&place, folder).unwrap();
                assert_eq!(std::fs::read_to_string(&place).unwrap(), content);
                assert_eq!(names(folder), ["run.csv"]);
            }
        }
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn what_a_killed_process_left_is_removed_later() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let old = std::time::SystemTime::now() - 2 * ORPHAN;
        let own = std::process::id();
        // No process has so large a number.
        let all = [
            (".bodyflight-4000000000-a".to_owned(), old),
            (".bodyflight-4000000000-new".to_owned(), old + 2 * ORPHAN),
            (format!(".bodyflight-{own}-alive"), old),
            (".bodyflight-notes".to_owned(), old),
            ("run.csv".to_owned(), old),
        ];
        for (name, time) in &all {
            let file = File::create(folder.join(name)).unwrap();
            file.set_modified(*time).unwrap();
        }
        let mut scratch = Scratch::create(folder).unwrap();
        scratch.write_all(b"1").unwrap();
        scratch.finish(&folder.join("run.csv"), folder).unwrap();
        let mut kept: Vec<_> = all[1..].iter().map(|(name, _)| name.clone()).collect();
        kept.sort();
        assert_eq!(names(folder), kept);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn an_unfinished_file_has_no_name() {
        let folder = tempfile::tempdir().unwrap();
        let mut scratch = Scratch::create(folder.path()).unwrap();
        scratch.file().write_all(b"half").unwrap();
        let is_named = matches!(scratch, Scratch::Named(..));
        assert_eq!(names(folder.path()).len(), usize::from(is_named));
        drop(scratch);
        assert!(names(folder.path()).is_empty());
    }
}
