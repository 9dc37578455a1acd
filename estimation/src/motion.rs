//! Estimation with the motion filter, and with a solution for the whole flight that starts from the filter's result.

use std::time::Instant;

use bodyflight_core::Real;
use bodyflight_core::body::{SEGMENT_COUNT, SegmentArray};
use bodyflight_core::dynamics::applied_load::AppliedLoads;
use bodyflight_core::dynamics::muscle_input::MuscleModel;
use bodyflight_core::dynamics::{Dynamics, Inputs, Motion};
use bodyflight_core::estimator::full::Full;
use bodyflight_core::estimator::motion::MotionFilter;
use bodyflight_core::estimator::motion::estimate::{MotionEstimate, Recorder};
use bodyflight_core::estimator::motion::measurement::{MotionMeasurement, Row as ChannelRow};
use bodyflight_core::estimator::motion::settings::MotionPreset;
use bodyflight_core::estimator::motion::state::{Difference, FlightState, MUSCLE, inputs_of};
use bodyflight_core::estimator::motion::update::Innovation;
use bodyflight_core::estimator::motion::watch::Consistency;
use bodyflight_core::estimator::propagation::Propagation;
use bodyflight_core::estimator::reduced::Reduced;

use crate::measured::MeasuredFlight;
use crate::replayed::Replayed;
use crate::report::{Flags, JointErrorSource, Point, Watched};
use crate::verdict::Collector;
use crate::whole::{self, Known, Sample, Whole};
use crate::{Estimation, Filter};
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::progress;
use bodyflight_mvnx::recording::Options;
use bodyflight_replay::Precision::{self, Double, Single};
use bodyflight_replay::flight::Flight;
use bodyflight_replay::input_history::InputRow;

/// How a flight is estimated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// Forward in time, as on the unit.
    Filter,
    /// The whole flight at once.
    Smooth,
}

/// Tuning of an estimation with the motion filter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// The preset; its sample rate and sensor noise are replaced by those of the recording.
    pub preset: MotionPreset,
    /// Whether to keep the preset's sensor noise even if the recording shows a different one.
    pub keep_noise: bool,
    /// Whether to find the joint error from the innovations.
    pub find_joint_error: bool,
    /// The full model or the reduced one.
    pub filter: Filter,
    /// Forward or the whole flight.
    pub method: Method,
}

/// Joint errors to try (deg). None is smaller than those of real recordings: a constant error is observed only once,
/// and most of it may look like muscle input. The last is larger than in real recordings: a flight that needs that
/// much has some other problem.
const JOINT_ERRORS: [f32; 3] = [2.0, 4.0, IMPLAUSIBLE];
const IMPLAUSIBLE: f32 = 8.0;

/// An axis may have become active this long before the filter notices (s).
const AWAKE_BEFORE: f64 = 0.15;

/// Runs the filter over a recording and, for comparison, the model with constant coefficients.
///
/// # Errors
/// Returns an error if a file is unusable or the preset is refused.
pub fn estimate(
    flight: &Flight,
    settings: &Settings,
    options: Options,
    precision: Precision,
    reached: &mut dyn FnMut(f64),
) -> Result<Estimation> {
    let mut measured = MeasuredFlight::read(flight, options)?;
    let height = measured
        .samples
        .first()
        .map_or(0.0, |first| first.motion.position.up());
    let model = flight.effects.applied(flight.dynamics(height), height)?;
    measured.correct(&model.sensors);
    if settings.filter == Filter::Reduced {
        model_is_plain(&model.dynamics)?;
    }
    let mut preset = settings.preset;
    if !settings.keep_noise {
        preset.noise = measured.noise(&preset.noise);
    }
    set_rate(&mut preset, measured.rate);
    // What a preset or an option says of all joints replaces what the flight says of each segment.
    let segments = flight.segment_errors.filter(|_| settings.find_joint_error);
    let find_joint_error = settings.find_joint_error && segments.is_none();
    if let Some(errors) = &segments {
        preset.joint_error = root_mean_square(errors);
    }
    let begin = Instant::now();
    let run = Run {
        flight,
        measured: &measured,
        dynamics: model.dynamics,
        applied: model.applied,
        segments,
    };
    if find_joint_error {
        preset.joint_error = run.joint_error(&preset)?;
    }
    let implausible = find_joint_error && preset.joint_error >= IMPLAUSIBLE.to_radians();
    reached(0.0);
    let least = if implausible {
        Consistency::Doubtful
    } else {
        Consistency::Consistent
    };
    let method = settings.method;
    let (points, collector, flags) = match (settings.filter, precision) {
        (Filter::Paper, Single) => run.points::<f32, Full>(&preset, method, least)?,
        (Filter::Paper, Double) => run.points::<f64, Full>(&preset, method, least)?,
        (Filter::Reduced, Single) => run.points::<f32, Reduced>(&preset, method, least)?,
        (Filter::Reduced, Double) => run.points::<f64, Reduced>(&preset, method, least)?,
    };
    let seconds = begin.elapsed().as_secs_f64();
    progress::stage("simulating with the estimates");
    let replayed = Replayed {
        flight,
        measured: &measured,
    };
    let mut estimation = replayed.report(points, &collector, flags, &preset, seconds)?;
    if implausible {
        let sentence = format!(
            "the measurements can only be explained by joint errors of {IMPLAUSIBLE} degrees or more"
        );
        estimation.report.doubt.get_or_insert(sentence);
    }
    if find_joint_error {
        estimation.report.joint_error_source = Some(match preset.joint_error {
            least if least <= JOINT_ERRORS[0].to_radians() => JointErrorSource::Assumed,
            _ => JointErrorSource::Seen,
        });
    }
    estimation.report.warn(measured.warnings.clone());
    Ok(estimation)
}

/// Root of the mean square of the errors of all segments but the pelvis (rad).
#[expect(clippy::cast_possible_truncation, reason = "a deviation")]
fn root_mean_square(errors: &SegmentArray<f64>) -> f32 {
    let squares = errors.values().skip(1).map(|error| error * error);
    let joints = (SEGMENT_COUNT - 1) as f64;
    (squares.sum::<f64>() / joints).sqrt() as f32
}

/// Sets the rate of the recording, keeping the preset's number of estimates a second.
fn set_rate(preset: &mut MotionPreset, rate: f64) {
    let per_estimate = rate * preset.solution_window as f64 / f64::from(preset.sample_rate);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a rate of a recording"
    )]
    {
        preset.sample_rate = rate as f32;
        preset.solution_window = (per_estimate / 2.0).round().max(1.0) as usize * 2;
    }
}

/// Checks that the reduced model suffices: its airflow is the same for all segments, and its air everywhere.
fn model_is_plain(dynamics: &Dynamics<f64>) -> Result<()> {
    if dynamics.stream.is_uniform() && dynamics.air.profile == 0.0 {
        return Ok(());
    }
    Err(
        Problem::bad_input("an effect of the model acts on the airflow at single segments, which the reduced filter does not represent")
            .help("use --filter paper, which uses the full model"),
    )
}

struct Run<'a> {
    flight: &'a Flight,
    measured: &'a MeasuredFlight,
    dynamics: Dynamics<f64>,
    applied: AppliedLoads<f64>,
    /// Standard deviation of each segment relative to the pelvis (rad), if the flight states them.
    segments: Option<SegmentArray<f64>>,
}

/// Sums the log likelihood of the measurements.
#[derive(Default)]
struct Likelihood(f64);

impl<T: Real> Recorder<T> for Likelihood {
    fn taken(&mut self, _: &ChannelRow<T>, innovation: &Innovation<T>, _: &Difference<T>) {
        let (value, variance) = (innovation.value.to_f64(), innovation.variance.to_f64());
        self.0 -= 0.5 * (variance.ln() + value * value / variance);
    }
}

impl Run<'_> {
    fn muscles_at(&self, time: f64) -> MuscleModel {
        let flight = &self.flight.muscles;
        let history = self.flight.inputs.as_ref();
        history.map_or(*flight, |history| history.muscles_at(time, flight))
    }

    /// Runs the filter over the recording. `before` is called before each instant is pushed, `each` afterwards, with
    /// the estimate if there is one.
    fn fly<T: Real, P: Propagation<T>>(
        &self,
        preset: &MotionPreset,
        recorder: &mut impl Recorder<T>,
        mut before: impl FnMut(usize, &mut MotionFilter<T, P>),
        mut each: impl FnMut(usize, &MotionFilter<T, P>, Option<MotionEstimate<T>>),
    ) -> Result<()> {
        let mut instants = self.measured.samples.iter();
        let Some(first) = instants.next() else {
            return Ok(());
        };
        let motion: Motion<T> = first.motion.cast();
        let mut filter = Box::new(
            MotionFilter::<T, P>::new(
                preset,
                &self.dynamics.cast(),
                &motion,
                &first.posture.cast(),
            )
            .map_err(|error| Problem::bad_input(format!("the preset: {error}")))?,
        );
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
            let measured = MotionMeasurement::of(&instant.motion).cast().into();
            let estimate = filter.push_recorded(&instant.posture.cast(), &measured, recorder);
            each(index, &filter, estimate);
            if index.is_multiple_of(256) {
                progress::reached(index, self.measured.samples.len())?;
            }
        }
        Ok(())
    }

    /// The joint error with the highest likelihood of the measurements.
    fn joint_error(&self, preset: &MotionPreset) -> Result<f32> {
        let mut best = (f64::NEG_INFINITY, preset.joint_error);
        for degrees in JOINT_ERRORS {
            progress::stage(format!("trying joint errors of {degrees} degrees"));
            let tried = MotionPreset {
                joint_error: degrees.to_radians(),
                ..*preset
            };
            let mut likelihood = Likelihood::default();
            self.fly::<f64, Reduced>(&tried, &mut likelihood, |_, _| (), |_, _, _| ())?;
            if likelihood.0 > best.0 {
                best = (likelihood.0, tried.joint_error);
            }
        }
        Ok(best.1)
    }

    fn points<T: Real, P: Propagation<T>>(
        &self,
        preset: &MotionPreset,
        method: Method,
        least: Consistency,
    ) -> Result<(Vec<Point>, Collector, Flags)> {
        let mut points = Vec::new();
        let mut places = Vec::new();
        let mut states = Vec::new();
        let mut collector = Collector::default();
        let mut flags = Flags::default();
        let mut activity = Vec::new();
        let mut last = self
            .measured
            .samples
            .first()
            .map_or(0.0, |first| first.time);
        progress::stage("filtering");
        self.fly::<T, P>(
            preset,
            &mut (),
            |_, _| (),
            |index, filter, estimate| {
                activity.push(filter.activity().map(Real::to_f64));
                if (index + 1).is_multiple_of(whole::STRIDE) {
                    states.push(filter.state().cast());
                }
                let (Some(estimate), Some(instant)) =
                    (estimate, self.measured.samples.get(index + 1))
                else {
                    return;
                };
                let watch = estimate.watch.cast();
                let consistency = estimate.consistency.max(least);
                collector.take(&watch, consistency, instant.time, instant.time - last);
                last = instant.time;
                flags.count_faults(estimate.faults);
                let deviation = estimate.deviation.map(Real::to_f64);
                places.push((index + 1) / whole::STRIDE);
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
        if method == Method::Smooth {
            let known = self.whole(preset, &states, &activity)?;
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
        Ok((points, collector, flags))
    }

    fn point(
        &self,
        time: f64,
        inputs: &Inputs<f64>,
        deviation: &Difference<f64>,
        motion: &Motion<f64>,
    ) -> Point {
        let deviation = deviation.fixed_rows::<12>(MUSCLE).into_owned();
        Point {
            time,
            inputs: InputRow::of(time, inputs).with_muscles(&self.muscles_at(time)),
            deviation: InputRow::of(time, &inputs_of(&deviation)),
            normalised_innovation: 1.0,
            consistency: None,
            watched: Watched::of_all(f64::NAN),
            motion: Some(*motion),
        }
    }

    /// Solves for the whole flight: the state at its start and at the end of each interval.
    fn whole(
        &self,
        preset: &MotionPreset,
        states: &[FlightState<f64>],
        activity: &[[f64; 3]],
    ) -> Result<Vec<Known>> {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "only a few samples"
        )]
        let before = (AWAKE_BEFORE * self.measured.rate).round() as usize;
        let awake = |index: usize| {
            let end = (index + before).min(activity.len());
            let ahead = activity.get(index..end).unwrap_or_default();
            let most = |axis: usize| ahead.iter().map(|level| level[axis]).fold(0.0, f64::max);
            [0, 1, 2].map(most)
        };
        let instants = self.measured.samples.iter().enumerate();
        let begin = self.measured.samples.first().map_or(0.0, |i| i.time);
        let samples = instants.map(|(index, instant)| Sample {
            time: instant.time - begin,
            posture: instant.posture,
            motion: instant.motion,
            muscles: self.muscles_at(instant.time),
            // The filter's first activity belongs to the second instant.
            activity: awake(index.saturating_sub(1)),
        });
        let model = (&self.dynamics, &self.applied);
        let all = f64::from(preset.joint_error);
        let segments = self
            .segments
            .map(|errors| errors.map(|_, error| error / all));
        Whole::new(preset, model, segments, samples.collect(), states).solve()
    }
}
