//! When the filter follows its sensors again after it was lost, so that what it learned meanwhile can be forgotten.

use super::watch::Consistency;
use crate::math::Real;

/// Time without a rejected measurement (s) after which the filter follows its sensors again.
const FOLLOWED: f32 = 0.3;
/// Time (s) in which what was learned while measurements were wrong or missing shows as a load that joints cannot cause.
const SHOWN: f32 = 1.5;

/// Whether the filter was lost, and since when it follows its sensors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Recovery<T> {
    lost: bool,
    /// Whether measurements were rejected or missing, and inputs have not been forgotten since.
    disturbed: bool,
    followed: T,
}

impl<T: Real> Recovery<T> {
    pub(super) fn new() -> Self {
        Self {
            lost: false,
            disturbed: false,
            followed: T::zero(),
        }
    }

    /// Takes the consistency after an interval of `duration` (s), whether the residual load is a `misfit`, larger than joints
    /// can cause, and whether no measurement was rejected in the interval and there was one. Returns whether the filter has
    /// just recovered.
    pub(super) fn take(
        &mut self,
        consistency: Consistency,
        misfit: bool,
        followed: bool,
        duration: T,
    ) -> bool {
        self.lost |= consistency == Consistency::Lost;
        if !followed {
            self.disturbed = true;
            self.followed = T::zero();
            return false;
        }
        let [enough, shown] = [FOLLOWED, SHOWN].map(T::single);
        if self.followed < shown {
            self.followed += duration;
        } else {
            self.disturbed = false;
        }
        if self.followed < enough || !(self.lost || self.disturbed && misfit) {
            return false;
        }
        (self.lost, self.disturbed) = (false, false);
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_loss_ends_once_when_nothing_was_rejected_for_a_while() {
        let mut recovery = Recovery::<f64>::new();
        let mut recovered = |consistency, misfit, followed, intervals| {
            let take = |_| recovery.take(consistency, misfit, followed, 0.01);
            (0..intervals).map(take).filter(|now| *now).count()
        };
        assert_eq!(recovered(Consistency::Doubtful, true, true, 200), 0);
        assert_eq!(recovered(Consistency::Lost, false, false, 100), 0);
        assert_eq!(recovered(Consistency::Lost, false, true, 20), 0);
        assert_eq!(recovered(Consistency::Doubtful, false, false, 1), 0);
        assert_eq!(recovered(Consistency::Doubtful, false, true, 25), 0);
        assert_eq!(recovered(Consistency::Doubtful, false, true, 200), 1);
        // A load that appears once measurements are right again was learned from wrong ones.
        assert_eq!(recovered(Consistency::Doubtful, false, false, 1), 0);
        assert_eq!(recovered(Consistency::Consistent, false, true, 100), 0);
        assert_eq!(recovered(Consistency::Doubtful, true, true, 100), 1);
        // Later, or without wrong measurements, it is one that acts.
        assert_eq!(recovered(Consistency::Doubtful, true, true, 100), 0);
        assert_eq!(recovered(Consistency::Doubtful, false, false, 1), 0);
        assert_eq!(recovered(Consistency::Consistent, false, true, 160), 0);
        assert_eq!(recovered(Consistency::Doubtful, true, true, 100), 0);
    }
}
