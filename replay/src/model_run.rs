//! The model's free run in either precision.
//!
//! Both are compiled here once, not in each crate that replays a flight.

use bodyflight_core::body::mass_properties::PostureRate;
use bodyflight_core::dynamics::applied_load::AppliedLoads;
use bodyflight_core::dynamics::equations_of_motion::Flight as RunState;
use bodyflight_core::dynamics::free_run::{Equations, FreeRun};
use bodyflight_core::dynamics::muscle_input::MuscleModel;
use bodyflight_core::dynamics::{Dynamics, Inputs, Motion, State};
use bodyflight_core::effect::Model;
use bodyflight_core::{Posture, Real};

use crate::Precision;

/// A change of posture within a duration (s).
#[derive(Clone, Copy)]
pub(crate) struct PostureChange<'a> {
    pub(crate) from: &'a Posture<f64>,
    pub(crate) to: &'a Posture<f64>,
    pub(crate) duration: f64,
}

impl PostureChange<'_> {
    /// Mean joint rates.
    fn rate<T: Real>(self) -> PostureRate<T> {
        PostureRate::between(&self.from.cast(), &self.to.cast(), T::of(self.duration))
    }
}

/// A free run of the model.
pub(crate) enum ModelRun {
    Single(Box<Typed<f32>>),
    Double(Box<Typed<f64>>),
}

/// The run in one precision.
pub(crate) struct Typed<T: Real> {
    dynamics: Dynamics<T>,
    applied: AppliedLoads<T>,
    run: FreeRun<T>,
}

impl ModelRun {
    /// Starts a run with `motion`, in the posture that `change` starts from.
    pub(crate) fn new(
        precision: Precision,
        model: &Model<f64>,
        equations: Equations,
        motion: &Motion<f64>,
        change: PostureChange<'_>,
    ) -> Self {
        match precision {
            Precision::Single => Self::Single(Typed::new(model, equations, motion, change)),
            Precision::Double => Self::Double(Typed::new(model, equations, motion, change)),
        }
    }

    /// Replaces the limb groups that muscle input acts on.
    pub(crate) fn set_muscles(&mut self, muscles: MuscleModel) {
        match self {
            Self::Single(run) => run.dynamics.muscles = muscles,
            Self::Double(run) => run.dynamics.muscles = muscles,
        }
    }

    /// Advances by `duration` (s) to a posture; applied loads depend on the time since the start (s).
    pub(crate) fn advance(
        &mut self,
        since_start: f64,
        inputs: &Inputs<f64>,
        posture: &Posture<f64>,
        duration: f64,
    ) {
        match self {
            Self::Single(run) => run.advance(since_start, inputs, posture, duration),
            Self::Double(run) => run.advance(since_start, inputs, posture, duration),
        }
    }

    /// The state of a run in double precision by the exact equations.
    pub(crate) fn state(&self) -> Option<&State<f64>> {
        match self {
            Self::Double(run) => match run.run.flight() {
                RunState::Exact(state) => Some(state),
                RunState::AsPublished(_) => None,
            },
            Self::Single(_) => None,
        }
    }

    /// The motion reached, with the joint rates of `change`.
    pub(crate) fn motion(&self, change: PostureChange<'_>) -> Motion<f64> {
        match self {
            Self::Single(run) => run.run.motion(&run.dynamics, &change.rate()).cast(),
            Self::Double(run) => run.run.motion(&run.dynamics, &change.rate()),
        }
    }
}

impl<T: Real> Typed<T> {
    fn new(
        model: &Model<f64>,
        equations: Equations,
        motion: &Motion<f64>,
        change: PostureChange<'_>,
    ) -> Box<Self> {
        let dynamics = model.dynamics.cast::<T>();
        let posture = change.from.cast();
        let run = FreeRun::new(
            &dynamics,
            equations,
            &motion.cast(),
            &posture,
            &change.rate(),
        );
        Box::new(Self {
            dynamics,
            applied: model.applied.cast(),
            run,
        })
    }

    fn advance(
        &mut self,
        since_start: f64,
        inputs: &Inputs<f64>,
        posture: &Posture<f64>,
        duration: f64,
    ) {
        self.run.advance_under(
            (&self.applied, T::of(since_start)),
            &self.dynamics,
            &inputs.cast(),
            &posture.cast(),
            T::of(duration),
        );
    }
}
