//! `bodyflight schema`.

use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_mvn_network::Sent;
use bodyflight_unit::ports::Port;
use bodyflight_unit::stream;
use bodyflight_verbs as verbs;
use schemars::JsonSchema;
use schemars::generate::SchemaSettings;
use serde_json::Value;

use super::several::Several;
use super::terminal::{self, Answer};
use super::{estimate, figures, hide, unit, view};

/// Print the JSON Schema of a verb's `--json` output.
#[derive(clap::Args)]
#[command(after_help = "Examples: bodyflight schema\n          bodyflight schema simulate")]
pub(super) struct Args {
    /// Verb, such as `simulate` or `unit-log`; without one, all names are listed.
    verb: Option<String>,
}

/// A name, and the schema of the verb's answer.
type Row = (&'static str, fn() -> Value);

/// Verbs that answer with one value. `monitor` and `mvn listen` print an endless stream of lines, described in
/// docs/formats.md.
const ANSWERS: &[Row] = &[
    ("airborne", answer::<verbs::airborne::Report>),
    (
        "airborne-several",
        answer::<Several<verbs::airborne::Report>>,
    ),
    ("demo", answer::<verbs::simulate::Report>),
    (
        "discover",
        answer::<bodyflight_discovery::output::report::Report>,
    ),
    ("estimate", answer::<bodyflight_estimation::report::Report>),
    ("estimate-presets", plain::<Vec<estimate::Listed>>),
    (
        "estimate-several",
        answer::<Several<bodyflight_estimation::report::Report>>,
    ),
    ("export", answer::<verbs::export::Report>),
    ("fall", answer::<verbs::fall::logbook::Answers>),
    ("figures", answer::<figures::Written>),
    ("fmu", answer::<verbs::fmu::Report>),
    ("hide", answer::<hide::Written>),
    ("import", answer::<verbs::import::Report>),
    ("inspect", answer::<verbs::inspect::Report>),
    ("inspect-several", answer::<Several<verbs::inspect::Report>>),
    ("mvn-send", answer::<Sent>),
    ("ports", plain::<Vec<Port>>),
    ("reproduce", answer::<verbs::reproduce::Report>),
    ("sensitivity", answer::<verbs::sensitivity::Report>),
    ("simulate", answer::<verbs::simulate::Report>),
    (
        "simulate-several",
        answer::<Several<verbs::simulate::Report>>,
    ),
    ("stream", answer::<stream::report::Report>),
    ("synth", answer::<verbs::synthesize::Report>),
    ("trim", answer::<verbs::trim::Report>),
    ("tune", answer::<verbs::tune::Report>),
    ("unit-configure", answer::<unit::Stored>),
    ("unit-flash", answer::<unit::Flashed>),
    ("unit-log", answer::<unit::Report>),
    ("unit-show", answer::<unit::Stored>),
    ("validate", answer::<verbs::validate::Report>),
    ("view", answer::<view::Written>),
];

pub(super) fn run(args: &Args, json: bool) -> Result<()> {
    let Some(verb) = &args.verb else {
        let names: Vec<&str> = ANSWERS.iter().map(|(name, _)| *name).collect();
        if json {
            return terminal::print_plain_json(&names);
        }
        terminal::print(&names.join("\n"));
        return Ok(());
    };
    let found = ANSWERS.iter().find(|(name, _)| name == verb);
    let (_, schema) = found.ok_or_else(|| {
        Problem::bad_input(format!("there is no schema for {verb}"))
            .help("`bodyflight schema` lists all names")
    })?;
    terminal::print_plain_json(&schema())
}

/// The schema of an answer that is an object, with the run that made it.
fn answer<T: JsonSchema + 'static>() -> Value {
    plain::<Answer<'static, T>>()
}

/// The schema of an answer that is a list.
fn plain<T: JsonSchema>() -> Value {
    let generator = SchemaSettings::draft2020_12()
        .for_serialize()
        .into_generator();
    generator.into_root_schema_for::<T>().into()
}
