//! Disturbances outside the library, to test whether they are mistaken for something inside it. They belong to the
//! tests, not to the model.

use bodyflight_core::dynamics::{Motion, State};
use bodyflight_core::frame::Vector;

/// A disturbance that no effect of the library produces.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outside {
    /// Gusts of the air: a horizontal force that comes and goes every few seconds.
    Gusts,
    /// A flapping strap: a moment about the long axis at 4 Hz.
    Flapping,
    /// Another skydiver who occasionally grips and pulls.
    Grip,
    /// A pilot chute that pulls at the back, in bursts.
    Tow,
}

impl Outside {
    /// All disturbances.
    pub const ALL: [Self; 4] = [Self::Gusts, Self::Flapping, Self::Grip, Self::Tow];

    /// Name in commands and tables.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Gusts => "outside-gusts",
            Self::Flapping => "outside-flapping",
            Self::Grip => "outside-grip",
            Self::Tow => "outside-tow",
        }
    }

    /// The disturbance of this name, if any.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|outside| outside.name() == name)
    }

    /// Applies the disturbance for `duration` (s) from `time` (s) on.
    pub fn push(self, state: &mut State<f64>, motion: &Motion<f64>, time: f64, duration: f64) {
        let about_body =
            |left, dorsal, cranial| motion.inertial_from_body * Vector::new(left, dorsal, cranial);
        let bursts = |period: f64, share: f64| {
            if (time / period).fract() < share {
                1.0
            } else {
                0.0
            }
        };
        let (force, moment) = match self {
            Self::Gusts => {
                let west = (time * 1.7).sin() + (time * 2.9 + 1.0).sin();
                let north = (time * 2.3 + 2.0).sin();
                (Vector::new(north, west, 0.0) * 120.0, Vector::zero())
            }
            Self::Flapping => {
                let beat = (time * 8.0 * core::f64::consts::PI).sin();
                (Vector::zero(), about_body(0.0, 10.0, 25.0) * beat)
            }
            Self::Grip => {
                let on = bursts(5.0, 0.25);
                let pull = Vector::new(100.0, -60.0, 20.0) * on;
                (pull, about_body(12.0, 20.0, -8.0) * on)
            }
            Self::Tow => {
                let on = bursts(7.0, 0.3);
                let up = Vector::new(0.0, 0.0, 300.0 * on);
                (up, about_body(25.0, 0.0, 0.0) * on)
            }
        };
        state.linear_momentum += force * duration;
        state.angular_momentum += moment * duration;
    }
}
