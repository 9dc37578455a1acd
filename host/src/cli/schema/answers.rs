//! The schemas, made from the types of the answers.

use std::collections::BTreeMap;

use bodyflight_mvn_network::Sent;
use bodyflight_unit::ports::Port;
use bodyflight_unit::stream;
use bodyflight_verbs as verbs;
use schemars::JsonSchema;
use schemars::generate::SchemaSettings;
use serde_json::Value;

use super::super::several::Several;
use super::super::terminal::Answer;
use super::super::{airborne, estimate, figures, hide, unit, view};

/// A name, and the schema of the verb's answer.
type Row = (&'static str, fn() -> Value);

/// Verbs that answer with one value, and one that answers with lines.
const ANSWERS: &[Row] = &[
    ("airborne", answer::<verbs::airborne::Report>),
    ("airborne-several", answer::<airborne::Set>),
    ("compare", answer::<verbs::compare::Report>),
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
    (
        "simulate-what-if",
        answer::<verbs::simulate::what_if::Report>,
    ),
    (
        "simulate-what-if-several",
        answer::<Several<verbs::simulate::what_if::Report>>,
    ),
    ("slimevr-listen", plain::<verbs::slimevr::Line>),
    ("slimevr-read", answer::<verbs::slimevr::Report>),
    ("stream", answer::<stream::report::Report>),
    (
        "stream-sensor",
        answer::<bodyflight_unit::sensor_line::SensorReport>,
    ),
    ("synth", answer::<bodyflight_laboratory::synthesize::Report>),
    ("technique", answer::<verbs::technique::report::Report>),
    (
        "technique-several",
        answer::<Several<verbs::technique::report::Report>>,
    ),
    ("trim", answer::<verbs::trim::Report>),
    ("tune", answer::<verbs::tune::Report>),
    ("unit-calibrate", answer::<unit::calibrate::Calibrated>),
    ("unit-configure", answer::<unit::setup::Stored>),
    ("unit-flash", answer::<unit::Flashed>),
    ("unit-log", answer::<unit::Report>),
    ("unit-show", answer::<unit::setup::Stored>),
    ("validate", answer::<verbs::validate::Report>),
    ("view", answer::<view::Written>),
];

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

#[test]
fn the_file_has_the_schemas_of_the_types() {
    let made: BTreeMap<&str, Value> = ANSWERS.iter().map(|(name, make)| (*name, make())).collect();
    let made = serde_json::to_string_pretty(&made).unwrap() + "\n";
    if std::env::var_os("BODYFLIGHT_WRITE_DOCS").is_some() {
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/data/schemas.json");
        std::fs::write(file, &made).unwrap();
    } else {
        assert!(
            made == super::SCHEMAS,
            "host/data/schemas.json is out of date; BODYFLIGHT_WRITE_DOCS=1 cargo test --package bodyflight \
             --features schema --lib schema"
        );
    }
}
