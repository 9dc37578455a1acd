//! `bodyflight figures`.

use std::path::PathBuf;

use bodyflight_estimation::request::Request;
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_replay::flight::{Flight, name_of};
use bodyflight_replay::preset_file::{AUTO, Tuning};
use bodyflight_verbs::figures::{Drawn, Settings, files, write};
use bodyflight_verbs::output::bodies::{FRONT, SIDE, TOP, View};
use bodyflight_verbs::output::figure::Format;
use serde::Serialize;

use super::arguments::{Names, window};
use super::outputs::Outputs;
use super::simulate::Reading;
use super::terminal::FlightBar;
use super::{estimate, terminal};

/// Draw the figures of a paper: reconstruction, inputs, path over ground and snapshots, as SVG, PDF or PNG. Several flights
/// share their axes.
#[derive(clap::Args)]
#[command(
    after_help = "Exit code 5: the recording cannot be trusted, and no figure was drawn; or the estimate cannot, as `bodyflight estimate` \
                  judges it, and the titles say so.\n\nExamples:\n  bodyflight figures flight.toml --format pdf --out figures\n  \
                  bodyflight figures flight.toml --preset turning --from 0.5 --to 1.5\n  \
                  bodyflight figures student expert --format pdf\n\n\
                  Presets and methods as in `bodyflight estimate --help`. Presets of the paper show what they measure."
)]
pub(super) struct Args {
    /// A flight.toml, or an MVNX file on its own; 240 frames a second. Up to five share the axes of each figure.
    #[arg(required = true, value_name = "FLIGHT")]
    flights: Vec<PathBuf>,
    /// A built-in preset or a preset.toml: how the inputs are estimated.
    #[arg(long, default_value = AUTO, value_parser = Names(estimate::presets), hide_possible_values = true)]
    preset: String,
    /// Filter forward in time as on the unit, or smooth the whole flight.
    #[arg(long, value_enum, default_value = "filter")]
    method: estimate::MethodName,
    /// Model inside the filter; by default the full one with "auto", the reduced one with other presets.
    #[arg(long, value_enum)]
    filter: Option<estimate::FilterName>,
    /// Draw from this time on; the whole flight is estimated all the same.
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    from: Option<f64>,
    /// Draw up to this time.
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    to: Option<f64>,
    /// Number of bodies in a row of snapshots.
    #[arg(long, default_value_t = 6)]
    snapshots: usize,
    /// Views of the snapshots, a row for each; separate several by commas. They stay as the body faces at first.
    #[arg(long, value_enum, value_delimiter = ',', default_value = "side")]
    views: Vec<ViewName>,
    /// Format of the figures; separate several by commas.
    #[arg(long, value_enum, value_delimiter = ',', default_value = "svg")]
    format: Vec<FormatName>,
    /// Title of the figures, "" for none; by default the names of the flights.
    #[arg(long)]
    title: Option<String>,
    /// Folder for the figures; created if absent.
    #[arg(long, value_name = "FOLDER", default_value = "figures")]
    out: PathBuf,
    #[command(flatten)]
    outputs: Outputs,
    #[command(flatten)]
    reading: Reading,
}

/// Formats by name.
#[derive(clap::ValueEnum, Clone, Copy)]
pub(super) enum FormatName {
    Svg,
    Pdf,
    Png,
}

impl FormatName {
    pub(super) const fn format(self) -> Format {
        match self {
            Self::Svg => Format::Svg,
            Self::Pdf => Format::Pdf,
            Self::Png => Format::Png,
        }
    }
}

/// Views by name.
#[derive(clap::ValueEnum, Clone, Copy)]
enum ViewName {
    /// From ahead.
    Front,
    /// From the right, facing to the right.
    Side,
    /// From above.
    Top,
}

impl ViewName {
    const fn view(self) -> View {
        match self {
            Self::Front => FRONT,
            Self::Side => SIDE,
            Self::Top => TOP,
        }
    }
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub(super) struct Written {
    figures: Vec<PathBuf>,
}

pub(super) fn run(args: &Args, json: bool) -> Result<()> {
    window(args.from, args.to)?;
    let settings = Settings {
        request: Request {
            tuning: Tuning::find(&args.preset)?,
            method: args.method.method(),
            filter: args.filter.map(estimate::FilterName::filter),
        },
        between: [args.from, args.to],
        snapshots: args.snapshots,
        views: args.views.iter().map(|name| name.view()).collect(),
        formats: args.format.iter().map(|name| name.format()).collect(),
    };
    let number = args.flights.len();
    settings.check(number)?;
    let flights: Vec<Flight> = args
        .flights
        .iter()
        .map(|path| Flight::read(path))
        .collect::<Result<_>>()?;
    let names = files(number, &settings.formats);
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    args.outputs.check_in(&args.out, &names)?;
    let options = args.reading.options();
    let mut drawn = Vec::new();
    for (flight, path) in flights.iter().zip(&args.flights) {
        let bar = FlightBar::of_passes("drawing", flight, 2);
        let done = Drawn::of(flight, name_of(path), &settings, options, &mut |time| {
            bar.at(time);
        });
        bar.end();
        drawn.push(done?);
    }
    let figures = write(&drawn, args.title.as_deref(), &settings, &args.out)?;
    if json {
        terminal::print_json(&Written { figures })?;
    } else {
        for path in figures {
            terminal::print(&format!("written: {}", path.display()));
        }
    }
    let mut doubts = drawn.into_iter().zip(&args.flights);
    match doubts.find_map(|(drawn, path)| Some((drawn.doubt?, path))) {
        None => Ok(()),
        Some((doubt, path)) => Err(Problem::doubt(doubt)
            .in_file(path)
            .help("the figures were written, and their titles say that they are doubtful")),
    }
}
