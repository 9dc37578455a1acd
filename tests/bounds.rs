//! Memory of every verb that reads files of any length, against the bound that docs/security.md states.

#![cfg(target_os = "linux")]
#![expect(clippy::expect_used, reason = "tests may panic: that is how they fail")]

use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use bodyflight_tests::long_recording::repeated;
use bodyflight_tests::text_inputs::{MAPPING, markers, track};

const PROGRAM: &str = env!("CARGO_BIN_EXE_bodyflight");

/// The page with the bounds.
const PAGE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/security.md");

/// Longest flight of the laboratory (s), which is repeated for longer ones.
const LONGEST: u32 = 120;

/// Frame rate (Hz).
const RATE: u32 = 240;

/// What a verb reads, and how its length is counted.
#[derive(Clone, Copy, PartialEq)]
enum Input {
    /// Recordings: minutes at 240 frames a second.
    Recording,
    /// Tracks and motion of other systems: MB of text.
    Table,
}

/// A verb, and the most memory that it needs.
struct Verb {
    /// Its arguments; inputs are `FLIGHT`, `OTHER`, `TRACK` and `MARKERS`.
    arguments: &'static [&'static str],
    input: Input,
    /// MB, whatever the input.
    base: f64,
    /// MB for each minute or MB of input.
    slope: f64,
}

const fn verb(arguments: &'static [&'static str], input: Input, base: f64, slope: f64) -> Verb {
    Verb {
        arguments,
        input,
        base,
        slope,
    }
}

const VERBS: [Verb; 11] = {
    use Input::{Recording, Table};
    [
        verb(&["inspect", "RECORDING"], Recording, 32.0, 0.0),
        verb(
            &["simulate", "FLIGHT", "--out", "a.csv", "--plot", "a.svg"],
            Recording,
            32.0,
            0.0,
        ),
        verb(
            &["export", "FLIGHT", "--out", "b.csv"],
            Recording,
            32.0,
            0.0,
        ),
        verb(
            &["estimate", "FLIGHT", "--out", "c.csv"],
            Recording,
            256.0,
            30.0,
        ),
        verb(&["view", "FLIGHT", "--out", "d.html"], Recording, 32.0, 2.0),
        verb(
            &["figures", "FLIGHT", "--format", "svg", "--out", "figures"],
            Recording,
            256.0,
            36.0,
        ),
        verb(
            &[
                "compare", "FLIGHT", "OTHER", "--align", "start", "--out", "e.csv",
            ],
            Recording,
            48.0,
            16.0,
        ),
        verb(&["technique", "FLIGHT"], Recording, 32.0, 12.0),
        // It refuses what was repeated.
        verb(
            &[
                "discover",
                "../flight-0/flight.toml",
                "--hold-out",
                "../flight-1/flight.toml",
            ],
            Recording,
            128.0,
            336.0,
        ),
        verb(&["fall", "TRACK", "--plot", "f.svg"], Table, 32.0, 12.0),
        verb(
            &[
                "import",
                "MARKERS",
                "--mapping",
                "../points.toml",
                "--out",
                "imported",
            ],
            Table,
            32.0,
            8.0,
        ),
    ]
};

/// Peak memory (MB) of a process that runs to its end.
fn peak(child: &mut Child) -> f64 {
    let status = format!("/proc/{}/status", child.id());
    let mut most = 0.0_f64;
    while child.try_wait().expect("it can be asked").is_none() {
        let text = std::fs::read_to_string(&status).unwrap_or_default();
        let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        let kilobytes = line.and_then(|line| line.trim().split(' ').next()?.parse::<f64>().ok());
        most = most.max(kilobytes.unwrap_or(0.0) / 1024.0);
        std::thread::sleep(Duration::from_millis(2));
    }
    most
}

struct Measured {
    size: f64,
    memory: f64,
    seconds: f64,
}

fn measured(folder: &Path, verb: &Verb, size: f64) -> Measured {
    let arguments = verb.arguments.iter().map(|word| match *word {
        "RECORDING" => "../long/flight.mvnx",
        "FLIGHT" => "../long/flight.toml",
        "OTHER" => "../other/flight.toml",
        "TRACK" => "../track.csv",
        "MARKERS" => "../markers.csv",
        word => word,
    });
    // Outputs of two hours are too large to keep those of every verb.
    let outputs = tempfile::tempdir_in(folder).expect("a folder");
    let begin = Instant::now();
    let mut child = Command::new(PROGRAM)
        .args(arguments)
        .current_dir(outputs.path())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("the binary starts");
    let memory = peak(&mut child);
    let code = child.wait().expect("it ends").code();
    // A flight that is repeated is doubted, of course.
    assert!(
        matches!(code, Some(0 | 4 | 5)),
        "{:?}: {code:?}",
        verb.arguments
    );
    Measured {
        size,
        memory,
        seconds: begin.elapsed().as_secs_f64(),
    }
}

impl Verb {
    fn name(&self) -> &str {
        self.arguments[0]
    }

    fn bound(&self, size: f64) -> f64 {
        self.base + self.slope * size
    }

    /// The bound as on the page.
    fn stated(&self) -> String {
        let unit = match self.input {
            Input::Recording => "minute",
            Input::Table => "MB",
        };
        match self.slope {
            slope if slope > 0.0 => format!("{} MB + {slope} MB for each {unit}", self.base),
            _ => format!("{} MB", self.base),
        }
    }
}

/// `BODYFLIGHT_BOUNDS_S=7200` flies two hours, and reads tracks of a million rows.
#[test]
fn memory_stays_within_what_is_stated() {
    let seconds: u32 =
        std::env::var("BODYFLIGHT_BOUNDS_S").map_or(10, |text| text.parse().expect("seconds"));
    let piece = seconds.min(LONGEST);
    let place = tempfile::tempdir().expect("a folder");
    let folder = place.path();
    let flown = Command::new(PROGRAM)
        .args([
            "hide",
            "clean",
            "--flights",
            "2",
            "--out",
            ".",
            "--duration",
            &piece.to_string(),
        ])
        .current_dir(folder)
        .stdout(Stdio::null())
        .status();
    assert!(flown.expect("it starts").success());
    for (name, from) in [("long", "flight-0"), ("other", "flight-1")] {
        repeated(folder, name, from, seconds, RATE);
    }
    let rows = if seconds < 1000 { 50_000 } else { 1_000_000 };
    let texts = [
        ("track.csv", track(rows)),
        ("markers.csv", markers(rows / 20)),
        ("points.toml", MAPPING.to_owned()),
    ];
    for (name, text) in texts {
        std::fs::write(folder.join(name), text).expect("written");
    }
    let page = std::fs::read_to_string(PAGE).expect("the page");
    println!("| verb | at most | input | memory | time |\n|---|---|---|---|---|");
    let mut faults = Vec::new();
    for verb in &VERBS {
        let size = match (verb.input, verb.name()) {
            (Input::Recording, "discover") => f64::from(piece) / 60.0,
            (Input::Recording, _) => f64::from(seconds) / 60.0,
            (Input::Table, "fall") => megabytes(&folder.join("track.csv")),
            (Input::Table, _) => megabytes(&folder.join("markers.csv")),
        };
        let found = measured(folder, verb, size);
        let unit = if verb.input == Input::Recording {
            "min"
        } else {
            "MB"
        };
        println!(
            "| `{}` | {} | {:.1} {unit} | {:.0} MB | {:.1} s |",
            verb.name(),
            verb.stated(),
            found.size,
            found.memory,
            found.seconds
        );
        if found.memory > verb.bound(found.size) || found.memory < 1.0 {
            faults.push(format!("{}: {:.0} MB", verb.name(), found.memory));
        }
        let row = format!("| `{}` | {} |", verb.name(), verb.stated());
        if !page.contains(&row) {
            faults.push(format!("docs/security.md lacks the row {row}"));
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

fn megabytes(path: &Path) -> f64 {
    std::fs::metadata(path).expect("a file").len() as f64 / 1e6
}
