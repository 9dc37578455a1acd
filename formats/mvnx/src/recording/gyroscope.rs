//! Bias and scale of the gyroscope of the pelvis, from its angular velocities and the attitudes: both record one rotation, so
//! no physics is needed, and any motion shows them.

use nalgebra::Vector3;

/// Fewest times that are compared.
const LEAST: f64 = 8.0;
/// Bias (rad/s) and relative error of scale that are told, if they also exceed so many standard errors. Rates that were
/// smoothed are up to 2 % too small.
const LEAST_BIAS: f64 = 0.03;
const LEAST_SCALE: f64 = 0.025;
const SURE: f64 = 4.0;
/// The same if noise of the attitudes and noise of the rates leave the scale open: largest standard error.
const VAGUE: f64 = 0.1;

/// Sums about one axis over times (s), turns by attitudes and turns by rates (rad).
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    count: f64,
    time_time: f64,
    time_attitude: f64,
    time_rate: f64,
    attitude_attitude: f64,
    attitude_rate: f64,
    rate_rate: f64,
}

/// A number with its standard error.
type Estimate = (f64, f64);

impl Sums {
    fn add(&mut self, time: f64, attitude: f64, rate: f64) {
        self.count += 1.0;
        self.time_time += time * time;
        self.time_attitude += time * attitude;
        self.time_rate += time * rate;
        self.attitude_attitude += attitude * attitude;
        self.attitude_rate += attitude * rate;
        self.rate_rate += rate * rate;
    }

    /// Bias (rad/s) and scale of the rates; the scale is one with an error of zero if the motion does not show it.
    ///
    /// Noise of the attitudes makes the slope of rates over attitudes too small, noise of the rates makes the inverse of the
    /// opposite slope too large: the scale is between the two, which are its standard error if they are further apart.
    fn fitted(&self) -> Option<[Estimate; 2]> {
        if self.count < LEAST {
            return None;
        }
        let left = |of: f64, with_time: f64| of - with_time * with_time / self.time_time;
        let attitude = left(self.attitude_attitude, self.time_attitude);
        let rate = left(self.rate_rate, self.time_rate);
        let both = self.attitude_rate - self.time_attitude * self.time_rate / self.time_time;
        let slopes = [both / attitude, rate / both];
        let scale = (slopes[0] * slopes[1]).sqrt();
        let variance = (rate - both * slopes[0]).max(0.0) / (self.count - 2.0);
        let error = (variance / attitude)
            .sqrt()
            .hypot(0.5 * (slopes[1] - slopes[0]));
        let scale = if scale.is_finite() && error < VAGUE {
            (scale, error)
        } else {
            (1.0, 0.0)
        };
        let further = self.time_rate - scale.0 * self.time_attitude;
        let lever = self.time_attitude / self.time_time;
        let bias = (
            further / self.time_time,
            (variance / self.time_time).sqrt().hypot(lever * scale.1),
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
    /// Takes a time (s), and the rotation in it by attitudes and by rates (rad, axes of the body).
    pub(super) fn see(&mut self, time: f64, [by_attitudes, by_rates]: &[Vector3<f64>; 2]) {
        for (axis, sums) in self.0.iter_mut().enumerate() {
            sums.add(time, by_attitudes[axis], by_rates[axis]);
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
            let turned = [rates * 0.1, measured * 0.1];
            seen.see(
                0.1,
                &[
                    turned[0].add_scalar(noise[0]),
                    turned[1].add_scalar(0.1 * noise[1]),
                ],
            );
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
}
