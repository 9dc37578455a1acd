//! The simulated skydiver of a live view: the model, stepped from the streamed postures beside the measured body.
//!
//! It is a free run: after its start it uses the measured postures but not the measured motion. The difference between
//! both bodies therefore shows the errors of the model, and grows.

use bodyflight_core::body::mass_properties::PostureRate;
use bodyflight_core::dynamics::free_run::FreeRun;
use bodyflight_core::dynamics::{Inputs, Motion};
use bodyflight_core::effect::Model;
use serde::Serialize;

use bodyflight_io::diagnostic::Result;
use bodyflight_mvnx::recording::FlightFrame;
use bodyflight_replay::flight::Flight;

/// Longest time between two frames of a run (s): over a longer gap the motion of the limbs is unknown.
const LONGEST_GAP: f64 = 0.5;

/// Largest component of a velocity that is plausible (m/s).
const PLAUSIBLE_SPEED: f64 = 1e3;

/// State of the simulated body for the page.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct AvatarState {
    /// Time at which the free run began (s).
    pub since_s: f64,
    /// Number of restarts: on request, after a gap in the stream, or after the simulation diverged.
    pub restarts: u32,
}

/// The model that follows a stream.
pub struct Avatar {
    flight: Flight,
    model: Model<f64>,
    last: FlightFrame,
    run: Option<Run>,
    restarts: u32,
}

/// A free run in progress.
struct Run {
    free: FreeRun<f64>,
    motion: Motion<f64>,
    inputs: Inputs<f64>,
    since: f64,
}

impl Avatar {
    /// Uses a flight's subject and air. The run begins with the frame after the `first`, when the speed of the limbs is
    /// known.
    ///
    /// # Errors
    /// Returns an error if an effect of the flight has an implausible value.
    pub fn new(flight: &Flight, first: &FlightFrame) -> Result<Self> {
        let height = first.pelvis.position.up();
        Ok(Self {
            model: flight.effects.applied(flight.dynamics(height), height)?,
            flight: flight.clone(),
            last: *first,
            run: None,
            restarts: 0,
        })
    }

    /// The model of the run.
    pub const fn model(&self) -> &Model<f64> {
        &self.model
    }

    /// Restarts with the next frame.
    pub fn restart(&mut self) {
        self.restarts += u32::from(self.run.take().is_some());
    }

    /// Advances to a frame of the stream.
    pub fn follow(&mut self, frame: &FlightFrame) {
        let duration = frame.time - self.last.time;
        if !(duration > 0.0 && duration <= LONGEST_GAP) {
            self.restart();
            self.last = *frame;
            return;
        }
        let middle = frame.time - 0.5 * duration;
        let inputs = self.model.inputs(&self.flight.inputs_at(middle));
        let mut dynamics = self.model.dynamics;
        if let Some(history) = &self.flight.inputs {
            dynamics.muscles = history.muscles_at(self.last.time, &self.flight.muscles);
        }
        let rate = PostureRate::between(&self.last.posture, &frame.posture, duration);
        if let Some(run) = &mut self.run {
            let since_start = self.last.time - run.since;
            run.free.advance_under(
                (&self.model.applied, since_start),
                &dynamics,
                &inputs,
                &frame.posture,
                duration,
            );
            run.motion = run.free.motion(&dynamics, &rate);
            run.inputs = inputs;
            let is_plausible = |v: &f64| v.abs() < PLAUSIBLE_SPEED;
            if !run.motion.velocity.to_array().iter().all(is_plausible) {
                self.restart();
            }
        }
        // A source without velocities provides no initial motion.
        if self.run.is_none()
            && let Ok(motion) = frame.motion()
        {
            let equations = self.flight.equations;
            self.run = Some(Run {
                free: FreeRun::new(&dynamics, equations, &motion, &frame.posture, &rate),
                motion,
                inputs,
                since: frame.time,
            });
        }
        self.last = *frame;
    }

    /// Its motion and inputs; `None` before it has begun.
    pub fn motion(&self) -> Option<(&Motion<f64>, &Inputs<f64>)> {
        self.run.as_ref().map(|run| (&run.motion, &run.inputs))
    }

    /// The state for the page.
    pub fn state(&self) -> Option<AvatarState> {
        self.run.as_ref().map(|run| AvatarState {
            since_s: run.since,
            restarts: self.restarts,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bodyflight_core::maneuver::Maneuver;
    use bodyflight_core::sensor_noise::SensorNoise;

    use bodyflight_laboratory::synthesize::{Request, synthesize};
    use bodyflight_mvnx::recording::Options;
    use bodyflight_replay::flight::DensityChoice;
    use bodyflight_replay::steps::Replay;
    use bodyflight_replay::subject::Subject;

    /// Turns of a person, recorded by perfect sensors.
    fn turns() -> (Flight, Vec<FlightFrame>) {
        let folder = tempfile::tempdir().unwrap();
        let subject = Subject::default();
        let request = Request {
            noise: SensorNoise::PAPER.scaled(0.0),
            sway: 0.0,
            ..Request::new(Maneuver::from_name("rotations").unwrap(), &subject, 1)
        };
        let flown = synthesize(&request, folder.path(), &mut |_| {}).unwrap();
        let flight = Flight::read(&flown.flight).unwrap();
        let frames = flight.open(Options::default()).unwrap().take(240 * 12);
        let frames = frames.collect::<Result<_>>().unwrap();
        (flight, frames)
    }

    fn off(avatar: &Avatar, motion: &Motion<f64>) -> [f64; 2] {
        let (flown, _) = avatar.motion().unwrap();
        let turn = flown.inertial_from_body.quaternion();
        [
            turn.angle_to(motion.inertial_from_body.quaternion()),
            (flown.position - motion.position).norm(),
        ]
    }

    fn followed(flight: &Flight, frames: &[FlightFrame]) -> Avatar {
        let mut avatar = Avatar::new(flight, &frames[0]).unwrap();
        for frame in &frames[1..] {
            avatar.follow(frame);
        }
        avatar
    }

    #[test]
    fn it_flies_what_simulate_flies_and_not_what_was_measured() {
        let (flight, frames) = turns();
        // GIVEN air thinner than the flight's
        let thin = Flight {
            density: DensityChoice::Constant(0.9),
            ..flight.clone()
        };
        // WHEN the model follows the stream, and is replayed beside the recording
        let avatar = followed(&thin, &frames);
        let replayed = Replay::new(&thin, frames[1..].iter().copied().map(Ok)).unwrap();
        let simulated = replayed.last().unwrap().unwrap().simulated;
        // THEN both agree with each other, and differ from the measured flight
        let [turned, apart] = off(&avatar, &simulated);
        assert!(turned < 0.01 && apart < 0.3, "{turned} rad, {apart} m");
        let [_, apart] = off(&avatar, &frames.last().unwrap().motion().unwrap());
        assert!(apart > 5.0, "{apart} m from what was measured");
        // In the flight's own air it agrees with the measurement.
        let [turned, apart] = off(
            &followed(&flight, &frames),
            &frames.last().unwrap().motion().unwrap(),
        );
        assert!(turned < 0.02 && apart < 0.3, "{turned} rad, {apart} m");
    }

    #[test]
    fn it_restarts_after_a_gap_or_on_request() {
        let (flight, frames) = turns();
        let mut avatar = followed(&flight, &frames[..240]);
        assert_eq!(avatar.state().unwrap().restarts, 0);
        avatar.restart();
        assert!(avatar.motion().is_none());
        avatar.follow(&frames[240]);
        let state = avatar.state().unwrap();
        assert!((state.since_s - frames[240].time).abs() < 1e-9);
        assert_eq!(state.restarts, 1);
        // A second is lost.
        avatar.follow(&frames[480]);
        assert!(avatar.motion().is_none());
        avatar.follow(&frames[481]);
        assert_eq!(avatar.state().unwrap().restarts, 2);
    }
}
