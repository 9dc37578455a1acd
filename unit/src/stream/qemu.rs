//! A unit in QEMU: the machine, its serial line and its logs.

use std::io::{Read, Write as _};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use tempfile::TempDir;

use bodyflight_io::diagnostic::{Problem, Result};

const PROGRAM: &str = "qemu-system-arm";

/// QEMU's `-icount`: each instruction takes 2^3 ns of the machine's time; on a Cortex-M4 at 168 MHz it takes half as
/// long again. The machine's clock thus counts the instructions executed, so the unit does not fall behind if the host
/// stalls. Nothing limits the rate of the line, so all that is sent during a stall would arrive at once; samples must
/// therefore be sent on credit.
const PACE: &str = "shift=3";

/// The same for a machine that hears only what is in a file: while it waits, its clock jumps to what comes next.
const FREE_PACE: &str = "shift=3,sleep=off";

/// Longest time from starting the machine until its line is open.
const START_TIMEOUT: Duration = Duration::from_secs(10);

/// A running machine; it is stopped when this value is dropped.
pub struct Qemu {
    child: Child,
    logs: Arc<Mutex<Vec<u8>>>,
    collector: Option<JoinHandle<()>>,
    monitor: Option<UnixStream>,
    /// Contains the sockets of the lines.
    _folder: TempDir,
}

/// A socket that QEMU opens.
fn listening(socket: &Path, wait: &str) -> String {
    format!("unix:{},server=on,{wait}", socket.display())
}

/// A folder for the machine's sockets.
fn room(image: &Path) -> Result<TempDir> {
    if !image.is_file() {
        return Err(Problem::refused("the image of the unit does not exist")
            .in_file(image)
            .help("build it: cargo xtask unit"));
    }
    tempfile::tempdir().map_err(|error| Problem::system("make", image, error))
}

/// The same, with the file that is the machine's memory.
fn room_with(image: &Path, flash: &Path) -> Result<TempDir> {
    let folder = room(image)?;
    let system = |error| Problem::system("open", flash, error);
    let flash = flash.canonicalize().map_err(system)?;
    // The image knows the file by this name.
    std::os::unix::fs::symlink(&flash, folder.path().join("flash.bin")).map_err(system)?;
    Ok(folder)
}

/// A line as the image reads it: each piece with its time (us, 4 bytes) and length (2 bytes) before it, little-endian.
fn records(line: &[(f64, Vec<u8>)]) -> Vec<u8> {
    let mut records = Vec::new();
    for (time, bytes) in line {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "saturates at zero and after 71 minutes"
        )]
        let time = (time * 1e6) as u32;
        for piece in bytes.chunks(usize::from(u16::MAX)) {
            records.extend(time.to_le_bytes());
            #[expect(clippy::cast_possible_truncation, reason = "as long as its largest")]
            records.extend((piece.len() as u16).to_le_bytes());
            records.extend(piece);
        }
    }
    records
}

impl Qemu {
    /// Starts the machine with an image for the `lm3s6965evb`; returns it with the line to its first UART.
    ///
    /// # Errors
    /// Returns an error if the image or QEMU is missing, or the machine does not start.
    pub fn start(image: &Path) -> Result<(Self, UnixStream)> {
        let folder = room(image)?;
        let socket = folder.path().join("line");
        let mut machine = Self::launch(image, folder, PACE, |command, folder| {
            command.args(["-M", "lm3s6965evb", "-cpu", "cortex-m4"]);
            command.args(["-monitor", "none"]);
            command.args(["-serial", &listening(&folder.join("line"), "wait=on")]);
            command.args(["-serial", "null"]);
        })?;
        let line = machine.connect(&socket)?;
        Ok((machine, line))
    }

    /// Starts a machine that no host can reach, with an image for the `mps2-an505`; returns it with the line of the unit's
    /// sensor. The file `flash` is its memory: what the unit writes is in it at once.
    ///
    /// # Errors
    /// Returns an error if the image, the file or QEMU is missing, or the machine does not start.
    pub fn start_alone(image: &Path, flash: &Path) -> Result<(Self, UnixStream)> {
        let folder = room_with(image, flash)?;
        let [line, monitor] = ["line", "monitor"].map(|name| folder.path().join(name));
        let mut machine = Self::launch(image, folder, PACE, |command, folder| {
            command.args(["-M", "mps2-an505"]);
            command.args(["-monitor", &listening(&folder.join("monitor"), "wait=off")]);
            command.args(["-serial", "null"]);
            command.args(["-serial", &listening(&folder.join("line"), "wait=on")]);
        })?;
        let line = machine.connect(&line)?;
        machine.monitor = Some(machine.connect(&monitor)?);
        Ok((machine, line))
    }

    /// Runs such a machine with what is sent on its sensor's line, each piece with the time since the start (s), and cuts
    /// the power when the line ends. Bytes arrive by the machine's clock, so that a run is the same on a busy desktop.
    ///
    /// # Errors
    /// The same, or if the machine still runs after `patience`.
    pub fn run_alone(
        image: &Path,
        flash: &Path,
        line: &[(f64, Vec<u8>)],
        patience: Duration,
    ) -> Result<()> {
        let folder = room_with(image, flash)?;
        let file = folder.path().join("line.bin");
        let system = |error| Problem::system("write", &file, error);
        std::fs::write(&file, records(line)).map_err(system)?;
        let mut machine = Self::launch(image, folder, FREE_PACE, |command, _| {
            command.args(["-M", "mps2-an505", "-monitor", "none"]);
            command.args(["-serial", "null", "-serial", "null"]);
        })?;
        let begin = Instant::now();
        while machine.child.try_wait().ok().flatten().is_none() {
            if begin.elapsed() > patience {
                let seconds = patience.as_secs();
                return Err(Problem::refused(format!(
                    "{PROGRAM} has not heard the line to its end within {seconds} s"
                )));
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        Ok(())
    }

    fn launch(
        image: &Path,
        folder: TempDir,
        pace: &str,
        choose: impl FnOnce(&mut Command, &Path),
    ) -> Result<Self> {
        let image = image
            .canonicalize()
            .map_err(|error| Problem::system("open", image, error))?;
        let mut command = Command::new(PROGRAM);
        choose(&mut command, folder.path());
        let mut child = command
            .args(["-nographic", "-icount", pace])
            .args(["-semihosting-config", "enable=on,target=native"])
            .arg("-kernel")
            .arg(image)
            .current_dir(folder.path())
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .map_err(|error| {
                Problem::refused(format!("cannot start {PROGRAM}"))
                    .help("install it: apt-get install qemu-system-arm")
                    .caused_by(error)
            })?;
        let logs = Arc::new(Mutex::new(Vec::new()));
        let collector = child.stdout.take().map(|mut output| {
            let logs = Arc::clone(&logs);
            std::thread::spawn(move || {
                let mut bytes = [0; 4096];
                while let Ok(count @ 1..) = output.read(&mut bytes) {
                    let mut logs = logs.lock().unwrap_or_else(PoisonError::into_inner);
                    logs.extend_from_slice(&bytes[..count]);
                }
            })
        });
        Ok(Self {
            child,
            logs,
            collector,
            monitor: None,
            _folder: folder,
        })
    }

    /// Resets a machine that was [started alone](Self::start_alone), as its reset pin would: memory stays as it is.
    ///
    /// # Errors
    /// Returns an error if QEMU has ended.
    pub fn reset(&mut self) -> Result<()> {
        let ended = || Problem::refused(format!("{PROGRAM} does not listen"));
        let monitor = self.monitor.as_mut().ok_or_else(ended)?;
        let sent = monitor.write_all(b"system_reset\n");
        sent.map_err(|error| ended().caused_by(error))
    }

    fn connect(&mut self, socket: &Path) -> Result<UnixStream> {
        let begin = Instant::now();
        loop {
            if let Ok(line) = UnixStream::connect(socket) {
                return Ok(line);
            }
            let ended = self.child.try_wait().ok().flatten();
            if ended.is_some() || begin.elapsed() > START_TIMEOUT {
                let state =
                    ended.map_or_else(|| "it does not answer".to_owned(), |s| s.to_string());
                return Err(Problem::refused(format!(
                    "{PROGRAM} did not open the line: {state}"
                )));
            }
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    /// The unit's log since the last call: defmt frames.
    pub fn logs(&self) -> Vec<u8> {
        std::mem::take(&mut *self.logs.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Stops the machine; returns its log since the last [`Qemu::logs`].
    pub fn stop(mut self) -> Vec<u8> {
        self.end();
        self.logs()
    }

    fn end(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
        if let Some(collector) = self.collector.take() {
            let _ = collector.join();
        }
    }
}

impl Drop for Qemu {
    fn drop(&mut self) {
        self.end();
    }
}
