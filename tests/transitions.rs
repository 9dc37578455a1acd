//! The paper's fourteen transitions between belly and back to earth, in several styles.

use std::borrow::Cow;

use bodyflight_core::body::pattern::{DRAW_IN_LEFT, PRESS, TO_BACK};
use bodyflight_core::maneuver::transitions::{ORDER, Transition};

use crate::estimator_flights::{FLIPS_AND_ROLLS, Flight, Pulse};

/// How a skydiver performs each kind of transition. The numbers were found by a search with one criterion: that the
/// body changes sides once in each of the fourteen.
#[derive(Debug, Clone, Copy)]
pub struct Style {
    /// Muscle input, damping, and the amplitude (rad) of a joint pattern, each added for the duration of a transition:
    /// back flip and layout about the left axis with [`PRESS`], rolls to belly and to back with [`DRAW_IN_LEFT`].
    moves: [[f64; 3]; 4],
    sway: f64,
    /// Damping between transitions [pitch, yaw, roll].
    damping: [f64; 3],
}

const fn style(moves: [[f64; 3]; 4], sway: f64, damping: [f64; 3]) -> Style {
    Style {
        moves,
        sway,
        damping,
    }
}

/// All styles found by a thirteen-minute search. The agile presets were tuned on eleven others.
pub const STYLES: [Style; 10] = [
    style(
        [
            [2.9, -6.0, 0.65],
            [3.2, -2.1, 0.5],
            [3.5, -2.0, 0.8],
            [1.9, -6.2, 0.1],
        ],
        0.05,
        [9.3, 3.95, 9.4],
    ),
    style(
        [
            [1.95, -3.3, 0.85],
            [3.5, -0.8, -0.5],
            [2.8, -4.2, 0.65],
            [2.9, -2.0, 0.6],
        ],
        0.05,
        [6.0, 3.15, 8.35],
    ),
    style(
        [
            [3.4, 0.0, 0.8],
            [2.6, -4.8, -0.5],
            [2.85, -4.1, 0.8],
            [2.6, -9.6, 0.8],
        ],
        0.05,
        [6.65, 8.0, 10.85],
    ),
    style(
        [
            [3.5, -3.15, 0.65],
            [2.85, -6.0, -0.5],
            [2.65, -4.75, 0.35],
            [1.9, -7.65, 0.25],
        ],
        0.05,
        [7.55, 7.35, 8.0],
    ),
    style(
        [
            [2.8, -5.2, 0.8],
            [3.5, -0.75, 0.5],
            [3.5, -2.0, 0.25],
            [1.75, -8.15, 0.5],
        ],
        0.0,
        [9.4, 8.0, 8.1],
    ),
    style(
        [
            [3.5, 0.0, 0.85],
            [3.0, -0.4, -0.5],
            [2.15, -9.1, 0.5],
            [2.0, -6.6, 0.45],
        ],
        0.0,
        [10.85, 8.0, 11.75],
    ),
    style(
        [
            [2.6, -4.55, 0.9],
            [3.5, -4.25, -0.5],
            [3.0, -9.15, 0.1],
            [2.0, -6.5, 0.75],
        ],
        0.05,
        [10.25, 8.0, 13.8],
    ),
    style(
        [
            [3.5, -6.0, 0.9],
            [3.05, -1.65, -0.5],
            [3.5, -10.0, 0.1],
            [2.2, -8.25, 0.6],
        ],
        0.0,
        [6.2, 3.45, 17.75],
    ),
    style(
        [
            [3.0, -6.0, 0.65],
            [3.2, -4.85, -0.45],
            [2.2, -7.05, 0.55],
            [2.5, -2.0, 0.55],
        ],
        0.0,
        [8.35, 8.0, 9.95],
    ),
    style(
        [
            [3.25, -6.0, 0.9],
            [2.8, -1.85, -0.5],
            [3.4, -2.05, 0.1],
            [1.95, -8.8, 0.15],
        ],
        0.05,
        [11.9, 7.7, 11.1],
    ),
];

/// Index of a style's move for each transition.
const fn move_for(transition: Transition) -> usize {
    match transition {
        Transition::BackFlip | Transition::FrontLoop => 0,
        Transition::Layout | Transition::FrontFlip => 1,
        Transition::RollToBelly | Transition::FailedLayout => 2,
        Transition::RollToBack => 3,
    }
}

/// Interval between transitions, and the longest time for which one is attempted (s).
const EVERY: f64 = 3.0;
const TRIED: f64 = 2.6;

impl Style {
    /// The script: 45 s, starting belly to earth.
    pub fn flight(&self) -> Flight {
        let pulses = (0u32..).zip(ORDER).map(|(number, transition)| {
            let which = move_for(transition);
            let [muscle, damping, amount] = self.moves[which];
            let begin = 2.0 + EVERY * f64::from(number);
            let rolls = which >= 2;
            let about = |value: f64| if rolls { [0.0, value] } else { [value, 0.0] };
            let ([pitch, roll], [pitch_damping, roll_damping]) = (about(muscle), about(damping));
            Pulse {
                during: [begin, begin + TRIED],
                muscle: [pitch, 0.0, roll],
                damping: [pitch_damping, 0.0, roll_damping],
                joints: Some((if rolls { DRAW_IN_LEFT } else { PRESS }, amount)),
                until_over: true,
            }
        });
        Flight {
            name: "transitions",
            damping: self.damping,
            sway: self.sway,
            on_back: TO_BACK,
            pulses: Cow::Owned(pulses.collect()),
            ..FLIPS_AND_ROLLS
        }
    }
}
