//! Normal equations of columns, nuisances and residuals, with the nuisances marginalized out using their prior.

use core::ops::AddAssign;

use nalgebra::{DMatrix, DVector};

/// Derivatives with respect to the nuisances, in standard deviations of their priors.
#[derive(Debug, Clone)]
pub struct NuisanceColumns {
    slopes: DMatrix<f64>,
    /// Columns times columns.
    products: DMatrix<f64>,
}

impl NuisanceColumns {
    /// The derivatives.
    pub const fn slopes(&self) -> &DMatrix<f64> {
        &self.slopes
    }
}

impl From<DMatrix<f64>> for NuisanceColumns {
    fn from(slopes: DMatrix<f64>) -> Self {
        Self {
            products: slopes.tr_mul(&slopes),
            slopes,
        }
    }
}

/// The matrix of the normal equations, summed over stretches: products of columns and nuisances.
#[derive(Debug, Clone)]
pub struct NormalMatrix {
    /// Columns times columns.
    gg: DMatrix<f64>,
    /// Columns times nuisances.
    gn: DMatrix<f64>,
    /// Nuisances times nuisances.
    nn: DMatrix<f64>,
}

impl NormalMatrix {
    /// The matrix of one stretch.
    pub fn of(columns: &DMatrix<f64>, nuisances: &NuisanceColumns) -> Self {
        Self {
            gg: columns.tr_mul(columns),
            gn: columns.tr_mul(&nuisances.slopes),
            nn: nuisances.products.clone(),
        }
    }

    /// A zero matrix for this number of columns and nuisances.
    pub fn nothing(columns: usize, nuisances: usize) -> Self {
        Self {
            gg: DMatrix::zeros(columns, columns),
            gn: DMatrix::zeros(columns, nuisances),
            nn: DMatrix::zeros(nuisances, nuisances),
        }
    }
}

impl AddAssign<&Self> for NormalMatrix {
    fn add_assign(&mut self, other: &Self) {
        self.gg += &other.gg;
        self.gn += &other.gn;
        self.nn += &other.nn;
    }
}

/// The right-hand side: products of columns and nuisances with a residual, over the same stretches.
#[derive(Debug, Clone)]
pub struct NormalVector {
    /// Columns times residual.
    gr: DVector<f64>,
    /// Nuisances times residual.
    nr: DVector<f64>,
    /// Residual times residual.
    rr: f64,
}

impl NormalVector {
    /// The right-hand side of one stretch.
    pub fn of(
        residual: &DVector<f64>,
        columns: &DMatrix<f64>,
        nuisances: &NuisanceColumns,
    ) -> Self {
        Self {
            gr: columns.tr_mul(residual),
            nr: nuisances.slopes.tr_mul(residual),
            rr: residual.norm_squared(),
        }
    }

    /// A zero right-hand side with the dimensions of `matrix`.
    pub fn nothing(matrix: &NormalMatrix) -> Self {
        Self {
            gr: DVector::zeros(matrix.gg.ncols()),
            nr: DVector::zeros(matrix.nn.ncols()),
            rr: 0.0,
        }
    }

    /// Sum of squares of the whitened residual, and of the nuisances at their current values `centre`.
    pub fn misfit(&self, centre: &DVector<f64>) -> f64 {
        self.rr + centre.norm_squared()
    }
}

impl AddAssign<&Self> for NormalVector {
    fn add_assign(&mut self, other: &Self) {
        self.gr += &other.gr;
        self.nr += &other.nr;
        self.rr += other.rr;
    }
}

/// The sum of all parts, starting from `nothing`.
pub fn sum<'a, T: AddAssign<&'a T> + 'a>(nothing: T, parts: impl IntoIterator<Item = &'a T>) -> T {
    parts.into_iter().fold(nothing, |mut sum, part| {
        sum += part;
        sum
    })
}

/// Misfit with slope and curvature in some parameters, after the nuisances have moved as far as their priors allow.
#[derive(Debug, Clone)]
pub struct Marginalized {
    /// Sum of squares of the whitened residual and of the nuisances at their optimum.
    pub misfit: f64,
    /// Columns times residual.
    pub slope: DVector<f64>,
    /// Columns times columns.
    pub curvature: DMatrix<f64>,
    /// Optimum of the nuisances.
    taken: DVector<f64>,
    /// Its derivative with respect to each parameter.
    pull: DMatrix<f64>,
}

impl Marginalized {
    /// Marginalizes the nuisances, whose current values are `centre`. They are in standard deviations, so their prior
    /// is a unit normal distribution around zero.
    pub fn of(matrix: &NormalMatrix, vector: &NormalVector, centre: &DVector<f64>) -> Self {
        Self::damped(matrix, vector, centre, 0.0)
    }

    /// The same with the nuisances held near `centre` by a share of their own curvature (Marquardt).
    pub fn damped(
        matrix: &NormalMatrix,
        vector: &NormalVector,
        centre: &DVector<f64>,
        damping: f64,
    ) -> Self {
        let count = matrix.nn.nrows();
        let nr = &vector.nr - centre;
        let rr = vector.misfit(centre);
        let mut held = &matrix.nn + DMatrix::identity(count, count);
        for k in 0..count {
            held[(k, k)] *= 1.0 + damping;
        }
        let Some(held) = held.cholesky() else {
            return Self {
                misfit: rr,
                slope: vector.gr.clone(),
                curvature: matrix.gg.clone(),
                taken: DVector::zeros(count),
                pull: DMatrix::zeros(count, matrix.gg.ncols()),
            };
        };
        let taken = held.solve(&nr);
        let pull = held.solve(&matrix.gn.transpose());
        Self {
            misfit: rr - nr.dot(&taken),
            slope: &vector.gr - &matrix.gn * &taken,
            curvature: &matrix.gg - &matrix.gn * &pull,
            taken,
            pull,
        }
    }

    /// The problem restricted to some of its columns.
    pub fn only(&self, columns: &[usize]) -> Self {
        Self {
            misfit: self.misfit,
            slope: DVector::from_fn(columns.len(), |k, _| self.slope[columns[k]]),
            curvature: DMatrix::from_fn(columns.len(), columns.len(), |j, k| {
                self.curvature[(columns[j], columns[k])]
            }),
            taken: self.taken.clone(),
            pull: self.pull.select_columns(columns),
        }
    }

    /// The change of the nuisances for a step of the parameters.
    pub fn nuisances(&self, step: &DVector<f64>) -> DVector<f64> {
        if step.len() == self.pull.ncols() {
            &self.taken - &self.pull * step
        } else {
            self.taken.clone()
        }
    }

    /// The step that minimizes the misfit, and the covariance of the parameters. `priors` are standard deviations.
    pub fn solved(&self, priors: &[f64]) -> Option<(DVector<f64>, DMatrix<f64>)> {
        self.solved_damped(priors, 0.0)
    }

    /// The same with the parameters held near their current values by a share of their own curvature.
    pub fn solved_damped(
        &self,
        priors: &[f64],
        damping: f64,
    ) -> Option<(DVector<f64>, DMatrix<f64>)> {
        if self.slope.is_empty() || self.slope.len() != priors.len() {
            return None;
        }
        let mut curvature = self.curvature.clone();
        for (k, prior) in priors.iter().enumerate() {
            curvature[(k, k)] += 1.0 / (prior * prior);
            curvature[(k, k)] *= 1.0 + damping;
        }
        let factor = curvature.cholesky()?;
        Some((factor.solve(&self.slope), factor.inverse()))
    }

    /// First-order reduction of the misfit by these parameters.
    pub fn gain(&self, priors: &[f64]) -> f64 {
        self.solved(priors)
            .map_or(0.0, |(step, _)| step.dot(&self.slope))
    }
}
