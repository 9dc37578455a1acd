//! Arguments of `bodyflight discover`.

use std::path::{Path, PathBuf};

use crate::cli::outputs::Outputs;
use crate::cli::simulate::Reading;

/// Find where simulation and measurement disagree, name the missing effect, and show how much of the gap it closes.
#[derive(clap::Args)]
#[command(
    after_help = "Verdicts: none (model and data agree without any change), calibrated (they agree once joints, subject and \
                  coefficients are adjusted within their tolerances), named (an effect is missing), described (a load that \
                  is not in the library), unexplained (neither), thin (too short to tell). docs/discovery.md says how often each is \
                  right.\n\n\
                  Example: bodyflight discover turn-1 --hold-out turn-2 --out what-is-missing\n\n\
                  Without recordings of your own: bodyflight hide wind --out lab makes flights to try it on."
)]
pub(in crate::cli) struct Args {
    /// A flight.toml, or an MVNX file on its own. Several flights of one person are fitted together.
    #[arg(required = true)]
    pub(super) flights: Vec<PathBuf>,
    /// Flights left out of the fit, which judge what is found in the others.
    #[arg(long, value_name = "FLIGHT", num_args = 1..)]
    pub(super) hold_out: Vec<PathBuf>,
    /// Name at most this many effects.
    #[arg(long, default_value_t = 3)]
    pub(super) max_effects: usize,
    /// Folder for report.json, report.svg and model.toml; created if absent.
    #[arg(long)]
    pub(super) out: Option<PathBuf>,
    /// Also print the errors found, the adjustments, and what to fly next.
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
