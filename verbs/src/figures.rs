//! Figures for papers, in the layout of the paper's validation figures: reconstruction with estimated inputs, the
//! inputs, the path over ground, and snapshots of the body. Several flights share their axes.

mod drawn;
mod snapshots;
mod together;
mod top_view;

use std::path::{Path, PathBuf};

use crate::estimate::{input_panels, shades};
use crate::output::figure::{Format, write_figure};
use crate::output::plot::{
    ESTIMATED, MEASURED, Panel, SIMULATED, figure_svg, measured_curve, row_svg, simulated_curve,
};
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_replay::comparison::Channel;
pub use drawn::{Drawn, Settings};

/// Names of the figures that flights share.
const SHARED: [&str; 3] = ["reconstruction", "inputs", "top-view"];
const SNAPSHOTS: &str = "snapshots";

/// File names of the figures of so many flights in these formats.
pub fn files(flights: usize, formats: &[Format]) -> Vec<String> {
    let names = SHARED.map(str::to_owned);
    let names = names.into_iter().chain(snapshots_of(flights));
    let file = |name: &str, format: &Format| format!("{name}.{}", format.extension());
    names
        .flat_map(|name| formats.iter().map(move |format| file(&name, format)))
        .collect()
}

/// Names of the snapshots of so many flights.
fn snapshots_of(flights: usize) -> impl Iterator<Item = String> {
    let letters = together::LETTERS.iter().take(flights);
    letters.map(move |letter| match flights {
        1 => SNAPSHOTS.to_owned(),
        _ => format!("{SNAPSHOTS}-{letter}"),
    })
}

/// Writes reconstruction, inputs, top view and snapshots into `folder`, and returns their paths. Several flights share the
/// axes of each figure, except for the snapshots, which have a figure for each. `title` replaces the names of the flights.
///
/// # Errors
/// Returns an error if the folder cannot be written to.
pub fn write(
    flights: &[Drawn],
    title: Option<&str>,
    settings: &Settings,
    folder: &Path,
) -> Result<Vec<PathBuf>> {
    let shared = match flights {
        [flight] => alone(flight, &flight.titled(title.unwrap_or(&flight.name)))?,
        several => together::figures(several, title)?,
    };
    let mut figures: Vec<(String, String)> =
        SHARED.map(str::to_owned).into_iter().zip(shared).collect();
    for (name, flight) in snapshots_of(flights.len()).zip(flights) {
        let title = flight.titled(title.unwrap_or(&flight.name));
        let (shapes, series) = (&flight.shapes, &flight.series);
        let svg = snapshots::svg(&title, shapes, series, settings.snapshots, &settings.views);
        figures.push((name, svg));
    }
    std::fs::create_dir_all(folder).map_err(|error| Problem::system("create", folder, error))?;
    let mut written = Vec::new();
    for (name, svg) in figures {
        for format in &settings.formats {
            let path = folder.join(&name).with_extension(format.extension());
            write_figure(&path, &svg)?;
            written.push(path);
        }
    }
    Ok(written)
}

/// Reconstruction, inputs and top view of one flight, with the times shaded in which it is not trusted.
fn alone(flight: &Drawn, title: &str) -> Result<[String; 3]> {
    let estimation = &flight.estimation;
    let shades = shades(&estimation.points);
    let panel = |&channel: &Channel| {
        let (label, (unit, factor)) = (channel.titled(), channel.drawn());
        let gap = factor * estimation.report.rms.get(channel);
        Panel {
            caption: format!("{label} ({unit}): RMS gap {gap:.2}"),
            curves: vec![
                measured_curve(channel, &flight.pairs),
                simulated_curve(channel, &flight.pairs, ESTIMATED),
            ],
            bands: Vec::new(),
            shades: shades.clone(),
            wraps: channel.is_angle(),
        }
    };
    let panels: Vec<Panel> = flight.channels.iter().map(panel).collect();
    let paths = [([MEASURED, SIMULATED], &flight.series)];
    Ok([
        figure_svg(title, &panels)?,
        row_svg(title, &input_panels(estimation))?,
        top_view::svg(title, &paths)?,
    ])
}
