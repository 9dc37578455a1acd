//! The body for drawing: the aerodynamic shape of each segment, the person in it, and the equipment.

use core::f64::consts::FRAC_PI_4;

use bodyflight_core::Segment;
use bodyflight_core::body::gear::{Shoes, Suit};
use bodyflight_core::body::pattern::{self, JointAngles};
use bodyflight_core::body::posture::pose;
use bodyflight_viewer::frame::half_extents;
use serde::Serialize;

use bodyflight_replay::subject::Subject;

/// Posture in which the skin is made. The limbs are apart, so that points near each other belong together.
const REST: &JointAngles = &[
    (Segment::LeftUpperArm, [0.0, FRAC_PI_4, 0.0]),
    (Segment::RightUpperArm, [0.0, -FRAC_PI_4, 0.0]),
    (Segment::LeftThigh, [0.0, 0.2, 0.0]),
    (Segment::RightThigh, [0.0, -0.2, 0.0]),
];

/// A segment for drawing. Axes are those of the segment: left, dorsal, cranial.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Shape {
    /// Name.
    pub name: &'static str,
    /// Half the extents of its aerodynamic shape (m), including equipment.
    pub half_extents_m: [f64; 3],
    /// Vector from its joint to its centre of gravity (m).
    pub cg_m: [f64; 3],
    /// Half the extents of the person in it (m), without equipment.
    pub person_half_extents_m: [f64; 3],
    /// Vector from its joint to the middle of the person in it (m).
    pub person_middle_m: [f64; 3],
    /// Its joint in the posture in which the skin is made (m), body axes.
    pub rest_joint_m: [f64; 3],
    /// `body_from_segment` in that posture.
    pub rest_attitude: [f64; 4],
}

/// Equipment of a person.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Worn {
    /// A helmet.
    pub helmet: bool,
    /// Shoes.
    pub shoes: bool,
    /// A parachute on the back.
    pub rig: bool,
    /// A weight belt.
    pub weight_belt: bool,
    /// Name of the suit.
    pub suit: &'static str,
}

impl Worn {
    /// The equipment of a subject.
    pub fn of(subject: &Subject) -> Self {
        let gear = subject.gear();
        let suit = Suit::NAMED.iter().find(|(_, suit)| *suit == gear.suit);
        Self {
            helmet: gear.helmet,
            shoes: gear.shoes != Shoes::Barefoot,
            rig: gear.rig > 0.0,
            weight_belt: gear.weight_belt > 0.0,
            suit: suit.map_or("standard", |(name, _)| *name),
        }
    }
}

/// Shapes of all segments of a subject.
pub fn shapes(subject: &Subject) -> Vec<Shape> {
    let (body, person) = (subject.body(), subject.bare_body());
    let posture = pattern::posture(REST);
    let (posed, turned) = (pose(&body, &posture), posture.body_from_segments());
    let shape = |segment: Segment| {
        let turn = &turned[segment];
        Shape {
            name: segment.name(),
            half_extents_m: half_extents(&body.segments[segment].area).into(),
            cg_m: body.segments[segment].cg.into(),
            person_half_extents_m: half_extents(&person.segments[segment].area).into(),
            person_middle_m: person.segments[segment].cg.into(),
            rest_joint_m: posed[segment].joint.into(),
            rest_attitude: [turn.w, turn.i, turn.j, turn.k],
        }
    };
    Segment::ALL.map(shape).to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Equipment adds to the aerodynamic shape, never to the person.
    #[test]
    fn a_person_is_smaller_than_the_body_with_equipment() {
        let shapes = shapes(&Subject::default());
        assert_eq!(shapes.len(), Segment::ALL.len());
        let size = |half: &[f64; 3]| half.iter().product::<f64>();
        for shape in &shapes {
            let (worn, person) = (
                size(&shape.half_extents_m),
                size(&shape.person_half_extents_m),
            );
            assert!(person > 0.0 && person <= worn * 1.0001, "{}", shape.name);
        }
        let at = |name: &str| {
            let shape = shapes.iter().find(|shape| shape.name == name);
            shape.map(|shape| shape.rest_joint_m).unwrap_or_default()
        };
        let (left, right) = (at("l_hand"), at("r_hand"));
        assert!(left[0] > 0.4 && (left[0] + right[0]).abs() < 1e-9);
    }
}
