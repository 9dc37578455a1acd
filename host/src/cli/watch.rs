//! A page that shows a live stream.

use std::path::{Path, PathBuf};

use bodyflight_io::diagnostic::Result;
use bodyflight_replay::flight::Flight;
use bodyflight_verbs::view::live::LiveView;
use bodyflight_verbs::view::page::Provenance;

use super::several::file_of;
use super::terminal;
use super::view::{command, open};

/// Whether to show a page.
#[derive(clap::Args, Clone, Copy)]
pub(super) struct Watch {
    /// Show the live stream in a browser on this machine, with a simulated body beside the measured one.
    #[arg(long)]
    view: bool,
    /// Open that page in a browser.
    #[arg(long, requires = "view")]
    open: bool,
}

impl Watch {
    /// Opens the page of a flight's stream, if requested, and waits until a browser shows it.
    pub(super) fn begin(self, flight: &Flight, file: Option<&PathBuf>) -> Result<Option<LiveView>> {
        if !self.view {
            return Ok(None);
        }
        let name = file.and_then(|path| path.file_name());
        let title = name.map_or_else(
            || "MVN".to_owned(),
            |name| name.to_string_lossy().into_owned(),
        );
        let files: Vec<PathBuf> = file.map(|path| file_of(path)).into_iter().collect();
        let files: Vec<&Path> = files.iter().map(PathBuf::as_path).collect();
        let view = LiveView::start(flight, title, Provenance::of(command(), &files)?)?;
        terminal::note(&format!(
            "live at {} (the stream waits for the page)",
            view.url()
        ));
        terminal::note_assumed_subject(flight);
        let doorway = self.open.then(|| view.doorway()).transpose()?;
        if let Some(doorway) = &doorway {
            open(doorway.path());
        }
        view.await_page()?;
        Ok(Some(view))
    }
}
