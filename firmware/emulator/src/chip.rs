//! The emulator as a process, controlled by lines of JSON.

use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};

use crate::Result;

/// Options of the emulated chip.
#[derive(Debug, Clone)]
pub struct Options {
    /// The image; by default the one named by `BODYFLIGHT_F405_IMAGE`.
    pub image: PathBuf,
    /// Whether the crystal starts.
    pub crystal: bool,
    /// Seed of the memory contents after power-on, and of the random numbers.
    pub seed: u64,
    /// Voltage of the battery (mV).
    pub battery: u16,
}

impl Options {
    /// Options of a chip without faults.
    ///
    /// # Panics
    /// Panics if `BODYFLIGHT_F405_IMAGE` is not set.
    pub fn new() -> Self {
        let image = std::env::var_os("BODYFLIGHT_F405_IMAGE");
        Self {
            image: image
                .expect("BODYFLIGHT_F405_IMAGE is the image: cargo xtask f405 sets it")
                .into(),
            crystal: true,
            seed: 1,
            battery: 3900,
        }
    }
}

impl Default for Options {
    fn default() -> Self {
        Self::new()
    }
}

/// An event on the chip.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Event {
    /// Bytes were sent by a port; `at` is the time of the last (us).
    Sent {
        /// Time (us).
        at: u64,
        /// `host` or `sensor`.
        port: String,
        /// The bytes.
        bytes: Vec<u8>,
    },
    /// The chip was reset.
    Reset {
        /// Time (us).
        at: u64,
        /// `power-on`, `brown-out`, `pin`, `software` or `watchdog`.
        cause: String,
    },
}

/// Counters and configuration of the chip.
#[derive(Debug, Clone, Deserialize)]
pub struct Look {
    /// Time (us).
    pub now: u64,
    /// Instructions executed.
    pub instructions: u64,
    /// Cycles in which the processor did not sleep, from the mean number of cycles per instruction.
    pub busy: u64,
    /// Bytes lost by the receivers of host and sensor.
    pub overruns: [u32; 2],
    /// FLASH.ACR.
    pub flash_control: u32,
    /// Clock frequency of the processor (Hz).
    pub frequency: u32,
    /// RCC.CSR.
    pub reset_flags: u32,
    /// Priorities of the enabled interrupts, by interrupt number.
    pub priorities: std::collections::BTreeMap<String, u8>,
    /// The independent watchdog.
    pub watchdog: Watchdog,
    /// Stack pointer.
    pub stack_pointer: u32,
    /// Whether a fault occurred within the fault handler.
    pub locked_up: bool,
    /// Program counter.
    pub pc: u32,
}

/// The independent watchdog.
#[derive(Debug, Clone, Copy, Deserialize)]
pub struct Watchdog {
    /// Whether it runs.
    pub started: bool,
    /// Number of times it was fed since the reset.
    pub fed: u32,
}

/// Cost of a part of the program, by the model of `stm32f405/cycles.py`.
#[derive(Debug, Clone, Copy, Deserialize)]
pub struct Cost {
    /// Instructions.
    pub instructions: u64,
    /// Cycles with no wait states for flash.
    pub cycles: u64,
    /// Cycles with the flash settings after a reset.
    pub plain: u64,
    /// Cycles with prefetch and caches.
    pub accelerated: u64,
}

/// An injected fault.
#[derive(Debug, Clone, Copy, Deserialize)]
pub struct Provoked {
    /// Address of the fault; 0 for a panic.
    pub address: u32,
    /// Time (us).
    pub at: u64,
    /// Number of active exceptions.
    pub nested: u32,
}

#[derive(Deserialize)]
struct Events {
    events: Vec<RawEvent>,
}

#[derive(Deserialize)]
struct RawEvent {
    at: u64,
    port: Option<String>,
    sent: Option<String>,
    reset: Option<String>,
}

/// A running chip.
#[derive(Debug)]
pub struct Chip {
    child: Child,
    input: ChildStdin,
    output: BufReader<ChildStdout>,
    now: u64,
}

impl Chip {
    /// Starts the emulator with power on. `BODYFLIGHT_F405_PYTHON` names the Python interpreter that has the required
    /// packages.
    ///
    /// # Errors
    /// Returns an error if the emulator does not start.
    pub fn start(options: &Options) -> Result<Self> {
        let python = std::env::var_os("BODYFLIGHT_F405_PYTHON").unwrap_or_else(|| "python3".into());
        let mut command = Command::new(&python);
        command.args(["-m", "stm32f405"]).arg(&options.image);
        command.args(["--seed", &options.seed.to_string()]);
        command.args(["--battery", &options.battery.to_string()]);
        if !options.crystal {
            command.arg("--no-crystal");
        }
        let mut child = command
            .current_dir(Path::new(env!("CARGO_MANIFEST_DIR")))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .map_err(|error| format!("{}: {error}", python.display()))?;
        let (Some(input), Some(output)) = (child.stdin.take(), child.stdout.take()) else {
            return Err("the emulator has no pipes".into());
        };
        Ok(Self {
            child,
            input,
            output: BufReader::new(output),
            now: 0,
        })
    }

    fn ask<T: DeserializeOwned>(&mut self, command: &Value) -> Result<T> {
        let failed = |error: &dyn std::fmt::Display| format!("the emulator, at {command}: {error}");
        writeln!(self.input, "{command}").map_err(|error| failed(&error))?;
        self.input.flush().map_err(|error| failed(&error))?;
        let mut line = String::new();
        self.output
            .read_line(&mut line)
            .map_err(|error| failed(&error))?;
        serde_json::from_str(&line).map_err(|error| failed(&error))
    }

    /// Time (us).
    pub fn now(&self) -> u64 {
        self.now
    }

    /// Sends bytes to a port, starting at a time (us).
    ///
    /// # Errors
    /// Returns an error if the emulator has ended.
    pub fn send(&mut self, at: u64, port: &str, bytes: &[u8]) -> Result<()> {
        self.send_broken(at, port, bytes, "", false)
    }

    /// Like [`send`](Self::send), with an error on each byte: `noise`, `framing`, `overrun`. With `at_once` the bytes
    /// are mixed with those already arriving.
    ///
    /// # Errors
    /// Returns an error if the emulator has ended.
    pub fn send_broken(
        &mut self,
        at: u64,
        port: &str,
        bytes: &[u8],
        error: &str,
        at_once: bool,
    ) -> Result<()> {
        let hex: String = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
        let _: Value = self.ask(&json!({
            "do": "send", "at": at, "port": port, "bytes": hex, "error": error, "at_once": at_once
        }))?;
        Ok(())
    }

    /// Runs until `until` (us).
    ///
    /// # Errors
    /// Returns an error if the emulator has ended.
    pub fn run(&mut self, until: u64) -> Result<Vec<Event>> {
        self.now = self.now.max(until);
        let found: Events = self.ask(&json!({"do": "run", "until": until}))?;
        found.events.into_iter().map(RawEvent::parse).collect()
    }

    /// Runs until `until` (us), counting every cycle; slow.
    ///
    /// # Errors
    /// Returns an error if the emulator has ended.
    pub fn trace(&mut self, until: u64) -> Result<Cost> {
        self.now = self.now.max(until);
        self.ask(&json!({"do": "trace", "until": until}))
    }

    /// Injects a fault now: `undefined`, `bus`, `division`, `unaligned`, `stack`, `panic`, `hang`; `within` a `task`,
    /// an `interrupt`, or wherever the processor is.
    ///
    /// # Errors
    /// Returns an error if the emulator has ended.
    pub fn provoke(&mut self, kind: &str, within: &str) -> Result<Provoked> {
        self.ask(&json!({"do": "provoke", "kind": kind, "within": within}))
    }

    /// Interrupts the power (`power-on`, `brown-out`) or pulls the reset pin (`pin`); `keep_memory` says whether memory
    /// keeps its contents.
    ///
    /// # Errors
    /// Returns an error if the emulator has ended.
    pub fn power(&mut self, cause: &str, keep_memory: bool) -> Result<()> {
        let _: Value =
            self.ask(&json!({"do": "power", "cause": cause, "keep_memory": keep_memory}))?;
        Ok(())
    }

    /// Counters and configuration of the chip.
    ///
    /// # Errors
    /// Returns an error if the emulator has ended.
    pub fn look(&mut self) -> Result<Look> {
        self.ask(&json!({"do": "look"}))
    }
}

impl Drop for Chip {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl RawEvent {
    fn parse(self) -> Result<Event> {
        let Self {
            at,
            port,
            sent,
            reset,
        } = self;
        match (port, sent, reset) {
            (Some(port), Some(hex), _) => Ok(Event::Sent {
                at,
                port,
                bytes: bytes_of(&hex)?,
            }),
            (.., Some(cause)) => Ok(Event::Reset { at, cause }),
            _ => Err("the emulator tells of something unknown".into()),
        }
    }
}

fn bytes_of(hex: &str) -> Result<Vec<u8>> {
    let places = (0..hex.len()).step_by(2);
    places
        .map(|place| {
            u8::from_str_radix(hex.get(place..place + 2).unwrap_or_default(), 16)
                .map_err(|error| format!("the emulator sent {hex}: {error}"))
        })
        .collect()
}
