//! Two runs over time as CSV.

use std::path::Path;

use bodyflight_core::observation::Observation;
use bodyflight_io::diagnostic::Result;
use bodyflight_io::files::CsvFile;
use bodyflight_replay::comparison::Channel;
use bodyflight_replay::steps::Step;

/// Both runs as CSV: time, then each channel without and with the change.
pub struct PairFile(CsvFile);

impl PairFile {
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
