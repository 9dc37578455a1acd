//! A load described in a `model.toml`: the axis along which it acts, and the factors it is multiplied by.
//!
//! ```toml
//! [[effect]]
//! moment_nm = 25.0
//! along = "dorsal"
//! times = [{ factor = "sine", frequency_hz = 3.1, phase_rad = 0.4 }]
//! ```
//! Every quantity has its unit in its name. A factor is the ratio of a quantity to a reference in the same unit, so the
//! size is in N or N m whatever the factors.

use bodyflight_core::Segment;
use bodyflight_core::dynamics::applied_load::factor::{FACTORS, Factor};
use bodyflight_core::dynamics::applied_load::{AppliedLoad, Axis, Direction, Kind, Point};
use serde::Deserialize;

use bodyflight_io::diagnostic::{Problem, Result};

/// Keys for the size with their largest values; a load has exactly one.
const SIZES: [(&str, f64); 2] = [("force_n", 3000.0), ("moment_nm", 600.0)];

/// Names of body, world and segment axes.
const BODY: [&str; 3] = ["left", "dorsal", "cranial"];
const WORLD: [&str; 3] = ["north", "west", "up"];
const SEGMENT: [&str; 3] = ["x", "y", "z"];
const STREAM: &str = "stream";

/// An `[[effect]]` without a name.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct LoadTable {
    force_n: Option<f64>,
    moment_nm: Option<f64>,
    along: String,
    at: Option<String>,
    #[serde(default)]
    times: Vec<FactorTable>,
}

#[derive(Deserialize)]
#[serde(tag = "factor", rename_all = "kebab-case", deny_unknown_fields)]
enum FactorTable {
    Speed {
        reference_mps: f64,
    },
    SpeedSquared {
        reference_mps: f64,
    },
    Joint {
        segment: String,
        axis: String,
        #[serde(default)]
        from_rad: f64,
        reference_rad: f64,
    },
    Turn {
        axis: String,
        reference_radps: f64,
    },
    Height {
        from_m: f64,
        reference_m: f64,
    },
    Sine {
        frequency_hz: f64,
        #[serde(default)]
        phase_rad: f64,
    },
    Pulse {
        start_s: f64,
        duration_s: f64,
        #[serde(default)]
        period_s: f64,
    },
}

/// Whether a table with these keys is a load.
pub(super) fn is_load<'a>(mut keys: impl Iterator<Item = &'a String>) -> bool {
    keys.any(|key| SIZES.iter().any(|(size, _)| key == size))
}

fn within(name: &str, value: f64, low: f64, high: f64) -> Result<f64> {
    if (low..=high).contains(&value) {
        return Ok(value);
    }
    Err(Problem::bad_input(format!(
        "{name}: expected {low} to {high}, found {value}"
    )))
}

/// Checks a reference to divide by; it may be negative.
fn reference(name: &str, value: f64, least: f64, most: f64) -> Result<f64> {
    if (least..=most).contains(&value.abs()) {
        return Ok(value);
    }
    Err(Problem::bad_input(format!(
        "{name}: expected a reference of {least} to {most} in size, found {value}"
    )))
}

fn segment(name: &str) -> Result<Segment> {
    Segment::from_name(name)
        .ok_or_else(|| Problem::unknown("segment", name, Segment::ALL.map(Segment::name)))
}

fn axis(names: [&str; 3], name: &str) -> Option<Axis> {
    let named = names
        .iter()
        .zip(Axis::ALL)
        .find(|(known, _)| **known == name);
    named.map(|(_, axis)| axis)
}

fn known_axis(names: [&str; 3], name: &str) -> Result<Axis> {
    axis(names, name).ok_or_else(|| Problem::unknown("axis", name, names))
}

fn direction(name: &str) -> Result<Direction> {
    if name == STREAM {
        return Ok(Direction::Stream);
    }
    if let Some(axis) = axis(BODY, name) {
        return Ok(Direction::Body(axis));
    }
    if let Some(axis) = axis(WORLD, name) {
        return Ok(Direction::World(axis));
    }
    if let Some((of, along)) = name.split_once(' ') {
        return Ok(Direction::Segment(
            segment(of)?,
            known_axis(SEGMENT, along)?,
        ));
    }
    Err(
        Problem::bad_input(format!("along: unknown axis \"{name}\"")).help(format!(
            "one of: {}, {}, {STREAM}, or a segment and its axis as \"l_shank x\"",
            BODY.join(", "),
            WORLD.join(", ")
        )),
    )
}

impl LoadTable {
    pub(super) fn load(&self) -> Result<AppliedLoad<f64>> {
        let (kind, size) = match (self.force_n, self.moment_nm) {
            (Some(force), None) => {
                let point = match &self.at {
                    Some(name) => Point::Segment(segment(name)?),
                    None => Point::Body,
                };
                let [(name, most), _] = SIZES;
                (Kind::Force(point), within(name, force, -most, most)?)
            }
            (None, Some(moment)) => {
                if self.at.is_some() {
                    return Err(
                        Problem::bad_input("at: a moment has no point of application")
                            .help("remove `at`, or give force_n instead"),
                    );
                }
                let [_, (name, most)] = SIZES;
                (Kind::Moment, within(name, moment, -most, most)?)
            }
            _ => {
                return Err(Problem::bad_input("expected either force_n or moment_nm")
                    .help("write one [[effect]] for each"));
            }
        };
        if self.times.len() > FACTORS {
            return Err(Problem::bad_input(format!(
                "times: expected at most {FACTORS} factors, found {}",
                self.times.len()
            )));
        }
        let mut factors = [None; FACTORS];
        for (place, table) in factors.iter_mut().zip(&self.times) {
            *place = Some(table.factor()?);
        }
        Ok(AppliedLoad {
            kind,
            direction: direction(&self.along)?,
            size,
            factors,
        })
    }
}

impl FactorTable {
    fn factor(&self) -> Result<Factor<f64>> {
        Ok(match self {
            Self::Speed { reference_mps } => Factor::Speed {
                reference: within("reference_mps", *reference_mps, 0.1, 300.0)?,
            },
            Self::SpeedSquared { reference_mps } => Factor::SpeedSquared {
                reference: within("reference_mps", *reference_mps, 0.1, 300.0)?,
            },
            Self::Joint {
                segment: name,
                axis,
                from_rad,
                reference_rad,
            } => Factor::Joint {
                segment: segment(name)?,
                axis: known_axis(SEGMENT, axis)?,
                from: within("from_rad", *from_rad, -3.2, 3.2)?,
                reference: reference("reference_rad", *reference_rad, 0.001, 10.0)?,
            },
            Self::Turn {
                axis,
                reference_radps,
            } => Factor::Turn {
                axis: known_axis(BODY, axis)?,
                reference: reference("reference_radps", *reference_radps, 0.001, 100.0)?,
            },
            Self::Height {
                from_m,
                reference_m,
            } => Factor::Height {
                from: within("from_m", *from_m, -1000.0, 50_000.0)?,
                reference: reference("reference_m", *reference_m, 0.1, 50_000.0)?,
            },
            Self::Sine {
                frequency_hz,
                phase_rad,
            } => Factor::Sine {
                frequency: within("frequency_hz", *frequency_hz, 0.0, 30.0)?,
                phase: within("phase_rad", *phase_rad, -100.0, 100.0)?,
            },
            Self::Pulse {
                start_s,
                duration_s,
                period_s,
            } => Factor::Pulse {
                start: within("start_s", *start_s, -1000.0, 10_000.0)?,
                duration: within("duration_s", *duration_s, 0.0, 10_000.0)?,
                period: within("period_s", *period_s, 0.0, 10_000.0)?,
            },
        })
    }
}

/// The name of an axis in the file.
const fn name_of(names: [&'static str; 3], axis: Axis) -> &'static str {
    let [x, y, z] = names;
    match axis {
        Axis::X => x,
        Axis::Y => y,
        Axis::Z => z,
    }
}

/// A load as a table of a `model.toml`.
pub(super) fn text(load: &AppliedLoad<f64>) -> String {
    let mut text = "\n[[effect]]\n".to_owned();
    let size = load.size;
    match load.kind {
        Kind::Moment => text += &format!("moment_nm = {size:?}\n"),
        Kind::Force(Point::Body) => text += &format!("force_n = {size:?}\n"),
        Kind::Force(Point::Segment(segment)) => {
            text += &format!("force_n = {size:?}\nat = \"{}\"\n", segment.name());
        }
    }
    let along = match load.direction {
        Direction::Body(axis) => name_of(BODY, axis).to_owned(),
        Direction::World(axis) => name_of(WORLD, axis).to_owned(),
        Direction::Segment(segment, axis) => {
            format!("{} {}", segment.name(), name_of(SEGMENT, axis))
        }
        Direction::Stream => STREAM.to_owned(),
    };
    text += &format!("along = \"{along}\"\n");
    let factors: Vec<String> = load.factors.iter().flatten().map(factor_text).collect();
    if !factors.is_empty() {
        text += &format!("times = [\n{}]\n", factors.concat());
    }
    text
}

fn factor_text(factor: &Factor<f64>) -> String {
    let (name, values) = match *factor {
        Factor::Speed { reference } => ("speed", format!("reference_mps = {reference:?}")),
        Factor::SpeedSquared { reference } => {
            ("speed-squared", format!("reference_mps = {reference:?}"))
        }
        Factor::Joint {
            segment,
            axis,
            from,
            reference,
        } => (
            "joint",
            format!(
                "segment = \"{}\", axis = \"{}\", from_rad = {from:?}, reference_rad = {reference:?}",
                segment.name(),
                name_of(SEGMENT, axis)
            ),
        ),
        Factor::Turn { axis, reference } => (
            "turn",
            format!(
                "axis = \"{}\", reference_radps = {reference:?}",
                name_of(BODY, axis)
            ),
        ),
        Factor::Height { from, reference } => (
            "height",
            format!("from_m = {from:?}, reference_m = {reference:?}"),
        ),
        Factor::Sine { frequency, phase } => (
            "sine",
            format!("frequency_hz = {frequency:?}, phase_rad = {phase:?}"),
        ),
        Factor::Pulse {
            start,
            duration,
            period,
        } => (
            "pulse",
            format!("start_s = {start:?}, duration_s = {duration:?}, period_s = {period:?}"),
        ),
    };
    format!("  {{ factor = \"{name}\", {values} }},\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> core::result::Result<AppliedLoad<f64>, String> {
        let table: LoadTable = toml::from_str(text).map_err(|error| error.to_string())?;
        table.load().map_err(|problem| problem.to_string())
    }

    #[test]
    fn written_data_is_read_back() {
        let text_of_each_factor = "force_n = -12.5\nat = \"l_foot\"\nalong = \"r_shank z\"\ntimes = [\n\
            { factor = \"speed-squared\", reference_mps = 50 },\n\
            { factor = \"joint\", segment = \"l_shank\", axis = \"x\", reference_rad = 0.5 },\n\
            { factor = \"turn\", axis = \"dorsal\", reference_radps = -2 }]";
        let others = "moment_nm = 25\nalong = \"up\"\ntimes = [\n\
            { factor = \"speed\", reference_mps = 50 },\n\
            { factor = \"height\", from_m = 4000, reference_m = -1000 },\n\
            { factor = \"sine\", frequency_hz = 3.1 }]";
        let pulse = "moment_nm = 25\nalong = \"stream\"\ntimes = [\n\
            { factor = \"pulse\", start_s = 2, duration_s = 1.5, period_s = 5 }]";
        for toml in [text_of_each_factor, others, pulse] {
            let load = parse(toml).unwrap();
            let again = text(&load).replace("[[effect]]", "");
            assert_eq!(parse(&again).unwrap(), load, "{again}");
        }
    }

    #[test]
    fn bad_loads_are_named() {
        let times = |factor: &str| format!("force_n = 1\nalong = \"up\"\ntimes = [{{ {factor} }}]");
        let factor = |text: &str| times(&format!("factor = {text}"));
        for (text, parts) in [
            (
                "force_n = 1\nmoment_nm = 1\nalong = \"up\"".to_owned(),
                ["either", "moment_nm"],
            ),
            (
                "moment_n = 1\nalong = \"up\"".to_owned(),
                ["moment_n", "moment_nm"],
            ),
            (
                "moment_nm = 1\nat = \"head\"\nalong = \"up\"".to_owned(),
                ["at", "point of application"],
            ),
            (
                "force_n = 1\nat = \"tail\"\nalong = \"up\"".to_owned(),
                ["segment", "tail"],
            ),
            (
                "force_n = nan\nalong = \"up\"".to_owned(),
                ["force_n", "NaN"],
            ),
            (
                "force_n = 1\nalong = \"down\"".to_owned(),
                ["along", "down"],
            ),
            ("force_n = 1\nalong = \"head w\"".to_owned(), ["axis", "w"]),
            (
                factor("\"sine\", frequency_radps = 3"),
                ["frequency_radps", "frequency_hz"],
            ),
            (
                factor("\"sine\", frequency_hz = 300"),
                ["frequency_hz", "300"],
            ),
            (
                factor("\"speed\", reference_mps = 0"),
                ["reference_mps", "0"],
            ),
            (
                factor("\"turn\", axis = \"x\", reference_radps = 1"),
                ["axis", "x"],
            ),
            (factor("\"cosine\", frequency_hz = 3"), ["cosine", "sine"]),
            (times("frequency_hz = 3"), ["factor", "missing"]),
        ] {
            let problem = parse(&text).unwrap_err();
            for part in parts {
                assert!(problem.contains(part), "{text}: {problem}");
            }
        }
    }
}
