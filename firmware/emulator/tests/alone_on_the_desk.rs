//! The unit without a host or a suit in flights of the independent simulator, on the desk: its person differs from the
//! one that is configured, flies in postures that the unit does not know, and something may act that no model has.

use std::fmt::Write as _;
use std::io::Cursor;
use std::path::Path;

use bodyflight_emulator::sensed::{Errors, Sensed, is_consistent};
use bodyflight_laboratory::sensor_bytes::{Magnetometer, Raw, SensorBytes};
use bodyflight_unit::monitor::Input;
use bodyflight_unit::sensor_line;
use nalgebra::Vector3;

/// Names of the flights' folders, with what acts in them.
const FLIGHTS: [&str; 12] = [
    "asym-slow-112",
    "damping-mixed-108",
    "legs_drag-slow-107",
    "mass-mixed-105",
    "none-mixed-102",
    "none-slow-101",
    "none-wide-103",
    "pitch_input-wide-111",
    "rig-constant-106",
    "unknown_shake-slow-109",
    "updraft-mixed-110",
    "wind-slow-104",
];

/// Errors after the first three seconds of a flight that begins at `start` (s).
fn flown(sensed: &Sensed, start: f64, only_consistent: bool) -> Errors {
    let bytes: Vec<u8> = sensed.bytes.iter().flat_map(|(_, b)| b.clone()).collect();
    let input = Input::new(Cursor::new(bytes), Path::new("a flight"));
    let (flight, report) = sensor_line::run(&sensed.setup, &input, |_| ()).unwrap();
    assert_eq!((report.missing, report.estimates_bad), (0, 0));
    let estimates = (flight.estimates()).map(|(time, estimate)| (time - start, estimate));
    let estimates = estimates.filter(|(time, _)| *time > 3.0);
    sensed.errors(estimates.filter(|(_, estimate)| !only_consistent || is_consistent(estimate)))
}

/// A sensor, the limits of its errors: velocity, horizontal and vertical (m/s), and the share of estimates that must
/// agree with the measurements, at least and at most.
struct Kind {
    name: &'static str,
    sensor: SensorBytes,
    limits: [f64; 2],
    consistent: [f64; 2],
}

/// Nearly all, and nearly none.
const ALL: [f64; 2] = [0.95, 1.0];
const NONE: [f64; 2] = [0.0, 0.05];

const KINDS: [Kind; 9] = [
    Kind {
        name: "accelerometer, receiver at 5 Hz",
        sensor: SensorBytes::TYPICAL,
        limits: [0.15, 0.2],
        consistent: ALL,
    },
    Kind {
        name: "receiver at 5 Hz",
        sensor: SensorBytes {
            specific_force: None,
            ..SensorBytes::TYPICAL
        },
        limits: [0.3, 0.4],
        consistent: ALL,
    },
    // The wind stays unknown without a receiver: up to 8 m/s in one of the flights.
    Kind {
        name: "accelerometer",
        sensor: SensorBytes {
            receiver_rate: 0.0,
            ..SensorBytes::TYPICAL
        },
        limits: [9.0, 1.0],
        consistent: ALL,
    },
    Kind {
        name: "neither",
        sensor: SensorBytes {
            specific_force: None,
            receiver_rate: 0.0,
            ..SensorBytes::TYPICAL
        },
        limits: [9.0, 2.0],
        consistent: ALL,
    },
    Kind {
        name: "solutions twice as late as configured",
        sensor: SensorBytes {
            latency: 0.2,
            ..SensorBytes::TYPICAL
        },
        limits: [0.25, 0.2],
        consistent: ALL,
    },
    Kind {
        name: "receiver worse than it states",
        sensor: SensorBytes {
            velocity: [0.5, 1.0],
            ..SensorBytes::TYPICAL
        },
        limits: [0.4, 0.6],
        consistent: NONE,
    },
    Kind {
        name: "receiver at 1 Hz",
        sensor: SensorBytes {
            receiver_rate: 1.0,
            ..SensorBytes::TYPICAL
        },
        limits: [0.2, 0.3],
        consistent: ALL,
    },
    Kind {
        name: "receiver at 10 Hz",
        sensor: SensorBytes {
            receiver_rate: 10.0,
            ..SensorBytes::TYPICAL
        },
        limits: [0.15, 0.2],
        consistent: ALL,
    },
    Kind {
        name: "poor accelerometer",
        sensor: SensorBytes {
            specific_force: Some([1.0, 0.5]),
            ..SensorBytes::TYPICAL
        },
        limits: [0.3, 0.4],
        consistent: [0.8, 1.0],
    },
];

#[test]
fn attitude_and_velocity_are_right_without_a_posture() {
    let mut rows = String::new();
    let mut means = String::new();
    for kind in KINDS {
        let (mut squares, mut consistent_mean) = ([0.0; 5], 0.0);
        for name in FLIGHTS {
            let flight = format!("{name}/flight-0");
            let Some(sensed) = Sensed::of(&flight, 30.0, &kind.sensor).unwrap() else {
                return;
            };
            let found = flown(&sensed, 0.0, false);
            let numbers = [
                found.horizontal,
                found.vertical,
                found.attitude.to_degrees(),
                found.muscle,
                found.muscle_deviations,
            ];
            for (sum, number) in squares.iter_mut().zip(numbers) {
                *sum += number * number / FLIGHTS.len() as f64;
            }
            consistent_mean += found.consistent / FLIGHTS.len() as f64;
            let place = format!("{}, {name}", kind.name);
            writeln!(rows, "{}", row(&place, found.consistent, numbers)).unwrap();
            let [horizontal, vertical] = kind.limits;
            let [least, most] = kind.consistent;
            assert!(found.horizontal < horizontal, "{place}: {found:?}");
            assert!(found.vertical < vertical, "{place}: {found:?}");
            assert!(
                (least..=most).contains(&found.consistent),
                "{place}: {found:?}"
            );
            assert!(found.attitude.to_degrees() < 1.2, "{place}: {found:?}");
            assert!(found.muscle_deviations < 1.5, "{place}: {found:?}");
        }
        writeln!(
            means,
            "{}",
            row(kind.name, consistent_mean, squares.map(f64::sqrt))
        )
        .unwrap();
    }
    eprintln!("{rows}\n{means}");
}

/// Headings of the flight against the sensor's own north (rad), and rates of the receiver (Hz).
const HEADINGS: [f64; 5] = [0.0, 1.0, 2.0, 3.1, -1.5];
const RATES: [f64; 3] = [1.0, 5.0, 10.0];
/// Noise of the receiver's velocity, horizontal and vertical (m/s), of which it states 0.25.
const NOISES: [[f64; 2]; 2] = [[0.1, 0.2], [0.25, 0.375]];
/// A sensor of rates and forces alone, three seconds at rest before the flight.
const RAW: Raw = Raw {
    rest: 3.0,
    bias: 0.01,
    scale: 0.005,
    magnetometer: None,
};

/// The same after a longer rest than any assumption lasts.
const RESTED: Raw = Raw { rest: 15.0, ..RAW };

/// Such a sensor does not know where north is. The receiver tells it where the velocity changes, as after an exit; before,
/// nothing that is estimated agrees with the measurements.
#[test]
fn a_sensor_without_an_orientation_finds_north_by_the_receiver() {
    let (mut agreeing, mut all) = (0.0, 0.0);
    for (receiver_rate, velocity) in RATES
        .into_iter()
        .flat_map(|rate| NOISES.map(|of| (rate, of)))
    {
        let sensor = SensorBytes {
            receiver_rate,
            velocity,
            raw: Some(RAW),
            ..SensorBytes::TYPICAL
        };
        for heading in HEADINGS {
            // Our own model's flight: only it has an exit.
            let exit = Sensed::of_maneuver("exit-and-tracking", 20.0, &sensor).unwrap();
            let exit = exit.turned(heading, &sensor);
            let found = flown(&exit, RAW.rest, true);
            let degrees = found.attitude.to_degrees();
            let place = format!("{receiver_rate} Hz, {} m/s, {heading} rad", velocity[0]);
            agreeing += found.count;
            all += 1020.0;
            eprintln!(
                "{place}: {:.0} of 1020 estimates after three seconds, {:.2}, {:.2} m/s, {degrees:.1} deg",
                found.count, found.horizontal, found.vertical
            );
            let is_right = found.horizontal < 1.0 && found.vertical < 0.5 && degrees < 8.0;
            assert!(found.count == 0.0 || is_right, "{place}: {found:?}");
        }
    }
    assert!(agreeing > 0.5 * all, "{agreeing} of {all}");
}

/// From the exit on, at another velocity than the fall that is assumed: nothing agrees with the sensors that only follows
/// from the assumption.
#[test]
fn a_velocity_that_is_only_assumed_agrees_with_nothing() {
    for (raw, receiver_rate, latency, specific_force) in [
        (None, 1.0, 0.1, Some([0.02, 0.05])),
        (None, 5.0, 0.1, Some([0.02, 0.05])),
        (None, 5.0, 0.1, None),
        (None, 0.5, 1.0, Some([0.02, 0.05])),
        (None, 0.5, 1.0, None),
        (Some(RAW), 1.0, 0.1, Some([0.02, 0.05])),
        (Some(RAW), 5.0, 1.0, Some([0.02, 0.05])),
        (Some(RESTED), 5.0, 1.0, Some([0.02, 0.05])),
        (Some(RESTED), 0.5, 0.1, Some([0.02, 0.05])),
    ] {
        let sensor = SensorBytes {
            receiver_rate,
            latency,
            raw,
            specific_force,
            ..SensorBytes::TYPICAL
        };
        let exit = Sensed::of_maneuver("exit-and-tracking", 8.0, &sensor).unwrap();
        let bytes: Vec<u8> = exit.bytes.iter().flat_map(|(_, b)| b.clone()).collect();
        let input = Input::new(Cursor::new(bytes), Path::new("a flight"));
        let (flight, _) = sensor_line::run(&exit.setup, &input, |_| ()).unwrap();
        let start = raw.map_or(0.0, |raw| raw.rest);
        let place = format!(
            "orientation {}, {receiver_rate} Hz, {latency} s late",
            raw.is_none()
        );
        let (mut agreeing, mut all, mut worst) = (0.0, 0.0, 0.0_f32);
        for (time, estimate) in flight.estimates() {
            let time = time - start;
            let Some((velocity, _)) = exit.truth(time).filter(|_| time > 0.0) else {
                continue;
            };
            all += 1.0;
            if is_consistent(estimate) {
                agreeing += 1.0;
                worst = worst.max((Vector3::from(estimate.velocity) - velocity).norm());
            }
        }
        eprintln!("{place}: {agreeing:.0} of {all:.0} agree, at most {worst:.1} m/s off");
        // As long as nothing is measured, the deviation is up to 6 m/s.
        let is_prompt = latency * receiver_rate <= 0.5 && receiver_rate >= 1.0;
        assert!(
            worst < if is_prompt { 2.5 } else { 8.0 },
            "{place}: {worst}"
        );
        // The barometer lags behind the acceleration of an exit, and is the only one to say so at 1 Hz.
        assert!(!is_prompt || agreeing > 0.7 * all, "{place}: {agreeing}");
    }
}

/// Flights of the independent simulator that begin in a steady fall: whatever agrees must be right.
#[test]
fn without_a_change_of_velocity_north_stays_unknown() {
    let sensor = SensorBytes {
        raw: Some(RAW),
        ..SensorBytes::TYPICAL
    };
    for (name, heading) in FLIGHTS.iter().zip(HEADINGS.iter().cycle()) {
        let flight = format!("{name}/flight-0");
        let Some(sensed) = Sensed::of(&flight, 30.0, &sensor).unwrap() else {
            return;
        };
        let found = flown(&sensed.turned(*heading, &sensor), RAW.rest, true);
        let degrees = found.attitude.to_degrees();
        eprintln!(
            "{name}: {:.0} estimates, {:.2}, {:.2} m/s, {degrees:.1} deg",
            found.count, found.horizontal, found.vertical
        );
        let is_right = found.horizontal < 1.0 && found.vertical < 0.5 && degrees < 8.0;
        assert!(found.count == 0.0 || is_right, "{name}: {found:?}");
    }
}

/// Fields and their dips (rad), with iron near the sensor: nobody tells the unit where north is but they.
const FIELDS: [(f64, f64); 3] = [(1.1, 0.0), (0.4, 0.15), (-1.2, -0.1)];

/// Without a receiver the heading is that of the field, whatever it was on the ground: estimates that agree are right but
/// for the declination.
#[test]
fn a_magnetometer_tells_north_without_a_receiver() {
    let mut agreeing = 0;
    for ((name, heading), (dip, declination)) in (FLIGHTS.iter())
        .zip(HEADINGS.iter().cycle())
        .zip(FIELDS.into_iter().cycle())
    {
        let magnetometer = Some(Magnetometer {
            dip,
            declination,
            error: [0.01, 0.005],
        });
        let sensor = SensorBytes {
            receiver_rate: 0.0,
            raw: Some(Raw {
                magnetometer,
                ..RAW
            }),
            ..SensorBytes::TYPICAL
        };
        let Some(sensed) = Sensed::of(&format!("{name}/flight-0"), 12.0, &sensor).unwrap() else {
            return;
        };
        let found = flown(&sensed.turned(*heading, &sensor), RAW.rest, true);
        let degrees = found.attitude.to_degrees();
        let declination = declination.to_degrees();
        eprintln!(
            "{name}: {:.0} estimates, {degrees:.1} deg, of which {declination:.1} are the field's",
            found.count
        );
        agreeing += u32::from(found.count > 0.0);
        let is_right = degrees < declination.abs() + 6.0;
        assert!(found.count == 0.0 || is_right, "{name}: {found:?}");
    }
    assert!(agreeing >= 6, "{agreeing}");
}

/// A row of a table: velocity, horizontal and vertical (m/s), attitude (deg), muscle input, and that in its deviations.
fn row(name: &str, consistent: f64, [a, b, c, d, e]: [f64; 5]) -> String {
    let share = 100.0 * consistent;
    format!("| {name} | {share:.0} % | {a:.2}, {b:.2} | {c:.2} | {d:.2}, {e:.1} |")
}
