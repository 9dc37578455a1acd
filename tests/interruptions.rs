//! Runs that are killed, that compete for an output, and that find no room: nothing partial, no orphan, inputs intact.

#![cfg(unix)]
#![expect(clippy::expect_used, reason = "tests may panic: that is how they fail")]

#[path = "interruptions/fly.rs"]
mod fly;
#[path = "interruptions/unit_log.rs"]
mod unit_log;
#[path = "interruptions/verbs.rs"]
mod verbs;

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use bodyflight_core::link::fault::Random;
use bodyflight_tests::text_inputs::{MAPPING, markers, track};

use verbs::{VERBS, Verb};

const PROGRAM: &str = env!("CARGO_BIN_EXE_bodyflight");

/// Kills of each verb; `BODYFLIGHT_KILLS=200` makes the table of docs/security.md.
const KILLS: u32 = 2;

fn kills() -> u32 {
    let given = std::env::var("BODYFLIGHT_KILLS").ok();
    given.map_or(KILLS, |given| given.parse().expect("a number"))
}

/// A run that goes on, and the first line that it says; none if it was killed before.
fn goes_on(folder: &Path, arguments: &[&str]) -> (Child, String) {
    let mut child = Command::new(PROGRAM)
        .args(arguments)
        .current_dir(folder)
        .stdout(Stdio::piped())
        .spawn()
        .expect("the binary starts");
    let mut first = String::new();
    let said = child.stdout.take().expect("it is piped");
    BufReader::new(said)
        .read_line(&mut first)
        .expect("a line or the end");
    (child, first.trim().to_owned())
}

fn end(mut child: Child) {
    child.kill().expect("it can be killed");
    child.wait().expect("it ends");
}

/// Everything in a folder by its name there.
type Content = BTreeMap<PathBuf, Vec<u8>>;

fn content(folder: &Path) -> Content {
    let mut found = Content::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(&next).expect("a folder").flatten() {
            let path = entry.path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let name = path.strip_prefix(folder).expect("below").to_path_buf();
                found.insert(name, std::fs::read(&path).expect("a file"));
            }
        }
    }
    found
}

fn start(folder: &Path, arguments: &[&str]) -> Child {
    Command::new(PROGRAM)
        .args(arguments)
        .current_dir(folder)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("the binary starts")
}

/// Runs to the end; 0 and the codes of an answer that is doubted or negative are ends.
fn run(folder: &Path, arguments: &[&str]) {
    let code = start(folder, arguments).wait().expect("it ends").code();
    assert!(matches!(code, Some(0 | 4 | 5)), "{arguments:?}: {code:?}");
}

/// A track of a jump as a logger writes it, and markers of a body that swings its limbs.
fn written(folder: &Path) {
    run(folder, &["hide", "clean", "--duration", "4", "--out", "."]);
    for (name, text) in [
        ("track.csv", track(300)),
        ("swing.csv", markers(400)),
        ("points.toml", MAPPING.to_owned()),
    ] {
        std::fs::write(folder.join(name), text).expect("written");
    }
}

fn copied(from: &Content, folder: &Path) {
    for (name, bytes) in from {
        let path = folder.join(name);
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("created");
        std::fs::write(path, bytes).expect("written");
    }
}

/// Beginning of temporary names.
const TEMPORARY: &str = ".bodyflight-";

/// Kills a verb at random moments, with and without results of an earlier run in place. Returns how often no output, a
/// part of the outputs, and all outputs were there, and the number of orphans: only a file that replaces another may be
/// caught between its two system calls.
fn killed(verb: &Verb, inputs: &Content, kills: u32, random: &mut Random) -> [u32; 4] {
    let place = tempfile::tempdir().expect("a folder");
    copied(inputs, place.path());
    let begin = Instant::now();
    run(place.path(), verb.arguments);
    let duration = begin.elapsed();
    let whole = content(place.path());
    let outputs: Vec<_> = whole
        .keys()
        .filter(|name| !inputs.contains_key(*name))
        .collect();
    assert!(!outputs.is_empty(), "{}", verb.name);
    let mut counts = [0; 4];
    for kill in 0..kills {
        let place = tempfile::tempdir().expect("a folder");
        copied(inputs, place.path());
        let is_there = kill % 2 == 1;
        if is_there {
            for name in &outputs {
                let path = place.path().join(name);
                std::fs::create_dir_all(path.parent().expect("a folder")).expect("created");
                std::fs::write(path, "of an earlier run").expect("written");
            }
        }
        let mut child = start(place.path(), verb.arguments);
        let share = f64::from(u32::try_from(random.below(1100)).expect("small")) / 1000.0;
        std::thread::sleep(duration.mul_f64(share));
        child.kill().expect("it can be killed");
        child.wait().expect("it ends");
        let after = content(place.path());
        let mut finished = 0;
        for (name, bytes) in &after {
            if is_there && name.to_string_lossy().contains(TEMPORARY) {
                counts[3] += 1;
                continue;
            }
            let is_whole = whole.get(name) == Some(bytes);
            let is_earlier = is_there && bytes == b"of an earlier run";
            assert!(
                is_whole || is_earlier,
                "{}, killed after {:.0} % of its time: {} has {} bytes",
                verb.name,
                100.0 * share,
                name.display(),
                bytes.len()
            );
            finished += usize::from(is_whole && !inputs.contains_key(name));
        }
        assert!(inputs.keys().all(|name| after.contains_key(name)));
        // A flight's files belong together: the one that names the others is written last.
        let is_complete = |name: &Path| after.get(name) == whole.get(name);
        let flights = outputs.iter().filter(|name| name.ends_with("flight.toml"));
        for flight in flights.filter(|name| is_complete(name)) {
            let own = outputs
                .iter()
                .filter(|name| name.parent() == flight.parent());
            assert!(
                own.into_iter().all(|name| is_complete(name)),
                "{}",
                verb.name
            );
        }
        let state = match finished {
            0 => 0,
            some if some < outputs.len() => 1,
            _ => 2,
        };
        counts[state] += 1;
    }
    counts
}

#[test]
fn a_killed_run_leaves_nothing_partial_and_no_orphan() {
    let kills = kills();
    let place = tempfile::tempdir().expect("a folder");
    written(place.path());
    let inputs = content(place.path());
    let mut random = Random::new(5);
    let mut caught = 0;
    println!(
        "| verb | kills | no output | some of its files | all | orphans |\n|---|---|---|---|---|---|"
    );
    for verb in &VERBS {
        let [none, some, all, orphans] = killed(verb, &inputs, kills, &mut random);
        println!(
            "| `{}` | {kills} | {none} | {some} | {all} | {orphans} |",
            verb.name
        );
        caught += orphans;
    }
    // By chance alone: a busy disk makes the gap between the two calls long.
    assert!(caught <= 1 + kills / 10, "{caught} orphans");
}

#[test]
fn two_runs_that_write_one_file_leave_that_of_one() {
    let place = tempfile::tempdir().expect("a folder");
    written(place.path());
    for (verb, other) in [
        (&VERBS[0], "flight-1/flight.toml"),
        (&VERBS[6], "flight-1/flight.toml"),
    ] {
        let mut others = verb.arguments.to_vec();
        others[1] = other;
        let [one, two] = [verb.arguments, &others].map(|arguments| {
            run(place.path(), arguments);
            content(place.path())
        });
        for _ in 0..3 {
            let runs = [verb.arguments, &others].map(|arguments| start(place.path(), arguments));
            for mut run in runs {
                run.wait().expect("it ends");
            }
            let after = content(place.path());
            assert_eq!(after.len(), one.len(), "{}: an orphan", verb.name);
            for (name, bytes) in &after {
                let is_whole = one.get(name) == Some(bytes) || two.get(name) == Some(bytes);
                assert!(is_whole, "{}: {}", verb.name, name.display());
            }
        }
    }
}

/// A limit on the size of files stands for a full disk: the system refuses to write on.
#[test]
fn without_room_nothing_is_left_and_the_file_is_named() {
    let place = tempfile::tempdir().expect("a folder");
    written(place.path());
    let inputs = content(place.path());
    // The coefficients of `tune` need less room.
    for verb in VERBS.iter().filter(|verb| verb.name != "tune") {
        let place = tempfile::tempdir().expect("a folder");
        copied(&inputs, place.path());
        // In blocks of 512 bytes. Without the signal, writing fails.
        let script = "trap '' XFSZ; ulimit -f 4; exec \"$0\" \"$@\"";
        let output = Command::new("sh")
            .args(["-c", script, PROGRAM])
            .args(verb.arguments)
            .current_dir(place.path())
            .output()
            .expect("a shell");
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(3), "{}: {message}", verb.name);
        assert!(
            message.contains("cannot write this file"),
            "{}: {message}",
            verb.name
        );
        let after = content(place.path());
        let partial: Vec<_> = after
            .iter()
            .filter(|(name, bytes)| inputs.get(*name) != Some(bytes) && bytes.len() >= 2048)
            .collect();
        assert!(partial.is_empty(), "{}: {partial:?}", verb.name);
        assert!(
            inputs
                .iter()
                .all(|(name, bytes)| after.get(name) == Some(bytes))
        );
        assert!(
            !after
                .keys()
                .any(|name| name.to_string_lossy().contains(TEMPORARY))
        );
    }
}

/// A folder without permission to write, unless the user may do anything.
#[test]
fn where_nothing_may_be_written_the_file_is_named_at_once() {
    use std::os::unix::fs::PermissionsExt;
    let place = tempfile::tempdir().expect("a folder");
    written(place.path());
    let locked = place.path().join("locked");
    std::fs::create_dir(&locked).expect("created");
    let mode = |mode| std::fs::set_permissions(&locked, PermissionsExt::from_mode(mode));
    mode(0o555).expect("set");
    if std::fs::write(locked.join("probe"), "").is_ok() {
        // The superuser writes everywhere; /proc takes no files from anybody.
        std::fs::remove_dir_all(&locked).expect("removed");
        std::os::unix::fs::symlink("/proc", &locked).expect("a link");
    }
    for arguments in [
        &["simulate", "flight-0/flight.toml", "--out", "locked/a.csv"][..],
        &["estimate", "flight-0/flight.toml", "--out", "locked/a.csv"],
        &["export", "flight-0/flight.toml", "--out", "locked/a.csv"],
        &["view", "flight-0/flight.toml", "--out", "locked/a.html"],
        &["fall", "track.csv", "--plot", "locked/a.svg"],
        &[
            "import",
            "swing.csv",
            "--mapping",
            "points.toml",
            "--out",
            "locked/b",
        ],
        &["synth", "rotations", "--out", "locked/b"],
    ] {
        let begin = Instant::now();
        let output = Command::new(PROGRAM)
            .args(arguments)
            .current_dir(place.path())
            .output()
            .expect("the binary starts");
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(3), "{arguments:?}: {message}");
        assert!(message.contains("locked"), "{arguments:?}: {message}");
        assert!(begin.elapsed() < Duration::from_secs(20));
    }
    if !locked.is_symlink() {
        mode(0o755).expect("set");
    }
}
