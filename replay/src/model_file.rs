//! `model.toml`: effects that extend the model of a flight.
//!
//! ```toml
//! [[effect]]
//! name = "wind"
//! north_mps = 3.5
//! ```
//! Omitted parameters keep their neutral values, at which they have no effect. An `[[effect]]` without a name is a load
//! by description.

mod load;

use std::collections::BTreeMap;
use std::path::Path;

use bodyflight_core::aerodynamics::stream::Stream;
use bodyflight_core::dynamics::Dynamics;
use bodyflight_core::dynamics::applied_load::{AppliedLoad, AppliedLoads};
use bodyflight_core::effect::sensors::Sensors;
use bodyflight_core::effect::{Effect, Model, PARAMETER_COUNT};
use serde::Deserialize;

use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::file_kind::FileKind;
use bodyflight_io::input;
use load::{LoadTable, is_load};

/// An effect with its parameters, by their names in files.
pub type ByName = (&'static str, Vec<(&'static str, f64)>);

/// Returns the text of a `model.toml` that starts with `comment`, given as whole lines.
pub fn model_toml(comment: &str, effects: &[ByName], loads: &[AppliedLoad<f64>]) -> String {
    let mut text = comment.to_owned();
    for (name, parameters) in effects {
        text += &format!("\n[[effect]]\nname = \"{name}\"\n");
        for (parameter, value) in parameters {
            text += &format!("{parameter} = {value:?}\n");
        }
    }
    for load in loads {
        text += &load::text(load);
    }
    text
}

/// The effects of a `model.toml`, in the order in which they are applied.
#[derive(Debug, Clone, PartialEq)]
pub struct Effects {
    /// Effects of the library, with their parameters.
    pub named: Vec<(Effect, [f64; PARAMETER_COUNT])>,
    /// Loads by description.
    pub loads: AppliedLoads<f64>,
}

impl Default for Effects {
    fn default() -> Self {
        Self {
            named: Vec::new(),
            loads: AppliedLoads::none(),
        }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ModelFile {
    effect: Vec<EffectTable>,
}

#[derive(Deserialize)]
struct EffectTable {
    name: Option<String>,
    #[serde(flatten)]
    parameters: BTreeMap<String, toml::Value>,
}

impl Effects {
    /// Reads a `model.toml`.
    ///
    /// # Errors
    /// Returns an error if the file cannot be read, or if an effect, a parameter or a value is invalid.
    pub fn read(path: &Path) -> Result<Self> {
        let text = input::settings(path, FileKind::Model)?;
        Self::parse(&text, path)
    }

    /// Parses the text of a `model.toml`; `path` is used in messages.
    ///
    /// # Errors
    /// Returns an error if an effect, a parameter or a value is invalid.
    pub fn parse(text: &str, path: &Path) -> Result<Self> {
        let file: ModelFile =
            toml::from_str(text).map_err(|error| Problem::toml(&error, text, path))?;
        let mut effects = Self::default();
        for (index, table) in file.effect.into_iter().enumerate() {
            effects
                .add(table)
                .map_err(|problem| problem.in_file(path).at(format!("effect {}", index + 1)))?;
        }
        // Always the same order: some effects act on what others have changed.
        effects.named.sort_by_key(|(effect, _)| *effect);
        Ok(effects)
    }

    fn add(&mut self, table: EffectTable) -> Result<()> {
        if table.name.is_some() || !is_load(table.parameters.keys()) {
            let (effect, values) = table.effect()?;
            let name = effect.description().name;
            if self.named.iter().any(|(other, _)| *other == effect) {
                return Err(Problem::bad_input(format!(
                    "effect \"{name}\" is there twice: expected each effect once"
                ))
                .help("give all its parameters in one [[effect]]"));
            }
            self.named.push((effect, values));
            return Ok(());
        }
        let fields = toml::Value::Table(table.parameters.into_iter().collect());
        let table = LoadTable::deserialize(fields).map_err(|error| Problem::toml_value(&error))?;
        self.loads = self
            .loads
            .with(table.load()?)
            .map_err(|error| Problem::bad_input(error.to_string()))?;
        Ok(())
    }

    /// Returns the model with the effects applied.
    ///
    /// # Errors
    /// Returns an error if a value is outside its plausible range, which cannot be the case for a parsed file.
    pub fn applied(&self, dynamics: Dynamics<f64>, start_height: f64) -> Result<Model<f64>> {
        let mut model = Model::new(dynamics, start_height);
        model.applied = self.loads;
        for (effect, values) in &self.named {
            effect
                .apply(values, &mut model)
                .map_err(|error| Problem::bad_input(error.to_string()))?;
        }
        Ok(model)
    }

    /// Returns the model with the effects applied, for an estimator that determines muscle input and damping itself.
    ///
    /// # Errors
    /// Returns an error if the filter cannot represent an effect: effects on the sensors or on the airflow at single
    /// segments, and loads by description.
    pub fn for_filter(&self, dynamics: Dynamics<f64>, start_height: f64) -> Result<Dynamics<f64>> {
        let model = self.applied(dynamics, start_height)?;
        let refused = |what: &str| {
            Problem::bad_input(format!(
                "an effect of the model acts on {what}, which this filter does not represent"
            ))
            .help("remove it from the model.toml; simulate --model supports it")
        };
        if model.sensors != Sensors::perfect() {
            return Err(refused("the sensors"));
        }
        if !model.applied.is_empty() {
            return Err(Problem::bad_input(
                "the model contains a load by description, which only the motion filter supports",
            )
            .help("omit --preset, or remove the load from the model.toml"));
        }
        if model.dynamics.stream != Stream::uniform() || model.dynamics.air.profile != 0.0 {
            return Err(refused("the airflow at single segments"));
        }
        Ok(model.dynamics)
    }
}

impl EffectTable {
    fn effect(&self) -> Result<(Effect, [f64; PARAMETER_COUNT])> {
        let Some(name) = &self.name else {
            return Err(Problem::bad_input(
                "expected name, force_n or moment_nm, found none of these",
            )
            .help("name = \"wind\" for an effect of the library; force_n = 50.0 for a load"));
        };
        let effect = Effect::from_name(name).ok_or_else(|| {
            let known = Effect::ALL.iter().map(|effect| effect.description().name);
            Problem::unknown("effect", name, known)
        })?;
        let parameters = effect.description().parameters;
        if self.parameters.is_empty() {
            let names: Vec<_> = parameters.iter().map(|p| p.name).collect();
            return Err(Problem::bad_input(format!(
                "effect \"{name}\" has no parameter, and so changes nothing"
            ))
            .help(format!("its parameters: {}", names.join(", "))));
        }
        let mut values = effect.neutral();
        for (key, found) in &self.parameters {
            let known = parameters.iter().zip(values.iter_mut());
            let Some((parameter, value)) = known.into_iter().find(|(p, _)| p.name == key) else {
                let names: Vec<_> = parameters.iter().map(|p| p.name).collect();
                return Err(Problem::bad_input(format!(
                    "effect \"{name}\" has no parameter \"{key}\""
                ))
                .help(format!("its parameters: {}", names.join(", "))));
            };
            let number = match found {
                toml::Value::Float(number) => Some(*number),
                #[expect(clippy::cast_precision_loss, reason = "plausible values are small")]
                toml::Value::Integer(number) => Some(*number as f64),
                _ => None,
            };
            let within = number.filter(|number| (parameter.low..=parameter.high).contains(number));
            *value = within.ok_or_else(|| {
                let found = number.map_or_else(|| found.to_string(), |number| number.to_string());
                let problem = Problem::bad_input(format!(
                    "{key}: expected {} to {}, found {found}",
                    parameter.low, parameter.high
                ));
                let turned = number.map(f64::to_radians);
                match turned.filter(|angle| (parameter.low..=parameter.high).contains(angle)) {
                    Some(angle) if key.ends_with("_rad") => {
                        problem.help(format!("if that is in degrees, write {angle:.4}"))
                    }
                    _ => problem,
                }
            })?;
        }
        Ok((effect, values))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bodyflight_core::AxisCoefficients;
    use bodyflight_core::frame::Vector;

    use crate::subject::Subject;

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
            ("[[effect]]\nfactor = 1", ["effect 1", "name"]),
            (
                "[[effect]]\nname = \"mass\"\nfactor = \"1\"",
                ["factor", "\"1\""],
            ),
            (
                "[[effect]]\nname = \"wind\"\nup_mps = 0\n[[effect]]\nforce_n = 9\nup = 1",
                ["effect 1", "up_mps"],
            ),
            (
                "[[effect]]\nname = \"wind\"\nnorth_mps = 1\n[[effect]]\nforce_n = 9\nup = 1",
                ["effect 2", "up"],
            ),
            (
                "[[effect]]\nname = \"wind\"\nnorth_mps = 1\n[[effect]]\nname = \"wind\"\nwest_mps = 1",
                ["effect 2", "twice"],
            ),
            (
                "[[effect]]\nname = \"mass\"",
                ["effect 1", "changes nothing"],
            ),
            ("efect = 1", ["model.toml", "efect"]),
        ] {
            let problem = parse(text).unwrap_err().to_string();
            for part in parts {
                assert!(problem.contains(part), "{text}: {problem}");
            }
        }
    }
}
