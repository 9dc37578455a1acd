//! Samples that arrived over a network, stamped when they arrived: even times, and what a sensor at rest does not send.
//!
//! A network delays packets by anything up to a tenth of a second, and delivers those that waited together. No packet is
//! early, so the least delayed ones tell when the others were sent: each sample is taken to be at least one period before
//! the next. That needs no clock of the sensor.

use std::path::Path;

use bodyflight_core::suit::strapdown::Reading;
use bodyflight_io::diagnostic::{Problem, Result};
use nalgebra::{UnitQuaternion, Vector3};

use super::fused::Turning;
use super::mapping::{Columns, SensorRow};
use super::stream::{self, BRIDGED, Places, Stream};
use crate::table::Table;

/// Samples over which a period is measured, if none of them was lost; fewer if there are not enough such spans.
const MEASURED: [usize; 4] = [32, 16, 8, 4];
/// Spans that are enough.
const ENOUGH: usize = 20;
/// Share of the spans that agree best on the period: at rest less is sent, and what waited arrives together.
const AGREEING: f64 = 0.2;
/// Longest gap in which a mean rate is as good as the rate (s): the turn over it is known from the orientations.
const SPANNED: f64 = 0.25;
/// Largest turn (rad) after which a sensor that sent nothing was at rest: firmware does not repeat an orientation.
const AT_REST: f64 = 0.005;
/// Longest rest that is filled (s).
const LONGEST_REST: f64 = 60.0;
/// Most samples filled in for one that arrived, and besides.
const MOST_FILLED: [usize; 2] = [20, 10_000];

/// Deviation of the length of a quaternion from 1 from which it is none.
const OFF_LENGTH: f64 = 0.01;

/// A sample as it arrived.
struct Arrived {
    time: f64,
    /// Packets that were lost before it.
    lost: f64,
    /// Whether the sensor began again since the sample before.
    is_new: bool,
    turn: UnitQuaternion<f64>,
    force: Vector3<f64>,
}

/// Reads one sensor from a file.
///
/// # Errors
/// Returns an error if the file cannot be read, or for the reasons given at [`of`].
pub(super) fn read(path: &Path, columns: &Columns, sensor: &SensorRow) -> Result<Stream> {
    let text = bodyflight_io::input::utf_8(bodyflight_io::input::movement(path)?, path)?;
    let table = stream::table(&text, columns, &sensor.prefix);
    table
        .and_then(|table| of(&table, columns, sensor))
        .map_err(|problem| problem.in_file(path))
}

/// The samples of a table.
///
/// # Errors
/// Returns an error if times run backwards, or for the reasons given at [`Stream`].
fn of(table: &Table, columns: &Columns, sensor: &SensorRow) -> Result<Stream> {
    let places = Places::of(table, columns, sensor, None)?;
    let mut arrived: Vec<Arrived> = Vec::new();
    let (mut lost, mut restarts) = (0.0, None);
    for row in 0..table.rows() {
        let time = places
            .time
            .map_or(f64::NAN, |column| table.value(row, column))
            * places.unit_s;
        let turn = places.turn(table, row);
        let force = places.force(table, row, turn);
        lost += places
            .lost
            .map_or(0.0, |column| table.value(row, column))
            .max(0.0);
        let Some(turn) = turn.filter(|turn| turn.coords.norm().is_finite()) else {
            continue;
        };
        is_unit(places.length(table, row)).map_err(|problem| problem.at_line(table.line(row)))?;
        // The turn over a sample without an acceleration is in the next.
        if !(time.is_finite() && force.norm().is_finite()) {
            continue;
        }
        let begun = places
            .restarts
            .map_or(0.0, |column| table.value(row, column));
        if let Some(last) = arrived.last().filter(|last| time < last.time) {
            return Err(Problem::bad_input(format!(
                "expected times that rise, found {time} s after {} s",
                last.time
            ))
            .at_line(table.line(row)));
        }
        arrived.push(Arrived {
            time,
            lost,
            is_new: restarts.is_some_and(|before| begun > before),
            turn,
            force,
        });
        lost = 0.0;
        restarts = Some(begun).filter(|begun| !begun.is_nan()).or(restarts);
    }
    let Some(period) = period(&arrived) else {
        return Stream::new(Vec::new(), Vec::new());
    };
    even(&mut arrived, period);
    filled(&arrived, period)
}

/// Checks the length of a quaternion.
fn is_unit(length: f64) -> Result<()> {
    if (length - 1.0).abs() <= OFF_LENGTH {
        return Ok(());
    }
    Err(Problem::bad_input(format!(
        "expected a quaternion of unit length, found one of length {length:.3}"
    )))
}

/// Time from sample to sample (s).
fn period(arrived: &[Arrived]) -> Option<f64> {
    let slopes = |count: usize| {
        let spans = arrived.windows(count + 1).filter_map(move |span| {
            let follows = |sample: &Arrived| sample.lost <= 0.0 && !sample.is_new;
            let is_whole = span.iter().skip(1).all(follows);
            let length = span.last()?.time - span.first()?.time;
            (is_whole && length > 0.0).then(|| length / count as f64)
        });
        spans.collect::<Vec<f64>>()
    };
    let mut each = MEASURED.into_iter().map(slopes);
    let mut found = each.find(|found| found.len() >= ENOUGH)?;
    found.sort_by(f64::total_cmp);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a share of the spans"
    )]
    let agreeing = (found.len() as f64 * AGREEING) as usize;
    // The shorter end, since a period that is too long would push samples further back one after the other.
    let ends = found.iter().zip(found.iter().skip(agreeing));
    let closest = ends.min_by(|one, other| (one.1 - one.0).total_cmp(&(other.1 - other.0)));
    closest.map(|(shorter, _)| *shorter)
}

/// Takes each sample to be at least a period before the next.
fn even(arrived: &mut [Arrived], period: f64) {
    let mut next = f64::INFINITY;
    for sample in arrived.iter_mut().rev() {
        sample.time = sample.time.min(next - period);
        next = sample.time;
    }
}

/// Readings from the orientations, with what was not sent in between.
fn filled(arrived: &[Arrived], period: f64) -> Result<Stream> {
    let (mut times, mut readings) = (Vec::new(), Vec::new());
    let mut turning = Turning::default();
    let mut restarts = Vec::new();
    let (mut missing, mut added) = (0.0, 0);
    let [of_each, besides] = MOST_FILLED;
    for (place, sample) in arrived.iter().enumerate() {
        let before = place.checked_sub(1).and_then(|before| arrived.get(before));
        if sample.is_new {
            // How it turned meanwhile is not known, not even whether it rested.
            turning = Turning::default();
            restarts.extend(before.map(|before| [before.time, sample.time]));
        }
        let rate = turning.rate(sample.time, &sample.turn);
        let (Some(before), Some(rate)) = (before, rate) else {
            continue;
        };
        let step = sample.time - before.time;
        let is_at_rest = sample.lost <= 0.0
            && step < LONGEST_REST
            && before.turn.angle_to(&sample.turn) < AT_REST;
        let parts = (step / period).round().max(1.0);
        if !is_at_rest && step > SPANNED && step > BRIDGED * period {
            // A mean over a gap is not the rate at its end.
            continue;
        }
        if !is_at_rest {
            missing += parts - 1.0;
        }
        let mut part = 1.0;
        while part < parts && added < of_each * arrived.len() + besides {
            let share = part / parts;
            times.push(before.time + share * step);
            readings.push(Reading {
                angular_velocity: rate,
                specific_force: before.force.lerp(&sample.force, share),
            });
            (part, added) = (part + 1.0, added + 1);
        }
        times.push(sample.time);
        readings.push(Reading {
            angular_velocity: rate,
            specific_force: sample.force,
        });
    }
    let count = times.len().max(1) as f64;
    let mut stream = Stream::new(times, readings)?;
    stream.is_fused = true;
    // What was filled in is missing all the same.
    stream.lost = (stream.lost + missing / count).min(1.0);
    stream.restarts = restarts;
    Ok(stream)
}

#[cfg(test)]
mod tests {
    use bodyflight_core::air::STANDARD_GRAVITY;
    use proptest::prelude::*;

    use super::super::mapping::ImuMapping;
    use super::*;

    fn read(text: &str, sensor: &SensorRow) -> Result<Stream> {
        let mapping = "kind = \"imu\"\nformat = \"slimevr\"\n[sensors.pelvis]\n";
        let columns = ImuMapping::parse(mapping, Path::new("m.toml"))?.columns()?;
        let table = stream::table(text, &columns, "")?;
        of(&table, &columns, sensor)
    }

    /// Orientation about X at a time (s): at rest until 2 s, then it swings.
    fn angle(time: f64) -> f64 {
        let since = (time - 2.0).max(0.0);
        0.8 * (1.0 - (3.0 * since).cos())
    }

    #[test]
    fn quaternions_that_are_none_are_refused() {
        let text = table(|_| 0.0, |_| false);
        let (first, rest) = text.split_once("\n").unwrap();
        let longer = rest.replace(",0,0,1,2,0,", ",0,1,1,2,0,");
        let said = read(&format!("{first}\n{longer}"), &SensorRow::default()).unwrap_err();
        let said = said.with_causes();
        assert!(
            said.contains("unit length, found one of length 1.414"),
            "{said}"
        );
    }

    /// The heading after a restart is another one, so that nothing is known of the turn over it.
    #[test]
    fn no_turn_and_no_rest_goes_over_a_restart() {
        let text = table(|_| 0.0, |_| false);
        let mut again = String::new();
        for line in text.lines() {
            let time: f64 = line.split(',').next().unwrap().parse().unwrap_or(0.0);
            again += &match time {
                // At rest all the time, with the same orientation before and after.
                0.8..1.2 => continue,
                1.2.. => line.strip_suffix(",0").unwrap().to_owned() + ",1\n",
                _ => line.to_owned() + "\n",
            };
        }
        let stream = read(&again, &SensorRow::default()).unwrap();
        let [[last, first]] = stream.restarts[..] else {
            panic!("{:?}", stream.restarts);
        };
        assert!(
            (0.3..0.9).contains(&last) && (1.1..1.7).contains(&first),
            "{last} {first}"
        );
        assert!(stream.at(1.0).is_none(), "it is not a rest");
        // While it turns, the jump of the heading is no rate.
        let turned = |line: &str| {
            let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
            let time: f64 = cells[0].parse().unwrap_or(0.0);
            if time > 5.0 {
                let part = |k: usize| cells[k].parse::<f64>().unwrap();
                let (w, x) = (part(1), part(2));
                // A quarter turn about the vertical.
                let half = core::f64::consts::FRAC_1_SQRT_2;
                for (k, part) in [(1, w), (2, x), (3, x), (4, w)] {
                    cells[k] = format!("{:.8}", half * part);
                }
                cells[10] = "1".to_owned();
            }
            cells.join(",") + "\n"
        };
        let jumped: String = text.lines().map(turned).collect();
        let stream = read(&jumped, &SensorRow::default()).unwrap();
        assert_eq!(stream.restarts.len(), 1);
        let fastest = stream
            .within([0.0, 10.0])
            .map(|(_, own)| own.angular_velocity.norm());
        let fastest = fastest.fold(0.0, f64::max);
        assert!(fastest < 2.6, "{fastest}");
    }

    /// What arrives of 100 samples a second, each late by `late` of its number (s); rows of which `is_lost` do not arrive, nor
    /// those that only repeat.
    fn table(late: impl Fn(u32) -> f64, is_lost: impl Fn(u32) -> bool) -> String {
        let mut text = crate::slimevr::record::COLUMNS.join(",") + "\n";
        let (mut arrival, mut sent, mut lost) = (0.0_f64, f64::NAN, 0);
        for k in 0..1000_u32 {
            let time = f64::from(k) * 0.01;
            let (sine, cosine) = (0.5 * angle(time)).sin_cos();
            if (sine - sent).abs() < 1e-4 && k % 40 != 0 {
                continue;
            }
            sent = sine;
            if is_lost(k) {
                lost += 1;
                continue;
            }
            arrival = arrival.max(time + 0.002 + late(k));
            text += &format!("{arrival:.6},{cosine:.8},{sine:.8},0,0,1,2,0,{k},{lost},0\n");
            lost = 0;
        }
        text
    }

    /// Errors of the rate (rad/s) while it swings, root of the mean square, and of the time (s), the largest.
    fn errors(stream: &Stream) -> [f64; 2] {
        let (mut square, mut count, mut furthest) = (0.0, 0.0_f64, 0.0_f64);
        let mut turned = 0.0;
        for (time, step, reading) in stream.timed([0.0, 10.0]) {
            turned += step * reading.angular_velocity.x;
            let since = (time - 2.0).max(0.0);
            // Rates are means over a period.
            let truth = 2.4 * (3.0 * (since - 0.005)).sin();
            if time > 2.1 {
                square += (reading.angular_velocity.x - truth).powi(2);
                count += 1.0;
                furthest = furthest.max((turned - angle(time)).abs());
            }
        }
        [(square / count.max(1.0)).sqrt(), furthest / 2.4]
    }

    #[test]
    fn times_of_a_network_become_even_and_rests_are_filled() {
        // Every seventh waits, and in each second some wait together.
        let late =
            |k: u32| if k.is_multiple_of(7) { 0.006 } else { 0.0 } + if k % 100 < 8 { 0.08 } else { 0.0 };
        let stream = read(&table(late, |_| false), &SensorRow::default()).unwrap();
        assert!((stream.rate_hz - 100.0).abs() < 3.0, "{}", stream.rate_hz);
        assert!(stream.gaps.is_empty(), "{:?}", stream.gaps);
        assert!(stream.lost < 0.01, "{}", stream.lost);
        let [rate, time] = errors(&stream);
        assert!(rate < 0.3 && time < 0.006, "{rate} {time}");
        let at_rest = stream.within([0.5, 1.5]).count();
        assert!((95..=105).contains(&at_rest), "{at_rest}");
        let force = stream.at(1.0).unwrap().specific_force;
        assert!((force - Vector3::new(1.0, 2.0, STANDARD_GRAVITY)).norm() < 1e-6);
    }

    #[test]
    fn lost_packets_are_counted_and_cost_no_turn() {
        let is_lost = |k: u32| k % 10 == 3 || (700..712).contains(&k);
        let stream = read(&table(|_| 0.0, is_lost), &SensorRow::default()).unwrap();
        assert!((0.06..0.14).contains(&stream.lost), "{}", stream.lost);
        let [_, time] = errors(&stream);
        assert!(time < 0.01, "less than a period: {time}");
        // A long gap stays one.
        let is_lost = |k: u32| (700..760).contains(&k);
        let stream = read(&table(|_| 0.0, is_lost), &SensorRow::default()).unwrap();
        assert_eq!(stream.gaps.len(), 1, "{:?}", stream.gaps);
        assert!(stream.at(7.3).is_none());
    }

    #[test]
    fn accelerations_are_turned_to_the_axes_of_the_orientation() {
        let sensor = SensorRow {
            acceleration_turn_deg: 90.0,
            ..SensorRow::default()
        };
        let stream = read(&table(|_| 0.0, |_| false), &sensor).unwrap();
        let force = stream.at(1.0).unwrap().specific_force;
        assert!(
            (force - Vector3::new(2.0, -1.0, STANDARD_GRAVITY)).norm() < 1e-6,
            "{force}"
        );
    }

    #[test]
    fn times_that_fall_are_refused_and_long_rests_stay_bounded() {
        let text = table(|_| 0.0, |_| false);
        let wrong = text.replacen("\n0.002", "\n1.002", 1);
        let said = read(&wrong, &SensorRow::default()).unwrap_err().to_string();
        assert!(said.contains("times that rise"), "{said}");
        let mut long = text;
        for k in 0..2000 {
            long += &format!("{}.5,1,0,0,0,0,0,0,5000,0,0\n", 20 + 50 * k + k * k % 9);
        }
        let stream = read(&long, &SensorRow::default()).unwrap();
        assert!(stream.within([0.0, 1e9]).count() < 100_000);
    }

    proptest! {
        #[test]
        fn jitter_of_any_kind_leaves_the_turns(seed in 0_u32..1000, most in 0.0_f64..0.03) {
            let late = |k: u32| {
                let mixed = (k ^ (seed << 8)).wrapping_mul(2_654_435_761) >> 16;
                most * (f64::from(mixed & 0xFFFF) / 65_535.0).powi(3)
            };
            let stream = read(&table(late, |_| false), &SensorRow::default()).unwrap();
            let [_, time] = errors(&stream);
            prop_assert!(time < 0.005 + 0.5 * most, "{time}");
        }
    }
}
