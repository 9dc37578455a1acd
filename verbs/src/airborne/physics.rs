//! Gravity and angular momentum in a phase, with error bars.

use nalgebra::Vector3;
use serde::Serialize;

use super::phases::Parabola;

/// Smallest standard deviation of a position of the centre of mass that is believed (m).
const LEAST_NOISE: f64 = 5e-4;
/// Error of the centre of mass relative to the body (m) that changes within a phase: tables of segments do not know the
/// person's own masses, and no frame shows that error by itself.
const BODY: f64 = 0.004;
/// Angular momentum (kg m2/s) below which a drift in percent says nothing.
const SMALL: f64 = 1.0;

/// The fall of a centre of mass.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Fall {
    /// Fitted acceleration: north, west, up (m/s2).
    pub acceleration_mps2: [f64; 3],
    /// Its size (m/s2).
    pub g_mps2: f64,
    /// Standard error of each component (m/s2), with noise that is alike from frame to frame.
    pub standard_error_mps2: f64,
    /// Root mean square distance from the parabola (m).
    pub residual_m: f64,
}

/// Fits a parabola; `None` if the frames do not determine it.
pub fn fall(times: &[f64], centres: &[Vector3<f64>]) -> Option<Fall> {
    let fit = Parabola::fitted(times, centres)?;
    let off: Vec<Vector3<f64>> = times
        .iter()
        .zip(centres)
        .map(|(t, c)| c - fit.at(*t))
        .collect();
    let square: f64 = off.iter().map(Vector3::norm_squared).sum();
    let next: f64 = off.windows(2).map(|pair| pair[0].dot(&pair[1])).sum();
    let count = times.len() as f64;
    let alike = (next / square.max(f64::MIN_POSITIVE)).clamp(0.0, 0.95);
    // Fewer frames are independent if their errors are alike; three numbers of each axis are fitted.
    let free = (count * (1.0 - alike) / (1.0 + alike) - 3.0).max(1.0);
    let deviation = (square / 3.0 / count * count / (count - 3.0).max(1.0))
        .sqrt()
        .max(LEAST_NOISE);
    let length = times.last()? - times.first()?;
    let acceleration = fit.acceleration();
    Some(Fall {
        acceleration_mps2: acceleration.into(),
        g_mps2: acceleration.norm(),
        standard_error_mps2: (deviation * (720.0 / free).sqrt()).hypot(8.0 * BODY)
            / (length * length),
        residual_m: (square / count).sqrt(),
    })
}

/// The angular momentum about the centre of mass in a phase.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Momentum {
    /// Its mean: north, west, up (kg m2/s).
    pub mean_nms: [f64; 3],
    /// Size of its change over the phase along a straight line (kg m2/s).
    pub drift_nms: f64,
    /// The same relative to the size of the mean (percent); null if the body hardly rotates.
    pub drift_percent: Option<f64>,
}

/// Fits a straight line to the angular momentum.
pub fn momentum(times: &[f64], momenta: &[Vector3<f64>]) -> Momentum {
    let count = times.len().max(1) as f64;
    let mean = momenta.iter().sum::<Vector3<f64>>() / count;
    let middle = times.iter().sum::<f64>() / count;
    let spread: f64 = times.iter().map(|time| (time - middle).powi(2)).sum();
    let slope = times
        .iter()
        .zip(momenta)
        .map(|(time, momentum)| (time - middle) * (momentum - mean))
        .sum::<Vector3<f64>>()
        / spread.max(f64::MIN_POSITIVE);
    let length = times
        .last()
        .zip(times.first())
        .map_or(0.0, |(last, first)| last - first);
    let drift = (slope * length).norm();
    Momentum {
        mean_nms: mean.into(),
        drift_nms: drift,
        drift_percent: (mean.norm() > SMALL).then(|| 100.0 * drift / mean.norm()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gravity_of_a_tilted_noisy_parabola_is_within_its_error_bar() {
        let right = Vector3::new(0.3, -0.1, -9.7);
        let mut inside = 0;
        for seed in 0..200_u32 {
            let mut state = seed.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
            let mut noise = || {
                let mut sum = -6.0;
                for _ in 0..12 {
                    state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                    sum += f64::from(state >> 8) / f64::from(1_u32 << 24);
                }
                0.002 * sum
            };
            let times: Vec<f64> = (0..48).map(|k| f64::from(k) / 120.0).collect();
            let centres: Vec<Vector3<f64>> = (times.iter())
                .map(|t| right * (0.5 * t * t) + Vector3::new(noise(), noise(), noise()))
                .collect();
            let found = fall(&times, &centres).unwrap();
            let off = Vector3::from(found.acceleration_mps2) - right;
            inside += i32::from(off.z.abs() < 2.0 * found.standard_error_mps2);
        }
        // Two standard errors of noise and body hold at least 95 of 100.
        assert!(inside >= 186, "{inside} of 200");
    }

    #[test]
    fn a_drift_is_that_of_the_line() {
        let times = [0.0, 0.1, 0.2, 0.3];
        let momenta = times.map(|time| Vector3::new(10.0, 2.0 * time, 0.0));
        let found = momentum(&times, &momenta);
        assert!((found.drift_nms - 0.6).abs() < 1e-9);
        assert!((found.drift_percent.unwrap() - 6.0).abs() < 0.1);
    }
}
