//! Sensors on the limbs of a unit: from the bytes of their line to estimates, in simulated jumps.
#![expect(clippy::expect_used, reason = "tests may panic: that is how they fail")]

use std::io::Cursor;
use std::path::Path;

use bodyflight_core::link::{LimbTable, SensorKind, Setup};
use bodyflight_core::maneuver::Maneuver;
use bodyflight_core::sensor_noise::SensorNoise;
use bodyflight_core::suit::placement::of_size;
use bodyflight_core::{Posture, Segment};
use bodyflight_laboratory::limb_sensors::line::STANDING;
use bodyflight_laboratory::limb_sensors::{Fault, LimbSensors, Sizes, Streams};
use bodyflight_laboratory::synthesize::{self, Request};
use bodyflight_mvnx::recording::FlightFrame;
use bodyflight_replay::flight::Flight;
use bodyflight_replay::subject::Subject;
use bodyflight_unit::log::LoggedFlight;
use bodyflight_unit::monitor::Input;
use bodyflight_unit::sensor_line::{SensorReport, run};
use bodyflight_unit::stream::configuration_at;
use nalgebra::Vector3;

/// Length of the flights (s): an exit and what follows.
const SECONDS: f64 = 20.0;

/// A jump from the exit on, without noise.
fn flown(subject: &Subject) -> Vec<FlightFrame> {
    let flight = Flight::bare(Path::new(""));
    let maneuver = Maneuver::from_name("exit-and-tracking").expect("a known maneuver");
    let request = Request {
        noise: SensorNoise::NONE,
        ..Request::new(maneuver, subject, 2)
    };
    let mut frames = synthesize::flown(&request, &flight.dynamics(4000.0)).expect("a flight");
    frames.retain(|frame| frame.time <= SECONDS);
    frames
}

/// The readings of ten sensors, one perhaps with a fault.
fn streams(frames: &[FlightFrame], fault: Option<(Segment, Fault)>) -> Streams {
    let sensors = LimbSensors {
        seed: 2,
        segments: of_size(10).expect("a set"),
        sizes: Sizes::TYPICAL,
        fault,
    };
    sensors.of(&Subject::default().body(), frames)
}

/// What a unit makes of the line, which has no host: it calibrates the sensors by itself.
fn alone(setup: &Setup, line: Vec<u8>) -> (LoggedFlight, SensorReport) {
    let input = Input::new(Cursor::new(line), Path::new("a line"));
    run(setup, &input, |_| ()).expect("samples")
}

fn setup() -> Setup {
    let flight = Flight::bare(Path::new(""));
    let (configure, table) = configuration_at(&flight, 0.0, "auto", 100.0).expect("a setup");
    let mut setup = Setup {
        configure,
        table,
        limbs: LimbTable::new(),
    };
    setup.configure.sensor = SensorKind::Chain;
    setup
}

/// Error of the directions of the limbs but those of a forearm without sensor relative to the pelvis in the flight, root of
/// the mean square (degrees).
fn direction_error(found: &LoggedFlight, frames: &[FlightFrame], begin: f64, is_dead: bool) -> f64 {
    let (mut squares, mut count) = (0.0, 0.0);
    for (time, posture) in found.postures() {
        let truth = frames.partition_point(|frame| frame.time < time - begin);
        let Some(truth) = frames.get(truth).filter(|_| time > begin) else {
            continue;
        };
        let along = |posture: &Posture<f64>, segment: Segment| {
            posture.body_from_segments()[segment] * Vector3::z()
        };
        let follows_rule =
            |s: &Segment| is_dead && matches!(s, Segment::LeftForearm | Segment::LeftHand);
        for segment in Segment::ALL
            .into_iter()
            .skip(1)
            .filter(|s| !follows_rule(s))
        {
            let angle = along(&posture, segment).angle(&along(&truth.posture, segment));
            squares += angle.powi(2);
            count += 1.0;
        }
    }
    f64::to_degrees((squares / f64::max(count, 1.0)).sqrt())
}

#[test]
fn a_line_alone_gives_postures_and_estimates_and_a_dead_node_costs_its_segment_only() {
    let frames = flown(&Subject::default());
    let setup = setup();
    let mut errors = Vec::new();
    for fault in [None, Some((Segment::LeftForearm, Fault::Dead(4.0)))] {
        let streams = streams(&frames, fault);
        let line = streams.line();
        let bytes: Vec<u8> = line.iter().flat_map(|(_, bytes)| bytes.clone()).collect();
        let (flight, report) = alone(&setup, bytes);
        let limbs = report.limbs.as_ref().expect("sensors on the limbs");
        assert_eq!(limbs.calibrated.len(), 10);
        assert_eq!((report.missing, report.estimates_bad), (0, 0));
        // The first sample is the one at which the calibration ends.
        let end = line.last().expect("a line").0;
        let begin = flight.duration() - (end - streams.flight_s - STANDING);
        let error = direction_error(&flight, &frames, begin, fault.is_some());
        errors.push(error);
        let sure = flight.estimates().filter(|(time, _)| *time > begin + 6.0);
        let flags: Vec<_> = sure.map(|(_, estimate)| estimate.flags).collect();
        let consistent = flags.iter().filter(|flags| {
            use bodyflight_core::link::EstimateFlags as Flags;
            !flags.intersects(Flags::DOUBTFUL | Flags::LOST)
                && flags.contains(Flags::LIMB) == fault.is_some()
        });
        let share = consistent.count() as f64 / flags.len() as f64;
        assert!(share > 0.8, "{fault:?}: {share}");
        match fault {
            None => assert!(limbs.failed.is_empty(), "{:?}", limbs.failed),
            Some(_) => {
                assert_eq!(limbs.failed, ["l_forearm"]);
                let doubt = report.doubt.expect("a doubt");
                assert!(doubt.contains("l_forearm"), "{doubt}");
                assert!(limbs.deviations_deg[Segment::LeftForearm as usize] > 20.0);
            }
        }
    }
    eprintln!("directions {errors:.1?} degrees");
    assert!(errors.iter().all(|error| *error < 10.0), "{errors:?}");
}

#[test]
fn without_poses_nothing_is_claimed() {
    let frames = flown(&Subject::default());
    let streams = streams(&frames, None);
    // From the flight on: nobody ever stood still.
    let flight_s = streams.flight_s + STANDING;
    let line = streams.line();
    let rest = line.iter().filter(|(time, _)| *time > flight_s);
    let bytes: Vec<u8> = rest.flat_map(|(_, bytes)| bytes.clone()).collect();
    let input = Input::new(Cursor::new(bytes), Path::new("a line"));
    let problem = run(&setup(), &input, |_| ()).expect_err("no calibration");
    let message = problem.to_string();
    assert!(
        message.contains("10 sensors on the limbs are not calibrated"),
        "{message}"
    );
}
