//! In which regime model and measurement disagree: slow or fast, high or low, turning, leaning, moving; and what the
//! missing force and moment go with.

use bodyflight_core::Segment;
use bodyflight_core::dynamics::Motion;
use serde::Serialize;

use super::gap::Spot;
use super::momentum::Missing;
use super::statistics::{correlation, quantile_of_sorted};
use super::track::Track;

/// Mean square of all channels over their floors in thirds of the flight, by one of its variables.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Regime {
    /// The variable, with its unit.
    pub by: &'static str,
    /// Bounds between the thirds.
    pub bounds: [f64; 2],
    /// Root mean square over the floor in the low, middle and high third, of the plain model.
    pub over_floor: [f64; 3],
    /// The same with the effects named.
    pub over_floor_after: [f64; 3],
}

/// How a missing force or moment goes with a variable of the flight.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Companion {
    /// The missing thing, with its unit.
    pub missing: &'static str,
    /// The variable, with its unit.
    pub variable: &'static str,
    /// Correlation over the windows.
    pub correlation: f64,
}

/// Variables of a flight at one moment.
const VARIABLES: [&str; 9] = [
    "time_s",
    "height_m",
    "speed_m_s",
    "turn_left_rad_s",
    "turn_dorsal_rad_s",
    "turn_cranial_rad_s",
    "stream_left",
    "stream_cranial",
    "posture_rad",
];

const MISSING: [&str; 6] = [
    "force_north_n",
    "force_west_n",
    "force_up_n",
    "moment_left_nm",
    "moment_dorsal_nm",
    "moment_cranial_nm",
];

/// Companions that are told, and the correlation from which on.
const MOST: usize = 5;
const STRONG: f64 = 0.4;

fn variables(track: &Track, frame: usize) -> [f64; VARIABLES.len()] {
    let motion: &Motion<f64> = &track.measured[frame];
    let through_air = motion.velocity.components;
    let speed = through_air.norm();
    let spin = motion.angular_velocity.components;
    let joints = Segment::ALL.iter().skip(1).map(|&segment| {
        let first = track.postures[0].parent_from_segment(segment);
        let now = track.postures[frame].parent_from_segment(segment);
        first.angle_to(now).powi(2)
    });
    [
        track.times[frame],
        motion.position.components.z,
        speed,
        spin.x,
        spin.y,
        spin.z,
        through_air.x / speed.max(1.0),
        through_air.z / speed.max(1.0),
        (joints.sum::<f64>() / (Segment::ALL.len() - 1) as f64).sqrt(),
    ]
}

/// Thirds of the flight by each variable.
pub fn regimes(track: &Track, map: &[Spot]) -> Vec<Regime> {
    let frame = |time: f64| {
        let middle = track.times.partition_point(|t| *t < time + 0.3);
        middle.min(track.times.len().saturating_sub(1))
    };
    let of: Vec<_> = map
        .iter()
        .map(|spot| variables(track, frame(spot.time_s)))
        .collect();
    let by = |(index, &by): (usize, &'static &'static str)| {
        let mut sorted: Vec<f64> = of.iter().map(|variables| variables[index]).collect();
        sorted.sort_by(f64::total_cmp);
        let bounds = [1.0, 2.0].map(|third| quantile_of_sorted(&sorted, third / 3.0));
        let mean = |third: usize, value: &dyn Fn(&Spot) -> f64| {
            let own = map.iter().zip(&of).filter(|(_, variables)| {
                bounds
                    .iter()
                    .filter(|bound| variables[index] >= **bound)
                    .count()
                    == third
            });
            let (sum, count) = own.fold((0.0, 0.0), |(s, n), (spot, _)| (s + value(spot), n + 1.0));
            if count > 0.0 {
                (sum / count).sqrt()
            } else {
                0.0
            }
        };
        let square =
            |values: &[f64]| values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64;
        Regime {
            by,
            bounds,
            over_floor: [0, 1, 2].map(|third| mean(third, &|spot| square(&spot.over_floor))),
            over_floor_after: [0, 1, 2]
                .map(|third| mean(third, &|spot| square(&spot.over_floor_after))),
        }
    };
    if map.len() < 3 {
        return Vec::new();
    }
    VARIABLES.iter().enumerate().map(by).collect()
}

/// What the missing forces and moments go with most: the signature of what is not in the library.
pub fn companions(track: &Track, missing: &[Missing]) -> Vec<Companion> {
    let frame = |time: f64| {
        let frame = track.times.partition_point(|t| *t < time);
        frame.min(track.times.len().saturating_sub(1))
    };
    let of: Vec<_> = missing
        .iter()
        .map(|m| variables(track, frame(m.time_s)))
        .collect();
    let mut all = Vec::new();
    for (k, name) in MISSING.iter().enumerate() {
        let values: Vec<f64> = missing
            .iter()
            .map(|m| {
                if k < 3 {
                    m.force_n[k]
                } else {
                    m.moment_nm[k - 3]
                }
            })
            .collect();
        for (index, variable) in VARIABLES.iter().enumerate() {
            let with: Vec<f64> = of.iter().map(|variables| variables[index]).collect();
            let correlation = correlation(&values, &with);
            if correlation.abs() >= STRONG {
                all.push(Companion {
                    missing: name,
                    variable,
                    correlation,
                });
            }
        }
    }
    all.sort_by(|a, b| b.correlation.abs().total_cmp(&a.correlation.abs()));
    all.truncate(MOST);
    all
}
