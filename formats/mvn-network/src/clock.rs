//! Evenly spaced times from time codes in whole milliseconds.

/// Largest difference between even time and time code (s): the code is truncated or rounded to 1 ms.
const TOLERANCE: f64 = 1e-3;
/// Fraction of the difference that is corrected per sample: 0.5 ms of rounding changes a step by 0.01 ms.
const PULL: f64 = 0.02;
/// Number of samples (0.2 s at 240 Hz) after which a time code that does not advance is a fault.
const PATIENCE: u32 = 48;

/// Turns sample counters and time codes into time. At 240 Hz the codes advance by 4 or 5 ms, but a filter needs steps
/// of 4.167 ms. The period is the mean since the first sample; the time advances by it, is gently pulled towards the
/// codes, and stays within 1 ms of them.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Clock {
    first: Option<(u32, u32)>,
    last: Option<(u32, f64)>,
    period: Option<f64>,
}

impl Clock {
    /// A clock for a known rate (Hz): time is the counter divided by the rate.
    pub(super) fn with_rate(rate: f64) -> Self {
        Self {
            period: Some(1.0 / rate),
            ..Self::default()
        }
    }

    /// Time of a sample (s).
    pub(super) fn time(&mut self, counter: u32, time_ms: u32, known_rate: bool) -> f64 {
        let code = f64::from(time_ms) / 1000.0;
        if known_rate && let Some(period) = self.period {
            let time = f64::from(counter) * period;
            self.last = Some((counter, time));
            return time;
        }
        let (first_counter, first_ms) = *self.first.get_or_insert((counter, time_ms));
        let samples = counter.wrapping_sub(first_counter);
        if samples > 0 && time_ms > first_ms {
            self.period = Some(f64::from(time_ms - first_ms) / 1000.0 / f64::from(samples));
        }
        let time = match (self.last, self.period) {
            (Some((last, time)), Some(period)) => {
                let even = time + f64::from(counter.wrapping_sub(last)) * period;
                // Time never runs backwards: a code that steps back stops the clock.
                let drawn = even + PULL * (code - even);
                drawn.clamp(code - TOLERANCE, code + TOLERANCE).max(time)
            }
            _ => code,
        };
        self.last = Some((counter, time));
        time
    }

    /// Counts per second (Hz), once two samples have arrived. If a sender sends only every n-th count, this is still
    /// the rate of the counter.
    pub(super) fn rate(&self) -> Option<f64> {
        self.period.map(|period| 1.0 / period)
    }

    /// Whether the sender's time codes do not advance.
    pub(super) fn stands_still(&self) -> bool {
        let samples = self
            .first
            .zip(self.last)
            .map(|((first, _), (last, _))| last.wrapping_sub(first));
        self.period.is_none() && samples.is_some_and(|samples| samples > PATIENCE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn time_codes_that_do_not_advance_are_noticed() {
        let mut clock = Clock::default();
        for counter in 0..100 {
            assert_eq!(clock.stands_still(), counter > 49);
            clock.time(counter, 0, false);
        }
        let mut clock = Clock::with_rate(240.0);
        assert!((clock.time(480, 0, true) - 2.0).abs() < 1e-12);
        assert!(!clock.stands_still());
    }

    proptest! {
        #[test]
        fn time_is_even_and_near_the_truth(
            rate in 20.0f64..1000.0,
            start in 0u32..100_000,
            rounded: bool,
        ) {
            let mut clock = Clock::default();
            let mut before = f64::NEG_INFINITY;
            for i in 0..1000u32 {
                let truth = f64::from(start) + f64::from(i) / rate * 1000.0;
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a time code")]
                let code = if rounded { truth.round() } else { truth.floor() } as u32;
                let time = clock.time(i, code, false);
                prop_assert!((time - truth / 1000.0).abs() <= 2e-3);
                prop_assert!(time >= before);
                if i > 500 {
                    // The codes alone are off by up to 1 ms.
                    prop_assert!((time - before - 1.0 / rate).abs() < 0.1e-3, "{}", time - before);
                }
                before = time;
            }
            prop_assert!((clock.rate().unwrap() / rate - 1.0).abs() < 0.03);
        }
    }
}
