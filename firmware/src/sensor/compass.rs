//! Heading from a magnetometer, for a sensor that sends no orientation.
//!
//! At rest the vertical is known, so the field's strength and its vertical part are learned; afterwards a field that
//! differs in either is that of something else, and is ignored. What is left is the horizontal direction of the field. It
//! points to magnetic north but for the declination, which only a receiver tells: as long as there is none, north is
//! magnetic north; once a receiver has found the heading, the field's *bearing* against its north is kept, and the
//! magnetometer bounds how far the heading drifts from then on. It never makes a heading better than its own error, since
//! that does not average out.

use bodyflight_core::Lanes;
use bodyflight_core::math::wrap_angle;
use nalgebra::Vector3;

/// Error of the field's direction, which changes with the attitude in it (rad): iron worn on the body, and what is left of
/// the sensor's own by its calibration.
const DIRECTION_ERROR: f32 = 0.05;

/// The largest difference of strength and vertical part from those at rest, as a share of the strength.
const DIFFERENCE: f32 = 0.12;

/// The least horizontal share of the field that tells a heading: a dip of 78 degrees.
const HORIZONTAL: f32 = 0.2;

/// Number of measurements at rest over which means are taken at most.
const MEMORY: f32 = 300.0;

/// Number of bounds by which a heading and a field may differ that are compared.
const BOUNDS: f32 = 3.0;

/// The field at rest.
#[derive(Debug, Clone, Copy)]
struct Field {
    strength: f32,
    up: f32,
    count: f32,
}

/// What is known of the field.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Compass {
    rest: Option<Field>,
    /// Angle of its horizontal part from north towards west, and the bound of that angle's error (rad).
    bearing: Option<(f32, f32)>,
}

/// A small rotation about the vertical (rad) that corrects the heading, and the bound of its error then.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Correction {
    pub(super) turn: f32,
    pub(super) error: f32,
}

impl Compass {
    /// Learns the field (inertial axes, any unit) of a sensor at rest.
    pub(super) fn rest(&mut self, field: &Vector3<f32>) {
        let found = Field {
            strength: field.norm(),
            up: field.z,
            count: 1.0,
        };
        self.rest = Some(self.rest.map_or(found, |before| {
            let count = (before.count + 1.0).min(MEMORY);
            Field {
                strength: before.strength + (found.strength - before.strength) / count,
                up: before.up + (found.up - before.up) / count,
                count,
            }
        }));
    }

    /// Forgets the north of the bearing, since the heading has another now.
    pub(super) fn forget_north(&mut self) {
        self.bearing = None;
    }

    /// Takes magnetic north for north, as long as nothing has told another.
    pub(super) fn assume_magnetic_north(&mut self) {
        self.bearing = self.bearing.or(Some((0.0, 0.0)));
    }

    /// The direction of the field (inertial axes), from north towards west (rad), with the bound of its error, if it is the
    /// earth's; `tilt` is the bound of the attitude's tilt (rad).
    fn direction(&self, field: &Vector3<f32>, tilt: f32) -> Option<(f32, f32)> {
        let rest = self.rest?;
        let horizontal = field.xy().norm();
        let allowed = rest.strength * (DIFFERENCE + tilt);
        let is_earths = (field.norm() - rest.strength).abs() < rest.strength * DIFFERENCE
            && (field.z - rest.up).abs() < allowed
            && horizontal > HORIZONTAL * rest.strength;
        // A tilt turns the vertical part of the field into the horizontal plane.
        let by_tilt = tilt * rest.up.abs() / horizontal;
        let error = (DIRECTION_ERROR * DIRECTION_ERROR + by_tilt * by_tilt).root();
        is_earths.then(|| (field.y.arctangent2(field.x), error))
    }

    /// Keeps the bearing of the field in an attitude whose heading has this error (rad).
    pub(super) fn learn(&mut self, field: &Vector3<f32>, tilt: f32, heading_error: f32) {
        let Some((angle, _)) = self.direction(field, tilt) else {
            return;
        };
        let known = self.bearing.filter(|(_, error)| *error <= heading_error);
        self.bearing = known.or(Some((angle, heading_error)));
    }

    /// The correction of a heading by the field (inertial axes): none if the heading is better than the field, or the two
    /// contradict each other.
    pub(super) fn correction(
        &self,
        field: &Vector3<f32>,
        tilt: f32,
        heading_error: f32,
    ) -> Option<Correction> {
        let (bearing, bearing_error) = self.bearing?;
        let (angle, error) = self.direction(field, tilt)?;
        let error = (error * error + bearing_error * bearing_error).root();
        if heading_error <= error {
            return None;
        }
        let turn = wrap_angle(bearing - angle);
        if turn.abs() > BOUNDS * (heading_error + error) {
            return None;
        }
        // Just as far as the better one of the two reaches, so that a single field means little.
        let share = if heading_error.is_finite() {
            1.0 - error / heading_error
        } else {
            1.0
        };
        Some(Correction {
            turn: turn * share,
            error,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f32::consts::PI;

    /// The earth's field where it dips by 63 degrees, `angle` from north towards west.
    fn field(angle: f32) -> Vector3<f32> {
        let (sine, cosine) = angle.sine_cosine();
        Vector3::new(0.45 * cosine, 0.45 * sine, -0.89)
    }

    fn rested() -> Compass {
        let mut compass = Compass::default();
        for _ in 0..10 {
            compass.rest(&field(0.5));
        }
        compass
    }

    #[test]
    fn a_heading_is_turned_to_the_field_and_no_better_than_it() {
        let mut compass = rested();
        assert_eq!(compass.correction(&field(0.5), 0.0, f32::INFINITY), None);
        compass.assume_magnetic_north();
        let found = compass.correction(&field(0.5), 0.0, f32::INFINITY).unwrap();
        assert!((found.turn + 0.5).abs() < 1e-5 && (found.error - DIRECTION_ERROR).abs() < 1e-6);
        // A heading that is known better stays.
        assert_eq!(compass.correction(&field(0.1), 0.0, 0.05), None);
        let found = compass.correction(&field(0.1), 0.0, 0.12).unwrap();
        assert!((found.turn + 0.1 * 7.0 / 12.0).abs() < 1e-5, "{found:?}");
    }

    #[test]
    fn a_receivers_north_is_kept() {
        let mut compass = rested();
        compass.assume_magnetic_north();
        compass.forget_north();
        compass.learn(&field(-0.2), 0.0, 0.08);
        compass.assume_magnetic_north();
        let found = compass.correction(&field(-0.1), 0.0, 1.0).unwrap();
        assert!(found.turn < -0.08 && found.turn > -0.1, "{found:?}");
        assert!((found.error - 0.05_f32.hypot(0.08)).abs() < 1e-6);
        // What is learned later from a worse heading changes nothing.
        compass.learn(&field(0.7), 0.0, 0.2);
        assert_eq!(compass.correction(&field(-0.1), 0.0, 1.0), Some(found));
    }

    #[test]
    fn a_disturbed_field_or_one_that_contradicts_the_heading_is_ignored() {
        let mut compass = rested();
        compass.assume_magnetic_north();
        for disturbed in [
            field(0.3) * 1.3,
            field(0.3) * 0.8,
            Vector3::new(0.9, 0.0, 0.44),
            Vector3::new(0.1, 0.0, -0.99),
            Vector3::new(f32::NAN, 0.0, 0.0),
            Vector3::zeros(),
        ] {
            assert_eq!(
                compass.correction(&disturbed, 0.0, 1.0),
                None,
                "{disturbed}"
            );
        }
        assert_eq!(compass.correction(&field(1.5), 0.0, 0.2), None);
    }

    #[test]
    fn angles_wrap() {
        let mut compass = rested();
        compass.learn(&field(3.1), 0.0, 0.01);
        let found = compass
            .correction(&field(-3.1), 0.0, f32::INFINITY)
            .unwrap();
        assert!((found.turn - 6.2 + 2.0 * PI).abs() < 1e-3, "{found:?}");
    }
}
