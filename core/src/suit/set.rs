//! All sensors of a person: postures from their readings.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use super::fill::{Orientation, filled};
pub use super::relative::pairs_of;
use super::relative::{Comparison, Errors, Mounted, Relative};
pub use super::sensor::Fitted;
use super::sensor::{Sensor, in_axes, link, matrix};
use super::strapdown::{LONGEST_INTERVAL, Reading, Strapdown};
use super::watch::{Fault, Watch};
use crate::air::STANDARD_GRAVITY;
use crate::body::posture::Posture;
use crate::body::{Body, Segment, SegmentArray};
use crate::frame::{Body as BodyFrame, Inertial, Rotation, facing_north};
use crate::math::{Real, normalized};

/// Time over which forces are averaged before neighbours are compared (s).
const WINDOW: f64 = 0.2;
/// Standard deviation of the mean force at a joint (m/s2), each axis: soft tissue, and what the joint's place is off.
const FORCE: f64 = 1.0;
/// Angle of the whole body after which turns are compared (rad), the longest time for it (s), and how far the joint
/// turns meanwhile, standard deviation (rad).
const FULL_TURN: f64 = core::f64::consts::TAU;
const LONGEST_TURN: f64 = 6.0;
const JOINT: f64 = 0.6;
/// At rest: largest angular velocity (rad/s) and difference of the force from gravity (m/s2) of the pelvis, and the
/// standard deviation of the force (m/s2).
const REST: [f64; 3] = [0.2, 0.4, 0.7];
/// Noise of a gyroscope (rad/s per root Hz).
const NOISE: f64 = 0.000_17;
/// Standard deviation of a segment relative to its sensor, each axis: soft tissue, and axes that are no hinges (rad). On the
/// trunk sensors lie on bones. In the recordings of docs/suit.md it is about twice as much.
const TISSUE: f32 = 0.03;
const BONE: f32 = 0.01;
/// Error of the first attitude's tilt (rad).
const TILT: f64 = 0.01;

/// Why a set of sensors cannot be used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SetError {
    /// No sensor at the pelvis, which is the reference.
    NoPelvis,
    /// Two sensors on one segment.
    Twice(Segment),
    /// More sensors than there is room for.
    TooMany,
}

/// A set of up to `N` sensors; `P` is [`pairs_of`] `N`.
#[derive(Debug, Clone)]
pub struct Suit<T: Real, const N: usize, const P: usize> {
    pub(super) sensors: heapless::Vec<Sensor<T>, N>,
    relative: Relative<T, N, P>,
    window: T,
    turning: T,
    /// Time since the errors were last set (s).
    age: T,
    /// Integral of the mismatches of neighbours since the first pose, and its time (s).
    misfit: [T; 2],
    is_on_ground: bool,
}

/// A posture with its covariances.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SuitPosture<T: Real> {
    /// Attitude of the pelvis; its heading is relative to that in the first pose, which is north.
    pub inertial_from_body: Rotation<T, Inertial, BodyFrame>,
    /// Angular velocity of the pelvis (rad/s, body axes).
    pub angular_velocity: Vector3<T>,
    /// Specific force at the sensor of the pelvis (m/s2, inertial axes).
    pub specific_force: Vector3<T>,
    /// The segments relative to the pelvis.
    pub orientations: SegmentArray<Orientation<T>>,
}

impl<T: Real> SuitPosture<T> {
    /// The posture.
    pub fn posture(&self) -> Posture<T> {
        Posture::from_body_rotations(&self.orientations.map(|_, o| o.body_from_segment))
    }
}

/// Variance of a segment relative to the pelvis by what lies between them and their sensors, each axis (rad2).
const fn tissue(segment: Segment) -> f32 {
    let own = match segment {
        Segment::Pelvis | Segment::Abdomen | Segment::Thorax | Segment::Head => BONE,
        _ => TISSUE,
    };
    own * own + BONE * BONE
}

impl<T: Real, const N: usize, const P: usize> Suit<T, N, P> {
    /// Starts with a person who stands still in `pose`, facing north by definition.
    ///
    /// # Errors
    /// Returns an error if the set is incomplete or contradicts itself.
    pub fn new(fitted: &[Fitted<T>], body: &Body<T>, pose: &Posture<T>) -> Result<Self, SetError> {
        let index = |segment: Segment| fitted.iter().position(|f| f.segment == segment);
        if index(Segment::Pelvis).is_none() {
            return Err(SetError::NoPelvis);
        }
        let mut sensors = heapless::Vec::new();
        for (place, one) in fitted.iter().enumerate() {
            if index(one.segment) != Some(place) {
                return Err(SetError::Twice(one.segment));
            }
            let sensor = Sensor::new(one, link(one, fitted, body));
            sensors.push(sensor).map_err(|_| SetError::TooMany)?;
        }
        let mut suit = Self {
            sensors,
            relative: Relative::new(),
            window: T::zero(),
            turning: T::zero(),
            age: T::zero(),
            misfit: [T::zero(); 2],
            is_on_ground: true,
        };
        let upright = facing_north::<T>(T::zero()).quaternion().into_inner();
        suit.place(pose, |segment_from_sensor, body_from_segment| {
            normalized(upright * body_from_segment * segment_from_sensor)
        });
        Ok(suit)
    }

    /// Sets attitudes and errors as in a pose.
    fn place(
        &mut self,
        pose: &Posture<T>,
        attitude: impl Fn(nalgebra::Quaternion<T>, nalgebra::Quaternion<T>) -> UnitQuaternion<T>,
    ) {
        let body_from_segments = pose.body_from_segments();
        for (index, sensor) in self.sensors.iter_mut().enumerate() {
            let mounting = &sensor.mounting;
            let of_segment = body_from_segments[sensor.segment];
            sensor.strapdown = Strapdown::new(attitude(
                mounting.segment_from_sensor.into_inner(),
                of_segment.into_inner(),
            ));
            let square = |value: T| value * value;
            let (tilt, heading) = (
                square(mounting.tilt_deviation),
                square(mounting.heading_deviation),
            );
            let level = square(T::of(TILT));
            // The pose is off by a tilt, which gravity keeps out of the attitude, and by a heading, which it does not.
            let attitude = Matrix3::from_diagonal(&Vector3::new(level, level, heading + tilt));
            let mounted = Mounted {
                vertical: of_segment.inverse() * Vector3::z(),
                tilt,
                heading,
            };
            self.relative.set(index, attitude, mounted);
            sensor.by_gain = Matrix3::zeros();
            sensor.gain_variance = Vector3::zeros();
            sensor.turned = Vector3::zeros();
            sensor.restart();
        }
        self.window = T::zero();
        self.turning = T::zero();
        self.age = T::zero();
    }

    /// Says whether the person stands on the ground or in an aircraft, where gravity can be told at rest. Not in a
    /// fall, whose force is no gravity.
    pub fn set_on_ground(&mut self, is_on_ground: bool) {
        self.is_on_ground = is_on_ground;
    }

    /// Takes one sample of all sensors, in their order, `duration` (s) after the last; `None` for one that was lost.
    pub fn push(&mut self, readings: &[Option<Reading<T>>], duration: T) {
        if !(duration > T::zero() && duration <= T::of(LONGEST_INTERVAL)) {
            return;
        }
        for (index, sensor) in self.sensors.iter_mut().enumerate() {
            let reading = readings.get(index).copied().flatten();
            sensor.take(reading.filter(Reading::is_finite).as_ref(), duration);
        }
        self.window += duration;
        self.turning += duration;
        if self.window >= T::of(WINDOW) {
            self.close_window();
        }
    }

    /// Compares neighbours, and begins the next window.
    fn close_window(&mut self) {
        let window = self.window;
        self.grow(window);
        for index in 0..self.sensors.len() {
            self.compare_forces(index, window);
        }
        self.compare_turns();
        for sensor in &mut self.sensors {
            sensor.restart();
        }
        self.window = T::zero();
    }

    /// Adds what the gyroscopes drifted.
    fn grow(&mut self, window: T) {
        let age = self.age;
        self.age += window;
        for (index, sensor) in self.sensors.iter_mut().enumerate() {
            let gyroscope = &sensor.gyroscope;
            let bias = gyroscope.bias_deviation * gyroscope.bias_deviation;
            let drift = bias * window * (T::of(2.0) * age + window) + T::of(NOISE * NOISE) * window;
            let gain = gyroscope.gain_deviation;
            let mut growth = Vector3::repeat(drift);
            for axis in 0..3 {
                let row = sensor.by_gain.row(axis);
                let variance = (0..3).fold(T::zero(), |sum, k| {
                    let error = row[k] * gain[k];
                    sum + error * error
                });
                if variance > sensor.gain_variance[axis] {
                    growth[axis] += variance - sensor.gain_variance[axis];
                    sensor.gain_variance[axis] = variance;
                }
            }
            self.relative.grow(index, &growth);
        }
    }

    fn compare_forces(&mut self, index: usize, window: T) {
        let Some(sensor) = self.sensors.get(index) else {
            return;
        };
        let square = |value: T| value * value;
        let Some(link) = sensor.link else {
            let [still, gravity, deviation] = REST.map(T::of);
            let force = sensor.pushed / window;
            let up = T::of(STANDARD_GRAVITY);
            let is_still = sensor.strapdown.rate().norm_squared() < square(still)
                && (force.norm_squared().root() - up).abs() < gravity;
            if self.is_on_ground && is_still && !sensor.has_lost {
                let (errors, _) = self.relative.compare(&Comparison {
                    pair: (index, None),
                    seen: force,
                    expected: Vector3::new(T::zero(), T::zero(), up),
                    variance: square(deviation),
                });
                self.correct(errors);
            }
            return;
        };
        let Some(parent) = self.sensors.get(link.parent()) else {
            return;
        };
        if sensor.has_lost || parent.has_lost || sensor.watch.is_dead() || parent.watch.is_dead() {
            return;
        }
        let (own, own_lever) = sensor.force_at(&link.from_own, window);
        let (other, other_lever) = parent.force_at(&link.from_parent, window);
        let lever = (own_lever.norm_squared() + other_lever.norm_squared()).root();
        let variance = square(T::of(FORCE)) + square(link.lever() * lever);
        let (errors, mismatch) = self.relative.compare(&Comparison {
            pair: (index, Some(link.parent())),
            seen: own,
            expected: other,
            variance,
        });
        self.correct(errors);
        if let Some(sensor) = self.sensors.get_mut(index) {
            sensor.watch.mismatched(mismatch, window);
            let [sum, time] = &mut self.misfit;
            *sum += Watch::counted(mismatch) * window;
            *time += window;
        }
    }

    /// The segments with a sensor, in the order of the sensors.
    pub fn segments(&self) -> impl Iterator<Item = Segment> {
        self.sensors.iter().map(|sensor| sensor.segment)
    }

    /// Mean mismatch of neighbours since the first pose (1 is expected of the worst that is allowed for): it is least if
    /// every sensor is where it is said to be. `None` before the first comparison.
    pub fn misfit(&self) -> Option<T> {
        let [sum, time] = self.misfit;
        (time > T::zero()).then(|| sum / time)
    }

    /// Compares the turns of the whole body, once it has turned about itself.
    fn compare_turns(&mut self) {
        let turn = T::of(FULL_TURN);
        let root = self.sensors.iter().find(|sensor| sensor.link.is_none());
        let turned = root.map_or(T::zero(), |root| root.turned.norm_squared());
        if turned >= turn * turn {
            for index in 0..self.sensors.len() {
                let Some((own, other, parent)) = self.turns_of(index) else {
                    continue;
                };
                let (errors, _) = self.relative.compare(&Comparison {
                    pair: (index, Some(parent)),
                    seen: own,
                    expected: other,
                    variance: T::of(JOINT * JOINT),
                });
                self.correct(errors);
            }
        } else if self.turning < T::of(LONGEST_TURN) {
            return;
        }
        self.turning = T::zero();
        for sensor in &mut self.sensors {
            sensor.turned = Vector3::zeros();
        }
    }

    fn turns_of(&self, index: usize) -> Option<(Vector3<T>, Vector3<T>, usize)> {
        let sensor = self.sensors.get(index)?;
        let parent = sensor.link?.parent();
        let other = self.sensors.get(parent)?;
        let is_alive = !sensor.watch.is_dead() && !other.watch.is_dead();
        is_alive.then_some((sensor.turned, other.turned, parent))
    }

    /// Takes errors back.
    fn correct(&mut self, errors: Option<Errors<T, N>>) {
        let Some(errors) = errors else { return };
        for (sensor, [attitude, mounting]) in self.sensors.iter_mut().zip(&errors) {
            sensor.strapdown.correct(attitude);
            let own = &mut sensor.mounting.segment_from_sensor;
            let mut turned = Strapdown::new(*own);
            turned.correct(mounting);
            *own = turned.reference_from_sensor;
        }
    }

    /// The posture now.
    pub fn posture(&self) -> SuitPosture<T> {
        let mut measured = SegmentArray::from_fn(|_| None);
        let pelvis = self.sensors.iter().enumerate();
        let pelvis = pelvis.clone().find(|(_, sensor)| sensor.link.is_none());
        let Some((root, pelvis)) = pelvis else {
            return SuitPosture {
                inertial_from_body: Rotation::identity(),
                angular_velocity: Vector3::zeros(),
                specific_force: Vector3::zeros(),
                orientations: filled(&measured),
            };
        };
        let reference_from_body = pelvis.reference_from_segment();
        let body_from_reference = reference_from_body.inverse();
        let of_body = matrix(&reference_from_body);
        for (index, sensor) in self.sensors.iter().enumerate() {
            if index == root || sensor.watch.is_dead() || self.has_slipped(index) {
                continue;
            }
            let reference_from_segment = sensor.reference_from_segment();
            let of_segment = matrix(&reference_from_segment);
            let covariance = self
                .relative
                .between((index, &of_segment), (root, &of_body));
            let tissue = Matrix3::from_diagonal_element(T::single(tissue(sensor.segment)));
            measured[sensor.segment] = Some(Orientation {
                body_from_segment: normalized(
                    body_from_reference.into_inner() * reference_from_segment.into_inner(),
                ),
                covariance: in_axes(&covariance, &reference_from_body) + tissue,
                is_measured: true,
            });
        }
        let mounted = pelvis.mounting.segment_from_sensor;
        SuitPosture {
            inertial_from_body: Rotation::from_quaternion(reference_from_body),
            angular_velocity: mounted * pelvis.strapdown.rate(),
            specific_force: pelvis.force,
            orientations: filled(&measured),
        }
    }

    /// The worst fault of each sensor that has one, in the order of the sensors.
    pub fn faults(&self) -> impl Iterator<Item = (Segment, Fault)> {
        let each = self.sensors.iter().enumerate();
        each.filter_map(|(index, sensor)| Some((sensor.segment, self.fault(index)?)))
    }

    fn fault(&self, index: usize) -> Option<Fault> {
        let watch = &self.sensors.get(index)?.watch;
        // A sensor that lost turns feels other forces too.
        let slipped = || self.has_slipped(index).then_some(Fault::Slipped);
        watch.fault().or_else(slipped)
    }

    /// Whether a sensor slipped. Of two that disagree it is the one that also disagrees with another, or else the outer
    /// one; it is the pelvis if all its neighbours disagree with it.
    fn has_slipped(&self, index: usize) -> bool {
        let Some(sensor) = self.sensors.get(index) else {
            return false;
        };
        let Some(link) = sensor.link else {
            return self.pelvis_slipped(index);
        };
        let is_inner_one =
            self.sensors
                .get(link.parent())
                .is_some_and(|parent| match parent.link {
                    Some(_) => parent.watch.is_suspect(),
                    None => self.pelvis_slipped(link.parent()),
                });
        sensor.watch.disagrees() && !is_inner_one
    }

    fn pelvis_slipped(&self, index: usize) -> bool {
        let linked = |sensor: &&Sensor<T>| sensor.link.is_some_and(|link| link.parent() == index);
        let mut neighbours = self.sensors.iter().filter(linked);
        let all = neighbours.clone().count();
        all > 1 && neighbours.all(|sensor| sensor.watch.disagrees())
    }
}
