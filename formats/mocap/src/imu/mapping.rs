//! The mapping of raw inertial sensors: `kind = "imu"`. `docs/suit.md` lists the fields.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use bodyflight_core::Segment;
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::file_kind::FileKind;
use bodyflight_io::input;
use serde::Deserialize;

pub use super::columns::{Columns, FORMATS, ForceUnit, RateUnit};
use super::columns::{MVNX, columns_of};

/// The value of `kind`.
pub const KIND: &str = "imu";
/// Longest recording (s).
const LONGEST: f64 = 1e5;
/// Largest delay of a clock (s).
const LATEST: f64 = 1e5;

/// A mapping as written in the file.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ImuMapping {
    /// Always [`KIND`].
    pub kind: String,
    /// Columns and units of a known program.
    pub format: Option<String>,
    /// Columns of the numbers, instead of those of a format.
    pub columns: Option<Columns>,
    /// Samples per second (Hz), if the file has no times.
    pub rate_hz: Option<f64>,
    /// Windows of the calibration.
    #[serde(default)]
    pub calibration: Windows,
    /// The part of the recording that is the flight.
    #[serde(default)]
    pub flight: FlightWindow,
    /// The sensors by the names of their segments.
    pub sensors: BTreeMap<String, SensorRow>,
}

/// Windows of the calibration, by the sensors' clock (s); omitted ones are found.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Windows {
    /// All sensors at rest in their tray.
    pub tray_s: Option<[f64; 2]>,
    /// Full turns of the tray about an axis of the sensors, each from rest to rest.
    #[serde(default)]
    pub turns_s: Vec<[f64; 2]>,
    /// Standing upright, arms down, still.
    pub upright_s: Option<[f64; 2]>,
    /// Bent forward, knees bent, arms hanging, still.
    pub bent_s: Option<[f64; 2]>,
    /// Marching, hands swinging high.
    pub march_s: Option<[f64; 2]>,
}

/// The flight (s, by the sensors' clock).
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FlightWindow {
    /// The exit; by default the end of the calibration.
    pub begin_s: Option<f64>,
    /// By default the end of the recording.
    pub end_s: Option<f64>,
    /// A receiver's track of the flight, whose velocities the flight then has. Relative to the mapping's folder.
    pub gnss: Option<PathBuf>,
    /// How long after the first row of that track the flight begins (s); otherwise it is found.
    pub gnss_begin_s: Option<f64>,
    /// Limb groups that muscle input acts on, as `muscles` of a `flight.toml`.
    pub muscles: Option<String>,
}

/// One sensor.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorRow {
    /// Its file, in the folder; by default the one file that was given.
    pub file: Option<PathBuf>,
    /// What precedes the names of its columns, if a file has several sensors.
    #[serde(default)]
    pub prefix: String,
    /// Its place in the frame of the segment (m); by default the segment's centre of gravity.
    pub place_m: Option<[f64; 3]>,
    /// Largest angular velocity that it can read (deg/s).
    pub range_dps: Option<f64>,
    /// How late its clock is (s): taken from its times.
    #[serde(default)]
    pub late_s: f64,
    /// By how much the axes of its acceleration are turned about its Z against those of its orientation (degrees).
    #[serde(default)]
    pub acceleration_turn_deg: f64,
    /// What makes orientations of its readings; sensors of different fusions are doubted.
    pub fusion: Option<String>,
}

impl ImuMapping {
    /// Reads the mapping of raw sensors; `None` if it is one of another kind.
    ///
    /// # Errors
    /// Returns an error if the file cannot be read, or has a field that cannot be used.
    pub fn read(path: &Path) -> Result<Option<Self>> {
        #[derive(Deserialize)]
        struct Head {
            kind: Option<String>,
        }
        let text = input::settings(path, FileKind::Mapping)?;
        let head: Option<Head> = toml::from_str(&text).ok();
        if head.and_then(|head| head.kind).as_deref() != Some(KIND) {
            return Ok(None);
        }
        let mut mapping = Self::parse(&text, path)?;
        let folder = path.parent().unwrap_or(Path::new(""));
        if let Some(track) = &mut mapping.flight.gnss {
            *track = folder.join(&track);
        }
        Ok(Some(mapping))
    }

    /// Same as [`ImuMapping::read`], for text already read from `path`.
    ///
    /// # Errors
    /// Returns an error if it is not valid.
    pub fn parse(text: &str, path: &Path) -> Result<Self> {
        let mapping: Self =
            toml::from_str(text).map_err(|error| Problem::toml(&error, text, path))?;
        mapping
            .check()
            .map_err(|problem| problem.in_file(path).on_its_line(text))?;
        Ok(mapping)
    }

    /// Whether the sensors are in a recording of MVN, which has no columns.
    pub(super) fn is_mvnx(&self) -> bool {
        self.format.as_deref() == Some(MVNX) && self.columns.is_none()
    }

    /// The columns, as given or those of the format.
    ///
    /// # Errors
    /// Returns an error if neither or both are given, or the format is not known.
    pub fn columns(&self) -> Result<Columns> {
        match (&self.format, &self.columns) {
            (None, Some(columns)) => Ok(columns.clone()),
            (Some(format), None) => columns_of(format)
                .ok_or_else(|| Problem::unknown("format", format, FORMATS).at("field format")),
            _ => Err(
                Problem::bad_input("expected either format or [columns]").help(format!(
                    "format = \"{}\", or a table [columns] with the names in the file",
                    FORMATS.join("\" or \"")
                )),
            ),
        }
    }

    /// The segments with their sensors, in the order of the core.
    ///
    /// # Errors
    /// Returns an error if a name is none of a segment.
    pub fn rows(&self) -> Result<Vec<(Segment, &SensorRow)>> {
        let mut rows = Vec::new();
        for (name, row) in &self.sensors {
            let names = Segment::ALL.map(Segment::name);
            let segment = Segment::from_name(name)
                .ok_or_else(|| Problem::unknown("segment", name, names).at("table sensors"))?;
            rows.push((segment, row));
        }
        rows.sort_by_key(|(segment, _)| *segment);
        Ok(rows)
    }

    /// Checks that each segment has a sensor of its own.
    fn check_sensors(&self, rows: &[(Segment, &SensorRow)]) -> Result<()> {
        for (place, (segment, row)) in rows.iter().enumerate() {
            let before = rows.get(..place).unwrap_or_default();
            let taken = before.iter().find(|(_, other)| {
                !self.is_mvnx() && other.file == row.file && other.prefix == row.prefix
            });
            if let Some((other, _)) = taken {
                return Err(Problem::bad_input(format!(
                    "it has the file and the columns of {}: expected its own sensor",
                    other.name()
                ))
                .at(format!("table sensors.{}", segment.name()))
                .help("leave out a segment without a sensor"));
            }
        }
        Ok(())
    }

    fn check(&self) -> Result<()> {
        let positive = |name: &str, value: f64, most: f64| {
            if value > 0.0 && value <= most {
                return Ok(());
            }
            let message = format!("expected more than 0 and at most {most}, found {value}");
            Err(Problem::bad_input(message).at(format!("field {name}")))
        };
        if !self.is_mvnx() {
            let columns = self.columns()?;
            columns.check()?;
            positive("columns.time_unit_s", columns.time_unit_s, 10.0)?;
            if columns.time.is_none() && self.rate_hz.is_none() {
                return Err(Problem::bad_input(
                    "expected columns.time or rate_hz, found neither",
                ));
            }
        }
        if let Some(rate) = self.rate_hz {
            positive("rate_hz", rate, 10_000.0)?;
        }
        let windows = &self.calibration;
        let named = [
            ("tray_s", windows.tray_s),
            ("upright_s", windows.upright_s),
            ("bent_s", windows.bent_s),
            ("march_s", windows.march_s),
        ];
        let turns = windows.turns_s.iter().map(|turn| ("turns_s", *turn));
        let given = named
            .into_iter()
            .filter_map(|(name, window)| Some((name, window?)));
        for (name, [from, to]) in given.chain(turns) {
            if !(from < to && from.abs() <= LONGEST && to.abs() <= LONGEST) {
                let message = format!("expected a begin before its end (s), found {from} to {to}");
                return Err(Problem::bad_input(message).at(format!("field calibration.{name}")));
            }
        }
        let rows = self.rows()?;
        self.check_sensors(&rows)?;
        for (segment, row) in rows {
            let place = row.place_m.unwrap_or_default();
            if !place.iter().all(|part| part.abs() <= 1.0) {
                let message = format!("expected three numbers within 1 m, found {place:?}");
                return Err(Problem::bad_input(message)
                    .at(format!("field sensors.{}.place_m", segment.name())));
            }
            if row.late_s.is_nan() || row.late_s.abs() > LATEST {
                let message = format!("expected within {LATEST} s, found {}", row.late_s);
                return Err(Problem::bad_input(message)
                    .at(format!("field sensors.{}.late_s", segment.name())));
            }
            if !row.acceleration_turn_deg.is_finite() || row.acceleration_turn_deg.abs() > 360.0 {
                let found = row.acceleration_turn_deg;
                let message = format!("expected within 360 degrees, found {found}");
                return Err(Problem::bad_input(message).at(format!(
                    "field sensors.{}.acceleration_turn_deg",
                    segment.name()
                )));
            }
            if let Some(range) = row.range_dps {
                positive(&format!("sensors.{}.range_dps", segment.name()), range, 1e5)?;
            }
        }
        if !self.sensors.contains_key(Segment::Pelvis.name()) {
            return Err(Problem::bad_input(
                "expected a sensor on the pelvis, the reference of all others",
            )
            .at("table sensors")
            .help("[sensors.pelvis]"));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEAD: &str = "kind = \"imu\"\nformat = \"dot\"\n";

    fn parse(text: &str) -> Result<ImuMapping> {
        ImuMapping::parse(text, Path::new("mapping.toml"))
    }

    #[test]
    fn two_segments_have_no_sensor_in_common() {
        let both = "kind = \"imu\"\nformat = \"dot\"\n[sensors.pelvis]\nfile = \"p.csv\"\n[sensors.l_thigh]\nfile = \"a.csv\"\n\
            [sensors.l_shank]\nfile = \"a.csv\"\n";
        let problem = ImuMapping::parse(both, Path::new("m.toml")).unwrap_err();
        let said = problem.to_string();
        assert!(
            said.contains("sensors.l_shank") && said.contains("columns of l_thigh"),
            "{said}"
        );
        let apart = both.replacen(
            "file = \"a.csv\"\n",
            "file = \"a.csv\"\nprefix = \"thigh_\"\n",
            1,
        );
        assert!(ImuMapping::parse(&apart, Path::new("m.toml")).is_ok());
    }

    #[test]
    fn what_cannot_be_used_is_named() {
        let pelvis = "[sensors.pelvis]\nfile = \"p.csv\"\n";
        for (text, parts) in [
            (format!("{HEAD}[sensors.tail]\n"), ["table sensors", "tail"]),
            (format!("{HEAD}[sensors.head]\n"), ["pelvis", "reference"]),
            (format!("kind = \"imu\"\n{pelvis}"), ["format", "columns"]),
            (
                format!("kind = \"imu\"\nformat = \"x\"\n{pelvis}"),
                ["mapping.toml:2: field format", "\"x\""],
            ),
            (
                format!("{HEAD}[calibration]\nbent_s = [3, 2]\n{pelvis}"),
                ["mapping.toml:4: field calibration.bent_s", "3 to 2"],
            ),
            (
                format!("{HEAD}{pelvis}range_dps = 0\n"),
                ["sensors.pelvis.range_dps", "found 0"],
            ),
            (
                format!("{HEAD}{pelvis}place_m = [0, 0, 9]\n"),
                ["sensors.pelvis.place_m", "9"],
            ),
            (
                format!(
                    "kind = \"imu\"\nrate_hz = 60\n[columns]\nangular_velocity = [\"x\", \"y\", \"z\"]\n\
                     free_acceleration = [\"a\", \"b\", \"c\"]\n{pelvis}"
                ),
                ["mapping.toml:3: table columns", "orientation"],
            ),
            (
                format!("{HEAD}rate = 3\n{pelvis}"),
                ["mapping.toml:3", "rate"],
            ),
        ] {
            let said = parse(&text).unwrap_err().to_string();
            for part in parts {
                assert!(said.contains(part), "{text}: {said}");
            }
        }
        let found = parse(&format!("{HEAD}{pelvis}[sensors.l_shank]\n")).unwrap();
        assert_eq!(found.rows().unwrap().len(), 2);
        let columns = found.columns().unwrap();
        assert!((columns.angular_velocity_unit.radians() - 0.017_453).abs() < 1e-6);
        assert!((columns.time_unit_s - 1e-6).abs() < 1e-12);
    }
}
