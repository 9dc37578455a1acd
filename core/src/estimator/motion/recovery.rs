//! When the filter follows its sensors again after it was lost, so that what it learned meanwhile can be forgotten.

use super::watch::Consistency;
use crate::math::Real;

/// Time without a rejected measurement (s) after which the filter follows its sensors again.
const FOLLOWED: f32 = 0.3;

/// Whether the filter was lost, and since when it follows its sensors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Recovery<T> {
    lost: bool,
    followed: T,
}

impl<T: Real> Recovery<T> {
    pub(super) fn new() -> Self {
        Self {
            lost: false,
            followed: T::zero(),
        }
    }

    /// Takes the consistency after an interval of `duration` (s), and whether a measurement was rejected in it or there
    /// was none. Returns whether the filter has just recovered.
    pub(super) fn take(&mut self, consistency: Consistency, followed: bool, duration: T) -> bool {
        self.lost |= consistency == Consistency::Lost;
        if !followed {
            self.followed = T::zero();
            return false;
        }
        let enough = T::single(FOLLOWED);
        if self.followed < enough {
            self.followed += duration;
        }
        self.followed >= enough && core::mem::take(&mut self.lost)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_loss_ends_once_when_nothing_was_rejected_for_a_while() {
        let mut recovery = Recovery::<f64>::new();
        let mut recovered = |consistency, followed, intervals| {
            let take = |_| recovery.take(consistency, followed, 0.01);
            (0..intervals).map(take).filter(|now| *now).count()
        };
        assert_eq!(recovered(Consistency::Doubtful, true, 100), 0);
        assert_eq!(recovered(Consistency::Lost, false, 100), 0);
        assert_eq!(recovered(Consistency::Lost, true, 20), 0);
        assert_eq!(recovered(Consistency::Doubtful, false, 1), 0);
        assert_eq!(recovered(Consistency::Doubtful, true, 25), 0);
        assert_eq!(recovered(Consistency::Doubtful, true, 100), 1);
    }
}
