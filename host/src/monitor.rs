//! What comes from a port, read by a person: the unit's logs, a sensor's packets.

pub mod defmt;
pub mod xbus;

use std::fs::File;
use std::io::{ErrorKind, Read};
use std::os::unix::fs::FileTypeExt;
use std::path::Path;
use std::time::Duration;

use serialport::{SerialPort, TTYPort};

use crate::diagnostic::{Kind, Problem, Result};
use crate::interrupt;

/// Opens a serial port at `baud`, a file, or standard input for `-`.
///
/// # Errors
/// Where there is none.
pub fn open(path: &Path, baud: u32) -> Result<Box<dyn Read>> {
    if path == Path::new("-") {
        return Ok(Box::new(std::io::stdin()));
    }
    let metadata =
        std::fs::metadata(path).map_err(|error| Problem::system("open", path, &error))?;
    if !metadata.file_type().is_char_device() {
        let file = File::open(path).map_err(|error| Problem::system("open", path, &error))?;
        return Ok(Box::new(file));
    }
    let refused = |error: serialport::Error| {
        Problem {
            kind: Kind::System,
            ..Problem::bad_input(format!("cannot open the port: {error}"))
        }
        .in_file(path)
        .help("list what is there: bodyflight ports")
    };
    let mut port =
        TTYPort::open(&serialport::new(path.to_string_lossy(), baud)).map_err(refused)?;
    port.set_timeout(Duration::from_millis(100))
        .map_err(refused)?;
    Ok(Box::new(port))
}

/// Gives bytes to `take` as they come, until the end of a file or Ctrl-C.
///
/// # Errors
/// Where reading fails, or `take` does.
pub fn follow(
    path: &Path,
    mut input: impl Read,
    mut take: impl FnMut(&[u8]) -> Result<()>,
) -> Result<()> {
    let mut bytes = [0; 4096];
    while interrupt::check().is_ok() {
        match input.read(&mut bytes) {
            Ok(0) => break,
            Ok(count) => take(&bytes[..count])?,
            Err(error) if matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::Interrupted) => {}
            Err(error) => return Err(Problem::system("read", path, &error)),
        }
    }
    Ok(())
}
