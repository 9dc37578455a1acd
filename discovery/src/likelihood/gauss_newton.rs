//! Gauss-Newton steps in the parameters of effects or loads, halved until the likelihood rises.

use nalgebra::DVector;

use crate::likelihood::schur::InformationForm;

/// Maximum number of steps, the gain of log-likelihood below which they stop, and how often a step is tried: in full,
/// then halved each time.
const STEPS: usize = 5;
const LEAST_GAIN: f64 = 0.2;
const TRIES: usize = 4;

/// How a fit depends on its parameters.
pub(crate) struct Fitted<'a, Around, Moved, Away> {
    /// Standard deviations of the parameters' prior.
    pub(crate) prior: &'a [f64],
    /// The quadratic approximation around some parameters, or `None` if the simulation diverges.
    pub(crate) around: Around,
    /// Parameters after a step.
    pub(crate) moved: Moved,
    /// The distance of parameters from the centre of their prior.
    pub(crate) away: Away,
}

impl<Around, Moved, Away> Fitted<'_, Around, Moved, Away> {
    /// Fits the parameters, beginning with the given approximation and step, and returns them with the approximation
    /// around them. Returns `None` if a step cannot be computed.
    pub(crate) fn from<P>(
        &self,
        mut at: P,
        mut form: InformationForm,
        mut step: DVector<f64>,
    ) -> Option<(P, InformationForm)>
    where
        Around: Fn(&P) -> Option<InformationForm>,
        Moved: Fn(&P, &DVector<f64>) -> P,
        Away: Fn(&P) -> DVector<f64>,
    {
        let left = |form: &InformationForm, at: &P| {
            let away = (self.away)(at);
            let each = away.iter().zip(self.prior);
            let penalty: f64 = each
                .map(|(away, deviation)| 0.5 * (away / deviation).powi(2))
                .sum();
            0.5 * form.square + penalty
        };
        for _ in 0..STEPS {
            let before = left(&form, &at);
            let mut gained = None;
            for _ in 0..TRIES {
                let next = (self.moved)(&at, &step);
                if let Some(found) = (self.around)(&next)
                    && left(&found, &next) < before
                {
                    gained = Some(before - left(&found, &next));
                    (at, form) = (next, found);
                    break;
                }
                step *= 0.5;
            }
            if gained.is_none_or(|gained| gained < LEAST_GAIN) {
                break;
            }
            step = form.solved(self.prior, &(self.away)(&at))?.0;
        }
        Some((at, form))
    }
}
