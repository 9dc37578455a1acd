//! A unit in QEMU: the machine, its serial line and its logs.

use std::io::Read;
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

/// Longest time from starting the machine until its line is open.
const START_TIMEOUT: Duration = Duration::from_secs(10);

/// A running machine; it is stopped when this value is dropped.
pub struct Qemu {
    child: Child,
    logs: Arc<Mutex<Vec<u8>>>,
    collector: Option<JoinHandle<()>>,
    /// Contains the socket of the line.
    _folder: TempDir,
}

impl Qemu {
    /// Starts the machine with an image for the `lm3s6965evb`; returns it with the line to its first UART.
    ///
    /// # Errors
    /// Returns an error if the image or QEMU is missing, or the machine does not start.
    pub fn start(image: &Path) -> Result<(Self, UnixStream)> {
        if !image.is_file() {
            return Err(Problem::refused("the image of the unit does not exist")
                .in_file(image)
                .help("build it: cargo xtask unit"));
        }
        let folder = tempfile::tempdir().map_err(|error| Problem::system("make", image, error))?;
        let socket = folder.path().join("line");
        let mut child = Command::new(PROGRAM)
            .args(["-M", "lm3s6965evb", "-cpu", "cortex-m4"])
            .args(["-nographic", "-monitor", "none", "-icount", PACE])
            .args(["-semihosting-config", "enable=on,target=native"])
            .arg("-serial")
            .arg(format!("unix:{},server=on,wait=on", socket.display()))
            .args(["-serial", "null", "-kernel"])
            .arg(image)
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
        let mut machine = Self {
            child,
            logs,
            collector,
            _folder: folder,
        };
        let line = machine.connect(&socket)?;
        Ok((machine, line))
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
