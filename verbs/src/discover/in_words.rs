//! What the effects found do to a person, in the words of a coach.

use std::path::Path;

use bodyflight_core::effect::Kind;
use bodyflight_discovery::output::report::Report;
use bodyflight_io::diagnostic::Result;
use bodyflight_mvnx::recording::FlightFrame;
use bodyflight_replay::flight::Flight;
use bodyflight_replay::joint_change::JointChange;
use bodyflight_replay::model_file::{Effects, model_toml};
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;

use crate::compare::effect::{DRAWS, Means, Part, body_deviation, joint_errors};

/// Time over which the model flies from the first frame (s): long enough for the fall rate to follow, and too short for
/// errors of the joints to turn the body away.
const FLOWN: f64 = 3.0;
/// The last part of it, whose means are compared (s).
const COMPARED: f64 = 1.0;
/// Changes of turn rate (rad/s), fall rate, drift (m/s) and pitch (rad) that nobody would notice.
const LEAST: [f64; 4] = [0.1, 0.3, 0.3, 0.05];
/// A change is told if it is this many of its standard deviations.
const SURE: f64 = 2.0;

/// One sentence for each change that a person would notice: the model flies from the first frame with the effects and
/// without them, but for errors of sensors and for turbulence. The standard deviations comprise those of the effects'
/// parameters, errors of all joints of the recording, and what is uncertain about the person's body.
///
/// # Errors
/// Returns an error if the flight cannot be flown.
pub(super) fn changes(
    report: &Report,
    flight: &Flight,
    frames: &[FlightFrame],
) -> Result<Vec<String>> {
    let Some(end) = frames.first().map(|first| first.time + FLOWN) else {
        return Ok(Vec::new());
    };
    let count = frames.partition_point(|frame| frame.time <= end);
    let frames = &frames[..count];
    let is_short = frames
        .last()
        .is_none_or(|last| last.time < end - 0.1 * COMPARED);
    let text = model_toml("", &report.model, &[]);
    let mut effects = Effects::parse(&text, Path::new("model.toml"))?;
    let is_physics = |kind| matches!(kind, Kind::Physics);
    effects
        .named
        .retain(|(effect, _)| is_physics(effect.description().kind));
    if effects.named.is_empty() || is_short {
        return Ok(Vec::new());
    }
    let from = end - COMPARED;
    let means = |effects: &Effects, joints: &[JointChange]| -> Result<Means> {
        let mut flight = flight.clone();
        flight.effects = effects.clone();
        Part::new(&flight, frames, from)?.run(joints)
    };
    let bare = Effects::default();
    let with = means(&effects, &[])?;
    let change = with.minus(&means(&bare, &[])?);
    let body = body_deviation(&flight.tolerances);
    let mut variances = change.numbers().map(|by| (body * by) * (body * by));
    let mut add = |apart: Means, share: f64| {
        for (variance, apart) in variances.iter_mut().zip(apart.numbers()) {
            *variance += apart * apart * share;
        }
    };
    let mut random = ChaCha8Rng::seed_from_u64(0);
    for _ in 0..DRAWS {
        let joints = joint_errors(&flight.tolerances, &mut random);
        let drawn = means(&effects, &joints)?.minus(&means(&bare, &joints)?);
        add(drawn.minus(&change), 1.0 / DRAWS as f64);
    }
    for (place, (effect, _)) in effects.named.iter().enumerate() {
        let description = effect.description();
        let named = report
            .effects
            .iter()
            .find(|named| named.name == description.name);
        let errors = named.map_or(&[][..], |named| &named.standard_errors);
        for (k, parameter) in description.parameters.iter().enumerate() {
            let Some((_, error)) = errors.iter().find(|(name, _)| *name == parameter.name) else {
                continue;
            };
            let (shifted, size) = shifted(&effects, (place, k), *error);
            if size > 0.0 {
                let times = error / size;
                add(means(&shifted, &[])?.minus(&with), times * times);
            }
        }
    }
    let names = effects.named.iter();
    let names = names.map(|(effect, _)| effect.description().name);
    let names: Vec<&str> = names.collect();
    let because = names.join(" and ");
    let change = change.numbers();
    Ok((0..change.len())
        .filter(|k| {
            let bar = SURE * variances[*k].sqrt();
            change[*k].abs() > LEAST[*k].max(bar)
        })
        .map(|k| {
            let says = in_words(k, change[k], variances[k].sqrt());
            format!("{says} than the files say, because of {because}")
        })
        .collect())
}

/// The effects with one parameter, of the effect at a place, changed by its standard error, and the size of the change,
/// which is smaller where the plausible range ends. A value near that end is as uncertain as any other.
fn shifted(effects: &Effects, (place, parameter): (usize, usize), error: f64) -> (Effects, f64) {
    let mut shifted = effects.clone();
    let (effect, values) = &mut shifted.named[place];
    let before = values[parameter];
    let after = effect.description().parameters[parameter].apart(before, error);
    values[parameter] = after;
    (shifted, (after - before).abs())
}

/// "After 3 s you fall 2.1 +- 0.3 m/s (8 km/h) faster", for a number of [`Means`] by its place.
fn in_words(place: usize, by: f64, deviation: f64) -> String {
    let side = |positive: &'static str, negative| if by > 0.0 { positive } else { negative };
    let (size, degrees) = (by.abs(), by.abs().to_degrees());
    let speed = format!(
        "{size:.1} +- {:.1} m/s ({:.0} km/h)",
        deviation.max(0.1),
        3.6 * size
    );
    let angle = format!("{degrees:.0} +- {:.0}", deviation.to_degrees().max(1.0));
    match place {
        0 => format!(
            "After {FLOWN} s you turn {angle} degrees/s more to the {}",
            side("left", "right")
        ),
        1 => format!(
            "After {FLOWN} s you fall {speed} {}",
            side("faster", "slower")
        ),
        2 => format!(
            "After {FLOWN} s you drift {speed} {}",
            side("faster", "slower")
        ),
        _ => format!(
            "After {FLOWN} s you fly {angle} degrees more head {}",
            side("up", "down")
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A fitted drag of 2.99 +- 0.1 was an error, since 3.09 is beyond the range.
    #[test]
    fn a_value_near_the_end_of_its_range_can_be_shifted() {
        let text = "[[effect]]\nname = \"thigh-drag\"\nleft_factor = 2.99\nright_factor = 0.56\n";
        let effects = Effects::parse(text, Path::new("model.toml")).expect("valid");
        let left = &effects.named[0].0.description().parameters[0];
        for error in [0.0, 0.1, 10.0] {
            let (shifted, size) = shifted(&effects, (0, 0), error);
            let found = shifted.named[0].1[0];
            assert!((left.low..=left.high).contains(&found), "{error}: {found}");
            let most = f64::max(left.high - 2.99, 2.99 - left.low);
            assert!((size - error.min(most)).abs() < 1e-12, "{error}: {size}");
        }
    }
}
