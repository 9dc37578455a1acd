//! Errors in TOML files, with a guess at what was meant.

use std::path::Path;

use super::Problem;
use super::choices::nearest;

impl Problem {
    /// A file that is not TOML, or not the expected kind, with the line of the error.
    pub fn toml(error: &toml::de::Error, text: &str, file: &Path) -> Self {
        let mut problem = Self::bad_input(error.message().trim().to_owned()).in_file(file);
        let before = error.span().and_then(|span| text.get(..span.start));
        let line = before.map(|before| before.matches('\n').count());
        if let Some(line) = line {
            problem = problem.at_line(line as u64 + 1);
        }
        let line = line.and_then(|line| text.lines().nth(line));
        let meant = line
            .and_then(|line| without_quotes(line).or_else(|| backslash(line)))
            .or_else(|| line.and_then(|line| wrong_length(error.message(), line)))
            .or_else(|| mistyped(error.message()));
        match meant {
            Some(help) => problem.help(help),
            None => problem,
        }
    }
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
    let (_, value) = line.split_once('=')?;
    let value = value.trim();
    (value.starts_with('"') && value.contains('\\')).then(|| {
        "a backslash between double quotes starts an escape sequence: use single quotes, or / in paths"
            .to_owned()
    })
}

/// Help for a list that is too short or too long: the message has its length, but not its name.
fn wrong_length(message: &str, line: &str) -> Option<String> {
    let (key, _) = line.split_once('=')?;
    (message.starts_with("invalid length")).then(|| format!("this is the list {}", key.trim()))
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
        wind: Option<[f64; 3]>,
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
    fn paths_of_windows_and_lists_of_another_length_are_explained() {
        let windows = problem("recording = \"C:\\Users\\me\\flight.mvnx\"\n");
        assert_eq!(windows.line, Some(1));
        assert!(
            windows
                .help
                .is_some_and(|help| help.contains("single quotes"))
        );
        let list = problem("wind = [0, 60]\n");
        assert_eq!(list.line, Some(1));
        assert_eq!(list.help.as_deref(), Some("this is the list wind"));
    }

    #[test]
    fn a_word_unlike_all_others_gets_no_suggestion() {
        assert_eq!(problem("colour = 1\n").help, None);
        assert_eq!(problem("height_m = 1.7 m\n").help, None);
    }
}
