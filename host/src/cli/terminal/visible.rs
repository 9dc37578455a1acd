//! Escapes control characters, which a terminal would obey, and characters that reverse the direction of text.

use std::borrow::Cow;
use std::fmt::Write;

use bodyflight_io::diagnostic::Problem;

/// Whether a terminal interprets the character as a command instead of showing it.
fn is_obeyed(c: char) -> bool {
    let turns = matches!(c, '\u{61C}' | '\u{200E}' | '\u{200F}' | '\u{202A}'..='\u{202E}' | '\u{2066}'..='\u{2069}');
    c.is_control() && c != '\n' && c != '\t' || turns
}

/// The text with control characters escaped.
pub(super) fn visible(text: &str) -> Cow<'_, str> {
    replaced(text, |c, into| into.extend(c.escape_unicode()))
}

/// JSON of the same meaning, with control characters escaped.
pub(super) fn json_without_controls(text: &str) -> Cow<'_, str> {
    replaced(text, |c, into| {
        // All of them are in the basic multilingual plane.
        let _ = write!(into, "\\u{:04x}", u32::from(c));
    })
}

fn replaced(text: &str, write: impl Fn(char, &mut String)) -> Cow<'_, str> {
    if !text.contains(is_obeyed) {
        return Cow::Borrowed(text);
    }
    let mut clean = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        if is_obeyed(c) {
            write(c, &mut clean);
        } else {
            clean.push(c);
        }
    }
    Cow::Owned(clean)
}

/// A name on one line: a line break in it would let it pass for a message of its own.
fn on_one_line(text: &str) -> String {
    visible(text).replace('\n', "\\n")
}

/// The problem with all its texts escaped.
pub(super) fn visible_problem(mut problem: Problem) -> Problem {
    let name = problem.file.as_ref().map(|file| file.display().to_string());
    problem.file = name.map(|name| on_one_line(&name).into());
    problem.message = visible(&problem.message).into_owned();
    problem.place = problem.place.map(|place| on_one_line(&place).into());
    problem.help = problem.help.map(|help| visible(&help).into());
    let causes: Vec<String> = problem.causes().map(ToString::to_string).collect();
    if causes.iter().any(|text| text.contains(is_obeyed)) {
        let causes: Vec<_> = causes.iter().map(|text| visible(text)).collect();
        problem = problem.caused_by(std::io::Error::other(causes.join(": ")));
    }
    problem
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn terminal_control_characters_are_escaped() {
        assert_eq!(visible("Zoë\tb\n"), "Zoë\tb\n");
        assert_eq!(
            visible("\u{1b}[2J\u{9b}x\u{202e}\r"),
            "\\u{1b}[2J\\u{9b}x\\u{202e}\\u{d}"
        );
    }

    #[test]
    fn json_keeps_its_meaning() {
        let name = "a\u{1b}\u{9b}\u{7f}\u{202e}ü";
        let text = serde_json::to_string_pretty(&[name]).unwrap();
        let clean = json_without_controls(&text);
        assert!(!clean.contains(is_obeyed));
        let back: Vec<String> = serde_json::from_str(&clean).unwrap();
        assert_eq!(back, [name]);
    }

    #[test]
    fn control_characters_in_problems_are_escaped() {
        let problem = Problem::bad_input("\u{1b}]0;x\u{7}")
            .in_file(std::path::Path::new("a\u{1b}.mvnx"))
            .at("\u{1b}")
            .help("\u{1b}")
            .caused_by(
                Problem::bad_input("plain").caused_by(std::io::Error::other("\u{1b}[2J\u{9b}")),
            );
        let problem = visible_problem(problem);
        let all = format!("{}{}", problem.with_causes(), problem.help.unwrap());
        assert!(!all.contains(is_obeyed), "{all}");
        assert!(all.contains("plain: \\u{1b}[2J"), "{all}");
    }

    #[test]
    fn a_name_cannot_pass_for_a_message() {
        let problem = Problem::bad_input("bad")
            .in_file(std::path::Path::new("a\nerror: none.mvnx"))
            .at("b\nverdict: consistent");
        let text = visible_problem(problem).to_string();
        assert_eq!(text.lines().count(), 1, "{text}");
    }
}
