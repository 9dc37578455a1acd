//! Common mistakes and the program's messages: the table of docs/mistakes.md, row by row.
#![expect(clippy::expect_used, reason = "tests may panic: that is how they fail")]

#[path = "mistakes/calls.rs"]
mod calls;
#[path = "mistakes/kinds.rs"]
mod kinds;
#[path = "mistakes/table.rs"]
mod table;

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use bodyflight_tests::program::{Program, ctrl_c, plain, text};
use bodyflight_tests::small_recording::written;
use calls::CALLS;
use table::{FILES, Made};

const PROGRAM: Program = Program(env!("CARGO_BIN_EXE_bodyflight"));

const FLIGHT: &str = "recording = \"flight.mvnx\"\nsubject = \"subject.toml\"\ninputs = \"inputs.csv\"\n\n[air]\ndensity = 1.0\n";
const SUBJECT: &str = "height_m = 1.75\nmass_kg = 75.0\nsex = \"male\"\n\n[gear]\nhelmet = true\n";
const INPUTS: &str = "time_s,pitch,yaw,roll,damp_pitch,damp_yaw,damp_roll\n0,0,0,0,6,0.5,12\n";

fn make(folder: &Path, made: Made) {
    let write = |name: &str, bytes: &[u8]| {
        fs::write(folder.join(name), bytes).expect("a file");
    };
    let recording = written(24);
    write("flight.mvnx", recording.as_bytes());
    write("flight.toml", FLIGHT.as_bytes());
    write("subject.toml", SUBJECT.as_bytes());
    write("inputs.csv", INPUTS.as_bytes());
    match made {
        Made::Nothing | Made::FullDisk | Made::CtrlC(_) => {}
        Made::File(name, bytes) => write(name, bytes),
        Made::Edit(name, from, to) => {
            let text = fs::read_to_string(folder.join(name)).expect("text");
            assert!(text.contains(from), "{name}: {from}");
            write(name, text.replace(from, to).as_bytes());
        }
        Made::Recording(damage) => write("flight.mvnx", &damage(recording)),
        Made::Folder(name) => fs::create_dir(folder.join(name)).expect("a folder"),
    }
}

/// Everything that the program writes, without line breaks, and its exit code.
fn said(made: Made, folder: &Path, call: &[&str]) -> (String, Option<i32>) {
    let mut command = Command::new(PROGRAM.0);
    command.args(call).stderr(Stdio::piped());
    command.stdout(match made {
        Made::FullDisk => {
            let full = fs::File::options().write(true).open("/dev/full");
            Stdio::from(full.expect("the device"))
        }
        _ => Stdio::piped(),
    });
    let child = command.spawn().expect("the binary starts");
    if let Made::CtrlC(there) = made {
        while !folder.join(there).exists() {
            std::thread::sleep(Duration::from_millis(5));
        }
        ctrl_c(child.id());
    }
    let output = child.wait_with_output().expect("it ends");
    let all = text(&output.stdout) + &text(&output.stderr);
    assert!(!all.contains("panicked"), "{all}");
    let words = all.split_whitespace().filter(|word| *word != "│");
    (words.collect::<Vec<_>>().join(" "), output.status.code())
}

#[test]
fn every_mistake_has_its_message() {
    let page = fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/mistakes.md"));
    let page = page.expect("docs/mistakes.md");
    let mut wrong = Vec::new();
    for mistake in FILES.iter().chain(&CALLS) {
        let folder = tempfile::tempdir().expect("a folder");
        make(folder.path(), mistake.made);
        let at = format!("{}/", plain(folder.path()));
        let call: Vec<String> = (mistake.call.split(' '))
            .map(|word| word.replacen('@', &at, 1))
            .collect();
        let call: Vec<&str> = call.iter().map(String::as_str).collect();
        let (said, code) = said(mistake.made, folder.path(), &call);
        if code != Some(mistake.code) || !said.contains(mistake.says) {
            wrong.push(format!("{} ({code:?}): {said}", mistake.what));
        }
        let row = format!("| {} | {} |", mistake.what, mistake.says);
        if !page.contains(&row) {
            wrong.push(format!("not in docs/mistakes.md: {row}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    let rows = page.lines().filter(|line| line.starts_with("| ")).count();
    assert_eq!(
        rows,
        FILES.len() + CALLS.len() + 1,
        "rows of docs/mistakes.md"
    );
}

#[test]
fn wrong_arguments_are_reported_as_json_on_request() {
    for (call, message) in [
        (
            &["simulate", "a", "--modle"][..],
            "unexpected argument '--modle' found",
        ),
        (&["simulat", "a"], "unrecognized subcommand 'simulat'"),
        (
            &["simulate"],
            "the following required arguments were not provided: <FLIGHT>...",
        ),
    ] {
        let said = PROGRAM.fails(&[call, &["--json"]].concat(), 2);
        let said: serde_json::Value = serde_json::from_str(&said).expect("JSON");
        assert_eq!(said["error"]["message"], message);
        let help = said["error"]["help"].as_str().expect("help");
        assert!(help.contains("--help"), "{help}");
    }
}

#[test]
fn problems_are_json_if_results_are() {
    let said = PROGRAM.fails(&["simulate", "nowhere.mvnx", "--json"], 3);
    let said: serde_json::Value = serde_json::from_str(&said).expect("JSON");
    let error = &said["error"];
    assert_eq!(error["exit_code"], 3);
    assert_eq!(error["file"], "nowhere.mvnx");
    assert!(
        error["message"]
            .as_str()
            .is_some_and(|text| text.contains("cannot read"))
    );
    assert!(
        error["causes"]
            .as_array()
            .is_some_and(|causes| !causes.is_empty())
    );
}
