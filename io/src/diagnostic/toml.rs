//! Errors in TOML files, with the field concerned, what was expected there, and a guess at what was meant.

use std::path::Path;

use toml::de::DeTable;

use super::Problem;
use super::choices::nearest;
use super::shape::plain;

impl Problem {
    /// A file that is not TOML, or not the expected kind, with the line and the field of the error.
    pub fn toml(error: &toml::de::Error, text: &str, file: &Path) -> Self {
        let mut problem = Self::bad_input(plain(error.message().trim())).in_file(file);
        let before = error.span().and_then(|span| text.get(..span.start));
        let line = before.map(|before| before.matches('\n').count());
        if let Some(line) = line {
            problem = problem.at_line(line as u64 + 1);
        }
        if let Some(field) = field(error) {
            problem = problem.at(format!("field {field}"));
        }
        let line = line.and_then(|line| text.lines().nth(line));
        let meant = line
            .and_then(|line| {
                without_quotes(line)
                    .or_else(|| backslash(line))
                    .or_else(|| decimal_comma(line))
            })
            .or_else(|| mistyped(error.message()));
        match meant {
            Some(help) => problem.help(help),
            None => problem,
        }
    }
}

impl Problem {
    /// A value of a TOML file that was read apart from the file's text: the field and what was expected in it.
    pub fn toml_value(error: &toml::de::Error) -> Self {
        let message = plain(error.message().trim());
        Self::bad_input(match field(error) {
            Some(field) => format!("{field}: {message}"),
            None => message,
        })
    }
}

impl Problem {
    /// Finds the line of the field that its place names, in the text of the file: that of the nearest table around it if the
    /// field is missing.
    #[must_use]
    pub fn on_its_line(self, text: &str) -> Self {
        let place = self.place.as_deref().unwrap_or_default();
        let path = place.rsplit(' ').next().unwrap_or(place);
        match line(text, path) {
            Some(line) => self.at_line(line),
            None => self,
        }
    }
}

/// The line on which the field or table of this path stands, as in `air.velocity`.
fn line(text: &str, path: &str) -> Option<u64> {
    let document = DeTable::parse(text).ok()?;
    let (mut table, mut found) = (Some(document.get_ref()), None);
    for part in path.split('.') {
        let known = table.into_iter().flat_map(|table| table.iter());
        let Some((key, value)) = known.into_iter().find(|(key, _)| key.get_ref() == part) else {
            break;
        };
        found = Some(key.span().start);
        table = value.get_ref().as_table();
    }
    let before = text.get(..found?)?;
    Some(before.matches('\n').count() as u64 + 1)
}

/// The path of the field concerned, as in `air.velocity`, if the error is about a field.
fn field(error: &toml::de::Error) -> Option<String> {
    // Without the text, the message ends with the path instead of an excerpt.
    let mut bare = error.clone();
    bare.set_input(None);
    let bare = bare.to_string();
    let path = bare.lines().last()?.strip_prefix("in `")?;
    Some(path.strip_suffix('`')?.to_owned())
}

/// Help for a line whose text value has no quotes.
fn without_quotes(line: &str) -> Option<String> {
    let (key, value) = line.split_once('=')?;
    let value = value.split('#').next().unwrap_or_default().trim();
    let is_text = value.starts_with(|c: char| c.is_alphabetic() || c == '/' || c == '.')
        && !["true", "false", "inf", "nan"].contains(&value);
    is_text.then(|| format!("put text in quotes: {} = \"{value}\"", key.trim()))
}

/// Help for a path with backslashes, which start escape sequences between double quotes.
fn backslash(line: &str) -> Option<String> {
    let (key, value) = line.split_once('=')?;
    let value = value.split('#').next().unwrap_or_default().trim();
    let path = value.strip_prefix('"')?.strip_suffix('"')?;
    path.contains('\\').then(|| {
        format!(
            "a backslash between double quotes starts an escape sequence; use single quotes or forward slashes: {} = '{path}'",
            key.trim()
        )
    })
}

/// Help for a number with a decimal comma.
fn decimal_comma(line: &str) -> Option<String> {
    let (key, value) = line.split_once('=')?;
    let value = value.split('#').next().unwrap_or_default().trim();
    let (whole, part) = value.split_once(',')?;
    let digits = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    (digits(whole.trim_start_matches('-')) && digits(part)).then(|| {
        let key = key.trim();
        format!("numbers have a decimal point: {key} = {whole}.{part}")
    })
}

/// Help for a misspelt key or choice: messages name what was found and what was expected in backticks.
fn mistyped(message: &str) -> Option<String> {
    if !message.starts_with("unknown") {
        return None;
    }
    let mut names = message.split('`').skip(1).step_by(2);
    let found = names.next()?;
    nearest(found, names).map(|name| format!("did you mean {name}?"))
}

#[cfg(test)]
mod tests {
    use serde::Deserialize;

    use super::*;

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    struct File {
        #[expect(dead_code, reason = "only read")]
        height_m: Option<f64>,
        #[expect(dead_code, reason = "only read")]
        recording: Option<String>,
        #[expect(dead_code, reason = "only read")]
        air: Option<Air>,
    }

    #[derive(Debug, Deserialize)]
    struct Air {
        #[expect(dead_code, reason = "only read")]
        velocity: [f64; 3],
    }

    fn problem(text: &str) -> Problem {
        let error = toml::from_str::<File>(text).expect_err("not the file");
        Problem::toml(&error, text, Path::new("a.toml"))
    }

    #[test]
    fn a_misspelt_key_is_recognised() {
        let problem = problem("recording = \"a\"\nheigth_m = 1.7\n");
        assert_eq!(problem.line, Some(2));
        assert_eq!(problem.help.as_deref(), Some("did you mean height_m?"));
    }

    #[test]
    fn text_without_quotes_is_reported() {
        let problem = problem("height_m = 1.7\nrecording = flight.mvnx  # mine\n");
        assert_eq!(problem.line, Some(2));
        let help = "put text in quotes: recording = \"flight.mvnx\"";
        assert_eq!(problem.help.as_deref(), Some(help));
    }

    #[test]
    fn paths_of_windows_and_decimal_commas_are_explained() {
        let windows = problem("recording = \"C:\\Users\\me\\flight.mvnx\"\n");
        assert_eq!(windows.line, Some(1));
        let help = windows.help.unwrap();
        assert!(
            help.contains("recording = 'C:\\Users\\me\\flight.mvnx'"),
            "{help}"
        );
        let comma = problem("height_m = 1,75\n").help.unwrap();
        assert!(comma.contains("height_m = 1.75"), "{comma}");
    }

    #[test]
    fn a_field_that_is_checked_later_has_its_line() {
        let text = "kind = 1\n\n[air]\nvelocity = [0, 0, 60]\n[segments.\"l_hand\"]\nrow = 3\nnoise.rate_hz = 2\n";
        for (place, line) in [
            ("kind", Some(1)),
            ("air", Some(3)),
            ("air.velocity", Some(4)),
            ("field air.velocity", Some(4)),
            ("table segments.l_hand", Some(5)),
            ("segments.l_hand.axes", Some(5)),
            ("segments.l_hand.noise.rate_hz", Some(7)),
            ("body.axes", None),
            ("", None),
        ] {
            let problem = Problem::bad_input("bad").at(place).on_its_line(text);
            assert_eq!(problem.line, line, "{place}");
        }
    }

    #[test]
    fn every_wrong_value_is_reported_with_its_field_and_shape() {
        for (text, said) in [
            (
                "[air]\nvelocity = [0, 60]\n",
                "a.toml:2: field air.velocity: invalid length 2, expected a list of 3 values",
            ),
            (
                "air.velocity = [0, 60, \"a\"]\n",
                "a.toml:1: field air.velocity: invalid type: string \"a\", expected a number",
            ),
            (
                "air = 3\n",
                "a.toml:1: field air: invalid type: integer `3`, expected a table",
            ),
            (
                "height_m = \"1.7\"\n",
                "a.toml:1: field height_m: invalid type: string \"1.7\", expected a number",
            ),
        ] {
            assert_eq!(problem(text).to_string(), said);
        }
        let missing = problem("[air]\n").to_string();
        assert!(missing.contains("missing field `velocity`"), "{missing}");
    }

    #[test]
    fn a_word_unlike_all_others_gets_no_suggestion() {
        assert_eq!(problem("colour = 1\n").help, None);
        assert_eq!(problem("height_m = 1.7 m\n").help, None);
    }
}
