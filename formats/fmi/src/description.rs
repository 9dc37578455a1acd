//! `modelDescription.xml` of a unit.

use std::fmt::Write;

use bodyflight_core::dynamics::step::TIME_STEP;

use crate::standard::Standard;
use crate::variables::{Causality, Variable};

/// Names of units, and their base units.
const UNITS: [(&str, &str); 8] = [
    ("1", ""),
    ("s", " s=\"1\""),
    ("m", " m=\"1\""),
    ("m/s", " m=\"1\" s=\"-1\""),
    ("rad", " rad=\"1\""),
    ("rad/s", " rad=\"1\" s=\"-1\""),
    ("N", " kg=\"1\" m=\"1\" s=\"-2\""),
    ("N.m", " kg=\"1\" m=\"2\" s=\"-2\""),
];

/// Describes a unit whose library has this name. The library checks the token.
pub fn description(
    standard: Standard,
    identifier: &str,
    token: &str,
    variables: &[Variable],
) -> String {
    let version = standard.name();
    // Names of attributes that changed from one version to the next.
    let (instance, state) = match standard {
        Standard::Two => ("guid", "canGetAndSetFMUstate"),
        Standard::Three => ("instantiationToken", "canGetAndSetFMUState"),
    };
    let mut text = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <fmiModelDescription fmiVersion=\"{version}\" modelName=\"bodyflight.Skydiver\" {instance}=\"{{{token}}}\" \
         description=\"A skydiver of 16 segments in free fall\" generationTool=\"bodyflight {}\" \
         variableNamingConvention=\"structured\">\n\
         \x20 <CoSimulation modelIdentifier=\"{identifier}\" canHandleVariableCommunicationStepSize=\"true\" \
         {state}=\"true\"/>\n  <UnitDefinitions>\n",
        env!("CARGO_PKG_VERSION")
    );
    for (name, base) in UNITS {
        put(
            &mut text,
            format_args!("    <Unit name=\"{name}\"><BaseUnit{base}/></Unit>\n"),
        );
    }
    put(
        &mut text,
        format_args!(
            "  </UnitDefinitions>\n  <DefaultExperiment startTime=\"0\" stopTime=\"10\" stepSize=\"{TIME_STEP:?}\"/>\n  \
             <ModelVariables>\n"
        ),
    );
    let time = "causality=\"independent\" variability=\"continuous\"";
    variable_element(&mut text, standard, ("time", 0), time, "unit=\"s\"");
    for (reference, variable) in (1..).zip(variables) {
        let (attributes, kind) = attributes(variable);
        variable_element(
            &mut text,
            standard,
            (&variable.name, reference),
            &attributes,
            &kind,
        );
    }
    text.push_str("  </ModelVariables>\n  <ModelStructure>\n");
    structure(&mut text, standard, variables);
    text.push_str("  </ModelStructure>\n</fmiModelDescription>\n");
    text
}

/// Attributes of any variable, and those of a number.
fn attributes(variable: &Variable) -> (String, String) {
    let Variable {
        unit,
        start,
        meaning,
        ..
    } = variable;
    let (role, start) = match variable.causality {
        Causality::Input => (
            "causality=\"input\" variability=\"continuous\"",
            format!(" start=\"{start:?}\""),
        ),
        Causality::Parameter => (
            "causality=\"parameter\" variability=\"fixed\" initial=\"exact\"",
            format!(" start=\"{start:?}\""),
        ),
        Causality::Output => (
            "causality=\"output\" variability=\"continuous\" initial=\"calculated\"",
            String::new(),
        ),
    };
    (
        format!("{role} description=\"{meaning}\""),
        format!("unit=\"{unit}\"{start}"),
    )
}

fn variable_element(
    text: &mut String,
    standard: Standard,
    (name, reference): (&str, usize),
    attributes: &str,
    kind: &str,
) {
    let named = format!("name=\"{name}\" valueReference=\"{reference}\" {attributes}");
    match standard {
        Standard::Two => put(
            text,
            format_args!("    <ScalarVariable {named}><Real {kind}/></ScalarVariable>\n"),
        ),
        Standard::Three => put(text, format_args!("    <Float64 {named} {kind}/>\n")),
    }
}

/// The outputs, which are also what is unknown at the start.
fn structure(text: &mut String, standard: Standard, variables: &[Variable]) {
    let outputs = || {
        (1_usize..)
            .zip(variables)
            .filter(|(_, variable)| variable.causality == Causality::Output)
            .map(|(reference, _)| reference)
    };
    match standard {
        Standard::Two => {
            for list in ["Outputs", "InitialUnknowns"] {
                put(text, format_args!("    <{list}>\n"));
                for reference in outputs() {
                    // Places in the list of variables, which begins with the time, count from 1.
                    let place = reference + 1;
                    put(text, format_args!("      <Unknown index=\"{place}\"/>\n"));
                }
                put(text, format_args!("    </{list}>\n"));
            }
        }
        Standard::Three => {
            for element in ["Output", "InitialUnknown"] {
                for reference in outputs() {
                    put(
                        text,
                        format_args!("    <{element} valueReference=\"{reference}\"/>\n"),
                    );
                }
            }
        }
    }
}

fn put(text: &mut String, piece: std::fmt::Arguments<'_>) {
    // Writing to a String cannot fail.
    let _ = text.write_fmt(piece);
}
