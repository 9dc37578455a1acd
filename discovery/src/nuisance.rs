//! Errors of suit, subject and sensors that are not missing effects, each with a tolerance. Without priors, a
//! discrepancy and the parameters could not be separated (Brynjarsdottir and O'Hagan).

use bodyflight_core::effect::{Effect, Model, PARAMETER_COUNT};
use bodyflight_core::math::small_rotation;
use bodyflight_core::{Posture, Segment};
use nalgebra::{DVector, SVector, Vector3};

/// Standard deviations of possible errors, before a flight has been seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tolerances {
    /// Calibration of a joint about one axis, constant throughout a flight (degrees).
    pub joint_deg: f64,
    /// Wander of a joint about one axis (degrees).
    pub wander_deg: f64,
    /// Joint error, constant or wandering, at which the suit no longer counts as an explanation (degrees).
    pub wander_limit_deg: f64,
    /// Joint error proportional to the bend (fraction).
    pub bend: f64,
    /// Mass of the body and of each segment (fraction).
    pub mass: f64,
    /// Inertia (fraction).
    pub inertia: f64,
    /// Area of each segment (fraction).
    pub area: f64,
    /// Coefficients of drag, lift, moment and damping (fraction).
    pub coefficients: f64,
    /// Position of the trunk's centre of gravity (m).
    pub cg_m: f64,
}

impl Default for Tolerances {
    fn default() -> Self {
        Self {
            joint_deg: 2.0,
            wander_deg: 1.0,
            wander_limit_deg: 5.0,
            bend: 0.03,
            mass: 0.03,
            inertia: 0.03,
            area: 0.03,
            coefficients: 0.04,
            cg_m: 0.004,
        }
    }
}

const SEGMENTS: usize = bodyflight_core::body::SEGMENT_COUNT;

/// Number of joint angles: three for each segment but the pelvis.
pub const JOINTS: usize = 3 * (SEGMENTS - 1);

/// Number of elements of the gyroscope's scale and misalignment matrix.
pub const GYRO: usize = 9;

/// Standard deviation of each element of that matrix; data sheets give 0.1 to 1 %.
const GYRO_SCALE: f64 = 0.004;

/// An angle of each joint (rad).
pub type Angles = SVector<f64, JOINTS>;

/// Joint errors of a stretch. The true joint is the recorded one times a small rotation.
#[derive(Debug, Clone, PartialEq)]
pub struct JointErrors {
    /// Legendre polynomials of degree 0, 1, 2 over the stretch (rad).
    pub course: [Angles; 3],
    /// Error proportional to the bend (fraction).
    pub bend: Angles,
}

impl JointErrors {
    /// Joints as recorded.
    pub fn none() -> Self {
        Self {
            course: [Angles::zeros(); 3],
            bend: Angles::zeros(),
        }
    }

    /// The true posture at `place`, which runs from -1 to 1 over the stretch.
    pub fn correct(&self, recorded: &Posture<f64>, place: f64) -> Posture<f64> {
        let mut posture = *recorded;
        for joint in 0..JOINTS / 3 {
            self.correct_joint(recorded, place, joint, &mut posture);
        }
        posture
    }

    /// One joint of the true posture, given by its index among the segments that have a parent.
    pub fn correct_joint(
        &self,
        recorded: &Posture<f64>,
        place: f64,
        joint: usize,
        posture: &mut Posture<f64>,
    ) {
        let segment = Segment::ALL[joint + 1];
        let part = |angles: &Angles| angles.fixed_rows::<3>(3 * joint).into_owned();
        let from_parent = recorded.parent_from_segment(segment);
        let mut turn = Vector3::zeros();
        for (angles, share) in self.course.iter().zip(legendre(place)) {
            turn += part(angles) * share;
        }
        let bend = part(&self.bend);
        if bend != Vector3::zeros() {
            turn += bend.component_mul(&from_parent.scaled_axis());
        }
        if turn != Vector3::zeros() {
            posture.set(segment, from_parent * small_rotation(&turn));
        }
    }
}

/// The Legendre polynomials of degree 0, 1, 2.
pub fn legendre(x: f64) -> [f64; 3] {
    [1.0, x, 1.5 * x * x - 0.5]
}

/// Angles by which all joints are bent (rad).
pub fn bend(posture: &Posture<f64>) -> Angles {
    let mut angles = Angles::zeros();
    for (k, &segment) in Segment::ALL.iter().skip(1).enumerate() {
        let turn = posture.parent_from_segment(segment).scaled_axis();
        angles.fixed_rows_mut::<3>(3 * k).copy_from(&turn);
    }
    angles
}

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
pub const SUBJECT: usize = EFFECT + EFFECTS.len() * PARAMETER_COUNT;
const MASS: usize = 0;
const INERTIA: usize = 1;
const SEGMENT_MASS: usize = 2;
const AREA: usize = SEGMENT_MASS + SEGMENTS;
const EFFECT: usize = AREA + SEGMENTS;

impl Tolerances {
    /// Largest plausible joint error, constant or wandering (rad): the stated limit, or twice a tolerance if that is
    /// larger.
    pub(super) fn joint_limit(&self) -> f64 {
        let least = 2.0 * self.joint_deg.max(self.wander_deg);
        self.wander_limit_deg.max(least).to_radians()
    }

    fn of_effect(&self, effect: Effect) -> f64 {
        match effect {
            Effect::CgOffset => self.cg_m,
            // Sensor errors that data sheets leave open.
            Effect::GyroBias => 0.002,
            Effect::Mounting => 0.01,
            Effect::PostureDelay | Effect::GnssLatency => 0.004,
            _ => self.coefficients,
        }
    }

    /// Standard deviation of each parameter of a [`Subject`].
    pub fn of_subject(&self) -> DVector<f64> {
        DVector::from_fn(SUBJECT, |k, _| match k {
            MASS => self.mass,
            INERTIA => self.inertia,
            _ if k < AREA => self.mass,
            _ if k < EFFECT => self.area,
            _ => self.of_effect(EFFECTS[(k - EFFECT) / PARAMETER_COUNT]),
        })
    }

    /// Standard deviation of the gyroscope's scale.
    pub const fn gyro_scale(&self) -> f64 {
        GYRO_SCALE
    }
}

/// Parameters of a [`Subject`] that are equivalent to an effect.
pub fn twins(effect: Effect) -> Vec<usize> {
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
pub fn described(index: usize) -> Option<(String, f64)> {
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
