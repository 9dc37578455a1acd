//! `bodyflight stream`: sends a recording to a unit, receives its estimates, and runs the same filter here for
//! comparison.

pub mod connection;
mod latencies;
pub mod line;
pub mod qemu;
pub mod report;
mod session;
mod settings;
pub mod twin;

use std::time::{Duration, Instant};

use bodyflight_core::aerodynamics::load_model::LoadModel;
use bodyflight_core::estimator::unit_preset::UnitPreset;
use bodyflight_core::link::fault::Injector;
use bodyflight_core::link::{
    ArchSource, Configure, Motion, PackedQuaternion, Sample, SegmentTable, SensorKind, StreamMode,
};

use super::request::checked;
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::interrupt;
use bodyflight_mvnx::recording::FlightFrame;
use bodyflight_replay::flight::Flight;
use connection::{Connection, Machine, Target};
use line::Line;
use report::{Live, Report};
use session::Session;
pub use settings::{Pace, Settings};

/// Samples per update of a live display.
const SAMPLES_A_LOOK: u32 = 8;

/// Streams `frames` of a flight, recorded at `frame_rate` (Hz), to a unit.
///
/// `look` is called with the progress, about thirty times a second at 240 Hz; `logs` gets the unit's defmt frames, if
/// there are any.
///
/// # Errors
/// Returns an error if the unit cannot be reached, refuses, or stops answering. Its answers are judged by the report.
pub fn stream(
    flight: &Flight,
    frame_rate: f64,
    frames: impl Iterator<Item = Result<FlightFrame>>,
    settings: &Settings,
    mut look: impl FnMut(&Live, &FlightFrame) -> Result<()>,
    mut logs: impl FnMut(&[u8]),
) -> Result<Report> {
    let mut frames = frames.peekable();
    let first = match frames.peek() {
        Some(Ok(first)) => *first,
        Some(Err(problem)) => return Err(problem.clone()),
        None => {
            return Err(
                Problem::bad_input("there are no frames to stream").in_file(&flight.recording)
            );
        }
    };
    let mode = match (settings.pace, &settings.target) {
        // An emulated machine may be slower than the flight; the host waits for it then.
        (Pace::Max, _) | (Pace::Times(_), Target::Qemu(_)) => StreamMode::Credit,
        (Pace::Source | Pace::Times(_), _) => StreamMode::Paced,
    };
    let line = Line::new(Connection::open(&settings.target)?);
    let injector = Injector::new(settings.faults, settings.seed);
    let mut session = Session::new(line, injector, session_number(), mode);
    session.greet()?;
    session.compare_clocks()?;
    let (configure, table) = configuration(flight, &first, &settings.preset, frame_rate)?;
    session.configure(configure, &table)?;
    session.start()?;

    let begin = Instant::now();
    let mut last_time = first.time;
    for frame in frames {
        let frame = frame?;
        if let Pace::Times(speed) = settings.pace {
            let due = begin + Duration::from_secs_f64(((frame.time - first.time) / speed).max(0.0));
            session.listen(due)?;
        } else {
            session.listen(Instant::now())?;
        }
        session.await_credit()?;
        session.sample(microseconds(frame.time - first.time), sample_of(&frame))?;
        last_time = frame.time;
        if session.sent().is_multiple_of(SAMPLES_A_LOOK) {
            interrupt::check()?;
            look(&Live::of(&session, frame.time), &frame)?;
            if let Machine::Qemu(machine) = &session.line.machine {
                logs(&machine.logs());
            }
        }
    }
    session.stop()?;
    let wall = begin.elapsed().as_secs_f64();
    if let Machine::Qemu(machine) = &session.line.machine {
        logs(&machine.logs());
    }
    Ok(Report::of(&session, settings, last_time - first.time, wall))
}

/// The configuration of the unit for this flight and filter.
///
/// # Errors
/// Returns an error if an effect of the model makes the density depend on the height, if the subject asks for
/// aerodynamics that the unit does not have, or if the unit does not have the preset, or a number is outside its ranges.
pub fn configuration(
    flight: &Flight,
    first: &FlightFrame,
    name: &str,
    frame_rate: f64,
) -> Result<(Configure, SegmentTable)> {
    configuration_at(flight, first.pelvis.position.up(), name, frame_rate)
}

/// The same for a flight that begins at `height` (m, inertial), with samples at `frame_rate` (Hz).
///
/// # Errors
/// Same as [`configuration`].
pub fn configuration_at(
    flight: &Flight,
    height: f64,
    name: &str,
    frame_rate: f64,
) -> Result<(Configure, SegmentTable)> {
    let plain = flight.dynamics(height);
    let dynamics = flight.effects.for_filter(plain, height)?;
    if dynamics.air.density != plain.air.density {
        return Err(Problem::bad_input(
            "an effect of the model makes the density depend on the height; the unit takes a single density",
        )
        .help("remove it from the model.toml, or run the filter here with it: estimate --model"));
    }
    if plain.aerodynamics.model != LoadModel::Paper {
        return Err(Problem::bad_input(
            "the subject asks for free-fly aerodynamics; the unit only has the paper's",
        )
        .help("remove aerodynamics = \"free-fly\" from the subject.toml, or run estimate here"));
    }
    let (body, aerodynamics) = (
        dynamics.body.cast::<f32>(),
        dynamics.aerodynamics.cast::<f32>(),
    );
    let table = SegmentTable::of(&body, &aerodynamics);
    let (arch_source, arch) = ArchSource::of(aerodynamics.arch);
    let unknown = || Problem::bad_input(format!("the unit has no preset \"{name}\""));
    let number = UnitPreset::number(name, &dynamics.muscles).ok_or_else(unknown)?;
    let preset = UnitPreset::of(number).ok_or_else(unknown)?;
    #[expect(
        clippy::cast_possible_truncation,
        reason = "single precision on the wire"
    )]
    let [sample_rate, air_density] =
        [frame_rate, dynamics.air.density.at(height)].map(|value| value as f32);
    // A window of the filter is a few samples.
    let window = f32::from(u8::try_from(preset.solution_window()).unwrap_or(u8::MAX));
    let configure = Configure {
        preset: u16::try_from(number).map_err(|_| unknown())?,
        sample_rate,
        update_rate: sample_rate / window,
        height: body.height,
        air_density,
        air_velocity: dynamics.air.velocity.cast::<f32>().to_array(),
        arch_source,
        arch,
        body_from_sensor: PackedQuaternion::default(),
        receiver_latency: 0.1,
        sensor: SensorKind::Xbus,
        table_digest: table.digest(),
    };
    checked(&configure, &table)?;
    Ok((configure, table))
}

/// A frame as a sample of the link.
pub fn sample_of(frame: &FlightFrame) -> Sample {
    let pelvis = &frame.pelvis;
    let body_from_inertial = pelvis.inertial_from_body.inverse();
    let motion = Motion {
        angular_velocity: pelvis
            .angular_velocity
            .map(|w| (body_from_inertial * w).cast()),
        velocity: pelvis.velocity.map(|v| v.cast()),
        horizontal_speed: None,
    };
    Sample::new(
        &frame.posture.cast(),
        &pelvis.inertial_from_body.cast(),
        &motion,
    )
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "saturates; recordings begin at 0"
)]
fn microseconds(seconds: f64) -> u64 {
    (seconds * 1e6).round() as u64
}

/// A session number that is unlikely to repeat the previous one.
fn session_number() -> u16 {
    let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
    let nanoseconds = now.map_or(0, |now| now.subsec_nanos());
    let [a, b, c, d] = nanoseconds.to_le_bytes();
    u16::from_le_bytes([a ^ c, b ^ d])
}
