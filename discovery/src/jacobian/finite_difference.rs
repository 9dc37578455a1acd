//! The linear problem of a stretch: its residual, and its derivatives with respect to everything that may be wrong.
//!
//! Every column is the difference of the residuals of two simulations, so a new effect needs no code here. The difference
//! between the two attitudes would not do, because rotations do not add up: it departs from that of the residuals by half
//! the residual.

use crate::named_effect::EffectSet;
use bodyflight_core::effect::{Effect, Model, extended};
use nalgebra::{DMatrix, DVector, Vector3};

use crate::input::flight::RecordedFlight;
use crate::jacobian::columns::Jacobian;
use crate::jacobian::effect_parameters::{ParameterId, changed};
use crate::jacobian::linearization_point::LinearizationPoint;
use crate::jacobian::random_effects::{Changes, RandomEffectColumns};
use crate::jacobian::subject_error::{GYRO, SUBJECT};
use crate::shooting::joint_error::{Angles, JOINTS, bend, legendre};
use crate::shooting::perturbation::{InputPerturbation, UnknownWrench};
use crate::shooting::simulator::{Simulator, Steps};
use crate::shooting::stretch::{CHANNELS, Stretch};

/// Steps of the finite differences.
const START_STEP: [f64; CHANNELS] = [0.003, 0.003, 0.003, 0.01, 0.01, 0.01, 0.1, 0.1, 0.1];
const JOINT_STEP: f64 = 0.02;
const SUBJECT_STEP: f64 = 0.01;
const FORCE_STEP: f64 = 10.0;
const MOMENT_STEP: f64 = 3.0;

fn collected(
    stretch: &Stretch,
    count: usize,
    column: impl Fn(usize) -> DVector<f64>,
) -> DMatrix<f64> {
    let mut matrix = DMatrix::zeros(stretch.grid.residuals(), count);
    for k in 0..count {
        matrix.set_column(k, &column(k));
    }
    matrix
}

/// Computes all derivatives of a stretch, whose residual is known, but those of effects. Returns `None` if a simulation
/// diverges.
pub(crate) fn linearized(
    track: &RecordedFlight,
    stretch: &Stretch,
    plain: &Model<f64>,
    point: &LinearizationPoint,
    residual: &DVector<f64>,
) -> Option<Jacobian> {
    let likely = point.start_in(stretch);
    let wrong = point.joints_in(stretch);
    let base = Simulator::new(track, stretch, &point.model(plain), &wrong, Steps::Long);
    let flown = base.residual(&likely, None);
    let start = collected(stretch, CHANNELS, |k| {
        let mut by = likely;
        by[k] += START_STEP[k];
        (&flown - base.residual(&by, None)) / START_STEP[k]
    });
    let joints = [0, 1, 2].map(|degree| {
        collected(stretch, JOINTS, |k| {
            let mut joints = wrong.clone();
            joints.course[degree][k] += JOINT_STEP;
            let other = base.with_joint(&joints, k / 3);
            (&flown - other.residual(&likely, None)) / JOINT_STEP
        })
    });
    let bends = bends(track, stretch);
    let bend = collected(stretch, JOINTS, |k| {
        let parts = joints.iter().zip(&bends);
        parts.map(|(matrix, bend)| matrix.column(k) * bend[k]).sum()
    });
    let effects = extended(plain, &point.effects);
    let subject = collected(stretch, SUBJECT, |k| {
        let mut subject = point.subject.clone();
        subject.0[k] += SUBJECT_STEP;
        let subject = subject.possible();
        let step = subject.0[k] - point.subject.0[k];
        if step == 0.0 {
            return DVector::zeros(stretch.grid.residuals());
        }
        let other = base.changed_to(&subject.of(&effects));
        (&flown - other.residual(&likely, None)) / step
    });
    let pushed = |force: f64, moment: f64| {
        collected(stretch, 3 * stretch.grid.rows, |k| {
            let mut axis = Vector3::zeros();
            axis[k % 3] = 1.0;
            let push = UnknownWrench {
                window: k / 3,
                force: axis * force,
                moment: axis * moment,
            };
            (&flown - base.residual(&likely, Some(push))) / (force + moment)
        })
    };
    let columns = Jacobian {
        residual: residual.clone(),
        gyro: gyro(track, stretch, &start),
        start,
        joints,
        bend,
        subject,
        force: pushed(FORCE_STEP, 0.0),
        moment: pushed(0.0, MOMENT_STEP),
    };
    columns.is_finite().then_some(columns)
}

/// The residual of a stretch.
pub(crate) fn residual(
    track: &RecordedFlight,
    stretch: &Stretch,
    plain: &Model<f64>,
    point: &LinearizationPoint,
) -> DVector<f64> {
    let model = point.model(plain);
    let joints = point.joints_in(stretch);
    let flight = Simulator::new(track, stretch, &model, &joints, Steps::Short);
    flight.residual(&point.start_in(stretch), None)
}

/// Derivatives with respect to some parameters.
pub(crate) fn effects_alone(
    track: &RecordedFlight,
    stretch: &Stretch,
    plain: &Model<f64>,
    point: &LinearizationPoint,
    parameters: &[ParameterId],
) -> DMatrix<f64> {
    if parameters.is_empty() {
        return DMatrix::zeros(stretch.grid.residuals(), 0);
    }
    let joints = point.joints_in(stretch);
    let base = Simulator::new(track, stretch, &point.model(plain), &joints, Steps::Long);
    let likely = point.start_in(stretch);
    let flown = base.residual(&likely, None);
    collected(stretch, parameters.len(), |k| {
        let (other, size) = changed(plain, &point.effects, parameters[k]);
        let flight = base.changed_to(&point.subject.of(&other));
        (&flown - flight.residual(&likely, None)) / size
    })
}

/// Derivatives with respect to effects that change at random, in each window. Returns `None` if there are none or a
/// derivative is not finite.
pub(crate) fn random_effects(
    track: &RecordedFlight,
    stretch: &Stretch,
    plain: &Model<f64>,
    point: &LinearizationPoint,
    effects: &EffectSet,
) -> Option<RandomEffectColumns> {
    if effects.is_empty() {
        return None;
    }
    let model = point.model(plain);
    let joints = point.joints_in(stretch);
    let base = Simulator::new(track, stretch, &model, &joints, Steps::Long);
    let likely = point.start_in(stretch);
    let flown = base.residual(&likely, None);
    let start = &stretch.start;
    let air = model.dynamics.air.velocity_at(&start.position);
    let through_air = (start.velocity_inertial() - air).components;
    let of = |(effect, _): &(Effect, [f64; 3])| Changes {
        effect: *effect,
        columns: collected(stretch, 3 * stretch.grid.rows, |k| {
            let (varied, size) = InputPerturbation::new(*effect, k / 3, k % 3);
            let other = base.with_varied(varied);
            (&flown - other.residual(&likely, None)) / size
        }),
    };
    RandomEffectColumns::new(effects.iter().map(of).collect(), through_air)
}

/// Derivatives with respect to the elements of the gyroscope's error matrix, including their effect on the start.
fn gyro(track: &RecordedFlight, stretch: &Stretch, start: &DMatrix<f64>) -> DMatrix<f64> {
    let window = stretch.grid.window;
    let spin = |frame: usize| track.samples[frame].motion.angular_velocity.components;
    collected(stretch, GYRO, |k| {
        let (to, from) = (k / 3, k % 3);
        let first = stretch.start.angular_velocity.components[from];
        let mut column = start.column(3 + to) * -first;
        for row in 0..stretch.grid.rows {
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
fn bends(track: &RecordedFlight, stretch: &Stretch) -> [Angles; 3] {
    let mut bends = [Angles::zeros(); 3];
    let mut norms = [0.0; 3];
    let rows = stretch.grid.rows;
    for k in 0..=rows {
        let bend = bend(&track.samples[stretch.first + k * stretch.grid.window].posture);
        let polynomials = legendre(2.0 * k as f64 / rows as f64 - 1.0);
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
