//! Errors of suit, subject and sensors that are no missing effect, each with a tolerance
//! (Brynjarsdottir and O'Hagan: without priors a discrepancy and the parameters cannot be told apart).

use bodyflight_core::effect::{Effect, Model, PARAMETER_COUNT};
use bodyflight_core::math::small_rotation;
use bodyflight_core::{Posture, Segment};
use nalgebra::{DVector, SVector, Vector3};

/// Standard deviations of what may be wrong, before a flight is seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tolerances {
    /// Calibration of a joint about one axis, the same all through a flight (degrees).
    pub joint_deg: f64,
    /// Wander of a joint about one axis (degrees).
    pub wander_deg: f64,
    /// Wander beyond which the suit no longer counts as an explanation (degrees).
    pub wander_limit_deg: f64,
    /// Error of a joint that grows with its bend (share).
    pub bend: f64,
    /// Mass of the body and of each segment (share).
    pub mass: f64,
    /// Inertia (share).
    pub inertia: f64,
    /// Area of each segment (share).
    pub area: f64,
    /// Coefficients of drag, lift, moment and damping (share).
    pub coefficients: f64,
    /// Centre of gravity of the trunk (m).
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

/// Angles of the joints: three of each segment but the pelvis.
pub const JOINTS: usize = 3 * (SEGMENTS - 1);

/// Scale and misalignment of the gyroscope: a matrix.
pub const GYRO: usize = 9;

/// Standard deviation of each element of that matrix: data sheets give 0.1 to 1 %.
const GYRO_SCALE: f64 = 0.004;

/// An angle of each joint (rad).
pub type Angles = SVector<f64, JOINTS>;

/// Joint errors of a stretch: the true joint is the recorded one times a small turn.
#[derive(Debug, Clone, PartialEq)]
pub struct JointErrors {
    /// Legendre polynomials of degree 0, 1, 2 over the stretch (rad).
    pub course: [Angles; 3],
    /// Share of the bend.
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

    /// The true posture at `place`, from -1 to 1 over the stretch.
    pub fn correct(&self, recorded: &Posture<f64>, place: f64) -> Posture<f64> {
        let mut posture = *recorded;
        for joint in 0..JOINTS / 3 {
            self.correct_joint(recorded, place, joint, &mut posture);
        }
        posture
    }

    /// One joint of the true posture, by its place among the segments that have a parent.
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

/// Legendre polynomials of degree 0, 1, 2.
pub fn legendre(x: f64) -> [f64; 3] {
    [1.0, x, 1.5 * x * x - 0.5]
}

/// How far all joints are bent (rad).
pub fn bend(posture: &Posture<f64>) -> Angles {
    let mut angles = Angles::zeros();
    for (k, &segment) in Segment::ALL.iter().skip(1).enumerate() {
        let turn = posture.parent_from_segment(segment).scaled_axis();
        angles.fixed_rows_mut::<3>(3 * k).copy_from(&turn);
    }
    angles
}

/// Effects that are within a tolerance anywhere.
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

/// Numbers of a [`Subject`]: mass, inertia, mass and area of each segment, effects within their tolerance.
pub const SUBJECT: usize = EFFECT + EFFECTS.len() * PARAMETER_COUNT;
const MASS: usize = 0;
const INERTIA: usize = 1;
const SEGMENT_MASS: usize = 2;
const AREA: usize = SEGMENT_MASS + SEGMENTS;
const EFFECT: usize = AREA + SEGMENTS;

impl Tolerances {
    fn of_effect(&self, effect: Effect) -> f64 {
        match effect {
            Effect::CgOffset => self.cg_m,
            // Of the sensors: what data sheets leave open.
            Effect::GyroBias => 0.002,
            Effect::Mounting => 0.01,
            Effect::PostureDelay | Effect::GnssLatency => 0.004,
            _ => self.coefficients,
        }
    }

    /// Of each number of a [`Subject`].
    pub fn of_subject(&self) -> DVector<f64> {
        DVector::from_fn(SUBJECT, |k, _| match k {
            MASS => self.mass,
            INERTIA => self.inertia,
            _ if k < AREA => self.mass,
            _ if k < EFFECT => self.area,
            _ => self.of_effect(EFFECTS[(k - EFFECT) / PARAMETER_COUNT]),
        })
    }

    /// Of the gyroscope's scale.
    pub const fn gyro_scale(&self) -> f64 {
        GYRO_SCALE
    }
}

/// Numbers of a [`Subject`] that are equivalent to an effect.
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

/// A number of a [`Subject`] in words, and the value at which the file is right.
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

/// Errors of the subject's file and of the sensors: shares, or units of the effect.
#[derive(Debug, Clone, PartialEq)]
pub struct Subject(pub DVector<f64>);

impl Subject {
    /// As in the file.
    pub fn as_in_file() -> Self {
        Self(DVector::zeros(SUBJECT))
    }

    /// The nearest possible values.
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

    /// The model with the subject as it is.
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
            // Kept inside the plausible ranges.
            let _ = effect.apply(&values, &mut other);
        }
        other
    }
}
