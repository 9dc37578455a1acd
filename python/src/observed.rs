//! What is observed of a skydiver: the quantities that a motion-capture suit measures.

use bodyflight_core::dynamics::Motion;
use bodyflight_core::frame::{Inertial, Vector};
use bodyflight_core::math::Lanes;
use bodyflight_core::observation::Observation;

/// Names of the observed quantities, with units.
pub(crate) const OBSERVED: [&str; 16] = [
    "up_left",
    "up_dorsal",
    "up_cranial",
    "heading_sin",
    "heading_cos",
    "angular_velocity_left_radps",
    "angular_velocity_dorsal_radps",
    "angular_velocity_cranial_radps",
    "velocity_left_mps",
    "velocity_dorsal_mps",
    "velocity_cranial_mps",
    "position_north_m",
    "position_west_m",
    "position_up_m",
    "horizontal_speed_mps",
    "vertical_velocity_mps",
];

/// One row of observations, in the order of [`OBSERVED`].
pub(crate) type Row<T> = [T; OBSERVED.len()];

/// Observes a motion, in the order of [`OBSERVED`].
pub(crate) fn observation<T: Lanes>(motion: &Motion<T>) -> Row<T> {
    let seen = Observation::of(motion);
    let vertical = Vector::<T, Inertial>::new(T::zero(), T::zero(), T::one());
    let up = motion.inertial_from_body.inverse() * vertical;
    let (sin, cos) = seen.angles.heading.sine_cosine();
    let [ul, ud, uc] = up.to_array();
    let [wl, wd, wc] = motion.angular_velocity.to_array();
    let [vl, vd, vc] = motion.velocity.to_array();
    let [north, west, height] = motion.position.to_array();
    [
        ul,
        ud,
        uc,
        sin,
        cos,
        wl,
        wd,
        wc,
        vl,
        vd,
        vc,
        north,
        west,
        height,
        seen.horizontal_speed,
        seen.vertical_velocity,
    ]
}
