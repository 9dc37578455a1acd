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
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct SampleClock {
    /// Latest reading and its unwrapped ticks.
    latest: Option<(u32, u64)>,
}

impl SampleClock {
    /// Creates a clock that starts with its first reading.
    pub const fn new() -> Self {
        Self { latest: None }
    }

    /// Returns the time of a reading (us). It starts at the value of the first reading and never jumps at a wrap.
    pub fn time(&mut self, fine: u32) -> u64 {
        let (last, ticks) = self.latest.unwrap_or((fine, u64::from(fine)));
        let step = nearest_step(last, fine);
        let time = ticks.saturating_add_signed(step);
        if step >= 0 {
            self.latest = Some((fine, time));
        }
        time * TICK
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
