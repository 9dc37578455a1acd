//! One sensor: the samples of its file.

use std::path::{Path, PathBuf};

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

use crate::links::{rotation, unit};
use bodyflight_io::diagnostic::{Problem, Result};

/// The sample times of DOT count microseconds in 32 bits, the packet counters of MT Manager have 16 bits.
const WRAP: f64 = 4_294_967_296.0;
const COUNTER_WRAP: f64 = 65_536.0;

/// The orientation of a sample's numbers, or what is wrong with them.
type Turn = fn(&[f64]) -> core::result::Result<UnitQuaternion<f64>, String>;

/// A way in which a file gives an orientation: names of columns, and the orientation of their numbers.
type Format = (&'static [&'static str], Turn);

const FORMATS: [Format; 6] = [
    (&["Quat_W", "Quat_X", "Quat_Y", "Quat_Z"], of_quaternion),
    (&["Quat_w", "Quat_x", "Quat_y", "Quat_z"], of_quaternion),
    (&["Quat_q0", "Quat_q1", "Quat_q2", "Quat_q3"], of_quaternion),
    (
        &[
            "Mat[1][1]",
            "Mat[2][1]",
            "Mat[3][1]",
            "Mat[1][2]",
            "Mat[2][2]",
            "Mat[3][2]",
            "Mat[1][3]",
            "Mat[2][3]",
            "Mat[3][3]",
        ],
        of_matrix,
    ),
    (&["Euler_X", "Euler_Y", "Euler_Z"], of_angles),
    (&["Roll", "Pitch", "Yaw"], of_angles),
];

fn of_quaternion(numbers: &[f64]) -> core::result::Result<UnitQuaternion<f64>, String> {
    let part = |k: usize| numbers.get(k).copied().unwrap_or(f64::NAN);
    unit(&Quaternion::new(part(0), part(1), part(2), part(3)))
}

fn of_matrix(numbers: &[f64]) -> core::result::Result<UnitQuaternion<f64>, String> {
    let rotation = rotation(&Matrix3::from_column_slice(numbers))?;
    Ok(UnitQuaternion::from_rotation_matrix(&rotation))
}

/// Degrees about X, Y and Z, in this order about fixed axes.
fn of_angles(numbers: &[f64]) -> core::result::Result<UnitQuaternion<f64>, String> {
    let about = |k: usize, axis: Vector3<f64>| {
        let angle = numbers.get(k).copied().unwrap_or(f64::NAN).to_radians();
        UnitQuaternion::from_scaled_axis(axis * angle)
    };
    Ok(about(2, Vector3::z()) * about(1, Vector3::y()) * about(0, Vector3::x()))
}

/// The samples of a sensor.
#[derive(Debug)]
pub(super) struct Sensor {
    pub(super) tag: String,
    pub(super) file: PathBuf,
    /// Frames per second (Hz), if the file states it.
    pub(super) rate: Option<f64>,
    /// Ticks or packets, rising.
    pub(super) stamps: Vec<f64>,
    /// Whether stamps are times, not packets.
    pub(super) timed: bool,
    pub(super) turns: Vec<UnitQuaternion<f64>>,
    /// Largest angle (deg), if the file gives angles.
    pub(super) largest: Option<f64>,
    /// How often stamps run backwards, and the first line on which they do.
    pub(super) backwards: Option<(u64, u64)>,
}

/// What the lines before the samples say.
struct Header {
    tag: Option<String>,
    rate: Option<f64>,
    names: Vec<String>,
    separator: char,
    /// Columns of the orientation, and the quaternion of their numbers.
    places: Vec<usize>,
    turn: Turn,
    /// Whether these are angles.
    is_angles: bool,
    /// Column of sample times.
    fine: Option<usize>,
}

impl Header {
    /// Reads up to the names of the columns; `None` if there is no packet counter.
    fn read<'a>(lines: &mut impl Iterator<Item = (u64, &'a str)>) -> Result<Option<Self>> {
        let (mut rate, mut tag) = (None, None);
        let heads = lines.find(|(_, line)| {
            if let Some((_, value)) = line.split_once("Update Rate:") {
                rate = value.trim().trim_end_matches("Hz").trim().parse().ok();
            }
            if let Some((_, value)) = line.split_once("DeviceTag:") {
                let value = value.trim_matches([',', ';', ' ', '"', '\t', '\r']);
                tag = Some(value.to_owned()).filter(|tag| !tag.is_empty());
            }
            line.starts_with("PacketCounter")
        });
        let Some((line, heads)) = heads else {
            return Ok(None);
        };
        let separator = ['\t', ',', ';'].into_iter().find(|c| heads.contains(*c));
        let separator = separator.unwrap_or(',');
        let names: Vec<String> = heads
            .split(separator)
            .map(|name| name.trim().to_owned())
            .collect();
        let place = |name: &str| names.iter().position(|own| own == name);
        let format = FORMATS.iter().find_map(|(columns, turn)| {
            let places: Option<Vec<usize>> = columns.iter().copied().map(place).collect();
            Some((places?, *turn))
        });
        let Some((places, turn)) = format else {
            let message = format!(
                "expected columns of an orientation, found {}",
                names.join(", ")
            );
            return Err(Problem::bad_input(message)
                .at_line(line)
                .help("export quaternions, matrices or Euler angles"));
        };
        Ok(Some(Self {
            tag,
            rate: rate.filter(|rate: &f64| rate.is_finite() && *rate > 0.0),
            fine: place("SampleTimeFine"),
            is_angles: places.len() == 3,
            names,
            separator,
            places,
            turn,
        }))
    }

    fn number(&self, cells: &[&str], at: usize) -> Result<f64> {
        let cell = cells.get(at).copied().unwrap_or_default();
        let number: Option<f64> = cell.parse().ok();
        number.filter(|number| number.is_finite()).ok_or_else(|| {
            let name = self.names.get(at).map_or("", String::as_str);
            Problem::bad_input(format!("expected a number, found \"{cell}\""))
                .at(format!("column {}, {name}", at + 1))
        })
    }
}

impl Sensor {
    /// Reads a sensor from the text of its file; `None` if it is another file.
    ///
    /// # Errors
    /// Returns an error with the line that does not follow the format.
    pub(super) fn parse(text: &str, file: &Path) -> Result<Option<Self>> {
        let mut lines = (1..).zip(text.trim_start_matches('\u{feff}').lines());
        let Some(header) = Header::read(&mut lines)? else {
            return Ok(None);
        };
        let stem = file.file_name().unwrap_or_default().to_string_lossy();
        let stem = stem.split('.').next().unwrap_or_default();
        let own = stem.rsplit('_').next().unwrap_or(stem);
        let mut sensor = Self {
            tag: header.tag.clone().unwrap_or_else(|| own.to_owned()),
            file: file.to_owned(),
            rate: header.rate,
            stamps: Vec::new(),
            timed: true,
            turns: Vec::new(),
            largest: None,
            backwards: None,
        };
        for (line, content) in lines {
            let cells: Vec<&str> = content.split(header.separator).map(str::trim).collect();
            let before = sensor.stamps.last().copied();
            sensor
                .add(&header, &cells)
                .map_err(|problem| problem.at_line(line))?;
            let back = before.zip(sensor.stamps.last());
            let back = back.map_or(0.0, |(before, stamp)| before - stamp);
            // Counters begin again.
            if back > 0.0 && back < 0.5 * sensor.wrap() {
                sensor.backwards.get_or_insert((0, line)).0 += 1;
            }
        }
        sensor.unwrapped();
        if sensor.stamps.len() < 2 {
            let message = format!("expected at least 2 samples, found {}", sensor.stamps.len());
            return Err(Problem::bad_input(message));
        }
        Ok(Some(sensor))
    }

    /// Adds a sample; packets that arrived without an orientation have none.
    fn add(&mut self, header: &Header, cells: &[&str]) -> Result<()> {
        let is_empty = |at: usize| cells.get(at).is_none_or(|cell| cell.is_empty());
        if header.places.iter().all(|at| is_empty(*at)) {
            return Ok(());
        }
        let more = cells.get(header.names.len()..).unwrap_or_default();
        if more.iter().any(|cell| !cell.is_empty()) {
            let (names, found) = (header.names.len(), cells.len());
            return Err(Problem::bad_input(format!(
                "expected {names} cells, as many as the columns have names, found {found}"
            ))
            .help("the names of the columns are those of another file: export it again"));
        }
        let fine = header.fine.filter(|at| !is_empty(*at));
        if self.stamps.is_empty() {
            self.timed = fine.is_some();
        }
        let stamp = if self.timed { header.fine } else { None };
        self.stamps.push(header.number(cells, stamp.unwrap_or(0))?);
        let numbers = header.places.iter().map(|at| header.number(cells, *at));
        let numbers: Vec<f64> = numbers.collect::<Result<_>>()?;
        let turn = (header.turn)(&numbers);
        self.turns.push(turn.map_err(|message| {
            Problem::bad_input(message)
                .help("the columns are exchanged, or those of another quantity")
        })?);
        if header.is_angles {
            let largest = numbers
                .iter()
                .fold(0.0_f64, |most, angle| most.max(angle.abs()));
            self.largest = Some(self.largest.unwrap_or(0.0).max(largest));
        }
        Ok(())
    }

    /// Where the counter of stamps begins again.
    fn wrap(&self) -> f64 {
        if self.timed { WRAP } else { COUNTER_WRAP }
    }

    /// Makes stamps rise where their counter began again.
    fn unwrapped(&mut self) {
        let wrap = self.wrap();
        let (mut before, mut turns) = (f64::NEG_INFINITY, 0.0);
        for stamp in &mut self.stamps {
            if *stamp + 0.5 * wrap < before {
                turns += wrap;
            }
            before = *stamp;
            *stamp += turns;
        }
    }

    /// The usual step between stamps: the mean of those without a gap, since stamps are rounded.
    pub(super) fn step(&self) -> f64 {
        let mut steps: Vec<f64> = self
            .stamps
            .windows(2)
            .map(|pair| pair[1] - pair[0])
            .collect();
        steps.sort_by(f64::total_cmp);
        let usual = steps.get(steps.len() / 2).copied().unwrap_or(0.0);
        let (sum, count) = (steps.iter())
            .filter(|step| (0.6 * usual..1.5 * usual).contains(*step))
            .fold((0.0, 0.0), |(sum, count), step| (sum + step, count + 1.0));
        if count > 0.0 { sum / count } else { usual }
    }
}
