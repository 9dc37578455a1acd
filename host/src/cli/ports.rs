//! `bodyflight ports`.

use bodyflight_io::diagnostic::Result;
use bodyflight_unit::ports::{self, Port};

use super::terminal;

/// List the serial ports of this machine.
#[derive(clap::Args)]
#[command(after_help = "Example: bodyflight ports --json")]
pub(super) struct Args {}

pub(super) fn run(_: &Args, json: bool) -> Result<()> {
    let ports = ports::list()?;
    if json {
        return terminal::print_plain_json(&ports);
    }
    if ports.is_empty() {
        terminal::print(
            "no serial ports; plug in the unit or its adapter, and make sure that the cable carries data",
        );
        return Ok(());
    }
    let mut table = terminal::table(&["port", "kind", "USB id", "serial number", "product"]);
    for port in &ports {
        table.add_row(row(port));
    }
    terminal::print(&table.to_string());
    Ok(())
}

fn row(port: &Port) -> [String; 5] {
    let id = match (&port.vendor_id, &port.product_id) {
        (Some(vendor), Some(product)) => format!("{vendor}:{product}"),
        _ => String::new(),
    };
    let names = [&port.manufacturer, &port.product];
    let names: Vec<&str> = names.into_iter().flatten().map(String::as_str).collect();
    [
        port.name.clone(),
        port.kind.to_owned(),
        id,
        port.serial_number.clone().unwrap_or_default(),
        names.join(" "),
    ]
}
