//! `bodyflight ports`.

use bodyflight::diagnostic::{Kind, Problem, Result};
use serde::Serialize;
use serialport::SerialPortType;

use super::terminal;

/// List the serial ports of this machine.
#[derive(clap::Args)]
#[command(after_help = "Example: bodyflight ports --json")]
pub(super) struct Args {}

#[derive(Serialize)]
struct Port {
    name: String,
    kind: &'static str,
    vid: Option<u16>,
    pid: Option<u16>,
    serial_number: Option<String>,
    product: Option<String>,
}

pub(super) fn run(_: &Args, json: bool) -> Result<()> {
    let found = serialport::available_ports().map_err(|error| Problem {
        kind: Kind::System,
        ..Problem::bad_input(format!("cannot list the serial ports: {error}"))
    })?;
    let ports: Vec<Port> = found.into_iter().map(port).collect();
    if json {
        return terminal::print_json(&ports);
    }
    if ports.is_empty() {
        terminal::print("no serial ports; a unit without hardware: bodyflight stream … --virtual");
        return Ok(());
    }
    let mut table = terminal::table(&["port", "kind", "vid:pid", "serial number", "product"]);
    for port in ports {
        let ids = match (port.vid, port.pid) {
            (Some(vid), Some(pid)) => format!("{vid:04x}:{pid:04x}"),
            _ => String::new(),
        };
        let [serial, product] = [port.serial_number, port.product].map(Option::unwrap_or_default);
        table.add_row([port.name, port.kind.to_owned(), ids, serial, product]);
    }
    terminal::print(&table.to_string());
    Ok(())
}

fn port(found: serialport::SerialPortInfo) -> Port {
    let mut port = Port {
        name: found.port_name,
        kind: "unknown",
        vid: None,
        pid: None,
        serial_number: None,
        product: None,
    };
    match found.port_type {
        SerialPortType::UsbPort(usb) => {
            port.kind = "usb";
            port.vid = Some(usb.vid);
            port.pid = Some(usb.pid);
            port.serial_number = usb.serial_number;
            port.product = usb.product;
        }
        SerialPortType::PciPort => port.kind = "pci",
        SerialPortType::BluetoothPort => port.kind = "bluetooth",
        SerialPortType::Unknown => {}
    }
    port
}
