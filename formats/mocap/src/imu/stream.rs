//! The samples of one sensor, with its own clock and rate.

use std::path::Path;

use bodyflight_core::suit::strapdown::Reading;
use bodyflight_io::diagnostic::{Problem, Result};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::fused::{Turning, pulled, with_gravity};
use super::mapping::{Columns, SensorRow};
use crate::table::Table;

/// Intervals between samples, as multiples of the usual one, up to which readings are interpolated.
pub(super) const BRIDGED: f64 = 3.5;
/// Most lines of description above the names.
const HEAD_LINES: usize = 40;
/// Fewest samples of a sensor.
const FEWEST: usize = 100;
/// Range of usable rates (Hz).
const RATES: [f64; 2] = [20.0, 4000.0];
/// Readings in a row that are as great as the greatest, if rates are cut off; how much they may differ, as a share; and the
/// least range of a gyroscope (rad/s).
const CLIPPED: usize = 6;
const ALIKE: f64 = 1e-6;
const SLOWEST_RANGE: f64 = 0.8;
/// Range of a counter that wraps.
const WRAPS: [f64; 3] = [65_536.0, 4_294_967_296.0, 256.0];

/// One sensor's samples.
#[derive(Debug, Clone, PartialEq)]
pub struct Stream {
    times: Vec<f64>,
    readings: Vec<Reading<f64>>,
    /// Samples per second (Hz), from the usual interval.
    pub rate_hz: f64,
    /// Standard deviation of the intervals, without gaps (s).
    pub jitter_s: f64,
    /// Gaps that are too long to interpolate: begin and length (s).
    pub gaps: Vec<[f64; 2]>,
    /// Share of samples that are missing.
    pub lost: f64,
    /// Whether its rates are turns of orientations by the sensor's own fusion, which has taken the bias off.
    pub is_fused: bool,
    /// Where the sensor began again, with another heading: the last sample before and the first after (s).
    pub restarts: Vec<[f64; 2]>,
}

/// What a column of forces holds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Force {
    /// Specific force in the sensor's axes.
    Specific,
    /// Acceleration without gravity in level axes.
    Free,
    /// Acceleration without gravity in the sensor's axes.
    Linear,
}

/// Where the numbers of a table are.
pub(super) struct Places {
    pub(super) time: Option<usize>,
    rate: Option<[usize; 3]>,
    turn: Option<[usize; 4]>,
    force: [usize; 3],
    kind: Force,
    /// Packets that were lost before the row.
    pub(super) lost: Option<usize>,
    /// How often the sensor had begun again.
    pub(super) restarts: Option<usize>,
    /// By how much an acceleration is turned about the sensor's Z (rad).
    force_turn: f64,
    /// Length of one unit of the time, or of one row (s).
    pub(super) unit_s: f64,
    /// Units of rate (rad/s) and force (m/s2).
    units: [f64; 2],
}

impl Places {
    pub(super) fn of(
        table: &Table,
        columns: &Columns,
        sensor: &SensorRow,
        rate_hz: Option<f64>,
    ) -> Result<Self> {
        let prefix = &sensor.prefix;
        let named = |name: &String| table.column(&format!("{prefix}{name}"));
        let three = |names: &[String; 3]| -> Result<[usize; 3]> {
            let [x, y, z] = names;
            Ok([named(x)?, named(y)?, named(z)?])
        };
        let turn = match &columns.orientation {
            Some([w, x, y, z]) => Some([named(w)?, named(x)?, named(y)?, named(z)?]),
            None => None,
        };
        let kinds = [
            (&columns.specific_force, Force::Specific),
            (&columns.free_acceleration, Force::Free),
            (&columns.linear_acceleration, Force::Linear),
        ];
        let given = kinds
            .into_iter()
            .find_map(|(names, kind)| Some((names.as_ref()?, kind)));
        let (forces, kind) = given.ok_or_else(|| Problem::bad_input("expected specific_force"))?;
        let either = |name: &String| named(name).or_else(|_| table.column(name));
        let filled =
            |column: &usize| (0..table.rows()).any(|row| table.value(row, *column).is_finite());
        // Sensors on a cable and those of a station may leave the time empty, but count.
        let time = columns
            .time
            .as_ref()
            .map(either)
            .transpose()?
            .filter(filled);
        let counter = columns.counter.as_ref().and_then(|name| either(name).ok());
        let (time, unit_s) = match (time, counter.filter(filled), rate_hz) {
            (Some(time), ..) => (Some(time), columns.time_unit_s),
            (None, Some(counter), Some(rate)) => (Some(counter), 1.0 / rate),
            (None, None, Some(rate)) => (None, 1.0 / rate),
            (None, _, None) => {
                return Err(Problem::bad_input("there are no times and no rate")
                    .help("give rate_hz, the samples per second, in the mapping"));
            }
        };
        Ok(Self {
            time,
            unit_s,
            rate: columns.angular_velocity.as_ref().map(three).transpose()?,
            turn,
            force: three(forces)?,
            kind,
            lost: columns.lost.as_ref().map(named).transpose()?,
            restarts: columns.restarts.as_ref().map(named).transpose()?,
            force_turn: sensor.acceleration_turn_deg.to_radians(),
            units: [
                columns.angular_velocity_unit.radians(),
                columns.specific_force_unit.metres(),
            ],
        })
    }

    /// A row's orientation (level axes from sensor), if there is one; not finite if a number is missing.
    pub(super) fn turn(&self, table: &Table, row: usize) -> Option<UnitQuaternion<f64>> {
        let [w, x, y, z] = self.turn?.map(|column| table.value(row, column));
        Some(UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z)))
    }

    /// The length of a row's quaternion; 1 if there is none.
    pub(super) fn length(&self, table: &Table, row: usize) -> f64 {
        let parts = self
            .turn
            .map(|turn| turn.map(|column| table.value(row, column)));
        parts.map_or(1.0, |parts| {
            parts.iter().map(|part| part * part).sum::<f64>().sqrt()
        })
    }

    /// A row's specific force (m/s2, sensor axes); not finite if a number is missing.
    pub(super) fn force(
        &self,
        table: &Table,
        row: usize,
        turn: Option<UnitQuaternion<f64>>,
    ) -> Vector3<f64> {
        let read = self.force.map(|column| table.value(row, column));
        let [_, unit] = self.units;
        let back = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), -self.force_turn);
        let force = back * (Vector3::from(read) * unit);
        match (turn, self.kind) {
            (Some(turn), Force::Free) => with_gravity(&turn, &force),
            (Some(turn), Force::Linear) => pulled(&turn, &force),
            (_, Force::Specific) | (None, _) => force,
        }
    }

    /// A row's reading at a time (s); its numbers are not finite if one is missing.
    fn reading(&self, table: &Table, row: usize, time: f64, turning: &mut Turning) -> Reading<f64> {
        let vector = |at: [usize; 3]| Vector3::from(at.map(|column| table.value(row, column)));
        let turn = self.turn(table, row);
        let [of_rate, _] = self.units;
        let unknown = || Vector3::repeat(f64::NAN);
        let rate = match (self.rate, turn) {
            (Some(rate), _) => vector(rate) * of_rate,
            // Nothing is known of the first.
            (None, Some(turn)) => turning.rate(time, &turn).unwrap_or_else(unknown),
            (None, None) => unknown(),
        };
        Reading {
            angular_velocity: rate,
            specific_force: self.force(table, row, turn),
        }
    }
}

/// Reads a table whose names may follow lines of description.
pub(super) fn table(text: &str, columns: &Columns, prefix: &str) -> Result<Table> {
    let first = format!("{prefix}{}", columns.first());
    let is_head = |line: &str| {
        line.split([',', ';', '\t'])
            .any(|cell| cell.trim().trim_matches('"') == first)
    };
    let mut skipped = 0;
    for line in text.split_inclusive('\n') {
        if is_head(line) {
            return Table::parse(text.get(skipped..).unwrap_or_default());
        }
        skipped += line.len();
    }
    Err(
        Problem::bad_input(format!("the table has no column \"{first}\""))
            .help("[columns] and prefix in the mapping must give the names in the file"),
    )
}

impl Stream {
    /// Takes the samples of a sensor out of a table. `rate_hz` is used if there is no time.
    ///
    /// # Errors
    /// Returns an error if a column is missing, the times do not rise, or there are too few samples.
    pub(super) fn of(
        table: &Table,
        columns: &Columns,
        sensor: &SensorRow,
        rate_hz: Option<f64>,
    ) -> Result<Self> {
        let places = Places::of(table, columns, sensor, rate_hz)?;
        let (mut times, mut readings) = (Vec::new(), Vec::new());
        let mut clock = Clock::default();
        let mut turning = Turning::default();
        for row in 0..table.rows() {
            let time = match places.time {
                Some(column) => clock.risen(table.value(row, column)) * places.unit_s,
                None => row as f64 * places.unit_s,
            };
            let reading = places.reading(table, row, time, &mut turning);
            // Rows with an empty cell are lost samples.
            if !reading.is_finite() || !time.is_finite() {
                continue;
            }
            if times.last().is_some_and(|last| time <= *last) {
                return Err(Problem::bad_input(format!(
                    "expected times that rise, found {time} s after {} s",
                    times.last().copied().unwrap_or_default()
                ))
                .at_line(table.line(row)));
            }
            times.push(time);
            readings.push(reading);
        }
        Ok(Self {
            is_fused: places.turn.is_some(),
            ..Self::new(times, readings)?
        })
    }

    /// Samples at rising times (s).
    ///
    /// # Errors
    /// Returns an error if there are too few samples, or their rate is none of a sensor.
    pub fn new(times: Vec<f64>, readings: Vec<Reading<f64>>) -> Result<Self> {
        if times.len() < FEWEST {
            let message = format!("expected at least {FEWEST} samples, found {}", times.len());
            return Err(Problem::bad_input(message));
        }
        let steps: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let mut sorted = steps.clone();
        sorted.sort_by(f64::total_cmp);
        let usual = sorted.get(sorted.len() / 2).copied().unwrap_or(0.0);
        let rate_hz = 1.0 / usual;
        let [least, most] = RATES;
        if !(least..=most).contains(&rate_hz) {
            let message = format!("expected {least} to {most} samples a second, found {rate_hz}");
            return Err(Problem::bad_input(message).help("check columns.time_unit_s, or rate_hz"));
        }
        let regular: Vec<f64> = steps.iter().copied().filter(|s| *s < 1.5 * usual).collect();
        let count = regular.len().max(1) as f64;
        let spread: f64 = regular.iter().map(|step| (step - usual).powi(2)).sum();
        let gaps = times.iter().zip(&steps);
        let gaps = gaps.filter(|(_, step)| **step > BRIDGED * usual);
        let span = times.last().zip(times.first()).map_or(0.0, |(b, a)| b - a);
        Ok(Self {
            gaps: gaps.map(|(begin, step)| [*begin, *step]).collect(),
            lost: (1.0 - (times.len() as f64 - 1.0) * usual / span).max(0.0),
            jitter_s: (spread / count).sqrt(),
            rate_hz,
            restarts: Vec::new(),
            times,
            readings,
            is_fused: false,
        })
    }

    /// The same samples, all earlier by so much (s).
    #[must_use]
    pub fn earlier(mut self, by: f64) -> Self {
        for time in self
            .times
            .iter_mut()
            .chain(self.gaps.iter_mut().map(|[begin, _]| begin))
            .chain(self.restarts.iter_mut().flatten())
        {
            *time -= by;
        }
        self
    }

    /// The rate (rad/s) at which readings are cut off: the greatest about an axis, if it comes many times in a row in
    /// a window (s).
    pub(super) fn clipped_at(&self, window: [f64; 2]) -> Option<f64> {
        let readings = || self.within(window).map(|(_, reading)| reading);
        let greatest = |axis: usize| {
            let sizes = readings().map(|reading| reading.angular_velocity[axis].abs());
            sizes.fold(0.0, f64::max)
        };
        let mut found: Option<f64> = None;
        for axis in 0..3 {
            let most = greatest(axis);
            let mut run = 0;
            for reading in readings() {
                let is_most = reading.angular_velocity[axis].abs() >= most * (1.0 - ALIKE);
                run = if is_most { run + 1 } else { 0 };
                if run >= CLIPPED && most > SLOWEST_RANGE {
                    found = Some(found.map_or(most, |found| found.max(most)));
                }
            }
        }
        found
    }

    /// First and last sample (s).
    pub fn span(&self) -> [f64; 2] {
        [self.times.first(), self.times.last()].map(|time| time.copied().unwrap_or(0.0))
    }

    /// The reading at a time (s), interpolated; `None` outside the samples and in gaps.
    pub fn at(&self, time: f64) -> Option<Reading<f64>> {
        let after = self.times.partition_point(|sample| *sample <= time);
        let before = after.checked_sub(1)?;
        let (from, to) = (*self.times.get(before)?, *self.times.get(after)?);
        if (to - from) * self.rate_hz > BRIDGED {
            return None;
        }
        let share = (time - from) / (to - from);
        let (one, other) = (self.readings.get(before)?, self.readings.get(after)?);
        Some(Reading {
            angular_velocity: one.angular_velocity.lerp(&other.angular_velocity, share),
            specific_force: one.specific_force.lerp(&other.specific_force, share),
        })
    }

    /// The samples within a window (s), each with the time to the one before (s).
    pub(super) fn within(
        &self,
        [from, to]: [f64; 2],
    ) -> impl Iterator<Item = (f64, &Reading<f64>)> {
        let begin = self.times.partition_point(|time| *time < from);
        let end = self.times.partition_point(|time| *time <= to);
        let usual = 1.0 / self.rate_hz;
        let step = move |k: usize| match k.checked_sub(1).and_then(|k| self.times.get(k)) {
            Some(before) => self.times.get(k).map_or(usual, |time| time - before),
            None => usual,
        };
        (begin..end).filter_map(move |k| Some((step(k), self.readings.get(k)?)))
    }

    /// The same with their times (s) first.
    pub(super) fn timed(
        &self,
        window: [f64; 2],
    ) -> impl Iterator<Item = (f64, f64, &Reading<f64>)> {
        let begin = self.times.partition_point(|time| *time < window[0]);
        let times = self.times.get(begin..).unwrap_or_default();
        (times.iter().zip(self.within(window)))
            .map(|(time, (step, reading))| (*time, step, reading))
    }
}

/// Reads one sensor from a file.
///
/// # Errors
/// Returns an error if the file cannot be read, or for the reasons given at [`Stream`].
pub(super) fn read(
    path: &Path,
    columns: &Columns,
    sensor: &SensorRow,
    rate_hz: Option<f64>,
) -> Result<Stream> {
    let text = bodyflight_io::input::utf_8(bodyflight_io::input::movement(path)?, path)?;
    let table = table(&text, columns, &sensor.prefix).map_err(|problem| problem.in_file(path))?;
    Stream::of(
        &table,
        columns,
        sensor,
        rate_hz.or_else(|| stated_rate(&text)),
    )
    .map_err(|problem| problem.in_file(path))
}

/// The rate (Hz) that MT Manager writes above the names: "// Update Rate: 100.0Hz".
fn stated_rate(text: &str) -> Option<f64> {
    let head = text.lines().take(HEAD_LINES);
    let (_, rate) = (head.filter_map(|line| line.split_once("Update Rate:"))).next()?;
    let rate = rate.trim().trim_end_matches("Hz").trim().parse();
    rate.ok()
        .filter(|rate: &f64| *rate > 0.0 && rate.is_finite())
}

/// A counter that may wrap.
#[derive(Default)]
struct Clock {
    last: Option<f64>,
    added: f64,
}

impl Clock {
    fn risen(&mut self, read: f64) -> f64 {
        if let Some(last) = self.last
            && read < last
        {
            // The smallest range in which this is a step forwards by less than half of it.
            let fits = |range: &&f64| last < **range && read + **range - last < 0.5 * **range;
            let mut ranges = WRAPS;
            ranges.sort_by(f64::total_cmp);
            let wrap = ranges.iter().find(fits).copied();
            self.added += wrap.unwrap_or(0.0);
        }
        self.last = Some(read);
        read + self.added
    }
}

#[cfg(test)]
mod tests {
    use bodyflight_core::air::STANDARD_GRAVITY;

    use super::super::mapping::ImuMapping;
    use super::*;

    fn columns(format: &str) -> Columns {
        let text = format!("kind = \"imu\"\nformat = \"{format}\"\n[sensors.pelvis]\n");
        ImuMapping::parse(&text, Path::new("m.toml"))
            .unwrap()
            .columns()
            .unwrap()
    }

    /// An export of Xsens DOT whose clock wraps, with a lost sample and a gap.
    fn export(lost: core::ops::Range<u32>) -> String {
        let mut text = "sep=,\nDeviceTag:,L1\nPacketCounter,SampleTimeFine,Acc_X,Acc_Y,Acc_Z,Gyr_X,Gyr_Y,Gyr_Z\n"
            .to_owned();
        for k in (0..200_u32).filter(|k| *k != 20 && !lost.contains(k)) {
            let time = (4_294_000_000_u64 + 16_667 * u64::from(k)) % 4_294_967_296;
            text += &format!("{k},{time},0,0,9.8,{k},0,0\n");
        }
        text
    }

    #[test]
    fn clock_units_and_gaps_of_an_export_are_read() {
        let columns = columns("dot");
        let text = export(100..120);
        let table = table(&text, &columns, "").unwrap();
        let stream = Stream::of(&table, &columns, &SensorRow::default(), None).unwrap();
        assert!((stream.rate_hz - 60.0).abs() < 0.01, "{}", stream.rate_hz);
        assert_eq!(stream.gaps.len(), 1, "{:?}", stream.gaps);
        assert!((stream.gaps[0][1] - 21.0 / 60.0).abs() < 1e-3);
        assert!((stream.lost - 21.0 / 199.0).abs() < 1e-3, "{}", stream.lost);
        let [begin, end] = stream.span();
        assert!((end - begin - 199.0 / 60.0).abs() < 1e-3, "the clock wraps");
        let rate = |k: f64| {
            let reading = stream.at(begin + k * 0.016_667)?;
            Some(reading.angular_velocity.x.to_degrees())
        };
        assert!((rate(20.0).unwrap() - 20.0).abs() < 0.01, "interpolated");
        assert!(rate(110.0).is_none(), "a gap");
        assert_eq!(stream.within([begin + 1.0, begin + 1.1]).count(), 6);
    }

    /// As stations of Xsens write: five lines of description, no times, and a counter that wraps.
    #[test]
    fn a_file_without_times_is_read_by_its_counter_and_stated_rate() {
        let mut text = "// Start Time: Unknown\n// Update Rate: 100.0Hz\n\
            PacketCounter,SampleTimeFine,Acc_X,Acc_Y,Acc_Z,Gyr_X,Gyr_Y,Gyr_Z\n"
            .to_owned();
        for k in (0..300_u32).filter(|k| *k != 150) {
            text += &format!("{},,0,0,9.8,{k},0,0\n", (65_400 + k) % 65_536);
        }
        let columns = columns("mt-manager");
        let table = table(&text, &columns, "").unwrap();
        let stream =
            Stream::of(&table, &columns, &SensorRow::default(), stated_rate(&text)).unwrap();
        let [begin, end] = stream.span();
        assert!((end - begin - 2.99).abs() < 1e-6, "{begin} {end}");
        assert!((stream.lost - 1.0 / 299.0).abs() < 1e-4, "{}", stream.lost);
        let said = Stream::of(&table, &columns, &SensorRow::default(), None).unwrap_err();
        assert!(said.to_string().contains("no rate"), "{said}");
    }

    /// What a sensor's own fusion made of its readings becomes readings again.
    #[test]
    fn rates_and_forces_follow_from_orientations_and_free_accelerations() {
        let mut text =
            "PacketCounter,SampleTimeFine,Quat_W,Quat_X,Quat_Y,Quat_Z,FreeAcc_X,FreeAcc_Y,FreeAcc_Z\n"
                .to_owned();
        // It leans forwards about X at 1 rad/s, and is pushed to the north.
        for k in 0..200_u32 {
            let half = 0.5 * f64::from(k) / 100.0;
            let (sine, cosine) = half.sin_cos();
            text += &format!("{k},{},{cosine},{sine},0,0,2,0,0\n", 10_000 * k);
        }
        let columns = columns("dot-fused");
        let table = table(&text, &columns, "").unwrap();
        let stream = Stream::of(&table, &columns, &SensorRow::default(), None).unwrap();
        assert!((stream.rate_hz - 100.0).abs() < 1e-6 && stream.is_fused);
        let reading = stream.at(1.0 + 1e-9).unwrap();
        assert!((reading.angular_velocity - Vector3::x()).norm() < 1e-6);
        let (sine, cosine) = 1.0_f64.sin_cos();
        let force = Vector3::new(2.0, STANDARD_GRAVITY * sine, STANDARD_GRAVITY * cosine);
        assert!(
            (reading.specific_force - force).norm() < 1e-6,
            "{reading:?}"
        );
    }

    #[test]
    fn broken_files_are_refused() {
        let columns = columns("dot");
        let parsed = |text: &str| {
            let table = table(text, &columns, "")?;
            Stream::of(&table, &columns, &SensorRow::default(), None)
        };
        let text = export(0..0);
        for (text, part) in [
            (text.replace("Gyr_X", "Euler_X"), "no column \"Gyr_X\""),
            (text.replace("Acc_Y", "FreeAcc_Y"), "no column \"Acc_Y\""),
            (export(40..200), "expected at least 100 samples, found 39"),
            (
                text.replace("10,4294166670,", "10,4294116668,"),
                "expected times that rise",
            ),
        ] {
            let said = parsed(&text).unwrap_err().to_string();
            assert!(said.contains(part), "{said}");
        }
    }
}
