//! Files that a verb writes, checked before its work starts.

use std::path::{Path, PathBuf};

use bodyflight_core::Body;
use bodyflight_io::destination;
use bodyflight_io::diagnostic::Result;
use bodyflight_mvnx::live::{Kept, LiveRecording};
use bodyflight_verbs::output::figure::{Format, write_figure};

use super::terminal;

use super::several::output_of;

/// Permissions for output files.
#[derive(clap::Args, Clone, Copy)]
pub(super) struct Outputs {
    /// Replace existing output files.
    #[arg(long)]
    force: bool,
}

/// A figure of the results.
#[derive(clap::Args, Clone)]
pub(super) struct Plot {
    /// Plot the results over time, as SVG, PDF or PNG according to the file's extension.
    #[arg(long = "plot", value_name = "FILE")]
    pub(super) path: Option<PathBuf>,
    /// Title of the figure; "" for none.
    #[arg(long = "plot-title", value_name = "TEXT", requires = "path")]
    title: Option<String>,
}

impl Plot {
    /// The plot of one of several flights.
    pub(super) fn of(&self, flight: &Path, flights: &[PathBuf]) -> Result<Self> {
        Ok(Self {
            path: output_of(self.path.as_ref(), flight, flights)?,
            title: self.title.clone(),
        })
    }

    /// The requested title, or else `or`.
    pub(super) fn title(&self, or: impl FnOnce() -> String) -> String {
        self.title.clone().unwrap_or_else(or)
    }

    /// Writes the figure, if one was requested.
    pub(super) fn write(&self, svg: impl FnOnce() -> Result<String>) -> Result<()> {
        self.path
            .as_ref()
            .map_or(Ok(()), |path| write_figure(path, &svg()?))
    }
}

impl Outputs {
    /// Checks the requested files. Call this once all inputs are known, since no input is ever replaced.
    pub(super) fn check<const N: usize>(self, paths: [&Option<PathBuf>; N]) -> Result<()> {
        destination::check(paths.into_iter().flatten(), self.force)
    }

    /// Same as [`Outputs::check`], for a file of this ending.
    pub(super) fn check_as(self, path: Option<&Path>, ending: &str) -> Result<()> {
        // An input that would be lost is what matters most.
        destination::check(path, self.force)?;
        path.map_or(Ok(()), |path| {
            destination::ending(path, &[ending], "a file").map(|_| ())
        })
    }

    /// Same as [`Outputs::check`], for tables in CSV and a figure.
    pub(super) fn check_with<const N: usize>(
        self,
        tables: [&Option<PathBuf>; N],
        plot: &Plot,
    ) -> Result<()> {
        plot.path.as_deref().map(Format::of).transpose()?;
        self.check([&plot.path])?;
        tables
            .into_iter()
            .try_for_each(|path| self.check_as(path.as_deref(), "csv"))
    }

    /// Creates a recording of what is received, if one was requested.
    pub(super) fn live(
        self,
        path: &Option<PathBuf>,
        body: impl FnOnce() -> Body<f64>,
    ) -> Result<Option<LiveRecording>> {
        let path = path.as_deref();
        self.check_as(path, "mvnx")?;
        path.map(|path| LiveRecording::new(path, body()))
            .transpose()
    }

    /// Checks files of these names in a folder, which need not exist yet.
    pub(super) fn check_in(self, folder: &Path, names: &[&str]) -> Result<()> {
        destination::check_in(folder, names, self.force)
    }
}

/// Prints what a recording of received frames contains.
pub(super) fn print_kept(kept: &Kept) {
    terminal::print(&format!(
        "written: {} ({} frames at {} Hz)",
        kept.file.display(),
        kept.frames,
        kept.frame_rate_hz
    ));
    if kept.left_out > 0 {
        terminal::note(&format!(
            "the sender restarted; the {} frames after that belong to another flight and are not in the recording",
            kept.left_out
        ));
    }
}
