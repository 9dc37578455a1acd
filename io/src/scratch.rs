//! A file under construction, which another process cannot see or which can be told from a finished one.
//!
//! On Linux it has no name until it is finished, so that not even a killed process leaves it behind. A file that replaces
//! another has a temporary name between two system calls; should the process be killed just then, a later run removes it.
//! Elsewhere, and on file systems without nameless files, it has a temporary name from the beginning, as every folder has.
//!
//! Whoever makes a file or folder with a temporary name holds a lock on it, which the system opens when the process ends,
//! however it ends. What nobody holds is therefore left over.

use std::fs::{DirEntry, File, TryLockError};
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
        loop {
            let file = builder.make_in(folder, |path| {
                File::options()
                    .read(true)
                    .write(true)
                    .create_new(true)
                    .open(path)
            })?;
            hold(file.as_file());
            if file.path().exists() {
                let unfinished = Unfinished::new(file.path());
                return Ok(Self::Named(file, unfinished));
            }
        }
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
                        hold(&file);
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

/// Age from which what cannot be locked is left over, such as folders on some network file systems: nothing is written for
/// so long.
const ORPHAN: Duration = Duration::from_secs(86_400);

fn prefix() -> String {
    format!("{PREFIX}{}-", std::process::id())
}

/// Locks what has a temporary name, until the file is closed. Before that, another process may have taken it for left over,
/// so it must be looked for afterwards.
fn hold(file: &File) {
    // Where there are no locks, its age tells.
    let _ = file.lock();
}

/// Removes temporary files and folders of processes that are gone. Whatever cannot be told or removed stays.
pub(crate) fn sweep(folder: &Path) {
    let Ok(entries) = std::fs::read_dir(folder) else {
        return;
    };
    for entry in entries.flatten() {
        let Some(_held) = orphan(&entry) else {
            continue;
        };
        let path = entry.path();
        let _ = std::fs::remove_file(&path).or_else(|_| std::fs::remove_dir_all(&path));
    }
}

/// What is left over, held from now on if the file system has locks; `None` if it is in use or something else.
fn orphan(entry: &DirEntry) -> Option<Option<File>> {
    let name = entry.file_name();
    let process = name.to_str()?.strip_prefix(PREFIX)?.split('-').next()?;
    process.parse::<u32>().ok()?;
    let kind = entry.file_type().ok()?;
    if !kind.is_file() && !kind.is_dir() {
        return None;
    }
    let opened = File::open(entry.path());
    let locked = opened.map(|file| (file.try_lock(), file));
    match locked {
        Ok((Ok(()), file)) => Some(Some(file)),
        Ok((Err(TryLockError::WouldBlock), _)) => None,
        Ok((Err(TryLockError::Error(_)), _)) | Err(_) => {
            let age = entry.metadata().ok()?.modified().ok()?.elapsed().ok()?;
            (age > ORPHAN).then_some(None)
        }
    }
}

/// A folder under construction, held.
pub(crate) struct ScratchFolder {
    pub(crate) folder: TempDir,
    _held: Option<File>,
}

impl ScratchFolder {
    /// Starts a folder beside its later place.
    pub(crate) fn create(above: &Path) -> io::Result<Self> {
        sweep(above);
        loop {
            let folder = tempfile::Builder::new()
                .prefix(&prefix())
                .tempdir_in(above)?;
            let held = File::open(folder.path()).ok();
            held.iter().for_each(hold);
            if folder.path().exists() {
                return Ok(Self {
                    folder,
                    _held: held,
                });
            }
        }
    }
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

    #[cfg(unix)]
    #[test]
    fn what_a_process_left_that_is_gone_is_removed_at_once() {
        let place = tempfile::tempdir().unwrap();
        let above = place.path();
        let kept = [".bodyflight-notes", "run.csv"];
        for name in kept.into_iter().chain([".bodyflight-4000000000-a"]) {
            File::create(above.join(name)).unwrap();
        }
        std::fs::create_dir_all(above.join(".bodyflight-1-b/part")).unwrap();
        std::os::unix::fs::symlink("run.csv", above.join(".bodyflight-1-link")).unwrap();
        // Processes that work are those that hold theirs, whatever their number.
        let held = ScratchFolder::create(above).unwrap();
        let own = held.folder.path().file_name().unwrap().to_owned();
        let named = Scratch::named(above).unwrap();
        assert_eq!(names(above).len(), 5, "{:?}", names(above));
        sweep(above);
        assert_eq!(names(above).len(), 5, "{:?}", names(above));
        drop(named);
        // As if the process had been killed: nothing is removed, and nothing is held any more.
        let ScratchFolder { folder, _held } = held;
        let _ = folder.keep();
        drop(_held);
        assert!(names(above).contains(&own.into_string().unwrap()));
        sweep(above);
        assert_eq!(names(above), [".bodyflight-1-link", kept[0], kept[1]]);
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
