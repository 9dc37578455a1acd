//! Every threshold of a decision: which effect is tried, refitted, named, and what the verdict is.
//!
//! Gains are differences of log-likelihood.

/// Thresholds of the decisions.
pub(crate) struct Decision {
    /// Root mean square of joint angles and of the direction of the stream below which a flight counts as motionless
    /// (rad): the jitter of suit and sensors.
    pub(crate) still_rad: f64,
    /// Number of effects that are refined by Gauss-Newton steps before they are compared.
    pub(crate) refined: usize,
    /// Probability that an effect does not act, below which it is named. An effect with less probability than this beside
    /// the named one is not its rival.
    pub(crate) false_discovery_rate: f64,
    /// Probability that the rivals of an effect act instead, from which it is not named.
    pub(crate) rivals_share: f64,
    /// Standard deviation of the log-likelihood of refitted flights: fits of the same flights end in different minima.
    pub(crate) refit_noise: f64,
    /// The same as a share of the gain.
    pub(crate) refit_noise_share: f64,
    /// Gain that each parameter of a description costs (Schwarz criterion for a few hundred independent observations).
    pub(crate) gain_per_parameter: f64,
    /// Share of the way from neutral to the end of its range above which a parameter matters.
    pub(crate) material_share_of_range: f64,
    /// Minimum duration of a flight (s), three comparisons.
    pub(crate) shortest_s: f64,
    /// Number of rejected effects after which the search ends.
    pub(crate) rejections: usize,
    /// Share of the best gain above which a runner-up is refitted too.
    pub(crate) runner_up_share: f64,
    /// Difference that a first-order estimate may be wrong by.
    pub(crate) runner_up_gain: f64,
    /// How many runners-up are refitted.
    pub(crate) runner_ups: usize,
    /// Share of the best gain by which a runner-up may be worse before its own slopes are computed.
    pub(crate) runner_up_deficit: f64,
    /// A runner-up is dropped if the fitted flights are less likely with it by more than this, and by more than
    /// `hopeless_share`: converging fits change by tens.
    pub(crate) hopeless_deficit: f64,
    /// The same as a share of the best gain.
    pub(crate) hopeless_share: f64,
    /// Standard deviations that the slope at zero strength must exceed for an effect that changes at random to be fitted.
    pub(crate) score_z: f64,
    /// The same in held-out flights.
    pub(crate) score_z_held_out: f64,
    /// Share of the best slope above which another effect that changes at random is fitted too.
    pub(crate) score_share: f64,
    /// Shortest motion, over all fitted flights together, in which effects can be distinguished (s).
    pub(crate) informative_s: f64,
    /// Share of what arbitrary forces and moments could explain that the named effects must explain.
    pub(crate) explained_share: f64,
    /// Misfit per observation above which the fit has failed, so that names found with it mean nothing.
    pub(crate) failed_misfit: f64,
    /// Standard deviations by which the misfit of short flights, which have few observations, may exceed one.
    pub(crate) failed_z: f64,
    /// Misfit per observation below which the model as given by the files agrees with the data.
    pub(crate) agreeing_misfit: f64,
    /// Unknown moment (N m) and force (N) in a tenth of a second below which they are too small to matter.
    pub(crate) immaterial_wrench: [f64; 2],
    /// Ratio of fitted to recorded noise of attitude and angular velocity above which the sensors no longer explain it.
    pub(crate) noise_ratio: f64,
    /// Number of standard errors above which an adjustment is reported.
    pub(crate) adjustment_z: f64,
    /// The same for the calibration of a joint.
    pub(crate) joint_z: f64,
    /// Factor on reported standard errors, for what the linear problem leaves out, above all the uncertainty of the
    /// estimated error sizes. Without it, 86 to 88 % of the true parameters of laboratory flights were within their 95 %
    /// intervals. Whether an effect acts is decided without it.
    pub(crate) reported_error: f64,
    /// Correlation of two estimates above which they count as indistinguishable.
    pub(crate) correlated: f64,
    /// Maximum number of groups of loads in a description.
    pub(crate) groups: usize,
    /// The same for the loads in a group.
    pub(crate) loads_in_group: usize,
    /// Fraction of its gain that counts for a force at a point, so that a similar one on the whole body is preferred.
    pub(crate) at_a_point: f64,
    /// Share of the previous groups' gain that a further group of loads must gain.
    pub(crate) group_share: f64,
    /// Standard errors by which a load must differ from zero.
    pub(crate) load_z: f64,
    /// Gain that a description needs in each held-out flight.
    pub(crate) description_held_out_gain: f64,
    /// Share of what arbitrary forces and moments could explain that a description must explain in the fitted flights.
    pub(crate) description_share: f64,
    /// The same in held-out flights.
    pub(crate) description_share_held_out: f64,
}

/// The thresholds in use; docs/discovery.md says with which flights they were calibrated.
pub(crate) const DECISION: Decision = Decision {
    still_rad: 0.04,
    refined: 6,
    false_discovery_rate: 0.02,
    rivals_share: 0.5,
    refit_noise: 5.0,
    refit_noise_share: 0.005,
    gain_per_parameter: 3.0,
    material_share_of_range: 0.02,
    shortest_s: 0.3,
    rejections: 3,
    runner_up_share: 0.4,
    runner_up_gain: 25.0,
    runner_ups: 4,
    runner_up_deficit: 0.05,
    hopeless_deficit: 100.0,
    hopeless_share: 0.3,
    score_z: 3.0,
    score_z_held_out: 1.5,
    score_share: 0.5,
    informative_s: 12.0,
    explained_share: 0.6,
    failed_misfit: 1.02,
    failed_z: 2.0,
    agreeing_misfit: 1.15,
    immaterial_wrench: [1.5, 12.0],
    noise_ratio: 2.0,
    adjustment_z: 1.5,
    joint_z: 3.0,
    reported_error: 1.25,
    correlated: 0.7,
    groups: 4,
    loads_in_group: 6,
    at_a_point: 0.95,
    group_share: 0.03,
    load_z: 4.0,
    description_held_out_gain: 4.0,
    description_share: 0.6,
    description_share_held_out: 0.7,
};

impl Decision {
    /// Log odds above which an effect is certain enough to be named.
    pub(crate) fn certain_odds(&self) -> f64 {
        ((1.0 - self.false_discovery_rate) / self.false_discovery_rate).ln()
    }

    /// Gain of log-likelihood that the errors of refits give away: half their variance. With normal errors, odds from which
    /// it is subtracted are right on average.
    pub(crate) const fn refit_allowance(&self) -> f64 {
        0.5 * self.refit_noise * self.refit_noise
    }
}
