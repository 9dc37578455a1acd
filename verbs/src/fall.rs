//! `bodyflight fall`: analyses the jumps on a logger's track, in a skydiver's terms.

mod accuracy;
pub mod answer;
pub mod beside;
mod conditions;
pub mod figure;
pub mod logbook;
pub mod page;
pub mod sensors;
pub mod units;

use std::path::Path;

use bodyflight_falls::atmosphere::Atmosphere;
use bodyflight_falls::boundary::Boundary;
use bodyflight_falls::channels::{Checked, Finding, checked};
use bodyflight_falls::fall::{Jump, Opening, Settings, analysed};
use bodyflight_falls::prediction::Prediction;
use bodyflight_falls::verdict::Verdict;
use bodyflight_falls::wind::Wind;
use serde::Serialize;

use beside::Beside;
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_tracks::{self as track, Track, folder};
pub use conditions::{Conditions, DEFAULT_MASS, Stated};
use sensors::{Sensors, ground_pressure, sensors};

/// Thickness of the layers in which the wind is given (m).
const LAYER: f64 = 500.0;

/// A moment of the jump.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Moment {
    /// Time from the start of the track (s).
    pub time_s: f64,
    /// Standard deviation of the time (s).
    pub deviation_s: f64,
    /// Time since 1970 (s, UTC), if the file has a date.
    pub unix_s: Option<f64>,
    /// Height above mean sea level (m).
    pub height_m: f64,
}

/// A piece of the fall with one posture.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct PieceRow {
    /// Beginning, from the start of the fall (s).
    pub from_s: f64,
    /// End, from the start of the fall (s).
    pub until_s: f64,
    /// Area times drag coefficient (m2).
    pub drag_area_m2: f64,
    /// Standard deviation (m2).
    pub deviation_m2: f64,
    /// Area times lift coefficient (m2); 0 if the fall does not glide.
    pub lift_area_m2: f64,
    /// Glide ratio through the air: horizontal over vertical speed.
    pub glide: f64,
}

/// The wind at a height.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct WindRow {
    /// Height above mean sea level (m).
    pub height_m: f64,
    /// Speed (m/s).
    pub speed_mps: f64,
    /// Direction from which it blows (rad, from north towards east).
    pub from_rad: f64,
    /// Standard deviation of each component (m/s).
    pub deviation_mps: f64,
}

impl WindRow {
    /// `None` if the standard deviation is larger than the wind: then it is not determined.
    fn of(wind: &Wind) -> Option<Self> {
        let [north, west] = [wind.velocity.x, wind.velocity.y];
        let row = Self {
            height_m: wind.height,
            speed_mps: wind.velocity.norm(),
            from_rad: west.atan2(-north).rem_euclid(core::f64::consts::TAU),
            deviation_mps: (0.5 * wind.deviation.norm_squared()).sqrt(),
        };
        (row.deviation_mps < row.speed_mps).then_some(row)
    }
}

/// A jump in numbers.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Report {
    /// Whether the fall is explained.
    pub verdict: Verdict,
    /// Why, in a sentence.
    pub reason: String,
    /// Rows that are far from their neighbours and were not used.
    pub rows_taken_out: usize,
    /// Rows that could not be read.
    pub rows_skipped: usize,
    /// Whether the velocities were measured, rather than derived from positions.
    pub has_velocities: bool,
    /// Exit from the aircraft.
    pub exit: Option<Moment>,
    /// Beginning of the opening.
    pub opening: Option<Moment>,
    /// Canopy fully open.
    pub canopy: Option<Moment>,
    /// Landing.
    pub landing: Option<Moment>,
    /// From exit to opening (s).
    pub fall_s: f64,
    /// Mean speed downwards from exit to opening (m/s).
    pub mean_rate_mps: f64,
    /// Distance over ground between exit and opening (m); 0 if the track has no positions.
    pub fall_distance_m: f64,
    /// Distance over ground between the opening and the landing, or the end of the track (m).
    pub canopy_distance_m: Option<f64>,
    /// Time under canopy (s).
    pub canopy_s: Option<f64>,
    /// Largest speed downwards (m/s).
    pub fastest_mps: f64,
    /// Speed downwards in the steady part, at the reference height of the standard atmosphere (m/s).
    pub normalised_rate_mps: f64,
    /// The reference height (m).
    pub reference_height_m: f64,
    /// Mass used for the areas (kg).
    pub mass_kg: f64,
    /// Area times drag coefficient in the steady part (m2); null, like the two that follow, if no second of the fall can
    /// be used.
    pub drag_area_m2: Option<f64>,
    /// Standard deviation of `drag_area_m2` from second to second (m2).
    pub drag_area_spread_m2: Option<f64>,
    /// Mass divided by area times drag coefficient (kg/m2); does not depend on the given mass.
    pub ballistic_kgpm2: Option<f64>,
    /// Glide ratio through the air in the second half of the fall.
    pub glide: Option<f64>,
    /// Glide ratio over ground under canopy.
    pub canopy_glide: Option<f64>,
    /// Pieces of one posture.
    pub pieces: Vec<PieceRow>,
    /// Wind during the fall, where it is determined: a fall that glides drifts as the jumper likes.
    pub wind: Vec<WindRow>,
    /// Wind from circles under canopy, where it is determined.
    pub canopy_wind: Vec<WindRow>,
    /// Difference between the wind of the highest circle and that at the end of the fall (standard deviations).
    pub winds_apart: Option<f64>,
    /// Details of the opening.
    pub opening_details: Option<Opening>,
    /// Data of other sensors.
    pub sensors: Sensors,
    /// The last third, predicted from the first two.
    pub prediction: Option<Prediction>,
    /// Comparison with another jumper from the same load.
    pub beside: Option<Beside>,
}

impl Report {
    /// Drag area (m2), its standard deviation (m2) and mass per drag area (kg/m2) of the steady part, if known and there is
    /// any.
    pub fn steady_drag(&self) -> Option<[f64; 3]> {
        Some([
            self.drag_area_m2?,
            self.drag_area_spread_m2?,
            self.ballistic_kgpm2?,
        ])
    }
}

/// The jumps of a track.
#[derive(Debug, Clone)]
pub struct Falls {
    /// Report and analysis of each: first the one that the track is about, the longest certain fall, then the others in
    /// order of time.
    pub jumps: Vec<(Report, Jump)>,
    /// Channels that contradict each other.
    pub channels: Vec<Finding>,
}

/// Whether a path is that of a logger's track, or of a folder that is no flight and so may hold tracks.
pub fn is_of_logger(path: &Path) -> bool {
    if path.is_dir() {
        !path.join("flight.toml").exists()
    } else {
        folder::is_track(path)
    }
}

/// Analyses the jumps on a track.
///
/// # Errors
/// Returns an error if there is no fall on the track.
pub fn falls(track: &Track, conditions: &Conditions, path: &Path) -> Result<Falls> {
    let Checked {
        samples,
        findings,
        motion,
    } = checked(&track.samples, track.given);
    let track = &Track {
        samples,
        ..track.clone()
    };
    let settings = Settings {
        atmosphere: atmosphere(track, conditions),
        reference_height: conditions.reference_height,
        motion,
    };
    let mut jumps: Vec<(Report, Jump)> = analysed(&track.samples, &settings)
        .into_iter()
        .map(|jump| {
            let mut report = report(track, conditions, &jump);
            if let Some(why) = accuracy::coarse(track, jump.times.fall) {
                (report.verdict, report.reason) = (Verdict::Uncertain, why);
            }
            (report, jump)
        })
        .collect();
    let rank = |(report, _): &(Report, Jump)| {
        let certain = match report.verdict {
            Verdict::Uncertain => 0.0,
            Verdict::Unexplained => 1e6,
            Verdict::Thin | Verdict::Explained => 2e6,
        };
        certain + report.fall_s
    };
    let main = (0..jumps.len())
        .max_by(|a, b| rank(&jumps[*a]).total_cmp(&rank(&jumps[*b])).then(b.cmp(a)));
    let Some(main) = main else {
        return Err(no_fall(track, &findings).in_file(path));
    };
    jumps[..=main].rotate_right(1);
    Ok(Falls {
        jumps,
        channels: findings,
    })
}

fn no_fall(track: &Track, findings: &[Finding]) -> Problem {
    let down = track.samples.iter().map(|sample| -sample.velocity.z);
    let fastest = down.fold(0.0, f64::max);
    let said: Vec<&str> = findings
        .iter()
        .map(|finding| finding.sentence.as_str())
        .collect();
    Problem::bad_input(format!(
        "no free fall on this track: {} rows, {fastest:.0} m/s downwards at most{}{}",
        track.samples.len(),
        if said.is_empty() { "" } else { "; " },
        said.join("; ")
    ))
    .help("give the track of a jump; one on the ground, in an aircraft or under canopy has no fall")
}

/// Analyses the jump that a track is about, as in [`falls`].
///
/// # Errors
/// Returns an error if there is no fall on the track.
pub fn fall(track: &Track, conditions: &Conditions, path: &Path) -> Result<(Report, Jump)> {
    let first = falls(track, conditions, path)?.jumps.into_iter().next();
    first.ok_or_else(|| no_fall(track, &[]).in_file(path))
}

/// Reads the track of another jumper from the same load, and compares that fall with `own`.
///
/// # Errors
/// Returns an error if the track cannot be read or has no fall.
pub fn beside(path: &Path, conditions: &Conditions, own: &Jump) -> Result<Beside> {
    let (report, other) = fall(&track::read(path)?, conditions, path)?;
    let apart = own.wind.apart(&other.wind, LAYER);
    Ok(Beside {
        normalised_rate_mps: report.normalised_rate_mps,
        winds_apart: apart.map(|(deviations, _)| deviations),
        heights: apart.map_or(0, |(_, heights)| heights),
    })
}

/// The atmosphere according to what is known about the ground.
fn atmosphere(track: &Track, conditions: &Conditions) -> Atmosphere {
    let pressure = conditions
        .ground_pressure
        .or_else(|| ground_pressure(track));
    let Some(last) = track.samples.last() else {
        return Atmosphere::Standard;
    };
    let height = last.height();
    let standard_temperature = 288.15 - 0.0065 * height;
    let temperature = conditions
        .ground_temperature
        .unwrap_or(standard_temperature);
    match pressure {
        Some(pressure) => Atmosphere::Ground {
            pressure,
            temperature,
            height,
        },
        None if conditions.ground_temperature.is_some() => {
            // From the standard atmosphere's density and temperature, by the gas law.
            let pressure = 287.053 * standard_temperature * Atmosphere::Standard.density(height);
            Atmosphere::Ground {
                pressure,
                temperature,
                height,
            }
        }
        None => Atmosphere::Standard,
    }
}

fn report(track: &Track, conditions: &Conditions, jump: &Jump) -> Report {
    let first = track.samples.first().map_or(0.0, |first| first.time);
    let moment = |boundary: Boundary| Moment {
        time_s: boundary.time - first,
        deviation_s: boundary.deviation,
        unix_s: track.start.map(|start| start + boundary.time - first),
        height_m: jump.height_at(boundary.time),
    };
    let until = jump.times.landing.map(|landing| landing.time);
    let until = until.or(jump.samples.last().map(|sample| sample.time));
    let under_canopy = jump
        .times
        .opening
        .zip(until)
        .map(|(opening, until)| [opening.time, until]);
    let mass = conditions.mass;
    let begin = jump.times.fall[0];
    let piece = |piece: &bodyflight_falls::drag::Piece| PieceRow {
        from_s: piece.time[0] - begin,
        until_s: piece.time[1] - begin,
        drag_area_m2: mass * piece.drag,
        deviation_m2: mass * piece.deviation,
        lift_area_m2: mass * piece.lift,
        glide: piece.glide,
    };
    let told = jump.wind.is_told();
    Report {
        verdict: jump.verdict,
        reason: jump.reason.clone(),
        rows_taken_out: jump.taken_out.count,
        rows_skipped: track.skipped,
        has_velocities: track.given.velocities,
        exit: jump.times.exit.map(moment),
        opening: jump.times.opening.map(moment),
        canopy: jump.times.canopy.map(moment),
        landing: jump.times.landing.map(moment),
        fall_s: jump.duration(),
        mean_rate_mps: (jump.height_at(jump.times.fall[0]) - jump.height_at(jump.times.fall[1]))
            / jump.duration().max(0.1),
        fall_distance_m: jump.way_over_ground(jump.times.fall),
        canopy_distance_m: under_canopy.map(|times| jump.way_over_ground(times)),
        canopy_s: under_canopy.map(|[from, to]| to - from),
        fastest_mps: jump.fastest,
        normalised_rate_mps: jump.normalised_rate,
        reference_height_m: conditions.reference_height,
        mass_kg: mass,
        drag_area_m2: jump.drag.map(|[drag, _]| mass * drag),
        drag_area_spread_m2: jump.drag.map(|[_, spread]| mass * spread),
        ballistic_kgpm2: (jump.drag.filter(|[drag, _]| *drag > 0.0)).map(|[drag, _]| 1.0 / drag),
        glide: jump.glide[0],
        canopy_glide: jump.glide[1],
        pieces: jump.pieces.iter().map(piece).collect(),
        wind: if told {
            jump.wind
                .layers(LAYER)
                .iter()
                .filter_map(WindRow::of)
                .collect()
        } else {
            Vec::new()
        },
        canopy_wind: jump
            .circles
            .iter()
            .filter_map(|circle| WindRow::of(&circle.wind))
            .collect(),
        winds_apart: jump.winds_apart().filter(|_| told),
        opening_details: jump.opening(),
        sensors: sensors(track, jump, mass),
        prediction: jump.prediction.clone(),
        beside: None,
    }
}
