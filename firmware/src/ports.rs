//! Building blocks for a board's ports: receivers that count their errors, and two host lines combined into one.

use core::sync::atomic::{AtomicU32, Ordering};

use embassy_futures::select::{self, select};
use embedded_io_async::{ErrorType, Read, Write};

/// Error counters of a receiver since the start: overruns (lost bytes), and others.
#[derive(Debug, Default)]
pub struct LineErrors {
    overruns: AtomicU32,
    others: AtomicU32,
}

impl LineErrors {
    /// Creates counters at zero.
    pub const fn new() -> Self {
        Self {
            overruns: AtomicU32::new(0),
            others: AtomicU32::new(0),
        }
    }

    /// Returns the number of overruns and of other errors.
    pub fn counted(&self) -> [u32; 2] {
        [&self.overruns, &self.others].map(|counter| counter.load(Ordering::Relaxed))
    }

    fn count(&self, is_overrun: bool) {
        let counter = if is_overrun {
            &self.overruns
        } else {
            &self.others
        };
        // Not every processor has atomic addition; only one task counts.
        counter.store(
            counter.load(Ordering::Relaxed).wrapping_add(1),
            Ordering::Relaxed,
        );
    }
}

/// A receiver that counts its errors and passes them on.
#[derive(Debug)]
pub struct Counted<R: Read> {
    receiver: R,
    errors: &'static LineErrors,
    is_overrun: fn(&R::Error) -> bool,
}

impl<R: Read> Counted<R> {
    /// Wraps `receiver` and counts its errors in `errors`; `is_overrun` distinguishes overruns from other errors.
    pub const fn new(
        receiver: R,
        errors: &'static LineErrors,
        is_overrun: fn(&R::Error) -> bool,
    ) -> Self {
        Self {
            receiver,
            errors,
            is_overrun,
        }
    }
}

impl<R: Read> ErrorType for Counted<R> {
    type Error = R::Error;
}

impl<R: Read> Read for Counted<R> {
    async fn read(&mut self, bytes: &mut [u8]) -> Result<usize, R::Error> {
        let result = self.receiver.read(bytes).await;
        result.inspect_err(|error| self.errors.count((self.is_overrun)(error)))
    }
}

/// A line that a host program opens and closes, such as USB serial.
pub trait Opened {
    /// Whether a host program has the line open.
    fn is_open(&self) -> bool;
}

/// Combines two lines: the first is used while it is open, the second otherwise. Input on the second while the first is
/// open, for example noise on an unconnected pin, is dropped.
#[derive(Debug)]
pub struct Preferred<A, B>(pub A, pub B);

/// Either of two receivers, whichever a board has.
#[derive(Debug)]
pub enum Either<A, B> {
    /// The first.
    First(A),
    /// The second.
    Second(B),
}

impl<A: Read, B: Read> ErrorType for Either<A, B> {
    type Error = LineError;
}

impl<A: Read, B: Read> Read for Either<A, B> {
    async fn read(&mut self, bytes: &mut [u8]) -> Result<usize, LineError> {
        match self {
            Self::First(receiver) => receiver.read(bytes).await.map_err(LineError::of),
            Self::Second(receiver) => receiver.read(bytes).await.map_err(LineError::of),
        }
    }
}

/// An error of either line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LineError(embedded_io_async::ErrorKind);

impl LineError {
    fn of(error: impl embedded_io_async::Error) -> Self {
        Self(error.kind())
    }
}

impl core::fmt::Display for LineError {
    fn fmt(&self, formatter: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(formatter, "{:?}", self.0)
    }
}

impl core::error::Error for LineError {}

impl embedded_io_async::Error for LineError {
    fn kind(&self) -> embedded_io_async::ErrorKind {
        self.0
    }
}

impl<A, B> ErrorType for Preferred<A, B> {
    type Error = LineError;
}

/// Bytes read from a line at once: one USB packet.
const PACKET: usize = 64;

impl<A: Read + Opened, B: Read> Read for Preferred<A, B> {
    async fn read(&mut self, bytes: &mut [u8]) -> Result<usize, LineError> {
        let mut second = [0; PACKET];
        loop {
            let length = bytes.len().min(PACKET);
            let room = second.get_mut(..length).unwrap_or_default();
            let heard = select(self.0.read(bytes), self.1.read(room)).await;
            match heard {
                select::Either::First(result) => return result.map_err(LineError::of),
                select::Either::Second(_) if self.0.is_open() => {}
                select::Either::Second(result) => {
                    let count = result.map_err(LineError::of)?;
                    let places = bytes.iter_mut().zip(&second).take(count);
                    places.for_each(|(place, byte)| *place = *byte);
                    return Ok(count);
                }
            }
        }
    }
}

impl<A: Write + Opened, B: Write> Write for Preferred<A, B> {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, LineError> {
        if self.0.is_open() {
            self.0.write(bytes).await.map_err(LineError::of)
        } else {
            self.1.write(bytes).await.map_err(LineError::of)
        }
    }

    async fn flush(&mut self) -> Result<(), LineError> {
        if self.0.is_open() {
            self.0.flush().await.map_err(LineError::of)
        } else {
            self.1.flush().await.map_err(LineError::of)
        }
    }
}

#[cfg(test)]
mod tests;
