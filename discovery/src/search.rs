//! The search: an effect gets a name where it is significant over flights drawn from the plain model, helps in
//! stretches that it was not fitted to, and explains most of what there is to explain.

use bodyflight_core::effect::{Effect, Model, PARAMETER_COUNT};

use super::check::{self, Check, Finding};
use super::choice::{Choice, Contest, next, pruned};
use super::criteria::{DISAGREES, EXPLAINS};
use super::effect_set::{EffectSet, all_parameters, extended};
use super::error::{Error, Result};
use super::fit::{Data, Fit};
use super::gap::{self, Gap, HeldOutGap};
use super::held_out::HeldOut;
use super::linearization::Linearization;
use super::momentum::balance;
use super::nuisance::Nuisance;
use super::null_distribution::NullDistribution;
use super::progress::{Progress, begin};
use super::regime;
use super::report::{self, Named, Outcome, Report, share_explained};
use super::stability::{Parts, Whiteness};
use super::stretch::stretches;
use super::track::Track;

/// How to look.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Settings {
    /// Most effects that are named.
    pub max_effects: usize,
    /// Seed of the flights that are drawn.
    pub seed: u64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            max_effects: 3,
            seed: 1,
        }
    }
}

/// Share of what a flight held out leaves beyond noise that the effects named must close there: what only fits one
/// flight is not it.
const CLOSES: f64 = 0.5;

/// Shortest flight that is judged (stretches).
const LEAST_STRETCHES: usize = 20;

/// Looks for what the model misses in a flight.
///
/// # Errors
/// Returns an error if the flight is too short to be judged, or if the search was cancelled.
pub fn discover(
    track: &Track,
    held_out: &[Track],
    settings: &Settings,
    progress: &dyn Progress,
) -> Result<Report> {
    let stretches = stretches(track);
    if stretches.len() < 2 {
        return Err(Error::TooShort {
            least_s: 4.0,
            found_s: track.duration(),
        });
    }
    begin(progress, "whether the sensors agree with one another")?;
    let search = Search::new(track, held_out, settings, progress);
    begin(progress, "what each effect would change")?;
    let as_in_files = (&EffectSet::new(), &Nuisance::none());
    let from_files = Linearization::new(
        track,
        &search.model,
        stretches,
        as_in_files,
        &all_parameters(),
    );
    begin(progress, "flights in which nothing is missing")?;
    let (plain, found) = search.without_effects(&from_files);
    let found = search.with_effects(from_files, found)?;
    begin(progress, "what is left of the gap")?;
    Ok(search.report(&plain, found))
}

/// A search in a flight whose sensors are judged.
struct Search<'a> {
    track: &'a Track,
    settings: &'a Settings,
    progress: &'a dyn Progress,
    checks: Vec<Check>,
    /// Errors of the sensors that the data alone show.
    faults: EffectSet,
    /// Without anything found.
    bare: Model<f64>,
    /// With the faults: no physics is taken for them.
    model: Model<f64>,
    others: Vec<HeldOut<'a>>,
}

/// How far the plain model is from the flight.
struct Plain {
    misfit: f64,
    /// Deviations of the misfit beyond that of drawn flights.
    disagreement: f64,
    left: Parts,
}

/// What was found so far.
struct Found {
    named: Vec<Named>,
    chosen: Fit,
    /// About the fit chosen.
    linearization: Linearization,
    /// Flights in which nothing is missing but what was found.
    null: NullDistribution,
}

impl<'a> Search<'a> {
    fn new(
        track: &'a Track,
        held_out: &'a [Track],
        settings: &'a Settings,
        progress: &'a dyn Progress,
    ) -> Self {
        let checks = check::checks(track);
        let faults: EffectSet = checks
            .iter()
            .filter(|check| check.finding == Finding::Found)
            .map(|check| (check.effect, check.values))
            .collect();
        let bare = Model::new(track.dynamics, track.start_height());
        Self {
            track,
            settings,
            progress,
            model: extended(&bare, &faults),
            bare,
            others: held_out
                .iter()
                .map(|track| HeldOut::new(track, &faults))
                .collect(),
            faults,
            checks,
        }
    }

    fn data<'b>(&'b self, linearization: &'b Linearization) -> Data<'b> {
        Data::new(self.track, &self.model, linearization)
    }

    fn null(&self, linearization: &Linearization, effects: &EffectSet) -> NullDistribution {
        let seed = self.settings.seed;
        NullDistribution::draw(self.track, linearization, &self.model, effects, seed)
    }

    /// The flight without effects, joints and subject fitted to it.
    fn without_effects(&self, from_files: &Linearization) -> (Plain, Found) {
        let none = EffectSet::new();
        let null = self.null(from_files, &none);
        let here = self.data(from_files);
        let (chosen, linearization) = here.profiled_relinearized(&none);
        let misfit = if self.faults.is_empty() {
            chosen.misfit
        } else {
            let bare = Data::new(self.track, &self.bare, from_files);
            bare.profiled_relinearized(&none).0.misfit
        };
        let [expected, deviation] = null.misfit;
        let plain = Plain {
            misfit,
            disagreement: (misfit - expected) / deviation,
            left: Parts::of(&here.with(&linearization), &chosen),
        };
        let found = Found {
            named: Vec::new(),
            chosen,
            linearization,
            null,
        };
        (plain, found)
    }

    /// Names effects one after another, as long as one deserves it.
    fn with_effects(&self, from_files: Linearization, mut found: Found) -> Result<Found> {
        let decided = |check: &&Check| check.finding != Finding::Undecided;
        let mut out_of_question: Vec<Effect> = self
            .checks
            .iter()
            .filter(decided)
            .map(|check| check.effect)
            .collect();
        let mut from_files = Some(from_files);
        while found.named.len() + self.faults.len() < self.settings.max_effects {
            begin(self.progress, "which effect explains most")?;
            let here = self.data(&found.linearization);
            let problems = match &from_files {
                // Joints may hide what is missing once they are fitted, and look like something else before.
                Some(from_files) => vec![here.with(from_files), here],
                None => vec![here],
            };
            let choice = next(&Contest {
                problems: &problems,
                others: &self.others,
                null: &found.null,
                chosen: &found.chosen,
                out_of_question: &out_of_question,
                progress: self.progress,
            })?;
            let Some(choice) = choice else {
                break;
            };
            from_files = None;
            let dropped;
            (found, dropped) = self.taken(choice, found)?;
            // What a later name made needless is not asked again, or two could drop one another for ever.
            out_of_question.extend(dropped);
        }
        Ok(found)
    }

    /// With one more name, and without those that it made needless.
    fn taken(&self, choice: Choice, before: Found) -> Result<(Found, Vec<Effect>)> {
        let here = self.data(&before.linearization);
        let fit = here.relinearized_to_the_end(choice.fit);
        let linearization = here.linearized_at(&fit.effects, &fit.nuisance, &all_parameters());
        let (chosen, dropped) = pruned(&self.data(&linearization), &before.null, fit);
        let mut named = before.named;
        named.push(choice.named);
        named.retain(|named| !dropped.contains(&named.effect()));
        begin(self.progress, "flights in which nothing more is missing")?;
        let found = Found {
            null: self.null(&linearization, &chosen.effects),
            named,
            chosen,
            linearization,
        };
        Ok((found, dropped))
    }

    /// What effects do in the flights held out.
    fn held_out_gaps(&self, effects: &EffectSet) -> Vec<HeldOutGap> {
        let gap = |other: &HeldOut<'_>| other.gap(effects, self.settings.seed);
        self.others.iter().map(gap).collect()
    }

    fn report(&self, plain: &Plain, found: Found) -> Report {
        let (track, floor) = (self.track, &found.null.floor);
        let explained = share_explained(plain.misfit, found.chosen.misfit, found.null.misfit[0]);
        let thin = found.linearization.parts.len() < LEAST_STRETCHES || track.is_still();
        let agrees = plain.disagreement < DISAGREES;
        let mut effects = [self.faults.clone(), found.chosen.effects.clone()].concat();
        let mut held_out = self.held_out_gaps(&effects);
        let closes = |gap: &HeldOutGap| gap.closed_share() >= CLOSES;
        let holds = found.chosen.effects.is_empty() || held_out.iter().all(closes);
        let enough = holds && (agrees || explained >= EXPLAINS);
        let by_check = self.checks.iter().filter(|c| c.finding == Finding::Found);
        let named: Vec<Named> = by_check
            .map(Named::by_check)
            .chain(settled(&found))
            .collect();
        let outcome = Outcome::of(thin, agrees, &named, enough);
        if outcome != Outcome::Named && !effects.is_empty() {
            effects.clear();
            held_out = self.held_out_gaps(&effects);
        }
        let left = Parts::of(&self.data(&found.linearization), &found.chosen);
        let data = Data::new(track, &self.bare, &found.linearization);
        let momentum =
            [&self.bare, &extended(&self.bare, &effects)].map(|model| balance(track, model));
        let map = gap::map(&data, &effects, floor);
        Report::new(report::Parts {
            outcome,
            explained,
            disagreement: plain.disagreement,
            gap: Gap::of(&data, &effects, floor),
            held_out,
            regimes: regime::regimes(track, &map),
            signature: regime::companions(track, &momentum[1]),
            whiteness: Whiteness::of(&plain.left, &left),
            momentum,
            map,
            named,
            effects,
            checks: self.checks.clone(),
        })
    }
}

/// The names with the parameters of the last, joint fit.
///
/// Their errors are how far fits to flights drawn from the model found are off, widened by the misfit that is left.
fn settled(found: &Found) -> Vec<Named> {
    let (fit, null) = (&found.chosen, &found.null);
    let left = (fit.misfit / null.misfit[0].max(1.0)).max(1.0).sqrt();
    let mut errors = fit.errors.iter().zip(&null.errors);
    let mut named = found.named.clone();
    for (effect, values) in &fit.effects {
        let mut own = [0.0; PARAMETER_COUNT];
        let count = effect.description().parameters.len();
        for (own, (fitted, drawn)) in own.iter_mut().zip(errors.by_ref().take(count)) {
            *own = fitted.max(*drawn) * left;
        }
        for named in named.iter_mut().filter(|named| named.effect() == *effect) {
            *named = named.clone().with_parameters(values, &own);
        }
    }
    named
}
