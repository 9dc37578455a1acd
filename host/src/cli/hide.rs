//! `bodyflight hide`.

use std::path::PathBuf;

use bodyflight_core::effect::Effect;
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::files::write_file;
use bodyflight_io::interrupt;
use bodyflight_laboratory::drawn::drawn;
use bodyflight_laboratory::outside::Outside;
use bodyflight_laboratory::{FRAME_RATE, Hidden, JointErrors, Settings, fly, strength};
use bodyflight_replay::flight::Flight;
use bodyflight_replay::model_file::Effects;
use bodyflight_replay::subject::Subject;
use bodyflight_verbs::hide::{FILES, truth_toml, write};
use serde::Serialize;

use super::arguments::{Names, at_least_one, within};
use super::outputs::Outputs;
use super::terminal;

/// Write flights in which an effect acts that the files do not mention, to test `discover` on.
#[derive(clap::Args)]
#[command(after_help = hidden_help())]
pub(super) struct Args {
    /// Names of effects, separated by commas; `clean` for none, `load` for a force or moment chosen at random.
    #[arg(required_unless_present = "model", value_parser = Names(completed), hide_possible_values = true)]
    effects: Option<String>,
    /// A model.toml whose effects and loads are hidden, with its values.
    #[arg(long)]
    model: Option<PathBuf>,
    /// Folder for flight-0, flight-1 and so on, and for truth.toml, which says what is hidden.
    #[arg(long)]
    out: PathBuf,
    /// A subject.toml; by default the default subject.
    #[arg(long)]
    subject: Option<PathBuf>,
    /// Number of flights with the same effects.
    #[arg(long, default_value_t = 2)]
    flights: u64,
    /// Length of each flight (s); longer ones make effects easier to find.
    #[arg(long, default_value_t = 40.0)]
    duration: f64,
    /// Strength of the effects as a share of their plausible ranges, 0 to 1; by default random, 0.4 to 0.8.
    #[arg(long)]
    strength: Option<f64>,
    /// Seed of strengths, movements, errors and noise; another seed gives other flights.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Factor on noise and errors; 0 for none.
    #[arg(long, default_value_t = 1.0)]
    noise: f64,
    /// Factor on the sensor noise alone.
    #[arg(long, default_value_t = 1.0)]
    sensor_noise: f64,
    /// Joint errors of the suit: constant (degrees), wandering (degrees at Hz), and a share of the bend.
    #[arg(long, value_name = "constant:2,wander:1.5@0.3,gain:0.05", value_parser = JointErrors::parse)]
    joints: Option<JointErrors>,
    /// Frame rate (Hz).
    #[arg(long, default_value_t = FRAME_RATE)]
    rate: f64,
    #[command(flatten)]
    outputs: Outputs,
}

/// The file that says what is hidden, beside the flights.
const TRUTH: &str = "truth.toml";

fn folder(args: &Args, index: u64) -> PathBuf {
    args.out.join(format!("flight-{index}"))
}

/// The name that asks for a random load.
const DRAWN: &str = "load";

fn known() -> Vec<&'static str> {
    let effects = Effect::ALL.iter().map(|effect| effect.description().name);
    let outside = effects.chain(Outside::ALL.map(Outside::name));
    outside.chain([DRAWN]).collect()
}

/// All names that are taken, for shells.
fn completed() -> Vec<&'static str> {
    let mut names = known();
    names.push("clean");
    names
}

fn hidden_help() -> String {
    format!(
        "Effects: {}\n\nExample: bodyflight hide wind --seed 1 --out lab",
        known().join(", ")
    )
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub(super) struct Written {
    flights: Vec<PathBuf>,
    truth: PathBuf,
}

/// The names of the effects, each once.
fn names(args: &Args) -> Result<Vec<&str>> {
    let names = args.effects.iter().flat_map(|names| names.split(','));
    let names: Vec<&str> = names.collect();
    if names.len() > 1 && names.contains(&"clean") {
        return Err(Problem::bad_input(
            "expected clean alone, or effects, found both",
        ));
    }
    for (place, name) in names.iter().enumerate() {
        // Several loads are drawn one after another.
        let is_there = names
            .get(..place)
            .is_some_and(|before| before.contains(name));
        if *name != DRAWN && is_there {
            return Err(Problem::bad_input(format!(
                "expected each effect once, found {name} twice"
            )));
        }
    }
    Ok(names)
}

pub(super) fn run(args: &Args, json: bool) -> Result<()> {
    for (name, value, low, high) in [
        ("duration", args.duration, 2.0, 300.0),
        ("noise", args.noise, 0.0, 20.0),
        ("sensor-noise", args.sensor_noise, 0.0, 20.0),
        ("rate", args.rate, 30.0, 240.0),
        ("strength", args.strength.unwrap_or(0.5), 0.0, 1.0),
    ] {
        within(name, value, [low, high], "")?;
    }
    at_least_one("flights", args.flights)?;
    let names = names(args)?;
    let mut hidden = names
        .into_iter()
        .filter(|name| *name != "clean")
        .map(|name| hidden(name, args.seed, args.strength))
        .collect::<Result<Vec<_>>>()?;
    if let Some(path) = &args.model {
        let Effects { named, loads } = Effects::read(path)?;
        hidden.extend(
            named
                .into_iter()
                .map(|(e, values)| Hidden::Effect(e, values)),
        );
        hidden.extend(loads.iter().copied().map(Hidden::Load));
    }
    let subject = match &args.subject {
        Some(path) => Subject::read(path)?,
        None => Subject::default(),
    };
    args.outputs.check_in(&args.out, &[TRUTH])?;
    for index in 0..args.flights {
        args.outputs.check_in(&folder(args, index), FILES)?;
    }
    let flight = Flight {
        subject: subject.clone(),
        ..Flight::bare(&args.out)
    };
    let dynamics = flight.dynamics(0.0);
    let inputs = flight.constant_inputs();
    let bar = terminal::bar(args.flights, "flying");
    let mut flights = Vec::new();
    for index in 0..args.flights {
        interrupt::check()?;
        let settings = Settings {
            seed: args.seed.wrapping_mul(1000) + index,
            person: Some(args.seed),
            duration: args.duration,
            noise: args.noise,
            sensor_noise: args.sensor_noise,
            joints: args.joints.unwrap_or_default(),
            rate: args.rate,
        };
        let flown = fly(&dynamics, &inputs, &hidden, &settings);
        flights.push(write(&flown, &subject, args.rate, &folder(args, index))?);
        bar.inc(1);
    }
    bar.finish_and_clear();
    let truth = args.out.join(TRUTH);
    write_file(&truth, truth_toml(&hidden).as_bytes())?;
    if json {
        return terminal::print_json(&Written { flights, truth });
    }
    for path in flights.iter().chain([&truth]) {
        terminal::print(&format!("written: {}", path.display()));
    }
    Ok(())
}

fn hidden(name: &str, seed: u64, share: Option<f64>) -> Result<Hidden> {
    if let Some(effect) = Effect::from_name(name) {
        return Ok(Hidden::Effect(effect, strength(effect, seed, share)));
    }
    if name == DRAWN {
        return Ok(Hidden::Load(drawn(seed)));
    }
    Outside::from_name(name)
        .map(Hidden::Outside)
        .ok_or_else(|| Problem::unknown("effect", name, known()))
}
