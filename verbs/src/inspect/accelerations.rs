//! The recorded acceleration of the pelvis, which no verb uses, against the change of its velocity.

use bodyflight_core::air::STANDARD_GRAVITY as GRAVITY;
use bodyflight_mvnx::recording::Warning;
use nalgebra::Vector3;

/// Time over which changes of velocity are compared (s), and the fewest such times.
const PIECE: f64 = 0.25;
const LEAST: u32 = 8;
/// Correlation above which the two are the same but for a factor, and the factor's distance from one.
const SAME: f64 = 0.8;
const APART: f64 = 0.4;
/// Change of velocity (m/s2, root mean square) that a body shows which is not at rest.
const MOVES: f64 = 0.3;
/// Root mean square (m/s2) that no body in flight has.
const IMPOSSIBLE: f64 = 500.0;
/// The same beyond which no unit explains the numbers either, so that whoever wrote the file is not believed.
const BROKEN: f64 = 2e5;
/// Share of gravity by which a mean difference along the vertical may differ from it.
const NEAR: f64 = 0.3;

/// Sums over pieces of a recording.
#[derive(Debug, Default)]
pub(super) struct Accelerations {
    begin: Option<(f64, Vector3<f64>)>,
    last: f64,
    /// Integral of the acceleration since then (m/s).
    gained: Vector3<f64>,
    pieces: u32,
    by_velocity: Vector3<f64>,
    by_acceleration: Vector3<f64>,
    squares: [f64; 2],
    product: f64,
    /// Frames whose acceleration is no number.
    no_numbers: u64,
}

impl Accelerations {
    /// Takes velocity (m/s) and acceleration of the pelvis at a time (s).
    pub(super) fn see(
        &mut self,
        time: f64,
        velocity: &Vector3<f64>,
        acceleration: Option<&Vector3<f64>>,
    ) {
        let Some(acceleration) = acceleration else {
            return;
        };
        if !acceleration.iter().all(|number| number.is_finite()) {
            self.no_numbers += 1;
            return;
        }
        let (begin, from) = *self.begin.get_or_insert((time, *velocity));
        self.gained += acceleration * (time - self.last).clamp(0.0, PIECE);
        self.last = time;
        let duration = time - begin;
        if duration < PIECE {
            return;
        }
        if duration < 2.0 * PIECE {
            let expected = (velocity - from) / duration;
            let found = self.gained / duration;
            self.pieces += 1;
            self.by_velocity += expected;
            self.by_acceleration += found;
            self.squares[0] += expected.norm_squared();
            self.squares[1] += found.norm_squared();
            self.product += expected.dot(&found);
        }
        self.begin = Some((time, *velocity));
        self.gained = Vector3::zeros();
    }

    /// What contradicts, in a sentence.
    pub(super) fn warning(&self) -> Option<Warning> {
        let remark = |what: &str| Warning {
            frame: 0,
            message: format!(
                "the accelerations {what}; expected m/s2 without gravity (they are not used)"
            ),
            segment: None,
            span_s: None,
            is_fault: false,
        };
        if self.no_numbers > 0 {
            let count = self.no_numbers;
            return Some(remark(&format!(
                "of the pelvis are no numbers in {count} frames"
            )));
        }
        if self.pieces < LEAST {
            return None;
        }
        let count = f64::from(self.pieces);
        let [by_velocity, by_acceleration] =
            [self.by_velocity, self.by_acceleration].map(|sum| sum / count);
        let offset = by_acceleration - by_velocity;
        // About their means, so that gravity does not pass for a motion.
        let expected = self.squares[0] / count - by_velocity.norm_squared();
        let found = self.squares[1] / count - by_acceleration.norm_squared();
        let product = self.product / count - by_velocity.dot(&by_acceleration);
        let correlation = product / (expected * found).sqrt().max(f64::MIN_POSITIVE);
        let scale = product / expected.max(f64::MIN_POSITIVE);
        let size = (self.squares[1] / count).sqrt();
        if size > BROKEN {
            let what = format!("are {size:.1e} m/s2 on average, which no unit explains");
            return Some(Warning {
                is_fault: true,
                ..remark(&what)
            });
        }
        let what = if size == 0.0 && expected > MOVES * MOVES {
            return Some(remark("are all zero though the velocity changes"));
        } else if size > IMPOSSIBLE {
            format!("are {size:.0} m/s2 on average: they seem to be in mm/s2")
        } else if (offset.z.abs() / GRAVITY - 1.0).abs() < NEAR {
            format!(
                "differ by {:+.1} m/s2 along the vertical: they contain gravity",
                offset.z
            )
        } else if correlation < -SAME {
            "have the opposite sign".to_owned()
        } else if correlation > SAME && (scale * GRAVITY - 1.0).abs() < APART {
            format!("are {scale:.2} times as large: they seem to be in units of g")
        } else if correlation > SAME && (scale - 1.0).abs() > APART {
            format!("are {scale:.2} times as large")
        } else {
            return None;
        };
        Some(remark(&format!(
            "{what}, compared with the change of the velocities"
        )))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said(change: impl Fn(Vector3<f64>) -> Vector3<f64>) -> Option<String> {
        let mut seen = Accelerations::default();
        for index in 0..1000 {
            let time = f64::from(index) / 100.0;
            let velocity = Vector3::new(3.0 * time.sin(), (2.0 * time).cos(), -50.0);
            let acceleration = Vector3::new(3.0 * time.cos(), -2.0 * (2.0 * time).sin(), 0.0);
            seen.see(time, &velocity, Some(&change(acceleration)));
        }
        seen.warning().map(|warning| warning.message)
    }

    #[test]
    fn units_sign_and_gravity_are_told() {
        assert_eq!(said(|right| right), None);
        let told = |what: &str, said: Option<String>| {
            assert!(
                said.as_ref().is_some_and(|said| said.contains(what)),
                "{said:?}"
            );
        };
        told("units of g", said(|right| right / GRAVITY));
        told("opposite sign", said(|right| -right));
        told("+9.8 m/s2", said(|right| right + Vector3::z() * GRAVITY));
        told("2.00 times", said(|right| 2.0 * right));
        told("in mm/s2", said(|right| 1000.0 * right));
        told(
            "1.0e6 m/s2 on average, which no unit",
            said(|_| Vector3::x() * 1e6),
        );
    }
}
