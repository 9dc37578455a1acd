//! Flights by keyboard, flown by a scripted hand through the same code as in the page and saved as its flights are.
#![expect(clippy::expect_used, reason = "tests may panic: that is how they fail")]

use std::path::PathBuf;

use bodyflight_core::aerodynamics::load_model::LoadModel;
use bodyflight_core::body::Segment;
use bodyflight_core::frame::{Body, Vector};
use bodyflight_estimation::Estimation;
use bodyflight_estimation::motion::Method;
use bodyflight_estimation::request::Request;
use bodyflight_mvnx::recording::Options;
use bodyflight_replay::Precision;
use bodyflight_replay::comparison::Channel;
use bodyflight_replay::flight::{DEFAULT_DENSITY, Flight};
use bodyflight_replay::preset_file::{AUTO, Tuning};
use bodyflight_replay::subject::Subject;
use bodyflight_verbs::simulate::simulate;
use bodyflight_verbs::view::flown::{frames, write};
use bodyflight_verbs::view::page::setup;
use bodyflight_viewer::cockpit::{CONTROLS, Cockpit, STARTS};
use tempfile::TempDir;

const RATE: usize = 240;

/// What a hand does.
#[derive(Clone, Copy)]
enum Hand {
    /// Moves a control.
    Control(&'static str, f32),
    /// Tenses muscles in pitch, yaw and roll.
    Muscle([f32; 3]),
    /// Braces limbs, or lets them go.
    Tension(f32),
    /// Turns a joint: segment, axis, angle (rad).
    Joint(Segment, usize, f32),
}

/// A flight of the scripted hand.
struct Flown {
    path: PathBuf,
    /// Angle by which the pelvis turned about its own axes (rad).
    turned: Vector<f32, Body>,
    /// Largest tilt from the initial attitude (rad).
    tilt: f32,
    _folder: TempDir,
}

fn subject() -> Subject {
    let mut subject = Subject::default();
    subject.set_load_model(LoadModel::FreeFly);
    subject
}

/// Flies from the start of this name for some seconds, with what the hand does at which time (s), and saves the flight.
fn flown(start: &str, seconds: usize, hand: &[(f64, Hand)]) -> Flown {
    let subject = subject();
    let place = STARTS.iter().position(|known| known.name == start);
    let mut cockpit = Cockpit::new(&setup(&subject, DEFAULT_DENSITY), place.expect("a start"));
    cockpit.hold(true);
    let mut bytes = Vec::new();
    let (mut turned, mut tilt) = (Vector::zero(), 0.0f32);
    for step in 0..RATE * seconds {
        for (_, act) in hand
            .iter()
            .filter(|(at, _)| (at * RATE as f64).round() == step as f64)
        {
            match *act {
                Hand::Control(name, share) => {
                    let control = CONTROLS.iter().position(|known| known.name == name);
                    cockpit.command(control.expect("a control"), share);
                }
                Hand::Muscle(share) => cockpit.muscle(share.into()),
                Hand::Tension(share) => cockpit.tension(share),
                Hand::Joint(segment, axis, angle) => cockpit.joint(segment as usize, axis, angle),
            }
        }
        cockpit.step();
        turned += cockpit.motion().angular_velocity * (1.0 / RATE as f32);
        tilt = tilt.max(cockpit.tilt());
        for number in cockpit.frame() {
            bytes.extend(number.to_le_bytes());
        }
    }
    let folder = tempfile::tempdir().expect("a folder");
    let frames = frames(&bytes).expect("frames");
    let path = write(
        &frames,
        &subject,
        DEFAULT_DENSITY,
        &folder.path().join("flown-0"),
    );
    Flown {
        path: path.expect("written"),
        turned,
        tilt,
        _folder: folder,
    }
}

/// Requires that the model flies the saved flight again, and that its estimate is trusted. Returns the estimate.
fn explained(name: &str, flown: &Flown) -> Estimation {
    let flight = Flight::read(&flown.path).expect("a flight");
    let again = simulate(
        &flight,
        Options::default(),
        Precision::Double,
        &mut |_| Ok(()),
        &mut |_| {},
    )
    .expect("simulated");
    println!("{name}: simulated again, RMS {:?}", again.report.rms);
    for channel in Channel::ALL {
        let gap = again.report.rms.get(channel);
        assert!(gap < 1e-3, "{name}, {channel:?}: {gap}");
    }
    let request = Request {
        tuning: Tuning::find(AUTO).expect("a preset"),
        method: Method::Filter,
        filter: None,
    };
    let estimation = request
        .run(&flight, Options::default(), Precision::Single, &mut |_| {})
        .expect("estimated");
    let found = estimation.report.consistency.as_ref();
    let found = found.expect("the motion filter");
    println!(
        "{name}: consistent {:.2}, doubtful {:.2}, lost {:.2}; RMS {:?}",
        found.consistent, found.doubtful, found.lost, estimation.report.rms
    );
    assert_eq!(estimation.report.doubt, None, "{name}");
    estimation
}

/// Requires a full turn, up to what the attitudes before and after differ.
fn turned_once(name: &str, angle: f32) {
    println!("{name}: turned by {:.0} degrees", angle.to_degrees());
    assert!(
        (angle.to_degrees() - 345.0).abs() < 25.0,
        "{name}: {angle} rad"
    );
}

#[test]
fn a_barrel_roll_by_hand_is_explained_by_its_inputs() {
    let flown = flown(
        "neutral",
        8,
        &[
            (2.0, Hand::Muscle([0.0, 0.0, 1.0])),
            (2.0, Hand::Control("left-arm-in", 1.0)),
            (2.0, Hand::Tension(-1.0)),
            (3.0, Hand::Muscle([0.0; 3])),
            (3.0, Hand::Control("left-arm-in", 0.0)),
            (3.0, Hand::Tension(1.0)),
            (4.5, Hand::Tension(0.0)),
        ],
    );
    turned_once("barrel roll", flown.turned.z());
    let estimation = explained("barrel roll", &flown);
    // The hand rolls with a coefficient of 4 from 2.25 s to 3 s.
    let points = estimation.points.iter();
    let rolling = points.filter(|point| (2.5..2.9).contains(&point.time));
    let rolls: Vec<_> = rolling
        .map(|point| [point.inputs.roll, point.deviation.roll])
        .collect();
    let [mean, deviation] =
        [0, 1].map(|k| rolls.iter().map(|roll| roll[k]).sum::<f64>() / rolls.len() as f64);
    println!("estimated muscle input in roll: {mean:.2} +- {deviation:.2}");
    // The damping changes at the same time, which a filter cannot tell apart at once: the bar says so.
    assert!(
        deviation < 2.0 && (mean - 4.0).abs() < deviation,
        "{mean} +- {deviation}"
    );
}

#[test]
fn a_sit_of_twenty_seconds_is_explained_by_its_inputs() {
    let flown = flown("sit", 20, &[]);
    assert!(flown.tilt < 0.2, "{} rad", flown.tilt);
    explained("sit", &flown);
}

#[test]
fn a_layout_by_hand_is_explained_by_its_inputs() {
    let flown = flown(
        "track",
        9,
        &[
            (2.0, Hand::Muscle([1.0, 0.0, 0.0])),
            (2.0, Hand::Tension(-1.0)),
            (2.4, Hand::Muscle([0.0; 3])),
            (2.9, Hand::Tension(1.0)),
            (4.6, Hand::Tension(0.0)),
        ],
    );
    turned_once("layout", flown.turned.x());
    explained("layout", &flown);
}

#[test]
fn a_back_flip_by_hand_is_explained_by_its_inputs() {
    let flown = flown(
        "neutral",
        7,
        &[
            (2.0, Hand::Muscle([1.0, 0.0, 0.0])),
            (2.0, Hand::Control("press", 1.0)),
            (2.0, Hand::Tension(-1.0)),
            (2.5, Hand::Muscle([0.0; 3])),
            (2.5, Hand::Control("press", 0.0)),
            (2.8, Hand::Tension(1.0)),
            (4.0, Hand::Tension(0.0)),
        ],
    );
    turned_once("flip", flown.turned.x());
    explained("flip", &flown);
}

#[test]
fn keys_and_joints_are_explained_by_their_postures() {
    let flown = flown(
        "neutral",
        6,
        &[
            (1.0, Hand::Control("turn", 1.0)),
            (2.0, Hand::Joint(Segment::RightShank, 2, 0.3)),
            (4.0, Hand::Control("turn", 0.0)),
        ],
    );
    explained("turn", &flown);
}
