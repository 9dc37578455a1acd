//! Fall speed in each pose according to both load models, and whether the pose is stable.

use core::f64::consts::{FRAC_PI_2, PI};
use std::fmt::Write as _;

use bodyflight_core::aerodynamics::Flow;
use bodyflight_core::aerodynamics::load_model::LoadModel;
use bodyflight_core::body::anthropometry::{Person, Sex};
use bodyflight_core::body::gear::Gear;
use bodyflight_core::body::pattern::{self, JointAngles};
use bodyflight_core::dynamics::steady::steady;
use bodyflight_core::dynamics::{Dynamics, Inputs};
use bodyflight_core::{AxisCoefficients, Body};
use nalgebra::Vector3;
use serde::Serialize;

use super::stability::{Mode, modes};
use bodyflight_io::diagnostic::{Problem, Result};

/// A pose, and what has been published about it.
#[derive(Debug, Clone, Copy)]
pub struct Pose {
    /// Name.
    pub name: &'static str,
    /// Joint angles.
    pub angles: &'static JointAngles,
    /// Rotation of the body about its left axis in which it is held (rad): pi/2 is belly to earth.
    pub pitch: f64,
    /// Range of published speeds (m/s).
    pub published: [f64; 2],
}

/// The poses, slow ones first. Standing has the arms at the sides, the fastest pose that is flown upright.
pub const POSES: [Pose; 5] = [
    Pose {
        name: "belly",
        angles: pattern::NEUTRAL,
        pitch: FRAC_PI_2,
        published: [50.0, 55.0],
    },
    Pose {
        name: "back",
        angles: pattern::BACK,
        pitch: -FRAC_PI_2,
        published: [50.0, 55.0],
    },
    Pose {
        name: "sit",
        angles: pattern::SIT,
        pitch: 0.0,
        published: [65.0, 70.0],
    },
    Pose {
        name: "stand",
        angles: &[],
        pitch: 0.0,
        published: [65.0, 100.0],
    },
    Pose {
        name: "head-down",
        angles: pattern::HEAD_DOWN,
        pitch: PI,
        published: [70.0, 85.0],
    },
];

/// The tracking pose. It glides, so its speed straight down is meaningless.
const TRACK: Pose = Pose {
    name: "track",
    angles: pattern::TRACK,
    pitch: FRAC_PI_2,
    published: [0.0, 0.0],
};

/// Air density used for the table (kg/m3), as at 3 km.
pub const DENSITY: f64 = 0.9;

/// Damping with which the table's modes are computed, that of a firmly held body: [pitch, yaw, roll].
pub const FIRM: AxisCoefficients<f64> = AxisCoefficients::new(6.0, 3.0, 12.0);

/// The person of the table: 1.80 m, 80 kg and a rig of 10 kg.
///
/// # Errors
/// Never returns an error, since the measures are constants.
pub fn person() -> Result<Body<f64>> {
    let not_a_person = |error: String| Problem::internal(error);
    let person = Person::new(1.80, 80.0, Sex::Male)
        .body()
        .map_err(|error| not_a_person(error.to_string()))?;
    let gear = Gear {
        rig: 10.0,
        ..Gear::default()
    };
    gear.fit(&person)
        .map_err(|error| not_a_person(error.to_string()))
}

/// One pose in one model.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Fall {
    /// Speed straight down with the pose and its attitude held (m/s).
    pub speed_mps: f64,
    /// Attitude in which the pose is in equilibrium without muscle input (deg), if there is one within 69 deg.
    pub balance_pitch_deg: Option<f64>,
    /// Glide ratio in that attitude: horizontal over vertical speed.
    pub balance_glide: Option<f64>,
    /// Modes about that equilibrium, the fastest growing first.
    pub modes: Vec<Mode>,
}

/// The model for a pose.
pub fn dynamics(body: Body<f64>, model: LoadModel) -> Dynamics<f64> {
    let mut dynamics = Dynamics::paper(body, DENSITY);
    dynamics.aerodynamics.model = model;
    dynamics
}

/// Computes how a pose falls.
pub fn fall(dynamics: &Dynamics<f64>, pose: &Pose) -> Fall {
    let posture = pattern::posture(pose.angles);
    let sample = dynamics.hold(&posture);
    let (sine, cosine) = pose.pitch.sin_cos();
    let flow = Flow {
        direction: Vector3::new(0.0, -sine, -cosine),
        dynamic_pressure: 1.0,
    };
    let drag = -sample
        .aerodynamics
        .total_load(&flow)
        .force
        .dot(&flow.direction);
    let weight = dynamics.body.mass() * dynamics.gravity;
    let inputs = Inputs {
        damping: FIRM,
        ..Inputs::belly_turn()
    };
    let balance = steady(dynamics, &posture, &inputs, pose.pitch, DENSITY);
    Fall {
        speed_mps: (2.0 * weight / (DENSITY * drag)).sqrt(),
        balance_pitch_deg: balance.map(|balance| balance.body_pitch.to_degrees()),
        balance_glide: balance.map(|balance| balance.glide),
        modes: balance.map_or_else(Vec::new, |balance| {
            modes(dynamics, &sample, &inputs, &balance.motion)
        }),
    }
}

/// The best glide of the tracking pose at angles of 20 to 80 deg to the airflow: horizontal over vertical speed, and
/// the vertical speed (m/s).
pub fn best_glide(dynamics: &Dynamics<f64>) -> (f64, f64) {
    let sample = dynamics.hold(&pattern::posture(pattern::TRACK));
    let weight = dynamics.body.mass() * dynamics.gravity;
    (20..=80)
        .map(|degrees| {
            let (sine, cosine) = f64::from(degrees).to_radians().sin_cos();
            let flow = Flow {
                direction: Vector3::new(0.0, -sine, cosine),
                dynamic_pressure: 1.0,
            };
            let force = sample.aerodynamics.total_load(&flow).force;
            let drag = -force.dot(&flow.direction);
            let lift = (force + flow.direction * drag).norm();
            let speed = (2.0 * weight / (DENSITY * force.norm())).sqrt();
            (lift / drag, speed * drag / force.norm())
        })
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .unwrap_or_default()
}

/// The table of all modes in docs/poses.md.
///
/// # Errors
/// Same as [`person`].
pub fn modes_table() -> Result<String> {
    let body = person()?;
    let mut text =
        String::from("| pose | model | balance (deg) | modes (1/s) |\n|---|---|---|---|\n");
    for pose in POSES.iter().chain([&TRACK]) {
        for model in [LoadModel::Paper, LoadModel::FreeFly] {
            let fall = fall(&dynamics(body, model), pose);
            let modes = fall.modes.iter().map(|mode| {
                if mode.frequency_radps > 0.0 {
                    format!("{:+.2} +- {:.1}i", mode.growth_per_s, mode.frequency_radps)
                } else {
                    format!("{:+.2}", mode.growth_per_s)
                }
            });
            let modes = modes.collect::<Vec<_>>().join(", ");
            let balance = fall
                .balance_pitch_deg
                .map_or_else(|| "none".to_owned(), |pitch| format!("{pitch:.0}"));
            let _ = writeln!(
                text,
                "| {} | {} | {balance} | {modes} |",
                pose.name,
                model.name()
            );
        }
    }
    Ok(text)
}

/// The table in docs/poses.md.
///
/// # Errors
/// Same as [`person`].
pub fn table() -> Result<String> {
    let body = person()?;
    let models = [LoadModel::Paper, LoadModel::FreeFly].map(|model| dynamics(body, model));
    let mut text = String::from(
        "| pose | published (m/s) | paper (m/s) | free-fly (m/s) | fastest growth, paper (1/s) | fastest growth, free-fly (1/s) |\n\
         |---|---|---|---|---|---|\n",
    );
    for pose in &POSES {
        let [paper, free] = [&models[0], &models[1]].map(|dynamics| fall(dynamics, pose));
        let [low, high] = pose.published;
        let growth = |fall: &Fall| {
            let first = fall.modes.first();
            first.map_or_else(
                || "no balance".to_owned(),
                |mode| format!("{:+.1}", mode.growth_per_s),
            )
        };
        let _ = writeln!(
            text,
            "| {} | {low:.0} to {high:.0} | {:.1} | {:.1} | {} | {} |",
            pose.name,
            paper.speed_mps,
            free.speed_mps,
            growth(&paper),
            growth(&free),
        );
    }
    let [paper, free] = [&models[0], &models[1]].map(|dynamics| best_glide(dynamics).0);
    let _ = writeln!(
        text,
        "| tracking, best glide ratio | 0.7 to 1.2 | {paper:.2} | {free:.2} | | |"
    );
    Ok(text)
}
