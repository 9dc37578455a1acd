//! A skydiver that is simulated step by step with inputs from outside; the code behind a unit's library.

use std::path::Path;

use bodyflight_core::body::mass_properties::PostureRate;
use bodyflight_core::body::posture::{joint_rotation, pose};
use bodyflight_core::dynamics::free_run::{Equations, FreeRun};
use bodyflight_core::dynamics::{Dynamics, Inputs, Motion};
use bodyflight_core::frame::{Body, Rotation, Vector};
use bodyflight_core::observation::Observation;
use bodyflight_core::{AxisCoefficients, Posture, Segment};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use crate::variables::{Causality, Variable, places, variables};
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_replay::comparison::Channel;
use bodyflight_replay::flight::Flight;

/// Longest step (s). The limbs move evenly during a step, which is not plausible for longer ones.
const LONGEST_STEP: f64 = 1.0;

/// A skydiver, before or in flight.
#[derive(Debug, Clone)]
pub struct Skydiver {
    flight: Flight,
    variables: Vec<Variable>,
    values: Vec<f64>,
    time: f64,
    /// The model and its run, from the first step on.
    run: Option<(Dynamics<f64>, FreeRun<f64>)>,
    /// Posture at the beginning of the next step.
    posture: Posture<f64>,
}

impl Skydiver {
    /// Reads the resources of a unit.
    ///
    /// # Errors
    /// Returns an error if they are unusable.
    pub fn read(resources: &Path) -> Result<Self> {
        Flight::read(resources).map(Self::new)
    }

    /// Creates a skydiver with a flight's person and air.
    pub fn new(flight: Flight) -> Self {
        let variables = variables(&flight);
        let values = variables.iter().map(|variable| variable.start).collect();
        Self {
            flight,
            variables,
            values,
            time: 0.0,
            run: None,
            posture: Posture::h_pose(),
        }
    }

    /// Returns the value of the variable with this reference.
    pub fn get(&self, reference: usize) -> Option<f64> {
        match reference.checked_sub(1) {
            None => Some(self.time),
            Some(place) => self.values.get(place).copied(),
        }
    }

    /// Sets the variable with this reference.
    ///
    /// # Errors
    /// Returns an error if there is no such variable, if it is an output, or a parameter after the start, or if the
    /// value is not finite.
    pub fn set(&mut self, reference: usize, value: f64) -> Result<()> {
        let place = reference.wrapping_sub(1);
        let (Some(variable), Some(kept)) = (self.variables.get(place), self.values.get_mut(place))
        else {
            return Err(Problem::bad_input(format!(
                "there is no variable {reference}"
            )));
        };
        let refused = |message: &str| Err(Problem::bad_input(message).at(variable.name.as_str()));
        match variable.causality {
            Causality::Output => return refused("this is an output, which cannot be set"),
            Causality::Parameter if self.run.is_some() => {
                return refused("a parameter cannot be set once the flight has begun");
            }
            _ if !value.is_finite() => return refused("expected a finite number"),
            _ => {}
        }
        *kept = value;
        Ok(())
    }

    /// Begins at a time (s) with the motion given by the parameters and the posture given by the inputs.
    ///
    /// # Errors
    /// Returns an error if the attitude is not a rotation.
    pub fn begin(&mut self, time: f64) -> Result<()> {
        self.time = time;
        self.run = None;
        self.posture = self.wanted();
        let motion = self.first_motion()?;
        self.show(&self.dynamics(), &motion);
        Ok(())
    }

    /// Simulates a step of `duration` (s), in which the limbs move evenly to the joint angles given by the inputs.
    ///
    /// # Errors
    /// Returns an error if the step is not between 0 and 1 s, or the simulation diverges.
    pub fn step(&mut self, duration: f64) -> Result<()> {
        if !(duration > 0.0 && duration <= LONGEST_STEP) {
            return Err(Problem::bad_input(format!(
                "expected a step above 0 and up to {LONGEST_STEP} s, found {duration}"
            )));
        }
        let (next, dynamics, inputs) = (self.wanted(), self.dynamics(), self.inputs());
        let rate = PostureRate::between(&self.posture, &next, duration);
        let mut run = match &self.run {
            Some((_, run)) => *run,
            None => {
                let motion = self.first_motion()?;
                FreeRun::new(&dynamics, Equations::Exact, &motion, &self.posture, &rate)
            }
        };
        run.advance(&dynamics, &inputs, &next, duration);
        let motion = run.motion(&dynamics, &rate);
        if !motion.velocity.is_finite() {
            return Err(
                Problem::bad_input("the simulation diverges").at(format!("{} s", self.time))
            );
        }
        self.time += duration;
        self.run = Some((dynamics, run));
        self.posture = next;
        self.show(&dynamics, &motion);
        Ok(())
    }

    fn taken<const N: usize>(&self, place: usize) -> [f64; N] {
        core::array::from_fn(|k| self.values.get(place + k).copied().unwrap_or(0.0))
    }

    fn put(&mut self, place: usize, numbers: &[f64]) {
        for (kept, number) in self.values.iter_mut().skip(place).zip(numbers) {
            *kept = *number;
        }
    }

    /// The posture given by the inputs.
    fn wanted(&self) -> Posture<f64> {
        let mut posture = Posture::h_pose();
        for (joint, segment) in Segment::ALL.into_iter().skip(1).enumerate() {
            let [psi, theta, phi] = self.taken(places::JOINTS + 3 * joint);
            posture.set(segment, joint_rotation(psi, theta, phi));
        }
        posture
    }

    fn inputs(&self) -> Inputs<f64> {
        let axes = |place| AxisCoefficients::from(self.taken::<3>(place));
        Inputs {
            muscle: axes(places::MUSCLE),
            damping: axes(places::DAMPING),
            ..Inputs::belly_turn()
        }
    }

    /// The model, with the wind given by the inputs.
    fn dynamics(&self) -> Dynamics<f64> {
        let [_, _, height] = self.taken(places::START);
        let mut dynamics = self.flight.dynamics(height);
        dynamics.air.velocity = vector(self.taken(places::WIND));
        dynamics
    }

    fn first_motion(&self) -> Result<Motion<f64>> {
        let place = places::START;
        let [w, x, y, z] = self.taken(place + 6);
        let turn = UnitQuaternion::try_new(Quaternion::new(w, x, y, z), 1e-3).ok_or_else(|| {
            Problem::bad_input("expected a quaternion that is not zero").at("start.attitude")
        })?;
        let inertial_from_body: Rotation<_, _, Body> = Rotation::from_quaternion(turn);
        let velocity = vector(self.taken(place + 3));
        Ok(Motion {
            inertial_from_body,
            position: vector(self.taken(place)),
            velocity: inertial_from_body.inverse() * velocity,
            angular_velocity: vector(self.taken(place + 10)),
        })
    }

    /// Sets the outputs.
    fn show(&mut self, dynamics: &Dynamics<f64>, motion: &Motion<f64>) {
        let numbers: Vec<f64> = [
            motion.position.to_array(),
            motion.velocity_inertial().to_array(),
        ]
        .into_iter()
        .flatten()
        .chain(motion.inertial_from_body.wxyz())
        .chain(motion.angular_velocity.to_array())
        .collect();
        self.put(places::MOTION, &numbers);
        let seen = Observation::of(motion);
        self.put(
            places::CHANNELS,
            &Channel::ALL.map(|channel| channel.value(&seen)),
        );
        let posed = pose(&dynamics.body, &self.posture);
        let loads = dynamics.segment_loads(&self.posture, motion);
        let (mut centre, mut force, mut moment) =
            (Vector3::zeros(), Vector3::zeros(), Vector3::zeros());
        let mut of_segments = Vec::new();
        for segment in Segment::ALL {
            let load = &loads[segment];
            centre += posed[segment].cg * dynamics.body.segments[segment].mass;
            force += load.force;
            moment += load.moment;
            of_segments.extend(load.force.iter().chain(&load.moment));
        }
        let centre = Vector::<_, Body>::from_components(centre / dynamics.body.mass());
        let centre = motion.position + motion.inertial_from_body * centre;
        self.put(places::CENTRE, &centre.to_array());
        self.put(places::LOADS, force.as_slice());
        self.put(places::LOADS + 3, moment.as_slice());
        self.put(places::SEGMENT_LOADS, &of_segments);
    }
}

fn vector<F>([x, y, z]: [f64; 3]) -> Vector<f64, F> {
    Vector::new(x, y, z)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn skydiver() -> Skydiver {
        Skydiver::new(Flight::bare(Path::new("none.mvnx")))
    }

    fn reference(skydiver: &Skydiver, name: &str) -> usize {
        let mut variables = skydiver.variables.iter();
        variables
            .position(|variable| variable.name == name)
            .unwrap()
            + 1
    }

    #[test]
    fn a_fall_ends_at_the_speed_at_which_the_air_carries_the_weight() {
        let mut skydiver = skydiver();
        skydiver.begin(0.0).unwrap();
        for _ in 0..2400 {
            skydiver.step(1.0 / 240.0).unwrap();
        }
        let value = |name: &str| skydiver.get(reference(&skydiver, name)).unwrap();
        let [north, west, up] =
            ["north", "west", "up"].map(|part| value(&format!("velocity.{part}")));
        assert!((-60.0..-45.0).contains(&up), "{up}");
        assert!(north.hypot(west) < 10.0);
        let force = ["left", "dorsal", "cranial"].map(|part| value(&format!("force.{part}")));
        let weight = skydiver.dynamics().body.mass() * 9.81;
        let size = Vector3::from(force).norm();
        assert!((size / weight - 1.0).abs() < 0.1, "{size}, {weight}");
        assert!((value("seen.vertical_velocity_mps") - up).abs() < 1e-9);
        assert!((skydiver.get(0).unwrap() - 10.0).abs() < 1e-9);
    }

    #[test]
    fn an_arm_that_is_drawn_in_turns_the_body_and_the_wind_carries_it() {
        let mut skydiver = skydiver();
        skydiver.begin(0.0).unwrap();
        let arm = reference(&skydiver, "joint.l_upperarm.theta");
        let wind = reference(&skydiver, "wind.west");
        let before = skydiver.get(arm).unwrap();
        skydiver.set(arm, 0.3 * before).unwrap();
        skydiver.set(wind, 8.0).unwrap();
        for _ in 0..480 {
            skydiver.step(1.0 / 240.0).unwrap();
        }
        let value = |name: &str| skydiver.get(reference(&skydiver, name)).unwrap();
        assert!(value("seen.angular_velocity_radps") > 0.2);
        assert!(value("position.west") > 1.0);
    }

    #[test]
    fn yaw_by_muscle_needs_a_pose_that_is_not_symmetric() {
        let turned = |arm_share: f64, yaw: f64| {
            let mut skydiver = skydiver();
            let arm = reference(&skydiver, "joint.l_upperarm.theta");
            let pose = arm_share * skydiver.get(arm).unwrap();
            skydiver.set(arm, pose).unwrap();
            let muscle = reference(&skydiver, "muscle.yaw");
            skydiver.set(muscle, yaw).unwrap();
            skydiver.begin(0.0).unwrap();
            for _ in 0..240 {
                skydiver.step(1.0 / 240.0).unwrap();
            }
            skydiver.get(reference(&skydiver, "body_rate.yaw")).unwrap()
        };
        assert!((turned(1.0, 0.5) - turned(1.0, 0.0)).abs() < 1e-9);
        assert!((turned(0.3, 0.5) - turned(0.3, 0.0)).abs() > 0.01);
    }

    #[test]
    fn impossible_values_are_refused() {
        let mut skydiver = skydiver();
        skydiver.begin(0.0).unwrap();
        let (output, parameter) = (
            reference(&skydiver, "position.up"),
            reference(&skydiver, "start.position.up"),
        );
        assert!(skydiver.set(output, 1.0).is_err());
        assert!(skydiver.set(0, 1.0).is_err() && skydiver.set(10_000, 1.0).is_err());
        assert!(skydiver.set(1, f64::NAN).is_err());
        skydiver.set(parameter, 1.0).unwrap();
        assert!(skydiver.step(0.0).is_err() && skydiver.step(f64::NAN).is_err());
        assert!(skydiver.step(2.0).is_err());
        skydiver.step(0.01).unwrap();
        assert!(skydiver.set(parameter, 2.0).is_err());
    }
}
