//! The onset of pitch oscillation in belly flight: modes as a function of arm position and pitch damping, from the
//! paper's "Pitch and Roll oscillations experienced by novices".

use core::f64::consts::FRAC_PI_2;

use bodyflight_core::body::pattern;
use bodyflight_core::dynamics::steady::steady;
use bodyflight_core::dynamics::step::TIME_STEP;
use bodyflight_core::dynamics::{Dynamics, Inputs, State};
use bodyflight_core::math::small_rotation;
use bodyflight_core::{Posture, frame::Rotation};
use nalgebra::Vector3;
use plotters::style::RGBColor;
use serde::Serialize;

use super::stability::modes;
use crate::output::plot::{Curve, Line, Panel, figure_svg_over};
use bodyflight_io::diagnostic::Result;

/// Density of the air (kg/m3).
const DENSITY: f64 = 1.0;
/// Lowest frequency that counts as an oscillation (rad/s): slower modes are changes of the glide path.
const SLOWEST: f64 = 1.5;

/// Pitch damping coefficients to examine, with their lines.
pub const DAMPINGS: [(f64, Line); 6] = [
    (0.0, line("damping 0", 0x9c, 0x2f, 0x00)),
    (0.5, line("damping 0.5", 0xd9, 0x7b, 0x29)),
    (1.0, line("damping 1", 0xb8, 0xa0, 0x2a)),
    (1.5, line("damping 1.5", 0x1b, 0x6e, 0x53)),
    (2.0, line("damping 2", 0x2c, 0x6f, 0xbb)),
    (3.0, line("damping 3 (belly turns)", 0x55, 0x3b, 0x8f)),
];

const fn line(label: &'static str, red: u8, green: u8, blue: u8) -> Line {
    Line {
        label,
        colour: RGBColor(red, green, blue),
        width: 2,
    }
}

/// The oscillation in pitch of one posture.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Point {
    /// Arms below (positive) or above the neutral posture (rad).
    pub arms_down_rad: f64,
    /// Coefficient of the pitch damping.
    pub damping: f64,
    /// Rate of growth (1/s).
    pub growth_per_s: f64,
    /// Angular frequency (rad/s).
    pub frequency_radps: f64,
}

/// The neutral posture with the arms lowered by `angle` (rad).
pub fn posture(angle: f64) -> Posture<f64> {
    lowered(&pattern::neutral(), angle)
}

fn lowered(base: &Posture<f64>, angle: f64) -> Posture<f64> {
    pattern::moved(base, pattern::ARMS_DOWN, angle)
}

fn inputs(damping: f64) -> Inputs<f64> {
    let mut inputs = Inputs::belly_turn();
    inputs.damping.pitch = damping;
    inputs
}

/// The oscillation from eigenvalues; `None` if the posture has no equilibrium near belly flight or does not oscillate.
pub fn oscillation(dynamics: &Dynamics<f64>, arms_down_rad: f64, damping: f64) -> Option<Point> {
    oscillation_of(dynamics, &posture(arms_down_rad), arms_down_rad, damping)
}

fn oscillation_of(
    dynamics: &Dynamics<f64>,
    posture: &Posture<f64>,
    arms_down_rad: f64,
    damping: f64,
) -> Option<Point> {
    let inputs = inputs(damping);
    let balance = steady(dynamics, posture, &inputs, FRAC_PI_2, DENSITY)?;
    let found = modes(dynamics, &dynamics.hold(posture), &inputs, &balance.motion);
    let mode = found.iter().find(|mode| mode.frequency_radps > SLOWEST)?;
    Some(Point {
        arms_down_rad,
        damping,
        growth_per_s: mode.growth_per_s,
        frequency_radps: mode.frequency_radps,
    })
}

/// Pitch damping coefficient below which a posture oscillates, if arched by `arch` with the arms lowered by `arms`
/// (rad); `None` if there is none between 0 and 1. Growth decreases linearly with the damping.
pub fn threshold(dynamics: &Dynamics<f64>, arch: f64, arms: f64) -> Option<f64> {
    let posture = lowered(&pattern::arched(&pattern::neutral(), arch), arms);
    let growth = |damping| Some(oscillation_of(dynamics, &posture, arms, damping)?.growth_per_s);
    let (low, high) = (growth(0.0)?, growth(1.0)?);
    (low > 0.0 && high < 0.0).then(|| low / (low - high))
}

/// Arches for which the figure shows the threshold (rad of the paper's pattern), with their lines.
const ARCHES: [(f64, Line); 3] = [
    (0.2, line("arched by 0.2 rad", 0xaa, 0x33, 0x77)),
    (0.0, line("neutral posture", 0x22, 0x22, 0x22)),
    (-0.2, line("de-arched by 0.2 rad", 0x44, 0x99, 0x88)),
];

fn arms() -> impl Iterator<Item = f64> {
    (-8..=16).map(|k| 0.05 * f64::from(k))
}

/// The same growth, measured in a free run of `seconds` that starts rotated by `tilt` (rad) about the left axis: how
/// much the oscillation of the pitch rate grew from the first half to the second, per second.
pub fn growth_of_run(
    dynamics: &Dynamics<f64>,
    arms_down_rad: f64,
    damping: f64,
    tilt: f64,
    seconds: f64,
) -> Option<f64> {
    let (posture, inputs) = (posture(arms_down_rad), inputs(damping));
    let balance = steady(dynamics, &posture, &inputs, FRAC_PI_2, DENSITY)?;
    let sample = dynamics.hold(&posture);
    let mut motion = balance.motion;
    let velocity = motion.velocity_inertial();
    let turned =
        motion.inertial_from_body.quaternion() * small_rotation(&Vector3::new(tilt, 0.0, 0.0));
    motion.inertial_from_body = Rotation::from_quaternion(turned);
    motion.velocity = motion.inertial_from_body.inverse() * velocity;
    let mut state = State::from_motion(&motion, &sample);
    let mut halves = [0.0f64; 2];
    let mut time = 0.0;
    while time < seconds {
        state = dynamics.step(&state, &sample, &inputs, TIME_STEP);
        time += TIME_STEP;
        let rate = state.motion(&sample).angular_velocity.components.x;
        halves[usize::from(time > 0.5 * seconds)] += rate * rate;
    }
    Some((halves[1] / halves[0]).ln() / seconds)
}

/// All points of the figure: arms from 0.4 rad above the neutral posture to 0.8 below.
pub fn map(dynamics: &Dynamics<f64>) -> Vec<Point> {
    arms()
        .flat_map(|arms| DAMPINGS.map(|(damping, _)| oscillation(dynamics, arms, damping)))
        .flatten()
        .collect()
}

/// The damping below which belly flight oscillates, against the arms' angle.
fn threshold_panel(dynamics: &Dynamics<f64>) -> Panel {
    let curve = |(arch, line): (f64, Line)| Curve {
        line,
        points: arms()
            .filter_map(|arms| Some((arms, threshold(dynamics, arch, arms)?)))
            .collect(),
    };
    Panel {
        caption: "pitch damping below which it oscillates".to_owned(),
        curves: ARCHES.map(curve).into(),
        bands: Vec::new(),
        shades: Vec::new(),
        wraps: false,
    }
}

/// The figure against the arms' angle: the threshold of damping, and growth and frequency for several dampings.
///
/// # Errors
/// Returns an error if the figure cannot be drawn.
pub fn svg(dynamics: &Dynamics<f64>) -> Result<String> {
    let points = map(dynamics);
    let curves = |value: fn(&Point) -> f64| {
        DAMPINGS
            .iter()
            .map(|(damping, line)| Curve {
                line: *line,
                points: points
                    .iter()
                    .filter(|point| (point.damping - damping).abs() < 1e-9)
                    .map(|point| (point.arms_down_rad, value(point)))
                    .collect(),
            })
            .collect()
    };
    let panel = |caption: &str, value: fn(&Point) -> f64| Panel {
        caption: caption.to_owned(),
        curves: curves(value),
        bands: Vec::new(),
        shades: Vec::new(),
        wraps: false,
    };
    figure_svg_over(
        "rad",
        "Pitch oscillation of belly flight against the arms' angle below neutral",
        &[
            threshold_panel(dynamics),
            panel("growth (1/s): above 0 it grows", |point| point.growth_per_s),
            panel("frequency (rad/s)", |point| point.frequency_radps),
        ],
    )
}
