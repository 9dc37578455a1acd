//! Whether a unit can take a configuration, before it is asked.

use bodyflight_core::link::{
    Configure, DecodeError, Header, MAX_FRAME_LENGTH, MESSAGES, Message, SegmentTable, Verdict,
};
use bodyflight_firmware::computer::{Configuration, LOWEST_RATE};
use bodyflight_io::diagnostic::{Problem, Result};

/// Checks the numbers of a configuration against the ranges of the link, and the whole as the unit does.
///
/// # Errors
/// Returns an error that names the field and its range, or says why the unit would refuse the configuration.
pub(crate) fn checked(configure: &Configure, table: &SegmentTable) -> Result<()> {
    for row in table.rows() {
        in_range(&Message::from(*row), Some(row.segment.name()))?;
    }
    in_range(&Message::from(*configure), None)?;
    Configuration::new(configure, table)
        .map(|_| ())
        .map_err(refused)
}

fn in_range(message: &Message, segment: Option<&str>) -> Result<()> {
    let mut frame = [0; MAX_FRAME_LENGTH];
    let length = message
        .encode(&Header::default(), &mut frame)
        .map_err(|error| Problem::internal("a message without a frame").caused_by(error))?;
    let field = match Message::decode(frame.get(..length).unwrap_or_default()) {
        Err(DecodeError::OutOfRange { field } | DecodeError::NotFinite { field }) => field,
        _ => return Ok(()),
    };
    let layouts = MESSAGES
        .iter()
        .filter(|layout| layout.code == message.code());
    let layout = layouts
        .flat_map(|layout| layout.fields)
        .find(|own| own.name == field);
    let (range, unit) = layout.map_or(("finite numbers", ""), |own| (own.range, own.unit));
    let space = if unit.is_empty() { "" } else { " " };
    let of = segment.map_or_else(String::new, |segment| format!(" of {segment}"));
    Err(Problem::bad_input(format!(
        "the unit takes {field}{of} of {range}{space}{unit}, and this is outside"
    ))
    .help(match field {
        "sample_rate" | "update_rate" => {
            "--rate is the number of samples that the sensor sends in a second"
        }
        "air_density" | "air_velocity" => "[air] in the flight.toml says it",
        "receiver_latency" => "--latency says it, in seconds",
        _ => "the subject.toml says it, in [coefficients] or in its segments.json",
    }))
}

/// What a unit's verdict means and what to do.
pub(crate) fn refused(verdict: Verdict) -> Problem {
    let (why, help) = match verdict {
        Verdict::UnusableRates => (
            format!(
                "its filter cannot run at this rate of samples, expected {LOWEST_RATE} to 2000 Hz"
            ),
            "--rate is the number of samples that the sensor sends in a second",
        ),
        Verdict::NotABody => (
            "the mass or an inertia of a segment is not positive".to_owned(),
            "correct the subject.toml, or its segments.json",
        ),
        verdict => (
            format!("{verdict:?}"),
            "docs/link.md, CONFIGURED, says what each verdict means",
        ),
    };
    Problem::bad_input(format!("the unit refuses the configuration: {why}")).help(help)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use bodyflight_replay::flight::Flight;

    use super::*;
    use crate::stream::configuration_at;

    #[test]
    fn numbers_that_no_unit_takes_are_named_with_their_range() {
        let flight = Flight::bare(Path::new("none"));
        let at = |rate| configuration_at(&flight, 0.0, "auto", rate);
        for (rate, said) in [
            (0.0, "sample_rate of 1.0 to 2000.0 Hz"),
            (f64::NAN, "sample_rate of 1.0 to 2000.0 Hz"),
            (1e9, "sample_rate of 1.0 to 2000.0 Hz"),
            (10.0, "expected 40 to 2000 Hz"),
        ] {
            let problem = at(rate).unwrap_err();
            assert!(problem.to_string().contains(said), "{rate}: {problem}");
            assert!(problem.help.is_some_and(|help| help.contains("--rate")));
        }
        let (mut configure, table) = at(100.0).unwrap();
        configure.air_density = 0.01;
        let problem = checked(&configure, &table).unwrap_err();
        assert!(
            problem
                .to_string()
                .contains("air_density of 0.1 to 2.0 kg/m3"),
            "{problem}"
        );
        let (configure, mut table) = at(100.0).unwrap();
        let mut row = *table.rows().next().unwrap();
        row.coefficients[1] = 100.0;
        table.insert(row);
        let problem = checked(&configure, &table).unwrap_err();
        assert!(
            problem
                .to_string()
                .contains("coefficients of pelvis of -20.0 to 20.0"),
            "{problem}"
        );
    }
}
