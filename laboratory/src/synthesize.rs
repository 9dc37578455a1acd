//! `bodyflight synth`: simulates a maneuver with noisy sensors, and writes it as a recording.

mod joints;
mod request;
mod tunnel;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use bodyflight_core::Segment;
use bodyflight_core::body::mass_properties::PostureRate;
use bodyflight_core::body::posture::Posture;
use bodyflight_core::dynamics::free_run::{Equations, FreeRun};
use bodyflight_core::dynamics::muscle_input::{MuscleForces, MuscleModel};
use bodyflight_core::dynamics::step::TIME_STEP;
use bodyflight_core::dynamics::trim::trim;
use bodyflight_core::dynamics::{Dynamics, Motion};
use bodyflight_core::frame::{Inertial, Vector};
use bodyflight_core::maneuver::Maneuver;
use bodyflight_core::math::small_rotation;
use bodyflight_core::sensor_noise::SensorNoise;
use nalgebra::Vector3;
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use serde::Serialize;

use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::files::{CsvFile, write_file};
use bodyflight_io::interrupt;
use bodyflight_mvnx::recording::{FlightFrame, PelvisMotion};
use bodyflight_mvnx::writer::{Description, Origin, Writer};
use bodyflight_replay::flight::{DensityChoice, Flight};
use bodyflight_replay::input_history::InputRow;
use bodyflight_replay::subject::SEGMENTS_FILE;

use crate::limb_sensors::{self, LimbSensors, Limbs, Sizes, Streams};
use crate::sensor_bytes::SensorBytes;
use joints::{JointErrors, Sway};
pub use request::{DEFAULT_SWAY, JointError, Request};
pub use tunnel::Tunnel;

/// Description of the written flight.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Report {
    /// The `flight.toml`.
    pub flight: PathBuf,
    /// Frames written.
    pub frames: u64,
    /// Length (s).
    pub duration_s: f64,
    /// Events in the tunnel, if there is one.
    pub tunnel: Option<Tunnel>,
}

const FRAME_RATE: f64 = 240.0;
/// Height of the first frame above the inertial origin (m).
const START_HEIGHT: f64 = 4000.0;

/// Name of the file of a sensor's bytes.
const SENSOR_FILE: &str = "imu.bin";
/// Name of the file of the bytes on the line of sensors on the limbs.
const LINE_FILE: &str = "chain.bin";

/// Files of a synthetic flight; the segments only if the subject has its own table, and the sensor's bytes on request.
pub const FILES: &[&str] = &[
    SENSOR_FILE,
    LINE_FILE,
    "flight.toml",
    "subject.toml",
    SEGMENTS_FILE,
    "inputs.csv",
    "flight.mvnx",
];

/// Flies the maneuver and writes `flight.toml`, `subject.toml`, `inputs.csv` and `flight.mvnx` into `folder`.
///
/// # Errors
/// Returns an error if a number is out of range or the folder cannot be written to.
pub fn synthesize(
    request: &Request<'_>,
    folder: &Path,
    progress: &mut dyn FnMut(f64),
) -> Result<Report> {
    synthesize_with(request, Additions::default(), folder, progress)
}

/// What a flight may have besides what its [`Request`] asks for.
#[derive(Debug, Clone, Copy, Default)]
pub struct Additions<'a> {
    /// A sensor at the pelvis, whose bytes go into `imu.bin`.
    pub sensor: Option<&'a SensorBytes>,
    /// What muscle input causes besides its moments.
    pub muscle_forces: MuscleForces,
    /// Lever arms of these forces as shares of the stature, instead of those of a body.
    pub lever_arms: Option<[f32; 4]>,
    /// Segments with raw sensors, whose readings go into the folder `sensors`.
    pub limbs: Option<Limbs>,
    /// Whether the bytes on the line of these sensors go into `chain.bin`.
    pub chain: bool,
}

/// Same as [`synthesize`], with additions.
///
/// # Errors
/// Same as [`synthesize`].
pub fn synthesize_with(
    request: &Request<'_>,
    additions: Additions<'_>,
    folder: &Path,
    progress: &mut dyn FnMut(f64),
) -> Result<Report> {
    let Additions {
        sensor,
        muscle_forces,
        lever_arms,
        limbs,
        chain,
    } = additions;
    request.check()?;
    std::fs::create_dir_all(folder).map_err(|error| Problem::system("create", folder, error))?;
    let mut flight = Flight::bare(&folder.join("flight.mvnx"));
    flight.subject = request.subject.clone();
    flight.density = DensityChoice::Constant(request.density);
    flight.muscles = request.maneuver.muscles.with_forces(muscle_forces);
    if let Some(arms) = lever_arms {
        flight.muscles = flight.muscles.with_lever_arms(arms);
    }
    let still = flight.dynamics(START_HEIGHT);
    let mut tunnel = request.tunnel.then(|| Tunnel::new(neutral_speed(&still)));
    if let Some(tunnel) = tunnel {
        flight.air_velocity = [0.0, 0.0, tunnel.stream_mps];
    }
    let dynamics = flight.dynamics(START_HEIGHT);
    let description = Description {
        subject_label: "Synthetic".to_owned(),
        frame_rate: FRAME_RATE,
        start_unix_ms: 0,
        comment: format!(
            "bodyflight synth {} --seed {}",
            request.maneuver.name, request.seed
        ),
        origin: Origin::Simulated,
    };
    let mut writer = Writer::create(&flight.recording, description, &dynamics.body)?;
    let mut kept = Vec::new();
    let mut each = |frame: FlightFrame| {
        if sensor.is_some() {
            kept.push(frame);
        }
        if let Some(tunnel) = &mut tunnel {
            tunnel.see(
                frame.time,
                &(frame.pelvis.position - Vector::new(0.0, 0.0, START_HEIGHT)),
            );
        }
        writer.write(&frame)
    };
    let frames = fly(request, &dynamics, &mut each, progress)?;
    writer.finish()?;
    if let Some(sensor) = sensor {
        let bytes: Vec<u8> = sensor.of(&kept).into_iter().flat_map(|(_, b)| b).collect();
        write_file(&folder.join(SENSOR_FILE), &bytes)?;
    }
    if let Some(limbs) = limbs {
        write_limbs(&worn(request, &dynamics, limbs)?, chain, folder)?;
    }
    write_inputs(request.maneuver, &folder.join("inputs.csv"))?;
    request.subject.write_in(folder)?;
    let path = folder.join("flight.toml");
    write_file(
        &path,
        flight_toml(request, &flight.muscles, tunnel.as_ref()).as_bytes(),
    )?;
    #[expect(clippy::cast_precision_loss, reason = "counts of frames")]
    let duration_s = frames.saturating_sub(1) as f64 / FRAME_RATE;
    Ok(Report {
        flight: path,
        frames,
        duration_s,
        tunnel,
    })
}

/// Writes the readings of sensors on the limbs and, if they share a line, its bytes.
fn write_limbs(streams: &Streams, chain: bool, folder: &Path) -> Result<()> {
    streams.write_in(&folder.join(limb_sensors::FOLDER))?;
    if chain {
        let bytes: Vec<u8> = streams.line().into_iter().flat_map(|(_, b)| b).collect();
        write_file(&folder.join(LINE_FILE), &bytes)?;
    }
    Ok(())
}

/// The readings of sensors on the limbs in the same flight, without the noise of the recording.
fn worn(request: &Request<'_>, dynamics: &Dynamics<f64>, limbs: Limbs) -> Result<Streams> {
    let exact = Request {
        noise: SensorNoise::NONE,
        joint_error: JointError::default(),
        ..request.clone()
    };
    let frames = flown(&exact, dynamics)?;
    let sensors = LimbSensors {
        seed: request.seed,
        segments: limbs.segments,
        sizes: Sizes::TYPICAL,
        fault: limbs.fault,
    };
    Ok(Streams {
        muscles: request.maneuver.muscles.name(),
        ..sensors.of(&dynamics.body, &frames)
    })
}

/// Flies the maneuver and returns every recorded frame.
///
/// # Errors
/// Returns an error if Ctrl-C is pressed.
pub fn flown(request: &Request<'_>, dynamics: &Dynamics<f64>) -> Result<Vec<FlightFrame>> {
    let mut frames = Vec::new();
    let mut each = |frame| {
        frames.push(frame);
        Ok(())
    };
    fly(request, dynamics, &mut each, &mut |_| {})?;
    Ok(frames)
}

/// Flies the maneuver, passes every recorded frame to `each`, and returns the number of frames.
///
/// # Errors
/// Returns the errors of `each`.
pub fn fly(
    request: &Request<'_>,
    dynamics: &Dynamics<f64>,
    each: &mut dyn FnMut(FlightFrame) -> Result<()>,
    progress: &mut dyn FnMut(f64),
) -> Result<u64> {
    let maneuver = request.maneuver;
    let mut random = ChaCha8Rng::seed_from_u64(request.seed);
    let sway = Sway::new(&mut random, request.sway);
    let posture = |time: f64| sway.on(&maneuver.posture(time), time);
    let rate = |time: f64| {
        let (before, after) = (posture(time - TIME_STEP), posture(time + TIME_STEP));
        PostureRate::between(&before, &after, 2.0 * TIME_STEP)
    };
    let mut run = FreeRun::new(
        dynamics,
        Equations::Exact,
        &start(maneuver, dynamics),
        &posture(0.0),
        &rate(0.0),
    );
    let mut sensors = Sensors {
        joints: JointErrors::new(request.seed, request.joint_error),
        random,
        noise: request.noise,
    };
    let mut index = 0;
    loop {
        #[expect(clippy::cast_precision_loss, reason = "counts of frames")]
        let time = index as f64 / FRAME_RATE;
        let motion = run.motion(dynamics, &rate(time));
        each(sensors.frame(index, time, &posture(time), &motion))?;
        if time >= maneuver.duration {
            return Ok(index + 1);
        }
        index += 1;
        #[expect(clippy::cast_precision_loss, reason = "counts of frames")]
        let next = index as f64 / FRAME_RATE;
        let inputs = maneuver.inputs(0.5 * (time + next));
        run.advance(dynamics, &inputs, &posture(next), next - time);
        if index.is_multiple_of(240) {
            progress(time);
            interrupt::check()?;
        }
    }
}

/// The initial motion: the trimmed speed of the neutral pose, straight down.
fn start(maneuver: &Maneuver, dynamics: &Dynamics<f64>) -> Motion<f64> {
    let speed = neutral_speed(dynamics);
    let inertial_from_body = maneuver.start_attitude();
    let fall =
        Vector::<f64, Inertial>::new(maneuver.start_forward, 0.0, -speed * maneuver.start_speed);
    Motion {
        inertial_from_body,
        position: Vector::new(0.0, 0.0, START_HEIGHT),
        velocity: inertial_from_body.inverse() * (fall + dynamics.air.velocity),
        angular_velocity: Vector::zero(),
    }
}

/// Speed of the trimmed neutral fall through the air (m/s).
fn neutral_speed(dynamics: &Dynamics<f64>) -> f64 {
    let neutral = bodyflight_core::body::pattern::neutral();
    // A posture that cannot be trimmed still falls: belly flight settles at 50 m/s.
    trim(dynamics, &neutral, START_HEIGHT).map_or(50.0, |trim| trim.terminal_speed)
}

/// Sensors with their noise.
struct Sensors {
    joints: JointErrors,
    random: ChaCha8Rng,
    noise: SensorNoise,
}

impl Sensors {
    fn vector(&mut self, size: [f64; 3]) -> Vector3<f64> {
        Vector3::from(size.map(|size| size * self.random.sample::<f64, _>(StandardNormal)))
    }

    fn frame(
        &mut self,
        index: u64,
        time: f64,
        posture: &Posture<f64>,
        motion: &Motion<f64>,
    ) -> FlightFrame {
        let noise = self.noise;
        let tilt = small_rotation(&self.vector([noise.attitude; 3]));
        let mut seen = self.joints.on(posture, time);
        for segment in Segment::ALL.into_iter().skip(1) {
            let error = small_rotation(&self.vector([noise.joint; 3]));
            seen.set(segment, seen.parent_from_segment(segment) * error);
        }
        let velocity = motion.velocity_inertial();
        let spin = motion.inertial_from_body * motion.angular_velocity;
        let horizontal = noise.horizontal_velocity;
        let velocity_error = self.vector([horizontal, horizontal, noise.vertical_velocity]);
        let spin_error = self.vector([noise.angular_velocity; 3]);
        let attitude = motion.inertial_from_body.quaternion() * tilt;
        FlightFrame {
            index,
            time,
            posture: seen,
            pelvis: PelvisMotion {
                inertial_from_body: bodyflight_core::frame::Rotation::from_quaternion(attitude),
                position: motion.position,
                velocity: Some(velocity + Vector::from_components(velocity_error)),
                angular_velocity: Some(spin + Vector::from_components(spin_error)),
            },
            centre_of_mass: None,
            bridged: false,
        }
    }
}

fn write_inputs(maneuver: &Maneuver, path: &Path) -> Result<()> {
    let mut file = CsvFile::create(path, &InputRow::COLUMNS)?;
    let mut time = 0.0;
    while time <= maneuver.duration {
        file.write(InputRow::of(time, &maneuver.inputs(time)).columns())?;
        time += 0.02;
    }
    file.finish()
}

fn flight_toml(request: &Request<'_>, muscles: &MuscleModel, tunnel: Option<&Tunnel>) -> String {
    let mut text = String::new();
    // Writing to a String cannot fail.
    let _ = writeln!(
        text,
        "# {}: {}",
        request.maneuver.name, request.maneuver.summary
    );
    let _ = writeln!(text, "# seed {}", request.seed);
    text.push_str(
        "recording = \"flight.mvnx\"\nsubject = \"subject.toml\"\ninputs = \"inputs.csv\"\n",
    );
    let _ = writeln!(text, "muscles = \"{}\"", muscles.name());
    if muscles.forces != MuscleForces::default() {
        let _ = writeln!(text, "muscle_forces = \"{}\"", muscles.forces.name());
    }
    let unchanged = request.maneuver.muscles.with_forces(muscles.forces);
    if *muscles != unchanged {
        let _ = writeln!(text, "lever_arms = {:?}", muscles.lever_arms);
    }
    let _ = writeln!(text, "\n[air]\ndensity = {}", request.density);
    if let Some(tunnel) = tunnel {
        let _ = writeln!(text, "velocity = [0.0, 0.0, {}]", tunnel.stream_mps);
    }
    text
}
