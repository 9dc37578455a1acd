//! Serial ports of this machine.

use std::fmt::Write as _;
use std::io;
use std::path::Path;
use std::time::Duration;

use serde::Serialize;
use serialport::{ErrorKind, SerialPort, SerialPortInfo, SerialPortType};

use bodyflight_io::diagnostic::{Problem, Result};

/// Longest time that a read from an open port waits.
pub const READ_TIMEOUT: Duration = Duration::from_millis(100);
/// Where Linux lists its terminals; if it is missing there are no ports, as in some containers.
#[cfg(target_os = "linux")]
const TERMINALS: &str = "/sys/class/tty";

/// A serial port.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Port {
    /// Name to open it with.
    pub name: String,
    /// `usb`, `pci`, `bluetooth` or `unknown`.
    pub kind: &'static str,
    /// USB vendor ID, four hexadecimal digits.
    pub vendor_id: Option<String>,
    /// USB product ID, four hexadecimal digits.
    pub product_id: Option<String>,
    /// Serial number of the device.
    pub serial_number: Option<String>,
    /// Manufacturer of the device.
    pub manufacturer: Option<String>,
    /// Product name reported by the device.
    pub product: Option<String>,
}

impl From<SerialPortInfo> for Port {
    fn from(info: SerialPortInfo) -> Self {
        let (kind, usb) = match info.port_type {
            SerialPortType::UsbPort(usb) => ("usb", Some(usb)),
            SerialPortType::PciPort => ("pci", None),
            SerialPortType::BluetoothPort => ("bluetooth", None),
            SerialPortType::Unknown => ("unknown", None),
        };
        let number = |number: u16| format!("{number:04x}");
        Self {
            name: info.port_name,
            kind,
            vendor_id: usb.as_ref().map(|usb| number(usb.vid)),
            product_id: usb.as_ref().map(|usb| number(usb.pid)),
            serial_number: usb.as_ref().and_then(|usb| usb.serial_number.clone()),
            manufacturer: usb.as_ref().and_then(|usb| usb.manufacturer.clone()),
            product: usb.and_then(|usb| usb.product),
        }
    }
}

/// All serial ports, sorted by name.
///
/// # Errors
/// Returns an error if the system cannot list them.
pub fn list() -> Result<Vec<Port>> {
    // The crate assumes that the folder exists.
    #[cfg(target_os = "linux")]
    if !Path::new(TERMINALS).is_dir() {
        return Ok(Vec::new());
    }
    let found = serialport::available_ports()
        .map_err(|error| Problem::refused("cannot list the serial ports").caused_by(error))?;
    let mut ports: Vec<Port> = found.into_iter().map(Port::from).collect();
    ports.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(ports)
}

/// Opens a port with 8 data bits, no parity and 1 stop bit; reads wait for at most [`READ_TIMEOUT`].
///
/// # Errors
/// Returns an error if the port does not exist, is in use, or access is denied.
pub fn open(name: &str, baud: u32) -> Result<Box<dyn SerialPort>> {
    serialport::new(name, baud)
        .timeout(READ_TIMEOUT)
        .open()
        .map_err(|error| refused(name, baud, error))
}

fn refused(name: &str, baud: u32, error: serialport::Error) -> Problem {
    let help = match error.kind() {
        ErrorKind::NoDevice | ErrorKind::Io(io::ErrorKind::NotFound) => {
            let mut help = "run `bodyflight ports` to list the serial ports".to_owned();
            let names: Vec<String> = list()
                .unwrap_or_default()
                .into_iter()
                .map(|port| port.name)
                .collect();
            if !names.is_empty() {
                // Writing to a string does not fail.
                let _ = write!(help, "; now: {}", names.join(", "));
            }
            help
        }
        ErrorKind::Io(io::ErrorKind::PermissionDenied) => {
            "your user has no access to it: on Linux join its group (often dialout) and log in again"
                .into()
        }
        ErrorKind::InvalidInput => format!("the port may not support {baud} baud: try another --baud"),
        _ => "it may be in use by another program".into(),
    };
    Problem::refused("cannot open the serial port")
        .in_file(Path::new(name))
        .help(help)
        .caused_by(error)
}

#[cfg(test)]
mod tests {
    use super::*;
    use bodyflight_io::diagnostic::Kind;
    use serialport::UsbPortInfo;

    #[test]
    fn usb_numbers_have_four_digits() {
        let port = Port::from(SerialPortInfo {
            port_name: "/dev/ttyACM0".into(),
            port_type: SerialPortType::UsbPort(UsbPortInfo {
                vid: 0x0483,
                pid: 0x374e,
                serial_number: Some("0670FF".into()),
                manufacturer: None,
                product: Some("STLINK-V3".into()),
            }),
        });
        assert_eq!(port.kind, "usb");
        assert_eq!(port.vendor_id.as_deref(), Some("0483"));
        assert_eq!(port.product_id.as_deref(), Some("374e"));
        assert_eq!(port.product.as_deref(), Some("STLINK-V3"));
        let plain = Port::from(SerialPortInfo {
            port_name: "COM1".into(),
            port_type: SerialPortType::PciPort,
        });
        assert_eq!((plain.kind, plain.vendor_id), ("pci", None));
    }

    #[test]
    fn a_missing_port_is_named() {
        let Err(problem) = open("/dev/no-such-port", 115_200) else {
            panic!("opened")
        };
        assert_eq!(problem.kind, Kind::System);
        assert!(problem.to_string().contains("/dev/no-such-port"));
        assert!(
            problem
                .help
                .unwrap_or_default()
                .contains("bodyflight ports")
        );
        assert!(list().is_ok());
    }
}
