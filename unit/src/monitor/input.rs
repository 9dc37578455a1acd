//! Bytes from a serial port, a file or standard input.

use std::fs::File;
use std::io::{self, ErrorKind, Read};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread;
use std::time::Duration;

use crate::ports;
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::input;

/// Bytes per read.
const PIECE: usize = 4096;
/// Number of pieces read ahead; beyond that, bytes stay in the system's buffer until a slow reader catches up.
const AHEAD: usize = 64;

/// Result of waiting for input.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Chunk {
    /// At least one byte.
    Bytes(Vec<u8>),
    /// Nothing yet.
    Silence,
    /// End of the input.
    End,
}

/// An input read on its own thread, so that waiting for it can be interrupted.
#[derive(Debug)]
pub struct Input {
    pieces: Receiver<io::Result<Vec<u8>>>,
    name: PathBuf,
}

impl Input {
    /// Opens `name`: `-` for standard input, a file, or else a serial port at `baud`.
    ///
    /// # Errors
    /// Returns an error if it cannot be opened.
    pub fn open(name: &str, baud: u32) -> Result<Self> {
        let path = Path::new(name);
        if name == "-" {
            return Ok(Self::new(io::stdin(), Path::new("standard input")));
        }
        if path.is_dir() {
            let is_folder = ErrorKind::IsADirectory.into();
            return Err(Problem::system("read", path, is_folder));
        }
        if is_file(path) {
            let file = File::open(path).map_err(|error| Problem::system("read", path, error))?;
            input::claim(path);
            return Ok(Self::new(file, path));
        }
        Ok(Self::new(ports::open(name, baud)?, path))
    }

    /// Reads from any reader; `name` is used in messages.
    pub fn new(reader: impl Read + Send + 'static, name: &Path) -> Self {
        let (sender, pieces) = sync_channel(AHEAD);
        thread::spawn(move || read(reader, &sender));
        Self {
            pieces,
            name: name.to_path_buf(),
        }
    }

    /// The next bytes, waiting for at most `patience`.
    ///
    /// # Errors
    /// Returns an error if reading fails, for example because a device was unplugged.
    pub fn next(&self, patience: Duration) -> Result<Chunk> {
        match self.pieces.recv_timeout(patience) {
            Ok(Ok(bytes)) if bytes.is_empty() => Ok(Chunk::Silence),
            Ok(Ok(bytes)) => Ok(Chunk::Bytes(bytes)),
            Ok(Err(error)) => Err(Problem::system("read", &self.name, error)),
            Err(RecvTimeoutError::Timeout) => Ok(Chunk::Silence),
            Err(RecvTimeoutError::Disconnected) => Ok(Chunk::End),
        }
    }
}

/// Device files are ports; everything else that exists, including pipes, is read as a file.
fn is_file(path: &Path) -> bool {
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt;
        std::fs::metadata(path).is_ok_and(|data| !data.file_type().is_char_device())
    }
    #[cfg(not(unix))]
    path.is_file()
}

/// Reads until the end, a failure, or until the receiver is gone.
fn read(mut reader: impl Read, sender: &SyncSender<io::Result<Vec<u8>>>) {
    let mut piece = vec![0; PIECE];
    loop {
        let result = match reader.read(&mut piece) {
            Ok(0) => return,
            Ok(length) => Ok(piece.get(..length).unwrap_or_default().to_vec()),
            Err(error) => match error.kind() {
                // Sending an empty piece fails if the receiver is gone.
                ErrorKind::TimedOut | ErrorKind::WouldBlock | ErrorKind::Interrupted => {
                    Ok(Vec::new())
                }
                _ => Err(error),
            },
        };
        let failed = result.is_err();
        if sender.send(result).is_err() || failed {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_bytes_arrive_before_the_end() {
        let bytes: Vec<u8> = (0..100_000u32).map(|i| i.to_le_bytes()[0]).collect();
        let input = Input::new(io::Cursor::new(bytes.clone()), Path::new("test"));
        let mut read = Vec::new();
        loop {
            match input.next(Duration::from_secs(5)).unwrap() {
                Chunk::Bytes(piece) => read.extend(piece),
                Chunk::Silence => {}
                Chunk::End => break,
            }
        }
        assert_eq!(read, bytes);
    }

    #[test]
    fn a_failing_device_is_named() {
        struct Unplugged;
        impl Read for Unplugged {
            fn read(&mut self, _: &mut [u8]) -> io::Result<usize> {
                Err(ErrorKind::BrokenPipe.into())
            }
        }
        let input = Input::new(Unplugged, Path::new("/dev/ttyUSB7"));
        let problem = input.next(Duration::from_secs(5)).unwrap_err();
        assert!(problem.to_string().contains("/dev/ttyUSB7"), "{problem}");
        assert!(Input::open("/", 9600).is_err());
    }
}
