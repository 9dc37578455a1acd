//! Files that a verb writes, looked at before its work.

use std::path::{Path, PathBuf};

use bodyflight::diagnostic::Result;
use bodyflight::formats::mvnx::live::{Kept, LiveRecording};
use bodyflight::output::destination;
use bodyflight::output::figure::{Format, write_figure};
use bodyflight_core::Body;

use super::terminal;

use super::several::output_of;

/// What is allowed to outputs.
#[derive(clap::Args, Clone, Copy)]
pub(super) struct Outputs {
    /// Replace output files that exist.
    #[arg(long)]
    force: bool,
}

/// A figure of what was found.
#[derive(clap::Args, Clone)]
pub(super) struct Plot {
    /// Draw the results over time, as SVG, PDF or PNG by the end of the file's name.
    #[arg(long = "plot", value_name = "FILE")]
    pub(super) path: Option<PathBuf>,
    /// Title of the figure; "" for none.
    #[arg(long = "plot-title", value_name = "TEXT", requires = "path")]
    title: Option<String>,
}

impl Plot {
    /// Of one of several flights.
    pub(super) fn of(&self, flight: &Path, flights: &[PathBuf]) -> Result<Self> {
        Ok(Self {
            path: output_of(self.path.as_ref(), flight, flights)?,
            title: self.title.clone(),
        })
    }

    /// The title that was asked for, or another.
    pub(super) fn title(&self, or: impl FnOnce() -> String) -> String {
        self.title.clone().unwrap_or_else(or)
    }

    /// Writes the figure, where one was asked for.
    pub(super) fn write(&self, svg: impl FnOnce() -> Result<String>) -> Result<()> {
        self.path
            .as_ref()
            .map_or(Ok(()), |path| write_figure(path, &svg()?))
    }
}

impl Outputs {
    /// Checks files, those that were asked for. To be called when all inputs are known: none of them is replaced.
    pub(super) fn check<const N: usize>(self, paths: [&Option<PathBuf>; N]) -> Result<()> {
        destination::check(paths.into_iter().flatten(), self.force)
    }

    /// As [`Outputs::check`], with a figure beside them.
    pub(super) fn check_with<const N: usize>(
        self,
        paths: [&Option<PathBuf>; N],
        plot: &Plot,
    ) -> Result<()> {
        plot.path.as_deref().map(Format::of).transpose()?;
        self.check([&plot.path])?;
        self.check(paths)
    }

    /// A recording of what is received, where one was asked for.
    pub(super) fn live(
        self,
        path: &Option<PathBuf>,
        body: impl FnOnce() -> Body<f64>,
    ) -> Result<Option<LiveRecording>> {
        self.check([path])?;
        let path = path.as_deref();
        path.map(|path| LiveRecording::new(path, body()))
            .transpose()
    }

    /// Checks files of these names in a folder, which may not be there yet.
    pub(super) fn check_in(self, folder: &Path, names: &[&str]) -> Result<()> {
        destination::check_in(folder, names, self.force)
    }
}

/// Says what is in a recording of what was received.
pub(super) fn print_kept(kept: &Kept) {
    terminal::print(&format!(
        "written: {} ({} frames at {} Hz)",
        kept.file.display(),
        kept.frames,
        kept.frame_rate_hz
    ));
    if kept.left_out > 0 {
        terminal::note(&format!(
            "the sender began anew; {} frames after that are another flight and not in the recording",
            kept.left_out
        ));
    }
}
