//! Arguments of every verb: numbers below zero are values, names of closed sets are known to shells, and what is wrong with
//! a number is put for users.

use std::ffi::OsStr;

use bodyflight_io::diagnostic::{Problem, Result};
use clap::Command;
use clap::builder::{PossibleValue, StringValueParser, TypedValueParser};

/// A command whose options take numbers below zero, so that a range is what refuses them, and not the parser.
pub(super) fn with_negative_numbers(command: Command) -> Command {
    let command = command.mut_args(|argument| {
        let is_option = !argument.is_positional() && argument.get_action().takes_values();
        argument.allow_negative_numbers(is_option)
    });
    command.mut_subcommands(with_negative_numbers)
}

/// What the standard library says of numbers, and how it is put for users.
const NUMBERS: [(&str, &str); 6] = [
    (
        "invalid digit found in string",
        "expected a whole number of 0 or more",
    ),
    (
        "invalid float literal",
        "expected a number, with a decimal point",
    ),
    (
        "number too large to fit in target type",
        "expected a smaller number",
    ),
    (
        "number too small to fit in target type",
        "expected a larger number",
    ),
    (
        "cannot parse integer from empty string",
        "expected a whole number of 0 or more",
    ),
    (
        "cannot parse float from empty string",
        "expected a number, with a decimal point",
    ),
];

/// A message about arguments in the words of users.
pub(super) fn in_words(message: &str) -> String {
    let put = |text: String, (from, to): &(&str, &str)| text.replace(from, to);
    NUMBERS.iter().fold(message.to_owned(), put)
}

/// Checks that the value of an option lies within its range.
///
/// # Errors
/// Returns an error that names the option, its range and the value.
pub(super) fn within(option: &str, value: f64, [low, high]: [f64; 2], unit: &str) -> Result<()> {
    if (low..=high).contains(&value) {
        return Ok(());
    }
    let space = if unit.is_empty() { "" } else { " " };
    Err(Problem::bad_input(format!(
        "expected --{option} of {low} to {high}{space}{unit}, found {}",
        shown(value)
    )))
}

/// A number as a person writes it: not with hundreds of digits.
fn shown(value: f64) -> String {
    let size = value.abs();
    if size >= 1e9 || size > 0.0 && size < 1e-6 {
        format!("{value:e}")
    } else {
        value.to_string()
    }
}

/// Checks that there is at least one of what an option counts.
///
/// # Errors
/// Returns an error that names the option.
pub(super) fn at_least_one(option: &str, count: u64) -> Result<()> {
    if count > 0 {
        return Ok(());
    }
    Err(Problem::bad_input(format!(
        "expected --{option} of 1 or more, found 0"
    )))
}

/// Longest flight whose times options name (s).
const LONGEST: f64 = 1e5;

/// Checks a window of time given by options `from` and `to` (s).
///
/// # Errors
/// Returns an error if an end is no time, or the window is empty.
pub(super) fn window(from: Option<f64>, to: Option<f64>) -> Result<()> {
    for (option, end) in [("from", from), ("to", to)] {
        if let Some(end) = end {
            within(option, end, [-LONGEST, LONGEST], "s")?;
        }
    }
    match (from, to) {
        (Some(from), Some(to)) if from >= to => Err(Problem::bad_input(format!(
            "expected --from before --to, found {from} and {to} s"
        ))),
        _ => Ok(()),
    }
}

/// A parser of names that shells complete. It takes others too: the verb refuses those and suggests the nearest, or reads
/// a file of that name.
#[derive(Clone)]
pub(super) struct Names(pub(super) fn() -> Vec<&'static str>);

impl TypedValueParser for Names {
    type Value = String;

    fn parse_ref(
        &self,
        command: &Command,
        argument: Option<&clap::Arg>,
        value: &OsStr,
    ) -> core::result::Result<String, clap::Error> {
        StringValueParser::new().parse_ref(command, argument, value)
    }

    fn possible_values(&self) -> Option<Box<dyn Iterator<Item = PossibleValue> + '_>> {
        Some(Box::new((self.0)().into_iter().map(PossibleValue::new)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_refuse_what_is_no_number_and_name_the_option() {
        for (value, said) in [
            (0.05, "expected --density of 0.1 to 2 kg/m3, found 0.05"),
            (-1.0, "expected --density of 0.1 to 2 kg/m3, found -1"),
            (f64::NAN, "expected --density of 0.1 to 2 kg/m3, found NaN"),
            (
                f64::INFINITY,
                "expected --density of 0.1 to 2 kg/m3, found inf",
            ),
        ] {
            let problem = within("density", value, [0.1, 2.0], "kg/m3").unwrap_err();
            assert_eq!(problem.to_string(), said);
        }
        assert!(within("density", 2.0, [0.1, 2.0], "kg/m3").is_ok());
        assert!(at_least_one("draws", 0).is_err() && at_least_one("draws", 1).is_ok());
    }

    #[test]
    fn windows_have_two_times_in_order() {
        assert!(window(Some(1.0), Some(2.0)).is_ok() && window(None, None).is_ok());
        assert!(window(Some(2.0), Some(2.0)).is_err());
        assert!(window(Some(f64::NAN), None).is_err());
        assert!(window(None, Some(f64::INFINITY)).is_err());
    }
}
