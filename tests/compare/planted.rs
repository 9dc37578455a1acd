//! Flights with known differences, recorded by suits with known errors.

use std::path::Path;

use bodyflight_core::Segment;
use bodyflight_core::body::joint_angle::JointAngle;
use bodyflight_core::frame::{Rotation, Vector};
use bodyflight_mvnx::recording::{FlightFrame, Options};
use bodyflight_mvnx::writer::{Description, Origin, Writer};
use bodyflight_replay::flight::Flight;
use bodyflight_replay::joint_change::JointChange;
use bodyflight_replay::steps::Replay;
use bodyflight_tests::estimator_flights::Noise;
use bodyflight_tests::program::{Program, plain};
use nalgebra::{UnitQuaternion, Vector3};

/// A flight of `synth` without noise, its frames, and its folder.
pub(super) struct Clean {
    pub(super) folder: String,
    pub(super) flight: Flight,
    pub(super) frames: Vec<FlightFrame>,
}

/// Simulates a maneuver.
pub(super) fn clean(program: Program, folder: &Path, maneuver: &str) -> Clean {
    let out = plain(&folder.join(maneuver)).to_owned();
    program.json(&["synth", maneuver, "--noise", "0", "--out", &out]);
    let flight = Flight::read(Path::new(&out)).expect("a flight");
    let frames = flight.open(Options::default()).expect("a recording");
    let frames = frames.map(|frame| frame.expect("a frame")).collect();
    Clean {
        folder: out,
        flight,
        frames,
    }
}

impl Clean {
    /// The flight with changes of joints, flown by the model from the same start.
    pub(super) fn changed(&self, joints: &[&str], until: f64) -> Vec<FlightFrame> {
        let parse = |text: &&str| JointChange::parse(text).expect("a change");
        let changes: Vec<JointChange> = joints.iter().map(parse).collect();
        let frames = self.frames.iter().copied();
        let frames = frames.take_while(|frame| frame.time <= until).map(Ok);
        let start = self.frames[0].motion().expect("a motion");
        let replay = Replay::changed(&self.flight, frames, &changes, &start).expect("a replay");
        let first = *replay.start();
        let steps = replay.map(|step| step.expect("a step"));
        let all = std::iter::once(first).chain(steps);
        all.zip(0..)
            .map(|(step, index)| {
                FlightFrame::from_motion(index, step.time, step.posture, &step.simulated)
            })
            .collect()
    }
}

/// The frame at a time (s), and how fast that time runs.
pub(super) fn at(frames: &[FlightFrame], time: f64, rate: f64) -> FlightFrame {
    let after = frames.partition_point(|frame| frame.time <= time);
    let after = after.clamp(1, frames.len() - 1);
    let (from, to) = (&frames[after - 1], &frames[after]);
    let share = (time - from.time) / (to.time - from.time);
    let mix = |from: f64, to: f64| from + share * (to - from);
    let mut mixed = *from;
    mixed.posture = from.posture.interpolated(&to.posture, share);
    let [one, two] = [from, to].map(|frame| *frame.pelvis.inertial_from_body.quaternion());
    mixed.pelvis.inertial_from_body = Rotation::from_quaternion(one.slerp(&two, share));
    let vector = |one: [f64; 3], two: [f64; 3], factor: f64| {
        let [x, y, z] = [0, 1, 2].map(|k: usize| factor * mix(one[k], two[k]));
        Vector::new(x, y, z)
    };
    let [(v, w), (v2, w2)] = [from, to].map(|frame| frame.rates().expect("rates"));
    mixed.pelvis.velocity = Some(vector(v.to_array(), v2.to_array(), rate));
    mixed.pelvis.angular_velocity = Some(vector(w.to_array(), w2.to_array(), rate));
    mixed
}

/// A suit: rate of its recording (Hz), errors of its joints (degrees), and noise as a share of the usual.
#[derive(Clone, Copy)]
pub(super) struct Suit {
    pub(super) rate: f64,
    pub(super) joint_deg: f64,
    pub(super) noise: f64,
    pub(super) seed: u64,
}

/// Writes a recording of frames, the time in them a function of the time in it, into a folder beside `of`.
pub(super) fn recorded(
    of: &Clean,
    name: &str,
    frames: &[FlightFrame],
    suit: Suit,
    source: impl Fn(f64) -> f64,
) -> String {
    let folder = format!("{}-{name}", of.folder);
    std::fs::create_dir_all(&folder).expect("a folder");
    let mut random = Noise::new(suit.seed);
    let mut normal = |deviation: f64| random.normal(deviation);
    let errors: Vec<JointChange> = Segment::ALL
        .into_iter()
        .flat_map(JointAngle::of_joint)
        .filter(|angle| !angle.is_bend())
        .map(|angle| JointChange::by(angle, normal(suit.joint_deg.to_radians())))
        .collect();
    let description = Description {
        subject_label: name.to_owned(),
        frame_rate: suit.rate,
        start_unix_ms: 0,
        comment: name.to_owned(),
        origin: Origin::Simulated,
    };
    let path = Path::new(&folder).join("flight.mvnx");
    let mut writer = Writer::create(&path, description, &of.flight.subject.body()).expect("a file");
    let end = frames.last().expect("frames").time;
    for index in 0.. {
        let time = index as f64 / suit.rate;
        let place = source(time);
        if place > end - 0.05 {
            break;
        }
        let rate = (source(time + 1e-3) - source(time - 1e-3)) / 2e-3;
        let mut frame = at(frames, place, rate);
        (frame.index, frame.time) = (index, time);
        frame.posture = bodyflight_replay::joint_change::changed(&errors, time, &frame.posture);
        let mut noise = |deviation: f64| [(); 3].map(|()| normal(suit.noise * deviation));
        let inertial = |[north, west, up]: [f64; 3]| Vector::new(north, west, up);
        let pelvis = &mut frame.pelvis;
        let turn = UnitQuaternion::from_scaled_axis(Vector3::from(noise(0.01)));
        pelvis.inertial_from_body =
            Rotation::from_quaternion(pelvis.inertial_from_body.quaternion() * turn);
        pelvis.velocity = pelvis.velocity.map(|v| v + inertial(noise(0.1)));
        pelvis.angular_velocity = pelvis.angular_velocity.map(|w| w + inertial(noise(0.03)));
        writer.write(&frame).expect("a frame");
    }
    writer.finish().expect("a file");
    for file in ["subject.toml", "inputs.csv", "flight.toml"] {
        let from = Path::new(&of.folder).join(file);
        if from.is_file() {
            std::fs::copy(from, Path::new(&folder).join(file)).expect("copied");
        }
    }
    folder
}
