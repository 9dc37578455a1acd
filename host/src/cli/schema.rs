//! `bodyflight schema`. The schemas are a file of the repository, which a test compares with the types of the answers: so
//! a change of an answer is seen, and the program needs no crate that makes schemas.

use std::collections::BTreeMap;

use bodyflight_io::diagnostic::{Problem, Result};
use serde_json::Value;

use super::terminal;

#[cfg(all(test, feature = "schema"))]
mod answers;

/// By verb, for verbs that answer with one value, and for the lines of `slimevr listen`. `monitor` and `mvn listen` print an
/// endless stream of lines, described in docs/formats.md.
const SCHEMAS: &str = include_str!("../../data/schemas.json");

/// Print the JSON Schema of a verb's `--json` output.
#[derive(clap::Args)]
#[command(after_help = "Examples: bodyflight schema\n          bodyflight schema simulate")]
pub(super) struct Args {
    /// Verb, such as `simulate` or `unit-log`; without one, all names are listed.
    verb: Option<String>,
}

pub(super) fn run(args: &Args, json: bool) -> Result<()> {
    let schemas: BTreeMap<String, Value> = serde_json::from_str(SCHEMAS)
        .map_err(|error| Problem::internal("the schemas cannot be read").caused_by(error))?;
    let Some(verb) = &args.verb else {
        let names: Vec<&String> = schemas.keys().collect();
        if json {
            return terminal::print_plain_json(&names);
        }
        for name in names {
            terminal::print(name);
        }
        return Ok(());
    };
    let schema = schemas.get(verb).ok_or_else(|| {
        Problem::bad_input(format!("there is no schema for {verb}"))
            .help("`bodyflight schema` lists all names")
    })?;
    terminal::print_plain_json(schema)
}
