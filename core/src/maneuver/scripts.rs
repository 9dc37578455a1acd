//! The maneuver scripts.

use super::base::{BELLY, about};
use super::paper::PAPER_TRACKING;
use super::skill::{ROLL_OSCILLATION, RW_SUIT_TURNS};
use super::transitions::{FOURTEEN_TRANSITIONS, PAPER_TRANSITIONS};
use super::{Knots, Maneuver, Track};
use crate::aerodynamics::BELLY_TURN_DAMPING;
use crate::body::Segment;
use crate::body::pattern::{
    ARCH, DRAW_IN_LEFT, JointAngles, PRESS, SIDE_BEND, STRETCH, TRACK, TURN,
};
use crate::dynamics::muscle_input::LAYOUTS;

/// Moves the arms from the sides of the body to straight ahead of the shoulders.
const ARMS_AHEAD: &JointAngles = &[
    (Segment::LeftUpperArm, [0.0, 0.0, 1.0]),
    (Segment::RightUpperArm, [0.0, 0.0, 1.0]),
];
/// Straight body, arms at the sides.
const STRAIGHT: &JointAngles = &[];

/// Amount of a pattern (rad) that is held one way for some seconds, then the other way.
const TO_AND_FRO: Knots<f64> = &[
    (1.0, 0.0),
    (2.0, 0.25),
    (5.0, 0.25),
    (7.0, -0.25),
    (11.0, -0.25),
    (13.0, 0.2),
    (18.0, 0.2),
    (20.0, -0.3),
    (24.0, -0.3),
    (26.0, 0.0),
];

/// All maneuvers, starting with the paper's seven basic ones.
pub const MANEUVERS: &[Maneuver] = &[
    BELLY,
    Maneuver {
        name: "rotations",
        summary: "turns right and left by full circles",
        tracks: &[Track {
            pattern: TURN,
            amount: TO_AND_FRO,
        }],
        ..BELLY
    },
    Maneuver {
        name: "side-slides",
        summary: "slides to the left and to the right",
        tracks: &[Track {
            pattern: SIDE_BEND,
            amount: TO_AND_FRO,
        }],
        ..BELLY
    },
    Maneuver {
        name: "longitudinal",
        summary: "moves forwards and backwards by stretching and bending the legs",
        tracks: &[Track {
            pattern: STRETCH,
            amount: TO_AND_FRO,
        }],
        ..BELLY
    },
    Maneuver {
        name: "vertical",
        summary: "falls faster and slower by arching and de-arching",
        tracks: &[Track {
            pattern: ARCH,
            amount: TO_AND_FRO,
        }],
        ..BELLY
    },
    Maneuver {
        name: "barrel-roll",
        summary: "rolls about the long axis, from belly to belly",
        duration: 16.0,
        tracks: &[Track {
            pattern: DRAW_IN_LEFT,
            amount: &[
                (1.5, 0.0),
                (1.9, 1.4),
                (3.2, 1.4),
                (3.7, 0.0),
                (8.5, 0.0),
                (8.9, 1.4),
                (10.2, 1.4),
                (10.7, 0.0),
            ],
        }],
        muscle: &[
            (1.6, about(0.0, 0.0, 0.0)),
            (1.8, about(0.0, 0.0, 4.0)),
            (3.0, about(0.0, 0.0, 4.0)),
            (3.2, about(0.0, 0.0, 0.0)),
            (8.6, about(0.0, 0.0, 0.0)),
            (8.8, about(0.0, 0.0, 4.0)),
            (10.0, about(0.0, 0.0, 4.0)),
            (10.2, about(0.0, 0.0, 0.0)),
        ],
        damping: &[
            (1.0, BELLY_TURN_DAMPING),
            (1.5, about(3.0, 3.0, 0.05)),
            (2.8, about(3.0, 3.0, 0.05)),
            (3.2, about(6.0, 3.0, 12.0)),
            (4.5, BELLY_TURN_DAMPING),
            (8.0, BELLY_TURN_DAMPING),
            (8.5, about(3.0, 3.0, 0.05)),
            (9.8, about(3.0, 3.0, 0.05)),
            (10.2, about(6.0, 3.0, 12.0)),
            (11.5, BELLY_TURN_DAMPING),
        ],
        ..BELLY
    },
    Maneuver {
        name: "back-loop",
        summary: "loops backwards about the frontal axis, from belly to belly",
        duration: 12.0,
        tracks: &[Track {
            pattern: PRESS,
            amount: &[(1.5, 0.0), (1.9, 0.8), (3.2, 0.8), (3.7, 0.0)],
        }],
        muscle: &[
            (1.4, about(0.0, 0.0, 0.0)),
            (1.6, about(4.5, 0.0, 0.0)),
            (2.8, about(4.5, 0.0, 0.0)),
            (3.0, about(0.0, 0.0, 0.0)),
        ],
        damping: &[
            (1.0, BELLY_TURN_DAMPING),
            (1.5, about(-0.2, 3.0, 6.0)),
            (2.6, about(-0.2, 3.0, 6.0)),
            (3.2, about(12.0, 3.0, 6.0)),
            (4.5, BELLY_TURN_DAMPING),
        ],
        muscles: LAYOUTS,
        ..BELLY
    },
    Maneuver {
        name: "tracking",
        summary: "leaves the vertical: angle flying over a steady muscle input in pitch",
        base: TRACK,
        start_pitch: 1.9,
        start_speed: 0.9,
        tracks: &[Track {
            pattern: TURN,
            amount: &[(12.0, 0.0), (13.0, 0.04), (16.0, 0.0)],
        }],
        muscle: &[
            (0.0, about(0.0, 0.0, 0.0)),
            (3.0, about(0.4, 0.0, 0.0)),
            (14.0, about(0.5, 0.0, 0.0)),
            (20.0, about(0.3, 0.0, 0.0)),
            (28.0, about(0.45, 0.0, 0.0)),
        ],
        damping: &[(0.0, about(6.0, 3.0, 12.0))],
        ..BELLY
    },
    Maneuver {
        name: "aggressive-turns",
        summary: "turns fast by arms and muscle input in every axis",
        tracks: &[Track {
            pattern: TURN,
            amount: &[
                (2.0, 0.0),
                (2.5, 0.6),
                (4.5, 0.6),
                (5.0, 0.0),
                (6.0, 0.0),
                (6.5, -0.7),
                (8.5, -0.7),
                (9.0, 0.0),
                (11.0, 0.0),
                (11.5, 0.8),
                (13.5, 0.8),
                (14.0, 0.0),
                (16.0, 0.0),
                (16.5, -0.6),
                (17.5, -0.6),
                (18.0, 0.0),
                (19.0, 0.0),
                (19.5, 0.6),
                (22.5, 0.6),
                (23.0, 0.0),
                (24.0, 0.0),
                (24.5, -0.8),
                (27.5, -0.8),
                (28.0, 0.0),
            ],
        }],
        muscle: &[
            (2.0, about(0.2, 0.2, 0.2)),
            (2.5, about(0.6, 2.2, 0.7)),
            (4.5, about(0.6, 2.2, 0.7)),
            (5.0, about(0.2, 0.2, 0.2)),
            (11.0, about(0.2, 0.2, 0.2)),
            (11.5, about(0.6, 3.2, 0.7)),
            (13.5, about(0.6, 3.2, 0.7)),
            (14.0, about(0.2, 0.2, 0.2)),
            (24.0, about(0.2, 0.2, 0.2)),
            (24.5, about(0.6, 2.2, 0.7)),
            (27.5, about(0.6, 2.2, 0.7)),
            (28.0, about(0.2, 0.2, 0.2)),
        ],
        damping: &[
            (2.0, BELLY_TURN_DAMPING),
            (2.5, about(5.0, 2.0, 4.0)),
            (9.0, about(5.0, 2.0, 4.0)),
            (11.0, BELLY_TURN_DAMPING),
            (24.0, BELLY_TURN_DAMPING),
            (24.5, about(5.0, 2.0, 4.0)),
            (28.0, BELLY_TURN_DAMPING),
        ],
        ..BELLY
    },
    Maneuver {
        name: "exit-and-tracking",
        summary: "leaves an aircraft, tracks, changes to the back and returns to the belly by barrel rolls",
        duration: 55.0,
        base: TRACK,
        start_pitch: 0.7,
        start_speed: 0.05,
        start_forward: 40.0,
        tracks: &[Track {
            pattern: DRAW_IN_LEFT,
            amount: &[
                (30.0, 0.0),
                (30.4, 0.6),
                (31.8, 0.6),
                (32.3, 0.0),
                (43.0, 0.0),
                (43.4, 0.6),
                (44.8, 0.6),
                (45.3, 0.0),
            ],
        }],
        muscle: &[
            (8.0, about(0.0, 0.0, 0.0)),
            (11.0, about(1.25, 0.0, 0.0)),
            (22.0, about(1.25, 0.0, 0.0)),
            (24.0, about(0.45, 0.0, 0.0)),
            (29.8, about(0.45, 0.0, 0.0)),
            (30.3, about(0.2, 0.0, 4.0)),
            (31.4, about(0.2, 0.0, 4.0)),
            (31.6, about(0.2, 0.0, 0.0)),
            (42.8, about(0.2, 0.0, 0.0)),
            (43.3, about(0.2, 0.0, 4.0)),
            (44.4, about(0.2, 0.0, 4.0)),
            (44.6, about(0.2, 0.0, 0.0)),
            (48.0, about(0.3, 0.0, 0.0)),
        ],
        damping: &[
            (29.5, about(6.0, 3.0, 12.0)),
            (30.0, about(6.0, 3.0, 0.05)),
            (31.5, about(6.0, 3.0, 0.05)),
            (31.9, about(6.0, 3.0, 14.0)),
            (42.5, about(6.0, 3.0, 12.0)),
            (43.0, about(6.0, 3.0, 0.05)),
            (44.5, about(6.0, 3.0, 0.05)),
            (44.9, about(6.0, 3.0, 14.0)),
        ],
        ..BELLY
    },
    Maneuver {
        name: "layouts",
        summary: "flips over with the body straight: legs press, arms release, damping turns negative",
        duration: 12.0,
        base: STRAIGHT,
        tracks: &[Track {
            pattern: ARMS_AHEAD,
            amount: &[(2.0, 0.0), (2.4, 1.57), (4.2, 1.57), (6.0, 0.0)],
        }],
        muscle: &[
            (1.0, about(0.0, 0.0, 0.0)),
            (1.2, about(1.0, 0.0, 0.0)),
            (2.0, about(1.0, 0.0, 0.0)),
            (2.2, about(0.0, 0.0, 0.0)),
        ],
        damping: &[
            (0.0, about(12.0, 3.0, 6.0)),
            (1.9, about(12.0, 3.0, 6.0)),
            (2.1, about(-0.1, 3.0, 6.0)),
            (4.2, about(-0.1, 3.0, 6.0)),
            (4.6, about(12.0, 3.0, 6.0)),
        ],
        muscles: LAYOUTS,
        ..BELLY
    },
    Maneuver {
        name: "transitions",
        summary: "changes between belly and back by back flips and half barrel rolls",
        tracks: &[
            Track {
                pattern: PRESS,
                amount: &[
                    (1.5, 0.0),
                    (1.9, 0.8),
                    (3.2, 0.8),
                    (3.7, 0.0),
                    (15.5, 0.0),
                    (15.9, 0.8),
                    (17.2, 0.8),
                    (17.7, 0.0),
                ],
            },
            Track {
                pattern: DRAW_IN_LEFT,
                amount: &[
                    (8.5, 0.0),
                    (8.9, 1.4),
                    (9.7, 1.4),
                    (10.2, 0.0),
                    (22.5, 0.0),
                    (22.9, 1.4),
                    (23.7, 1.4),
                    (24.2, 0.0),
                ],
            },
        ],
        muscle: &[
            (1.4, about(0.0, 0.0, 0.0)),
            (1.6, about(3.0, 0.0, 0.0)),
            (2.4, about(3.0, 0.0, 0.0)),
            (3.0, about(0.0, 0.0, 0.0)),
            (8.6, about(0.0, 0.0, 0.0)),
            (8.8, about(0.0, 0.0, 4.0)),
            (9.2, about(0.0, 0.0, 4.0)),
            (9.4, about(0.0, 0.0, 0.0)),
            (15.4, about(0.0, 0.0, 0.0)),
            (15.6, about(3.0, 0.0, 0.0)),
            (16.4, about(3.0, 0.0, 0.0)),
            (17.0, about(0.0, 0.0, 0.0)),
            (22.6, about(0.0, 0.0, 0.0)),
            (22.8, about(0.0, 0.0, 4.0)),
            (23.2, about(0.0, 0.0, 4.0)),
            (23.4, about(0.0, 0.0, 0.0)),
        ],
        damping: &[
            (1.0, BELLY_TURN_DAMPING),
            (1.5, about(-0.2, 3.0, 6.0)),
            (2.6, about(-0.2, 3.0, 6.0)),
            (3.2, about(12.0, 3.0, 6.0)),
            (4.5, about(3.0, 3.0, 6.0)),
            (8.0, about(3.0, 3.0, 6.0)),
            (8.5, about(3.0, 3.0, 0.05)),
            (9.4, about(3.0, 3.0, 0.05)),
            (9.8, about(6.0, 3.0, 12.0)),
            (12.0, about(3.0, 3.0, 6.0)),
            (15.0, about(3.0, 3.0, 6.0)),
            (15.5, about(-0.2, 3.0, 6.0)),
            (16.6, about(-0.2, 3.0, 6.0)),
            (17.2, about(12.0, 3.0, 6.0)),
            (18.5, about(3.0, 3.0, 6.0)),
            (22.0, about(3.0, 3.0, 6.0)),
            (22.5, about(3.0, 3.0, 0.05)),
            (23.4, about(3.0, 3.0, 0.05)),
            (23.8, about(6.0, 3.0, 12.0)),
            (26.0, about(3.0, 3.0, 6.0)),
        ],
        muscles: LAYOUTS,
        ..BELLY
    },
    FOURTEEN_TRANSITIONS,
    RW_SUIT_TURNS,
    ROLL_OSCILLATION,
    PAPER_TRACKING,
    PAPER_TRANSITIONS,
];

impl Maneuver {
    /// Returns the maneuver with this name, or `None` if there is none.
    pub fn from_name(name: &str) -> Option<&'static Self> {
        MANEUVERS.iter().find(|maneuver| maneuver.name == name)
    }
}
