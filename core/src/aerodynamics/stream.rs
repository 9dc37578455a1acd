//! Local deviations of the airstream at single segments, which the paper's model leaves out.
//!
//! All are off unless an [effect](crate::effect) turns them on. Loads are then summed segment by segment, each with
//! its own local airstream, instead of using the compiled sums.

use nalgebra::{SimdBool, Vector3};

use super::{ExposedSegment, Flow, Loads};
use crate::body::{Segment, SegmentArray};
use crate::math::{Lanes, Real};

/// Speed at which the drag coefficients apply unchanged (m/s), see [`Stream::reynolds`].
pub const REYNOLDS_SPEED: f64 = 50.0;

/// Distance from the line of the airstream through the trunk at which half the shelter remains (m).
pub const SHELTER_WIDTH: f64 = 0.25;

/// Distance behind the middle of the trunk at which the shelter reaches half its value (m): half the depth of a chest.
pub const SHELTER_DEPTH: f64 = 0.1;

/// Deviations of the local airstream; zero means none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stream<T> {
    /// Share of the velocity `spin x r` due to the body's rotation that a segment experiences; at zero the rotation is
    /// ignored.
    pub rotation: T,
    /// Exponent `n` of the drag coefficients, which vary with the speed as `(speed / REYNOLDS_SPEED)^-n`.
    pub reynolds: T,
    /// Share of its load that a segment directly behind the trunk loses.
    pub shelter: T,
    /// Time by which the loads lag behind the joints (s).
    pub lag: T,
}

impl<T: Lanes> Stream<T> {
    /// The paper's assumption: the same airstream for all segments.
    pub fn uniform() -> Self {
        Self {
            rotation: T::zero(),
            reynolds: T::zero(),
            shelter: T::zero(),
            lag: T::zero(),
        }
    }

    /// Returns whether all segments experience the same airstream; a lag is allowed.
    #[inline]
    pub fn is_uniform(&self) -> bool {
        let zero = T::zero();
        self.rotation == zero && self.reynolds == zero && self.shelter == zero
    }

    /// Converts the values to another precision.
    pub fn cast<U: Lanes>(&self) -> Stream<U>
    where
        T: Real,
    {
        let scalar = |value: T| U::of(value.to_f64());
        Stream {
            rotation: scalar(self.rotation),
            reynolds: scalar(self.reynolds),
            shelter: scalar(self.shelter),
            lag: scalar(self.lag),
        }
    }

    /// Sums force and moment of all segments, each in its local airstream.
    ///
    /// `velocity` through the air (m/s) and `spin` (rad/s) are in body axes; `density` is in kg/m3.
    #[cold]
    #[inline(never)]
    pub fn total_load(
        &self,
        segments: &SegmentArray<ExposedSegment<T>>,
        velocity: &Vector3<T>,
        spin: &Vector3<T>,
        density: T,
    ) -> Loads<T> {
        let mut sum = Loads {
            exposed_area: T::zero(),
            force: Vector3::zeros(),
            moment: Vector3::zeros(),
        };
        let loads = self.segment_loads(segments, velocity, spin, density);
        for load in loads.values() {
            sum.exposed_area += load.exposed_area;
            sum.force += load.force;
            sum.moment += load.moment;
        }
        sum
    }

    /// The loads that [`Stream::total_load`] sums, by segment.
    pub fn segment_loads(
        &self,
        segments: &SegmentArray<ExposedSegment<T>>,
        velocity: &Vector3<T>,
        spin: &Vector3<T>,
        density: T,
    ) -> SegmentArray<Loads<T>> {
        let direction = Flow::new(velocity, density).direction;
        let trunk = segments[Segment::Thorax].centre;
        segments.map(|segment, exposed| {
            let local = velocity + spin.cross(&exposed.centre) * self.rotation;
            let flow = Flow::new(&local, density);
            let mut felt = *exposed;
            felt.drag *= self.drag_factor(&local);
            let load = felt.load(&flow.direction);
            let pressure = flow.dynamic_pressure
                * self.unsheltered(segment, &exposed.centre, &trunk, &direction);
            Loads {
                exposed_area: load.exposed_area,
                force: load.force * pressure,
                moment: load.moment * pressure,
            }
        })
    }

    /// Ratio of the drag coefficient to that at [`REYNOLDS_SPEED`].
    fn drag_factor(&self, velocity: &Vector3<T>) -> T {
        let ratio = velocity.norm_squared() * T::of(1.0 / (REYNOLDS_SPEED * REYNOLDS_SPEED));
        // At rest the exponent is meaningless, and there is no force.
        let none = self.reynolds.simd_eq(T::zero()) | ratio.simd_lt(T::of(1e-4));
        none.if_else(T::one, || ratio.power(self.reynolds * T::of(-0.5)))
    }

    /// Share of its load that a segment in the wake of the trunk keeps.
    fn unsheltered(
        &self,
        segment: Segment,
        centre: &Vector3<T>,
        trunk: &Vector3<T>,
        direction: &Vector3<T>,
    ) -> T {
        let is_trunk = matches!(
            segment,
            Segment::Pelvis | Segment::Abdomen | Segment::Thorax
        );
        let offset = trunk - centre;
        // The air comes from the direction of the velocity, so behind means against the velocity.
        let behind = offset.dot(direction);
        if is_trunk {
            return T::one();
        }
        let aside = (offset - direction * behind).norm_squared();
        let width = T::of(SHELTER_WIDTH * SHELTER_WIDTH);
        let depth = T::of(SHELTER_DEPTH * SHELTER_DEPTH);
        // The wake starts at the trunk; without the depth term a limb beside it would lose its load abruptly.
        let inside = behind * behind / (behind * behind + depth);
        behind.simd_le(T::zero()).if_else(T::one, || {
            T::one() - self.shelter * inside * width / (width + aside)
        })
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use crate::aerodynamics::{Aerodynamics, expose, total_load};
    use crate::body::posture::pose;
    use crate::test_body::{any_posture, reference_body};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_uniform_stream_gives_the_loads_of_the_paper(
            posture in any_posture(),
            velocity in prop::array::uniform3(-60.0f64..60.0),
            spin in prop::array::uniform3(-6.0f64..6.0),
        ) {
            let body = reference_body();
            let exposed = expose(&body, &pose(&body, &posture), &Aerodynamics::paper());
            let (velocity, spin) = (Vector3::from(velocity), Vector3::from(spin));
            let plain = total_load(&exposed, &Flow::new(&velocity, 1.0));
            let local = Stream::uniform().total_load(&exposed, &velocity, &spin, 1.0);
            let scale = 1.0 + velocity.norm_squared();
            prop_assert!((plain.force - local.force).norm() < 1e-13 * scale);
            prop_assert!((plain.moment - local.moment).norm() < 1e-13 * scale);
        }

        #[test]
        fn rotation_is_felt_by_the_share_and_not_at_rest(
            posture in any_posture(),
            spin in prop::array::uniform3(-6.0f64..6.0),
        ) {
            let body = reference_body();
            let exposed = expose(&body, &pose(&body, &posture), &Aerodynamics::paper());
            let (velocity, spin) = (Vector3::new(3.0, -48.0, 5.0), Vector3::from(spin));
            let load = |rotation: f64, spin: &Vector3<f64>| {
                let stream = Stream { rotation, ..Stream::uniform() };
                stream.total_load(&exposed, &velocity, spin, 1.0)
            };
            prop_assert_eq!(load(1.0, &Vector3::zeros()), load(0.0, &spin));
            let (half, whole) = (load(0.5, &(spin * 2.0)), load(1.0, &spin));
            prop_assert!((half.moment - whole.moment).norm() < 1e-9);
        }
    }

    #[test]
    fn drag_decreases_with_speed_and_shelter_reduces_loads_behind() {
        let stream = Stream::<f64> {
            reynolds: 0.5,
            shelter: 0.6,
            ..Stream::uniform()
        };
        assert!((stream.drag_factor(&Vector3::new(0.0, 50.0, 0.0)) - 1.0).abs() < 1e-12);
        let slow = stream.drag_factor(&Vector3::new(0.0, 12.5, 0.0));
        assert!((slow - 2.0).abs() < 1e-9, "{slow}");
        let (trunk, down) = (Vector3::zeros(), -Vector3::z());
        let left =
            |place: Vector3<f64>| stream.unsheltered(Segment::LeftHand, &place, &trunk, &down);
        // In a fall, the region above the trunk lies in its wake.
        let inside = 0.25 / 0.26;
        assert!((left(Vector3::new(0.0, 0.0, 0.5)) - (1.0 - 0.6 * inside)).abs() < 1e-12);
        assert!((left(Vector3::new(0.0, 0.0, -0.5)) - 1.0).abs() < 1e-12);
        assert!((left(Vector3::new(0.25, 0.0, 0.5)) - (1.0 - 0.3 * inside)).abs() < 1e-12);
        // A limb that passes the level of the trunk loses its load gradually.
        let levels = (-50..50).map(|k| left(Vector3::new(0.1, 0.0, 0.01 * f64::from(k))));
        let levels: std::vec::Vec<f64> = levels.collect();
        assert!(
            levels
                .windows(2)
                .all(|pair| (pair[1] - pair[0]).abs() < 0.05)
        );
    }
}
