//! Postures from raw sensors on the limbs, against the truth of simulated falls and of recordings.

use std::collections::BTreeMap;
use std::path::Path;

use bodyflight_core::maneuver::Maneuver;
use bodyflight_core::sensor_noise::SensorNoise;
use bodyflight_core::suit::placement::of_size;
use bodyflight_core::suit::strapdown::Reading;
use bodyflight_core::{Posture, Segment};
use bodyflight_laboratory::limb_sensors::{Fault, LimbSensors, Sizes, Streams};
use bodyflight_laboratory::synthesize::{JointError, Request, fly};
use bodyflight_mocap::imu::mapping::ImuMapping;
use bodyflight_mocap::imu::stream::Stream;
use bodyflight_mocap::imu::worn::{Worn, worn};
use bodyflight_mvnx::recording::FlightFrame;
use bodyflight_replay::flight::Flight;
use bodyflight_replay::subject::Subject;
use nalgebra::Vector3;

/// A flight without noise.
fn flown(name: &str, seed: u64) -> Vec<FlightFrame> {
    let subject = Subject::default();
    let flight = Flight::bare(Path::new(""));
    let request = Request {
        maneuver: Maneuver::from_name(name).expect("a known maneuver"),
        subject: &subject,
        density: 1.0,
        seed,
        noise: SensorNoise::NONE,
        joint_error: JointError::default(),
        sway: 0.02,
        tunnel: false,
    };
    let mut frames = Vec::new();
    let mut each = |frame: FlightFrame| {
        frames.push(frame);
        Ok(())
    };
    fly(&request, &flight.dynamics(4000.0), &mut each, &mut |_| {}).expect("a flight");
    frames
}

/// What the program makes of the sensors' readings.
fn read(streams: &Streams, mapping: &str) -> bodyflight_io::diagnostic::Result<Worn> {
    let mapping = ImuMapping::parse(mapping, Path::new("mapping.toml"))?;
    let sensors: Vec<(Segment, Stream)> = streams
        .sensors
        .iter()
        .map(|(segment, rows)| {
            let times = rows.iter().map(|row| row.0).collect();
            let readings = rows.iter().map(|(_, rate, force)| Reading {
                angular_velocity: *rate,
                specific_force: *force,
            });
            Ok((*segment, Stream::new(times, readings.collect())?))
        })
        .collect::<bodyflight_io::diagnostic::Result<_>>()?;
    let body = Subject::default().body();
    worn(&mapping, &sensors, &body, &mut |_| Ok(()))
}

/// Errors of a set over a flight, RMS (degrees): of the orientation about an axis by segment, its stated deviation, the
/// direction of all limbs relative to the pelvis, and the pelvis' tilt.
struct Errors {
    actual: BTreeMap<Segment, f64>,
    stated: BTreeMap<Segment, f64>,
    direction: f64,
    tilt: f64,
}

fn errors(worn: &Worn, frames: &[FlightFrame]) -> Errors {
    let mut squares = BTreeMap::new();
    let (mut directions, mut tilts) = (0.0, 0.0);
    let mut count = 0.0;
    let limbs = Segment::ALL.into_iter().skip(1);
    for (time, seen) in &worn.frames {
        let Some(truth) = frames.iter().rev().find(|frame| frame.time <= time + 1e-6) else {
            continue;
        };
        count += 1.0;
        let true_segments = truth.posture.body_from_segments();
        for segment in limbs.clone() {
            let found = seen.orientations[segment].body_from_segment;
            let off = found * true_segments[segment].inverse();
            *squares.entry(segment).or_insert(0.0) += off.scaled_axis().norm_squared() / 3.0;
            let along = Vector3::z();
            let angle = (found * along).angle(&(true_segments[segment] * along));
            directions += angle * angle / 15.0;
        }
        let up = |attitude: &nalgebra::UnitQuaternion<f64>| attitude.inverse() * Vector3::z();
        let found = up(seen.inertial_from_body.quaternion());
        tilts += found
            .angle(&up(truth.pelvis.inertial_from_body.quaternion()))
            .powi(2);
    }
    let root = |square: f64| (square / count).sqrt().to_degrees();
    Errors {
        actual: squares
            .iter()
            .map(|(s, square)| (*s, root(*square)))
            .collect(),
        stated: limbs.map(|s| (s, worn.deviation[s].to_degrees())).collect(),
        direction: root(directions),
        tilt: root(tilts),
    }
}

/// The sensors of a set in a flight, by the errors of a seed.
fn streams(
    frames: &[FlightFrame],
    count: usize,
    seed: u64,
    fault: Option<(Segment, Fault)>,
) -> Streams {
    let sensors = LimbSensors {
        seed,
        segments: of_size(count).expect("a set"),
        sizes: Sizes::TYPICAL,
        fault,
    };
    sensors.of(&Subject::default().body(), frames)
}

#[test]
fn measured_table() {
    for name in [
        "vertical",
        "rotations",
        "transitions",
        "exit-and-tracking",
        "aggressive-turns",
        "layouts",
    ] {
        for count in [16, 10, 8, 5] {
            let mut rows = Vec::new();
            for seed in 1..=3 {
                let frames = flown(name, seed);
                let streams = streams(&frames, count, seed, None);
                let worn = read(&streams, &streams.mapping()).expect("a calibrated set");
                let found = errors(&worn, &frames);
                let mean = |m: &BTreeMap<Segment, f64>| {
                    (m.values().map(|v| v * v).sum::<f64>() / 15.0).sqrt()
                };
                rows.push(format!(
                    "dir {:.1} axis {:.1} stated {:.1} tilt {:.1} {:?}",
                    found.direction,
                    mean(&found.actual),
                    mean(&found.stated),
                    found.tilt,
                    worn.doubts
                ));
                if seed == 1 && count == 10 {
                    for (s, a) in &found.actual {
                        eprintln!("   {} {:.1} stated {:.1}", s.name(), a, found.stated[s]);
                    }
                    eprintln!("{:?}", worn.notes);
                }
            }
            eprintln!("{name} {count}: {rows:#?}");
        }
    }
    let _ = Posture::<f64>::h_pose();
}
