//! The one error type that users see: where, what was wrong, what was expected, what to do next.
//!
//! Each reader builds a [`Problem`] at the place that knows most; it is handed up unchanged and printed
//! once, by `main`.

use std::fmt;
use std::path::{Path, PathBuf};

/// The result of everything that can disappoint a user.
pub type Result<T> = core::result::Result<T, Problem>;

/// Why a command ended; each kind is one exit code, see [`Kind::exit_code`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A file or value given by the user is not usable.
    BadInput,
    /// The operating system refused: missing file, no permission, full disk.
    System,
    /// The run finished and its answer is no: a mismatch, a lost packet.
    Disagreement,
    /// Ctrl-C.
    Interrupted,
}

impl Kind {
    /// Exit code of the process: 2 bad input, 3 system, 4 disagreement, 130 Ctrl-C (1 is left to crashes).
    pub const fn exit_code(self) -> u8 {
        match self {
            Self::BadInput => 2,
            Self::System => 3,
            Self::Disagreement => 4,
            Self::Interrupted => 130,
        }
    }
}

/// A problem with its place and the next step.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Problem {
    /// What kind of failure this is.
    pub kind: Kind,
    /// What is wrong, in a sentence with the values found and expected.
    pub message: String,
    /// The file concerned.
    pub file: Option<PathBuf>,
    /// Line in the file, from 1.
    pub line: Option<u64>,
    /// Place by meaning: a frame, an element, a field.
    pub place: Option<String>,
    /// What the user can do next.
    pub help: Option<String>,
}

impl Problem {
    /// Bad input with its message.
    pub fn bad_input(message: impl Into<String>) -> Self {
        Self {
            kind: Kind::BadInput,
            message: message.into(),
            file: None,
            line: None,
            place: None,
            help: None,
        }
    }

    /// A refusal by the operating system while doing `action` ("read", "create", ...) on `file`.
    pub fn system(action: &str, file: &Path, error: &std::io::Error) -> Self {
        Self {
            kind: Kind::System,
            ..Self::bad_input(format!("cannot {action} this file: {error}")).in_file(file)
        }
    }

    /// A file that is no TOML, or not the expected one, with the line of the error.
    pub fn toml(error: &toml::de::Error, text: &str, file: &Path) -> Self {
        let problem = Self::bad_input(error.message().trim().to_owned()).in_file(file);
        match error.span() {
            Some(span) => {
                let before = text.get(..span.start).unwrap_or(text);
                problem.at_line(before.matches('\n').count() as u64 + 1)
            }
            None => problem,
        }
    }

    /// A negative answer.
    pub fn disagreement(message: impl Into<String>) -> Self {
        Self {
            kind: Kind::Disagreement,
            ..Self::bad_input(message)
        }
    }

    /// Ctrl-C was pressed.
    pub fn interrupted() -> Self {
        Self {
            kind: Kind::Interrupted,
            ..Self::bad_input("interrupted; unfinished files were removed")
        }
    }

    /// Names the file, unless one is named already.
    #[must_use]
    pub fn in_file(mut self, file: &Path) -> Self {
        self.file.get_or_insert_with(|| file.to_path_buf());
        self
    }

    /// Names the line, from 1.
    #[must_use]
    pub fn at_line(mut self, line: u64) -> Self {
        self.line = Some(line);
        self
    }

    /// Names the place by meaning.
    #[must_use]
    pub fn at(mut self, place: impl Into<String>) -> Self {
        self.place = Some(place.into());
        self
    }

    /// Says what to do next.
    #[must_use]
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(file) = &self.file {
            write!(f, "{}", file.display())?;
            if let Some(line) = self.line {
                write!(f, ":{line}")?;
            }
            write!(f, ": ")?;
        }
        if let Some(place) = &self.place {
            write!(f, "{place}: ")?;
        }
        write!(f, "{}", self.message)
    }
}

impl std::error::Error for Problem {}

impl miette::Diagnostic for Problem {
    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        self.help
            .as_ref()
            .map(|help| Box::new(help) as Box<dyn fmt::Display>)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_problem_reads_as_place_and_sentence() {
        let problem = Problem::bad_input("expected 92 numbers, found 91")
            .in_file(Path::new("flight.mvnx"))
            .at_line(7)
            .at("frame 3, orientation");
        assert_eq!(
            problem.to_string(),
            "flight.mvnx:7: frame 3, orientation: expected 92 numbers, found 91"
        );
        assert_eq!(
            problem.in_file(Path::new("other")).file,
            Some("flight.mvnx".into())
        );
    }
}
