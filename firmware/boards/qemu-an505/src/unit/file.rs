//! Flash memory in a file of the desktop, by semihosting: erased by sector, written by word.
//!
//! What was written is in the file at once, so it survives the end of QEMU as flash survives a loss of power. No time of the
//! machine passes meanwhile.

use core::ops::Range;

use bodyflight_firmware::recorder::serial_flash::{SECTOR, parts};
use embedded_storage_async::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};
use semihosting::fs::File;
use semihosting::io::{Read, Seek, SeekFrom, Write};

/// The file, in the folder in which QEMU was started.
const NAME: &core::ffi::CStr = c"flash.bin";

/// The file.
pub(super) struct FileFlash {
    file: File,
    capacity: u32,
}

/// The desktop refused an operation, or it lies beyond the end.
#[derive(Debug)]
pub(super) struct Refused;

impl NorFlashError for Refused {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

impl FileFlash {
    /// Opens the file; `None` if there is none of a usable length.
    pub(super) fn find() -> Option<Self> {
        let file = File::options().read(true).write(true).open(NAME).ok()?;
        let capacity = u32::try_from(file.metadata().ok()?.len()).ok()?;
        let [log, _] = parts(capacity);
        let usable = !log.is_empty() && capacity.is_multiple_of(SECTOR);
        usable.then_some(Self { file, capacity })
    }

    /// Where log and configuration are stored.
    pub(super) fn parts(&self) -> [Range<u32>; 2] {
        parts(self.capacity)
    }

    fn go_to(&mut self, offset: u32, length: usize) -> Result<(), Refused> {
        let end = u32::try_from(length)
            .ok()
            .and_then(|length| offset.checked_add(length));
        if end.is_none_or(|end| end > self.capacity) {
            return Err(Refused);
        }
        let gone = self.file.seek(SeekFrom::Start(offset.into()));
        gone.map(|_| ()).map_err(|_| Refused)
    }

    fn put(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Refused> {
        self.go_to(offset, bytes.len())?;
        self.file.write_all(bytes).map_err(|_| Refused)
    }
}

impl ErrorType for FileFlash {
    type Error = Refused;
}

impl ReadNorFlash for FileFlash {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Refused> {
        self.go_to(offset, bytes.len())?;
        self.file.read_exact(bytes).map_err(|_| Refused)
    }

    fn capacity(&self) -> usize {
        self.capacity as usize
    }
}

/// Bytes that are written at once.
const PIECE: usize = 64;

impl NorFlash for FileFlash {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = SECTOR as usize;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), Refused> {
        for offset in (from..to).step_by(PIECE) {
            self.put(offset, &[0xff; PIECE])?;
        }
        Ok(())
    }

    /// Writing only clears bits, as in flash.
    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Refused> {
        let mut place = offset;
        for piece in bytes.chunks(PIECE) {
            let mut cells = [0; PIECE];
            let cells = cells.get_mut(..piece.len()).ok_or(Refused)?;
            self.read(place, cells).await?;
            cells
                .iter_mut()
                .zip(piece)
                .for_each(|(cell, byte)| *cell &= byte);
            self.put(place, cells)?;
            place += PIECE as u32;
        }
        Ok(())
    }
}
