//! The linear problem of a stretch: its residual, and its derivatives with respect to everything that may be wrong.
//!
//! Every column is the difference of two simulations, so a new effect needs no code here.

use std::collections::BTreeMap;

use bodyflight_core::effect::Model;
use nalgebra::{DMatrix, DVector, Vector3};

use super::effect_set::{EffectSet, ParameterId, changed, extended};
use super::error_prior::{CONSTANTS, OWN};
use super::flown::Flown;
use super::nuisance::{Angles, GYRO, JOINTS, JointErrors, SUBJECT, Subject, bend, legendre};
use super::prepared::{Prepared, Steps};
use super::stretch::{CHANNELS, Channels, NUMBERS, ROWS, Stretch};
use super::track::Track;
use super::window::Push;

/// The point of linearization: current estimates of everything that may be wrong.
#[derive(Debug, Clone, PartialEq)]
pub struct Belief {
    /// Effects.
    pub effects: EffectSet,
    /// Errors of subject and sensors.
    pub subject: Subject,
    /// Joint calibration and joint errors proportional to the bend.
    pub joints: JointErrors,
    /// The most likely joint wander, by the first frame of a stretch. Empty until it has been estimated.
    pub wander: BTreeMap<usize, Course>,
}

/// The course of joint errors over a stretch: coefficients of the Legendre polynomials of degree 0, 1, 2 (rad).
pub type Course = [Angles; 3];

impl Belief {
    /// The point at which the files are exact.
    pub fn files() -> Self {
        Self {
            effects: EffectSet::new(),
            subject: Subject::as_in_file(),
            joints: JointErrors::none(),
            wander: BTreeMap::new(),
        }
    }

    /// The joint errors in a stretch.
    ///
    /// The derivatives of an effect depend on the joints. Taken at the recorded joints, their errors would be
    /// correlated with the residuals, and every load that follows the limbs would be underestimated (errors in
    /// variables).
    pub fn joints_in(&self, stretch: &Stretch) -> JointErrors {
        let mut joints = self.joints.clone();
        if let Some(wander) = self.wander.get(&stretch.first) {
            for (course, wander) in joints.course.iter_mut().zip(wander) {
                *course += wander;
            }
        }
        joints
    }

    /// The constants as one vector.
    pub fn constants(&self) -> DVector<f64> {
        let mut constants = DVector::zeros(CONSTANTS);
        let calibration = &self.joints.course[0];
        constants.rows_mut(0, JOINTS).copy_from(calibration);
        constants
            .rows_mut(JOINTS, JOINTS)
            .copy_from(&self.joints.bend);
        constants.rows_mut(OWN, SUBJECT).copy_from(&self.subject.0);
        constants
    }

    /// The plain model with subject and effects of this point.
    pub fn model(&self, plain: &Model<f64>) -> Model<f64> {
        self.subject.of(&extended(plain, &self.effects))
    }
}

/// The residual of a stretch and its derivatives.
#[derive(Debug, Clone)]
pub struct Columns {
    /// Residual: measured less simulated.
    pub missing: DVector<f64>,
    /// With respect to the start, by channel.
    pub start: DMatrix<f64>,
    /// With respect to the joints, by degree of the course over the stretch.
    pub joints: [DMatrix<f64>; 3],
    /// With respect to joint errors proportional to the bend.
    pub bend: DMatrix<f64>,
    /// With respect to scale and misalignment of the gyroscope.
    pub gyro: DMatrix<f64>,
    /// With respect to subject and sensors.
    pub subject: DMatrix<f64>,
    /// With respect to a force in each window, three axes each.
    pub force: DMatrix<f64>,
    /// With respect to a moment in each window.
    pub moment: DMatrix<f64>,
    /// With respect to the effects.
    pub effects: DMatrix<f64>,
}

/// Steps of the finite differences.
const START_STEP: [f64; CHANNELS] = [0.003, 0.003, 0.003, 0.01, 0.01, 0.01, 0.1, 0.1, 0.1];
const JOINT_STEP: f64 = 0.02;
const SUBJECT_STEP: f64 = 0.01;
const FORCE_STEP: f64 = 10.0;
const MOMENT_STEP: f64 = 3.0;

fn collected(count: usize, column: impl Fn(usize) -> DVector<f64>) -> DMatrix<f64> {
    let mut matrix = DMatrix::zeros(NUMBERS, count);
    for k in 0..count {
        matrix.set_column(k, &column(k));
    }
    matrix
}

impl Columns {
    /// Computes all columns. Returns `None` if a simulation diverges.
    pub fn new(
        track: &Track,
        stretch: &Stretch,
        plain: &Model<f64>,
        belief: &Belief,
        parameters: &[ParameterId],
    ) -> Option<Self> {
        let still = Channels::zeros();
        let wrong = belief.joints_in(stretch);
        let base = Prepared::new(track, stretch, &belief.model(plain), &wrong, Steps::Long);
        let flown = base.fly(&still, None);
        let change = |other: &Flown, size: f64| other.less(&flown, track, stretch) / size;
        let start = collected(CHANNELS, |k| {
            let mut by = still;
            by[k] = START_STEP[k];
            change(&base.fly(&by, None), START_STEP[k])
        });
        let joints = [0, 1, 2].map(|degree| {
            collected(JOINTS, |k| {
                let mut joints = wrong.clone();
                joints.course[degree][k] += JOINT_STEP;
                change(
                    &base.with_joint(&joints, k / 3).fly(&still, None),
                    JOINT_STEP,
                )
            })
        });
        let bends = bends(track, stretch);
        let bend = collected(JOINTS, |k| {
            let parts = joints.iter().zip(&bends);
            parts.map(|(matrix, bend)| matrix.column(k) * bend[k]).sum()
        });
        let effects = extended(plain, &belief.effects);
        let subject = collected(SUBJECT, |k| {
            let mut subject = belief.subject.clone();
            subject.0[k] += SUBJECT_STEP;
            let subject = subject.possible();
            let step = subject.0[k] - belief.subject.0[k];
            if step == 0.0 {
                return DVector::zeros(NUMBERS);
            }
            change(
                &base.changed_to(&subject.of(&effects)).fly(&still, None),
                step,
            )
        });
        let pushed = |force: f64, moment: f64| {
            collected(3 * ROWS, |k| {
                let mut axis = Vector3::zeros();
                axis[k % 3] = 1.0;
                let push = Push {
                    window: k / 3,
                    force: axis * force,
                    moment: axis * moment,
                };
                change(&base.fly(&still, Some(push)), force + moment)
            })
        };
        let columns = Self {
            missing: missing(track, stretch, plain, belief),
            gyro: gyro(track, stretch, &start),
            start,
            joints,
            bend,
            subject,
            force: pushed(FORCE_STEP, 0.0),
            moment: pushed(0.0, MOMENT_STEP),
            effects: effect_columns(stretch, plain, belief, parameters, (&base, &flown)),
        };
        columns.is_finite().then_some(columns)
    }

    fn is_finite(&self) -> bool {
        let finite = |matrix: &DMatrix<f64>| matrix.iter().all(|value| value.is_finite());
        let others = [
            &self.start,
            &self.bend,
            &self.subject,
            &self.force,
            &self.moment,
            &self.effects,
        ];
        self.missing.iter().all(|value| value.is_finite())
            && others.into_iter().chain(&self.joints).all(finite)
    }
}

/// The residual of a stretch.
pub fn missing(
    track: &Track,
    stretch: &Stretch,
    plain: &Model<f64>,
    belief: &Belief,
) -> DVector<f64> {
    let model = belief.model(plain);
    let joints = belief.joints_in(stretch);
    let flight = Prepared::new(track, stretch, &model, &joints, Steps::Short);
    flight.fly(&Channels::zeros(), None).missing(track, stretch)
}

/// Derivatives with respect to some parameters, and the residual in the last column.
pub fn effects_and_missing(
    track: &Track,
    stretch: &Stretch,
    plain: &Model<f64>,
    belief: &Belief,
    parameters: &[ParameterId],
) -> DMatrix<f64> {
    let columns = effects_alone(track, stretch, plain, belief, parameters);
    let mut columns = columns.insert_column(parameters.len(), 0.0);
    columns.set_column(parameters.len(), &missing(track, stretch, plain, belief));
    columns
}

/// Derivatives with respect to some parameters.
pub fn effects_alone(
    track: &Track,
    stretch: &Stretch,
    plain: &Model<f64>,
    belief: &Belief,
    parameters: &[ParameterId],
) -> DMatrix<f64> {
    if parameters.is_empty() {
        return DMatrix::zeros(NUMBERS, 0);
    }
    let joints = belief.joints_in(stretch);
    let base = Prepared::new(track, stretch, &belief.model(plain), &joints, Steps::Long);
    let flown = base.fly(&Channels::zeros(), None);
    effect_columns(stretch, plain, belief, parameters, (&base, &flown))
}

fn effect_columns(
    stretch: &Stretch,
    plain: &Model<f64>,
    belief: &Belief,
    parameters: &[ParameterId],
    (base, flown): (&Prepared<'_>, &Flown),
) -> DMatrix<f64> {
    collected(parameters.len(), |k| {
        let (other, size) = changed(plain, &belief.effects, parameters[k]);
        let flight = base.changed_to(&belief.subject.of(&other));
        flight
            .fly(&Channels::zeros(), None)
            .less(flown, base.track, stretch)
            / size
    })
}

/// Derivatives with respect to the elements of the gyroscope's error matrix, including their effect on the start.
fn gyro(track: &Track, stretch: &Stretch, start: &DMatrix<f64>) -> DMatrix<f64> {
    let window = stretch.grid.window;
    let spin = |frame: usize| track.measured[frame].angular_velocity.components;
    collected(GYRO, |k| {
        let (to, from) = (k / 3, k % 3);
        let first = stretch.start.angular_velocity.components[from];
        let mut column = start.column(3 + to) * -first;
        for row in 0..ROWS {
            let begin = stretch.first + row * window + 1;
            let mean = (begin..begin + window)
                .map(|frame| spin(frame)[from])
                .sum::<f64>();
            column[row * CHANNELS + 3 + to] += mean / window as f64;
        }
        column
    })
}

/// How far the joints are bent over a stretch, by degree of the polynomial.
fn bends(track: &Track, stretch: &Stretch) -> [Angles; 3] {
    let mut bends = [Angles::zeros(); 3];
    let mut norms = [0.0; 3];
    for k in 0..=ROWS {
        let bend = bend(&track.postures[stretch.first + k * stretch.grid.window]);
        let polynomials = legendre(2.0 * k as f64 / ROWS as f64 - 1.0);
        for ((sum, norm), value) in bends.iter_mut().zip(&mut norms).zip(polynomials) {
            *sum += bend * value;
            *norm += value * value;
        }
    }
    for (sum, norm) in bends.iter_mut().zip(norms) {
        *sum /= norm;
    }
    bends
}
