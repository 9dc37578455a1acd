//! Connections to a unit: a serial port, QEMU, or a unit in this process.

use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

use serialport::{SerialPort, TTYPort};

use super::qemu::Qemu;
use crate::virtual_unit::VirtualUnit;
use bodyflight_io::diagnostic::{Problem, Result};

/// Default rate of a serial line (baud): 240 samples a second use 70 % of it.
pub const DEFAULT_BAUD: u32 = 460_800;

/// Where the unit is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Target {
    /// Path of its device.
    Port {
        /// Its device.
        path: PathBuf,
        /// Its rate (baud).
        baud: u32,
    },
    /// In QEMU, running this image.
    Qemu(PathBuf),
    /// In this process.
    Virtual,
}

/// An open line to a unit.
pub struct Connection {
    /// From the unit; reads fail with `TimedOut` from time to time if nothing arrives.
    pub reader: Box<dyn Read + Send>,
    /// To the unit.
    pub writer: Box<dyn Write + Send>,
    /// The machine behind the line, if this program started it.
    pub machine: Machine,
}

/// A machine that lives as long as its connection.
pub enum Machine {
    /// Not started by this program.
    Foreign,
    /// QEMU, with the unit's logs.
    Qemu(Qemu),
    /// Threads of this process.
    Virtual(VirtualUnit),
}

/// Longest time that a read waits before it checks whether the stream has ended.
const READ_TIMEOUT: Duration = Duration::from_millis(50);

impl Connection {
    /// Opens the line, and starts the machine if it is ours.
    ///
    /// # Errors
    /// Returns an error if the port does not exist, or the machine does not start.
    pub fn open(target: &Target) -> Result<Self> {
        match target {
            Target::Port { path, baud } => Self::port(path, *baud, Machine::Foreign),
            Target::Virtual => {
                let unit = VirtualUnit::start()?;
                let path = unit.path().to_path_buf();
                Self::port(&path, DEFAULT_BAUD, Machine::Virtual(unit))
            }
            Target::Qemu(image) => {
                let (qemu, line) = Qemu::start(image)?;
                let system = |error| Problem::system("open", image, error);
                line.set_read_timeout(Some(READ_TIMEOUT)).map_err(system)?;
                Ok(Self {
                    reader: Box::new(line.try_clone().map_err(system)?),
                    writer: Box::new(line),
                    machine: Machine::Qemu(qemu),
                })
            }
        }
    }

    fn port(path: &Path, baud: u32, machine: Machine) -> Result<Self> {
        let refused = |error: serialport::Error| {
            Problem::refused("cannot open the port")
                .in_file(path)
                .help("run `bodyflight ports` to list the ports; on Linux your user must be in the group dialout")
                .caused_by(error)
        };
        let mut port =
            TTYPort::open(&serialport::new(path.to_string_lossy(), baud)).map_err(refused)?;
        port.set_timeout(READ_TIMEOUT).map_err(refused)?;
        // Boards with USB send only while a terminal is connected; pseudo-terminals do not have this signal.
        let _ = port.write_data_terminal_ready(true);
        let mut writer = port.try_clone_native().map_err(refused)?;
        writer
            .set_timeout(Duration::from_secs(2))
            .map_err(refused)?;
        Ok(Self {
            reader: Box::new(port),
            writer: Box::new(writer),
            machine,
        })
    }
}
