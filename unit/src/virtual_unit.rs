//! The unit as a process on this machine: the boards' application behind a pseudo-terminal.

use std::cell::RefCell;
use std::io::{ErrorKind, Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::sync::mpsc::Sender;
use std::time::{Duration, Instant};

use bodyflight_core::link::StreamMode;
use bodyflight_firmware::recorder::storage::{EraseAhead, FlightLog, Log as _, NoLog};
use bodyflight_firmware::recorder::{Block, Recorder};
use bodyflight_firmware::{Board, Identity, RECEIVER_BYTES, Unit, run};
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::pipe::Pipe;
use embedded_io_async::{ErrorType, Read, Write};
use serialport::{SerialPort, TTYPort};

use super::block_on::block_on;
use super::file_flash::FileFlash;
use super::monitor::{Chunk, Input};
use bodyflight_io::diagnostic::{Problem, Result};

/// Capacity, in blocks, of the buffer between the unit and its file.
const BLOCKS: usize = 64;

/// A unit that runs in threads of this process until the process ends.
#[derive(Debug)]
pub struct VirtualUnit {
    path: PathBuf,
    /// The session with which it started on its own, if it has a stored configuration.
    resumed: Option<StreamMode>,
    /// Kept open so that hosts may connect and disconnect.
    _port: TTYPort,
}

impl VirtualUnit {
    /// Starts a unit.
    ///
    /// # Errors
    /// Returns an error if the system cannot provide a pseudo-terminal.
    pub fn start() -> Result<Self> {
        Self::start_with(None, None)
    }

    /// Starts a unit that keeps its log in a file, as a board does in flash.
    ///
    /// # Errors
    /// Returns an error if the system cannot provide a pseudo-terminal, or the file cannot be used.
    pub fn start_with_log(path: &Path) -> Result<Self> {
        Self::start_with(Some(FileFlash::open(path)?), None)
    }

    /// Same as [`VirtualUnit::start_with_log`], with a sensor on the unit's own port.
    ///
    /// # Errors
    /// Same as [`VirtualUnit::start_with_log`].
    pub fn start_with_sensor(path: &Path, sensor: SensorLine) -> Result<Self> {
        Self::start_with(Some(FileFlash::open(path)?), Some(sensor))
    }

    fn start_with(flash: Option<FileFlash>, sensor: Option<SensorLine>) -> Result<Self> {
        let (ours, port) =
            TTYPort::pair().map_err(|error| refused("open a pseudo-terminal").caused_by(error))?;
        let path = port
            .name()
            .map(PathBuf::from)
            .ok_or_else(|| refused("use a pseudo-terminal: it has no name"))?;
        let writer = ours
            .try_clone_native()
            .map_err(|error| refused("share a pseudo-terminal").caused_by(error))?;
        // The threads run until the process exits; a unit never stops on its own.
        let received: &'static Received = Box::leak(Box::new(Pipe::new()));
        std::thread::spawn(move || receive(ours, received));
        let sensed: &'static Received = Box::leak(Box::new(Pipe::new()));
        if let Some(sensor) = sensor {
            std::thread::spawn(move || {
                sensor.play(|piece| {
                    block_on(sensed.write_all(piece));
                    true
                })
            });
        }
        let (started, starts) = std::sync::mpsc::channel();
        std::thread::spawn(move || serve([received, sensed], writer, flash, &started));
        let resumed = starts.recv().ok().flatten();
        Ok(Self {
            path,
            resumed,
            _port: port,
        })
    }

    /// The session with which it started on its own; `None` if it waits for a host.
    pub const fn resumed(&self) -> Option<StreamMode> {
        self.resumed
    }

    /// Path at which hosts open it, like any serial port.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

/// The line of a sensor.
#[derive(Debug)]
pub struct SensorLine {
    /// Its bytes.
    pub input: Input,
    /// Pace of a recorded line (bytes/s); a port sets its own.
    pub pace: Option<f64>,
}

/// Longest wait for a sensor's bytes.
const PATIENCE: Duration = Duration::from_millis(100);

/// Bytes of a recorded line that arrive at once.
const PIECE: usize = 32;

impl SensorLine {
    /// Passes the bytes on until the line ends. A unit that is behind delays them: nothing is lost.
    /// Ends early when `pass` returns `false`.
    pub(super) fn play(self, mut pass: impl FnMut(&[u8]) -> bool) {
        let mut due = Instant::now();
        loop {
            let bytes = match self.input.next(PATIENCE) {
                Ok(Chunk::Bytes(bytes)) => bytes,
                Ok(Chunk::Silence) => continue,
                Ok(Chunk::End) | Err(_) => return,
            };
            for piece in bytes.chunks(PIECE) {
                if let Some(pace) = self.pace {
                    std::thread::sleep(due.saturating_duration_since(Instant::now()));
                    #[expect(clippy::cast_precision_loss, reason = "a piece is short")]
                    let length = piece.len() as f64;
                    due += Duration::from_secs_f64(length / pace);
                }
                if !pass(piece) {
                    return;
                }
            }
        }
    }
}

/// Runs the unit on its own thread, forever.
fn serve(
    [received, sensed]: [&'static Received; 2],
    writer: TTYPort,
    flash: Option<FileFlash>,
    started: &Sender<Option<StreamMode>>,
) {
    let recorder = Recorder::new(vec![Block::EMPTY; BLOCKS].leak());
    let board = ThisMachine {
        begin: Instant::now(),
        recorder: flash.is_some().then_some(&recorder),
    };
    let unit = RefCell::new(Unit::new(board, identity()));
    let (receiver, sensor) = (FromLine(received), FromLine(sensed));
    let transmitter = ToHost(writer);
    block_on(async {
        match flash {
            Some(flash) => {
                let [log, setup] = FileFlash::PARTS;
                let ahead = EraseAhead::OWN_CHIP;
                let mut log = FlightLog::new(&recorder, flash, log, setup, ahead);
                let setup = log.stored().await;
                let resumed = setup.is_some_and(|setup| unit.borrow_mut().resume(&setup));
                let _ = started.send(resumed.then_some(StreamMode::Sensor));
                run(&unit, receiver, transmitter, sensor, log).await;
            }
            None => {
                let _ = started.send(None);
                run(&unit, receiver, transmitter, sensor, NoLog).await;
            }
        }
    });
}

fn refused(action: &str) -> Problem {
    Problem::refused(format!("cannot {action}"))
}

fn identity() -> Identity {
    Identity {
        build: *b"virtual\0",
        boot_id: std::process::id(),
        ..Identity::default()
    }
}

/// This machine as a board.
struct ThisMachine<'a> {
    begin: Instant,
    recorder: Option<&'a Recorder>,
}

impl Board for ThisMachine<'_> {
    /// Nanoseconds serve as cycles.
    #[expect(clippy::cast_possible_truncation, reason = "the counter wraps")]
    fn cycles(&self) -> u32 {
        self.begin.elapsed().as_nanos() as u32
    }

    /// Unknown on this machine.
    fn stack_free(&self) -> u32 {
        0
    }

    fn line_errors(&self) -> [u32; 2] {
        [0; 2]
    }

    fn recorder(&self) -> Option<&Recorder> {
        self.recorder
    }

    fn feed_watchdog(&self) {}

    fn note(&self, _: u32) {}
}

type Received = Pipe<CriticalSectionRawMutex, RECEIVER_BYTES>;

/// Moves bytes from the terminal to the unit. A full pipe blocks the terminal and thus the host: nothing is lost.
fn receive(mut port: TTYPort, received: &Received) {
    let mut bytes = [0; 512];
    let _ = port.set_timeout(Duration::from_secs(3600));
    loop {
        match port.read(&mut bytes) {
            Ok(count) => block_on(received.write_all(&bytes[..count])),
            Err(error) if matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::Interrupted) => {}
            Err(_) => std::thread::sleep(Duration::from_millis(20)),
        }
    }
}

struct FromLine(&'static Received);

impl ErrorType for FromLine {
    type Error = std::convert::Infallible;
}

impl Read for FromLine {
    async fn read(&mut self, bytes: &mut [u8]) -> core::result::Result<usize, Self::Error> {
        Ok(self.0.read(bytes).await)
    }
}

struct ToHost(TTYPort);

impl ErrorType for ToHost {
    type Error = embedded_io_async::ErrorKind;
}

impl Write for ToHost {
    /// Fails if the host does not read and the terminal is full.
    async fn write(&mut self, bytes: &[u8]) -> core::result::Result<usize, Self::Error> {
        self.0
            .write(bytes)
            .map_err(|_| embedded_io_async::ErrorKind::TimedOut)
    }

    async fn flush(&mut self) -> core::result::Result<(), Self::Error> {
        Ok(())
    }
}
