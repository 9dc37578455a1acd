//! A folder of what trackers sent: a table for each sensor, and a mapping in which they get their segments.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use bodyflight_core::Segment;
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::files::{AtomicFolder, CsvFile, number, write_file};

use super::sensor_type;
use super::server::{Received, Server};
use super::tracker::{SensorState, Tracker};

/// Name of the mapping.
pub const MAPPING_FILE: &str = "mapping.toml";
/// Columns of each table.
pub const COLUMNS: [&str; 11] = [
    "time_s",
    "q_w",
    "q_x",
    "q_y",
    "q_z",
    "acceleration_x_mps2",
    "acceleration_y_mps2",
    "acceleration_z_mps2",
    "packet",
    "lost_packets",
    "restarts",
];
/// Most tables.
const MOST_TABLES: usize = 128;
/// First version of the protocol whose acceleration is turned on the tracker as its orientation is meant to be.
const TURNED_SINCE: u32 = 22;

/// A sensor of a tracker that is worn on a segment: `A1:B2:C3:D4:E5:F6=l_thigh`, or `A1:B2:C3:D4:E5:F6/1=l_shank` for its
/// second sensor.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Assignment {
    /// The name of the tracker.
    pub tracker: String,
    /// The number of the sensor.
    pub sensor: u8,
    /// The segment.
    pub segment: Segment,
}

impl FromStr for Assignment {
    type Err = String;

    fn from_str(text: &str) -> core::result::Result<Self, String> {
        let usage =
            || format!("expected ADDRESS=SEGMENT, as A1:B2:C3:D4:E5:F6=l_thigh, found {text:?}");
        let (tracker, segment) = text.split_once('=').ok_or_else(usage)?;
        let (tracker, sensor) = match tracker.split_once('/') {
            Some((tracker, sensor)) => (tracker, sensor.parse().map_err(|_| usage())?),
            None => (tracker, 0),
        };
        let known = Segment::ALL.map(Segment::name).join(", ");
        let segment = Segment::from_name(segment.trim())
            .ok_or_else(|| format!("unknown segment {segment:?}: expected one of {known}"))?;
        let tracker = tracker.trim().replace('-', ":").to_ascii_uppercase();
        if tracker.is_empty() {
            return Err(usage());
        }
        Ok(Self {
            tracker,
            sensor,
            segment,
        })
    }
}

/// The tables, while they are written. The folder gets its name when it is complete.
pub struct Record {
    folder: AtomicFolder,
    path: PathBuf,
    tables: BTreeMap<(usize, u8), (String, CsvFile)>,
    /// Samples for which there was no table.
    refused: u64,
}

impl Record {
    /// Begins a folder, which must not exist.
    ///
    /// # Errors
    /// Returns an error if it exists, or cannot be created.
    pub fn create(path: &Path) -> Result<Self> {
        Ok(Self {
            folder: AtomicFolder::create(path)?,
            path: path.to_owned(),
            tables: BTreeMap::new(),
            refused: 0,
        })
    }

    /// Adds a sample to the table of its sensor, which begins with the first.
    ///
    /// # Errors
    /// Returns an error if the system refuses.
    pub fn push(&mut self, received: &Received, server: &Server) -> Result<()> {
        let key = (received.tracker, received.sensor);
        if !self.tables.contains_key(&key) {
            let Some(tracker) = server.trackers().get(received.tracker) else {
                return Ok(());
            };
            if self.tables.len() >= MOST_TABLES {
                self.refused += 1;
                return Ok(());
            }
            let name = file_name(tracker, received.sensor);
            let table = CsvFile::create(&self.folder.path().join(&name), &COLUMNS)?;
            self.tables.insert(key, (name, table));
        }
        let Some((_, table)) = self.tables.get_mut(&key) else {
            return Ok(());
        };
        let sample = &received.sample;
        let turned = sample.orientation.iter().map(|part| format!("{part:.8}"));
        let pushed = (0..3).map(|axis| {
            sample
                .acceleration
                .map_or(String::new(), |all| number(all[axis]))
        });
        let counts = [sample.number, sample.lost, sample.restarts].map(|count| count.to_string());
        table.write_fields(
            core::iter::once(number(sample.time_s))
                .chain(turned)
                .chain(pushed)
                .chain(counts),
        )
    }

    /// Completes the tables and writes the mapping; returns the folder. `None`, and no folder, if nothing was received.
    ///
    /// # Errors
    /// Returns an error if the system refuses.
    pub fn finish(self, server: &Server, worn: &[Assignment]) -> Result<Option<PathBuf>> {
        if self.tables.is_empty() {
            return Ok(None);
        }
        let text = mapping(
            self.tables
                .iter()
                .map(|(key, (name, _))| (key, name.as_str())),
            server,
            worn,
        );
        for (_, (_, table)) in self.tables {
            table.finish()?;
        }
        write_file(&self.folder.path().join(MAPPING_FILE), text.as_bytes())?;
        self.folder.finish()?;
        Ok(Some(self.path))
    }

    /// Samples for which there was no table, since there are too many sensors.
    pub fn refused(&self) -> u64 {
        self.refused
    }
}

/// Name of the table of a sensor.
fn file_name(tracker: &Tracker, sensor: u8) -> String {
    let plain = tracker.name.replace(':', "").replace('.', "-");
    match sensor {
        0 => format!("{plain}.csv"),
        _ => format!("{plain}-{sensor}.csv"),
    }
}

/// Name of a sensor as users give it.
pub fn sensor_name(tracker: &Tracker, sensor: u8) -> String {
    match sensor {
        0 => tracker.name.clone(),
        _ => format!("{}/{sensor}", tracker.name),
    }
}

/// The fusion behind a sensor's orientations, as the mapping names it.
pub fn fusion(sensor: &SensorState) -> Option<String> {
    let fusion = sensor_type::fusion(sensor.sensor_type)?;
    Some(match sensor.has_magnetometer {
        true => format!("{fusion} with magnetometer"),
        false => fusion.to_owned(),
    })
}

/// The mapping: sensors that are worn have their segments, others wait for them as comments.
fn mapping<'a>(
    tables: impl Iterator<Item = (&'a (usize, u8), &'a str)>,
    server: &Server,
    worn: &[Assignment],
) -> String {
    let mut text = "# What SlimeVR's trackers sent. Give each its segment, then: bodyflight import FOLDER --mapping FOLDER/mapping.toml\n\
        # Segments: pelvis (needed), thorax, l_upperarm, l_forearm, l_thigh, l_shank and so on; calibration: docs/suit.md.\n\
        kind = \"imu\"\nformat = \"slimevr\"\n"
        .to_owned();
    for ((tracker, sensor), file) in tables {
        let Some((own, state)) = server
            .trackers()
            .get(*tracker)
            .and_then(|own| Some((own, own.sensors.get(sensor)?)))
        else {
            continue;
        };
        let segment = worn
            .iter()
            .find(|worn| worn.tracker == own.name && worn.sensor == *sensor);
        let mark = if segment.is_some() { "" } else { "# " };
        let name = segment.map_or("SEGMENT", |worn| worn.segment.name());
        // Writing to a String cannot fail.
        let _ = writeln!(
            text,
            "\n# {}: {}, {} samples{}\n{mark}[sensors.{name}]\n{mark}file = {file:?}",
            sensor_name(own, *sensor),
            sensor_type::name(state.sensor_type),
            state.samples,
            own.restarted(),
        );
        if let Some(fusion) = fusion(state) {
            let _ = writeln!(text, "{mark}fusion = {fusion:?}");
        }
        let _ = writeln!(
            text,
            "{mark}acceleration_turn_deg = {}",
            acceleration_turn_deg(own.handshake.protocol)
        );
    }
    text
}

/// By how much a tracker's acceleration is turned about its Z against its orientation (degrees), if its chip is mounted as
/// the firmware assumes, by 90 or 270 degrees. Firmware turns the orientation back by that angle. Up to version 21 of the
/// protocol it leaves the acceleration as it is; since then it turns it too, in the other sense.
pub const fn acceleration_turn_deg(protocol: u32) -> f64 {
    if protocol < TURNED_SINCE { 90.0 } else { 180.0 }
}

/// Checks that no sensor and no segment is given twice.
///
/// # Errors
/// Returns an error that names it.
pub fn check(worn: &[Assignment]) -> Result<()> {
    for (place, one) in worn.iter().enumerate() {
        for other in worn.iter().skip(place + 1) {
            if one.segment == other.segment {
                let name = one.segment.name();
                return Err(Problem::bad_input(format!("two trackers are on {name}")));
            }
            if (&one.tracker, one.sensor) == (&other.tracker, other.sensor) {
                return Err(Problem::bad_input(format!(
                    "the tracker {} is on {} and on {}",
                    one.tracker,
                    one.segment.name(),
                    other.segment.name()
                )));
            }
        }
    }
    Ok(())
}
