//! Which effect of the library makes the flights more likely, and whether that is significant.

pub(crate) mod backward_elimination;
pub(crate) mod decision;
pub(crate) mod forward_selection;
pub(crate) mod hypothesis;
pub(crate) mod random_effect_test;
pub(crate) mod refit;
pub(crate) mod robust_covariance;
pub(crate) mod runner_up;
pub(crate) mod score_test;
