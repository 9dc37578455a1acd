//! How far suit, subject and sensors may be from what the files say.

/// Standard deviations of possible errors, before a flight has been seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tolerances {
    /// Calibration of a joint about one axis, constant throughout a flight (degrees).
    pub joint_deg: f64,
    /// Wander of a joint about one axis (degrees).
    pub wander_deg: f64,
    /// Joint error, constant or wandering, at which the suit no longer counts as an explanation (degrees).
    pub wander_limit_deg: f64,
    /// Joint error proportional to the bend (fraction).
    pub bend: f64,
    /// Mass of the body and of each segment (fraction).
    pub mass: f64,
    /// Inertia (fraction).
    pub inertia: f64,
    /// Area of each segment (fraction).
    pub area: f64,
    /// Coefficients of drag, lift, moment and damping (fraction).
    pub coefficients: f64,
    /// Position of the trunk's centre of gravity (m).
    pub cg_m: f64,
}

impl Default for Tolerances {
    fn default() -> Self {
        Self {
            joint_deg: 2.0,
            wander_deg: 1.0,
            wander_limit_deg: 5.0,
            bend: 0.03,
            mass: 0.03,
            inertia: 0.03,
            area: 0.03,
            coefficients: 0.04,
            cg_m: 0.004,
        }
    }
}

impl Tolerances {
    /// Largest plausible joint error, constant or wandering (degrees): the stated limit, or twice a tolerance if that is
    /// larger.
    pub const fn joint_limit_deg(&self) -> f64 {
        let least = 2.0 * self.joint_deg.max(self.wander_deg);
        self.wander_limit_deg.max(least)
    }
}
