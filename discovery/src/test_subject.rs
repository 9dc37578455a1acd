//! The person of this crate's tests: 1.75 m and 75 kg, dressed as for a jump, with the paper's coefficients.

use bodyflight_core::Body;
use bodyflight_core::body::anthropometry::{Person, Sex};
use bodyflight_core::body::gear::Gear;
use bodyflight_core::dynamics::Dynamics;

fn body() -> Body<f64> {
    let bare = Person::new(1.75, 75.0, Sex::Male).body().unwrap();
    Gear::default().fit(&bare).unwrap()
}

/// The person in still air near the ground.
pub(crate) fn dynamics() -> Dynamics<f64> {
    Dynamics::paper(body(), 1.0)
}
