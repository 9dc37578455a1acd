//! Homogeneous solids that model segments and equipment.
//!
//! Each solid stands on its base: its axis Z points up from the base (the proximal end), and X and Y are the principal
//! axes of its cross-sections. Masses come from tables, so inertia is given per unit mass.

use nalgebra::{Matrix3, Vector3};

use crate::math::Real;

/// A homogeneous solid (all dimensions in m).
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Solid<T: Real> {
    /// Elliptical sections whose semi-axes [a along X, b along Y] change linearly from base to top.
    TruncatedEllipticCone {
        /// Semi-axes of the base.
        base: [T; 2],
        /// Semi-axes of the top.
        top: [T; 2],
        /// Distance from base to top.
        length: T,
    },
    /// Ellipsoid with semi-axes along X, Y and Z; the base is its lowest point.
    Ellipsoid {
        /// Semi-axes.
        semi_axes: [T; 3],
    },
    /// Upper half of an ellipsoid; the base is its widest section and the third semi-axis is its height.
    SemiEllipsoid {
        /// Semi-axes.
        semi_axes: [T; 3],
    },
    /// Rectangular block with sides along X, Y and Z.
    Cuboid {
        /// Sides.
        sides: [T; 3],
    },
}

impl<T: Real> Solid<T> {
    /// Creates a truncated circular cone with these radii at base and top (m).
    pub fn cone(base: T, top: T, length: T) -> Self {
        Self::TruncatedEllipticCone {
            base: [base; 2],
            top: [top; 2],
            length,
        }
    }

    /// Creates an elliptical cylinder with semi-axes [along X, along Y] (m).
    pub fn elliptic_cylinder(semi_axes: [T; 2], length: T) -> Self {
        Self::TruncatedEllipticCone {
            base: semi_axes,
            top: semi_axes,
            length,
        }
    }

    /// Extent along Z (m).
    pub fn length(&self) -> T {
        match *self {
            Self::TruncatedEllipticCone { length, .. } => length,
            Self::Ellipsoid {
                semi_axes: [_, _, c],
            } => c + c,
            Self::SemiEllipsoid {
                semi_axes: [_, _, c],
            } => c,
            Self::Cuboid { sides: [_, _, z] } => z,
        }
    }

    /// Volume (m3).
    pub fn volume(&self) -> T {
        match *self {
            Self::TruncatedEllipticCone { base, top, length } => {
                T::pi() * length * mean_over_length(base, top, |_, a, b| a * b)
            }
            Self::Ellipsoid {
                semi_axes: [a, b, c],
            } => T::of(4.0 / 3.0) * T::pi() * a * b * c,
            Self::SemiEllipsoid {
                semi_axes: [a, b, c],
            } => T::of(2.0 / 3.0) * T::pi() * a * b * c,
            Self::Cuboid { sides: [x, y, z] } => x * y * z,
        }
    }

    /// Height of the centre of gravity above the base, along Z (m).
    pub fn cg(&self) -> T {
        match *self {
            Self::TruncatedEllipticCone { base, top, length } => {
                length * mean_over_length(base, top, |t, a, b| a * b * t)
                    / mean_over_length(base, top, |_, a, b| a * b)
            }
            Self::SemiEllipsoid {
                semi_axes: [_, _, c],
            } => T::of(3.0 / 8.0) * c,
            Self::Ellipsoid { .. } | Self::Cuboid { .. } => self.length() * T::of(0.5),
        }
    }

    /// Principal moments of inertia about the centre of gravity per unit mass (m2): squared radii of gyration about X,
    /// Y and Z.
    pub fn gyration(&self) -> Vector3<T> {
        // Mean squares of the coordinates about the centre of gravity; each moment is the sum of two of them.
        let (xx, yy, zz) = match *self {
            Self::TruncatedEllipticCone { base, top, length } => {
                let section = mean_over_length(base, top, |_, a, b| a * b);
                let cg = self.cg();
                let along = mean_over_length(base, top, |t, a, b| a * b * t * t);
                (
                    mean_over_length(base, top, |_, a, b| a * a * a * b) / (section * T::of(4.0)),
                    mean_over_length(base, top, |_, a, b| a * b * b * b) / (section * T::of(4.0)),
                    length * length * along / section - cg * cg,
                )
            }
            Self::Ellipsoid {
                semi_axes: [a, b, c],
            } => {
                let fifth = T::of(0.2);
                (a * a * fifth, b * b * fifth, c * c * fifth)
            }
            Self::SemiEllipsoid {
                semi_axes: [a, b, c],
            } => {
                let fifth = T::of(0.2);
                (a * a * fifth, b * b * fifth, c * c * T::of(19.0 / 320.0))
            }
            Self::Cuboid { sides: [x, y, z] } => {
                let twelfth = T::of(1.0 / 12.0);
                (x * x * twelfth, y * y * twelfth, z * z * twelfth)
            }
        };
        Vector3::new(yy + zz, xx + zz, xx + yy)
    }

    /// Areas of the silhouettes seen along X, Y and Z (m2).
    ///
    /// For a truncated elliptic cone the third is the area of the larger end section, exact if one end covers the
    /// other.
    pub fn silhouette(&self) -> Vector3<T> {
        match *self {
            Self::TruncatedEllipticCone {
                base: [a0, b0],
                top: [a1, b1],
                length,
            } => Vector3::new(
                length * (b0 + b1),
                length * (a0 + a1),
                T::pi() * (a0 * b0).max(a1 * b1),
            ),
            Self::Ellipsoid {
                semi_axes: [a, b, c],
            } => Vector3::new(b * c, a * c, a * b) * T::pi(),
            Self::SemiEllipsoid {
                semi_axes: [a, b, c],
            } => {
                let half = T::of(0.5);
                Vector3::new(b * c * half, a * c * half, a * b) * T::pi()
            }
            Self::Cuboid { sides: [x, y, z] } => Vector3::new(y * z, x * z, x * y),
        }
    }

    /// Mean width along X (m).
    pub fn mean_width(&self) -> T {
        self.silhouette().y / self.length()
    }
}

/// Mean over the length of `value(t, a, b)`, a polynomial of degree five or less in t (0 at the base, 1 at the top).
fn mean_over_length<T: Real>(base: [T; 2], top: [T; 2], value: impl Fn(T, T, T) -> T) -> T {
    // Three-point Gauss rule, exact up to degree five: nodes 1/2 +- sqrt(3/20).
    let node = T::of(0.387_298_334_620_741_7);
    let half = T::of(0.5);
    let at = |t: T| {
        let between = |from: T, to: T| from + (to - from) * t;
        value(t, between(base[0], top[0]), between(base[1], top[1]))
    };
    (at(half - node) + at(half + node)) * T::of(5.0 / 18.0) + at(half) * T::of(8.0 / 18.0)
}

/// Returns whether some distribution of mass has this inertia: symmetric, with no negative second moment of mass.
///
/// With J = tr(I)/2 - I (the second moments of mass) the test is J >= 0, which implies both positive moments and the
/// triangle inequality. The tolerance is 1e-6 of the trace, in either precision.
pub fn is_possible_inertia<T: Real>(inertia: &Matrix3<T>) -> bool {
    let trace = inertia.trace();
    // The comparison is also false for NaN.
    if !(trace > T::zero() && trace.is_finite()) {
        return false;
    }
    let scaled = inertia / trace;
    let tolerance = T::of(1e-6);
    if (scaled - scaled.transpose()).amax() > tolerance {
        return false;
    }
    let second_moment = Matrix3::from_diagonal_element(T::of(0.5) + tolerance) - scaled;
    let (a, b, c) = (second_moment.m11, second_moment.m22, second_moment.m33);
    let (d, e, f) = (second_moment.m21, second_moment.m31, second_moment.m32);
    let floor = -tolerance * tolerance;
    a >= T::zero()
        && b >= T::zero()
        && c >= T::zero()
        && a * b - d * d >= floor
        && a * c - e * e >= floor
        && b * c - f * f >= floor
        && second_moment.determinant() >= floor
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::PI;
    use proptest::prelude::*;

    /// Point membership, which defines each solid independently.
    fn contains(solid: &Solid<f64>, x: f64, y: f64, z: f64) -> bool {
        let ellipse = |a: f64, b: f64| (x / a).powi(2) + (y / b).powi(2);
        match *solid {
            Solid::TruncatedEllipticCone { base, top, length } => {
                let t = z / length;
                let mix = |i: usize| base[i] * (1.0 - t) + top[i] * t;
                (0.0..=1.0).contains(&t) && ellipse(mix(0), mix(1)) <= 1.0
            }
            Solid::Ellipsoid {
                semi_axes: [a, b, c],
            } => ellipse(a, b) + (z / c - 1.0).powi(2) <= 1.0,
            Solid::SemiEllipsoid {
                semi_axes: [a, b, c],
            } => ellipse(a, b) + (z / c).powi(2) <= 1.0,
            Solid::Cuboid { sides } => x.abs() <= sides[0] / 2.0 && y.abs() <= sides[1] / 2.0,
        }
    }

    /// Volume, centre of gravity, gyration and silhouettes found by counting cells of a grid.
    fn counted(solid: &Solid<f64>) -> (f64, f64, Vector3<f64>, Vector3<f64>) {
        const N: usize = 96;
        let (half, length) = (0.2, solid.length());
        let cell = |i: usize, low: f64, size: f64| low + (i as f64 + 0.5) * size / N as f64;
        let mut seen = [[[false; N]; N]; 3];
        let (mut count, mut first, mut second) = (0.0, 0.0, Vector3::zeros());
        for i in 0..N {
            for j in 0..N {
                for k in 0..N {
                    let (x, y) = (cell(i, -half, 2.0 * half), cell(j, -half, 2.0 * half));
                    let z = cell(k, 0.0, length);
                    if contains(solid, x, y, z) {
                        count += 1.0;
                        first += z;
                        second += Vector3::new(x * x, y * y, z * z);
                        seen[0][j][k] = true;
                        seen[1][i][k] = true;
                        seen[2][i][j] = true;
                    }
                }
            }
        }
        let (side, rise) = (2.0 * half / N as f64, length / N as f64);
        let cg = first / count;
        let mean = second / count - Vector3::new(0.0, 0.0, cg * cg);
        let gyration = Vector3::new(mean.y + mean.z, mean.x + mean.z, mean.x + mean.y);
        let area = Vector3::new(side * rise, side * rise, side * side);
        let area = Vector3::from_fn(|axis, _| {
            area[axis] * seen[axis].as_flattened().iter().filter(|s| **s).count() as f64
        });
        (count * side * side * rise, cg, gyration, area)
    }

    #[test]
    fn formulas_agree_with_counted_cells() {
        let solids = [
            Solid::cone(0.12, 0.07, 0.5),
            Solid::TruncatedEllipticCone {
                base: [0.17, 0.1],
                top: [0.13, 0.06],
                length: 0.3,
            },
            Solid::elliptic_cylinder([0.18, 0.11], 0.25),
            Solid::Ellipsoid {
                semi_axes: [0.15, 0.19, 0.12],
            },
            Solid::SemiEllipsoid {
                semi_axes: [0.15, 0.08, 0.19],
            },
            Solid::Cuboid {
                sides: [0.3, 0.2, 0.5],
            },
        ];
        for solid in solids {
            let (volume, cg, gyration, area) = counted(&solid);
            let close = |found: f64, expected: f64, share: f64| {
                assert!(
                    (found / expected - 1.0).abs() < share,
                    "{solid:?}: {found} is not {expected}"
                );
            };
            close(solid.volume(), volume, 0.02);
            close(solid.cg(), cg, 0.005);
            for axis in 0..3 {
                close(solid.gyration()[axis], gyration[axis], 0.015);
                close(solid.silhouette()[axis], area[axis], 0.03);
            }
        }
    }

    proptest! {
        /// The closed-form polynomials of the truncated circular cone (Hanavan 1964, Kwon3D).
        #[test]
        fn circular_cones_have_their_closed_form(
            r0 in 0.02f64..0.2, r1 in 0.02f64..0.2, length in 0.1f64..0.6
        ) {
            let solid = Solid::cone(r0, r1, length);
            let s = r0 * r0 + r0 * r1 + r1 * r1;
            let fourth = r0.powi(4) + r0.powi(3) * r1 + (r0 * r1).powi(2) + r0 * r1.powi(3) + r1.powi(4);
            let along = r0.powi(4) + 4.0 * r0.powi(3) * r1 + 10.0 * (r0 * r1).powi(2)
                + 4.0 * r0 * r1.powi(3) + r1.powi(4);
            let spin = 0.3 * fourth / s;
            let swing = spin / 2.0 + 3.0 * length * length / 80.0 * along / (s * s);
            let cg = length * (r0 * r0 + 2.0 * r0 * r1 + 3.0 * r1 * r1) / (4.0 * s);
            prop_assert!((solid.volume() / (PI * length * s / 3.0) - 1.0).abs() < 1e-13);
            prop_assert!((solid.cg() / cg - 1.0).abs() < 1e-13);
            prop_assert!((solid.gyration() - Vector3::new(swing, swing, spin)).amax() < 1e-14);
        }

        #[test]
        fn elliptic_columns_have_their_closed_form(
            a in 0.05f64..0.3, b in 0.05f64..0.3, length in 0.1f64..0.6
        ) {
            let expected = Vector3::new(
                (3.0 * b * b + length * length) / 12.0,
                (3.0 * a * a + length * length) / 12.0,
                (a * a + b * b) / 4.0,
            );
            let solid = Solid::elliptic_cylinder([a, b], length);
            prop_assert!((solid.gyration() - expected).amax() < 1e-14);
            prop_assert!((solid.cg() - length / 2.0).abs() < 1e-15);
        }
    }

    #[test]
    fn impossible_inertias_are_refused() {
        let possible = |d: [f64; 3]| is_possible_inertia(&Matrix3::from_diagonal(&d.into()));
        assert!(possible([1.0, 1.0, 0.1]));
        assert!(possible([1.0, 0.5, 0.5]), "a flat plate is the border");
        assert!(!possible([1.0, 0.4, 0.4]), "triangle inequality");
        assert!(!possible([1.0, 1.0, -0.1]));
        assert!(!possible([f64::NAN, 1.0, 1.0]));
        assert!(!possible([0.0; 3]));
        let mut skewed = Matrix3::identity();
        skewed[(0, 1)] = 0.1;
        assert!(!is_possible_inertia(&skewed));
        skewed[(1, 0)] = 0.1;
        assert!(is_possible_inertia(&skewed));
        skewed[(0, 1)] = 0.9;
        skewed[(1, 0)] = 0.9;
        assert!(!is_possible_inertia(&skewed));
    }
}
