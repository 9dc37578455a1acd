//! `model.toml`: effects that the model of a flight is extended by.
//!
//! ```toml
//! [[effect]]
//! name = "wind"
//! north_mps = 3.5
//! ```
//! Parameters that are not given keep the value at which they do nothing.

use std::collections::BTreeMap;
use std::path::Path;

use bodyflight_core::aerodynamics::stream::Stream;
use bodyflight_core::dynamics::Dynamics;
use bodyflight_core::effect::sensors::Sensors;
use bodyflight_core::effect::{Effect, Model, PARAMETER_COUNT};
use bodyflight_discovery::report::ByName;
use serde::Deserialize;

use crate::diagnostic::{Problem, Result};
use crate::formats::input;

/// The text of a `model.toml`, after a comment of whole lines.
pub fn model_toml(comment: &str, effects: &[ByName]) -> String {
    let mut text = comment.to_owned();
    for (name, parameters) in effects {
        text += &format!("\n[[effect]]\nname = \"{name}\"\n");
        for (parameter, value) in parameters {
            text += &format!("{parameter} = {value:?}\n");
        }
    }
    text
}

/// Effects with their parameters, in the order of the file.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Effects(Vec<(Effect, [f64; PARAMETER_COUNT])>);

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ModelFile {
    effect: Vec<EffectTable>,
}

#[derive(Deserialize)]
struct EffectTable {
    name: String,
    #[serde(flatten)]
    parameters: BTreeMap<String, f64>,
}

impl Effects {
    /// Reads a `model.toml`.
    ///
    /// # Errors
    /// Where the file is missing, or an effect, a parameter or a value is not usable.
    pub fn read(path: &Path) -> Result<Self> {
        let text = input::text(path)?;
        Self::parse(&text, path)
    }

    /// As read from a `model.toml`; `path` names it in messages, and is where the files that it names are looked for.
    ///
    /// # Errors
    /// As of reading.
    pub fn parse(text: &str, path: &Path) -> Result<Self> {
        let file: ModelFile =
            toml::from_str(text).map_err(|error| Problem::toml(&error, text, path))?;
        let effects = file.effect.iter().enumerate().map(|(index, table)| {
            table
                .effect()
                .map_err(|problem| problem.in_file(path).at(format!("effect {}", index + 1)))
        });
        let mut effects = effects.collect::<Result<Vec<_>>>()?;
        // One order for all: some effects act on what others changed.
        effects.sort_by_key(|(effect, _)| *effect);
        Ok(Self(effects))
    }

    /// The model with the effects.
    ///
    /// # Errors
    /// Where a value is outside its plausible range; a file that was read has none.
    pub fn applied(&self, dynamics: Dynamics<f64>, start_height: f64) -> Result<Model<f64>> {
        let mut model = Model::new(dynamics, start_height);
        for (effect, values) in &self.0 {
            effect
                .apply(values, &mut model)
                .map_err(|error| Problem::bad_input(error.to_string()))?;
        }
        Ok(model)
    }

    /// The model with the effects for an estimator, which finds muscle input and damping by itself.
    ///
    /// # Errors
    /// Where an effect cannot fly in a filter: those of the sensors, and those of the stream at single segments.
    pub fn for_filter(&self, dynamics: Dynamics<f64>, start_height: f64) -> Result<Dynamics<f64>> {
        let model = self.applied(dynamics, start_height)?;
        let refused = |what: &str| {
            Problem::bad_input(format!(
                "an effect of the model acts on {what}, which no filter flies"
            ))
            .help("take it out of the model.toml; simulate --model flies with it")
        };
        if model.sensors != Sensors::perfect() {
            return Err(refused("the sensors"));
        }
        if model.dynamics.stream != Stream::uniform() || model.dynamics.air.profile != 0.0 {
            return Err(refused("the stream at single segments"));
        }
        Ok(model.dynamics)
    }
}

impl EffectTable {
    fn effect(&self) -> Result<(Effect, [f64; PARAMETER_COUNT])> {
        let effect = Effect::from_name(&self.name).ok_or_else(|| {
            let names: Vec<_> = Effect::ALL.iter().map(|e| e.description().name).collect();
            let known = names.join(", ");
            Problem::bad_input(format!("unknown effect \"{}\"", self.name))
                .help(format!("one of: {known}"))
        })?;
        let parameters = effect.description().parameters;
        let mut values = effect.neutral();
        for (name, &found) in &self.parameters {
            let known = parameters.iter().zip(values.iter_mut());
            let Some((parameter, value)) = known.into_iter().find(|(p, _)| p.name == name) else {
                let names: Vec<_> = parameters.iter().map(|p| p.name).collect();
                return Err(Problem::bad_input(format!(
                    "effect \"{}\" has no parameter \"{name}\"",
                    self.name
                ))
                .help(format!("its parameters: {}", names.join(", "))));
            };
            if !(parameter.low..=parameter.high).contains(&found) {
                return Err(Problem::bad_input(format!(
                    "{name}: expected {} to {}, found {found}",
                    parameter.low, parameter.high
                )));
            }
            *value = found;
        }
        Ok((effect, values))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bodyflight_core::AxisCoefficients;
    use bodyflight_core::frame::Vector;

    use crate::formats::subject::Subject;

    fn parse(text: &str) -> Result<Effects> {
        Effects::parse(text, Path::new("model.toml"))
    }

    #[test]
    fn effects_change_the_model() {
        let effects = parse(
            "[[effect]]\nname = \"wind\"\nnorth_mps = 3\n[[effect]]\nname = \"damping\"\nyaw_factor = -0.05",
        )
        .unwrap();
        let plain = Dynamics::paper(Subject::default().body(), 1.0);
        let model = effects.applied(plain, 0.0).unwrap();
        let wind = model.dynamics.air.velocity;
        assert_eq!(wind, Vector::new(3.0, 0.0, 0.0));
        let factor = model.damping_factor;
        assert_eq!(factor, AxisCoefficients::new(1.0, -0.05, 1.0));
        assert_eq!(model.dynamics.body, plain.body);
    }

    #[test]
    fn bad_effects_are_named() {
        for (text, parts) in [
            ("[[effect]]\nname = \"wnd\"", ["effect 1", "wnd"]),
            ("[[effect]]\nname = \"wind\"\nup = 1", ["up", "wind"]),
            ("[[effect]]\nname = \"mass\"\nfactor = 9", ["factor", "9"]),
            (
                "[[effect]]\nname = \"mass\"\nfactor = nan",
                ["factor", "NaN"],
            ),
            ("[[effect]]\nfactor = 1", ["model.toml:1", "name"]),
            ("efect = 1", ["model.toml", "efect"]),
        ] {
            let problem = parse(text).unwrap_err().to_string();
            for part in parts {
                assert!(problem.contains(part), "{text}: {problem}");
            }
        }
    }
}
