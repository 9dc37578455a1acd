//! Fusing a measurement: each channel behind its gate, then the state moved by what all of them say.

use nalgebra::SVector;

use super::constants::{Constant, Constants, WIND};
use super::covariance;
use super::estimate::{ChannelEstimate, Recorder};
use super::filter::MotionFilter;
use super::measurement::{
    BAROMETER_CHANNEL, FORCE_CHANNELS, Prediction, RATE_CHANNELS, RECEIVER_CHANNELS, Row,
    SensorMeasurement,
};
use super::rejection::{Rejection, Verdict, coordinates, explaining};
use super::repeats::BELIEVED;
use super::state::{
    ATTITUDE, Difference, MOTION_STATES, RESIDUAL_FORCE, SPIN, STATES, VELOCITY, input_vector,
};
use super::support::Situation;
use super::update::Innovation;
use super::watch::Consistency;
use crate::dynamics::interval::Interval;
use crate::estimator::factor::Cholesky;
use crate::estimator::limits::limit;
use crate::estimator::propagation::Propagation;
use crate::frame::{Rotation, Vector};
use crate::math::Real;

/// Error that a motion may have whose attitude, velocity or angular velocity turned out wrong: attitude (rad), velocity
/// (m/s), angular velocity (rad/s).
const MISLED: [f32; 3] = [0.05, 3.0, 0.3];

/// Largest difference from a prediction that a measurement may have, in the unit of its channel: that of the air's force in
/// a storm. More is a prediction that went wrong.
const LARGEST_INNOVATION: f32 = 4096.0;

/// Deviation of the velocity (m/s) beyond which the derivatives of the air's force mean nothing.
const UNCLEAR: f32 = 6.0;

/// Correction of the state and of the constants by the channels fused so far.
pub(super) struct Moved<T: Real> {
    state: Difference<T>,
    constants: Constant<T>,
    /// Whether what was believed of a quantity was given up.
    reset: bool,
    /// Whether the filter follows its sensors again after it was lost.
    recovered: bool,
    /// Whether the filter was consistent before.
    trusted: bool,
}

/// A channel as the filter sees it: its innovation, and its derivative with respect to the first coordinates.
struct Look<T: Real> {
    innovation: T,
    slope: SVector<T, STATES>,
    reach: usize,
    direct: Constant<T>,
}

impl<T: Real> Look<T> {
    fn slope(&self) -> &[T] {
        self.slope.as_slice().get(..self.reach).unwrap_or_default()
    }

    fn along(&self, moved: &Difference<T>) -> T {
        let pairs = self.slope().iter().zip(moved.iter());
        pairs.fold(T::zero(), |sum, (slope, moved)| sum + *slope * *moved)
    }
}

impl<T: Real, P: Propagation<T>> MotionFilter<T, P> {
    /// Fuses a measurement.
    #[inline(never)]
    pub(super) fn take(
        &mut self,
        measured: &SensorMeasurement<T>,
        recorder: &mut impl Recorder<T>,
    ) {
        let Some(interval) = &self.interval else {
            return;
        };
        let prediction = Prediction::of(&self.state, interval);
        let cg = interval.cg().components;
        let measured = self
            .held
            .joined(measured, &prediction.motion, &self.trail, self.duration);
        let mut measured = self.climb.with_rate(&measured, self.duration);
        self.repeats.take(&measured.motion, self.duration);
        self.lasting.take(&measured);
        self.turned_back.pass(self.duration);
        self.constants.concern(&measured);
        if measured.measures(RATE_CHANNELS.start) {
            self.scale.concern(measured.reads(RATE_CHANNELS.start));
        }
        let updraft = self.dynamics.air.velocity.up();
        self.support
            .take(&measured, &prediction.motion, updraft, self.duration);
        let mut moved = Moved {
            state: Difference::zeros(),
            constants: Constant::zeros(),
            reset: false,
            recovered: false,
            trusted: false,
        };
        let is_supported = self.support.situation() == Situation::Supported;
        let is_carried = is_supported || measured.is_still;
        moved.reset |= self.assumed.take(&measured, is_carried, self.duration);
        if measured.specific_force.is_some() && !self.is_velocity_clear() {
            measured.specific_force = None;
        }
        moved.trusted = self.watch.is_trusted();
        let mut fused = [false; 2];
        let mut followed = true;
        for k in 0..self.channels.len() {
            if measured.measures(k) {
                let done = self.take_channel(k, &measured, &prediction, &cg, &mut moved, recorder);
                fused[usize::from(k >= RATE_CHANNELS.end)] |= done;
                followed &= done;
            }
        }
        // What is rejected tells nothing of the rate.
        let is_fused = self.channels[..RATE_CHANNELS.end].iter().all(|c| c.fused);
        let attitude = measured.motion.inertial_from_body.filter(|_| is_fused);
        let read = measured.gyroscope.map(|read| {
            let spin = read.angular_velocity.components;
            spin - self.constants.bias()
        });
        let spin = measured.motion.angular_velocity.map(|spin| spin.components);
        self.pace.take(
            attitude.as_ref().map(Rotation::quaternion),
            spin.or(read),
            self.duration,
        );
        if attitude.is_none() {
            let spin = &prediction.motion.angular_velocity.components;
            let drift = self.scale.drift(spin, self.duration);
            for (k, variance) in drift.iter().enumerate() {
                self.factors.add_to(ATTITUDE + k, *variance);
            }
        }
        self.watch.suspect = self.rejections.iter().any(Rejection::is_suspect);
        self.watch.pace = self.pace.wrong();
        self.watch.pass(fused, self.duration);
        followed &= fused.contains(&true) && !moved.reset;
        let consistency = self.watch.consistency();
        let misfit = self.watch.residual_consistency() != Consistency::Consistent;
        moved.recovered = (self.recovery).take(consistency, misfit, followed, self.duration);
        self.settle(&moved);
    }

    /// Fuses a channel; returns whether it was.
    #[inline(never)]
    fn take_channel(
        &mut self,
        k: usize,
        measured: &SensorMeasurement<T>,
        prediction: &Prediction<T>,
        cg: &nalgebra::Vector3<T>,
        moved: &mut Moved<T>,
        recorder: &mut impl Recorder<T>,
    ) -> bool {
        let repeated = self.repeats.time(k);
        self.watch.channels[k].repeated = repeated;
        let Some(look) = self.look(k, measured, prediction, cg) else {
            if !measured.is_superseded(k) {
                self.faults.measurement = true;
                self.watch.take_unusable(k, self.duration);
                self.rejections[k].contradict();
                self.channels[k].rejected = true;
            }
            return false;
        };
        if repeated > T::single(BELIEVED) {
            return false;
        }
        let spin = &prediction.motion.angular_velocity.components;
        let noise = measured
            .stated_variance(k)
            .unwrap_or_else(|| self.noise.variance(k, spin));
        let noise = noise + self.unmodelled(k, spin);
        let mut seen = self.factors.see(look.slope());
        let constants = self.constants.see(look.slope(), &look.direct);
        let mut own = seen.variance + noise;
        let mut variance = own + constants.variance();
        let value = look.innovation - look.along(&moved.state) - look.direct.dot(&moved.constants);
        let normalised = value / variance.root();
        let square = normalised * normalised;
        // NaN is not within the gate, so it is rejected.
        let within = square <= self.gate;
        let trusted = within || moved.trusted && self.watch.follows(k);
        self.watch.take(k, normalised, !within, self.duration);
        self.activity.take(k, normalised);
        self.squares[0] += if within { square } else { self.gate };
        self.squares[1] += T::one();
        let verdict = if self.is_outranked(k) {
            Verdict::Gate
        } else {
            self.rejections[k].judge(k, [value, noise], within, trusted)
        };
        if k < RATE_CHANNELS.start && verdict == Verdict::Reset {
            self.turn_attitude(measured, prediction);
        }
        if verdict != Verdict::Gate && value.is_finite() {
            self.give_up(k, value * value, &look, moved);
            if verdict == Verdict::Return {
                self.rejections.iter_mut().for_each(Rejection::excuse);
            }
            seen = self.factors.see(look.slope());
            own = seen.variance + noise;
            variance = own + constants.variance();
        }
        let fused = within || verdict != Verdict::Gate;
        self.channels[k] = ChannelEstimate {
            innovation: value,
            variance,
            fused,
            rejected: !within,
        };
        if fused {
            let mut spread = self.factors.update(&seen, own);
            let through = self.constants.update(&constants, own, &mut spread);
            let gain = value / variance;
            moved.state += spread * gain;
            moved.constants += through * gain;
            recorder.weighed(k, &Innovation { value, variance }, &spread);
            if look.reach == MOTION_STATES {
                let row = Row {
                    innovation: look.innovation,
                    slope: look.slope.fixed_rows::<MOTION_STATES>(0).into_owned(),
                };
                recorder.taken(&row, &Innovation { value, variance }, &spread);
            }
        }
        fused
    }

    /// Whether a channel is not believed against the filter: a barometer, which the flow around a body disturbs, as long as
    /// a receiver tells the velocity.
    fn is_outranked(&self, k: usize) -> bool {
        k == BAROMETER_CHANNEL && self.watch.is_heard(RECEIVER_CHANNELS.end - 1)
    }

    /// Takes a jump of the attitude; one that is back where it was is no longer suspect.
    fn turn_attitude(&mut self, measured: &SensorMeasurement<T>, prediction: &Prediction<T>) {
        let predicted = prediction.motion.inertial_from_body;
        let is_back = measured.motion.inertial_from_body.is_some_and(|attitude| {
            self.turned_back
                .jump(predicted.quaternion(), attitude.quaternion())
        });
        if is_back {
            for rejection in &mut self.rejections[..RATE_CHANNELS.start] {
                rejection.pardon();
            }
            self.rejections.iter_mut().for_each(Rejection::excuse);
        }
    }

    /// Gives up what the filter believed of a channel's quantity, as far as the innovation's square asks for: the filter
    /// is wrong, not the sensor.
    fn give_up(&mut self, k: usize, square: T, look: &Look<T>, moved: &mut Moved<T>) {
        for coordinate in coordinates(k) {
            // A force is measured as an acceleration; all other channels have the unit of their coordinate.
            let slope = if FORCE_CHANNELS.contains(&k) {
                look.slope()
                    .get(coordinate)
                    .copied()
                    .unwrap_or_else(T::zero)
            } else {
                T::one()
            };
            let largest = covariance::unknown::<T>(coordinate);
            self.factors
                .add_to(coordinate, explaining(square, slope, largest));
        }
        self.watch.restart(k);
        moved.reset = true;
        if (RATE_CHANNELS.end..BAROMETER_CHANNEL).contains(&k) {
            self.constants.concern_wind();
        }
    }

    /// Compares a channel with its prediction; `None` if the measurement is not plausible.
    fn look(
        &self,
        k: usize,
        measured: &SensorMeasurement<T>,
        prediction: &Prediction<T>,
        cg: &nalgebra::Vector3<T>,
    ) -> Option<Look<T>> {
        let mut slope = SVector::<T, STATES>::zeros();
        let airflow = FORCE_CHANNELS.contains(&k);
        let (mut innovation, reach) = if airflow {
            let sensor = measured.specific_force?;
            let axis = k - FORCE_CHANNELS.start;
            let motion = &prediction.motion;
            let predicted = self.airflow.at(
                &(sensor.arm.components - cg),
                motion.inertial_from_body.quaternion(),
                &motion.angular_velocity.components,
                self.duration,
            );
            slope = predicted.slope(axis, &self.slope);
            (
                sensor.force.components[axis] - predicted.force[axis],
                STATES,
            )
        } else {
            let row = prediction.row(k, measured)?;
            slope
                .fixed_rows_mut::<MOTION_STATES>(0)
                .copy_from(&row.slope);
            (row.innovation, MOTION_STATES)
        };
        let gyroscope = measured.reads(k);
        if gyroscope {
            innovation -= self.constants.bias()[k - RATE_CHANNELS.start];
        }
        let direct = Constants::direct(k, slope.as_slice(), gyroscope, airflow);
        // False for NaN.
        let is_plausible = innovation.abs() <= T::single(LARGEST_INNOVATION);
        is_plausible.then_some(Look {
            innovation,
            slope,
            reach,
            direct,
        })
    }

    /// Variance of a channel beyond the noise of its sensor: the acceleration that the model misses, and the scale of a
    /// gyroscope at an angular velocity `spin` (rad/s).
    fn unmodelled(&self, k: usize, spin: &nalgebra::Vector3<T>) -> T {
        if RATE_CHANNELS.contains(&k) {
            self.scale.variance(spin)[k - RATE_CHANNELS.start]
        } else if FORCE_CHANNELS.contains(&k) {
            let [velocity, _] = self.process.motion_noise();
            velocity / (self.duration * self.duration)
        } else {
            T::zero()
        }
    }

    /// Moves the state, and keeps everything within its limits.
    fn settle(&mut self, moved: &Moved<T>) {
        let Some(interval) = &self.interval else {
            return;
        };
        self.faults.covariance |= self.factors.keep_positive();
        self.faults.covariance |= self.constants.settle(&moved.constants);
        let wind = Vector::new(moved.constants[WIND], moved.constants[WIND + 1], T::zero());
        let air = self.dynamics.air.velocity + wind;
        if air.is_finite() && air.norm_squared() <= T::of(100.0 * 100.0) {
            self.dynamics.air.velocity = air;
        }
        let mut next = self.state.moved(&moved.state, interval);
        next.limit_inputs();
        if next.is_finite() {
            self.state = next;
        } else {
            self.faults.update = true;
        }
        if limit(&mut self.state.motion, interval) {
            self.faults.motion = true;
        }
        if covariance::limit(&mut self.factors) {
            self.constants.disconnect();
        }
        if moved.reset {
            self.watch.begin_again();
            // A motion of which one part was wrong misled the others, and the inputs.
            for (first, deviation) in [ATTITUDE, VELOCITY, SPIN].into_iter().zip(MISLED) {
                for k in first..first + 3 {
                    self.factors.add_to(k, T::single(deviation * deviation));
                }
            }
        }
        let is_left = moved.reset || moved.recovered;
        if is_left {
            self.forget_inputs();
        }
        self.lasting.pass(is_left, self.duration);
        self.keep_assumption();
        if moved.recovered {
            self.activity.calm();
            self.watch.renew();
        }
        self.process.set_activity(self.activity.level());
        self.watch_residual();
    }

    /// Whether the velocity is known well enough for the air's force, which is quadratic in it.
    fn is_velocity_clear(&self) -> bool {
        let largest = T::single(UNCLEAR * UNCLEAR);
        (VELOCITY..SPIN).all(|k| self.factors.variance(k) < largest)
    }

    /// Keeps a velocity that is only assumed as uncertain as it is.
    fn keep_assumption(&mut self) {
        for (k, least) in self.assumed.variances().into_iter().enumerate() {
            if least > T::zero() {
                let missing = least - self.factors.variance(VELOCITY + k);
                if missing > T::zero() {
                    self.factors.add_to(VELOCITY + k, missing);
                }
            }
        }
    }

    /// Compares the residual load with the load that joint errors can cause.
    fn watch_residual(&mut self) {
        let inputs = input_vector(&self.state.inputs);
        let residual = inputs.fixed_rows::<6>(RESIDUAL_FORCE - MOTION_STATES);
        let factor = Cholesky::new(&self.process.residual_covariance());
        let whitened = factor.solve_transposed(&residual.transpose());
        let mean = whitened.norm_squared() / T::of(6.0);
        self.watch.take_residual(mean, self.duration);
    }
}
