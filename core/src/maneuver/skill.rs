//! Maneuvers of an expert and of a novice: turns in a suit with booties, and rocking from side to side.

use super::base::{BELLY, about};
use super::{Maneuver, Track};
use crate::aerodynamics::BELLY_TURN_DAMPING;
use crate::body::Segment;
use crate::body::pattern::{JointAngles, TURN};
use crate::dynamics::muscle_input;

/// Presses one arm and the leg on the same side down into the airstream.
const LEFT_SIDE_DOWN: &JointAngles = &[
    (Segment::LeftUpperArm, [0.0, 0.0, -1.0]),
    (Segment::LeftThigh, [0.0, 0.0, 1.0]),
];

/// Turns of a competitive skydiver, paper "Skydiver Conscious Inputs During Basic Maneuvers".
pub const RW_SUIT_TURNS: Maneuver = Maneuver {
    name: "rw-suit-turns",
    summary: "turns fast by arms, thighs and shanks, as in a suit with booties",
    duration: 24.0,
    tracks: &[Track {
        pattern: TURN,
        amount: &[
            (1.5, 0.0),
            (2.0, 0.5),
            (5.0, 0.5),
            (5.5, -0.5),
            (8.5, -0.5),
            (9.0, 0.0),
            (11.0, 0.0),
            (11.5, 0.7),
            (14.0, 0.7),
            (14.5, -0.7),
            (17.0, -0.7),
            (17.5, 0.0),
        ],
    }],
    muscle: &[
        (1.5, about(0.0, 0.0, 0.0)),
        (2.0, about(0.5, 2.0, 0.5)),
        (8.5, about(0.5, 2.0, 0.5)),
        (9.0, about(0.0, 0.0, 0.0)),
        (11.0, about(0.0, 0.0, 0.0)),
        (11.5, about(0.8, 3.0, 0.5)),
        (17.0, about(0.8, 3.0, 0.5)),
        (17.5, about(0.0, 0.0, 0.0)),
    ],
    damping: &[
        (1.5, BELLY_TURN_DAMPING),
        (2.0, about(4.0, 1.5, 6.0)),
        (17.0, about(4.0, 1.5, 6.0)),
        (17.5, BELLY_TURN_DAMPING),
    ],
    muscles: muscle_input::RW_SUIT_TURNS,
    ..BELLY
};

/// Paper "Pitch and Roll oscillations experienced by novices": without damping about the long axis the rocking grows.
pub const ROLL_OSCILLATION: Maneuver = Maneuver {
    name: "roll-oscillation",
    summary: "rocks from side to side, tense, with one arm and one leg down, and calms down when relaxed",
    duration: 20.0,
    tracks: &[Track {
        pattern: LEFT_SIDE_DOWN,
        amount: &[(2.0, 0.0), (3.0, 0.6)],
    }],
    damping: &[
        (1.5, BELLY_TURN_DAMPING),
        (2.5, about(3.0, 2.0, 0.0)),
        (11.0, about(3.0, 2.0, 0.0)),
        (12.0, about(3.0, 2.0, 6.0)),
    ],
    ..BELLY
};
