//! Estimated inputs of a flight, for the page.

use serde::Serialize;

use super::series::{Packed, RATE, Series};
use bodyflight_estimation::report::Point;
use bodyflight_estimation::request::Request;
use bodyflight_io::diagnostic::Result;
use bodyflight_mvnx::recording::Options;
use bodyflight_replay::Precision;
use bodyflight_replay::flight::Flight;

/// The columns: muscle input and damping, each in pitch, yaw and roll, and their standard deviations.
const COLUMNS: [(&str, usize, f64); 3] = [
    ("time_s", 1, 1e-4),
    ("inputs", 6, 1e-3),
    ("deviation", 6, 1e-3),
];

/// Estimated inputs over time.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Estimated {
    /// Columns over time.
    pub series: Packed,
    /// Why they should not be trusted.
    pub doubt: Option<String>,
}

/// Estimates a flight's inputs as requested.
///
/// # Errors
/// Same as [`Request::run`].
pub fn estimated(
    flight: &Flight,
    request: &Request,
    options: Options,
    progress: &mut dyn FnMut(f64),
) -> Result<Estimated> {
    let estimation = request.run(flight, options, Precision::Double, progress)?;
    Ok(Estimated {
        series: series(&estimation.points).packed(),
        doubt: estimation.report.doubt,
    })
}

/// [`RATE`] rows a second, and the last.
fn series(points: &[Point]) -> Series {
    let mut series = Series::new(&COLUMNS);
    let mut due = f64::NEG_INFINITY;
    for (index, point) in points.iter().enumerate() {
        // Some slack, since the rates need not divide evenly.
        if point.time < due - 1e-3 && index + 1 < points.len() {
            continue;
        }
        due = point.time + 1.0 / RATE;
        let [_, deviation @ ..] = point.deviation.columns();
        series.push(point.inputs.columns().into_iter().chain(deviation));
    }
    series
}

#[cfg(test)]
mod tests {
    use super::*;
    use bodyflight_core::maneuver::Maneuver;
    use bodyflight_estimation::motion::Method;
    use bodyflight_replay::preset_file::{AUTO, Tuning};

    use bodyflight_laboratory::synthesize::{self, synthesize};
    use bodyflight_replay::subject::Subject;

    #[test]
    fn true_inputs_are_within_the_bands() {
        let folder = tempfile::tempdir().unwrap();
        let maneuver = Maneuver::from_name("aggressive-turns").unwrap();
        let subject = Subject::default();
        let flown = synthesize::Request::new(maneuver, &subject, 1);
        let flown = synthesize(&flown, folder.path(), &mut |_| {}).unwrap();
        let flight = Flight::read(&flown.flight).unwrap();
        let request = Request {
            tuning: Tuning::find(AUTO).unwrap(),
            method: Method::Filter,
            filter: None,
        };
        let found = request.run(&flight, Options::default(), Precision::Double, &mut |_| {});
        let series = series(&found.unwrap().points);
        let [times, inputs, deviations] =
            ["time_s", "inputs", "deviation"].map(|name| series.column(name));
        let rate = series.rows() as f64 / flown.duration_s;
        assert!((rate - RATE).abs() < 2.0, "{rate} rows a second");
        // The flight uses yaw input.
        let (mut within, mut largest) = (0, 0.0_f64);
        for (row, time) in times[0].iter().enumerate() {
            let known = flight.inputs_at(*time).muscle.yaw;
            let bar = 2.0 * deviations[1][row];
            within += usize::from((inputs[1][row] - known).abs() < bar);
            largest = largest.max(known.abs() / bar);
        }
        let share = within as f64 / series.rows() as f64;
        assert!(share > 0.8, "{share} within the bands");
        assert!(largest > 2.0, "the bands hide what is flown: {largest}");
    }
}
