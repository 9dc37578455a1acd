//! The paper's tracking flight with the numbers that the paper gives, for flights with its muscle forces.

use super::base::{BELLY, about};
use super::{Maneuver, Track};
use crate::body::pattern::{DRAW_IN_LEFT, TRACK};

/// Paper "The Tracking Maneuver": 33 m/s over ground with a pitch input between 1 and 2 and strong damping, then two
/// rolls, each by a burst of roll input as the damping is released.
///
/// The sizes of the bursts were found by a search for one roll each way that is no faster than necessary, with
/// [`FITTED_LEVER_ARMS`](crate::dynamics::muscle_input::FITTED_LEVER_ARMS).
pub(super) const PAPER_TRACKING: Maneuver = Maneuver {
    name: "paper-tracking",
    summary: "tracks at 33 m/s over a steady pitch input, as in the paper, and rolls to the back and to the belly",
    duration: 55.0,
    base: TRACK,
    start_pitch: 0.7,
    start_speed: 0.05,
    start_forward: 40.0,
    tracks: &[Track {
        pattern: DRAW_IN_LEFT,
        amount: &[
            (30.0, 0.0),
            (30.4, 0.586),
            (31.65, 0.586),
            (32.15, 0.0),
            (43.0, 0.0),
            (43.4, 0.724),
            (44.717, 0.724),
            (45.217, 0.0),
        ],
    }],
    muscle: &[
        (8.0, about(0.0, 0.0, 0.0)),
        (11.0, about(1.336, 0.0, 0.0)),
        (28.0, about(1.336, 0.0, 0.0)),
        (29.5, about(0.45, 0.0, 0.0)),
        (29.8, about(0.45, 0.0, 0.0)),
        (30.3, about(0.2, 0.0, 3.216)),
        (31.25, about(0.2, 0.0, 3.216)),
        (31.55, about(0.2, 0.0, 0.0)),
        (42.8, about(0.2, 0.0, 0.0)),
        (43.3, about(0.2, 0.0, 2.943)),
        (44.317, about(0.2, 0.0, 2.943)),
        (44.617, about(0.2, 0.0, 0.0)),
        (48.0, about(0.3, 0.0, 0.0)),
    ],
    damping: &[
        (8.0, about(6.0, 3.0, 12.0)),
        (11.0, about(8.673, 3.0, 12.0)),
        (29.5, about(8.673, 3.0, 12.0)),
        (30.0, about(6.0, 3.0, 0.035)),
        (31.35, about(6.0, 3.0, 0.035)),
        (31.75, about(6.0, 3.0, 14.0)),
        (42.5, about(6.0, 3.0, 12.0)),
        (43.0, about(6.0, 3.0, 0.048)),
        (44.417, about(6.0, 3.0, 0.048)),
        (44.817, about(6.0, 3.0, 14.0)),
    ],
    ..BELLY
};
