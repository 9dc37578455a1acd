//! The one error type that users see: where the problem is, what is wrong, what was expected, and what to do next.
//!
//! A [`Problem`] is built where the cause is known best, passed up unchanged and printed once, by `main`.

pub mod choices;
pub mod shape;
#[cfg(feature = "toml")]
mod toml;

use std::error::Error;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The result of any operation that can fail because of the user's input or the system.
pub type Result<T> = core::result::Result<T, Problem>;

/// Why a command ended. Each kind has its own exit code, see [`Kind::exit_code`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A file or value given by the user cannot be used.
    BadInput,
    /// The system refused: file not found, no permission, disk full, port in use, or a unit that does not answer.
    System,
    /// The run finished with a negative answer: a mismatch, a lost packet.
    Disagreement,
    /// The run finished, but its answer cannot be trusted.
    Doubt,
    /// Ctrl-C.
    Interrupted,
    /// A bug in this program.
    Internal,
}

impl Kind {
    /// Exit code of the process: 1 for a bug in this program, 2 for bad input, 3 if the system refused, 4 for a
    /// disagreement, 5 for an answer that cannot be trusted, 130 for Ctrl-C.
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

/// A problem with its location, its cause and the next step.
#[derive(Debug, Clone, thiserror::Error)]
#[error("{}{message}", self.location())]
pub struct Problem {
    /// What kind of failure this is.
    pub kind: Kind,
    /// What is wrong, in one sentence, with the values found and expected.
    pub message: String,
    /// The file concerned.
    pub file: Option<PathBuf>,
    /// Line in the file, from 1.
    pub line: Option<u64>,
    /// Place within the file: a frame, an element, a field.
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

    /// Bad input.
    pub fn bad_input(message: impl Into<String>) -> Self {
        Self::new(Kind::BadInput, message)
    }

    /// A refusal by the system, or by a device connected to it.
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

    /// An answer that cannot be trusted.
    pub fn doubt(message: impl Into<String>) -> Self {
        Self::new(Kind::Doubt, message)
    }

    /// A part of the program that was left out when it was built, to keep the build short.
    pub fn not_built_in(what: &str) -> Self {
        Self::bad_input(format!("this program was built without {what}")).help(
            "released programs and the Python package have it; from the sources: \
             cargo run --release --features full -- ..., or cargo install --path host --features full",
        )
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

    /// Attaches the underlying error.
    #[must_use]
    pub fn caused_by(self, cause: impl Error + Send + Sync + 'static) -> Self {
        Self {
            cause: Some(Arc::new(cause)),
            ..self
        }
    }

    /// Sets the file, unless one is already set.
    #[must_use]
    pub fn in_file(mut self, file: &Path) -> Self {
        self.file.get_or_insert_with(|| file.to_path_buf());
        self
    }

    /// Sets the line, counted from 1.
    #[must_use]
    pub fn at_line(mut self, line: u64) -> Self {
        self.line = Some(line);
        self
    }

    /// Sets the place within the file.
    #[must_use]
    pub fn at(mut self, place: impl Into<Box<str>>) -> Self {
        self.place = Some(place.into());
        self
    }

    /// Sets the advice on what to do next.
    #[must_use]
    pub fn help(mut self, help: impl Into<Box<str>>) -> Self {
        self.help = Some(help.into());
        self
    }
}

impl Problem {
    /// File, line and place: the prefix of the message.
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

    /// The underlying errors, from the nearest to the deepest.
    pub fn causes(&self) -> impl Iterator<Item = &(dyn Error + 'static)> {
        core::iter::successors(self.source(), |error: &&(dyn Error + 'static)| {
            (*error).source()
        })
    }

    /// The problem and its causes, in one line.
    pub fn with_causes(&self) -> String {
        self.causes()
            .fold(self.to_string(), |text, cause| format!("{text}: {cause}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_problem_is_printed_as_place_and_sentence() {
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
    }
}
