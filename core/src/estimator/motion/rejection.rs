//! When a channel that is beyond its gate is believed again, because the filter is wrong rather than the sensor.
//!
//! A sensor that is right while the filter is wrong says the same thing again and again; garbage contradicts itself.
//! So innovations beyond the gate are believed once they have agreed with each other for a while, and those that never
//! agree are not.
//!
//! If they agree from the first, right after the filter followed the sensor, then the sensor jumped, as no body can. It
//! is followed, since the filter cannot tell which value is right, but it stays suspect until it jumps back.

use super::measurement::{CHANNELS, FORCE_CHANNELS, RATE_CHANNELS};
use super::state::{ATTITUDE, RESIDUAL_FORCE, SPIN, VELOCITY};
use crate::math::Real;

/// Time for which innovations must agree (s), and how many must.
const AGREEING: (f32, u16) = (0.3, 3);
/// Number of standard deviations of the sensor by which innovations that agree may differ.
const DEVIATIONS: f32 = 5.0;
/// The same of a jump back, which is beyond the gate as the jump was.
const BACK_DEVIATIONS: f32 = 3.0;
/// How fast the innovation of a wrong filter may change: attitude (rad/s), angular velocity (rad/s2), velocity (m/s2),
/// specific force (m/s3).
const RATES: [f32; 4] = [5.0, 20.0, 15.0, 40.0];

/// Time after which a sensor that jumped is no longer suspect (s).
const SUSPECT: f32 = 60.0;
/// Time for which it stays suspect once another channel has jumped back (s): one sensor's channels are believed again
/// one after another.
const EXCUSED: f32 = 1.0;
/// Time after a jump in which the filter overshoots (s): what looks like a jump back is none.
const OVERSHOOTS: f32 = 0.25;
/// The same after the filter has lost a suspect sensor.
const LOST_TRACK: f32 = 1.5;
/// Share of a jump by which the jump back may differ.
const BACK: f32 = 0.35;

/// What to do with an innovation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Verdict {
    /// Fuse it if it is within the gate.
    Gate,
    /// Give up what was believed of this quantity, then fuse it.
    Reset,
    /// The same, after which the sensor is back where it was before it jumped.
    Return,
}

/// The innovations of a channel since one was within the gate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Rejection<T> {
    last: T,
    /// Time since the previous innovation, and for which innovations have agreed (s).
    since: T,
    agreeing: T,
    count: u16,
    /// The first innovation of the streak, and whether a later one contradicted it or the filter was not trusted.
    first: T,
    contradicted: bool,
    /// Sum of the sensor's jumps, and the time for which it stays suspect (s).
    jumped: T,
    suspect: T,
    /// Time for which another jump belongs to the return of another channel (s).
    excused: T,
}

impl<T: Real> Rejection<T> {
    pub(super) fn new() -> Self {
        Self {
            last: T::zero(),
            since: T::zero(),
            agreeing: T::zero(),
            count: 0,
            first: T::zero(),
            contradicted: false,
            jumped: T::zero(),
            suspect: T::zero(),
            excused: T::zero(),
        }
    }

    /// Whether the sensor jumped and has not jumped back.
    pub(super) fn is_suspect(&self) -> bool {
        self.suspect > T::zero()
    }

    /// Takes the sensor as no longer suspect.
    pub(super) fn pardon(&mut self) {
        self.jumped = T::zero();
        self.suspect = T::zero();
    }

    /// Takes the sensor as no longer suspect in a moment, because another channel has jumped back. This one may do so without
    /// having jumped, if it was not followed then.
    pub(super) fn excuse(&mut self) {
        let longest = T::single(EXCUSED);
        self.excused = longest;
        if self.suspect > longest {
            self.suspect = longest;
        }
    }

    /// Takes a measurement that is not plausible: it contradicts those before and after it.
    pub(super) fn contradict(&mut self) {
        self.contradicted = true;
        self.last = T::of(f64::NAN);
        if self.count == 0 {
            self.first = T::zero();
            self.count = 1;
        }
    }

    /// Whether an innovation within the gate is the jump back of a sensor that is suspect: the jump has made the filter so
    /// uncertain that the gate is wide. An attitude may overshoot, since its axes do not turn one after another.
    fn is_back_within(&self, value: T, noise: T) -> bool {
        let missing = value + self.jumped;
        let allowed = self.jumped * T::single(BACK);
        let clear = T::single(DEVIATIONS * DEVIATIONS) * noise;
        let overshoots = self.suspect > T::single(SUSPECT - OVERSHOOTS);
        self.is_suspect()
            && !overshoots
            && missing * missing <= allowed * allowed
            && value * value > clear
    }

    /// Ends a streak.
    fn end(&mut self) {
        *self = Self {
            jumped: self.jumped,
            suspect: self.suspect,
            excused: self.excused,
            ..Self::new()
        };
    }

    /// Adds the jump with which a streak of agreeing innovations began; `deviation` is that of the sensor. Returns
    /// whether it was a jump back.
    fn jump(&mut self, deviation: T) -> bool {
        let largest = if self.first.abs() > self.jumped.abs() {
            self.first.abs()
        } else {
            self.jumped.abs()
        };
        let opposite = self.first * self.jumped < T::zero();
        let large = self.first.abs() > self.jumped.abs() * T::of(0.5);
        if self.contradicted && self.is_suspect() && !(opposite && large) {
            // The filter cannot follow the sensor: neither is to be believed for a moment.
            let longest = T::single(LOST_TRACK);
            if self.suspect > longest {
                self.suspect = longest;
            }
            return false;
        }
        self.jumped += self.first;
        let tolerance = largest * T::single(BACK) + deviation * T::single(BACK_DEVIATIONS);
        let small = self.jumped.abs() <= tolerance;
        // While it follows a wrong sensor the filter may become inconsistent, and so do the jumps back.
        let back = self.contradicted || self.excused > T::zero() || small && self.is_suspect();
        if back || small {
            self.pardon();
        } else {
            self.suspect = T::single(SUSPECT);
        }
        back
    }

    /// Passes an interval of `duration` (s).
    pub(super) fn pass(&mut self, duration: T) {
        // Bounded, so that it stays exact.
        if self.since < T::of(100.0) {
            self.since += duration;
        }
        if self.excused > T::zero() {
            self.excused -= duration;
        }
        if self.is_suspect() {
            self.suspect -= duration;
            if !self.is_suspect() {
                self.pardon();
            }
        }
    }

    /// Judges an innovation of a channel with this measurement noise. `trusted` says whether the filter was consistent
    /// before it: only then can the sensor be at fault.
    pub(super) fn judge(
        &mut self,
        channel: usize,
        [value, noise]: [T; 2],
        within: bool,
        trusted: bool,
    ) -> Verdict {
        let elapsed = core::mem::replace(&mut self.since, T::zero());
        if within {
            self.end();
            if channel >= RATE_CHANNELS.start && self.is_back_within(value, noise) {
                self.pardon();
                return Verdict::Return;
            }
            return Verdict::Gate;
        }
        if self.count == 0 {
            self.first = value;
            self.contradicted = !trusted;
        }
        let drift = T::single(RATES[kind(channel)]) * elapsed;
        let sensor = T::single(2.0 * DEVIATIONS * DEVIATIONS) * noise;
        let change = match [value - self.last, value + self.last] {
            // Half a turn is the same in either direction.
            [turn, back] if kind(channel) == 0 && back.abs() < turn.abs() => back,
            [change, _] => change,
        };
        // The comparison is false for NaN.
        let agrees = self.count > 0 && change * change <= sensor + drift * drift;
        self.last = value;
        if agrees {
            self.agreeing += elapsed;
            self.count = self.count.saturating_add(1);
        } else {
            self.contradicted |= self.count > 0;
            self.agreeing = T::zero();
            self.count = 1;
        }
        let (time, number) = AGREEING;
        if self.count >= number && self.agreeing >= T::single(time) {
            let back = self.jump(noise.root());
            self.end();
            return if back {
                Verdict::Return
            } else {
                Verdict::Reset
            };
        }
        Verdict::Gate
    }
}

/// Index in [`RATES`] of the quantity of a channel.
fn kind(channel: usize) -> usize {
    match channel {
        0..3 => 0,
        3..6 => 1,
        _ if FORCE_CHANNELS.contains(&channel) => 3,
        _ => 2,
    }
}

/// The error coordinates of what a channel measures.
pub(super) fn coordinates(channel: usize) -> core::ops::Range<usize> {
    let one = |k: usize| k..k + 1;
    match channel {
        0..3 => one(ATTITUDE + channel),
        3..6 => one(SPIN + channel - 3),
        6..9 => one(VELOCITY + channel - 6),
        9 => VELOCITY..VELOCITY + 2,
        10..13 => one(VELOCITY + channel - 10),
        13 => one(VELOCITY + 2),
        14..CHANNELS => one(RESIDUAL_FORCE + channel - 14),
        _ => 0..0,
    }
}

/// The variance of a coordinate that explains an innovation of this square through a slope, at most `largest`.
pub(super) fn explaining<T: Real>(square: T, slope: T, largest: T) -> T {
    let gain = slope * slope;
    // Also where the slope is zero or NaN.
    if square < largest * gain {
        square / gain
    } else {
        largest
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn resets(values: impl Iterator<Item = f64>) -> Option<usize> {
        let mut rejection = Rejection::<f64>::new();
        values
            .map(|value| {
                rejection.pass(1.0 / 120.0);
                rejection.judge(6, [value, 0.01], value.abs() < 0.5, true)
            })
            .position(|verdict| verdict != Verdict::Gate)
    }

    #[test]
    fn a_force_is_explained_in_the_unit_of_its_coordinate() {
        // A drag area of 0.1 m2 at 50 m/s is 2 m/s2 for a person of 75 kg: the slope is 20 m/s2 per m2.
        assert!((explaining(4.0, 20.0, 1.0) - 0.01_f64).abs() < 1e-12);
        for slope in [0.0, f64::NAN, 1.0] {
            assert!((explaining(4.0, slope, 1.0) - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn what_agrees_is_believed_soon_and_what_contradicts_itself_never() {
        let steady = resets((0..240).map(|k| 20.0 + 0.1 * f64::from(k % 3))).unwrap();
        assert!((36..40).contains(&steady), "{steady}");
        let garbage =
            |k: i32| f64::from(k * 7919 % 61 - 30) + 0.5f64.copysign(f64::from(k % 2) - 0.5);
        assert_eq!(resets((0..960).map(garbage)), None);
        // A sensor that jumps is suspect until it jumps back.
        let mut rejection = Rejection::<f64>::new();
        for (size, suspect) in [(20.0, true), (-19.0, false), (8.0, true)] {
            for _ in 0..50 {
                rejection.pass(1.0 / 120.0);
                if rejection.judge(6, [size, 0.01], false, true) != Verdict::Gate {
                    break;
                }
            }
            assert_eq!(rejection.is_suspect(), suspect, "{size}");
        }
        // It stays suspect for a moment after another channel has jumped back, and takes its own jump back as one.
        rejection.excuse();
        assert!(rejection.is_suspect());
        for _ in 0..50 {
            rejection.pass(1.0 / 120.0);
            if rejection.judge(6, [-8.0, 0.01], false, true) != Verdict::Gate {
                break;
            }
        }
        assert!(!rejection.is_suspect());
        // An attitude that is half a turn away is as far in either direction.
        let mut rejection = Rejection::<f64>::new();
        let half_turn = (0..240).position(|k| {
            rejection.pass(1.0 / 120.0);
            let value = if k % 3 == 0 { 1.9 } else { -1.9 };
            rejection.judge(1, [value, 1e-4], false, true) != Verdict::Gate
        });
        assert!(
            half_turn.is_some_and(|k| (36..40).contains(&k)),
            "{half_turn:?}"
        );
        // One value within the gate ends a streak.
        let now_and_then = |k: i32| if k % 30 == 0 { 0.0 } else { 20.0 };
        assert_eq!(resets((1..960).map(now_and_then)), None);
    }

    /// Judges the same innovation of channel 6 at 120 Hz until it is more than gated, or a second is over; within the gate
    /// for a fifth of a second.
    fn judged(rejection: &mut Rejection<f64>, value: f64, within: bool) -> Verdict {
        let number = if within { 24 } else { 120 };
        let mut verdicts = (0..number).map(|_| {
            rejection.pass(1.0 / 120.0);
            rejection.judge(6, [value, 0.01], within, true)
        });
        let found = verdicts.find(|verdict| *verdict != Verdict::Gate);
        found.unwrap_or(Verdict::Gate)
    }

    #[test]
    fn implausible_values_contradict_those_between_them() {
        let mut rejection = Rejection::<f64>::new();
        for _ in 0..240 {
            rejection.pass(1.0 / 120.0);
            rejection.contradict();
            let verdict = rejection.judge(6, [20.0, 0.01], false, true);
            assert_eq!(verdict, Verdict::Gate);
        }
        // What agrees after that is believed, and no sensor is suspect because of it.
        assert_eq!(judged(&mut rejection, 20.0, false), Verdict::Return);
        assert!(!rejection.is_suspect());
    }

    #[test]
    fn a_jump_back_counts_within_a_wide_gate_too() {
        let mut rejection = Rejection::<f64>::new();
        assert_eq!(judged(&mut rejection, 9.0, false), Verdict::Reset);
        assert!(rejection.is_suspect());
        // The filter overshoots.
        assert_eq!(judged(&mut rejection, -8.0, true), Verdict::Gate);
        // Noise, or another change, is none.
        for value in [0.3, -0.3, 9.0, -4.0] {
            assert_eq!(judged(&mut rejection, value, true), Verdict::Gate);
        }
        assert_eq!(judged(&mut rejection, -8.0, true), Verdict::Return);
        assert!(!rejection.is_suspect());
    }

    #[test]
    fn a_channel_may_return_after_another_though_its_own_jump_was_missed() {
        let mut rejection = Rejection::<f64>::new();
        rejection.excuse();
        assert_eq!(judged(&mut rejection, -8.0, false), Verdict::Return);
        assert!(!rejection.is_suspect());
        // Later it is a jump.
        (0..240).for_each(|_| rejection.pass(1.0 / 120.0));
        assert_eq!(judged(&mut rejection, -8.0, false), Verdict::Reset);
        assert!(rejection.is_suspect());
    }
}
