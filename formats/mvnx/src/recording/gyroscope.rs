//! Bias and scale of the gyroscope of the pelvis, from its angular velocities and the attitudes: both record one rotation, so
//! no physics is needed, and any motion shows them.

use nalgebra::{Matrix2, Matrix4, Vector2, Vector3, Vector4};

/// Fewest times that are compared.
const LEAST: f64 = 8.0;
/// Bias (rad/s) and relative error of scale that are told, if they also exceed so many standard errors. Rates that were
/// smoothed are up to 2 % too small.
const LEAST_BIAS: f64 = 0.03;
const LEAST_SCALE: f64 = 0.025;
const SURE: f64 = 4.0;
/// The same if noise of the attitudes and noise of the rates leave the scale open: largest standard error.
const VAGUE: f64 = 0.1;

/// A number with its standard error.
type Estimate = (f64, f64);

/// The rotation about the axes of the body in a brief time (s): by attitudes and by rates (rad), and by how much the angular
/// acceleration changes (rad/s2).
#[derive(Debug, Clone, Copy)]
pub(super) struct Turned {
    pub(super) time: f64,
    pub(super) by_attitudes: Vector3<f64>,
    pub(super) by_rates: Vector3<f64>,
    pub(super) bends: Vector3<f64>,
}

/// Products, summed, of a time, the change of the angular acceleration in it, and the turns about one axis by attitudes and by
/// rates. Rates of motion capture are differences or smoothed, which leaves a turn behind by a constant times the second.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    count: f64,
    products: Matrix4<f64>,
}

impl Sums {
    fn add(&mut self, row: Vector4<f64>) {
        self.count += 1.0;
        self.products += row * row.transpose();
    }

    /// Bias (rad/s) and scale of the rates; the scale is one with an error of zero if the motion does not show it.
    ///
    /// Noise of the attitudes makes the slope of rates over attitudes too small, noise of the rates makes the inverse of the
    /// opposite slope too large: the scale is between the two, which are its standard error if they are further apart.
    fn fitted(&self) -> Option<[Estimate; 2]> {
        if self.count < LEAST {
            return None;
        }
        let of = |row, column| self.products.fixed_view::<2, 2>(row, column).into_owned();
        // Without any change of the acceleration, only the time is left.
        let known = of(0, 0) + Matrix2::from_diagonal(&Vector2::new(0.0, f64::MIN_POSITIVE));
        let inverse = known.try_inverse()?;
        let explained = inverse * of(0, 2);
        let left = of(2, 2) - of(2, 0) * explained;
        let (attitude, both, rate) = (left[(0, 0)], left[(0, 1)], left[(1, 1)]);
        let slopes = [both / attitude, rate / both];
        let scale = (slopes[0] * slopes[1]).sqrt();
        let variance = (rate - both * slopes[0]).max(0.0) / (self.count - 3.0);
        let error = (variance / attitude)
            .sqrt()
            .hypot(0.5 * (slopes[1] - slopes[0]));
        let scale = if scale.is_finite() && error < VAGUE {
            (scale, error)
        } else {
            (1.0, 0.0)
        };
        let [lever, by_rates] = [explained[(0, 0)], explained[(0, 1)]];
        let bias = (
            by_rates - scale.0 * lever,
            (variance * inverse[(0, 0)]).sqrt().hypot(lever * scale.1),
        );
        Some([bias, scale])
    }
}

/// A scale that is worth telling.
fn is_off((scale, error): Estimate) -> bool {
    (scale - 1.0).abs() > LEAST_SCALE.max(SURE * error)
}

/// What has been seen about the axes of the body.
#[derive(Debug, Clone, Default)]
pub(super) struct Gyroscope([Sums; 3]);

impl Gyroscope {
    /// Takes the rotation in a brief time.
    pub(super) fn see(&mut self, turned: &Turned) {
        for (axis, sums) in self.0.iter_mut().enumerate() {
            let about = [turned.bends, turned.by_attitudes, turned.by_rates];
            let [bends, by_attitudes, by_rates] = about.map(|of| of[axis]);
            sums.add(Vector4::new(turned.time, bends, by_attitudes, by_rates));
        }
    }

    /// The scales, one where none is worth telling; `None` if none is.
    pub(super) fn scale(&self) -> Option<[f64; 3]> {
        let scales = self.0.map(|sums| sums.fitted().map(|[_, scale]| scale));
        let scales = scales.map(|scale| scale.filter(|scale| is_off(*scale)));
        (scales.iter().any(Option::is_some))
            .then(|| scales.map(|scale| scale.map_or(1.0, |(scale, _)| scale)))
    }

    /// Errors of the gyroscope that are worth telling, in a sentence.
    pub(super) fn errors(&self) -> Option<String> {
        let mut told = Vec::new();
        for (sums, axis) in self.0.iter().zip(["x", "y", "z"]) {
            let Some([(bias, bias_error), scale]) = sums.fitted() else {
                continue;
            };
            if bias.abs() > LEAST_BIAS.max(SURE * bias_error) {
                told.push(format!(
                    "a bias of {bias:+.3} +- {bias_error:.3} rad/s about {axis}"
                ));
            }
            if is_off(scale) {
                told.push(format!(
                    "a scale of {:.3} +- {:.3} about {axis}",
                    scale.0, scale.1
                ));
            }
        }
        (!told.is_empty()).then(|| {
            format!(
                "against the attitudes, the angular velocities of the pelvis have {} of the body: errors of the gyroscope",
                told.join(", ")
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is said of a body that tumbles, with noise of the attitudes (rad) and of the rates (rad/s).
    fn said(bias: f64, scale: f64, noise: [f64; 2]) -> Option<String> {
        let mut seen = Gyroscope::default();
        let wave = |k: u32, speed: f64| (speed * f64::from(k)).sin();
        for k in 0..100 {
            let rates = Vector3::new(wave(k, 0.31), wave(k, 0.47), wave(k, 0.23)) * 2.0;
            let noise = [noise[0] * wave(k, 57.3), noise[1] * wave(k, 91.7)];
            let measured = rates * scale + Vector3::y() * bias;
            seen.see(&Turned {
                time: 0.1,
                by_attitudes: (rates * 0.1).add_scalar(noise[0]),
                by_rates: (measured * 0.1).add_scalar(0.1 * noise[1]),
                bends: Vector3::zeros(),
            });
        }
        seen.errors()
    }

    #[test]
    fn bias_and_scale_are_told_with_their_errors_and_noise_is_not() {
        assert_eq!(said(0.0, 1.0, [0.0; 2]), None);
        assert_eq!(said(0.0, 1.0, [0.06, 0.0]), None);
        assert_eq!(said(0.0, 1.0, [0.0, 0.6]), None);
        let bias = said(0.05, 1.0, [0.002, 0.02]).unwrap();
        assert!(
            bias.contains("a bias of +0.05") && bias.contains("about y"),
            "{bias}"
        );
        assert!(
            !bias.contains("scale") && !bias.contains("about x"),
            "{bias}"
        );
        let scale = said(0.0, 1.03, [0.002, 0.02]).unwrap();
        assert_eq!(scale.matches("a scale of 1.03").count(), 3, "{scale}");
        assert!(!scale.contains("bias"), "{scale}");
    }

    #[test]
    fn rates_that_were_smoothed_have_the_scale_of_their_gyroscope() {
        let smoothed = |scale: f64| {
            let mut seen = Gyroscope::default();
            // A rate of 3 Hz, smoothed to 0.95 of its size.
            let speed = core::f64::consts::TAU * 3.0;
            let turn = |time: f64| (speed * time).sin() + 2.0 * (0.7 * time).sin();
            let by_rates = |time: f64| 0.95 * (speed * time).sin() + 2.0 * (0.7 * time).sin();
            let bend = |time: f64| -0.95 * speed.powi(2) * (speed * time).sin();
            let change = |of: &dyn Fn(f64) -> f64, k: u32| {
                let [from, to] = [k, k + 1].map(|k| 0.1 * f64::from(k));
                Vector3::x() * (of(to) - of(from))
            };
            for k in 0..40 {
                seen.see(&Turned {
                    time: 0.1,
                    by_attitudes: change(&turn, k),
                    by_rates: change(&by_rates, k) * scale,
                    bends: change(&bend, k) * scale,
                });
            }
            seen.scale()
        };
        assert_eq!(smoothed(1.0), None);
        let [x, y, z] = smoothed(1.03).unwrap();
        assert!((x - 1.03).abs() < 0.005, "{x}");
        assert!((y - 1.0).abs().max((z - 1.0).abs()) < 1e-12, "{y}, {z}");
    }
}
