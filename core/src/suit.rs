//! Posture from inertial sensors on the limbs, gyroscopes and accelerometers without magnetometers.
//!
//! Each sensor is [integrated alone](strapdown) after its [gyroscope](tray) was calibrated at rest and in full turns.
//! [Two poses and a march](mounting) show how it lies on its segment. From then on, neighbours are
//! [compared](relative): what both feel at their common joint is the same force, whatever the motion, so no direction
//! of gravity is needed in the fall. Segments without a sensor follow [rules](fill). [`set`] joins all of it.
//! [`watch`] finds sensors that fail or slip, [`clock`] those that are late, and [`range`] joints that no person bends so.
//!
//! Reference axes are level, with Z up; their heading is that in which the person faced in the first pose, which is
//! north by definition. Covariances are those of small rotations: an estimate is the true rotation, followed by the
//! error.

pub mod clock;
pub mod fill;
pub mod joint;
pub mod mounting;
pub mod placement;
pub mod range;
pub mod relative;
pub mod rest;
mod sensor;
pub mod set;
pub mod strapdown;
pub mod tray;
pub mod watch;
