//! `bodyflight sensitivity`: how much a flight changes with each parameter of the model.
//!
//! The paper says that 30 % in any coefficient changes the velocities by less than 1 %. That can mean two things: how
//! much the motion from the same postures and inputs changes (a free run), or how well the flight is reconstructed
//! after the inputs are re-estimated, which is how the paper reconstructs flights.

mod figure;

use bodyflight_core::dynamics::Dynamics;
use bodyflight_core::estimator::preset::Preset;
use bodyflight_core::observation::Observation;
use serde::Serialize;

use bodyflight_estimation::Filter;
use bodyflight_estimation::windows::estimate;
use bodyflight_io::diagnostic::Result;
use bodyflight_io::interrupt;
use bodyflight_mvnx::recording::{FlightFrame, Options, Warning, faults};
use bodyflight_replay::Precision;
use bodyflight_replay::comparison::{Channel, Comparison, Pair, PerChannel};
use bodyflight_replay::flight::Flight;
use bodyflight_replay::input_history::{InputHistory, InputRow};
use bodyflight_replay::steps::too_short;
use bodyflight_replay::variants::{Variant, fly};

/// A parameter of the model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Parameter {
    /// Cd of all segments.
    Drag,
    /// Cl of all segments.
    Lift,
    /// Cm of all segments.
    Moment,
    /// Cm_damp about the left axis.
    PitchDamping,
    /// Cm_damp about the dorsal axis.
    YawDamping,
    /// Cm_damp about the cranial axis.
    RollDamping,
    /// Mass of all segments.
    Mass,
    /// Area of the feet: the paper's shoe size.
    Shoes,
    /// Difference of the arch factor from 1.
    Arch,
}

impl Parameter {
    /// All parameters.
    pub const ALL: [Self; 9] = [
        Self::Drag,
        Self::Lift,
        Self::Moment,
        Self::PitchDamping,
        Self::YawDamping,
        Self::RollDamping,
        Self::Mass,
        Self::Shoes,
        Self::Arch,
    ];

    /// Readable name.
    pub const fn label(self) -> &'static str {
        match self {
            Self::Drag => "Cd",
            Self::Lift => "Cl",
            Self::Moment => "Cm",
            Self::PitchDamping => "damping, pitch",
            Self::YawDamping => "damping, yaw",
            Self::RollDamping => "damping, roll",
            Self::Mass => "mass",
            Self::Shoes => "shoes (area)",
            Self::Arch => "arch",
        }
    }

    /// Factors on drag, lift and moment coefficients; `None` for other parameters.
    const fn coefficient_factors(self, factor: f64) -> Option<[f64; 3]> {
        Some(match self {
            Self::Drag => [factor, 1.0, 1.0],
            Self::Lift => [1.0, factor, 1.0],
            Self::Moment => [1.0, 1.0, factor],
            _ => return None,
        })
    }

    /// Factors on the damping: pitch, yaw, roll.
    const fn damping_factors(self, factor: f64) -> [f64; 3] {
        match self {
            Self::PitchDamping => [factor, 1.0, 1.0],
            Self::YawDamping => [1.0, factor, 1.0],
            Self::RollDamping => [1.0, 1.0, factor],
            _ => [1.0; 3],
        }
    }

    fn vary(self, dynamics: &mut Dynamics<f64>, factor: f64) {
        use bodyflight_core::Segment::{LeftFoot, RightFoot};
        use bodyflight_core::aerodynamics::ArchFactor;
        let aerodynamics = &mut dynamics.aerodynamics;
        if let Some([drag, lift, moment]) = self.coefficient_factors(factor) {
            for (_, coefficients) in aerodynamics.coefficients.iter_mut() {
                coefficients.drag *= drag;
                coefficients.lift *= lift;
                coefficients.moment *= moment;
            }
        }
        if self == Self::Arch {
            aerodynamics.arch = match aerodynamics.arch {
                ArchFactor::Fixed(fixed) => ArchFactor::Fixed(1.0 + factor * (fixed - 1.0)),
                ArchFactor::FromPosture => ArchFactor::Scaled(factor),
                ArchFactor::Scaled(scale) => ArchFactor::Scaled(scale * factor),
            };
        }
        for (segment, parameters) in dynamics.body.segments.iter_mut() {
            if self == Self::Mass {
                parameters.mass *= factor;
                parameters.inertia *= factor;
            }
            if self == Self::Shoes && matches!(segment, LeftFoot | RightFoot) {
                parameters.area *= factor;
            }
        }
    }
}

/// The effect of a parameter.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Effect {
    /// The parameter.
    pub parameter: Parameter,
    /// Factor by which it was multiplied.
    pub factor: f64,
    /// Root mean square of varied minus unvaried free run.
    pub change: PerChannel,
    /// RMS gap of measured minus reconstructed with re-estimated inputs, for aerodynamic coefficients and if requested.
    pub reconstruction: Option<PerChannel>,
    /// Why the change means nothing, if the varied run diverges.
    pub diverged: Option<String>,
}

/// The sensitivity of a flight.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Report {
    /// Largest absolute value of each channel of the unvaried run.
    pub amplitude: PerChannel,
    /// One entry for each parameter and direction.
    pub effects: Vec<Effect>,
    /// RMS gap of measured minus reconstructed with the unvaried model, if estimation was requested.
    pub reconstruction: Option<PerChannel>,
    /// Largest absolute value of each measured channel in that reconstruction.
    pub measured_amplitude: Option<PerChannel>,
    /// Values that are implausible for a flight.
    pub warnings: Vec<Warning>,
    /// Why no change means anything, if the unvaried run diverges.
    pub diverged: Option<String>,
}

impl Report {
    /// Why the result cannot be trusted.
    pub fn doubt(&self) -> Option<String> {
        faults(&self.warnings).or_else(|| self.diverged.clone())
    }
}

/// Variants that are flown at once: as many as there are lanes, since each has inputs for every frame.
const SIDE_BY_SIDE: usize = 4;

/// Simulates a flight's postures with each parameter increased and decreased by `share` (0.3 is 30 %). With
/// `estimation`, also re-estimates the inputs each time.
///
/// # Errors
/// Returns an error if the flight cannot be read, or the preset is refused.
pub fn sensitivity(
    flight: &Flight,
    share: f64,
    estimation: Option<&Preset>,
    options: Options,
    progress: &mut dyn FnMut(),
) -> Result<Report> {
    let mut recording = flight.open(options)?;
    let frames: Vec<FlightFrame> = recording.by_ref().collect::<Result<_>>()?;
    let [first, _, ..] = frames.as_slice() else {
        return Err(too_short(&flight.recording));
    };
    let dynamics = flight.dynamics(first.pelvis.position.up());
    let unvaried = Variant {
        flight: flight.clone(),
        dynamics,
    };
    let mut plain = Run::new();
    let diverged = fly(&frames, &[unvaried], &mut |_, pair| {
        plain.push((pair.time, pair.simulated));
    })?;
    let diverged = diverged.into_iter().flatten().next();
    let reconstruct = |varied: Option<(Parameter, f64)>| {
        let Some(preset) = estimation else {
            return Ok(None);
        };
        let mut flight = flight.clone();
        if let Some((parameter, factor)) = varied {
            let Some(factors) = parameter.coefficient_factors(factor) else {
                return Ok(None);
            };
            flight.subject = flight.subject.clone().with_coefficients_times(factors);
        }
        let (by, precision) = (Filter::Paper, Precision::Double);
        let estimation = estimate(&flight, preset, by, options, precision, &mut |_| {})?;
        Ok(Some(estimation.report))
    };
    let unvaried = reconstruct(None)?;
    let all = Parameter::ALL.iter();
    let all = all.flat_map(|own| [1.0 - share, 1.0 + share].map(|factor| (*own, factor)));
    let all: Vec<(Parameter, f64)> = all.collect();
    let mut effects = Vec::new();
    for some in all.chunks(SIDE_BY_SIDE) {
        let varied = some.iter().map(|of| varied(flight, &frames, dynamics, *of));
        let varied: Vec<Variant> = varied.collect();
        let mut change = vec![Comparison::default(); some.len()];
        let mut at = vec![plain.iter(); some.len()];
        let diverged = fly(&frames, &varied, &mut |index, pair| {
            if let Some((time, unvaried)) = at[index].next() {
                change[index].push(against(*time, unvaried, pair.simulated));
            }
        })?;
        for (((parameter, factor), change), diverged) in some.iter().zip(change).zip(diverged) {
            effects.push(Effect {
                parameter: *parameter,
                factor: *factor,
                change: change.rms(),
                reconstruction: reconstruct(Some((*parameter, *factor)))?.map(|report| report.rms),
                diverged,
            });
            progress();
            interrupt::check()?;
        }
    }
    let mut own = Comparison::default();
    for (time, unvaried) in &plain {
        own.push(against(*time, unvaried, *unvaried));
    }
    Ok(Report {
        amplitude: own.amplitude(),
        effects,
        reconstruction: unvaried.as_ref().map(|report| report.rms),
        measured_amplitude: unvaried.as_ref().map(|report| report.amplitude),
        warnings: recording.warnings(),
        diverged,
    })
}

/// Time and observation of the unvaried model's motion, frame by frame.
type Run = Vec<(f64, Observation<f64>)>;

/// The flight with one parameter multiplied by a factor.
fn varied(
    flight: &Flight,
    frames: &[FlightFrame],
    mut dynamics: Dynamics<f64>,
    (parameter, factor): (Parameter, f64),
) -> Variant {
    let mut flight = flight.clone();
    parameter.vary(&mut dynamics, factor);
    let factors = parameter.damping_factors(factor);
    let rows = frames.iter().map(|frame| {
        let mut inputs = flight.inputs_at(frame.time);
        let damping = inputs.damping.to_array();
        inputs.damping = std::array::from_fn(|axis| damping[axis] * factors[axis]).into();
        InputRow::of(frame.time, &inputs)
    });
    flight.inputs = Some(InputHistory::new(rows.collect()));
    Variant { flight, dynamics }
}

fn against(time: f64, unvaried: &Observation<f64>, simulated: Observation<f64>) -> Pair {
    Pair {
        time,
        measured: *unvaried,
        simulated,
    }
}

/// Channels shown in tables.
pub const SHOWN: [Channel; 5] = [
    Channel::Roll,
    Channel::Pitch,
    Channel::YawRate,
    Channel::HorizontalVelocity,
    Channel::VerticalVelocity,
];
