//! `modelDescription.xml` of a unit.

use std::fmt::Write;

use bodyflight_core::dynamics::step::TIME_STEP;

use crate::variables::{Causality, Variable};

/// Names of units, and their base units.
const UNITS: [(&str, &str); 6] = [
    ("m", "m=\"1\""),
    ("m/s", "m=\"1\" s=\"-1\""),
    ("rad", "rad=\"1\""),
    ("rad/s", "rad=\"1\" s=\"-1\""),
    ("N", "kg=\"1\" m=\"1\" s=\"-2\""),
    ("N.m", "kg=\"1\" m=\"2\" s=\"-2\""),
];

/// Describes a unit whose library has this name. The library checks the token.
pub fn description(identifier: &str, token: &str, variables: &[Variable]) -> String {
    let mut text = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <fmiModelDescription fmiVersion=\"3.0\" modelName=\"bodyflight.Skydiver\" instantiationToken=\"{{{token}}}\" \
         description=\"A skydiver of 16 segments in free fall\" generationTool=\"bodyflight {}\" \
         variableNamingConvention=\"structured\">\n\
         \x20 <CoSimulation modelIdentifier=\"{identifier}\" canHandleVariableCommunicationStepSize=\"true\" \
         canGetAndSetFMUState=\"true\"/>\n  <UnitDefinitions>\n",
        env!("CARGO_PKG_VERSION")
    );
    for (name, base) in UNITS {
        put(
            &mut text,
            format_args!("    <Unit name=\"{name}\"><BaseUnit {base}/></Unit>\n"),
        );
    }
    put(
        &mut text,
        format_args!(
            "  </UnitDefinitions>\n  <DefaultExperiment startTime=\"0\" stopTime=\"10\" stepSize=\"{TIME_STEP:?}\"/>\n  \
             <ModelVariables>\n    <Float64 name=\"time\" valueReference=\"0\" causality=\"independent\" \
             variability=\"continuous\"/>\n"
        ),
    );
    for (reference, variable) in (1..).zip(variables) {
        variable_element(&mut text, reference, variable);
    }
    text.push_str("  </ModelVariables>\n  <ModelStructure>\n");
    for element in ["Output", "InitialUnknown"] {
        for (reference, variable) in (1..).zip(variables) {
            if variable.causality == Causality::Output {
                let reference: usize = reference;
                put(
                    &mut text,
                    format_args!("    <{element} valueReference=\"{reference}\"/>\n"),
                );
            }
        }
    }
    text.push_str("  </ModelStructure>\n</fmiModelDescription>\n");
    text
}

fn variable_element(text: &mut String, reference: usize, variable: &Variable) {
    let Variable {
        name,
        unit,
        start,
        meaning,
        ..
    } = variable;
    let kind = match variable.causality {
        Causality::Input => {
            format!("causality=\"input\" variability=\"continuous\" start=\"{start:?}\"")
        }
        Causality::Parameter => format!(
            "causality=\"parameter\" variability=\"fixed\" initial=\"exact\" start=\"{start:?}\""
        ),
        Causality::Output => {
            "causality=\"output\" variability=\"continuous\" initial=\"calculated\"".to_owned()
        }
    };
    let unit = if unit.is_empty() {
        String::new()
    } else {
        format!(" unit=\"{unit}\"")
    };
    put(
        text,
        format_args!(
            "    <Float64 name=\"{name}\" valueReference=\"{reference}\" {kind}{unit} description=\"{meaning}\"/>\n"
        ),
    );
}

fn put(text: &mut String, piece: std::fmt::Arguments<'_>) {
    // Writing to a String cannot fail.
    let _ = text.write_fmt(piece);
}
