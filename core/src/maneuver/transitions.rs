//! The paper's fourteen transitions between belly and back to earth, in its order ("Transition Maneuvers").
//!
//! Each is one pulse of posture, muscle input and damping. The sizes of the pulses were found by a search with only two
//! criteria: the body must go over once, in the direction named by the paper, and come to rest. Both must hold for
//! people of 62 to 90 kg who sway, with and without a rig.

use super::base::{BELLY, about};
use super::{Maneuver, Track};
use crate::axis::AxisCoefficients;
use crate::body::Segment;
use crate::body::pattern::{DRAW_IN_LEFT, JointAngles, STRETCH, TO_BACK};

/// Time of the first transition (s).
const FIRST: f64 = 2.0;
/// Time from one transition to the next (s).
const EVERY: f64 = 3.2;
/// Rise and fall time of a pulse (s).
const RISE: f64 = 0.3;

/// How the body goes over: the amounts of the patterns in [`BRISK_TRACKS`] (rad) and the inputs.
#[derive(Clone, Copy)]
struct Way {
    joints: [f64; 5],
    muscle: AxisCoefficients<f64>,
    damping: AxisCoefficients<f64>,
    /// Duration at full size (s).
    hold: f64,
}

const fn way(joints: [f64; 5], muscle: [f64; 2], damping: [f64; 3], hold: f64) -> Way {
    let ([pitch, roll], [about_left, about_dorsal, about_cranial]) = (muscle, damping);
    Way {
        joints,
        muscle: about(pitch, 0.0, roll),
        damping: about(about_left, about_dorsal, about_cranial),
        hold,
    }
}

/// Belly to back through the legs.
const BACK_FLIP: Way = way(
    [-1.3, 2.0, 0.0, -0.1, -0.15],
    [0.1, 0.0],
    [-0.04, 3.0, 6.0],
    1.15,
);
/// Belly to back through the head.
const FRONT_LOOP: Way = way(
    [-0.74, -0.1, 0.0, -0.29, 0.84],
    [1.6, 0.0],
    [0.16, 3.0, 6.0],
    1.16,
);
/// Back to belly through the head.
const LAYOUT: Way = way(
    [-0.15, 0.8, 0.0, 0.87, 0.44],
    [2.2, 0.0],
    [0.3, 3.0, 6.0],
    0.44,
);
/// Back to belly through the legs.
const FRONT_FLIP: Way = way(
    [-0.54, -0.82, 0.0, -0.8, 0.19],
    [0.0, 0.0],
    [1.6, 3.0, 6.0],
    1.3,
);
/// Back to belly about the long axis.
const ROLL_TO_BELLY: Way = way(
    [0.0, 0.0, -1.04, 0.0, 0.0],
    [0.0, 3.8],
    [3.0, 3.0, 1.0],
    0.41,
);
const ROLL_TO_BACK: Way = way(
    [0.0, 0.0, -0.9, 0.0, 0.0],
    [0.0, 4.2],
    [3.0, 3.0, 0.1],
    0.64,
);
/// Started as a layout and ended as a roll; damping in pitch and yaw is negative, as found in the paper.
const FAILED_LAYOUT: Way = way(
    [-0.15, 0.3, 1.09, 0.1, 0.17],
    [1.0, 3.7],
    [-0.1, -0.2, 0.8],
    0.75,
);

/// A transition between belly and back to earth.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Transition {
    /// Belly to back through the legs.
    BackFlip,
    /// Belly to back through the head.
    FrontLoop,
    /// Back to belly through the head.
    Layout,
    /// Back to belly through the legs.
    FrontFlip,
    /// Back to belly about the long axis.
    RollToBelly,
    /// Belly to back about the long axis.
    RollToBack,
    /// Started as a layout and ended as a roll.
    FailedLayout,
}

/// One way for each [`Transition`], in the order of its variants.
type Ways = [Way; 7];

/// With moments alone, at up to 14 rad/s.
const BRISK: Ways = [
    BACK_FLIP,
    FRONT_LOOP,
    LAYOUT,
    FRONT_FLIP,
    ROLL_TO_BELLY,
    ROLL_TO_BACK,
    FAILED_LAYOUT,
];

/// With the paper's muscle forces and [fitted lever arms](crate::dynamics::muscle_input::FITTED_LEVER_ARMS), at up to
/// 8 rad/s; the paper's flights had 7. Found by the same search, for the default subject.
const GENTLE: Ways = [
    way(
        [-1.179, 1.534, 0.0, -0.095, -0.136],
        [0.1, 0.0],
        [0.189, 3.565, 6.094],
        1.018,
    ),
    way(
        [-0.543, -0.1, 0.0, -0.253, 1.097],
        [1.729, 0.0],
        [0.334, 3.608, 7.183],
        1.093,
    ),
    way(
        [-0.131, 0.73, 0.0, 0.794, 0.543],
        [2.433, 0.0],
        [0.558, 2.888, 7.015],
        0.507,
    ),
    way(
        [-0.482, -0.808, 0.0, -0.697, 0.183],
        [0.0, 0.0],
        [1.942, 3.242, 5.484],
        1.036,
    ),
    way(
        [0.0, 0.0, -1.014, 0.0, 0.0],
        [0.0, 3.461],
        [2.385, 3.607, 1.423],
        0.394,
    ),
    way(
        [0.0, 0.0, -1.16, 0.0, 0.0],
        [0.0, 3.12],
        [3.0, 3.0, 0.2],
        0.46,
    ),
    way(
        [-0.176, 0.265, 1.222, 0.112, 0.157],
        [1.013, 2.878],
        [-0.083, -0.189, 0.835],
        0.753,
    ),
];

/// The paper's order, starting belly to earth.
pub const ORDER: [Transition; 14] = {
    use Transition::{
        BackFlip, FailedLayout, FrontFlip, FrontLoop, Layout, RollToBack, RollToBelly,
    };
    [
        BackFlip,
        RollToBelly,
        FrontLoop,
        RollToBelly,
        BackFlip,
        FailedLayout,
        BackFlip,
        FrontFlip,
        RollToBack,
        Layout,
        BackFlip,
        Layout,
        BackFlip,
        Layout,
    ]
};

const fn begin(number: usize) -> f64 {
    FIRST + EVERY * number as f64
}

/// Knots of a joint's pulses; `which` (0 to 4) selects the pattern.
const fn joint(ways: &Ways, which: usize) -> [(f64, f64); 56] {
    let mut knots = [(0.0, 0.0); 56];
    let mut k = 0;
    while k < ORDER.len() {
        let (from, way) = (begin(k), ways[ORDER[k] as usize]);
        let until = from + RISE + way.hold;
        knots[4 * k] = (from, 0.0);
        knots[4 * k + 1] = (from + RISE, way.joints[which]);
        knots[4 * k + 2] = (until, way.joints[which]);
        knots[4 * k + 3] = (until + RISE, 0.0);
        k += 1;
    }
    knots
}

/// Knots of muscle input or damping, with the value `rest` between the pulses.
const fn inputs(
    ways: &Ways,
    damping: bool,
    rest: AxisCoefficients<f64>,
) -> [(f64, AxisCoefficients<f64>); 56] {
    let mut knots = [(0.0, rest); 56];
    let mut k = 0;
    while k < ORDER.len() {
        let (from, way) = (begin(k), ways[ORDER[k] as usize]);
        let until = from + RISE + way.hold;
        let value = if damping { way.damping } else { way.muscle };
        knots[4 * k] = (from, rest);
        knots[4 * k + 1] = (from + RISE, value);
        knots[4 * k + 2] = (until, value);
        knots[4 * k + 3] = (until + RISE, rest);
        k += 1;
    }
    knots
}

/// Knots of the share of the posture that is stable back to earth.
const fn on_back() -> [(f64, f64); 28] {
    let mut knots = [(0.0, 0.0); 28];
    let mut k = 0;
    while k < ORDER.len() {
        let after = if k.is_multiple_of(2) { 1.0 } else { 0.0 };
        knots[2 * k] = (begin(k) + 0.3, 1.0 - after);
        knots[2 * k + 1] = (begin(k) + 0.9, after);
        k += 1;
    }
    knots
}

/// Rotates both shoulders outwards, so that the bent forearms go up.
const ARMS_UP: &JointAngles = &[
    (Segment::LeftUpperArm, [0.0, 0.0, 1.0]),
    (Segment::RightUpperArm, [0.0, 0.0, 1.0]),
];
/// Moves both thighs towards the belly.
const HIPS_BENT: &JointAngles = &[
    (Segment::LeftThigh, [0.0, 0.0, 1.0]),
    (Segment::RightThigh, [0.0, 0.0, 1.0]),
];
/// Draws both arms in to the body.
const DRAW_IN: &JointAngles = &[
    (Segment::LeftUpperArm, [0.0, -1.0, 0.0]),
    (Segment::RightUpperArm, [0.0, 1.0, 0.0]),
    (Segment::LeftForearm, [0.0, -1.0, 0.0]),
    (Segment::RightForearm, [0.0, 1.0, 0.0]),
];

const fn track(pattern: &'static JointAngles, amount: &'static [(f64, f64)]) -> Track {
    Track { pattern, amount }
}

const BRISK_TRACKS: &[Track] = &[
    track(TO_BACK, &const { on_back() }),
    track(ARMS_UP, &const { joint(&BRISK, 0) }),
    track(HIPS_BENT, &const { joint(&BRISK, 1) }),
    track(DRAW_IN_LEFT, &const { joint(&BRISK, 2) }),
    track(DRAW_IN, &const { joint(&BRISK, 3) }),
    track(STRETCH, &const { joint(&BRISK, 4) }),
];

const GENTLE_TRACKS: &[Track] = &[
    track(TO_BACK, &const { on_back() }),
    track(ARMS_UP, &const { joint(&GENTLE, 0) }),
    track(HIPS_BENT, &const { joint(&GENTLE, 1) }),
    track(DRAW_IN_LEFT, &const { joint(&GENTLE, 2) }),
    track(DRAW_IN, &const { joint(&GENTLE, 3) }),
    track(STRETCH, &const { joint(&GENTLE, 4) }),
];

/// Damping between the pulses.
const RELAXED: AxisCoefficients<f64> = about(6.0, 3.0, 8.0);

/// The paper's fourteen transitions in one flight of 48 s that starts and ends belly to earth.
pub const FOURTEEN_TRANSITIONS: Maneuver = Maneuver {
    name: "fourteen-transitions",
    summary: "the paper's order of flips, loops, rolls and layouts, one of which fails",
    duration: 48.0,
    tracks: BRISK_TRACKS,
    muscle: &const { inputs(&BRISK, false, about(0.0, 0.0, 0.0)) },
    damping: &const { inputs(&BRISK, true, RELAXED) },
    ..BELLY
};

/// The same at the rates of the paper's flights, and with its muscle forces.
pub const PAPER_TRANSITIONS: Maneuver = Maneuver {
    name: "paper-transitions",
    summary: "the same fourteen at the paper's rates of rotation, for flights with its muscle forces",
    tracks: GENTLE_TRACKS,
    muscle: &const { inputs(&GENTLE, false, about(0.0, 0.0, 0.0)) },
    damping: &const { inputs(&GENTLE, true, RELAXED) },
    ..FOURTEEN_TRANSITIONS
};
