//! Both flights over time as CSV.

use std::path::Path;

use bodyflight_io::diagnostic::Result;
use bodyflight_io::files::CsvFile;
use bodyflight_replay::comparison::Channel;

use super::{Compared, Track};

/// Writes matched times, each channel of both flights, and each angle of both flights with its difference and the
/// standard deviation of that.
///
/// # Errors
/// Returns an error if the file cannot be written; no partial file is left.
pub fn write(path: &Path, [a, b]: [&Track; 2], compared: &Compared) -> Result<()> {
    let channels = Channel::ALL
        .into_iter()
        .flat_map(|channel| ["a", "b"].map(|side| format!("{side}_{}", channel.key())));
    let angles = compared.differences.angles.iter().flat_map(|angle| {
        ["a", "b", "difference", "deviation"].map(|side| format!("{side}_{angle}_rad"))
    });
    let times = ["time_s", "a_time_s", "b_time_s"].map(str::to_owned);
    let columns: Vec<String> = times.into_iter().chain(channels).chain(angles).collect();
    let mut file = CsvFile::create(path, &columns)?;
    let origin = compared.matched.alignment.a_s;
    for ((one, two), row) in (compared.differences.times.iter()).zip(&compared.differences.rows) {
        let channels = Channel::ALL
            .into_iter()
            .flat_map(|channel| [a.channel(channel, *one), b.channel(channel, *two)]);
        let times = [one - origin, *one, *two];
        let angles = row.iter().flatten().copied();
        file.write(times.into_iter().chain(channels).chain(angles))?;
    }
    file.finish()
}
