//! Bias, scale and mounting of each sensor, from the windows of the calibration.

use bodyflight_core::suit::mounting::{March, MountingError, Stances, fit};
use bodyflight_core::suit::rest::Rest;
use bodyflight_core::suit::set::Fitted;
use bodyflight_core::suit::strapdown::Strapdown;
use bodyflight_core::suit::tray::{Gyroscope, TurnError, Turns};
use bodyflight_core::{Body, Segment};
use bodyflight_io::diagnostic::{Problem, Result};
use nalgebra::{UnitQuaternion, Vector3};

use super::mapping::{ImuMapping, SensorRow, Windows};
use super::stream::Stream;
use super::windows::Found;

/// Standard deviation of the angular velocity of a person who stands still (rad/s), while a bias is taken.
const SWAY: f64 = 0.002;
/// Angle between up by the rates and by the forces from which they contradict each other (rad).
const DISAGREEMENT: f64 = 0.35;

/// A set of sensors that are ready for use.
pub(super) struct Calibrated {
    /// In the order of the streams.
    pub(super) fitted: Vec<Fitted<f64>>,
    /// End of the upright pose (s), in which attitudes begin.
    pub(super) begin_s: f64,
    /// Direction of up at the pelvis' sensor in the upright pose.
    pub(super) pelvis_up: Vector3<f64>,
    /// End of the last window (s).
    pub(super) end_s: f64,
    /// Remarks.
    pub(super) notes: Vec<String>,
}

impl Calibrated {
    /// Place of the sensor on the pelvis, in its frame (m).
    pub(super) fn pelvis_place(&self) -> Vector3<f64> {
        let pelvis = self
            .fitted
            .iter()
            .find(|fitted| fitted.segment == Segment::Pelvis);
        pelvis.map_or_else(Vector3::zeros, |fitted| fitted.place)
    }
}

/// Calibrates all sensors.
///
/// # Errors
/// Returns an error that names the sensor and the window if a pose was not held, or does not show a mounting.
pub(super) fn calibrated(
    mapping: &ImuMapping,
    windows: &Found,
    sensors: &[(Segment, &Stream)],
    body: &Body<f64>,
) -> Result<Calibrated> {
    let given = &mapping.calibration;
    let mut notes: Vec<String> = windows.note.iter().cloned().collect();
    let rows = mapping.rows()?;
    let mut fitted = Vec::new();
    for ((segment, stream), (_, row)) in sensors.iter().zip(&rows) {
        let one = sensor(*segment, stream, windows, given, &mut notes)
            .map_err(|problem| problem.at(format!("sensor {}", segment.name())))?;
        fitted.push(placed(one, row, body));
    }
    if windows.tray.is_none() && !sensors.iter().all(|(_, stream)| stream.is_fused) {
        notes.push(
            "no rest in a tray: biases are those of a person who stands, and drift more".to_owned(),
        );
    }
    if given.turns_s.is_empty() {
        notes.push("no full turns: the scales of the gyroscopes are those of the maker, and spins add to the errors".to_owned());
    }
    let ends = [Some(windows.upright), windows.bent, windows.march];
    Ok(Calibrated {
        fitted,
        begin_s: windows.upright[1],
        pelvis_up: pelvis_up(windows, sensors)?,
        end_s: ends
            .into_iter()
            .flatten()
            .fold(0.0, |end, [_, to]| end.max(to)),
        notes,
    })
}

fn pelvis_up(windows: &Found, sensors: &[(Segment, &Stream)]) -> Result<Vector3<f64>> {
    let pelvis = sensors
        .iter()
        .find(|(segment, _)| *segment == Segment::Pelvis);
    let (_, stream) =
        pelvis.ok_or_else(|| Problem::bad_input("expected a sensor on the pelvis"))?;
    up(&held(stream, windows.upright, "upright_s")?, "upright_s")
}

fn placed(fitted: Fitted<f64>, row: &SensorRow, body: &Body<f64>) -> Fitted<f64> {
    let at_cg = body.segments[fitted.segment].cg;
    Fitted {
        place: row.place_m.map_or(at_cg, Vector3::from),
        range: row.range_dps.map(f64::to_radians),
        ..fitted
    }
}

fn sensor(
    segment: Segment,
    stream: &Stream,
    windows: &Found,
    given: &Windows,
    notes: &mut Vec<String>,
) -> Result<Fitted<f64>> {
    let gyroscope = gyroscope(segment, stream, windows, given, notes)?;
    let upright = held(stream, windows.upright, "upright_s")?;
    let bent = match windows.bent {
        Some(window) => Some(up(&held(stream, window, "bent_s")?, "bent_s")?),
        None => None,
    };
    if let (Some(window), Some(bent)) = (windows.bent, &bent) {
        agrees(
            stream,
            &gyroscope,
            [windows.upright, window],
            [&up(&upright, "upright_s")?, bent],
        )?;
    }
    let march = windows.march.map(|window| {
        let mut march = March::default();
        for (step, reading) in stream.within(window) {
            march.take(&gyroscope.corrected(&reading.angular_velocity), step);
        }
        march
    });
    let stances = Stances {
        upright: up(&upright, "upright_s")?,
        bent,
        march,
    };
    let mounting = fit(segment, &stances, &UnitQuaternion::identity()).map_err(|error| {
        match error {
            MountingError::NoHeading => Problem::bad_input(
                "how it lies on its segment does not follow from the poses: it neither leaned in the bend nor swung to one side in the march",
            )
            .help("bend until the back is level, knees bent, and march with knees and hands high"),
            MountingError::Contradiction => Problem::bad_input(
                "bend and march contradict each other: the sensor is on another segment than the mapping says, or was turned in between",
            )
            .help("look whether it was exchanged with another one"),
        }
    })?;
    Ok(Fitted {
        segment,
        place: Vector3::zeros(),
        gyroscope,
        mounting,
        range: None,
    })
}

/// Checks that the rates turn up from one pose into that of the next (sensor axes).
fn agrees(
    stream: &Stream,
    gyroscope: &Gyroscope<f64>,
    [from, to]: [[f64; 2]; 2],
    [before, after]: [&Vector3<f64>; 2],
) -> Result<()> {
    let middle = |[begin, end]: [f64; 2]| 0.5 * (begin + end);
    let mut turned = Strapdown::new(UnitQuaternion::identity());
    for (step, reading) in stream.within([middle(from), middle(to)]) {
        turned.advance(&gyroscope.corrected(&reading.angular_velocity), step);
    }
    let expected = turned.reference_from_sensor.inverse() * before;
    let off = expected.angle(after);
    if off < DISAGREEMENT {
        return Ok(());
    }
    let message = format!(
        "rates and forces contradict each other between upright_s and bent_s: the rates turn it by {:.0} degrees, and up is {:.0} degrees from where that leads",
        turned.reference_from_sensor.angle().to_degrees(),
        off.to_degrees()
    );
    Err(Problem::bad_input(message).help("the axes of both must be the same and right-handed; check the order and signs of their columns, and the unit of the angular velocity"))
}

fn gyroscope(
    segment: Segment,
    stream: &Stream,
    windows: &Found,
    given: &Windows,
    notes: &mut Vec<String>,
) -> Result<Gyroscope<f64>> {
    let (window, name) = match windows.tray {
        Some(tray) => (tray, "tray_s"),
        None => (windows.upright, "upright_s"),
    };
    let rest = held(stream, window, name)?;
    let [from, to] = window;
    let mut gyroscope = Gyroscope::of_fusion();
    if !stream.is_fused {
        gyroscope.set_bias(&rest, to - from);
        if windows.tray.is_none() {
            gyroscope.bias_deviation = gyroscope.bias_deviation.hypot(SWAY);
        }
    }
    for turn in &given.turns_s {
        let mut turns = Turns::default();
        for (step, reading) in stream.within(*turn) {
            turns.take(&gyroscope.corrected(&reading.angular_velocity), step);
        }
        let [from, to] = turn;
        let place = format!("turns_s from {from} to {to} s");
        match gyroscope.set_gain(&turns) {
            Ok(_) => {}
            // A tray in which sensors lie askew calibrates no axis of theirs.
            Err(TurnError::NoAxis) => notes.push(format!(
                "{}: {place}: the turn is about none of its axes, and shows no scale",
                segment.name()
            )),
            Err(TurnError::NoTurn) => {
                return Err(Problem::bad_input(format!(
                    "{place}: expected full turns, found less than half a turn"
                )));
            }
            Err(TurnError::NotFull(angle)) => {
                return Err(Problem::bad_input(format!(
                    "{place}: expected full turns, found {:.2} turns",
                    angle / std::f64::consts::TAU
                ))
                .help("begin and end with the tray in the same direction"));
            }
        }
    }
    Ok(gyroscope)
}

/// A window in which the sensor must rest.
fn held(stream: &Stream, window: [f64; 2], name: &str) -> Result<Rest<f64>> {
    let mut rest = Rest::default();
    stream
        .within(window)
        .for_each(|(_, reading)| rest.take(reading));
    let [from, to] = window;
    let place = format!("{name} from {from:.1} to {to:.1} s");
    if rest.count() < 10 {
        let [begin, end] = stream.span();
        let message = format!(
            "{place}: expected samples, found {}; the sensor's are from {begin:.1} to {end:.1} s",
            rest.count()
        );
        return Err(Problem::bad_input(message));
    }
    if !rest.is_still() {
        let message = format!(
            "{place}: expected rest, found a rate that varies by {:.0} deg/s and a force of {:.2} m/s2",
            rest.rate_deviation().to_degrees(),
            rest.force().norm()
        );
        return Err(Problem::bad_input(message)
            .help("give a window in which the person holds still, or check the units"));
    }
    Ok(rest)
}

fn up(rest: &Rest<f64>, name: &str) -> Result<Vector3<f64>> {
    rest.up()
        .ok_or_else(|| Problem::bad_input(format!("{name}: no gravity is felt")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use bodyflight_core::suit::strapdown::Reading;

    /// Somebody sways while standing, by a degree in four seconds.
    #[test]
    fn swaying_is_no_bias_of_a_fusion() {
        let sway = Vector3::new(0.004, 0.0, 0.0);
        let reading = Reading {
            angular_velocity: sway,
            specific_force: Vector3::z() * 9.8,
        };
        let times = (0..500).map(|k| f64::from(k) * 0.01).collect();
        let mut stream = Stream::new(times, vec![reading; 500]).unwrap();
        let windows = Found {
            tray: None,
            upright: [0.5, 4.5],
            bent: None,
            march: None,
            note: None,
        };
        let given = Windows::default();
        let bias = |stream: &Stream| {
            let found = gyroscope(Segment::Thorax, stream, &windows, &given, &mut Vec::new());
            found.unwrap().bias
        };
        assert!((bias(&stream) - sway).norm() < 1e-9, "a raw one is taken");
        stream.is_fused = true;
        assert!(bias(&stream).norm() < 1e-9, "{}", bias(&stream));
    }
}
