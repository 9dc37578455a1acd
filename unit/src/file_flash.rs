//! A file used like flash memory, for the log of a unit on this machine: erased by sector, written by word.

use std::fs::{File, OpenOptions};
use std::ops::Range;
use std::os::unix::fs::FileExt;
use std::path::Path;

use embedded_storage_async::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};

use bodyflight_firmware::recorder::serial_flash::{SECTOR, parts};
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::files::write_file;

/// Number of sectors: as many as the flash of a Raspberry Pi Pico 2 has left beside a firmware image.
const SECTORS: u32 = 768;

/// The backing file.
#[derive(Debug)]
pub(super) struct FileFlash(File);

/// The file system refused an operation.
#[derive(Debug)]
pub(super) struct Refused;

impl NorFlashError for Refused {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

impl FileFlash {
    /// Opens a file, or creates an erased one.
    ///
    /// # Errors
    /// Returns an error if the file cannot be opened or created, or has a different size.
    pub(super) fn open(path: &Path) -> Result<Self> {
        let system = |error| Problem::system("open", path, error);
        let size = u64::from(SECTOR * SECTORS);
        // Whole from the beginning: a file cut short would be refused at the next start.
        if path.metadata().map_or(0, |found| found.len()) == 0 {
            write_file(path, &vec![0xff; (SECTOR * SECTORS) as usize])?;
        }
        let mut options = OpenOptions::new();
        let file = options.read(true).write(true).open(path).map_err(system)?;
        let found = file.metadata().map_err(system)?.len();
        if found != size {
            let message =
                format!("expected the log of a unit with {size} bytes, found {found} bytes");
            return Err(Problem::bad_input(message).in_file(path).help(
                "name a file that does not exist yet, or one that was created by this option",
            ));
        }
        Ok(Self(file))
    }

    /// Where log and configuration are stored.
    pub(super) const PARTS: [Range<u32>; 2] = parts(SECTOR * SECTORS);
}

impl ErrorType for FileFlash {
    type Error = Refused;
}

impl ReadNorFlash for FileFlash {
    const READ_SIZE: usize = 1;

    async fn read(
        &mut self,
        offset: u32,
        bytes: &mut [u8],
    ) -> core::result::Result<(), Self::Error> {
        let read = self.0.read_exact_at(bytes, u64::from(offset));
        read.map_err(|_| Refused)
    }

    fn capacity(&self) -> usize {
        (SECTOR * SECTORS) as usize
    }
}

impl NorFlash for FileFlash {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = SECTOR as usize;

    async fn erase(&mut self, from: u32, to: u32) -> core::result::Result<(), Self::Error> {
        let erased = vec![0xff; to.saturating_sub(from) as usize];
        let written = self.0.write_all_at(&erased, u64::from(from));
        written.map_err(|_| Refused)
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> core::result::Result<(), Self::Error> {
        let mut cells = vec![0; bytes.len()];
        self.read(offset, &mut cells).await?;
        for (cell, byte) in cells.iter_mut().zip(bytes) {
            *cell &= byte;
        }
        let written = self.0.write_all_at(&cells, u64::from(offset));
        written.map_err(|_| Refused)
    }
}
