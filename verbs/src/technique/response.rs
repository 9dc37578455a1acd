//! The response to a pattern: frequency response, gain, bandwidth, poles and zeros.

use core::f64::consts::TAU;

use bodyflight_core::dynamics::step::TIME_STEP;
use nalgebra::{Complex, DMatrix, DVector, SMatrix, SVector};
use serde::Serialize;

use super::linear::{OUTPUT_NAMES, Single, variable};
use crate::stability::STATES;

/// Lowest and highest frequency (Hz), and points between.
pub const LOWEST_HZ: f64 = 0.02;
/// See [`LOWEST_HZ`].
pub const HIGHEST_HZ: f64 = 10.0;
const POINTS: usize = 109;
/// The gain at the bandwidth, for that at the lowest frequency.
const HALF_POWER: f64 = core::f64::consts::FRAC_1_SQRT_2;
/// Poles and zeros this near to each other, for their size, cancel.
const CANCELS: f64 = 1e-4;
/// Zeros beyond this are those of a delay of a few steps (1/s).
const FASTEST: f64 = 0.2 / TIME_STEP;
/// Slowest pole that grows (1/s): the heading has no restoring moment, and its pole is 0 but for rounding.
const GROWS: f64 = 1e-3;

/// A pole or zero (1/s).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Root {
    /// Real part (1/s).
    pub re_per_s: f64,
    /// Imaginary part (rad/s).
    pub im_radps: f64,
}

/// A point of the frequency response.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Point {
    /// Frequency (Hz).
    pub frequency_hz: f64,
    /// Size, unit of the output per rad of the pattern.
    pub gain: f64,
    /// Standard deviation of the gain, from the errors of the pattern's weights.
    pub gain_deviation: f64,
    /// Phase (rad), continuous.
    pub phase_rad: f64,
}

/// The response of one output to a pattern.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Response {
    /// The output and its unit.
    pub output: &'static str,
    /// Output per rad of the pattern at 0.02 Hz, with the sign of a slow movement.
    pub gain: f64,
    /// Standard deviation of the gain, from the errors of the pattern's weights.
    pub gain_deviation: f64,
    /// Lowest frequency (Hz) at which the gain is 3 dB less; null if it is not up to 10 Hz.
    pub bandwidth_hz: Option<f64>,
    /// Poles that this output shows.
    pub poles: Vec<Root>,
    /// Finite zeros.
    pub zeros: Vec<Root>,
    /// The frequency response from 0.02 to 10 Hz.
    pub bode: Vec<Point>,
}

impl Response {
    /// Size of the gain times bandwidth, by which techniques are compared.
    pub fn merit(&self) -> f64 {
        self.gain.abs() * self.bandwidth_hz.unwrap_or(HIGHEST_HZ)
    }
}

/// Growth of the fastest growing mode of a state matrix (1/s); `None` if none grows.
pub fn growth(states: &SMatrix<f64, STATES, STATES>) -> Option<f64> {
    let roots = roots(&variable(states));
    let fastest = roots.iter().map(|root| root.re_per_s).reduce(f64::max)?;
    (fastest > GROWS).then_some(fastest)
}

/// The response of an output, by its place in [`OUTPUT_NAMES`].
///
/// `errors` are models of what the pattern may be off by, one for each independent error of one standard deviation.
pub fn response(model: &Single, output: usize, errors: &[Single]) -> Response {
    let transfer = Transfer { model, output };
    let mut bode: Vec<Point> = Vec::new();
    let mut before = None;
    let span: f64 = HIGHEST_HZ / LOWEST_HZ;
    for k in 0..POINTS {
        #[expect(clippy::cast_precision_loss, reason = "a hundred points")]
        let share = k as f64 / (POINTS - 1) as f64;
        let frequency = LOWEST_HZ * span.powf(share);
        let (value, gain_deviation) = transfer.with(Complex::new(0.0, TAU * frequency), errors);
        let phase = match before {
            None => angle(value),
            Some((last, phase)) => phase + angle(value / last),
        };
        before = Some((value, phase));
        bode.push(Point {
            frequency_hz: frequency,
            gain: size(value),
            gain_deviation,
            phase_rad: phase,
        });
    }
    let (slow, gain_deviation) = transfer.with(Complex::new(0.0, TAU * LOWEST_HZ), errors);
    let gain = if slow.re < 0.0 {
        -size(slow)
    } else {
        size(slow)
    };
    let (poles, zeros) = transfer.roots();
    Response {
        output: OUTPUT_NAMES[output],
        gain,
        gain_deviation,
        bandwidth_hz: bandwidth(&transfer, &bode),
        poles,
        zeros,
        bode,
    }
}

/// The first frequency at which the gain has fallen by 3 dB, refined by bisection.
fn bandwidth(transfer: &Transfer<'_>, bode: &[Point]) -> Option<f64> {
    let limit = bode.first()?.gain * HALF_POWER;
    let after = bode.iter().position(|point| point.gain < limit)?;
    let mut low = bode.get(after.checked_sub(1)?)?.frequency_hz;
    let mut high = bode.get(after)?.frequency_hz;
    for _ in 0..40 {
        let middle = (low * high).sqrt();
        if size(transfer.at(Complex::new(0.0, TAU * middle))) < limit {
            high = middle;
        } else {
            low = middle;
        }
    }
    Some(high)
}

/// A transfer function `C (s I - A)^-1 (B0 + s B1) + D0 + s D1`.
struct Transfer<'a> {
    model: &'a Single,
    output: usize,
}

impl Transfer<'_> {
    /// The value for an amplitude.
    fn at(&self, s: Complex<f64>) -> Complex<f64> {
        self.with(s, &[]).0
    }

    /// The value, and the standard deviation of its size by independent errors.
    fn with(&self, s: Complex<f64>, errors: &[Single]) -> (Complex<f64>, f64) {
        let transposed = self.model.states.transpose();
        let matrix = SMatrix::<Complex<f64>, STATES, STATES>::from_fn(|row, column| {
            let own = Complex::from(-transposed[(row, column)]);
            if row == column { own + s } else { own }
        });
        let seen = self.model.seen.row(self.output).transpose();
        let solved = matrix.lu().solve(&seen.map(Complex::from));
        let through = solved.unwrap_or_else(|| SVector::repeat(Complex::from(f64::NAN)));
        let of = |single: &Single| {
            let [held, moving] = single.input;
            let inner: Complex<f64> = (0..STATES)
                .map(|k| through[k] * (s * moving[k] + held[k]))
                .sum();
            let [direct, direct_rate] = single.direct.map(|seen| seen[self.output]);
            inner + s * direct_rate + direct
        };
        let value = of(self.model);
        let towards = value.conj() / size(value);
        let variance: f64 = errors
            .iter()
            .map(|error| (of(error) * towards).re.powi(2))
            .sum();
        (value, variance.sqrt())
    }

    /// The matrices of the same function divided by s, which is proper: `A, B, C, D` with the states `x - B1 a`, and a.
    fn proper(&self) -> (DMatrix<f64>, DVector<f64>, DVector<f64>, f64) {
        let (model, output) = (self.model, self.output);
        let order = STATES + 1;
        let [held, moving]: [SVector<f64, STATES>; 2] = model.input;
        let row = model.seen.row(output);
        let mut states = DMatrix::zeros(order, order);
        states
            .view_mut((0, 0), (STATES, STATES))
            .copy_from(&model.states);
        let along = held + model.states * moving;
        states.view_mut((0, STATES), (STATES, 1)).copy_from(&along);
        let mut input = DVector::zeros(order);
        input[STATES] = 1.0;
        let mut seen = DVector::zeros(order);
        for (to, from) in seen.iter_mut().zip(row.iter()) {
            *to = *from;
        }
        seen[STATES] = model.direct[0][output] + (row * moving).x;
        (states, input, seen, model.direct[1][output])
    }

    /// Poles and finite zeros, without those that cancel.
    ///
    /// With `s = shift + 1/w` zeros at infinity come to w = 0, and the direct term is the value at `shift`: so zeros are the
    /// eigenvalues of a matrix however small the direct term is.
    fn roots(&self) -> (Vec<Root>, Vec<Root>) {
        let (states, input, seen, direct) = self.proper();
        let mut poles = roots(&states);
        // The integrator, which the factor s cancels.
        if let Some(slowest) =
            (0..poles.len()).min_by(|a, b| poles[*a].size().total_cmp(&poles[*b].size()))
        {
            poles.remove(slowest);
        }
        let order = input.len();
        let shift = 7.3;
        let shifted = DMatrix::identity(order, order) * shift - &states;
        let Some(inverse) = shifted.try_inverse() else {
            return (poles, Vec::new());
        };
        let moved = &inverse * &input;
        let direct = direct + seen.dot(&moved);
        let row = seen.transpose() * &inverse;
        if direct.abs() < f64::MIN_POSITIVE {
            return (poles, Vec::new());
        }
        let closed = -&inverse + moved * row / direct;
        let zeros = closed.complex_eigenvalues();
        let mut zeros: Vec<Root> = zeros
            .iter()
            .filter(|w| size(**w) > 1.0 / FASTEST)
            .map(|w| Complex::from(shift) + w.inv())
            .map(|s| Root {
                re_per_s: s.re,
                im_radps: s.im,
            })
            .collect();
        poles.retain(|pole| {
            let near = |zero: &Root| {
                let apart = (pole.re_per_s - zero.re_per_s).hypot(pole.im_radps - zero.im_radps);
                apart < CANCELS * (1.0 + pole.size())
            };
            let cancelled = zeros.iter().position(near);
            if let Some(zero) = cancelled {
                zeros.remove(zero);
            }
            cancelled.is_none()
        });
        (sorted(poles), sorted(zeros))
    }
}

impl Root {
    fn size(&self) -> f64 {
        self.re_per_s.hypot(self.im_radps)
    }
}

fn roots(matrix: &DMatrix<f64>) -> Vec<Root> {
    let values = matrix.complex_eigenvalues();
    let root = |value: &Complex<f64>| Root {
        re_per_s: value.re,
        im_radps: value.im,
    };
    values.iter().map(root).collect()
}

fn size(value: Complex<f64>) -> f64 {
    value.norm_sqr().sqrt()
}

fn angle(value: Complex<f64>) -> f64 {
    value.im.atan2(value.re)
}

fn sorted(mut roots: Vec<Root>) -> Vec<Root> {
    roots.sort_by(|a, b| {
        let size = a.size().total_cmp(&b.size());
        size.then(a.im_radps.total_cmp(&b.im_radps))
    });
    roots
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `(s + 2) / ((s + 1)(s + 3))` in two of nine states, besides one that the output does not show.
    fn known() -> Single {
        let mut states = SMatrix::<f64, STATES, STATES>::identity() * -5.0;
        states[(0, 0)] = -1.0;
        states[(1, 1)] = -3.0;
        let mut held = SVector::<f64, STATES>::zeros();
        (held[0], held[1], held[4]) = (1.0, 1.0, 1.0);
        let mut seen = SMatrix::zeros();
        (seen[(0, 0)], seen[(0, 1)]) = (0.5, 0.5);
        Single::plain(states, held, seen)
    }

    #[test]
    fn a_known_transfer_function_has_its_poles_zeros_gain_and_bandwidth() {
        let half = Single::plain(known().states, known().input[0] * 0.5, known().seen);
        let found = response(&known(), 0, &[half.clone(), half]);
        let near = |roots: &[Root], values: &[f64]| {
            assert_eq!(roots.len(), values.len(), "{roots:?}");
            for (root, value) in roots.iter().zip(values) {
                assert!((root.re_per_s - value).abs() < 1e-6 && root.im_radps.abs() < 1e-6);
            }
        };
        near(&found.poles, &[-1.0, -3.0]);
        near(&found.zeros, &[-2.0]);
        let exact = |hz: f64| {
            let s = Complex::new(0.0, TAU * hz);
            size((s + 2.0) / ((s + 1.0) * (s + 3.0)))
        };
        assert!((found.gain - exact(LOWEST_HZ)).abs() < 1e-9);
        // Two independent errors of half of the pattern.
        assert!((found.gain_deviation - found.gain * 0.5_f64.sqrt()).abs() < 1e-9);
        let bandwidth = found.bandwidth_hz.unwrap();
        assert!((exact(bandwidth) - HALF_POWER * exact(LOWEST_HZ)).abs() < 1e-9);
        for point in &found.bode {
            assert!((point.gain - exact(point.frequency_hz)).abs() < 1e-9);
        }
        assert_eq!(growth(&known().states), None);
    }
}
