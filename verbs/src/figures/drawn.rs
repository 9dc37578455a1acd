//! A flight estimated and flown, ready to be drawn.

use bodyflight_core::estimator::measurement::Quantity;

use crate::output::bodies::View;
use crate::output::figure::Format;
use crate::output::plot::FLIGHTS;
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

/// Largest number of flights in a figure: each has a colour.
const MOST_FLIGHTS: usize = FLIGHTS.len();
/// Largest number of bodies in a row of snapshots.
const MOST_SNAPSHOTS: usize = 40;

impl Settings {
    /// Checks that so many flights, and the snapshots, fit into figures.
    ///
    /// # Errors
    /// Returns an error that says how many do.
    pub fn check(&self, flights: usize) -> Result<()> {
        let numbers = [
            ("flights in a figure", MOST_FLIGHTS, flights),
            ("snapshots in a row", MOST_SNAPSHOTS, self.snapshots),
        ];
        for (what, most, found) in numbers {
            if !(1..=most).contains(&found) {
                let problem = format!("expected 1 to {most} {what}, found {found}");
                return Err(Problem::bad_input(problem));
            }
        }
        Ok(())
    }
}

/// A flight ready to be drawn.
pub struct Drawn {
    pub(super) name: String,
    pub(super) estimation: Estimation,
    /// Measured and reconstructed channels.
    pub(super) pairs: Vec<Pair>,
    pub(super) series: Series,
    pub(super) shapes: Vec<Shape>,
    /// What the preset measures decides what is shown.
    pub(super) channels: &'static [Channel],
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
    pub(super) fn titled(&self, title: &str) -> String {
        match &self.doubt {
            Some(_) => format!("{title} (doubtful)").trim_start().to_owned(),
            None => title.to_owned(),
        }
    }
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
