//! The maneuvers in which planted faults of sensors on the limbs are flown.

/// Flown in turn, one for each seed.
pub(crate) const MANEUVERS: [&str; 11] = [
    "rotations",
    "side-slides",
    "longitudinal",
    "vertical",
    "barrel-roll",
    "back-loop",
    "tracking",
    "aggressive-turns",
    "exit-and-tracking",
    "layouts",
    "transitions",
];
