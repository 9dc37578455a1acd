//! The report of a search, for people and machines.

use crate::named_effect::{ByName, Named, Outcome};
use serde::Serialize;

use crate::jacobian::layout::WRENCH;
use crate::likelihood::flight_problem::FlightProblem;
use crate::likelihood::linear_fit::LinearFit;
use crate::output::adjusted_parameters::{Adjustment, JointCalibration};
use crate::output::description::Described;
use crate::output::detectable::Detectable;
use crate::output::residual_rms::{Gap, Spot};
use crate::output::residual_wrench::Remainder;
use crate::shooting::stretch::CHANNELS;

/// Names of the channels, with units.
pub const CHANNEL_NAMES: [&str; CHANNELS] = [
    "attitude_x_rad",
    "attitude_y_rad",
    "attitude_z_rad",
    "angular_velocity_x_radps",
    "angular_velocity_y_radps",
    "angular_velocity_z_radps",
    "velocity_north_mps",
    "velocity_west_mps",
    "velocity_up_mps",
];

/// Estimated sizes of the errors in a flight.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ErrorSizes {
    /// Noise of single frames: attitude (rad), angular velocity (rad/s), horizontal and vertical velocity (m/s).
    pub sensors: [f64; 4],
    /// The same, estimated from differences of neighbouring frames.
    pub sensors_recorded: [f64; 4],
    /// Calibration of a joint about an axis (degrees).
    pub joint_calibration_deg: f64,
    /// Wander of a joint about an axis, root mean square (degrees).
    pub joint_wander_deg: f64,
    /// Joint error proportional to the bend (fraction).
    pub joint_bend: f64,
    /// Unknown moment and force in each tenth of a second (N m, N).
    pub pushes: [f64; 2],
    /// Misfit per observation with these errors; one if they are right.
    pub misfit: f64,
}

impl ErrorSizes {
    pub(crate) fn new(problem: &FlightProblem<'_>, fitted: &LinearFit) -> Self {
        let errors = &fitted.errors;
        Self {
            sensors: core::array::from_fn(|k| errors.sizes[k].sqrt()),
            sensors_recorded: problem.noise,
            joint_calibration_deg: errors.prior_deviations.calibration.to_degrees(),
            joint_wander_deg: errors.wander().to_degrees(),
            joint_bend: errors.prior_deviations.bend,
            pushes: WRENCH.map(|k| errors.sizes[k].sqrt()),
            misfit: errors.misfit(),
        }
    }
}

/// A held-out flight.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct HeldOut {
    /// Gain of log-likelihood with the named effects.
    pub gain: f64,
    /// The gap by channel.
    pub gap: Gap,
    /// Its residual.
    pub remainder: Remainder,
}

/// The report of a search.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Report {
    /// The outcome.
    pub verdict: Outcome,
    /// The named effects, in the order in which they were found.
    pub effects: Vec<Named>,
    /// The closest candidates if the verdict is not `named`. They are not part of the model. If the verdict is
    /// `calibrated`, the effect that may be the cause of the adjustments, if there is one.
    pub nearest: Vec<Named>,
    /// Share of the explainable disagreement that the effects explain.
    pub explained: f64,
    /// Misfit per observation of the model as given by the files, with sensor noise alone.
    pub misfit_unadjusted: f64,
    /// Error sizes of each flight.
    pub errors: Vec<ErrorSizes>,
    /// Errors found in subject, coefficients and sensors, most significant first.
    pub adjustments: Vec<Adjustment>,
    /// Joints with a significant calibration error, most significant first.
    pub joints: Vec<JointCalibration>,
    /// The gap of the first flight.
    pub gap: Gap,
    /// The held-out flights.
    pub held_out: Vec<HeldOut>,
    /// The disagreement in each stretch.
    pub residual_map: Vec<Spot>,
    /// The residual of each flight.
    pub remainders: Vec<Remainder>,
    /// Loads that describe what nothing in the library explains.
    pub description: Option<Described>,
    /// The best description found if it does not explain enough, here or in the held-out flights. It is not part of the
    /// model.
    pub nearest_description: Option<Described>,
    /// How strong the effects that are not named would have to be to show in these flights. Empty if they are too short,
    /// or if the fit has failed. Effects that change at random have no such limit.
    pub detectable: Vec<Detectable>,
    /// What to fly next.
    pub fly_next: String,
    /// What the named effects change for the person in the first flight, in sentences; filled by who has the files.
    pub changes: Vec<String>,
    /// What the recordings say of themselves although they are trusted; filled by who has the files.
    pub warnings: Vec<String>,
    /// The effects as written to `model.toml`.
    pub model: Vec<ByName>,
    /// Mass and coefficients, estimated from tolerances and flights combined, as effects of a `model.toml`.
    pub corrections: Vec<ByName>,
}
