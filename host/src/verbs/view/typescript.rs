//! The page's types are those of its data: `host/viewer/src/types.ts` is made here.

use std::fmt::Write;
use std::path::PathBuf;

use ts_rs::{Config, TS};

use super::avatar::AvatarState;
use super::estimated::Estimated;
use super::live::{Look, Received};
use super::page::{FlyData, Input, Mode, PageData, Provenance, SCHEMA};
use super::run::Run;
use super::series::{Column, Packed};
use super::shape::{Shape, Worn};
use crate::replay::comparison::Channel;
use crate::unit::stream::report::{Live, LiveEstimate};

/// Environment variable that has the file written anew.
const WRITE: &str = "BODYFLIGHT_WRITE_TYPES";

fn declare<T: TS>(text: &mut String, config: &Config) {
    let docs = T::docs().unwrap_or_default();
    let _ = write!(text, "\n{docs}export {}\n", T::decl(config));
}

fn types() -> String {
    // Counts of frames and estimates, far below 2^53.
    let config = Config::default().with_large_int("number");
    let mut text = String::from(
        "// Made by a test of host/src/verbs/view/typescript.rs, which also says how to make it anew.\n\n",
    );
    let _ = writeln!(
        text,
        "/** Version of the data. */\nexport const SCHEMA = {SCHEMA};\n"
    );
    text += "/** Channels of a flight, in the order of its series. */\nexport const CHANNELS = [\n";
    for channel in Channel::ALL {
        let (key, (label, unit), angle) = (channel.key(), channel.label(), channel.is_angle());
        let _ = writeln!(
            text,
            "  {{ key: {key:?}, label: {label:?}, unit: {unit:?}, angle: {angle} }},"
        );
    }
    text += "] as const;\n";
    declare::<Shape>(&mut text, &config);
    declare::<Worn>(&mut text, &config);
    declare::<Column>(&mut text, &config);
    declare::<Packed>(&mut text, &config);
    declare::<Estimated>(&mut text, &config);
    declare::<Run>(&mut text, &config);
    declare::<FlyData>(&mut text, &config);
    declare::<Mode>(&mut text, &config);
    declare::<Input>(&mut text, &config);
    declare::<Provenance>(&mut text, &config);
    declare::<PageData>(&mut text, &config);
    declare::<LiveEstimate>(&mut text, &config);
    declare::<Live>(&mut text, &config);
    declare::<Received>(&mut text, &config);
    declare::<AvatarState>(&mut text, &config);
    declare::<Look>(&mut text, &config);
    let lines = text.lines().map(|line| format!("{}\n", line.trim_end()));
    lines.collect()
}

#[test]
fn the_page_has_the_types_of_its_data() {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("viewer/src/types.ts");
    let made = types();
    if std::env::var_os(WRITE).is_some() {
        std::fs::write(&path, &made).unwrap();
    }
    let found = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(
        found == made,
        "{} is not what the data is: {WRITE}=1 cargo test -p bodyflight --lib types_of_its_data writes it anew",
        path.display()
    );
}
