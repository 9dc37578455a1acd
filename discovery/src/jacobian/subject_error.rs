//! Errors of suit, subject and sensors that are not missing effects, each with a tolerance. Without priors, a
//! discrepancy and the parameters could not be separated (Brynjarsdottir and O'Hagan).

use bodyflight_core::Segment;
use bodyflight_core::effect::{Effect, Model, PARAMETER_COUNT};
use bodyflight_core::tolerances::Tolerances;
use nalgebra::DVector;

const SEGMENTS: usize = bodyflight_core::body::SEGMENT_COUNT;

/// Number of elements of the gyroscope's scale and misalignment matrix.
pub(crate) const GYRO: usize = 9;

/// Standard deviation of each element of that matrix; data sheets give 0.1 to 1 %.
pub(crate) const GYRO_SCALE: f64 = 0.004;

/// Effects that are always present within a tolerance.
const EFFECTS: [Effect; 9] = [
    Effect::Drag,
    Effect::Lift,
    Effect::Moment,
    Effect::Damping,
    Effect::CgOffset,
    Effect::GyroBias,
    Effect::Mounting,
    Effect::PostureDelay,
    Effect::GnssLatency,
];

/// Number of parameters of a [`Subject`]: mass, inertia, mass and area of each segment, effects within their tolerance.
pub(crate) const SUBJECT: usize = EFFECT + EFFECTS.len() * PARAMETER_COUNT;
const MASS: usize = 0;
const INERTIA: usize = 1;
const SEGMENT_MASS: usize = 2;
const AREA: usize = SEGMENT_MASS + SEGMENTS;
const EFFECT: usize = AREA + SEGMENTS;

fn deviation_of(tolerances: &Tolerances, effect: Effect) -> f64 {
    match effect {
        Effect::CgOffset => tolerances.cg_m,
        // Sensor errors that data sheets leave open.
        Effect::GyroBias => 0.002,
        Effect::Mounting => 0.01,
        Effect::PostureDelay | Effect::GnssLatency => 0.004,
        _ => tolerances.coefficients,
    }
}

/// Prior standard deviation of each parameter of a [`Subject`].
pub(crate) fn subject_deviations(tolerances: &Tolerances) -> DVector<f64> {
    DVector::from_fn(SUBJECT, |k, _| match k {
        MASS => tolerances.mass,
        INERTIA => tolerances.inertia,
        _ if k < AREA => tolerances.mass,
        _ if k < EFFECT => tolerances.area,
        _ => deviation_of(tolerances, EFFECTS[(k - EFFECT) / PARAMETER_COUNT]),
    })
}

/// Parameters of a [`Subject`] that are equivalent to an effect.
pub(crate) fn aliased(effect: Effect) -> Vec<usize> {
    if effect == Effect::Mass {
        return vec![MASS];
    }
    let place = EFFECTS.iter().position(|other| *other == effect);
    place.map_or_else(Vec::new, |place| {
        let first = EFFECT + place * PARAMETER_COUNT;
        (first..first + PARAMETER_COUNT).collect()
    })
}

/// Description of a parameter of a [`Subject`], and its value if the file is exact.
pub(crate) fn described(index: usize) -> Option<(String, f64)> {
    let segment = |k: usize| Segment::ALL[k].name();
    match index {
        MASS => Some(("mass of the body, factor".to_owned(), 1.0)),
        INERTIA => Some(("inertia of the body, factor".to_owned(), 1.0)),
        _ if index < AREA => Some((
            format!("mass of {}, factor", segment(index - SEGMENT_MASS)),
            1.0,
        )),
        _ if index < EFFECT => Some((format!("area of {}, factor", segment(index - AREA)), 1.0)),
        _ => {
            let effect = EFFECTS[(index - EFFECT) / PARAMETER_COUNT].description();
            let parameter = effect.parameters.get((index - EFFECT) % PARAMETER_COUNT)?;
            Some((
                format!("{}, {}", effect.name, parameter.name),
                parameter.neutral,
            ))
        }
    }
}

/// Errors of the subject's file and of the sensors: fractions, or units of the effect.
#[derive(Debug, Clone, PartialEq)]
pub struct Subject(pub DVector<f64>);

impl Subject {
    /// No errors.
    pub fn as_in_file() -> Self {
        Self(DVector::zeros(SUBJECT))
    }

    /// Clamps the parameters to possible values.
    pub fn possible(mut self) -> Self {
        for (k, value) in self.0.iter_mut().enumerate() {
            if k < EFFECT {
                *value = value.max(-0.9);
            } else {
                let effect = EFFECTS[(k - EFFECT) / PARAMETER_COUNT].description();
                match effect.parameters.get((k - EFFECT) % PARAMETER_COUNT) {
                    Some(p) => *value = value.clamp(p.low - p.neutral, p.high - p.neutral),
                    None => *value = 0.0,
                }
            }
        }
        self
    }

    /// The model with these errors applied.
    pub fn of(&self, model: &Model<f64>) -> Model<f64> {
        let mut other = *model;
        let share = |index: usize| 1.0 + self.0[index];
        for (k, (_, segment)) in other.dynamics.body.segments.iter_mut().enumerate() {
            let mass = share(MASS) * share(SEGMENT_MASS + k);
            segment.mass *= mass;
            segment.inertia *= mass * share(INERTIA);
            segment.area *= share(AREA + k);
        }
        for (row, effect) in EFFECTS.iter().enumerate() {
            let mut values = effect.neutral();
            let off = self.0.rows(EFFECT + row * PARAMETER_COUNT, PARAMETER_COUNT);
            if off.iter().all(|off| *off == 0.0) {
                continue;
            }
            for (value, off) in values.iter_mut().zip(off.iter()) {
                *value += off;
            }
            // `apply` clamps to the plausible ranges.
            let _ = effect.apply(&values, &mut other);
        }
        other
    }
}
