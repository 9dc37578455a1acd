//! Turns the fixes of any format into samples: a flat map, an increasing clock, velocities by direction and speed.

use bodyflight_falls::channels::{Given, with_velocities};
use bodyflight_falls::{Sample, median};
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::text::number;
use nalgebra::Vector3;

use crate::track::Track;

/// Metres per degree of latitude, for the mean radius of the Earth.
const METRES_PER_DEGREE: f64 = 6_371_008.8 * core::f64::consts::PI / 180.0;

/// A fix as a logger writes it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Point {
    /// Time (s), since 1970 if the format has a date.
    pub(crate) time: f64,
    /// Latitude and longitude (degrees).
    pub(crate) place: [f64; 2],
    /// Height (m).
    pub(crate) height: f64,
    /// Horizontal speed (m/s), if given.
    pub(crate) speed: Option<f64>,
}

/// Converts latitudes and longitudes (degrees) to positions north and west of the first one (m).
#[derive(Default)]
pub(crate) struct Flat {
    /// Latitude and longitude of the first one, and the length of a degree of longitude there, as a fraction of one of
    /// latitude.
    origin: Option<([f64; 2], f64)>,
}

impl Flat {
    pub(crate) fn position(
        &mut self,
        [latitude, longitude]: [f64; 2],
        height: f64,
    ) -> Vector3<f64> {
        let ([first_latitude, first_longitude], narrower) = *self
            .origin
            .get_or_insert_with(|| ([latitude, longitude], latitude.to_radians().cos()));
        // Also correct across the date line.
        let east = (longitude - first_longitude + 540.0).rem_euclid(360.0) - 180.0;
        Vector3::new(
            (latitude - first_latitude) * METRES_PER_DEGREE,
            -east * METRES_PER_DEGREE * narrower,
            height,
        )
    }
}

/// Seconds until the ten bits of a GPS week are used up: receivers with old firmware then report a date 1024 weeks
/// earlier.
const ROLLOVER: f64 = 1024.0 * 604_800.0;

/// Largest difference of a step from a rollover (s), and the largest step back that is a single bad row (s).
const NEAR: f64 = 60.0;
const BACK: f64 = 5.0;

/// Sets the clock of rows right: adds the weeks of a rollover, skips rows that step back, and keeps the longest run if
/// the clock was set back. Returns the rows, how many were left out, and what was done, in sentences.
pub(crate) fn in_order<T>(
    mut rows: Vec<T>,
    time: impl Fn(&mut T) -> &mut f64,
) -> (Vec<T>, usize, Vec<String>) {
    let mut last = f64::NEG_INFINITY;
    let is_later = |row: &mut T| {
        let before = core::mem::replace(&mut last, *time(row));
        before < last
    };
    // Most tracks need nothing, and no second copy.
    if rows.iter_mut().all(is_later) {
        return (rows, 0, Vec::new());
    }
    let mut runs: Vec<(Vec<T>, f64)> = Vec::new();
    let (mut skipped, mut added, mut notes) = (0, 0.0, Vec::new());
    for mut row in rows {
        *time(&mut row) += added;
        let own = *time(&mut row);
        let Some((run, last)) = runs.last_mut() else {
            runs.push((vec![row], own));
            continue;
        };
        let back = *last - own;
        if (back - ROLLOVER).abs() < NEAR {
            added += ROLLOVER;
            *time(&mut row) += ROLLOVER;
            notes.push("the clock falls back by 1024 weeks, which is corrected".to_owned());
        } else if back > BACK {
            runs.push((vec![row], own));
            continue;
        }
        let own = *time(&mut row);
        if own > *last {
            *last = own;
            run.push(row);
        } else {
            skipped += 1;
        }
    }
    let all: usize = runs.iter().map(|(run, _)| run.len()).sum();
    let longest = runs.into_iter().map(|(run, _)| run).max_by_key(Vec::len);
    let longest = longest.unwrap_or_default();
    if longest.len() < all {
        let others = all - longest.len();
        skipped += others;
        notes.push(format!(
            "the clock is set back within the file: the longest run is used, and {others} rows of others are not"
        ));
    }
    (longest, skipped, notes)
}

/// Largest height of a point (m).
pub(crate) const HIGHEST: f64 = 200_000.0;

/// Largest difference of the median ratio of speeds from one at which the speeds are used.
const ALIKE: f64 = 0.1;

/// Makes a track of points. `has_date` says whether their times count from 1970.
pub(crate) fn track(
    format: &'static str,
    points: Vec<Point>,
    skipped: usize,
    has_date: bool,
) -> Result<Track> {
    if points.is_empty() {
        return Err(Problem::bad_input(format!(
            "expected points with time, position and height in this {format} file, found none"
        ))
        .help("routes and waypoints have no times; export the track"));
    }
    let all = points.len();
    let points: Vec<Point> = points
        .into_iter()
        .filter(|point| point.height.abs() < HIGHEST)
        .collect();
    let skipped = skipped + all - points.len();
    let (points, out_of_order, mut notes) = in_order(points, |point| &mut point.time);
    let mut flat = Flat::default();
    let first = points.first().map_or(0.0, |point| point.time);
    let mut samples: Vec<Sample> = points
        .iter()
        .map(|point| Sample {
            time: point.time - first,
            position: flat.position(point.place, point.height),
            velocity: Vector3::zeros(),
        })
        .collect();
    let has_speeds = points.iter().filter(|point| point.speed.is_some()).count() * 2 > points.len();
    let mut given = Given {
        places: true,
        velocities: false,
        speeds: false,
    };
    if has_speeds {
        with_velocities(&mut samples);
        given.speeds = with_speeds(&mut samples, &points, &mut notes);
    }
    Ok(Track {
        format,
        samples,
        start: has_date.then_some(first),
        given,
        speed_accuracy: Vec::new(),
        position_accuracy: Vec::new(),
        inertial: Vec::new(),
        pressure: Vec::new(),
        skipped: skipped + out_of_order,
        notes,
    })
}

/// Gives the horizontal velocities of the positions the measured speeds, if these agree with them. Returns whether they
/// do.
fn with_speeds(samples: &mut [Sample], points: &[Point], notes: &mut Vec<String>) -> bool {
    const MOVES: f64 = 5.0;
    let ratios = samples.iter().zip(points).filter_map(|(sample, point)| {
        let across = sample.across();
        (across > MOVES).then_some(point.speed? / across)
    });
    let Some(ratio) = median(ratios).filter(|ratio| (ratio - 1.0).abs() < ALIKE) else {
        notes.push(
            "the speeds of the points disagree with their positions, and are not used".to_owned(),
        );
        return false;
    };
    for (sample, point) in samples.iter_mut().zip(points) {
        let across = sample.across();
        if let Some(speed) = point.speed.filter(|_| across > 1.0) {
            let scale = (speed / across).clamp(0.5, 2.0) / ratio;
            sample.velocity.x *= scale;
            sample.velocity.y *= scale;
        }
    }
    notes.push(
        "horizontal velocities have the direction of the positions and the speed of the points"
            .to_owned(),
    );
    true
}

/// Seconds since 1970 of a date and a time of day (s).
pub(crate) fn seconds_of(year: i32, month: u32, day: u32, time_of_day: f64) -> Option<f64> {
    let date = chrono::NaiveDate::from_ymd_opt(year, month, day)?;
    let days = date.signed_duration_since(chrono::NaiveDate::from_ymd_opt(1970, 1, 1)?);
    #[expect(
        clippy::cast_precision_loss,
        reason = "exact for any date of the calendar"
    )]
    Some(days.num_days() as f64 * 86_400.0 + time_of_day)
}

/// Seconds since 1970 of a time such as `2023-10-08T21:36:27.798Z`, also with an offset from UTC.
pub(crate) fn seconds_of_text(text: &str) -> Option<f64> {
    let text = text.trim();
    let time = chrono::DateTime::parse_from_rfc3339(text).map(|time| time.to_utc());
    let time = time.or_else(|_| {
        chrono::NaiveDateTime::parse_from_str(text.trim_end_matches('Z'), "%Y-%m-%dT%H:%M:%S%.f")
            .map(|time| time.and_utc())
    });
    #[expect(
        clippy::cast_precision_loss,
        reason = "exact for dates before the year 2255"
    )]
    time.ok().map(|time| time.timestamp_micros() as f64 * 1e-6)
}

/// Day and time of a time since 1970 (s, UTC), such as `2024-06-01 10:00:40`; `None` outside the calendar.
pub fn date(unix: f64) -> Option<String> {
    #[expect(
        clippy::cast_possible_truncation,
        reason = "a time outside the calendar has no date"
    )]
    let time = chrono::DateTime::from_timestamp(unix.round() as i64, 0)?;
    Some(format!("{} {}", time.date_naive(), time.time()))
}

/// A number within plus or minus `most`.
pub(crate) fn within(text: &str, most: f64) -> Option<f64> {
    let number = number(text.trim())?;
    (number.abs() <= most).then_some(number)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ordered(times: &[f64]) -> (Vec<f64>, usize, Vec<String>) {
        in_order(times.to_vec(), |time| time)
    }

    #[test]
    fn a_rollover_is_corrected_and_the_longest_run_is_kept() {
        let (times, skipped, notes) =
            ordered(&[9e8, 9e8 + 1.0, 9e8 + 2.0 - ROLLOVER, 9e8 + 3.0 - ROLLOVER]);
        assert_eq!(times, [9e8, 9e8 + 1.0, 9e8 + 2.0, 9e8 + 3.0]);
        assert_eq!((skipped, notes.len()), (0, 1));
        let (times, skipped, notes) = ordered(&[100.0, 101.0, 100.5, 40.0, 41.0, 42.0]);
        assert_eq!(times, [40.0, 41.0, 42.0]);
        assert_eq!((skipped, notes.len()), (3, 1));
    }
}
