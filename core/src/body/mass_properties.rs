//! Whole-body mass, centre of gravity and inertia, their rates as the limbs move, and the momenta of the segments
//! relative to the body frame.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use super::posture::{PosedSegment, Posture, near};
use super::{Body, Segment, SegmentArray, SegmentParameters};
use crate::math::{Lanes, cross_columns, outer, point_inertia, small_rotation, usually};

/// Mass properties of a posed body, in body axes with the origin at the pelvic joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MassProperties<T: Lanes> {
    /// Mass (kg).
    pub mass: T,
    /// Position of the centre of gravity (m), paper eq. (cg1).
    pub cg: Vector3<T>,
    /// Inertia about the origin (kg m2), paper eq. (cg2) with distances measured from the origin, see model.md
    /// "Equations of motion".
    pub inertia_about_origin: Matrix3<T>,
}

impl<T: Lanes> MassProperties<T> {
    /// Sums over the posed segments of `body`.
    pub fn of(body: &Body<T>, posed: &SegmentArray<PosedSegment<T>>) -> Self {
        let mut sum = Self::none();
        for segment in Segment::ALL {
            let (parameters, placed) = (&body.segments[segment], &posed[segment]);
            let inertia = body_inertia(&parameters.inertia, &placed.body_from_segment);
            sum.add(&MassShare::of(parameters, placed, &inertia));
        }
        sum.divided()
    }

    fn none() -> Self {
        Self {
            mass: T::zero(),
            cg: Vector3::zeros(),
            inertia_about_origin: Matrix3::zeros(),
        }
    }

    /// Adds a segment; until [`MassProperties::divided`], `cg` is the first moment.
    #[inline(always)]
    fn add(&mut self, share: &MassShare<T>) {
        self.mass += share.mass;
        self.cg += share.first_moment;
        self.inertia_about_origin += share.inertia;
    }

    fn divided(mut self) -> Self {
        self.cg /= self.mass;
        self
    }

    /// Returns the inertia about the centre of gravity (kg m2).
    pub fn inertia_about_cg(&self) -> Matrix3<T> {
        self.inertia_about_origin - point_inertia(self.mass, &self.cg)
    }
}

/// Joint motion: angular velocity of each segment relative to its parent, in the parent's axes (rad/s).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PostureRate<T: Lanes>(pub SegmentArray<Vector3<T>>);

impl<T: Lanes> PostureRate<T> {
    /// Rates of a body whose joints are at rest.
    pub fn zero() -> Self {
        Self(SegmentArray::from_fn(|_| Vector3::zeros()))
    }

    /// Returns the constant rates that take `from` to `to` in `duration` (s), each joint along the shorter arc.
    ///
    /// Uses the series of the arc sine instead of trigonometry, accurate to 1e-5 of the rate for 0.5 rad per step.
    pub fn between(from: &Posture<T>, to: &Posture<T>, duration: T) -> Self {
        let scale = T::of(2.0) / duration;
        Self(SegmentArray::from_fn(|segment| {
            let start = from.parent_from_segment(segment);
            joint_rate(start, to.parent_from_segment(segment), scale)
        }))
    }

    /// Sets one of the rates of [`PostureRate::between`], from the joint's rotations.
    pub fn set_between(
        &mut self,
        segment: Segment,
        from: &UnitQuaternion<T>,
        to: &UnitQuaternion<T>,
        duration: T,
    ) {
        self.0[segment] = joint_rate(from, to, T::of(2.0) / duration);
    }

    /// Returns the posture a short time (s) before `posture` if the joints have moved at these rates.
    pub fn posture_before(&self, posture: &Posture<T>, time: T) -> Posture<T> {
        let mut before = *posture;
        for (segment, rate) in self.0.iter() {
            let back: UnitQuaternion<T> = small_rotation(&(rate * -time));
            before.set(segment, back * posture.parent_from_segment(segment));
        }
        before
    }
}

/// Rate of a joint, given two over the duration.
#[inline(always)]
fn joint_rate<T: Lanes>(
    start: &UnitQuaternion<T>,
    end: &UnitQuaternion<T>,
    scale: T,
) -> Vector3<T> {
    let end: UnitQuaternion<T> = near(end, start);
    let half_turn = (*end * start.conjugate().into_inner())
        .vector()
        .into_owned();
    let square = half_turn.norm_squared();
    let series = T::one() + square * (T::of(1.0 / 6.0) + square * T::of(3.0 / 40.0));
    half_turn * (series * scale)
}

/// What a segment adds to [`MassProperties`], about the origin.
#[derive(Debug, Clone, Copy)]
struct MassShare<T: Lanes> {
    mass: T,
    first_moment: Vector3<T>,
    inertia: Matrix3<T>,
}

impl<T: Lanes> MassShare<T> {
    /// Of a segment with this `inertia` in body axes.
    #[inline(always)]
    fn of(
        parameters: &SegmentParameters<T>,
        placed: &PosedSegment<T>,
        inertia: &Matrix3<T>,
    ) -> Self {
        Self {
            mass: parameters.mass,
            first_moment: placed.cg * parameters.mass,
            inertia: inertia + point_inertia(parameters.mass, &placed.cg),
        }
    }
}

/// How a segment moves relative to the body frame.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SegmentMotion<T: Lanes> {
    joint_velocity: Vector3<T>,
    angular_velocity: Vector3<T>,
}

impl<T: Lanes> SegmentMotion<T> {
    /// The root, which is the body frame.
    pub(crate) fn none() -> Self {
        Self {
            joint_velocity: Vector3::zeros(),
            angular_velocity: Vector3::zeros(),
        }
    }

    /// Sets the motion of a segment from that of its parent; the root's stays.
    #[inline(always)]
    pub(crate) fn follow(
        moving: &mut SegmentArray<Self>,
        segment: Segment,
        posed: &SegmentArray<PosedSegment<T>>,
        rate: &PostureRate<T>,
    ) {
        if let Some(parent) = segment.parent() {
            let of_parent = (&posed[parent], &moving[parent]);
            moving[segment] = Self::of(&posed[segment], of_parent, &rate.0[segment]);
        }
    }

    /// Of a segment whose joint turns at `rate`, given its parent with the parent's motion.
    #[inline(always)]
    fn of(
        placed: &PosedSegment<T>,
        (parent, motion): (&PosedSegment<T>, &Self),
        rate: &Vector3<T>,
    ) -> Self {
        let spin = motion.angular_velocity;
        Self {
            joint_velocity: motion.joint_velocity + spin.cross(&(placed.joint - parent.joint)),
            angular_velocity: spin + parent.body_from_segment * rate,
        }
    }
}

/// What a moving segment adds to mass properties and mass motion.
#[derive(Debug, Clone, Copy)]
pub(crate) struct MovingShare<T: Lanes> {
    mass: MassShare<T>,
    momentum: Vector3<T>,
    angular_momentum: Vector3<T>,
    inertia_rate: Matrix3<T>,
}

impl<T: Lanes> MovingShare<T> {
    #[inline(always)]
    pub(crate) fn of(
        parameters: &SegmentParameters<T>,
        placed: &PosedSegment<T>,
        motion: &SegmentMotion<T>,
    ) -> Self {
        let spin = motion.angular_velocity;
        let velocity = motion.joint_velocity + spin.cross(&(placed.cg - placed.joint));
        let inertia = body_inertia(&parameters.inertia, &placed.body_from_segment);
        let momentum = velocity * parameters.mass;
        let turning = cross_columns(&spin, &inertia);
        let pull = outer_pair(&placed.cg, &momentum);
        Self {
            mass: MassShare::of(parameters, placed, &inertia),
            momentum,
            angular_momentum: placed.cg.cross(&momentum) + inertia * spin,
            inertia_rate: turning
                + turning.transpose()
                + Matrix3::from_diagonal_element(pull.trace())
                - pull,
        }
    }
}

/// Sum over the segments, of which each is added in the order of [`Segment::ALL`].
#[derive(Debug, Clone, Copy)]
pub(crate) struct MovingSum<T: Lanes> {
    properties: MassProperties<T>,
    motion: MassMotion<T>,
}

impl<T: Lanes> MovingSum<T> {
    pub(crate) fn none() -> Self {
        Self {
            properties: MassProperties::none(),
            motion: MassMotion::zero(),
        }
    }

    #[inline(always)]
    pub(crate) fn add(&mut self, share: &MovingShare<T>) {
        self.properties.add(&share.mass);
        self.motion.cg_rate += share.momentum;
        self.motion.relative_angular_momentum += share.angular_momentum;
        self.motion.inertia_rate += share.inertia_rate;
    }

    pub(crate) fn done(mut self) -> (MassProperties<T>, MassMotion<T>) {
        self.motion.cg_rate /= self.properties.mass;
        (self.properties.divided(), self.motion)
    }
}

/// How mass moves within the body frame; rates are component rates in body axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MassMotion<T: Lanes> {
    /// Rate of the centre of gravity (m/s).
    pub cg_rate: Vector3<T>,
    /// Rate of the inertia about the origin (kg m2/s).
    pub inertia_rate: Matrix3<T>,
    /// Angular momentum of the segments relative to the body frame, about the origin (kg m2/s); h in model.md.
    pub relative_angular_momentum: Vector3<T>,
}

impl<T: Lanes> MassMotion<T> {
    /// Mass motion of a body whose joints are at rest.
    pub fn zero() -> Self {
        Self {
            cg_rate: Vector3::zeros(),
            inertia_rate: Matrix3::zeros(),
            relative_angular_momentum: Vector3::zeros(),
        }
    }

    /// Computes the mass motion of a posed body from its joint rates.
    pub fn of(
        body: &Body<T>,
        posed: &SegmentArray<PosedSegment<T>>,
        rate: &PostureRate<T>,
    ) -> Self {
        Self::with_properties(body, posed, rate).1
    }

    /// Computes mass properties and mass motion in one pass, which share the inertia of each segment.
    pub fn with_properties(
        body: &Body<T>,
        posed: &SegmentArray<PosedSegment<T>>,
        rate: &PostureRate<T>,
    ) -> (MassProperties<T>, Self) {
        let mut sum = MovingSum::none();
        let mut moving = SegmentArray::from_fn(|_| SegmentMotion::<T>::none());
        for segment in Segment::ALL {
            let placed = &posed[segment];
            SegmentMotion::follow(&mut moving, segment, posed, rate);
            let parameters = &body.segments[segment];
            sum.add(&MovingShare::of(parameters, placed, &moving[segment]));
        }
        sum.done()
    }

    /// Angular momentum of the segments relative to a frame that moves with the centre of gravity and rotates with the
    /// body (kg m2/s).
    pub fn relative_angular_momentum_about_cg(&self, properties: &MassProperties<T>) -> Vector3<T> {
        self.relative_angular_momentum - properties.cg.cross(&(self.cg_rate * properties.mass))
    }
}

/// Inertia of a segment in body axes, by the similarity transformation of paper eq. (cg2).
fn body_inertia<T: Lanes>(inertia: &Matrix3<T>, body_from_segment: &Matrix3<T>) -> Matrix3<T> {
    let is_zero = |element: T| element.simd_eq(T::zero());
    usually(
        is_zero(inertia.m21) & is_zero(inertia.m31) & is_zero(inertia.m32),
        || {
            // Principal axes are the usual case: a sum of three outer products.
            let axis = |k: usize| body_from_segment.column(k).into_owned();
            outer(&axis(0), inertia.m11)
                + outer(&axis(1), inertia.m22)
                + outer(&axis(2), inertia.m33)
        },
        || body_from_segment * inertia * body_from_segment.transpose(),
    )
}

/// `a b^T + b a^T`.
fn outer_pair<T: Lanes>(a: &Vector3<T>, b: &Vector3<T>) -> Matrix3<T> {
    let product = a * b.transpose();
    product + product.transpose()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::posture::pose;
    use crate::test_body::{any_posture, reference_body};
    use proptest::prelude::*;

    const STEP: f64 = 1e-5;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn rates_are_the_slopes_of_the_sums(a in any_posture(), b in any_posture()) {
            // GIVEN a body moving from near `a` towards `b`
            let body = reference_body();
            let (before, after) = (a.interpolated(&b, 0.3 - STEP), a.interpolated(&b, 0.3 + STEP));
            let middle = pose(&body, &a.interpolated(&b, 0.3));
            // WHEN its joint rates are taken over a short time (2e-5 s of a one-second motion)
            let rate = PostureRate::between(&before, &after, 2.0 * STEP);
            let motion = MassMotion::of(&body, &middle, &rate);
            // THEN the sums change at these rates
            let sums = |posture| MassProperties::of(&body, &pose(&body, posture));
            let (start, end) = (sums(&before), sums(&after));
            let cg_rate = (end.cg - start.cg) / (2.0 * STEP);
            prop_assert!((cg_rate - motion.cg_rate).norm() < 1e-6);
            let inertia_rate =
                (end.inertia_about_origin - start.inertia_about_origin) / (2.0 * STEP);
            prop_assert!((inertia_rate - motion.inertia_rate).norm() < 1e-5);
        }

        #[test]
        fn relative_angular_momentum_is_that_of_moving_points(a in any_posture(), b in any_posture()) {
            // Each segment is represented by six equal point masses with the same total mass and inertia.
            let body = reference_body();
            let (before, after) = (a.interpolated(&b, 0.3 - STEP), a.interpolated(&b, 0.3 + STEP));
            let rate = PostureRate::between(&before, &after, 2.0 * STEP);
            let motion = MassMotion::of(&body, &pose(&body, &a.interpolated(&b, 0.3)), &rate);
            let (start, end) = (pose(&body, &before), pose(&body, &after));
            let mut sum = Vector3::zeros();
            for (segment, parameters) in body.segments.iter() {
                let (i, m) = (parameters.inertia.diagonal(), parameters.mass);
                for axis in 0..3 {
                    let spread = 3.0 * (0.5 * i.sum() - i[axis]) / m;
                    assert!(spread >= 0.0, "{segment:?} is not a solid");
                    for sign in [-1.0, 1.0] {
                        let mut local = parameters.cg;
                        local[axis] += sign * libm::sqrt(spread);
                        let place = |posed: &SegmentArray<PosedSegment<f64>>| {
                            posed[segment].joint + posed[segment].body_from_segment * local
                        };
                        let (p, q) = (place(&start), place(&end));
                        sum += (p + q).cross(&(q - p)) * (m / 6.0 / (4.0 * STEP));
                    }
                }
            }
            prop_assert!((sum - motion.relative_angular_momentum).norm() < 1e-5);
        }
    }

    #[test]
    fn inertia_about_the_cg_is_the_smallest() {
        let body = reference_body();
        let properties = MassProperties::of(&body, &pose(&body, &Posture::h_pose()));
        let difference = properties.inertia_about_origin - properties.inertia_about_cg();
        assert!(difference.diagonal().min() >= 0.0);
        let expected = outer(&properties.cg, -properties.mass);
        assert!((difference.m21 - expected.m21).abs() < 1e-12);
    }
}
