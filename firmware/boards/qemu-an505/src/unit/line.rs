//! The line of the sensor in a file of the desktop, by semihosting, at the pace of the machine's own clock.
//!
//! QEMU hands a UART one byte at a time and costs the desktop 50 us for each, so ten sensors on one line, 25 kB/s, arrive
//! later and later. What is in the file arrives when it should, however busy the desktop is, and so every run is the same.
//! A record is the time since the start (us, 4 bytes), the number of bytes (2 bytes), and the bytes; little-endian. The end
//! of the file cuts the power.

use core::convert::Infallible;

use embassy_time::{Instant, Timer};
use embedded_io_async::{ErrorType, Read};
use semihosting::fs::File;
use semihosting::io::Read as _;
use semihosting::process;

/// The file, in the folder in which QEMU was started.
const NAME: &core::ffi::CStr = c"line.bin";

/// The file, and the bytes of the present record that were not read yet.
pub(super) struct FileLine {
    file: File,
    left: usize,
}

impl FileLine {
    /// Opens the file; `None` if there is none.
    pub(super) fn find() -> Option<Self> {
        let file = File::open(NAME).ok()?;
        Some(Self { file, left: 0 })
    }

    /// Fills the bytes, or cuts the power if the file has ended.
    fn fill(&mut self, bytes: &mut [u8]) {
        if self.file.read_exact(bytes).is_err() {
            process::exit(0);
        }
    }
}

impl ErrorType for FileLine {
    type Error = Infallible;
}

impl Read for FileLine {
    async fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Infallible> {
        while self.left == 0 {
            let (mut time, mut length) = ([0; 4], [0; 2]);
            self.fill(&mut time);
            self.fill(&mut length);
            self.left = usize::from(u16::from_le_bytes(length));
            Timer::at(Instant::from_micros(u32::from_le_bytes(time).into())).await;
        }
        let count = self.left.min(bytes.len());
        self.fill(bytes.get_mut(..count).unwrap_or_default());
        self.left -= count;
        Ok(count)
    }
}
