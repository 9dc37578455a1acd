//! Sensor time without wrap-around.

/// Ticks of `SampleTimeFine` per day, after which 10- and 100-series sensors wrap.
const DAY: u32 = 864_000_000;
/// Length of a tick (us).
const TICK: u64 = 100;

/// Unwraps `SampleTimeFine` into a continuous time.
///
/// Some sensors wrap at 2^32 ticks, some after a day; the clock chooses the reading nearest to the last one. The time
/// of a GNSS solution, which is earlier than that of the packets around it, does not disturb the clock. Gaps of up to
/// half a day are bridged.
///
/// A sensor that restarts counts from zero again. A reading further back than any solution, or readings that stay back,
/// begin a new epoch: time continues from the last reading, and [`SampleClock::restarts`] counts it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct SampleClock {
    /// Latest reading and its unwrapped ticks.
    latest: Option<(u32, u64)>,
    /// The last reading that lay back, and how many have followed each other forwards since the first of them.
    back: Option<(u32, u32)>,
    restarts: u32,
}

/// A reading that lies back by more than this (ticks) is a restart: solutions are a few seconds old at most.
const LONGEST_BACK: i64 = 100_000;

/// Number of consecutive readings that lie back, each later than the one before, after which the sensor has restarted.
/// Solutions of a receiver come one at a time between other packets.
const BACK_READINGS: u32 = 4;

impl SampleClock {
    /// Creates a clock that starts with its first reading.
    pub const fn new() -> Self {
        Self {
            latest: None,
            back: None,
            restarts: 0,
        }
    }

    /// Returns the time of a reading (us). It starts at the value of the first reading, never jumps at a wrap, and
    /// continues when the sensor restarts.
    pub fn time(&mut self, fine: u32) -> u64 {
        let (last, ticks) = self.latest.unwrap_or((fine, u64::from(fine)));
        let step = nearest_step(last, fine);
        if step >= 0 {
            self.back = None;
        } else if self.has_restarted(fine, step) {
            self.back = None;
            self.restarts = self.restarts.wrapping_add(1);
            let time = ticks.saturating_add(1);
            self.latest = Some((fine, time));
            return time * TICK;
        }
        let time = ticks.saturating_add_signed(step);
        if step >= 0 {
            self.latest = Some((fine, time));
        }
        time * TICK
    }

    /// Returns by how much a reading lies behind the latest one (s), or `None` if it does not, or by more than any
    /// solution does.
    pub fn behind(&self, fine: u32) -> Option<f32> {
        let (last, _) = self.latest?;
        let step = nearest_step(last, fine);
        // Exact: below 2^24.
        let ticks = u16::try_from(-step).ok()?;
        Some(f32::from(ticks) * 1e-4)
    }

    /// Number of times that the sensor has restarted; wraps.
    pub const fn restarts(&self) -> u32 {
        self.restarts
    }

    /// Judges a reading that lies back by `step` ticks.
    fn has_restarted(&mut self, fine: u32, step: i64) -> bool {
        let count = match self.back {
            Some((before, count)) if fine >= before => count + 1,
            _ => 1,
        };
        self.back = Some((fine, count));
        step < -LONGEST_BACK || count >= BACK_READINGS
    }
}

/// Ticks from `last` to `fine`, along the shorter way for either kind of wrap.
fn nearest_step(last: u32, fine: u32) -> i64 {
    let full = i64::from(fine.wrapping_sub(last).cast_signed());
    if last >= DAY || fine >= DAY {
        return full;
    }
    let straight = i64::from(fine) - i64::from(last);
    let (day, half) = (i64::from(DAY), i64::from(DAY / 2));
    if straight < -half {
        straight + day
    } else if straight >= half {
        straight - day
    } else {
        full
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn both_wraps_are_crossed_in_both_directions() {
        for wrap in [1u64 << 32, u64::from(DAY)] {
            let mut clock = SampleClock::new();
            let reading = |ticks: u64| u32::try_from(ticks % wrap).unwrap();
            let start = wrap - 150;
            for packet in 0..4 {
                let ticks = start + packet * 100;
                assert_eq!(clock.time(reading(ticks)), ticks * 100, "{wrap} {packet}");
                // In between comes a GNSS solution that is 2.49 s old.
                let old = ticks - 24_906;
                assert_eq!(clock.time(reading(old)), old * 100, "{wrap} {packet}");
            }
        }
    }

    #[test]
    fn a_sensor_that_does_not_wrap_at_midnight_counts_on() {
        let mut clock = SampleClock::new();
        for ticks in (DAY - 500..DAY + 500).step_by(100) {
            assert_eq!(clock.time(ticks), u64::from(ticks) * 100);
        }
    }

    /// A sensor that was up for 40 minutes, and one that was up for 2 s.
    #[test]
    fn time_goes_on_after_a_restart_of_the_sensor() {
        for up in [24_000_000_u32, 20_000] {
            let mut clock = SampleClock::new();
            let mut last = clock.time(up);
            let mut stood_still = 0;
            for packet in 0..400_u32 {
                let time = clock.time(packet * 100);
                stood_still += u32::from(time <= last);
                last = last.max(time);
            }
            assert_eq!(clock.restarts(), 1, "up for {up} ticks");
            assert!(stood_still < BACK_READINGS, "{stood_still} of 400 lost");
            assert!(last <= (u64::from(up) + 40_000) * TICK);
            assert!(last >= (u64::from(up) + 39_500) * TICK);
        }
    }

    #[test]
    fn solutions_of_a_receiver_are_not_restarts() {
        let mut clock = SampleClock::new();
        for packet in 0..4_000_u32 {
            clock.time(1_000_000 + packet * 25);
            if packet % 40 == 0 {
                clock.time(1_000_000 + packet * 25 - 25_000);
            }
        }
        assert_eq!(clock.restarts(), 0);
    }

    proptest! {
        #[test]
        fn steps_add_up_over_many_wraps(
            daily in any::<bool>(),
            start in 0u64..u64::from(DAY),
            steps in prop::collection::vec(0u64..400_000_000, 1..60),
        ) {
            let wrap = if daily { u64::from(DAY) } else { 1 << 32 };
            let mut clock = SampleClock::new();
            let mut ticks = start;
            for step in steps {
                prop_assert_eq!(clock.time(u32::try_from(ticks % wrap).unwrap()), ticks * 100);
                ticks += step;
            }
        }
    }
}
