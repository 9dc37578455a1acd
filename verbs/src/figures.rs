//! Figures for papers, in the layout of the paper's validation figures: reconstruction with estimated inputs, the
//! inputs, the path over ground, and snapshots of the body. Several flights share their axes.

mod snapshots;
mod together;
mod top_view;

use std::path::{Path, PathBuf};

use bodyflight_core::estimator::measurement::Quantity;

use crate::estimate::{input_panels, shades};
use crate::output::bodies::View;
use crate::output::figure::{Format, write_figure};
use crate::output::plot::{
    ESTIMATED, MEASURED, Panel, SIMULATED, figure_svg, measured_curve, row_svg, simulated_curve,
};
use crate::view::run::fly_series;
use crate::view::series::Series;
use crate::view::shape::{Shape, shapes};
use bodyflight_estimation::Estimation;
use bodyflight_estimation::request::Request;
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_mvnx::recording::Options;
use bodyflight_replay::Precision;
use bodyflight_replay::comparison::{Channel, Pair};
use bodyflight_replay::flight::Flight;
use bodyflight_replay::input_history::InputHistory;
use bodyflight_replay::preset_file::Tuning;

const RECONSTRUCTION: &str = "reconstruction";
const INPUTS: &str = "inputs";
const TOP_VIEW: &str = "top-view";
const SNAPSHOTS: &str = "snapshots";

/// Largest number of flights in a figure.
pub const MOST: usize = together::LETTERS.len();

/// File names of the figures of so many flights in these formats.
pub fn files(flights: usize, formats: &[Format]) -> Vec<String> {
    let names = [RECONSTRUCTION, INPUTS, TOP_VIEW].map(str::to_owned);
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

/// A flight ready to be drawn.
pub struct Drawn {
    name: String,
    estimation: Estimation,
    /// Measured and reconstructed channels.
    pairs: Vec<Pair>,
    series: Series,
    shapes: Vec<Shape>,
    /// What the preset measures decides what is shown.
    channels: &'static [Channel],
    /// Why the estimate should not be trusted; titles say so too.
    pub doubt: Option<String>,
}

impl Drawn {
    /// Estimates and flies a flight, and keeps the times that are drawn.
    ///
    /// # Errors
    /// Same as [`Request::run`], and an error if the recording is doubtful, a format was not built in, or nothing happens
    /// between the times.
    pub fn of(
        flight: &Flight,
        name: String,
        settings: &Settings,
        options: Options,
        progress: &mut dyn FnMut(f64),
    ) -> Result<Self> {
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
        let pairs = estimation.estimated.series().iter().copied();
        let pairs = pairs.filter(|pair| shown.contains(&pair.time)).collect();
        if estimation.points.is_empty() || series.rows() == 0 {
            return Err(Problem::bad_input(
                "the flight has nothing to draw between --from and --to",
            )
            .in_file(&flight.recording)
            .help("give times within the flight, which bodyflight inspect lists"));
        }
        Ok(Self {
            name,
            estimation,
            pairs,
            series,
            shapes: shapes(&flight.subject),
            channels: channels(tuning),
            doubt,
        })
    }

    /// The title of one flight.
    fn titled(&self, title: &str) -> String {
        match &self.doubt {
            Some(_) => format!("{title} (doubtful)").trim_start().to_owned(),
            None => title.to_owned(),
        }
    }

    /// Bodies at regular times.
    fn snapshots(&self, title: &str, settings: &Settings) -> String {
        let (shapes, series) = (&self.shapes, &self.series);
        snapshots::svg(title, shapes, series, settings.snapshots, &settings.views)
    }
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
    let mut figures = match flights {
        [flight] => alone(flight, &flight.titled(title.unwrap_or(&flight.name)))?,
        several => together::figures(several, title)?,
    };
    for (name, flight) in snapshots_of(flights.len()).zip(flights) {
        let title = flight.titled(title.unwrap_or(&flight.name));
        figures.push((name, flight.snapshots(&title, settings)));
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
fn alone(flight: &Drawn, title: &str) -> Result<Vec<(String, String)>> {
    let estimation = &flight.estimation;
    let shades = shades(&estimation.points);
    let panel = |&channel: &Channel| {
        let ((label, _), (unit, factor)) = (channel.label(), channel.drawn());
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
    Ok(vec![
        (RECONSTRUCTION.to_owned(), figure_svg(title, &panels)?),
        (
            INPUTS.to_owned(),
            row_svg(title, &input_panels(estimation))?,
        ),
        (TOP_VIEW.to_owned(), top_view::svg(title, &paths)?),
    ])
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

/// The channels that the preset measures, or all that the paper's figures show.
fn channels(tuning: &Tuning) -> &'static [Channel] {
    use Channel::{HorizontalVelocity, Pitch, Roll, YawRate};
    match tuning {
        Tuning::Motion { .. } => &[HorizontalVelocity, YawRate, Pitch, Roll],
        Tuning::Windows(preset)
            if (preset.measurement.quantities()).any(|q| q == Quantity::YawRate) =>
        {
            &[YawRate, Pitch, Roll]
        }
        Tuning::Windows(_) => &[HorizontalVelocity, Pitch, Roll],
    }
}
