//! Figures for papers, in the layout of the paper's validation figures: reconstruction with estimated inputs, the
//! inputs, the path over ground, and snapshots of the body.

mod snapshots;
mod top_view;

use std::path::{Path, PathBuf};

use bodyflight_core::estimator::measurement::Quantity;

use crate::estimate::input_panels;
use crate::output::bodies::View;
use crate::output::figure::{Format, write_figure};
use crate::output::plot::{ESTIMATED, Panel, figure_svg, measured_curve, row_svg, simulated_curve};
use crate::view::run::fly_series;
use crate::view::shape::shapes;
use bodyflight_estimation::Estimation;
use bodyflight_estimation::request::Request;
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_mvnx::recording::Options;
use bodyflight_replay::Precision;
use bodyflight_replay::comparison::Channel;
use bodyflight_replay::flight::Flight;
use bodyflight_replay::input_history::InputHistory;
use bodyflight_replay::preset_file::Tuning;

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
    /// How to estimate the inputs; what the preset measures also decides what is shown.
    pub request: Request,
    /// Times that are drawn (s); the whole flight is estimated all the same.
    pub between: [Option<f64>; 2],
    /// Number of bodies in a row of snapshots.
    pub snapshots: usize,
    /// Views of the snapshots, a row for each.
    pub views: Vec<View>,
    /// Formats in which to write each figure.
    pub formats: Vec<Format>,
}

/// The figures of a flight.
#[derive(Debug, Clone)]
pub struct Written {
    /// Their paths.
    pub figures: Vec<PathBuf>,
    /// Why the estimate that they show should not be trusted; their titles say so too.
    pub doubt: Option<String>,
}

/// Writes reconstruction, inputs, top view and snapshots into `folder`, and returns their paths.
///
/// # Errors
/// Same as [`Request::run`], and an error if the recording is doubtful, nothing happens between the times, or the folder
/// cannot be written to.
pub fn write(
    flight: &Flight,
    title: &str,
    settings: &Settings,
    options: Options,
    folder: &Path,
    progress: &mut dyn FnMut(f64),
) -> Result<Written> {
    for format in &settings.formats {
        format.available()?;
    }
    let tuning = &settings.request.tuning;
    let mut estimation = settings
        .request
        .run(flight, options, Precision::Double, progress)?;
    let doubt = estimation.report.doubt.clone();
    if let Some(doubt) = (doubt.as_ref()).filter(|_| estimation.report.is_recording_doubtful) {
        return Err(Problem::doubt(doubt.clone())
            .help("no figure was drawn; bodyflight inspect says what the recording contains"));
    }
    let flown = with_inputs(flight, tuning, &estimation);
    let [from, to] = settings.between;
    let [from, to] = [
        from.unwrap_or(f64::NEG_INFINITY),
        to.unwrap_or(f64::INFINITY),
    ];
    let shown = from..=to;
    let series = fly_series(&flown, options, progress)?
        .series
        .between(from, to);
    estimation
        .points
        .retain(|point| shown.contains(&point.time));
    if estimation.points.is_empty() || series.rows() == 0 {
        return Err(
            Problem::bad_input("the flight has nothing to draw between --from and --to")
                .in_file(&flight.recording)
                .help("give times within the flight, which bodyflight inspect lists"),
        );
    }
    let title = &match &doubt {
        Some(_) => format!("{title} (doubtful)").trim_start().to_owned(),
        None => title.to_owned(),
    };
    let mut panels = reconstruction(tuning, &estimation);
    for curve in panels.iter_mut().flat_map(|panel| &mut panel.curves) {
        curve.points.retain(|(time, _)| shown.contains(time));
    }
    let figures = [
        (RECONSTRUCTION, figure_svg(title, &panels)?),
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
    Ok(Written {
        figures: written,
        doubt,
    })
}

/// The flight with its known inputs, which take precedence, or the estimated ones.
fn with_inputs(flight: &Flight, tuning: &Tuning, estimation: &Estimation) -> Flight {
    if flight.inputs.is_some() {
        return flight.clone();
    }
    let rows = estimation.points.iter().map(|point| point.inputs);
    Flight {
        inputs: Some(InputHistory::new(rows.collect())),
        muscles: match tuning {
            Tuning::Windows(preset) => preset.muscles,
            Tuning::Motion { .. } => flight.muscles,
        },
        ..flight.clone()
    }
}

/// Measured and reconstructed channels: those that the preset measures, or all that the paper's figures show.
fn reconstruction(tuning: &Tuning, estimation: &Estimation) -> Vec<Panel> {
    use Channel::{HorizontalVelocity, Pitch, Roll, YawRate};
    let channels: &[Channel] = match tuning {
        Tuning::Motion { .. } => &[HorizontalVelocity, YawRate, Pitch, Roll],
        Tuning::Windows(preset)
            if (preset.measurement.quantities()).any(|q| q == Quantity::YawRate) =>
        {
            &[YawRate, Pitch, Roll]
        }
        Tuning::Windows(_) => &[HorizontalVelocity, Pitch, Roll],
    };
    let panel = |&channel: &Channel| {
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
    };
    channels.iter().map(panel).collect()
}
