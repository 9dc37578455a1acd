//! The real binary, for tests of the command line: its JSON output and its error messages.

use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

/// The path of the program, which Cargo gives only to tests of the program's own package.
#[derive(Debug, Clone, Copy)]
pub struct Program(pub &'static str);

impl Program {
    /// Runs the program with these arguments.
    pub fn run(self, arguments: &[&str]) -> Output {
        Command::new(self.0)
            .args(arguments)
            .output()
            .unwrap_or_else(|error| panic!("{}: {error}", self.0))
    }

    /// Returns the standard output as JSON, and the exit code.
    pub fn answer(self, arguments: &[&str]) -> (Value, Option<i32>) {
        let output = self.run(&[arguments, &["--json"]].concat());
        let value = serde_json::from_slice(&output.stdout)
            .unwrap_or_else(|_| panic!("{arguments:?}: {}", text(&output.stderr)));
        self.check_schema(arguments, &value);
        (value, output.status.code())
    }

    /// Returns the standard output of a successful run as JSON.
    pub fn json(self, arguments: &[&str]) -> Value {
        let output = self.run(&[arguments, &["--json"]].concat());
        assert!(
            output.status.success(),
            "{arguments:?}: {}",
            text(&output.stderr)
        );
        let value = serde_json::from_slice(&output.stdout)
            .unwrap_or_else(|error| panic!("{arguments:?}: no JSON: {error}"));
        self.check_schema(arguments, &value);
        value
    }

    /// Asserts that an answer matches one of the schemas that `bodyflight schema` lists for the verb.
    fn check_schema(self, arguments: &[&str], value: &Value) {
        let verb = arguments[0];
        let listed = text(&self.run(&["schema"]).stdout);
        let is_of_verb = |name: &&str| {
            let rest = name.strip_prefix(verb);
            rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('-'))
        };
        let names: Vec<&str> = listed.lines().filter(is_of_verb).collect();
        let faults: Vec<String> = names
            .iter()
            .filter_map(|name| self.fault(name, value))
            .collect();
        assert!(
            names.is_empty() || faults.len() < names.len(),
            "{arguments:?} is not as its schema says: {faults:#?}"
        );
    }

    /// Asserts that a value, such as a line, is as the schema of this name says.
    pub fn fits(self, name: &str, value: &Value) {
        let fault = self.fault(name, value);
        assert!(fault.is_none(), "{fault:?}: {value}");
    }

    /// The first violation of a schema, if there is one.
    fn fault(self, name: &str, value: &Value) -> Option<String> {
        let schema = self.run(&["schema", name]).stdout;
        let schema: Value = serde_json::from_slice(&schema)
            .unwrap_or_else(|error| panic!("schema of {name}: {error}"));
        let validator = jsonschema::validator_for(&schema)
            .unwrap_or_else(|error| panic!("schema of {name}: {error}"));
        let error = validator.validate(value).err()?;
        Some(format!("{name}, {}: {error}", error.instance_path()))
    }

    /// Returns the error message of a run that fails with this exit code.
    pub fn fails(self, arguments: &[&str], code: i32) -> String {
        let (message, found) = self.says(arguments);
        assert_eq!(found, Some(code), "{arguments:?}: {message}");
        message
    }

    /// Returns the standard error without line breaks, and the exit code.
    pub fn says(self, arguments: &[&str]) -> (String, Option<i32>) {
        let output = self.run(arguments);
        let message = text(&output.stderr);
        assert!(!message.contains("panicked"), "{message}");
        // Terminal output may wrap anywhere: compare without line breaks.
        let words = message.split_whitespace().filter(|word| *word != "│");
        (words.collect::<Vec<_>>().join(" "), output.status.code())
    }

    /// Synthesises a maneuver into a folder; returns its `flight.toml`.
    pub fn synth(self, maneuver: &str, folder: &Path, extra: &[&str]) -> String {
        let report = self.json(&[&["synth", maneuver, "--out", plain(folder)], extra].concat());
        let flight = report["flight"].as_str();
        flight.unwrap_or_else(|| panic!("{report}")).to_owned()
    }
}

/// Sends a process the signal that Ctrl-C sends.
pub fn ctrl_c(process: u32) {
    let sent = Command::new("kill")
        .args(["-INT", &process.to_string()])
        .status();
    assert!(sent.is_ok_and(|status| status.success()), "kill is there");
}

/// The output of a program as text.
pub fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// A path as an argument.
pub fn plain(path: &Path) -> &str {
    path.to_str()
        .unwrap_or_else(|| panic!("a plain path: {}", path.display()))
}

/// A number in a report.
pub fn number(value: &Value) -> f64 {
    value
        .as_f64()
        .unwrap_or_else(|| panic!("a number: {value}"))
}

/// Writes a file into a folder; returns its path.
pub fn written(folder: &Path, name: &str, content: &str) -> String {
    let path = folder.join(name);
    std::fs::write(&path, content).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    plain(&path).to_owned()
}
