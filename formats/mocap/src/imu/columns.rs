//! Where the numbers of a sensor are in its table, and their units.

use bodyflight_core::air::STANDARD_GRAVITY;
use bodyflight_io::diagnostic::{Problem, Result};
use serde::Deserialize;

use crate::slimevr::record::COLUMNS;

/// Columns by name, and their units.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Columns {
    /// Time of the sample, or a counter.
    pub time: Option<String>,
    /// Column with the number of the sample, for files whose column of times is empty; it needs a rate.
    pub counter: Option<String>,
    /// Length of one unit of the time (s).
    #[serde(default = "one")]
    pub time_unit_s: f64,
    /// Angular velocity about the sensor's x, y and z.
    pub angular_velocity: Option<[String; 3]>,
    /// Orientation by the sensor's own fusion, a quaternion w, x, y, z from the sensor to level axes, instead of rates.
    pub orientation: Option<[String; 4]>,
    /// Unit of the angular velocity.
    #[serde(default)]
    pub angular_velocity_unit: RateUnit,
    /// Specific force along x, y and z: at rest it points up.
    pub specific_force: Option<[String; 3]>,
    /// Acceleration without gravity in the level axes of the orientation, instead of the specific force.
    pub free_acceleration: Option<[String; 3]>,
    /// Acceleration without gravity in the sensor's own axes, instead of the specific force.
    pub linear_acceleration: Option<[String; 3]>,
    /// Unit of the specific force, or of the acceleration.
    #[serde(default)]
    pub specific_force_unit: ForceUnit,
    /// Whether times are those at which samples arrived.
    #[serde(skip)]
    pub(super) arrived: bool,
    /// How many packets were lost since the sample before, for samples that arrived.
    #[serde(skip)]
    pub(super) lost: Option<String>,
    /// How often the sensor had begun again, for samples that arrived.
    #[serde(skip)]
    pub(super) restarts: Option<String>,
}

pub(super) const fn one() -> f64 {
    1.0
}

/// Unit of an angular velocity.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
pub enum RateUnit {
    /// rad/s.
    #[default]
    #[serde(rename = "rad/s")]
    Radians,
    /// deg/s.
    #[serde(rename = "deg/s")]
    Degrees,
}

impl RateUnit {
    /// One unit in rad/s.
    pub fn radians(self) -> f64 {
        match self {
            Self::Radians => 1.0,
            Self::Degrees => 1.0_f64.to_radians(),
        }
    }
}

/// Unit of a specific force.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
pub enum ForceUnit {
    /// m/s2.
    #[default]
    #[serde(rename = "m/s2")]
    Si,
    /// Multiples of standard gravity.
    #[serde(rename = "g")]
    Gravity,
}

impl ForceUnit {
    /// One unit in m/s2.
    pub const fn metres(self) -> f64 {
        match self {
            Self::Si => 1.0,
            Self::Gravity => STANDARD_GRAVITY,
        }
    }
}

/// The format of recordings of MVN, which have no columns.
pub(super) const MVNX: &str = "mvnx";

/// The format of what `bodyflight slimevr` records.
const SLIMEVR: &str = "slimevr";

/// Columns and units of programs that export raw data, or that of the sensors' fusion.
pub const FORMATS: [&str; 6] = [
    "mt-manager",
    "dot",
    "mt-manager-fused",
    "dot-fused",
    SLIMEVR,
    MVNX,
];

/// The columns of such a program.
pub(super) fn columns_of(format: &str) -> Option<Columns> {
    if format == SLIMEVR {
        return Some(slimevr());
    }
    // SampleTimeFine counts 100 us in MT Manager, 1 us in Xsens DOT.
    let (program, is_fused) = match format.strip_suffix("-fused") {
        Some(program) => (program, true),
        None => (format, false),
    };
    let (tick, unit, parts) = match program {
        "mt-manager" => (1e-4, RateUnit::Radians, ["q0", "q1", "q2", "q3"]),
        "dot" => (1e-6, RateUnit::Degrees, ["W", "X", "Y", "Z"]),
        _ => return None,
    };
    let three = |name: &str| ["X", "Y", "Z"].map(|axis| format!("{name}_{axis}"));
    Some(Columns {
        time: Some("SampleTimeFine".to_owned()),
        counter: Some("PacketCounter".to_owned()),
        time_unit_s: tick,
        angular_velocity: (!is_fused).then(|| three("Gyr")),
        orientation: is_fused.then(|| parts.map(|part| format!("Quat_{part}"))),
        angular_velocity_unit: unit,
        // MT Manager writes the accelerometer beside the orientation, DOT does not.
        specific_force: (!is_fused || program == "mt-manager").then(|| three("Acc")),
        free_acceleration: (is_fused && program == "dot").then(|| three("FreeAcc")),
        linear_acceleration: None,
        specific_force_unit: ForceUnit::Si,
        arrived: false,
        lost: None,
        restarts: None,
    })
}

/// The columns of tables of SlimeVR's trackers.
fn slimevr() -> Columns {
    let [
        time,
        w,
        x,
        y,
        z,
        along_x,
        along_y,
        along_z,
        _,
        lost,
        restarts,
    ] = COLUMNS.map(str::to_owned);
    Columns {
        time: Some(time),
        counter: None,
        time_unit_s: 1.0,
        angular_velocity: None,
        orientation: Some([w, x, y, z]),
        angular_velocity_unit: RateUnit::Radians,
        specific_force: None,
        free_acceleration: None,
        linear_acceleration: Some([along_x, along_y, along_z]),
        specific_force_unit: ForceUnit::Si,
        arrived: true,
        lost: Some(lost),
        restarts: Some(restarts),
    }
}

impl Columns {
    pub(super) fn check(&self) -> Result<()> {
        let problem = |what: &str| Err(Problem::bad_input(what.to_owned()).at("table columns"));
        if self.angular_velocity.is_some() == self.orientation.is_some() {
            return problem("expected either angular_velocity or orientation");
        }
        let (free, linear) = (&self.free_acceleration, &self.linear_acceleration);
        let forces = [&self.specific_force, free, linear];
        if forces.iter().filter(|force| force.is_some()).count() != 1 {
            return problem(
                "expected one of specific_force, free_acceleration and linear_acceleration",
            );
        }
        if self.specific_force.is_none() && self.orientation.is_none() {
            return problem(
                "an acceleration without gravity needs the orientation, which is missing",
            );
        }
        Ok(())
    }

    /// Name of a column that every file has.
    pub(super) fn first(&self) -> &str {
        let rates = self.angular_velocity.as_ref().map(|[x, ..]| x);
        let turns = self.orientation.as_ref().map(|[w, ..]| w);
        rates.or(turns).map_or("", String::as_str)
    }
}
