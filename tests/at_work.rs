//! The running program: what a terminal shows, Ctrl-C in every verb, several flights in one call.
#![cfg(unix)]
#![expect(clippy::expect_used, reason = "tests may panic: that is how they fail")]

use std::fs;
use std::io::Read;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use bodyflight_tests::program::{Program, ctrl_c, number, plain, text};
use serialport::{SerialPort, TTYPort};

const PROGRAM: Program = Program(env!("CARGO_BIN_EXE_bodyflight"));

/// Makes a flight with a duration of `seconds`.
fn flight(folder: &Path, seconds: &str) -> String {
    let out = plain(folder);
    let words = [
        "hide",
        "clean",
        "--flights",
        "1",
        "--rate",
        "60",
        "--out",
        out,
    ];
    PROGRAM.json(&[&words[..], &["--duration", seconds]].concat());
    plain(&folder.join("flight-0/flight.toml")).to_owned()
}

fn begun(place: &Path, words: &[&str]) -> Child {
    let command = Command::new(PROGRAM.0)
        .args(words)
        .current_dir(place)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn();
    command.expect("the binary starts")
}

/// Calls that take longer than a second or never end on their own; `@` is replaced by a long flight.
const LONG: [&str; 15] = [
    "estimate @",
    "estimate @ --method smooth",
    "tune @ --draws 100000 --out best.toml",
    "sensitivity @",
    "discover @",
    "validate @",
    "reproduce --out reproduction",
    "hide clean --duration 300 --flights 50 --out lab",
    "stream @ --virtual",
    "mvn send @ --to 127.0.0.1:9",
    "mvn listen --bind 127.0.0.1:0",
    "slimevr listen --bind 127.0.0.1:0",
    "monitor --xbus",
    "unit",
    "simulate @ @ @ @ @ @ @ @ @ @ @ @ @ @ @ @ @ @ @ @ @ @ @ @ @ @ @ @ @ @",
];

#[test]
fn ctrl_c_ends_every_verb_within_a_second() {
    let folder = tempfile::tempdir().expect("a folder");
    let long = flight(folder.path(), "300");
    let mut wrong = Vec::new();
    for call in LONG {
        let place = tempfile::tempdir().expect("a folder");
        let call = call.replace('@', &long);
        let words: Vec<&str> = call.split(' ').collect();
        let mut child = begun(place.path(), &words);
        // A search has a best result to save only after its first draws.
        let is_search = call.starts_with("tune");
        std::thread::sleep(Duration::from_millis(if is_search { 8000 } else { 600 }));
        if let Some(status) = child.try_wait().expect("a state") {
            wrong.push(format!("{call}: over before Ctrl-C, {status}"));
            continue;
        }
        // An input that ends would be a reason to end too.
        let _input = child.stdin.take();
        let pressed = Instant::now();
        ctrl_c(child.id());
        let output = child.wait_with_output().expect("it ends");
        let seconds = pressed.elapsed().as_secs_f64();
        if output.status.code() != Some(130) || seconds > 1.2 {
            let said = text(&output.stderr);
            wrong.push(format!(
                "{call}: {} after {seconds:.2} s: {said}",
                output.status
            ));
        }
        let left = files(place.path());
        if let Some(left) = left.iter().find(|name| name.starts_with(".bodyflight-")) {
            wrong.push(format!("{call}: {left} is left"));
        }
        if is_search {
            let best = fs::read_to_string(place.path().join("best.toml")).unwrap_or_default();
            if !best.contains("[coefficients]") {
                wrong.push(format!("{call}: the best so far is lost"));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Names of all files in a folder and its subfolders.
fn files(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).expect("a folder").flatten();
    let each = entries.flat_map(|entry| match entry.path() {
        path if path.is_dir() => files(&path),
        path => vec![
            path.file_name()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned(),
        ],
    });
    each.collect()
}

/// Returns what a call shows on a terminal while it runs.
fn shown(place: &Path, words: &[&str]) -> String {
    let (mut screen, terminal) = TTYPort::pair().expect("a pseudo terminal");
    let name = terminal.name().expect("a name");
    let behind = fs::File::options()
        .read(true)
        .write(true)
        .open(&name)
        .expect("the terminal");
    drop(terminal);
    screen.set_timeout(Duration::from_millis(50)).expect("set");
    let mut child = Command::new(PROGRAM.0)
        .args(words)
        .current_dir(place)
        .env("TERM", "xterm")
        .stdout(Stdio::null())
        .stderr(behind)
        .spawn()
        .expect("the binary starts");
    let mut seen = Vec::new();
    let mut piece = [0; 4096];
    loop {
        let is_over = child.try_wait().expect("a state").is_some();
        match screen.read(&mut piece) {
            Ok(count) => seen.extend_from_slice(&piece[..count]),
            Err(_) if is_over => return text(&seen),
            Err(_) => {}
        }
    }
}

#[test]
fn a_terminal_shows_stages_rates_and_the_time_left() {
    let folder = tempfile::tempdir().expect("a folder");
    let long = flight(folder.path(), "60");
    for (words, parts) in [
        (
            &["simulate", &long, &long, &long][..],
            &[
                "simulating, ",
                " of 60 s, ",
                " times real time",
                " %, ",
                " left",
            ][..],
        ),
        (
            &["estimate", &long, "--method", "smooth"],
            &[
                "estimating: filtering, to find the joint errors",
                "estimating: filtering",
                "estimating: smoothing, pass 2 of 4",
                " %, ",
                " left",
            ],
        ),
        (
            &["tune", &long, "--draws", "80"],
            &["draws ", "/80, ", "/s, ", " left"],
        ),
        (
            &["validate", &long],
            &[
                "validating: exact equations, windows of 0.25 s",
                "validating: as published",
                " left",
            ],
        ),
    ] {
        let seen = shown(folder.path(), words);
        for part in parts {
            assert!(seen.contains(part), "{words:?} shows no {part:?}: {seen}");
        }
    }
}

#[test]
fn several_flights_are_processed_one_by_one() {
    let folder = tempfile::tempdir().expect("a folder");
    let [one, two] = ["one", "two"].map(|name| {
        let made = folder.path().join(name);
        flight(&made, "3");
        let place = folder.path().join(format!("turn-{name}"));
        fs::rename(made.join("flight-0"), &place).expect("moved");
        plain(&place).to_owned()
    });
    let out = plain(&folder.path().join("{}.csv")).to_owned();
    // Each result is the same as from a call with that flight alone.
    let both = &PROGRAM.json(&["simulate", &one, &two, "--out", &out])["flights"];
    for (k, (flight, name)) in [(&one, "turn-one"), (&two, "turn-two")]
        .into_iter()
        .enumerate()
    {
        let alone = PROGRAM.json(&["simulate", flight]);
        assert_eq!(both[k]["flight"], flight.as_str());
        assert_eq!(both[k]["report"]["rms"], alone["rms"]);
        let csv = fs::read_to_string(folder.path().join(format!("{name}.csv"))).expect("a table");
        let rows = csv.lines().count() - 1;
        assert_eq!(alone["frames"], rows);
    }
    let recordings = [&one, &two].map(|place| format!("{place}/flight.mvnx"));
    let told = PROGRAM.json(&["inspect", &recordings[0], &recordings[1]]);
    assert_eq!(told["flights"].as_array().map(Vec::len), Some(2));
    // A flight that cannot be read does not stop the others.
    let absent = plain(&folder.path().join("absent.mvnx")).to_owned();
    let (estimates, code) = PROGRAM.answer(&["estimate", &one, &absent, &two]);
    assert_eq!(code, Some(3));
    let estimates = &estimates["flights"];
    assert_eq!(estimates[1]["error"]["exit_code"], 3, "{estimates}");
    for k in [0, 2] {
        assert!(
            number(&estimates[k]["report"]["updates"]) > 50.0,
            "{estimates}"
        );
    }
    // Flights of the same name would share one output file.
    let again = PROGRAM.fails(&["simulate", &one, &one, "--out", &out, "--force"], 2);
    assert!(again.contains("have the same name"), "{again}");
}
