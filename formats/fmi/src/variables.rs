//! The variables of a unit, in one table for both the description and the library.

use bodyflight_core::Segment;
use bodyflight_core::axis::AXIS_NAMES;
use bodyflight_core::body::pattern;
use bodyflight_core::body::posture::joint_angles;
use bodyflight_core::frame::{Inertial, Rotation, facing_north};

use bodyflight_replay::comparison::Channel;
use bodyflight_replay::flight::Flight;

/// Initial fall speed (m/s).
const SPEED: f64 = 50.0;

/// The role of a variable.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Causality {
    /// Set before each step.
    Input,
    /// Set before the flight.
    Parameter,
    /// Read after each step.
    Output,
}

/// A variable. Its value reference is its place in the table plus one; 0 is the time.
#[derive(Debug, Clone, PartialEq)]
pub struct Variable {
    /// Name, structured by dots.
    pub name: String,
    /// Its role.
    pub causality: Causality,
    /// Unit as FMI writes it; 1 for a plain number.
    pub unit: &'static str,
    /// Initial value; that of an output is computed.
    pub start: f64,
    /// Its meaning.
    pub meaning: &'static str,
}

/// Places of groups of variables in the table.
pub mod places {
    use bodyflight_core::Segment;

    use super::Channel;

    /// Joint angles: psi, theta, phi of each segment but the pelvis.
    pub const JOINTS: usize = 0;
    /// Muscle input: pitch, yaw, roll.
    pub const MUSCLE: usize = JOINTS + 3 * (Segment::ALL.len() - 1);
    /// Damping: pitch, yaw, roll.
    pub const DAMPING: usize = MUSCLE + 3;
    /// Velocity of the air: north, west, up.
    pub const WIND: usize = DAMPING + 3;
    /// First motion: position, velocity, attitude, body rates.
    pub const START: usize = WIND + 3;
    /// Outputs: position, velocity, attitude, body rates.
    pub const MOTION: usize = START + 13;
    /// Outputs: channels.
    pub const CHANNELS: usize = MOTION + 13;
    /// Outputs: centre of gravity, world axes.
    pub const CENTRE: usize = CHANNELS + Channel::ALL.len();
    /// Outputs: total aerodynamic force and moment.
    pub const LOADS: usize = CENTRE + 3;
    /// Outputs: force and moment of each segment.
    pub const SEGMENT_LOADS: usize = LOADS + 6;
    /// Number of variables.
    pub const COUNT: usize = SEGMENT_LOADS + 6 * Segment::ALL.len();
}

/// Meaning of muscle input.
const MUSCLE: &str = "muscle input coefficient: scales the moment of the air on limbs, so yaw does nothing in a pose whose left and right sides mirror each other";

const INERTIAL: [&str; 3] = ["north", "west", "up"];
const BODY: [&str; 3] = ["left", "dorsal", "cranial"];
const ROTATION: [&str; 4] = ["w", "x", "y", "z"];

struct Table(Vec<Variable>);

impl Table {
    fn add<const N: usize>(
        &mut self,
        causality: Causality,
        (group, parts): (&str, [&str; N]),
        start: [f64; N],
        (unit, meaning): (&'static str, &'static str),
    ) {
        for (part, start) in parts.into_iter().zip(start) {
            self.0.push(Variable {
                name: format!("{group}.{part}"),
                causality,
                unit,
                start,
                meaning,
            });
        }
    }

    /// Position, velocity, attitude and body rates.
    fn add_motion(&mut self, causality: Causality, group: &str) {
        let attitude: Rotation<f64, Inertial, _> = facing_north(core::f64::consts::FRAC_PI_2);
        let mut add = |what: &str, about: (&'static str, &'static str), start: &[f64]| match *start
        {
            [a, b, c, d] => self.add(
                causality,
                (&format!("{group}{what}"), ROTATION),
                [a, b, c, d],
                about,
            ),
            [a, b, c] => {
                let parts = if what == "body_rate" {
                    AXIS_NAMES
                } else {
                    INERTIAL
                };
                self.add(
                    causality,
                    (&format!("{group}{what}"), parts),
                    [a, b, c],
                    about,
                );
            }
            _ => {}
        };
        add("position", ("m", "pelvic joint, world axes"), &[0.0; 3]);
        let velocity = (
            "m/s",
            "velocity of the pelvic joint over ground, world axes",
        );
        add("velocity", velocity, &[0.0, 0.0, -SPEED]);
        let turn = ("1", "attitude of the body, quaternion world from body");
        add("attitude", turn, &attitude.wxyz());
        add(
            "body_rate",
            ("rad/s", "angular velocity, body axes"),
            &[0.0; 3],
        );
    }
}

/// All variables of a unit with this flight's person and air, in order.
pub fn variables(flight: &Flight) -> Vec<Variable> {
    let mut table = Table(Vec::with_capacity(places::COUNT));
    let neutral = pattern::neutral::<f64>();
    for segment in Segment::ALL.into_iter().skip(1) {
        table.add(
            Causality::Input,
            (
                &format!("joint.{}", segment.name()),
                ["psi", "theta", "phi"],
            ),
            joint_angles(neutral.parent_from_segment(segment)),
            ("rad", "joint angle to reach at the end of the step"),
        );
    }
    let axes = |group| (group, AXIS_NAMES);
    table.add(Causality::Input, axes("muscle"), [0.0; 3], ("1", MUSCLE));
    table.add(
        Causality::Input,
        axes("damping"),
        flight.subject.damping().to_array(),
        ("1", "damping coefficient"),
    );
    table.add(
        Causality::Input,
        ("wind", INERTIAL),
        flight.air_velocity,
        ("m/s", "velocity of the air, world axes"),
    );
    table.add_motion(Causality::Parameter, "start.");
    table.add_motion(Causality::Output, "");
    for channel in Channel::ALL {
        let (_, unit) = channel.label();
        table.0.push(Variable {
            name: format!("seen.{}", channel.key()),
            causality: Causality::Output,
            unit,
            start: 0.0,
            meaning: "a channel in which flights are compared",
        });
    }
    table.add(
        Causality::Output,
        ("cg", INERTIAL),
        [0.0; 3],
        ("m", "centre of gravity, world axes"),
    );
    let force = ("N", "force of the air, body axes");
    let moment = ("N.m", "moment of the air about the pelvic joint, body axes");
    table.add(Causality::Output, ("force", BODY), [0.0; 3], force);
    table.add(Causality::Output, axes("moment"), [0.0; 3], moment);
    for segment in Segment::ALL {
        let name = segment.name();
        let group = format!("force.{name}");
        table.add(Causality::Output, (&group, BODY), [0.0; 3], force);
        let group = format!("moment.{name}");
        table.add(Causality::Output, (&group, AXIS_NAMES), [0.0; 3], moment);
    }
    table.0
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;
    use std::path::Path;

    use super::*;

    #[test]
    fn every_variable_has_a_unit() {
        for variable in variables(&Flight::bare(Path::new("none.mvnx"))) {
            assert!(!variable.unit.is_empty(), "{}", variable.name);
        }
    }

    #[test]
    fn groups_begin_at_their_stated_indices() {
        let all = variables(&Flight::bare(Path::new("none.mvnx")));
        assert_eq!(all.len(), places::COUNT);
        for (place, name) in [
            (places::JOINTS, "joint.abdomen.psi"),
            (places::MUSCLE, "muscle.pitch"),
            (places::DAMPING, "damping.pitch"),
            (places::WIND, "wind.north"),
            (places::START, "start.position.north"),
            (places::MOTION, "position.north"),
            (places::CHANNELS, "seen.roll_rad"),
            (places::CENTRE, "cg.north"),
            (places::LOADS, "force.left"),
            (places::SEGMENT_LOADS, "force.pelvis.left"),
        ] {
            assert_eq!(all[place].name, name);
        }
        let names: BTreeSet<&str> = all.iter().map(|variable| variable.name.as_str()).collect();
        assert_eq!(names.len(), all.len());
    }
}
