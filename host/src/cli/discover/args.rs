//! Arguments of `bodyflight discover`.

use std::path::{Path, PathBuf};

use crate::cli::outputs::Outputs;
use crate::cli::simulate::Reading;

/// Find where simulation and measurement disagree, name the effect that is missing, and show how the gap shrinks.
#[derive(clap::Args)]
#[command(
    after_help = "Verdicts: none (model and data agree as the files are), calibrated (they agree once joints, subject and \
                  coefficients are adjusted within their tolerances), named (an effect is missing), described (a load that \
                  is not in the library), unexplained (neither), thin (too short to tell). docs/discovery.md says how often each is \
                  right.\n\n\
                  Example: bodyflight discover turn-1 --hold-out turn-2 --out what-is-missing\n\n\
                  Without recordings of your own: bodyflight hide wind --out lab makes flights to try it on."
)]
pub(in crate::cli) struct Args {
    /// A flight.toml, an MVNX file alone, or a FlySight's CSV file, of which density, wind and drag area are judged.
    /// Several of one person are fitted together.
    #[arg(required = true)]
    pub(super) flights: Vec<PathBuf>,
    /// Other flights, which effects are not fitted to but have to help in.
    #[arg(long, value_name = "FLIGHT", num_args = 1..)]
    pub(super) hold_out: Vec<PathBuf>,
    /// Largest number of effects to name.
    #[arg(long, default_value_t = 3)]
    pub(super) max_effects: usize,
    /// Seed of the flights that are drawn for comparison.
    #[arg(long, default_value_t = 1)]
    pub(super) seed: u64,
    /// Folder for report.json, report.svg and model.toml; made where absent.
    #[arg(long)]
    pub(super) out: Option<PathBuf>,
    /// End with the errors found, what they adjust, and what to fly next.
    #[arg(long)]
    pub(super) explain: bool,
    #[command(flatten)]
    pub(super) outputs: Outputs,
    #[command(flatten)]
    pub(super) reading: Reading,
}

impl Args {
    /// The first flight.
    pub(super) fn flight(&self) -> &Path {
        self.flights.first().map_or(Path::new(""), PathBuf::as_path)
    }
}
