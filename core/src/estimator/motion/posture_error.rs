//! What joints that are recorded a little off do to the loads: the source of the residual load, from the model.

use nalgebra::{SMatrix, SVector, Vector3};

use crate::aerodynamics::Flow;
use crate::body::Segment;
use crate::body::mass_properties::PostureRate;
use crate::body::posture::Posture;
use crate::dynamics::{Dynamics, PostureSample};
use crate::math::{Real, small_rotation};

/// Joint axes, three for each segment but the pelvis.
pub const JOINT_AXES: usize = 45;

/// Variance of each component besides (m4, m6).
const COVARIANCE_FLOOR: f64 = 1e-6;

/// Turn of a joint by which the loads are compared (rad).
const TURN: f64 = 0.03;

/// Force and moment over the dynamic pressure for each joint axis that is off by 1 rad.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PostureError<T: Real> {
    columns: [SVector<T, 6>; JOINT_AXES],
    covariance: SMatrix<T, 6, 6>,
    next: usize,
}

impl<T: Real> PostureError<T> {
    /// Nothing yet.
    pub fn none() -> Self {
        Self {
            columns: [SVector::zeros(); JOINT_AXES],
            covariance: SMatrix::zeros(),
            next: 0,
        }
    }

    /// Force and moment over the dynamic pressure for each joint axis that is off by 1 rad: those of a segment in a
    /// row, in the order of [`Segment::ALL`] without the pelvis.
    pub fn columns(&self) -> &[SVector<T, 6>; JOINT_AXES] {
        &self.columns
    }

    /// Covariance of the residual load where every joint axis has a deviation of 1 rad.
    pub fn covariance(&self) -> &SMatrix<T, 6, 6> {
        &self.covariance
    }

    /// All axes anew, for a posture in the stream of `velocity` (m/s, through the air, body axes).
    pub fn renew(
        &mut self,
        dynamics: &Dynamics<T>,
        posture: &Posture<T>,
        velocity: &Vector3<T>,
        sample: &mut PostureSample<T>,
    ) {
        self.next = 0;
        let base = load(dynamics, posture, velocity, sample);
        for _ in 0..JOINT_AXES {
            self.turn_next(dynamics, posture, velocity, &base, sample);
        }
    }

    /// One axis anew, the next in turn. `sample` is a place to work in.
    pub fn renew_next(
        &mut self,
        dynamics: &Dynamics<T>,
        posture: &Posture<T>,
        velocity: &Vector3<T>,
        sample: &mut PostureSample<T>,
    ) {
        let base = load(dynamics, posture, velocity, sample);
        self.turn_next(dynamics, posture, velocity, &base, sample);
    }

    fn turn_next(
        &mut self,
        dynamics: &Dynamics<T>,
        posture: &Posture<T>,
        velocity: &Vector3<T>,
        base: &SVector<T, 6>,
        sample: &mut PostureSample<T>,
    ) {
        let index = self.next;
        self.next = (index + 1) % JOINT_AXES;
        let segment = Segment::ALL[1 + index / 3];
        let mut turn = Vector3::zeros();
        turn[index % 3] = T::of(TURN);
        let joint = posture.parent_from_segment(segment) * small_rotation(&turn);
        let turned = posture.with(segment, joint);
        let column = (load(dynamics, &turned, velocity, sample) - base) / T::of(TURN);
        if column.iter().all(|v| v.is_finite()) {
            self.columns[index] = column;
        }
        if self.next == 0 {
            let mut covariance = SMatrix::<T, 6, 6>::zeros();
            for column in &self.columns {
                covariance += column * column.transpose();
            }
            // So that it has an inverse where no joint moves some load.
            for k in 0..6 {
                covariance[(k, k)] += T::of(COVARIANCE_FLOOR);
            }
            self.covariance = covariance;
        }
    }
}

/// Force, and moment about the centre of gravity, over the dynamic pressure (m2, m3) of a posture in the stream of `velocity`
/// (m/s, through the air, body axes). `sample` is a place to work in.
pub fn load<T: Real>(
    dynamics: &Dynamics<T>,
    posture: &Posture<T>,
    velocity: &Vector3<T>,
    sample: &mut PostureSample<T>,
) -> SVector<T, 6> {
    dynamics.sample_into(posture, &PostureRate::zero(), sample);
    let flow = Flow::new(velocity, T::one());
    let loads = sample.aerodynamics.total_load(&flow);
    let scale = T::one() / flow.dynamic_pressure;
    let moment = loads.moment - sample.mass.cg.cross(&loads.force);
    let mut column = SVector::<T, 6>::zeros();
    column
        .fixed_rows_mut::<3>(0)
        .copy_from(&(loads.force * scale));
    column.fixed_rows_mut::<3>(3).copy_from(&(moment * scale));
    column
}
