//! Folders of Xsens sensors: a file of CSV or text for each, as Xsens DOT and MT Manager export them.
//!
//! Sensors are joined by their sample times, or by packet counters where an export has no times. Samples that a sensor
//! lacks are gaps.

mod sensor;

use std::path::{Path, PathBuf};

use crate::table::{LEAST_DEGREES, Table};
use crate::timing::clock_rate;
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::input;
use sensor::Sensor;

/// Length of a tick of sample times (s): that of Xsens DOT, and that of MT Manager.
const TICKS_S: [f64; 2] = [1e-6, 1e-4];
/// Highest rate of a sensor's orientations (Hz): beyond it, the tick is the longer one.
const FASTEST: f64 = 1000.0;
/// Distance from a common frame, in frames, at which a sample is out of time.
const OUT_OF_TIME: f64 = 0.25;
/// Largest share of samples out of time for a sensor to be used.
const MOST_OUT: f64 = 0.1;
/// Longest recording (frames).
const FRAME_LIMIT: f64 = 1e8;

/// Reads a folder. Columns are called `Time` (s), and `TAG.w` and so on for each sensor, with the tag that its header
/// or file name gives.
///
/// # Errors
/// Returns an error if the folder has no such files, one is damaged, or sensors have nothing in common.
pub(crate) fn read(folder: &Path) -> Result<(Table, Vec<String>)> {
    let entries = std::fs::read_dir(folder)
        .map_err(|error| Problem::system("read", folder, error))?
        .flatten();
    let mut files: Vec<PathBuf> = entries
        .map(|entry| entry.path())
        .filter(|path| path.is_file())
        .collect();
    files.sort();
    let mut sensors: Vec<Sensor> = Vec::new();
    for file in files {
        let name = file.to_string_lossy().to_ascii_lowercase();
        if ![".csv", ".txt", ".csv.gz", ".txt.gz"]
            .iter()
            .any(|end| name.ends_with(end))
        {
            continue;
        }
        let text = input::utf_8(input::movement(&file)?, &file)?;
        let found = Sensor::parse(&text, &file).map_err(|problem| problem.in_file(&file))?;
        let Some(found) = found else { continue };
        if let Some(other) = sensors.iter().find(|other| other.tag == found.tag) {
            let message = format!(
                "the sensor {} is also in {}",
                found.tag,
                other.file.display()
            );
            return Err(Problem::bad_input(message)
                .in_file(&file)
                .help("keep one recording in a folder"));
        }
        sensors.push(found);
    }
    if sensors.is_empty() {
        return Err(Problem::bad_input("expected a file of Xsens DOT or MT Manager for each sensor, found none")
            .in_file(folder)
            .help("their columns are PacketCounter, SampleTimeFine, and a quaternion, matrix or Euler angles"));
    }
    joined(&sensors).map_err(|problem| problem.in_file(folder))
}

/// The frames that all sensors have in common.
struct Frames {
    begin: f64,
    /// Stamps from frame to frame.
    step: f64,
    count: usize,
    rate: f64,
}

impl Frames {
    fn of(sensors: &[Sensor]) -> Result<Self> {
        let ends = |sensor: &Sensor| Some((*sensor.stamps.first()?, *sensor.stamps.last()?));
        let spans = || sensors.iter().filter_map(ends);
        let begin = spans()
            .map(|(begin, _)| begin)
            .fold(f64::NEG_INFINITY, f64::max);
        let end = spans().map(|(_, end)| end).fold(f64::INFINITY, f64::min);
        let step = sensors.first().map_or(0.0, Sensor::step);
        let timed = sensors.first().is_some_and(|sensor| sensor.timed);
        if step <= 0.0 || end - begin < step || sensors.iter().any(|sensor| sensor.timed != timed) {
            let tags = sensors.iter().map(|sensor| &sensor.tag);
            let spans: Vec<String> = (tags.zip(spans()))
                .map(|(tag, (begin, end))| format!("{tag} {begin} to {end}"))
                .collect();
            let message = format!("the sensors have no time in common: {}", spans.join(", "));
            return Err(Problem::bad_input(message)
                .help("they must be synchronised, and recorded together"));
        }
        // Frames are those of the first sensor.
        let origin = sensors.first().and_then(|sensor| sensor.stamps.first());
        let origin = origin.copied().unwrap_or(begin);
        let begin = origin + ((begin - origin) / step - OUT_OF_TIME).ceil() * step;
        let stated = stated_rate(sensors);
        let measured = timed.then(|| measured_rate(step, stated));
        let rate = measured.or(stated).ok_or_else(|| {
            Problem::bad_input(
                "expected sample times, or an update rate in the header, found neither",
            )
        })?;
        let count = ((end - begin) / step + OUT_OF_TIME).floor() + 1.0;
        if count > FRAME_LIMIT {
            let message = format!("expected at most {FRAME_LIMIT} frames, found {count}");
            return Err(Problem::bad_input(message));
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a count, checked above"
        )]
        let count = count as usize;
        Ok(Self {
            begin,
            step,
            count,
            rate,
        })
    }

    /// Adds the columns of a sensor to rows of this many columns. Returns a warning about samples that it lacks.
    ///
    /// # Errors
    /// Returns an error if the sensor is out of time.
    fn add(
        &self,
        sensor: &Sensor,
        rows: &mut [Vec<f64>],
        columns: usize,
    ) -> Result<Option<String>> {
        let (mut out, mut worst) = (0, 0.0_f64);
        for (stamp, turn) in sensor.stamps.iter().zip(&sensor.turns) {
            let place = (stamp - self.begin) / self.step;
            let off = (place - place.round()).abs();
            if place.round() < 0.0 || place.round() >= self.count as f64 {
                continue;
            }
            if off > OUT_OF_TIME {
                out += 1;
                worst = worst.max(off);
                continue;
            }
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "checked above"
            )]
            let row = rows.get_mut(place.round() as usize);
            if let Some(row) = row.filter(|row| row.len() == columns) {
                row.extend([turn.w, turn.i, turn.j, turn.k]);
            }
        }
        let lacks = rows.iter().filter(|row| row.len() == columns).count();
        for row in rows {
            row.resize(columns + 4, f64::NAN);
        }
        if out as f64 > MOST_OUT * sensor.stamps.len() as f64 {
            let message = format!(
                "the sensor {} is out of time: {out} of {} samples are up to {:.0} ms off the frames of the first sensor",
                sensor.tag,
                sensor.stamps.len(),
                1000.0 * worst / self.rate
            );
            return Err(
                Problem::bad_input(message).help("synchronise the sensors before recording")
            );
        }
        let also = if out > 0 {
            format!(", {out} of them out of time")
        } else {
            String::new()
        };
        Ok((lacks > 0).then(|| {
            format!(
                "the sensor {} lacks {lacks} of {} samples{also}",
                sensor.tag, self.count
            )
        }))
    }
}

/// The rate that a header states (Hz).
fn stated_rate(sensors: &[Sensor]) -> Option<f64> {
    sensors.iter().find_map(|sensor| sensor.rate)
}

/// The rate (Hz) of frames that are so many ticks apart: the tick is the one with which it is nearer to a stated rate.
fn measured_rate(step: f64, stated: Option<f64>) -> f64 {
    let [short, long] = TICKS_S.map(|tick| clock_rate(1.0 / (step * tick)));
    let off = |rate: f64| stated.map_or(0.0, |stated| (rate / stated).ln().abs());
    if off(long) < off(short) || short > FASTEST {
        long
    } else {
        short
    }
}

/// What contradicts itself in the files.
fn contradictions(sensors: &[Sensor]) -> Vec<String> {
    let back = sensors.iter().filter_map(|sensor| {
        let (count, line) = sensor.backwards?;
        let what = if sensor.timed { "sample times" } else { "packet counters" };
        Some(format!(
            "the {what} of the sensor {} run backwards {count} times, first on line {line} of {}: its rows are of two recordings, or in another order",
            sensor.tag,
            sensor.file.display()
        ))
    });
    let largest = sensors.iter().filter_map(|sensor| sensor.largest);
    let largest = largest.reduce(f64::max);
    let radians = largest.filter(|angle| (f64::MIN_POSITIVE..LEAST_DEGREES).contains(angle));
    let radians = radians.map(|angle| {
        format!(
            "no angle of any sensor is beyond {angle:.2}, and degrees are expected: they are radians; export degrees, or quaternions"
        )
    });
    back.chain(radians).collect()
}

/// One table of all sensors, from the latest begin to the earliest end.
fn joined(sensors: &[Sensor]) -> Result<(Table, Vec<String>)> {
    let frames = Frames::of(sensors)?;
    let times = (0..frames.count).map(|k| k as f64 / frames.rate);
    let mut rows: Vec<Vec<f64>> = times.map(|time| vec![time]).collect();
    let mut columns = vec!["Time".to_owned()];
    let mut warnings = Vec::new();
    for sensor in sensors {
        warnings.extend(frames.add(sensor, &mut rows, columns.len())?);
        columns.extend(["w", "x", "y", "z"].map(|part| format!("{}.{part}", sensor.tag)));
    }
    let mut table = Table::of_rows(columns, (1..).zip(rows).collect())?;
    // Without times, the rate is the one that is stated.
    let stated = stated_rate(sensors).filter(|_| sensors.iter().any(|sensor| sensor.timed));
    table.header.rate = stated.map(|rate| ("Update Rate", rate));
    table.header.contradictions = contradictions(sensors);
    Ok((table, warnings))
}

#[cfg(test)]
mod tests {
    use super::*;

    const ONE: &str = "DeviceTag:,A1\nPacketCounter,SampleTimeFine,Euler_X,Euler_Y,Euler_Z\n\
        1,1000000,90,0,0\n2,1010000,90,0,0\n3,1020000,90,0,90\n4,1030000,0,0,0\n5,1040000,0,0,0\n";

    fn together(files: &[(&str, &str)]) -> Result<(Table, Vec<String>)> {
        let mut sensors = Vec::new();
        for (name, text) in files {
            sensors.extend(Sensor::parse(text, Path::new(name))?);
        }
        joined(&sensors)
    }

    #[test]
    fn sensors_are_joined_by_time_and_lost_samples_are_said() {
        let other = ONE
            .replace("DeviceTag:,A1\n", "")
            .replace("3,1020000,90,0,90\n", "");
        let other = other
            .replace("1,1000000,90,0,0\n", "")
            .replace("1010000", "1011000");
        let (table, warnings) = together(&[("x.csv", ONE), ("jump_B2.csv", &other)]).unwrap();
        assert_eq!(table.rows(), 4, "from the second frame of the first");
        assert_eq!(warnings.len(), 1, "{warnings:?}");
        assert!(warnings[0].contains("B2 lacks 1 of 4"), "{warnings:?}");
        let row = |row: usize, tag: &str| {
            let parts = ["w", "x", "y", "z"].map(|part| format!("{tag}.{part}"));
            parts.map(|name| table.value(row, table.column(&name).unwrap()))
        };
        assert!(row(1, "B2")[0].is_nan());
        // First 90 degrees about X, then about Z: half of each component.
        for part in row(1, "A1") {
            assert!((part - 0.5).abs() < 1e-12, "{:?}", row(1, "A1"));
        }
        assert!((table.value(1, 0) - 0.01).abs() < 1e-12);
    }

    #[test]
    fn sensors_out_of_time_and_broken_lines_are_refused() {
        let late = ONE.replace("A1", "B2").replace("0000,", "4000,");
        let apart = ONE.replace("A1", "B2").replace(",10", ",90");
        for (other, part) in [
            (
                late.as_str(),
                "B2 is out of time: 4 of 5 samples are up to 4 ms",
            ),
            (&apart, "no time in common"),
            (
                &ONE.replace("90,0,90", "90,x,90"),
                "column 4, Euler_Y: expected a number, found \"x\"",
            ),
            (&ONE.replace("Euler_", "Acc_"), "columns of an orientation"),
        ] {
            let said = together(&[("x.csv", ONE), ("y.csv", other)])
                .unwrap_err()
                .to_string();
            assert!(said.contains(part), "{said}");
        }
        assert!(
            Sensor::parse("time,x\n0,1\n", Path::new("a.csv"))
                .unwrap()
                .is_none()
        );
    }
}
