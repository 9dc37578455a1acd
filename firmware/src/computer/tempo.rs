//! Whether samples arrive at the configured rate, by their own time stamps.

/// Time over which samples are counted (us).
const SPAN: u32 = 2_000_000;
/// Share by which the rate may differ: an acceleration of a g is then wrong by less than the accelerometer.
const TOLERANCE: f32 = 0.03;

/// Counts samples against their time.
#[derive(Debug, Clone, Copy)]
pub(super) struct Tempo {
    elapsed: u32,
    samples: u32,
    is_wrong: bool,
}

impl Tempo {
    /// Before the first sample.
    pub(super) const fn new() -> Self {
        Self {
            elapsed: 0,
            samples: 0,
            is_wrong: false,
        }
    }

    /// Takes a sample `elapsed` (us) after the last one, which counts as so many at the configured rate (Hz).
    pub(super) fn take(&mut self, elapsed: u64, samples: u16, rate: f32) {
        let elapsed = u32::try_from(elapsed).unwrap_or(SPAN);
        self.elapsed = self.elapsed.saturating_add(elapsed);
        self.samples = self.samples.saturating_add(u32::from(samples));
        if self.elapsed >= SPAN {
            // Exact: both are below 2^24 for all allowed rates.
            let ratio = self.samples as f32 * 1e6 / (self.elapsed as f32 * rate);
            *self = Self {
                is_wrong: (ratio - 1.0).abs() > TOLERANCE,
                ..Self::new()
            };
        }
    }

    /// Begins anew after a gap.
    pub(super) fn interrupt(&mut self) {
        (self.elapsed, self.samples) = (0, 0);
    }

    /// Whether the samples of the last span had another rate.
    pub(super) const fn is_wrong(&self) -> bool {
        self.is_wrong
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wrong_rate_is_found_and_forgotten() {
        let mut tempo = Tempo::new();
        let mut after = |interval: u64, samples| {
            (0..1000).for_each(|_| tempo.take(interval, samples, 240.0));
            tempo.is_wrong()
        };
        assert!(after(5_000, 1));
        assert!(!after(4_167, 1));
        // Samples that are missing are bridged.
        assert!(!after(12_500, 3));
        assert!(!after(4_083, 1), "2 %");
        assert!(after(3_968, 1), "5 %");
    }
}
