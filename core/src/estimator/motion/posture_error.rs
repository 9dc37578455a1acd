//! Effect of errors in the recorded joints on the loads, computed from the model; such errors cause the residual load.

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

use crate::aerodynamics::Flow;
use crate::body::mass_properties::PostureRate;
use crate::body::posture::Posture;
use crate::body::{Segment, SegmentArray};
use crate::dynamics::{Dynamics, Motion, PostureSample};
use crate::math::{Real, small_rotation};

/// Number of joint axes, three for each segment except the pelvis.
pub const JOINT_AXES: usize = 45;

/// Variance added to each component of a load's covariance (m4 for forces, m6 for moments).
const COVARIANCE_FLOOR: f64 = 1e-6;

/// Least dynamic pressure (Pa) by which the moment that rotation requires is divided: that of 10 m/s. In a slower flow
/// nothing is learned of the air's loads.
const LEAST_PRESSURE: f64 = 50.0;

/// Joint rotation over which the change of the loads is taken (rad).
const TURN: f64 = 0.03;

/// Sensitivity of force and moment, divided by the dynamic pressure, to an error of 1 rad in each joint axis, from the
/// aerodynamic loads alone, and the effect of the joints on the inertia.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PostureError<T: Real> {
    columns: [SVector<T, 6>; JOINT_AXES],
    covariance: SMatrix<T, 6, 6>,
    /// Covariance of the inertia (kg2 m4), in the order xx, xy, xz, yy, yz, zz, and the partial sum for the next one.
    inertia: [SMatrix<T, 6, 6>; 2],
    next: usize,
    /// Standard deviation of each segment's orientation relative to the pelvis (rad), if the segments are off, each on
    /// its own, instead of the joints.
    segments: Option<SegmentArray<T>>,
    /// Load and inertia of the posture whose joints are turned.
    base: [SVector<T, 6>; 2],
}

impl<T: Real> PostureError<T> {
    /// An empty value, before anything is computed.
    pub fn none() -> Self {
        Self {
            columns: [SVector::zeros(); JOINT_AXES],
            covariance: SMatrix::zeros(),
            inertia: [SMatrix::zeros(); 2],
            next: 0,
            segments: None,
            base: [SVector::zeros(); 2],
        }
    }

    /// Takes errors of segments, each on its own, instead of those of joints: standard deviations relative to the pelvis,
    /// each axis, as multiples of 1 rad. A segment that is off leaves those beyond it where they are.
    pub fn set_segments(&mut self, deviations: &SegmentArray<T>) {
        self.segments = Some(*deviations);
        self.next = 0;
        self.inertia[1] = SMatrix::zeros();
    }

    /// Whether segments are off, each on its own, instead of joints.
    pub fn is_of_segments(&self) -> bool {
        self.segments.is_some()
    }

    /// Covariance of the aerodynamic load divided by the dynamic pressure (m4 for the force, m6 for the moment), if
    /// every joint axis has a standard deviation of 1 rad, or every segment that of [`PostureError::set_segments`].
    pub fn covariance(&self) -> &SMatrix<T, 6, 6> {
        &self.covariance
    }

    /// Covariance of the moment that the body's rotation requires, divided by the dynamic pressure (m6), if every joint
    /// axis has a standard deviation of 1 rad. In fast turns it exceeds the covariance of the aerodynamic moment.
    pub fn turning_covariance(&self, dynamics: &Dynamics<T>, motion: &Motion<T>) -> Matrix3<T> {
        let spin = motion.angular_velocity.components;
        let pressure = flow(dynamics, motion).dynamic_pressure;
        let least = T::of(LEAST_PRESSURE);
        let scale = T::one() / if pressure > least { pressure } else { least };
        let mut by_inertia = SMatrix::<T, 3, 6>::zeros();
        for k in 0..6 {
            let mut unit = SVector::<T, 6>::zeros();
            unit[k] = scale;
            by_inertia.set_column(k, &turning(&matrix(&unit), &spin));
        }
        by_inertia * self.inertia[0] * by_inertia.transpose()
    }

    /// Recomputes all axes for a body that holds `posture` and moves as `motion`. `sample` is scratch space.
    pub fn renew(
        &mut self,
        dynamics: &Dynamics<T>,
        posture: &Posture<T>,
        motion: &Motion<T>,
        sample: &mut PostureSample<T>,
    ) {
        self.next = 0;
        self.see(dynamics, posture, motion, sample);
        for _ in 0..JOINT_AXES {
            self.see_turned(dynamics, posture, motion, sample);
        }
    }

    /// Recomputes the next axis in cyclic order. `sample` is scratch space.
    #[inline(always)]
    pub fn renew_next(
        &mut self,
        dynamics: &Dynamics<T>,
        posture: &Posture<T>,
        motion: &Motion<T>,
        sample: &mut PostureSample<T>,
    ) {
        self.see(dynamics, posture, motion, sample);
        self.see_turned(dynamics, posture, motion, sample);
    }

    /// Computes the effect of the posture itself. This and the next one are out of line, one after the other, so that
    /// their frames do not add up on a unit's stack.
    #[inline(never)]
    fn see(
        &mut self,
        dynamics: &Dynamics<T>,
        posture: &Posture<T>,
        motion: &Motion<T>,
        sample: &mut PostureSample<T>,
    ) {
        dynamics.sample_into(posture, &PostureRate::zero(), sample);
        self.base = [
            aerodynamic(dynamics, motion, sample),
            numbers(&sample.inertia),
        ];
    }

    /// Computes that of the posture with the next axis turned, and so that of the axis.
    #[inline(never)]
    fn see_turned(
        &mut self,
        dynamics: &Dynamics<T>,
        posture: &Posture<T>,
        motion: &Motion<T>,
        sample: &mut PostureSample<T>,
    ) {
        let index = self.next;
        self.next = (index + 1) % JOINT_AXES;
        dynamics.sample_into(&turned(posture, index), &PostureRate::zero(), sample);
        let [load, inertia] = self.base;
        let column = (aerodynamic(dynamics, motion, sample) - load) / T::of(TURN);
        let mut inertia = (numbers(&sample.inertia) - inertia) / T::of(TURN);
        if let Some(segments) = &self.segments {
            inertia *= segments[segment_of(index)];
        }
        self.keep(index, &column, &inertia);
        if self.next == 0
            && let Some(segments) = &self.segments
        {
            self.covariance = covariance_of_segments(&self.columns, posture, segments);
        }
    }

    /// Stores the effect of an axis. Kept out of line, because a unit's stack cannot hold both this and the
    /// computation.
    #[inline(never)]
    fn keep(&mut self, index: usize, column: &SVector<T, 6>, inertia: &SVector<T, 6>) {
        if column.iter().all(|v| v.is_finite()) {
            self.columns[index] = *column;
        }
        self.inertia[1] += inertia * inertia.transpose();
        if self.next == 0 {
            self.covariance = covariance_of(&self.columns);
            let summed = core::mem::replace(&mut self.inertia[1], SMatrix::zeros());
            if summed.iter().all(|v| v.is_finite()) {
                self.inertia[0] = summed;
            }
        }
    }
}

/// Load ([`load`]) per radian of error in each joint axis: three consecutive columns per segment, in the order of
/// [`Segment::ALL`] without the pelvis.
pub fn columns<T: Real>(
    dynamics: &Dynamics<T>,
    posture: &Posture<T>,
    motion: &Motion<T>,
    sample: &mut PostureSample<T>,
) -> [SVector<T, 6>; JOINT_AXES] {
    let base = load(dynamics, posture, motion, sample);
    core::array::from_fn(|index| {
        let turned = turned(posture, index);
        (load(dynamics, &turned, motion, sample) - base) / T::of(TURN)
    })
}

/// Load per standard deviation of each segment about its axes, from the load per radian of each joint axis ([`columns`]):
/// turning a segment on its own turns the joints beyond it back.
pub fn of_segments<T: Real>(
    columns: &[SVector<T, 6>; JOINT_AXES],
    posture: &Posture<T>,
    deviations: &SegmentArray<T>,
) -> [SVector<T, 6>; JOINT_AXES] {
    core::array::from_fn(|index| of_segment(columns, posture, deviations, index))
}

/// One of [`of_segments`].
fn of_segment<T: Real>(
    columns: &[SVector<T, 6>; JOINT_AXES],
    posture: &Posture<T>,
    deviations: &SegmentArray<T>,
    index: usize,
) -> SVector<T, 6> {
    let segment = segment_of(index);
    let mut found = columns[index];
    for (child, beyond) in Segment::ALL.into_iter().skip(1).enumerate() {
        if beyond.parent() != Some(segment) {
            continue;
        }
        let turn = posture.parent_from_segment(beyond).to_rotation_matrix();
        for own in 0..3 {
            found -= columns[3 * child + own] * turn[(index % 3, own)];
        }
    }
    found * deviations[segment]
}

/// Covariance of a load if the segments are off, each on its own. Kept out of line and without a copy of the columns,
/// because of the unit's stack.
#[inline(never)]
fn covariance_of_segments<T: Real>(
    columns: &[SVector<T, 6>; JOINT_AXES],
    posture: &Posture<T>,
    deviations: &SegmentArray<T>,
) -> SMatrix<T, 6, 6> {
    let mut covariance = SMatrix::<T, 6, 6>::zeros();
    for index in 0..JOINT_AXES {
        let column = of_segment(columns, posture, deviations, index);
        covariance += column * column.transpose();
    }
    invertible(covariance)
}

/// The posture with each segment turned on its own, by angles about its axes (rad), three for each segment in the order
/// of [`columns`].
pub fn with_turned_segments<T: Real>(
    posture: &Posture<T>,
    turns: &SVector<T, JOINT_AXES>,
) -> Posture<T> {
    let mut body_from_segments = posture.body_from_segments();
    for (joint, segment) in Segment::ALL.into_iter().skip(1).enumerate() {
        let turn = small_rotation(&turns.fixed_rows::<3>(3 * joint).into_owned());
        body_from_segments[segment] *= turn;
    }
    Posture::from_body_rotations(&body_from_segments)
}

/// Segment of a joint axis.
fn segment_of(index: usize) -> Segment {
    Segment::ALL[1 + index / 3]
}

/// Covariance of a load if every joint axis has a standard deviation of 1 rad.
pub fn covariance_of<T: Real>(columns: &[SVector<T, 6>; JOINT_AXES]) -> SMatrix<T, 6, 6> {
    let mut covariance = SMatrix::<T, 6, 6>::zeros();
    for column in columns {
        covariance += column * column.transpose();
    }
    invertible(covariance)
}

/// Keeps the covariance invertible if no joint affects a component.
#[inline(always)]
fn invertible<T: Real>(mut covariance: SMatrix<T, 6, 6>) -> SMatrix<T, 6, 6> {
    for k in 0..6 {
        covariance[(k, k)] += T::of(COVARIANCE_FLOOR);
    }
    covariance
}

/// Force and moment about the centre of gravity divided by the dynamic pressure (m2, m3) for a posture in motion,
/// minus the moment that the body's rotation requires. `sample` is scratch space.
pub fn load<T: Real>(
    dynamics: &Dynamics<T>,
    posture: &Posture<T>,
    motion: &Motion<T>,
    sample: &mut PostureSample<T>,
) -> SVector<T, 6> {
    dynamics.sample_into(posture, &PostureRate::zero(), sample);
    let mut load = aerodynamic(dynamics, motion, sample);
    let scale = T::one() / flow(dynamics, motion).dynamic_pressure;
    let turning = turning(&sample.inertia, &motion.angular_velocity.components) * scale;
    let mut moment = load.fixed_rows_mut::<3>(3);
    moment -= turning;
    load
}

/// Returns a posture with one joint axis rotated.
#[inline(never)]
fn turned<T: Real>(posture: &Posture<T>, axis: usize) -> Posture<T> {
    let segment = segment_of(axis);
    let mut turn = Vector3::zeros();
    turn[axis % 3] = T::of(TURN);
    posture.with(
        segment,
        posture.parent_from_segment(segment) * small_rotation(&turn),
    )
}

/// Moment that rotation at `spin` requires (N m).
fn turning<T: Real>(inertia: &Matrix3<T>, spin: &Vector3<T>) -> Vector3<T> {
    spin.cross(&(inertia * spin))
}

fn numbers<T: Real>(m: &Matrix3<T>) -> SVector<T, 6> {
    SVector::from([
        m[(0, 0)],
        m[(0, 1)],
        m[(0, 2)],
        m[(1, 1)],
        m[(1, 2)],
        m[(2, 2)],
    ])
}

fn matrix<T: Real>(n: &SVector<T, 6>) -> Matrix3<T> {
    Matrix3::new(n[0], n[1], n[2], n[1], n[3], n[4], n[2], n[4], n[5])
}

fn flow<T: Real>(dynamics: &Dynamics<T>, motion: &Motion<T>) -> Flow<T> {
    let air = dynamics.air.velocity_at(&motion.position);
    let velocity = motion.velocity - motion.inertial_from_body.inverse() * air;
    let density = dynamics.air.density.at(motion.position.up());
    Flow::new(&velocity.components, density)
}

/// Aerodynamic load divided by the dynamic pressure.
fn aerodynamic<T: Real>(
    dynamics: &Dynamics<T>,
    motion: &Motion<T>,
    sample: &PostureSample<T>,
) -> SVector<T, 6> {
    let flow = flow(dynamics, motion);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::pattern;
    use crate::frame::{Vector, facing_north};
    use crate::test_body::reference_body;

    fn falling() -> (Dynamics<f64>, Motion<f64>) {
        let dynamics = Dynamics::paper(reference_body(), 1.0);
        let inertial_from_body = facing_north(1.4);
        let motion = Motion {
            inertial_from_body,
            position: Vector::zero(),
            velocity: inertial_from_body.inverse() * Vector::new(3.0, 1.0, -50.0),
            angular_velocity: Vector::new(0.2, 0.1, -0.3),
        };
        (dynamics, motion)
    }

    /// A thigh that is off by itself changes the load as a hip turned one way with the knee turned back.
    #[test]
    fn a_segment_that_is_off_leaves_those_beyond_it() {
        let (dynamics, motion) = falling();
        let posture = pattern::neutral::<f64>();
        let mut sample = PostureSample::blank();
        let joints = columns(&dynamics, &posture, &motion, &mut sample);
        let deviations = SegmentArray::from_fn(|_| 1.0);
        let found = of_segments(&joints, &posture, &deviations);
        let base = load(&dynamics, &posture, &motion, &mut sample);
        for index in [0, 6, 27, 28, 30, 44] {
            let mut turns = SVector::zeros();
            turns[index] = TURN;
            let off = with_turned_segments(&posture, &turns);
            let expected = (load(&dynamics, &off, &motion, &mut sample) - base) / TURN;
            let gap = (found[index] - expected).norm();
            assert!(gap < 0.1 * expected.norm() + 2e-3, "{index}: {gap}");
        }
    }

    #[test]
    fn certain_segments_add_nothing_to_the_residual_load() {
        let (dynamics, motion) = falling();
        let posture = pattern::neutral::<f64>();
        let size = |deviation: f64| {
            let mut sample = PostureSample::blank();
            let mut error = PostureError::none();
            error.set_segments(&SegmentArray::from_fn(|segment| {
                if segment == Segment::LeftThigh {
                    3.0
                } else {
                    deviation
                }
            }));
            error.renew(&dynamics, &posture, &motion, &mut sample);
            let turning = error.turning_covariance(&dynamics, &motion);
            (error.covariance().trace(), turning.trace())
        };
        let (thigh, whole) = (size(0.0), size(3.0));
        assert!(
            thigh.0 > 1e-3 && thigh.0 < 0.5 * whole.0,
            "{thigh:?} {whole:?}"
        );
        assert!(
            thigh.1 > 0.0 && thigh.1 < 0.5 * whole.1,
            "{thigh:?} {whole:?}"
        );
    }
}
