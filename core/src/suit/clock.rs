//! Clocks of worn sensors: what two neighbours feel at their common joint, the later one feels later.
//!
//! The difference of the two forces is the delay times the change of the force, so a regression shows the delay. It needs
//! forces that change: a march, in which the whole body rises and falls.

use nalgebra::Vector3;

use super::sensor::Sensor;
use super::set::Suit;
use crate::math::Real;

/// Time within which differences of forces are alike (s): errors of attitude and soft tissue.
const ALIKE: f64 = 0.2;
/// Least time of samples from which a delay follows (s).
const LEAST_TIME: f64 = 3.0;
/// Least change of the force from which it follows, root of its mean square (m/s3).
const LEAST_CHANGE: f64 = 4.0;

/// Forces at a joint by the sensor and by its neighbour (m/s2, reference axes).
type Pair<T> = [Vector3<T>; 2];

#[derive(Debug, Clone, Copy)]
struct Joint<T: Real> {
    /// The last pair of forces, and the one before.
    last: [Option<Pair<T>>; 2],
    /// Sums over time of the change of the force with the difference, of its square, and of that of the difference.
    sums: [T; 3],
    time: T,
}

/// Compares the clocks of a set.
#[derive(Debug, Clone, Copy)]
pub struct Clocks<T: Real, const N: usize> {
    joints: [Joint<T>; N],
    rates: [Option<Vector3<T>>; N],
}

impl<T: Real, const N: usize> Default for Clocks<T, N> {
    fn default() -> Self {
        let joint = Joint {
            last: [None; 2],
            sums: [T::zero(); 3],
            time: T::zero(),
        };
        Self {
            joints: [joint; N],
            rates: [None; N],
        }
    }
}

impl<T: Real, const N: usize> Clocks<T, N> {
    /// Takes the sample that the set took last, `duration` (s) after the one before.
    pub fn take<const P: usize>(&mut self, suit: &Suit<T, N, P>, duration: T) {
        let has_passed = duration > T::zero();
        if !has_passed {
            return;
        }
        let mut turning = [None; N];
        for ((sensor, before), turning) in
            (suit.sensors.iter().zip(&mut self.rates)).zip(&mut turning)
        {
            let rate = sensor.strapdown.rate();
            *turning = before.map(|before| (rate - before) / duration);
            *before = (!sensor.has_lost).then_some(rate);
        }
        let felt = |index: usize, place: &Vector3<T>| {
            let sensor = suit.sensors.get(index)?;
            Some(force_now(sensor, place, turning.get(index)?.as_ref()?))
        };
        for (index, (sensor, joint)) in suit.sensors.iter().zip(&mut self.joints).enumerate() {
            let pair = sensor.link.and_then(|link| {
                let own = felt(index, &link.from_own)?;
                Some([own, felt(link.parent(), &link.from_parent)?])
            });
            joint.take(pair, duration);
        }
    }

    /// How late each sensor is relative to the pelvis' (s), with its standard deviation; `None` if that does not show.
    pub fn delays<const P: usize>(&self, suit: &Suit<T, N, P>) -> [Option<[T; 2]>; N] {
        core::array::from_fn(|index| {
            let mut sensor = suit.sensors.get(index)?;
            let mut joint = self.joints.get(index)?;
            let (mut delay, mut variance) = (T::zero(), T::zero());
            // Towards the pelvis, which is at most so far.
            for _ in 0..N {
                let Some(link) = sensor.link else { break };
                let [own, spread] = joint.delay()?;
                delay += own;
                variance += spread;
                sensor = suit.sensors.get(link.parent())?;
                joint = self.joints.get(link.parent())?;
            }
            Some([delay, variance.root()])
        })
    }
}

impl<T: Real> Joint<T> {
    fn take(&mut self, pair: Option<Pair<T>>, duration: T) {
        if let ([Some([own, other]), Some([first, second])], Some([third, fourth])) =
            (self.last, pair)
        {
            let change = (third + fourth - first - second) / (duration * T::of(4.0));
            let gap = own - other;
            let [product, square, gaps] = &mut self.sums;
            *product += gap.dot(&change) * duration;
            *square += change.norm_squared() * duration;
            *gaps += gap.norm_squared() * duration;
            self.time += duration;
        }
        self.last = [pair, self.last[0]];
    }

    /// How much later the sensor is than its neighbour (s), and the variance of that.
    fn delay(&self) -> Option<[T; 2]> {
        let [product, square, gaps] = self.sums;
        let least = T::of(LEAST_CHANGE * LEAST_CHANGE) * self.time;
        if !(self.time > T::of(LEAST_TIME) && square > least && gaps.is_finite()) {
            return None;
        }
        let rest = gaps - product * product / square;
        let independent = self.time / T::of(ALIKE);
        Some([-product / square, rest / square / independent])
    }
}

/// Force now at a place relative to a sensor (m, sensor axes), which turns ever faster (rad/s2, sensor axes), in reference
/// axes (m/s2).
fn force_now<T: Real>(sensor: &Sensor<T>, place: &Vector3<T>, turning: &Vector3<T>) -> Vector3<T> {
    let rate = sensor.strapdown.rate();
    let around = turning.cross(place) + rate.cross(&rate.cross(place));
    sensor.force + sensor.strapdown.reference_from_sensor * around
}
