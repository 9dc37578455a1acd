//! What if: a recorded flight simulated again with changes, as `bodyflight simulate` does with `--joint`, `--inputs none`
//! and the effects `mass`, `drag`, `lift` and `moment`.

use bodyflight_core::body::SEGMENT_COUNT;
use bodyflight_core::body::joint_angle::{JointAngle, share_within};
use bodyflight_core::body::mass_properties::PostureRate;
use bodyflight_core::dynamics::free_run::{Equations, FreeRun};
use bodyflight_core::dynamics::{Dynamics, Inputs, Motion};
use bodyflight_core::frame::{Rotation, Vector};
use bodyflight_core::observation::Observation;
use bodyflight_core::{AxisCoefficients, Posture, Segment};
use nalgebra::{Quaternion, UnitQuaternion};

use crate::frame::{Frame, frame};
use crate::setup::Setup;

/// Numbers of a recorded row: time (s), muscle input, damping, and for each segment but the pelvis the quaternion
/// `parent_from_segment` (w, x, y, z).
pub const ROW: usize = 1 + 6 + 4 * (SEGMENT_COUNT - 1);

/// Numbers of an initial motion: position (m, inertial), attitude `inertial_from_body` (w, x, y, z), velocity (m/s) and
/// angular velocity (rad/s) in body axes.
pub const START: usize = 3 + 4 + 3 + 3;

/// Numbers of what is seen of a step: time (s), the observation, position (m) and attitude.
pub const SEEN: usize = 1 + 7 + 3 + 4;

/// Most joint angles that can be changed at once.
pub const MOST: usize = 16;

/// A change of an angle of a joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Change {
    /// The angle.
    pub angle: JointAngle,
    /// How much further the joint is turned (rad).
    pub by: f64,
    /// When (s); always without a window.
    pub window: Option<[f64; 2]>,
}

impl Change {
    /// The change (rad) at a time (s).
    fn at(&self, time: f64) -> f64 {
        self.window
            .map_or(self.by, |window| self.by * share_within(window, time))
    }
}

/// What is changed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Changes {
    joints: [Option<Change>; MOST],
    mass_factor: f64,
    area_factor: f64,
    without_inputs: bool,
}

impl Default for Changes {
    fn default() -> Self {
        Self::of_body(1.0, 1.0, false)
    }
}

impl Changes {
    /// Factors on all masses and inertias, and on all drag, lift and moment coefficients, and whether the known inputs are
    /// replaced by the subject's damping.
    pub const fn of_body(mass_factor: f64, area_factor: f64, without_inputs: bool) -> Self {
        Self {
            joints: [None; MOST],
            mass_factor,
            area_factor,
            without_inputs,
        }
    }

    /// Adds a change of a joint; returns whether there was room for it.
    pub fn add(&mut self, change: Change) -> bool {
        let free = self.joints.iter_mut().find(|joint| joint.is_none());
        free.map(|place| *place = Some(change)).is_some()
    }

    /// A posture with the changes at a time (s), each in the axes of the joint's parent.
    fn of(&self, posture: Posture<f64>, time: f64) -> Posture<f64> {
        let joints = self.joints.iter().flatten();
        joints.fold(posture, |posture, change| {
            change.angle.turned(&posture, change.at(time))
        })
    }
}

/// A recorded posture, and the inputs since the row before.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Row {
    /// Time since frame 0 (s).
    pub time: f64,
    /// Conscious inputs up to this row.
    pub inputs: Inputs<f64>,
    /// Posture.
    pub posture: Posture<f64>,
}

impl Row {
    /// Reads a row from its numbers.
    pub fn from_numbers(numbers: &[f64; ROW]) -> Self {
        let mut next = numbers.iter().copied();
        let mut number = || next.next().unwrap_or(0.0);
        let time = number();
        let mut three = || AxisCoefficients::new(number(), number(), number());
        let inputs = Inputs {
            muscle: three(),
            damping: three(),
            ..Inputs::belly_turn()
        };
        let mut posture = Posture::h_pose();
        for segment in Segment::ALL.into_iter().skip(1) {
            posture.set(segment, rotation([number(), number(), number(), number()]));
        }
        Self {
            time,
            inputs,
            posture,
        }
    }
}

fn rotation([w, x, y, z]: [f64; 4]) -> UnitQuaternion<f64> {
    UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z))
}

/// Reads an initial motion from its numbers.
pub fn motion(numbers: &[f64; START]) -> Motion<f64> {
    let at = |k: usize| numbers.get(k).copied().unwrap_or(0.0);
    Motion {
        position: Vector::new(at(0), at(1), at(2)),
        inertial_from_body: Rotation::from_quaternion(rotation([at(3), at(4), at(5), at(6)])),
        velocity: Vector::new(at(7), at(8), at(9)),
        angular_velocity: Vector::new(at(10), at(11), at(12)),
    }
}

/// The numbers of an initial motion.
pub fn start_numbers(motion: &Motion<f64>) -> [f64; START] {
    let attitude = motion.inertial_from_body.quaternion();
    let mut numbers = (motion.position.to_array().into_iter())
        .chain([attitude.w, attitude.i, attitude.j, attitude.k])
        .chain(motion.velocity.to_array())
        .chain(motion.angular_velocity.to_array());
    core::array::from_fn(|_| numbers.next().unwrap_or(0.0))
}

/// A flight with changes, stepped from row to row.
#[derive(Debug, Clone)]
pub struct WhatIf {
    dynamics: Dynamics<f64>,
    own_inputs: Inputs<f64>,
    equations: Equations,
    changes: Changes,
    start: Motion<f64>,
    run: Option<FreeRun<f64>>,
    /// The row reached, and the one ahead of it.
    reached: Option<Row>,
    ahead: Option<Row>,
    motion: Motion<f64>,
}

impl WhatIf {
    /// Starts a flight with an initial motion.
    pub fn new(
        setup: &Setup<f64>,
        equations: Equations,
        start: Motion<f64>,
        changes: &Changes,
    ) -> Self {
        let mut dynamics = setup.dynamics;
        dynamics.body.scale_mass(changes.mass_factor);
        dynamics.aerodynamics.scale_area(changes.area_factor);
        Self {
            dynamics,
            own_inputs: setup.inputs,
            equations,
            changes: *changes,
            start,
            run: None,
            reached: None,
            ahead: None,
            motion: start,
        }
    }

    /// Takes the next row as recorded, and advances to the row before it: the joint rates at a row depend on the row ahead.
    /// Returns whether a row is reached, which is so from the second row on.
    pub fn push(&mut self, row: &Row) -> bool {
        let mut row = Row {
            posture: self.changes.of(row.posture, row.time),
            ..*row
        };
        if self.changes.without_inputs {
            row.inputs = self.own_inputs;
        }
        match (self.reached, self.ahead, &mut self.run) {
            (Some(before), Some(now), Some(_)) => {
                self.advance(&before, &now, &row);
                self.ahead = Some(row);
            }
            (Some(first), ..) => {
                let rate = rate(&first, &row);
                let (equations, start) = (self.equations, &self.start);
                let run = FreeRun::new(&self.dynamics, equations, start, &first.posture, &rate);
                self.run = Some(run);
                self.ahead = Some(row);
            }
            _ => {
                self.reached = Some(row);
                return false;
            }
        }
        true
    }

    /// Advances to the last row.
    pub fn finish(&mut self) {
        if let (Some(before), Some(last)) = (self.reached, self.ahead.take()) {
            self.advance(&before, &last, &last);
        }
    }

    fn advance(&mut self, before: &Row, now: &Row, after: &Row) {
        let duration = now.time - before.time;
        if let Some(run) = &mut self.run {
            run.advance(&self.dynamics, &now.inputs, &now.posture, duration);
            self.motion = run.motion(&self.dynamics, &rate(before, after));
            self.reached = Some(*now);
        }
    }

    /// The motion at the row reached.
    pub const fn motion(&self) -> &Motion<f64> {
        &self.motion
    }

    /// The row reached, with the changes.
    pub const fn reached(&self) -> Option<&Row> {
        self.reached.as_ref()
    }

    /// What is seen at the row reached, see [`SEEN`].
    pub fn seen(&self) -> [f64; SEEN] {
        let (motion, time) = (&self.motion, self.reached.map_or(0.0, |row| row.time));
        let seen = Observation::of(motion);
        let attitude = motion.inertial_from_body.quaternion();
        let mut numbers = ([
            time,
            seen.angles.roll,
            seen.angles.pitch,
            seen.angles.heading,
            seen.yaw_rate,
            seen.angular_velocity.norm(),
            seen.horizontal_speed,
            seen.vertical_velocity,
        ]
        .into_iter())
        .chain(motion.position.to_array())
        .chain([attitude.w, attitude.i, attitude.j, attitude.k]);
        core::array::from_fn(|_| numbers.next().unwrap_or(0.0))
    }

    /// The frame at the row reached.
    pub fn frame(&self) -> Option<Frame> {
        let row = self.reached?;
        let (inputs, posture) = (&row.inputs, &row.posture);
        Some(frame(
            &self.dynamics,
            inputs,
            posture,
            &self.motion,
            row.time,
        ))
    }
}

/// Mean joint rates between two rows.
fn rate(from: &Row, to: &Row) -> PostureRate<f64> {
    PostureRate::between(&from.posture, &to.posture, to.time - from.time)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cockpit::tests::setup;
    use bodyflight_core::body::pattern;
    use bodyflight_core::frame::facing_north;

    fn numbers(time: f64) -> [f64; ROW] {
        let mut all = [0.0; ROW];
        all[0] = time;
        all[4..7].copy_from_slice(&[3.0, 0.5, 6.0]);
        let posture = pattern::neutral::<f64>();
        for (segment, four) in Segment::ALL
            .into_iter()
            .skip(1)
            .zip(all[7..].chunks_exact_mut(4))
        {
            let turn = posture.parent_from_segment(segment);
            four.copy_from_slice(&[turn.w, turn.i, turn.j, turn.k]);
        }
        all
    }

    fn flown(changes: &Changes) -> Motion<f64> {
        let single = setup();
        let setup = Setup::<f64> {
            dynamics: single.dynamics.cast(),
            inputs: single.inputs.cast(),
        };
        let attitude = facing_north(core::f64::consts::FRAC_PI_2);
        let start = Motion {
            inertial_from_body: attitude,
            position: Vector::new(1.0, 2.0, 3.0),
            velocity: attitude.inverse() * Vector::new(0.0, 0.0, -50.0),
            angular_velocity: Vector::zero(),
        };
        let start = motion(&start_numbers(&start));
        let mut flight = WhatIf::new(&setup, Equations::Exact, start, changes);
        for k in 0..=480 {
            let is_reached = flight.push(&Row::from_numbers(&numbers(f64::from(k) / 240.0)));
            assert_eq!(is_reached, k > 0);
        }
        flight.finish();
        assert!((flight.seen()[0] - 2.0).abs() < 1e-9);
        *flight.motion()
    }

    #[test]
    fn a_bent_arm_turns_a_heavy_body_falls_faster_and_a_wide_one_slower() {
        let plain = flown(&Changes::default());
        let mut turned = Changes::default();
        let angle = JointAngle::of_joint(Segment::LeftUpperArm).next().unwrap();
        let change = Change {
            angle,
            by: 0.5,
            window: None,
        };
        assert!(turned.add(change));
        let turned = flown(&turned).angular_velocity - plain.angular_velocity;
        assert!(turned.norm() > 0.1, "{turned:?}");
        let fall = |changes: &Changes| -flown(changes).velocity_inertial().up();
        let (heavy, wide) = (
            Changes::of_body(1.2, 1.0, false),
            Changes::of_body(1.0, 1.2, false),
        );
        let rates = [fall(&heavy), fall(&Changes::default()), fall(&wide)];
        assert!(
            rates[0] > rates[1] + 0.5 && rates[1] > rates[2] + 0.5,
            "{rates:?}"
        );
    }

    #[test]
    fn more_changes_than_there_is_room_for_are_refused() {
        let mut changes = Changes::default();
        let angle = JointAngle::all().next().unwrap();
        let change = Change {
            angle,
            by: 0.1,
            window: Some([0.0, 1.0]),
        };
        assert!((0..MOST).all(|_| changes.add(change)));
        assert!(!changes.add(change));
    }
}
