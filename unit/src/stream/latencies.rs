//! Latencies from samples to their estimates, in memory that does not grow with the length of the flight.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// Samples whose time of sending is remembered: half a minute's worth.
const REMEMBERED: usize = 8192;

/// Shortest latency distinguished (ms), and the ratio between the limits of neighbouring classes.
const SHORTEST: f64 = 1e-3;
const STEP: f64 = 1.005;

/// Number of classes: the last one begins at about twelve minutes and takes every longer latency.
const CLASSES: usize = 4096;

/// When samples were sent, and how long their estimates took.
pub(super) struct Latencies {
    sent: u32,
    /// Sending times of the last samples.
    sent_at: VecDeque<Instant>,
    /// Number of latencies in each class.
    counts: Vec<u32>,
    last: Option<f64>,
    longest: f64,
}

impl Default for Latencies {
    fn default() -> Self {
        Self {
            sent: 0,
            sent_at: VecDeque::with_capacity(REMEMBERED),
            counts: vec![0; CLASSES],
            last: None,
            longest: 0.0,
        }
    }
}

impl Latencies {
    /// Records that the next sample was sent.
    pub(super) fn sample_sent(&mut self, at: Instant) {
        if self.sent_at.len() == REMEMBERED {
            self.sent_at.pop_front();
        }
        self.sent_at.push_back(at);
        self.sent = self.sent.wrapping_add(1);
    }

    /// Records that the estimate for a sample has arrived.
    pub(super) fn estimate_came(&mut self, sequence: u32, at: Instant) {
        let behind = self.sent.wrapping_sub(sequence) as usize;
        let place = self.sent_at.len().checked_sub(behind);
        if let Some(sent) = place.and_then(|place| self.sent_at.get(place)) {
            self.add(at.saturating_duration_since(*sent));
        }
    }

    fn add(&mut self, time: Duration) {
        let time = time.as_secs_f64() * 1e3;
        let class = (time.max(SHORTEST) / SHORTEST).ln() / STEP.ln();
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "not negative, and limited by `min`"
        )]
        let class = (class.round() as usize).min(CLASSES - 1);
        if let Some(count) = self.counts.get_mut(class) {
            *count = count.saturating_add(1);
        }
        self.last = Some(time);
        self.longest = self.longest.max(time);
    }

    /// Number of samples sent.
    pub(super) fn sent(&self) -> u32 {
        self.sent
    }

    /// The most recent latency (ms).
    pub(super) fn last(&self) -> Option<f64> {
        self.last
    }

    /// The longest latency (ms); 0 before the first.
    pub(super) fn longest(&self) -> f64 {
        self.longest
    }

    /// The latency (ms) that this share of all does not exceed, accurate to half a percent; 0 before the first.
    pub(super) fn quantile(&self, share: f64) -> f64 {
        let all: u64 = self.counts.iter().map(|count| u64::from(*count)).sum();
        #[expect(clippy::cast_precision_loss, reason = "counts of estimates")]
        let wanted = share * all as f64;
        let mut below = 0.0;
        for (class, count) in (0..).zip(&self.counts) {
            below += f64::from(*count);
            if *count > 0 && below >= wanted {
                return (SHORTEST * STEP.powi(class)).min(self.longest);
            }
        }
        self.longest
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_the_times() {
        let mut latencies = Latencies::default();
        assert!(latencies.quantile(0.5) < 1e-9);
        for k in 1..=1000 {
            latencies.add(Duration::from_micros(10 * k));
        }
        for (share, expected) in [(0.5, 5.0), (0.99, 9.9), (1.0, 10.0)] {
            let found = latencies.quantile(share);
            assert!((found / expected - 1.0).abs() < 0.006, "{share}: {found}");
        }
        assert!((latencies.longest() - 10.0).abs() < 1e-9);
        assert!((latencies.last().unwrap() - 10.0).abs() < 1e-9);
    }

    #[test]
    fn days_of_samples_take_no_more_memory_than_minutes() {
        let mut latencies = Latencies::default();
        let begin = Instant::now();
        for k in 0..100_000 {
            latencies.sample_sent(begin);
            latencies.estimate_came(k, begin + Duration::from_millis(3));
        }
        assert_eq!(latencies.sent(), 100_000);
        assert_eq!(latencies.sent_at.len(), REMEMBERED);
        assert!((latencies.quantile(0.5) - 3.0).abs() < 0.02);
        // Too old, and not sent yet: neither counts.
        latencies.estimate_came(5, begin + Duration::from_secs(9));
        latencies.estimate_came(200_000, begin + Duration::from_secs(9));
        assert!(latencies.longest() < 3.1);
    }
}
