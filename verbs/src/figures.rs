//! Figures for papers, in the layout of the paper's validation figures: reconstruction with estimated inputs, the
//! inputs, the path over ground, and snapshots of the body.

mod snapshots;
mod top_view;

use std::path::{Path, PathBuf};

use bodyflight_core::estimator::preset::Preset;

use crate::estimate::input_panels;
use crate::output::bodies::View;
use crate::output::figure::{Format, write_figure};
use crate::output::plot::{ESTIMATED, Panel, figure_svg, measured_curve, row_svg, simulated_curve};
use crate::view::run::fly_series;
use crate::view::shape::shapes;
use bodyflight_estimation::windows::estimate;
use bodyflight_estimation::{Estimation, Filter};
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_mvnx::recording::Options;
use bodyflight_replay::Precision;
use bodyflight_replay::comparison::Channel;
use bodyflight_replay::flight::Flight;
use bodyflight_replay::input_history::InputHistory;

const RECONSTRUCTION: &str = "reconstruction";
const INPUTS: &str = "inputs";
const TOP_VIEW: &str = "top-view";
const SNAPSHOTS: &str = "snapshots";

/// File names of the figures in these formats.
pub fn files(formats: &[Format]) -> Vec<String> {
    let file = |name: &str, format: &Format| format!("{name}.{}", format.extension());
    [RECONSTRUCTION, INPUTS, TOP_VIEW, SNAPSHOTS]
        .into_iter()
        .flat_map(|name| formats.iter().map(move |format| file(name, format)))
        .collect()
}

/// How to draw a flight.
#[derive(Debug, Clone)]
pub struct Settings {
    /// Preset of the filter; what it measures also decides what is shown.
    pub preset: &'static Preset,
    /// The filter to use.
    pub filter: Filter,
    /// Number of bodies in a row of snapshots.
    pub snapshots: usize,
    /// Views of the snapshots, a row for each.
    pub views: Vec<View>,
    /// Formats in which to write each figure.
    pub formats: Vec<Format>,
}

/// Writes reconstruction, inputs, top view and snapshots into `folder`, and returns their paths.
///
/// # Errors
/// Same as [`estimate`], and an error if the recording is doubtful or the folder cannot be written to.
pub fn write(
    flight: &Flight,
    title: &str,
    settings: &Settings,
    options: Options,
    folder: &Path,
    progress: &mut dyn FnMut(f64),
) -> Result<Vec<PathBuf>> {
    for format in &settings.formats {
        format.available()?;
    }
    let preset = settings.preset;
    let estimation = estimate(
        flight,
        preset,
        settings.filter,
        options,
        Precision::Double,
        progress,
    )?;
    if let Some(doubt) =
        (estimation.report.doubt.as_ref()).filter(|_| estimation.report.is_recording_doubtful)
    {
        return Err(Problem::doubt(doubt.clone())
            .help("no figure was drawn; bodyflight inspect says what the recording contains"));
    }
    let rows = estimation.points.iter().map(|point| point.inputs);
    // Known inputs take precedence over estimated ones.
    let flown = match &flight.inputs {
        Some(_) => flight.clone(),
        None => Flight {
            inputs: Some(InputHistory::new(rows.collect())),
            muscles: preset.muscles,
            ..flight.clone()
        },
    };
    let series = fly_series(&flown, options, progress)?.series;
    let figures = [
        (RECONSTRUCTION, reconstruction(title, preset, &estimation)?),
        (INPUTS, row_svg(title, &input_panels(&estimation))?),
        (TOP_VIEW, top_view::svg(title, &series)?),
        (
            SNAPSHOTS,
            snapshots::svg(
                title,
                &shapes(&flight.subject),
                &series,
                settings.snapshots,
                &settings.views,
            ),
        ),
    ];
    std::fs::create_dir_all(folder).map_err(|error| Problem::system("create", folder, error))?;
    let mut written = Vec::new();
    for (name, svg) in figures {
        for format in &settings.formats {
            let path = folder.join(name).with_extension(format.extension());
            write_figure(&path, &svg)?;
            written.push(path);
        }
    }
    Ok(written)
}

/// Measured and reconstructed channels, those that suit the preset.
fn reconstruction(title: &str, preset: &Preset, estimation: &Estimation) -> Result<String> {
    let turning = preset.name.contains("turn");
    let channels = if turning {
        [Channel::YawRate, Channel::Pitch, Channel::Roll]
    } else {
        [Channel::HorizontalVelocity, Channel::Pitch, Channel::Roll]
    };
    let panels = channels.map(|channel| {
        let ((label, _), (unit, factor)) = (channel.label(), channel.drawn());
        let gap = factor * estimation.report.rms.get(channel);
        Panel {
            caption: format!("{label} ({unit}): RMS gap {gap:.2}"),
            curves: vec![
                measured_curve(channel, estimation.estimated.series()),
                simulated_curve(channel, estimation.estimated.series(), ESTIMATED),
            ],
            bands: Vec::new(),
            wraps: channel.is_angle(),
        }
    });
    figure_svg(title, &panels)
}
