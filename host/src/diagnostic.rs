//! The one error type that users see: where, what was wrong, what was expected, what to do next.
//!
//! Each reader builds a [`Problem`] at the place that knows most; it is handed up unchanged and printed
//! once, by `main`.

pub mod choices;
mod toml;

use std::error::Error;
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The result of everything that can fail for a user.
pub type Result<T> = core::result::Result<T, Problem>;

/// Why a command ended; each kind is one exit code, see [`Kind::exit_code`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A file or value given by the user is not usable.
    BadInput,
    /// The system refused: missing file, no permission, full disk, a port in use, a unit that does not answer.
    System,
    /// The run finished and its answer is no: a mismatch, a lost packet.
    Disagreement,
    /// The run finished, and its answer is not to be trusted.
    Doubt,
    /// Ctrl-C.
    Interrupted,
    /// A bug in this program.
    Internal,
}

impl Kind {
    /// Exit code of the process: 1 a bug in this program, 2 bad input, 3 refused by the system, 4 disagreement,
    /// 5 an answer that is not to be trusted, 130 Ctrl-C.
    pub const fn exit_code(self) -> u8 {
        match self {
            Self::Internal => 1,
            Self::BadInput => 2,
            Self::System => 3,
            Self::Disagreement => 4,
            Self::Doubt => 5,
            Self::Interrupted => 130,
        }
    }
}

/// A problem with its place, its cause and the next step.
#[derive(Debug, Clone, thiserror::Error)]
#[error("{}{message}", self.location())]
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
    pub place: Option<Box<str>>,
    /// What the user can do next.
    pub help: Option<Box<str>>,
    /// The underlying error, if any.
    #[source]
    pub cause: Option<Arc<dyn Error + Send + Sync>>,
}

impl Problem {
    fn new(kind: Kind, message: impl Into<String>) -> Self {
        Self {
            kind,
            message: message.into(),
            file: None,
            line: None,
            place: None,
            help: None,
            cause: None,
        }
    }

    /// Bad input with its message.
    pub fn bad_input(message: impl Into<String>) -> Self {
        Self::new(Kind::BadInput, message)
    }

    /// A refusal by the system, or by what is connected to it.
    pub fn refused(message: impl Into<String>) -> Self {
        Self::new(Kind::System, message)
    }

    /// A refusal by the operating system while doing `action` ("read", "create", ...) on `file`.
    pub fn system(action: &str, file: &Path, error: std::io::Error) -> Self {
        Self::refused(format!("cannot {action} this file"))
            .in_file(file)
            .caused_by(error)
    }

    /// A negative answer.
    pub fn disagreement(message: impl Into<String>) -> Self {
        Self::new(Kind::Disagreement, message)
    }

    /// An answer that is not to be trusted.
    pub fn doubt(message: impl Into<String>) -> Self {
        Self::new(Kind::Doubt, message)
    }

    /// Ctrl-C was pressed.
    pub fn interrupted() -> Self {
        Self::new(
            Kind::Interrupted,
            "interrupted; unfinished files were removed",
        )
    }

    /// A bug in this program, not in its input.
    pub fn internal(message: impl Into<String>) -> Self {
        Self::new(Kind::Internal, message)
    }

    /// Keeps the underlying error.
    #[must_use]
    pub fn caused_by(self, cause: impl Error + Send + Sync + 'static) -> Self {
        Self {
            cause: Some(Arc::new(cause)),
            ..self
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
    pub fn at(mut self, place: impl Into<Box<str>>) -> Self {
        self.place = Some(place.into());
        self
    }

    /// Says what to do next.
    #[must_use]
    pub fn help(mut self, help: impl Into<Box<str>>) -> Self {
        self.help = Some(help.into());
        self
    }
}

impl Problem {
    /// File, line and place, as the message begins.
    fn location(&self) -> String {
        let mut text = String::new();
        if let Some(file) = &self.file {
            text += &file.display().to_string();
            if let Some(line) = self.line {
                text += &format!(":{line}");
            }
            text += ": ";
        }
        if let Some(place) = &self.place {
            text += &format!("{place}: ");
        }
        text
    }

    /// The problem and its causes, on one line.
    pub fn with_causes(&self) -> String {
        let mut text = self.to_string();
        let mut cause = self.source();
        while let Some(error) = cause {
            text += &format!(": {error}");
            cause = error.source();
        }
        text
    }
}

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

    #[test]
    fn a_refusal_keeps_its_cause() {
        let cause = std::io::Error::from(std::io::ErrorKind::NotFound);
        let problem = Problem::system("read", Path::new("flight.mvnx"), cause);
        assert_eq!(problem.kind, Kind::System);
        let source = problem.source().unwrap();
        assert_eq!(source.to_string(), "entity not found");
        assert_eq!(
            problem.with_causes(),
            "flight.mvnx: cannot read this file: entity not found"
        );
        let shown = format!("{:?}", miette::Report::new(problem));
        assert!(shown.contains("entity not found"), "{shown}");
    }
}
