//! Equations of motion: the state of a falling body and how a step advances it.
//!
//! [`Dynamics`] holds everything that stays the same during a flight; a [`PostureSample`] holds everything that
//! depends on the posture alone, computed once for each interval between two recorded postures; a [`State`] holds the
//! rest. [`step`] is the integrator, [`equations_of_motion`] gives the rates in their exact and their published form,
//! [`muscle_input`] models the skydiver's conscious inputs, [`residual`] loads that nothing else accounts for,
//! [`applied_load`] user-defined loads. [`trim`] finds the steady belly fall, [`steady`] steady falls in other
//! attitudes, and [`point_mass`] is a fall without known posture.

pub mod applied_load;
pub mod equations_of_motion;
pub mod free_run;
pub mod interval;
pub mod muscle_input;
pub mod point_mass;
pub mod residual;
pub mod sample_parts;
pub mod steady;
pub mod step;
pub mod trim;

use nalgebra::{Matrix3, Vector3};

use crate::aerodynamics::compiled::CompiledAerodynamics;
use crate::aerodynamics::free_fly::FreeFly;
use crate::aerodynamics::stream::Stream;
use crate::aerodynamics::{Aerodynamics, BELLY_TURN_DAMPING, Flow, Loads, expose};
use crate::air::{Air, GRAVITY};
use crate::axis::AxisCoefficients;
use crate::body::mass_properties::{MassMotion, MassProperties, PostureRate};
use crate::body::posture::{PosedSegment, Posture, pose};
use crate::body::{Body, SegmentArray};
use crate::frame::{Body as BodyFrame, Inertial, Rotation, Vector};
use crate::math::{Lanes, Real, inverse_symmetric_or};
use muscle_input::MuscleModel;
use residual::ResidualLoad;

/// Everything that stays the same during a flight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dynamics<T: Lanes> {
    /// The person with all equipment.
    pub body: Body<T>,
    /// Aerodynamic coefficients.
    pub aerodynamics: Aerodynamics<T>,
    /// Density and velocity of the air.
    pub air: Air<T>,
    /// Effects on the local airstream at single segments.
    pub stream: Stream<T>,
    /// Limbs that produce the muscle input.
    pub muscles: MuscleModel,
    /// Gravitational acceleration, positive downwards (m/s2).
    pub gravity: T,
}

impl<T: Lanes> Dynamics<T> {
    /// Creates a model with the paper's coefficients in still air of constant density (kg/m3).
    pub fn paper(body: Body<T>, density: T) -> Self {
        Self {
            body,
            aerodynamics: Aerodynamics::paper(),
            air: Air::still(density),
            stream: Stream::uniform(),
            muscles: muscle_input::BACK_TRACKING,
            gravity: T::of(GRAVITY),
        }
    }

    /// Converts the parameters to another precision.
    pub fn cast<U: Lanes>(&self) -> Dynamics<U>
    where
        T: Real,
    {
        Dynamics {
            body: self.body.cast(),
            aerodynamics: self.aerodynamics.cast(),
            air: self.air.cast(),
            stream: self.stream.cast(),
            muscles: self.muscles,
            gravity: U::of(self.gravity.to_f64()),
        }
    }

    /// Returns the aerodynamic load on each segment of a moving body, without damping and muscle input, in body axes
    /// with moments about the origin.
    pub fn segment_loads(
        &self,
        posture: &Posture<T>,
        motion: &Motion<T>,
    ) -> SegmentArray<Loads<T>> {
        let posed = pose(&self.body, posture);
        let mut exposed = expose(&self.body, &posed, &self.aerodynamics);
        let air = self.air.velocity_at(&motion.position);
        let through_air = motion.velocity - motion.inertial_from_body.inverse() * air;
        let density = self.air.density.at(motion.position.up());
        let spin = &motion.angular_velocity.components;
        if let Some(free_fly) = FreeFly::of(&self.body, &posed, &self.aerodynamics) {
            let direction = Flow::new(&through_air.components, density).direction;
            let felt = free_fly.felt(&direction);
            exposed = exposed.map(|segment, exposed| felt.by(segment, exposed));
        }
        self.stream
            .segment_loads(&exposed, &through_air.components, spin, density)
    }

    /// Returns the load factor of a total aerodynamic force (N): its size over the weight, 1 in a steady fall.
    pub fn load_factor<F>(&self, force: &Vector<T, F>) -> T {
        force.norm() / (self.body.mass() * self.gravity)
    }

    /// Creates the sample of a body that holds `posture`.
    pub fn hold(&self, posture: &Posture<T>) -> PostureSample<T> {
        self.sample(posture, &PostureRate::zero())
    }

    /// Creates the sample of an interval of `duration` (s) in which the body moves from one posture to the next. The
    /// geometry is that of the middle of the interval, and the joint rates are constant.
    pub fn between(&self, from: &Posture<T>, to: &Posture<T>, duration: T) -> PostureSample<T> {
        let mut sample = PostureSample::blank();
        self.between_into(from, to, duration, &mut sample);
        sample
    }

    /// In-place form of [`Dynamics::between`]: a sample takes 1.5 kB, too much for a unit's stack.
    pub fn between_into(
        &self,
        from: &Posture<T>,
        to: &Posture<T>,
        duration: T,
        sample: &mut PostureSample<T>,
    ) {
        let (middle, rate) = middle_of(from, to, duration);
        self.sample_into(&middle, &rate, sample);
    }

    /// Fills `sample` with the aerodynamics of the posture that the body had [`Stream::lag`] earlier. Kept out of line
    /// so that flights without lag do not pay for it.
    #[cold]
    #[inline(never)]
    fn late_sample_into(
        &self,
        posture: &Posture<T>,
        rate: &PostureRate<T>,
        sample: &mut PostureSample<T>,
    ) {
        let mut prompt = *self;
        prompt.stream.lag = T::zero();
        let before = rate.posture_before(posture, self.stream.lag);
        prompt.sample_into(&before, rate, sample);
        let aerodynamics = sample.aerodynamics;
        prompt.sample_into(posture, rate, sample);
        sample.aerodynamics = aerodynamics;
    }

    /// Creates the sample of a posture whose joints move at `rate`.
    pub fn sample(&self, posture: &Posture<T>, rate: &PostureRate<T>) -> PostureSample<T> {
        let mut sample = PostureSample::blank();
        self.sample_into(posture, rate, &mut sample);
        sample
    }

    /// In-place form of [`Dynamics::sample`].
    pub fn sample_into(
        &self,
        posture: &Posture<T>,
        rate: &PostureRate<T>,
        sample: &mut PostureSample<T>,
    ) {
        if self.stream.lag != T::zero() {
            return self.late_sample_into(posture, rate, sample);
        }
        // Written out, since a posed body that a function returns is copied, which the unit would pay for.
        let posed = pose(&self.body, posture);
        sample.set_mass(MassMotion::with_properties(&self.body, &posed, rate));
        self.expose_into(&posed, sample);
    }

    /// Sets all of `sample` but the aerodynamics, and returns the posed body, which [`Dynamics::expose_into`] needs for
    /// these.
    #[inline(always)]
    pub fn pose_into(
        &self,
        posture: &Posture<T>,
        rate: &PostureRate<T>,
        sample: &mut PostureSample<T>,
    ) -> SegmentArray<PosedSegment<T>> {
        let posed = pose(&self.body, posture);
        sample.set_mass(MassMotion::with_properties(&self.body, &posed, rate));
        posed
    }

    /// Sets the aerodynamics of `sample`, without [`Stream::lag`].
    #[inline(always)]
    pub fn expose_into(
        &self,
        posed: &SegmentArray<PosedSegment<T>>,
        sample: &mut PostureSample<T>,
    ) {
        let aerodynamics = &mut sample.aerodynamics;
        aerodynamics.expose(&self.body, posed, &self.aerodynamics);
    }
}

/// Returns the posture and the joint rates that stand for an interval of `duration` (s) between two postures, see
/// [`Dynamics::between`].
#[inline(always)]
pub fn middle_of<T: Lanes>(
    from: &Posture<T>,
    to: &Posture<T>,
    duration: T,
) -> (Posture<T>, PostureRate<T>) {
    let middle = from.interpolated(to, T::of(0.5));
    (middle, PostureRate::between(from, to, duration))
}

/// Everything that depends on the posture alone, in body axes; shared by all runs over the same interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PostureSample<T: Lanes> {
    /// Mass, centre of gravity and inertia about the origin.
    pub mass: MassProperties<T>,
    /// Rates of the mass properties.
    pub motion: MassMotion<T>,
    /// Inertia about the centre of gravity (kg m2).
    pub inertia: Matrix3<T>,
    /// Inverse of the inertia about the centre of gravity (1/(kg m2)).
    pub inverse_inertia: Matrix3<T>,
    /// Angular momentum of the segments relative to the body frame, about the centre of gravity (kg m2/s).
    pub relative_angular_momentum: Vector3<T>,
    /// Aerodynamic sums over the segments.
    pub aerodynamics: CompiledAerodynamics<T>,
}

impl<T: Lanes> PostureSample<T> {
    /// Sets mass properties and mass motion, and what follows from them.
    #[inline(always)]
    fn set_mass(&mut self, (mass, motion): (MassProperties<T>, MassMotion<T>)) {
        (self.mass, self.motion) = (mass, motion);
        self.inertia = self.mass.inertia_about_cg();
        // The inertia of a body with positive masses is never singular; the identity keeps the step finite for invalid
        // input.
        self.inverse_inertia = inverse_symmetric_or(&self.inertia, Matrix3::identity);
        self.relative_angular_momentum = self.motion.relative_angular_momentum_about_cg(&self.mass);
    }

    /// Creates an empty sample, to be filled by [`Dynamics::sample_into`].
    pub fn blank() -> Self {
        Self {
            mass: MassProperties {
                mass: T::zero(),
                cg: Vector3::zeros(),
                inertia_about_origin: Matrix3::zeros(),
            },
            motion: MassMotion::zero(),
            inertia: Matrix3::zeros(),
            inverse_inertia: Matrix3::zeros(),
            relative_angular_momentum: Vector3::zeros(),
            aerodynamics: CompiledAerodynamics::hidden(),
        }
    }
}

/// The skydiver's conscious inputs, paper eq. (ukf_state).
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Deserialize, serde::Serialize))]
pub struct Inputs<T: Lanes> {
    /// Muscle input coefficients (dimensionless).
    pub muscle: AxisCoefficients<T>,
    /// Damping moment coefficients Cm_damp (dimensionless).
    pub damping: AxisCoefficients<T>,
    /// Load that the model does not account for; zero in the paper.
    pub residual: ResidualLoad<T>,
}

impl<T: Lanes> Default for Inputs<T> {
    /// No muscle input, no damping, no residual load.
    fn default() -> Self {
        Self {
            muscle: AxisCoefficients::zero(),
            damping: AxisCoefficients::zero(),
            residual: ResidualLoad::none(),
        }
    }
}

impl<T: Lanes> Inputs<T> {
    /// No muscle input, with the paper's damping of belly turns, eq. (params).
    pub fn belly_turn() -> Self {
        Self {
            muscle: AxisCoefficients::zero(),
            damping: BELLY_TURN_DAMPING.map(T::of),
            residual: ResidualLoad::none(),
        }
    }

    /// Converts the inputs to another precision.
    pub fn cast<U: Lanes>(&self) -> Inputs<U>
    where
        T: Real,
    {
        Inputs {
            muscle: self.muscle.cast(),
            damping: self.damping.cast(),
            residual: self.residual.cast(),
        }
    }
}

/// State in momentum form (model.md, notes on the exact equations). It needs no posture acceleration, and conserves
/// momentum exactly where no force acts.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Deserialize, serde::Serialize),
    serde(bound(deserialize = "T: Real + serde::Deserialize<'de>"))
)]
pub struct State<T: Lanes> {
    /// Attitude of the body frame.
    pub inertial_from_body: Rotation<T, Inertial, BodyFrame>,
    /// Position of the centre of gravity (m).
    pub cg_position: Vector<T, Inertial>,
    /// Linear momentum (kg m/s).
    pub linear_momentum: Vector<T, Inertial>,
    /// Angular momentum about the centre of gravity (kg m2/s).
    pub angular_momentum: Vector<T, Inertial>,
}

/// Motion of the body frame, as sensors measure it and as the paper describes it.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Deserialize, serde::Serialize),
    serde(bound(deserialize = "T: Real + serde::Deserialize<'de>"))
)]
pub struct Motion<T: Lanes> {
    /// Attitude of the body frame.
    pub inertial_from_body: Rotation<T, Inertial, BodyFrame>,
    /// Position of the pelvic joint (m).
    pub position: Vector<T, Inertial>,
    /// Velocity of the pelvic joint (m/s), body axes; [U, V, W] in the paper.
    pub velocity: Vector<T, BodyFrame>,
    /// Angular velocity of the body frame (rad/s), body axes; [P, Q, R] in the paper.
    pub angular_velocity: Vector<T, BodyFrame>,
}

impl<T: Lanes> Motion<T> {
    /// Velocity of the pelvic joint over the ground (m/s).
    pub fn velocity_inertial(&self) -> Vector<T, Inertial> {
        self.inertial_from_body * self.velocity
    }

    /// Converts the motion to another precision.
    pub fn cast<U: Lanes>(&self) -> Motion<U>
    where
        T: Real,
    {
        Motion {
            inertial_from_body: self.inertial_from_body.cast(),
            position: self.position.cast(),
            velocity: self.velocity.cast(),
            angular_velocity: self.angular_velocity.cast(),
        }
    }
}

impl<T: Lanes> State<T> {
    /// Returns a state at rest at the origin, with the body axes along the inertial axes.
    pub fn at_rest() -> Self {
        Self {
            inertial_from_body: Rotation::identity(),
            cg_position: Vector::zero(),
            linear_momentum: Vector::zero(),
            angular_momentum: Vector::zero(),
        }
    }

    /// Returns whether every number is finite.
    pub fn is_finite(&self) -> bool
    where
        T: Real,
    {
        self.inertial_from_body
            .quaternion()
            .coords
            .iter()
            .all(|c| c.is_finite())
            && self.cg_position.is_finite()
            && self.linear_momentum.is_finite()
            && self.angular_momentum.is_finite()
    }

    /// Converts the state to another precision.
    pub fn cast<U: Lanes>(&self) -> State<U>
    where
        T: Real,
    {
        State {
            inertial_from_body: self.inertial_from_body.cast(),
            cg_position: self.cg_position.cast(),
            linear_momentum: self.linear_momentum.cast(),
            angular_momentum: self.angular_momentum.cast(),
        }
    }
}
