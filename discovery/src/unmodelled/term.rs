//! Groups of loads that share their factors, and the search for the group that a flight's residuals call for.

use bodyflight_core::dynamics::applied_load::factor::Factor;
use bodyflight_core::dynamics::applied_load::{AppliedLoad, Kind, Point};
use rayon::prelude::*;

use crate::hypotheses::decision::DECISION;
use crate::likelihood::flight_problem::FlightProblem;
use crate::unmodelled::grammar::{
    Factors, Pointing, directions, frequencies, near, pulses, sine, single, states, times, unit,
};
use crate::unmodelled::projection::{Column, Directed, View, mean_turn};

/// Number of sines, and of pulses, that are refined: those with the largest lower bounds of their gain.
const CLOSELY: usize = 12;

/// Loads that share their factors.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Group {
    /// Factors common to all loads.
    pub factors: Factors,
    /// Direction and size (N or N m) of each load.
    pub terms: Vec<(Pointing, f64)>,
    /// Cost of the choice, in addition to that of the parameters: the logarithm of the number of alternatives.
    pub choice: f64,
}

impl Group {
    /// The loads of the group.
    pub(crate) fn loads(&self) -> impl Iterator<Item = AppliedLoad<f64>> {
        self.terms.iter().map(|(pointing, size)| AppliedLoad {
            size: *size,
            ..unit(*pointing, self.factors)
        })
    }

    /// Gain needed to justify the group: cost of its choice and of its parameters.
    pub(crate) fn cost(&self) -> f64 {
        let numbers: usize = self.factors.iter().flatten().map(numbers_of).sum();
        self.choice + DECISION.gain_per_parameter * (numbers + self.terms.len()) as f64
    }
}

/// Number of fitted parameters of a factor.
const fn numbers_of(factor: &Factor<f64>) -> usize {
    match factor {
        Factor::Sine { .. } => 2,
        Factor::Pulse { period, .. } => {
            if *period > 0.0 {
                3
            } else {
                2
            }
        }
        _ => 0,
    }
}

/// A product of factors along one direction, with its gain less its cost.
#[derive(Clone, Copy)]
struct BestProduct {
    factors: Factors,
    direction: usize,
    worth: f64,
}

/// A view with the directions and factors that a search tries, computed once.
struct Search<'a> {
    view: &'a View<'a>,
    pointings: Vec<Pointing>,
    directed: Vec<Directed>,
    states: Vec<Factor<f64>>,
}

/// Returns the group with the largest gain, or `None` if none gains more than it costs.
pub(crate) fn best_group(view: &View<'_>, problem: &FlightProblem<'_>) -> Option<Group> {
    let pointings = directions();
    let mut states = states(problem.track.start_height());
    for factor in &mut states {
        if let Factor::Joint {
            segment,
            axis,
            from,
            ..
        } = factor
        {
            let mean = mean_turn(problem, *segment);
            *from = axis.of(&mean);
        }
    }
    let directed = pointings.par_iter().map(|p| view.directed(*p)).collect();
    let search = Search {
        view,
        pointings,
        directed,
        states,
    };
    let duration = problem.track.duration();
    let kinds = [
        search.best_state(),
        search.best_sine(duration),
        search.best_pulse(duration),
    ];
    let best = kinds
        .into_iter()
        .flatten()
        .max_by(|a, b| a.worth.total_cmp(&b.worth))?;
    let best = search.multiplied(best);
    let group = search.joined(best, duration);
    (best.worth > 0.0).then_some(group)
}

impl Search<'_> {
    fn choice(&self, factors: &Factors, duration: f64) -> f64 {
        let mut choice = 0.0;
        for factor in factors.iter().flatten() {
            choice += match factor {
                Factor::Sine { .. } => (frequencies(duration).len() as f64 / 3.0).ln(),
                Factor::Pulse { period, .. } if *period > 0.0 => 1e3_f64.ln(),
                Factor::Pulse { .. } => (duration * 5.0).max(1.0).ln(),
                _ => (self.states.len() as f64).ln(),
            };
        }
        choice
    }

    fn is_at_a_point(&self, direction: usize) -> bool {
        matches!(self.pointings[direction].0, Kind::Force(Point::Segment(_)))
    }

    /// The gain along a direction less its cost: the direction is one of many, a point of application is one more
    /// parameter, and a force on the whole body is preferred if it explains as much.
    fn worth_along(&self, gain: f64, direction: usize) -> f64 {
        let choice = (self.pointings.len() as f64).ln();
        if self.is_at_a_point(direction) {
            DECISION.at_a_point * gain - choice - 2.0 * DECISION.gain_per_parameter
        } else {
            gain - choice - DECISION.gain_per_parameter
        }
    }

    fn worth(&self, gain: f64, factors: &Factors, direction: usize, duration: f64) -> f64 {
        let numbers: usize = factors.iter().flatten().map(numbers_of).sum();
        let worth = self.worth_along(gain, direction);
        worth - self.choice(factors, duration) - DECISION.gain_per_parameter * numbers as f64
    }

    /// The best factor without explicit time dependence, alone or multiplied by the speed factor.
    fn best_state(&self) -> Option<BestProduct> {
        let products = |k: usize| {
            let first = self.states[k];
            let alone = core::iter::once(single(first));
            // All aerodynamic loads depend on the square of the speed.
            let others = self.states[..1].iter().filter(move |_| k > 0);
            alone.chain(others.filter_map(move |other| times(single(first), *other)))
        };
        let all: Vec<Factors> = (0..self.states.len())
            .flat_map(products)
            .chain([[None; 3]])
            .collect();
        all.par_iter()
            .filter_map(|factors| {
                let values = self.view.values(factors);
                let each = self.directed.iter().enumerate().map(|(direction, along)| {
                    let gain = self.view.gain(along, &values);
                    BestProduct {
                        factors: *factors,
                        direction,
                        worth: self.worth(gain, factors, direction, 1.0),
                    }
                });
                each.max_by(|a, b| a.worth.total_cmp(&b.worth))
            })
            .max_by(|a, b| a.worth.total_cmp(&b.worth))
    }

    /// Sine and cosine at a frequency.
    fn waves(&self, frequency: f64) -> [Vec<f64>; 2] {
        [0.0, core::f64::consts::FRAC_PI_2]
            .map(|phase| self.view.values(&single(sine(frequency, phase))))
    }

    /// Gain of a sine along a direction, and its phase.
    fn wave(&self, frequency: f64, direction: usize) -> Option<(f64, f64)> {
        let waves = self.waves(frequency);
        let along = &self.directed[direction];
        let columns = waves.each_ref().map(|values| Column { along, values });
        let (gain, sizes) = self.view.solved(&columns)?;
        Some((gain, sizes[1].atan2(sizes[0])))
    }

    fn best_sine(&self, duration: f64) -> Option<BestProduct> {
        let all = frequencies(duration);
        let step = all.get(1)? - all.first()?;
        let mut bounds: Vec<(f64, f64, usize)> = all
            .par_iter()
            .flat_map_iter(|frequency| {
                let waves = self.waves(*frequency);
                let each = self.directed.iter().enumerate();
                each.map(move |(direction, along)| {
                    let bound = self
                        .view
                        .at_least(along, waves.each_ref().map(Vec::as_slice));
                    (bound, *frequency, direction)
                })
            })
            .collect();
        bounds.sort_by(|a, b| b.0.total_cmp(&a.0));
        bounds.truncate(CLOSELY);
        let closely = bounds.par_iter().filter_map(|(_, frequency, direction)| {
            let fine = (-12..=12).filter_map(|k| {
                let frequency = frequency + step * f64::from(k) / 8.0;
                let (gain, phase) = self.wave(frequency, *direction)?;
                Some((gain, frequency, phase))
            });
            let (gain, frequency, phase) = fine.max_by(|a, b| a.0.total_cmp(&b.0))?;
            let factors = single(sine(frequency, phase));
            Some(BestProduct {
                factors,
                direction: *direction,
                worth: self.worth(gain, &factors, *direction, duration),
            })
        });
        closely.max_by(|a, b| a.worth.total_cmp(&b.worth))
    }

    fn best_pulse(&self, duration: f64) -> Option<BestProduct> {
        let mut bounds: Vec<(f64, Factor<f64>, usize)> = pulses(duration)
            .into_par_iter()
            .filter_map(|pulse| {
                let values = self.view.values(&single(pulse));
                let each = self.directed.iter().enumerate().map(|(direction, along)| {
                    let bound = self.view.at_least(along, [&values, &[]]);
                    (bound, pulse, direction)
                });
                each.max_by(|a, b| a.0.total_cmp(&b.0))
            })
            .collect();
        bounds.sort_by(|a, b| b.0.total_cmp(&a.0));
        bounds.truncate(CLOSELY);
        let closely = bounds.par_iter().filter_map(|(_, pulse, direction)| {
            let gain = |pulse: Factor<f64>| {
                let values = self.view.values(&single(pulse));
                self.view.gain(&self.directed[*direction], &values)
            };
            let mut best = (gain(*pulse), *pulse);
            for step in [0.1, 0.05, 0.05, 0.025] {
                let others = near(best.1, step).into_iter().map(|p| (gain(p), p));
                let found = others.max_by(|a, b| a.0.total_cmp(&b.0))?;
                if found.0 > best.0 {
                    best = found;
                }
            }
            let factors = single(best.1);
            Some(BestProduct {
                factors,
                direction: *direction,
                worth: self.worth(best.0, &factors, *direction, duration),
            })
        });
        closely.max_by(|a, b| a.worth.total_cmp(&b.worth))
    }

    /// Multiplies by one more factor if that pays off.
    fn multiplied(&self, found: BestProduct) -> BestProduct {
        let along = &self.directed[found.direction];
        let gain = |factors: &Factors| self.view.gain(along, &self.view.values(factors));
        let alone = gain(&found.factors);
        let others = self.states.par_iter().filter_map(|factor| {
            if found.factors.contains(&Some(*factor)) {
                return None;
            }
            // A joint oscillating about its mean contributes little unless the mean is included, so the angle is not
            // centred.
            let mut factor = *factor;
            if let Factor::Joint { from, .. } = &mut factor {
                *from = 0.0;
            }
            let factors = times(found.factors, factor)?;
            let more = gain(&factors)
                - alone
                - (self.states.len() as f64).ln()
                - DECISION.gain_per_parameter;
            Some(BestProduct {
                factors,
                worth: found.worth + more,
                ..found
            })
        });
        let best = others.max_by(|a, b| a.worth.total_cmp(&b.worth));
        best.filter(|best| best.worth > found.worth)
            .unwrap_or(found)
    }

    /// Adds other directions that share the factors.
    fn joined(&self, found: BestProduct, duration: f64) -> Group {
        let values = self.view.values(&found.factors);
        let mut chosen = vec![found.direction];
        let solved = |directions: &[usize]| {
            let columns: Vec<Column<'_>> = directions
                .iter()
                .map(|k| Column {
                    along: &self.directed[*k],
                    values: &values,
                })
                .collect();
            self.view.solved(&columns)
        };
        let mut gained = solved(&chosen).map_or(0.0, |(gain, _)| gain);
        while chosen.len() < DECISION.loads_in_group {
            let others = (0..self.pointings.len()).filter(|k| !chosen.contains(k));
            let with = |k: usize| {
                let mut all = chosen.clone();
                all.push(k);
                let (gain, _) = solved(&all)?;
                Some((self.worth_along(gain - gained, k), gain, k))
            };
            let best = others
                .collect::<Vec<_>>()
                .into_par_iter()
                .filter_map(with)
                .max_by(|a, b| a.0.total_cmp(&b.0));
            match best {
                Some((worth, gain, k)) if worth > 0.0 => {
                    chosen.push(k);
                    gained = gain;
                }
                _ => break,
            }
        }
        let sizes = solved(&chosen).map(|(_, sizes)| sizes);
        let terms = chosen.iter().enumerate().map(|(place, k)| {
            let size = sizes.as_ref().map_or(0.0, |sizes| sizes[place]);
            (self.pointings[*k], size)
        });
        let numbers = DECISION.gain_per_parameter * chosen.len() as f64;
        let directions: f64 = chosen.iter().map(|k| -self.worth_along(0.0, *k)).sum();
        Group {
            factors: found.factors,
            terms: terms.collect(),
            choice: self.choice(&found.factors, duration) + directions - numbers,
        }
    }
}

/// Adapts the phase or start of time-dependent factors to another flight, if its gain exceeds the cost of a parameter.
pub(crate) fn shifted(view: &View<'_>, group: &Group) -> Group {
    let directed: Vec<Directed> = group.terms.iter().map(|(p, _)| view.directed(*p)).collect();
    let gain = |factors: &Factors| {
        let values = view.values(factors);
        let columns: Vec<Column<'_>> = directed
            .iter()
            .map(|along| Column {
                along,
                values: &values,
            })
            .collect();
        view.quadratic(&columns)
            .map_or(f64::MIN, |(information, slope)| {
                let sizes = nalgebra::DVector::from_iterator(
                    group.terms.len(),
                    group.terms.iter().map(|(_, size)| *size),
                );
                sizes.dot(&slope) - 0.5 * sizes.dot(&(information * &sizes))
            })
    };
    let mut best = (
        gain(&group.factors) + DECISION.gain_per_parameter,
        group.factors,
    );
    for place in 0..group.factors.len() {
        let others: Vec<Factor<f64>> = match group.factors[place] {
            Some(Factor::Sine { frequency, phase }) => (1..64)
                .map(|k| {
                    sine(
                        frequency,
                        phase + core::f64::consts::TAU * f64::from(k) / 64.0,
                    )
                })
                .collect(),
            Some(Factor::Pulse {
                start,
                duration,
                period,
            }) if period > 0.0 => (1..100)
                .map(|k| Factor::Pulse {
                    start: start + period * f64::from(k) / 100.0 - period,
                    duration,
                    period,
                })
                .collect(),
            _ => continue,
        };
        for other in others {
            let mut factors = group.factors;
            factors[place] = Some(other);
            let found = gain(&factors);
            if found > best.0 {
                best = (found, factors);
            }
        }
    }
    Group {
        factors: best.1,
        ..group.clone()
    }
}
