//! User-defined loads: a force or a moment along an axis, scaled by a product of a few [factors](factor).
//!
//! They model what no [effect](crate::effect) covers: a flapping strap, a pull by another skydiver, a drogue. A list of
//! loads has a fixed capacity and needs no heap. Each step is enclosed by two half impulses (Strang 1968), one applied
//! to the state before it and one to the state after it: this is second order in time, and the step itself needs no
//! knowledge of the loads.

pub mod factor;
pub mod instant;

use nalgebra::Vector3;

use super::equations_of_motion::Flight;
use super::interval::Interval;
use super::{Dynamics, Motion, PostureSample, State};
use crate::body::posture::{PosedSegment, Posture, pose};
use crate::body::{Segment, SegmentArray};
use crate::frame::{Body as BodyFrame, Vector};
use crate::math::Real;
use factor::{FACTORS, Factor};
use instant::Instant;

pub use instant::Axis;

/// Maximum number of loads that act at the same time.
pub const APPLIED_LOADS: usize = 12;

/// Direction of a load.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Direction {
    /// Along an axis of the body: left, dorsal, cranial.
    Body(Axis),
    /// Along an axis of a segment.
    Segment(Segment, Axis),
    /// Along an inertial axis: north, west, up.
    World(Axis),
    /// Along the airstream, the direction of drag.
    Stream,
}

/// Point at which a force acts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Point {
    /// At the centre of gravity of the body.
    Body,
    /// At the centre of gravity of a segment.
    Segment(Segment),
}

/// Kind of a load.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Kind {
    /// A force (N) at a point.
    Force(Point),
    /// A moment (N m), which needs no point of application.
    Moment,
}

/// A user-defined force or moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AppliedLoad<T> {
    /// Whether the load is a force or a moment.
    pub kind: Kind,
    /// Direction of the load.
    pub direction: Direction,
    /// Size when every factor is one (N or N m).
    pub size: T,
    /// Factors that multiply the size.
    pub factors: [Option<Factor<T>>; FACTORS],
}

/// A list of loads that act at the same time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AppliedLoads<T> {
    loads: [Option<AppliedLoad<T>>; APPLIED_LOADS],
}

/// A force at the centre of gravity and a moment about it, in body axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Push<T: Real> {
    /// Force (N).
    pub force: Vector<T, BodyFrame>,
    /// Moment (N m).
    pub moment: Vector<T, BodyFrame>,
}

/// Error for a list that already has [`APPLIED_LOADS`] loads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TooManyLoads;

impl core::fmt::Display for TooManyLoads {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "expected at most {APPLIED_LOADS} loads")
    }
}

impl core::error::Error for TooManyLoads {}

impl<T: Real> AppliedLoads<T> {
    /// An empty list.
    pub const fn none() -> Self {
        Self {
            loads: [None; APPLIED_LOADS],
        }
    }

    /// Returns the list with one more load.
    ///
    /// # Errors
    /// Returns an error if the list already has [`APPLIED_LOADS`] loads.
    pub fn with(mut self, load: AppliedLoad<T>) -> Result<Self, TooManyLoads> {
        let place = self.loads.iter_mut().find(|place| place.is_none());
        *place.ok_or(TooManyLoads)? = Some(load);
        Ok(self)
    }

    /// Iterates over the loads.
    pub fn iter(&self) -> impl Iterator<Item = &AppliedLoad<T>> {
        self.loads.iter().flatten()
    }

    /// Returns whether the list is empty.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.loads.iter().all(Option::is_none)
    }

    /// Converts the loads to another precision.
    pub fn cast<U: Real>(&self) -> AppliedLoads<U> {
        AppliedLoads {
            loads: self.loads.map(|load| {
                load.map(|load| AppliedLoad {
                    kind: load.kind,
                    direction: load.direction,
                    size: U::of(load.size.to_f64()),
                    factors: load.factors.map(|factor| factor.map(|f| f.cast())),
                })
            }),
        }
    }

    /// Returns the sum of all loads on a body with this motion, `time` (s) after the start of the flight; `cg` (m) is
    /// its centre of gravity in body axes.
    pub fn at(
        &self,
        dynamics: &Dynamics<T>,
        posture: &Posture<T>,
        motion: &Motion<T>,
        cg: &Vector<T, BodyFrame>,
        time: T,
    ) -> Push<T> {
        let mut push = Push {
            force: Vector::zero(),
            moment: Vector::zero(),
        };
        let to_body = motion.inertial_from_body.inverse();
        let air = to_body * dynamics.air.velocity_at(&motion.position);
        let now = Instant {
            time,
            motion,
            posture,
            through_air: (motion.velocity - air).components,
        };
        let mut posed = None;
        for load in self.iter() {
            let posed = match load.needs_segments() {
                true => Some(&*posed.get_or_insert_with(|| pose(&dynamics.body, posture))),
                false => None,
            };
            let along = load.along(&now, posed) * load.strength(&now);
            match load.kind {
                Kind::Moment => push.moment += Vector::from_components(along),
                Kind::Force(point) => {
                    push.force += Vector::from_components(along);
                    if let (Point::Segment(segment), Some(posed)) = (point, posed) {
                        let arm = posed[segment].cg - cg.components;
                        push.moment += Vector::from_components(arm.cross(&along));
                    }
                }
            }
        }
        push
    }

    /// Changes the momenta of a body in `posture` by the loads at `time` (s) acting for `duration` (s); position and
    /// attitude stay the same.
    pub fn push(
        &self,
        dynamics: &Dynamics<T>,
        state: &mut State<T>,
        (posture, interval): (&Posture<T>, &impl Interval<T>),
        time: T,
        duration: T,
    ) {
        if self.is_empty() {
            return;
        }
        let motion = state.motion(interval);
        let push = self.at(dynamics, posture, &motion, &interval.cg(), time);
        let to_inertial = state.inertial_from_body;
        state.linear_momentum += to_inertial * push.force * duration;
        state.angular_momentum += to_inertial * push.moment * duration;
    }
}

impl<T: Real> AppliedLoad<T> {
    /// Size of the load with all factors applied (N or N m).
    pub fn strength(&self, now: &Instant<'_, T>) -> T {
        let factors = self.factors.iter().flatten();
        factors.fold(self.size, |size, factor| size * factor.at(now))
    }

    fn needs_segments(&self) -> bool {
        matches!(self.kind, Kind::Force(Point::Segment(_)))
            || matches!(self.direction, Direction::Segment(..))
    }

    /// Unit vector of the load's direction, in body axes; zero for a load along the airstream if there is none.
    fn along(
        &self,
        now: &Instant<'_, T>,
        posed: Option<&SegmentArray<PosedSegment<T>>>,
    ) -> Vector3<T> {
        match (self.direction, posed) {
            (Direction::Body(axis), _) => axis.unit(),
            (Direction::Segment(segment, axis), Some(posed)) => {
                posed[segment].body_from_segment * axis.unit::<T>()
            }
            (Direction::Segment(..), None) => Vector3::zeros(),
            (Direction::World(axis), _) => {
                let axis = Vector::from_components(axis.unit());
                (now.motion.inertial_from_body.inverse() * axis).components
            }
            (Direction::Stream, _) => {
                let speed = now.through_air.norm_squared().root();
                if speed > T::zero() {
                    now.through_air * (-T::one() / speed)
                } else {
                    Vector3::zeros()
                }
            }
        }
    }
}

impl<T: Real> Flight<T> {
    /// Same as [`AppliedLoads::push`], for either set of equations.
    pub fn push(
        &mut self,
        dynamics: &Dynamics<T>,
        loads: &AppliedLoads<T>,
        (posture, sample): (&Posture<T>, &PostureSample<T>),
        time: T,
        duration: T,
    ) {
        match self {
            Self::Exact(state) => loads.push(dynamics, state, (posture, sample), time, duration),
            Self::AsPublished(_) if loads.is_empty() => {}
            Self::AsPublished(flight) => {
                let motion = *flight.motion();
                let cg = Vector::from_components(sample.mass.cg);
                let push = loads.at(dynamics, posture, &motion, &cg, time);
                let spin = &sample.inverse_inertia * push.moment * duration;
                let velocity = push.force * (duration / sample.mass.mass) - spin.cross(&cg);
                flight.push(&velocity, &spin);
            }
        }
    }
}

#[cfg(test)]
mod tests;
