//! `bodyflight discover`: where simulation and measurement disagree, which effect is missing, and how much of the
//! gap it closes.
//!
//! The steps, one file each: the flight in memory ([`track`]), whether its sensors agree with one another
//! ([`check`]), short free runs and their residuals ([`stretch`]), what each effect would change in them and what may
//! be wrong without being one ([`design`]), effects fitted to them ([`fit`]), and here the choice: an effect gets a
//! name where it is significant over flights drawn from the plain model, helps in stretches that it was not fitted
//! to, and explains most of what there is to explain.

pub mod check;
mod choice;
pub mod design;
pub mod figure;
pub mod fit;
pub mod flown;
pub mod gap;
mod held_out;
pub mod linear;
pub mod momentum;
mod null;
pub mod point;
pub mod regime;
pub mod report;
pub mod stability;
pub mod stretch;
pub mod tolerance;
pub mod track;

use bodyflight_core::effect::{Effect, Model};

use crate::diagnostic::{Problem, Result};
use check::{Check, Finding};
use choice::{next, pruned};
use design::{Around, places};
use fit::{Data, Values, with};
use gap::{Gap, HeldOutGap};
use held_out::HeldOut;
use momentum::balance;
use null::Null;
use report::{Named, Outcome, share_explained};
use stability::{Parts, Whiteness};
use stretch::stretches;
use tolerance::Wrong;
use track::Track;

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

/// Deviations of the misfit beyond that of drawn flights, from which on the flight disagrees with the model.
const DISAGREES: f64 = 5.0;

/// Share of what there is to explain that the effects named must explain together.
const EXPLAINS: f64 = 0.6;

/// Share of what a flight held out leaves beyond noise that they must close there: what only fits one flight is not it.
const CLOSES: f64 = 0.5;

/// Shortest flight that is judged (stretches).
const LEAST_STRETCHES: usize = 20;

/// Looks for what the model misses in a flight.
///
/// # Errors
/// Where the flight is too short to be judged.
pub fn discover(
    track: &Track,
    held_out: &[Track],
    settings: &Settings,
    mut progress: impl FnMut(&str),
) -> Result<report::Report> {
    let bare = Model::new(track.dynamics, track.start_height());
    let stretches = stretches(track);
    if stretches.len() < 2 {
        return Err(Problem::bad_input(format!(
            "expected at least 4 s of flight, found {:.1} s",
            track.duration()
        )));
    }
    progress("whether the sensors agree with one another");
    let checks = check::checks(track);
    let faults: Values = checks
        .iter()
        .filter(|check| check.finding == Finding::Found)
        .map(|check| (check.effect, check.values))
        .collect();
    // Errors of the sensors are in the model from here on, and no physics is taken for them.
    let model = with(&bare, &faults);
    progress("what each effect would change");
    let start = (&Vec::new(), &Wrong::nothing());
    let from_files = Around::new(track, &model, stretches, start, &places());
    progress("flights in which nothing is missing");
    let nothing = Vec::new();
    let mut null = Null::draw(track, &from_files, &model, &nothing, settings.seed);
    let others: Vec<HeldOut<'_>> = held_out
        .iter()
        .map(|track| HeldOut::new(track, &faults))
        .collect();
    let here = Data::new(track, &model, &from_files);
    let (mut chosen, mut around) = here.settled_refined(&nothing);
    let left_before = Parts::of(&here.with(&around), &chosen);
    let plain = if faults.is_empty() {
        chosen.misfit
    } else {
        let bare = Data::new(track, &bare, &from_files);
        bare.settled_refined(&nothing).0.misfit
    };
    let [expected, deviation] = null.misfit;
    let disagreement = (plain - expected) / deviation;

    let decided = |check: &&Check| check.finding != Finding::Undecided;
    let mut out_of_question: Vec<Effect> = checks
        .iter()
        .filter(decided)
        .map(|check| check.effect)
        .collect();
    let mut from_files = Some(from_files);
    let mut named: Vec<Named> = Vec::new();
    while named.len() + faults.len() < settings.max_effects {
        progress("which effect explains most");
        let here = Data::new(track, &model, &around);
        let problems = match &from_files {
            // Joints may hide what is missing once they are fitted, and look like something else before.
            Some(from_files) => vec![here.with(from_files), here],
            None => vec![here],
        };
        let Some(choice) = next(&problems, &others, &null, &chosen, &out_of_question) else {
            break;
        };
        named.push(choice.named);
        let fit = here.finished(choice.fit);
        around = here.moved_to(&fit.values, &fit.wrong, &places());
        from_files = None;
        let here = Data::new(track, &model, &around);
        let dropped;
        (chosen, dropped) = pruned(&here, &null, fit);
        named.retain(|named| !dropped.contains(&named.effect()));
        // What a later name made needless is not asked again, or two could drop one another for ever.
        out_of_question.extend(dropped);
        progress("flights in which nothing more is missing");
        null = Null::draw(track, &around, &model, &chosen.values, settings.seed);
    }
    let explained = share_explained(plain, chosen.misfit, null.misfit[0]);
    report::settle(&mut named, &chosen, &null);
    let by_check = checks.iter().filter(|c| c.finding == Finding::Found);
    named.splice(0..0, by_check.map(Named::by_check));
    let thin = around.parts.len() < LEAST_STRETCHES || track.is_still();
    let agrees = disagreement < DISAGREES;
    progress("what is left of the gap");
    let gaps = |values: &Values| -> Vec<HeldOutGap> {
        let gap = |other: &HeldOut<'_>| other.gap(values, settings.seed);
        others.iter().map(gap).collect()
    };
    let mut values = [faults, chosen.values.clone()].concat();
    let mut held_out = gaps(&values);
    let closes = |gap: &HeldOutGap| gap.closed_share() >= CLOSES;
    let holds = chosen.values.is_empty() || held_out.iter().all(closes);
    let enough = holds && (agrees || explained >= EXPLAINS);
    let outcome = Outcome::of(thin, agrees, &named, enough);
    if outcome != Outcome::Named && !values.is_empty() {
        values.clear();
        held_out = gaps(&values);
    }
    let left_after = Parts::of(&Data::new(track, &model, &around), &chosen);
    let data = Data::new(track, &bare, &around);
    let gap = Gap::of(&data, &values, &null.floor);
    let momentum = [&bare, &with(&bare, &values)].map(|model| balance(track, model));
    let map = gap::map(&data, &values, &null.floor);
    Ok(report::Report::new(report::Parts {
        outcome,
        named,
        explained,
        disagreement,
        gap,
        held_out,
        regimes: regime::regimes(track, &map),
        signature: regime::companions(track, &momentum[1]),
        whiteness: Whiteness::of(&left_before, &left_after),
        momentum,
        map,
        values,
        checks,
    }))
}

#[cfg(test)]
mod tests;
