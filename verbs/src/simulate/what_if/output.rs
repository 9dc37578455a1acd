//! Both runs of a changed flight as a table and as a figure.

use std::path::Path;

use bodyflight_core::observation::Observation;
use bodyflight_io::diagnostic::Result;
use bodyflight_io::files::CsvFile;
use bodyflight_replay::comparison::Channel;
use bodyflight_replay::steps::Step;

use super::Simulation;
use crate::output::plot::{CHANGED, Curve, Panel, UNCHANGED, figure_svg};

/// Both runs as CSV: time, then each channel without and with the change.
pub struct RunFile(CsvFile);

impl RunFile {
    /// Creates the file.
    ///
    /// # Errors
    /// Returns an error if the folder cannot be written to.
    pub fn create(path: &Path) -> Result<Self> {
        let names = Channel::ALL.into_iter().flat_map(|channel| {
            ["unchanged", "changed"].map(|side| format!("{side}_{}", channel.key()))
        });
        let columns: Vec<String> = std::iter::once("time_s".to_owned()).chain(names).collect();
        CsvFile::create(path, &columns).map(Self)
    }

    /// Adds a row.
    ///
    /// # Errors
    /// Returns an error if the file cannot be written.
    pub fn write(&mut self, steps: [&Step; 2]) -> Result<()> {
        let seen = steps.map(|step| Observation::of(&step.simulated));
        let values = Channel::ALL
            .into_iter()
            .flat_map(|channel| [channel.value(&seen[0]), channel.value(&seen[1])]);
        self.0.write(std::iter::once(steps[0].time).chain(values))
    }

    /// Completes the file and gives it its name.
    ///
    /// # Errors
    /// Returns an error if the file cannot be written; no partial file is left.
    pub fn finish(self) -> Result<()> {
        self.0.finish()
    }
}

/// A figure of all channels, without and with the change.
///
/// # Errors
/// Returns an error if the figure cannot be drawn.
pub fn svg(title: &str, simulation: &Simulation) -> Result<String> {
    let panels = Channel::ALL.map(|channel| {
        let ((label, _), (unit, factor)) = (channel.label(), channel.drawn());
        let curve = |line, run: usize| Curve {
            line,
            points: (simulation.seen.iter())
                .map(|(time, seen)| (*time, factor * channel.value(&seen[run])))
                .collect(),
        };
        Panel {
            caption: format!("{label} ({unit})"),
            curves: vec![curve(UNCHANGED, 0), curve(CHANGED, 1)],
            bands: Vec::new(),
            wraps: channel.is_angle(),
        }
    });
    figure_svg(title, &panels)
}
