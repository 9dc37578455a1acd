//! A run of the motion filter over a recording, and of the solution for the whole flight that starts from it.

use bodyflight_core::Real;
use bodyflight_core::body::SegmentArray;
use bodyflight_core::dynamics::applied_load::AppliedLoads;
use bodyflight_core::dynamics::muscle_input::MuscleModel;
use bodyflight_core::dynamics::{Dynamics, Inputs, Motion};
use bodyflight_core::estimator::motion::MotionFilter;
use bodyflight_core::estimator::motion::estimate::{MotionEstimate, Recorder};
use bodyflight_core::estimator::motion::settings::{ASSUMED_DEVIATION, MotionPreset};
use bodyflight_core::estimator::motion::state::{
    Difference, FlightState, MUSCLE, VELOCITY, inputs_of,
};
use bodyflight_core::estimator::motion::watch::Consistency;
use bodyflight_core::estimator::propagation::Propagation;
use bodyflight_core::flight_sample::FlightSample;

use crate::forward::{STRIDE, Sample};
use crate::report::{Flags, Point, Watched};
use crate::size::Sizes;
use crate::velocities::Velocities;
use crate::verdict::{Collector, Doubts};
use crate::whole::Whole;
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::progress;
use bodyflight_mvnx::recording::Warning;
use bodyflight_replay::flight::Flight;
use bodyflight_replay::input_history::InputRow;

/// An axis may have become active this long before the filter notices (s).
const AWAKE_BEFORE: f64 = 0.15;

/// A recording, and the model of its flight.
#[derive(Clone, Copy)]
pub(crate) struct Run<'a> {
    pub(crate) flight: &'a Flight,
    /// What was measured, in order of time.
    pub(crate) samples: &'a [FlightSample],
    /// Where the velocities come from.
    pub(crate) velocities: &'a Velocities,
    /// What is implausible in the recording.
    pub(crate) warnings: &'a [Warning],
    /// Sample rate (Hz).
    pub(crate) rate: f64,
    pub(crate) dynamics: Dynamics<f64>,
    pub(crate) applied: AppliedLoads<f64>,
    /// Standard deviation of each segment relative to the pelvis (rad), if the flight states them.
    pub(crate) segments: Option<SegmentArray<f64>>,
}

/// Estimates, and how they came about.
pub(crate) struct Points {
    pub(crate) points: Vec<Point>,
    pub(crate) collector: Collector,
    pub(crate) flags: Flags,
    /// Whether they are those of the whole flight.
    pub(crate) is_smoothed: bool,
}

impl<'a> Run<'a> {
    fn muscles_at(&self, time: f64) -> MuscleModel {
        let flight = &self.flight.muscles;
        let history = self.flight.inputs.as_ref();
        history.map_or(*flight, |history| history.muscles_at(time, flight))
    }

    /// What an estimate can be at best: if the import doubted a sensor, or where the recording contradicts itself, none is
    /// consistent.
    fn consistency_at(&self, time: f64) -> Consistency {
        let has_fault = self.warnings.iter().any(|warning| {
            let span = warning.span_s;
            warning.is_fault && span.is_none_or(|[from, to]| (from..=to).contains(&time))
        });
        if has_fault || !self.flight.doubted.is_empty() {
            Consistency::Doubtful
        } else {
            Consistency::Consistent
        }
    }

    /// Runs the filter over the recording. `before` is called before each instant is pushed, `each` afterwards, with
    /// the estimate if there is one.
    pub(crate) fn fly<T: Real, P: Propagation<T>>(
        &self,
        preset: &MotionPreset,
        recorder: &mut impl Recorder<T>,
        mut before: impl FnMut(usize, &mut MotionFilter<T, P>),
        mut each: impl FnMut(usize, &MotionFilter<T, P>, Option<MotionEstimate<T>>),
    ) -> Result<()> {
        let mut instants = self.samples.iter();
        let Some(first) = instants.next() else {
            return Ok(());
        };
        let motion: Motion<T> = first.motion.cast();
        let refused = |error| Problem::bad_input(format!("the preset: {error}"));
        let process = MotionFilter::<T, P>::process(preset).map_err(refused)?;
        let dynamics = self.dynamics.cast();
        let mut filter = Box::new(MotionFilter::<T, P>::unstarted(preset, process, &dynamics));
        let velocity_deviation = if self.velocities.are_assumed() {
            T::single(ASSUMED_DEVIATION)
        } else {
            T::zero()
        };
        filter
            .restart_assuming(&motion, &first.posture.cast(), velocity_deviation)
            .map_err(refused)?;
        if let Some(errors) = &self.segments {
            filter.set_segment_errors(&errors.map(|_, error| T::of(*error)));
        }
        let applied = self.applied.cast::<T>();
        let mut last = first.time;
        for (index, instant) in instants.enumerate() {
            let (middle, duration) = (0.5 * (last + instant.time), instant.time - last);
            last = instant.time;
            filter.apply(&applied, T::of(middle - first.time), T::of(duration));
            filter.dynamics_mut().muscles = self.muscles_at(instant.time);
            before(index, &mut filter);
            let measured = self.velocities.measured(self.samples, index + 1).cast();
            let estimate = filter.push_recorded(&instant.posture.cast(), &measured, recorder);
            each(index, &filter, estimate);
            if index.is_multiple_of(256) {
                progress::reached(index, self.samples.len())?;
            }
        }
        Ok(())
    }

    /// Estimates with a filter, and by the whole flight if `smooth` gives the possible sizes of the joint errors and the preset
    /// for it. `doubts` are added to what the filter states.
    pub(crate) fn points<T: Real, P: Propagation<T>>(
        &self,
        preset: &MotionPreset,
        smooth: Option<(Sizes, MotionPreset)>,
        doubts: Doubts,
    ) -> Result<Points> {
        let mut points = Vec::new();
        let mut places = Vec::new();
        let mut states = Vec::new();
        let mut collector = Collector::default();
        let mut flags = Flags::default();
        let mut activity = Vec::new();
        let mut last = self.samples.first().map_or(0.0, |first| first.time);
        progress::stage("filtering");
        self.fly::<T, P>(
            preset,
            &mut (),
            |_, _| (),
            |index, filter, estimate| {
                activity.push(filter.activity().map(Real::to_f64));
                if (index + 1).is_multiple_of(STRIDE) {
                    states.push(filter.state().cast());
                }
                let (Some(estimate), Some(instant)) = (estimate, self.samples.get(index + 1))
                else {
                    return;
                };
                let watch = estimate.watch.cast();
                let at_best = doubts.least.max(self.consistency_at(instant.time));
                let consistency = estimate.consistency.max(at_best);
                collector.take(&watch, consistency, instant.time, instant.time - last);
                last = instant.time;
                flags.count_faults(estimate.faults);
                let mut deviation = estimate.deviation.map(Real::to_f64);
                let mut of_muscle = deviation.fixed_rows_mut::<3>(MUSCLE);
                of_muscle *= doubts.muscle;
                places.push((index + 1) / STRIDE);
                points.push(Point {
                    normalised_innovation: estimate.normalised_innovation.to_f64(),
                    consistency: Some(consistency),
                    watched: Watched::of(&watch),
                    ..self.point(
                        instant.time,
                        &estimate.inputs.cast(),
                        &deviation,
                        &estimate.motion.cast(),
                    )
                });
            },
        )?;
        let mut is_smoothed = false;
        if let Some((sizes, preset)) = smooth {
            let solution = self.whole(&preset, sizes, &states, &activity).solve()?;
            let known = solution.map_or_else(Vec::new, |solution| solution.known);
            is_smoothed = !known.is_empty();
            for (point, place) in points.iter_mut().zip(places) {
                let Some(known) = known.get(place) else {
                    continue;
                };
                let (inputs, deviation) = (&known.state.inputs, &known.deviation);
                *point = Point {
                    normalised_innovation: point.normalised_innovation,
                    consistency: point.consistency,
                    watched: point.watched,
                    ..self.point(point.time, inputs, deviation, &known.motion)
                };
            }
        }
        Ok(Points {
            points,
            collector,
            flags,
            is_smoothed,
        })
    }

    fn point(
        &self,
        time: f64,
        inputs: &Inputs<f64>,
        deviation: &Difference<f64>,
        motion: &Motion<f64>,
    ) -> Point {
        let of_inputs = deviation.fixed_rows::<12>(MUSCLE).into_owned();
        Point {
            time,
            inputs: InputRow::of(time, inputs).with_muscles(&self.muscles_at(time)),
            deviation: InputRow::of(time, &inputs_of(&of_inputs)),
            velocity_deviation: [0, 1, 2].map(|axis| deviation[VELOCITY + axis]),
            normalised_innovation: 1.0,
            consistency: None,
            watched: Watched::of_all(f64::NAN),
            motion: Some(*motion),
        }
    }

    /// The whole flight as one problem, about the trajectory of a filter.
    pub(crate) fn whole(
        &self,
        preset: &MotionPreset,
        sizes: Sizes,
        states: &[FlightState<f64>],
        activity: &[[f64; 3]],
    ) -> Whole<'a> {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "only a few samples"
        )]
        let before = (AWAKE_BEFORE * self.rate).round() as usize;
        let awake = |index: usize| {
            let end = (index + before).min(activity.len());
            let ahead = activity.get(index..end).unwrap_or_default();
            let most = |axis: usize| ahead.iter().map(|level| level[axis]).fold(0.0, f64::max);
            [0, 1, 2].map(most)
        };
        let instants = self.samples.iter().enumerate();
        let begin = self.samples.first().map_or(0.0, |i| i.time);
        let samples = instants.map(|(index, instant)| Sample {
            time: instant.time - begin,
            posture: &instant.posture,
            motion: &instant.motion,
            muscles: self.muscles_at(instant.time),
            // The filter's first activity belongs to the second instant.
            activity: awake(index.saturating_sub(1)),
        });
        let model = (&self.dynamics, &self.applied);
        let all = f64::from(preset.joint_error);
        let segments = self
            .segments
            .map(|errors| errors.map(|_, error| error / all));
        Whole::new(preset, sizes, model, segments, samples.collect(), states)
    }
}
