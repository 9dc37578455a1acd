//! What the inertial sensor and the barometer of a logger add to a jump.

use bodyflight_core::air::{GRAVITY, standard_density};
use bodyflight_falls::fall::Jump;
use bodyflight_falls::median;
use nalgebra::Vector3;
use serde::Serialize;

use bodyflight_tracks::Track;

/// Data of the logger's other sensors.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Sensors {
    /// Largest specific force during the opening (multiples of gravity).
    pub largest_g: Option<f64>,
    /// Median of the specific force in the steady fall (multiples of gravity): 1 if it is steady.
    pub fall_g: Option<f64>,
    /// Area times drag coefficient in the steady fall (m2), from the specific force and the receiver's speed.
    pub drag_area_m2: Option<f64>,
    /// Direction of the upward force in the steady fall, axes of the logger: the attitude in which it was worn.
    pub up_in_logger: Option<[f64; 3]>,
    /// Median and largest specific force under canopy (multiples of gravity).
    pub canopy_g: Option<[f64; 2]>,
    /// Pressure on the ground after landing (Pa).
    pub ground_pressure_pa: Option<f64>,
}

/// Time after the exit in which the fall still accelerates (s).
const GATHERS: f64 = 10.0;

/// Fewest samples of a mean.
const FEWEST: usize = 20;

/// Summarises the inertial sensor and the barometer; `mass` is that of the jumper (kg).
pub(super) fn sensors(track: &Track, jump: &Jump, mass: f64) -> Sensors {
    let within = |from: f64, to: f64| {
        let inertial = track.inertial.iter();
        inertial.filter(move |(time, _)| (from..=to).contains(time))
    };
    let forces = |from: f64, to: f64| {
        within(from, to).map(|(_, sample)| sample.specific_force.norm() / GRAVITY)
    };
    let [begin, end] = jump.times.fall;
    let steady = if jump.times.exit.is_some() {
        begin + GATHERS
    } else {
        begin
    };
    let areas = within(steady, end).filter_map(|(time, sample)| {
        let here = jump.sample_at(*time)?;
        let pressure = 0.5 * standard_density(here.height()) * here.velocity.norm_squared();
        (pressure > 1.0).then_some(mass * sample.specific_force.norm() / pressure)
    });
    let mean: Vector3<f64> = within(steady, end)
        .map(|(_, sample)| sample.specific_force)
        .sum();
    let has_enough = within(steady, end).count() >= FEWEST;
    let opening = jump.times.opening.zip(jump.times.canopy);
    let landing = jump
        .times
        .landing
        .map_or(f64::INFINITY, |landing| landing.time - 1.0);
    Sensors {
        largest_g: opening
            .and_then(|(from, to)| forces(from.time - 0.5, to.time + 1.0).max_by(f64::total_cmp)),
        fall_g: median(forces(steady, end)),
        drag_area_m2: median(areas).filter(|_| has_enough),
        up_in_logger: (mean.try_normalize(1e-6).filter(|_| has_enough)).map(Into::into),
        canopy_g: jump.times.canopy.and_then(|open| {
            let flown = || forces(open.time + 1.0, landing);
            Some([median(flown())?, flown().max_by(f64::total_cmp)?])
        }),
        ground_pressure_pa: ground_pressure(track),
    }
}

/// Time at the end of a track during which the logger must be at rest (s), and the largest speed that counts as rest
/// (m/s).
const AT_REST: f64 = 10.0;
const STILL: f64 = 2.0;

/// Barometric pressure at the end of a track that ends on the ground (Pa).
pub(super) fn ground_pressure(track: &Track) -> Option<f64> {
    let last = track.samples.last()?.time;
    let end = |time: f64| time >= last - AT_REST && time <= last;
    let mut moving = track.samples.iter().filter(|sample| end(sample.time));
    if moving.any(|sample| sample.velocity.norm() > STILL) {
        return None;
    }
    let pressures = track.pressure.iter().filter(|(time, _)| end(*time));
    median(pressures.map(|(_, pressure)| *pressure))
        .filter(|pressure| (50_000.0..110_000.0).contains(pressure))
}
