//! A unit that is killed while it writes its log: what is read back afterwards is whole up to the cut.

use std::path::Path;
use std::process::Child;
use std::time::{Duration, Instant};

use bodyflight_core::link::fault::Random;

use super::{end, goes_on, kills, run, start};

/// Size of the file that acts as the unit's memory (bytes).
const MEMORY: u64 = 3 << 20;

/// A unit with its log in `flash`, and its port; no port if it was killed before it had one.
fn unit(folder: &Path) -> (Child, String) {
    goes_on(folder, &["unit", "--flash", "flash"])
}

/// What is read back: the lines of the recording's frames, those of the estimates, and whether blocks are damaged.
struct Log {
    frames: Vec<String>,
    estimates: Vec<String>,
    is_damaged: bool,
}

fn log(folder: &Path) -> Log {
    let arguments = ["unit", "log", "--flash", "flash", "--out", "log", "--force"];
    let code = start(folder, &arguments).wait().expect("it ends").code();
    assert!(matches!(code, Some(0 | 4)), "{code:?}");
    let lines = |name: &str| {
        let text = std::fs::read_to_string(folder.join("log/1").join(name)).unwrap_or_default();
        text.lines().map(str::to_owned).collect::<Vec<_>>()
    };
    let recording = lines("flight.mvnx");
    let normal = recording
        .iter()
        .position(|line| line.contains("\"normal\""));
    let frames = recording.into_iter().skip(normal.unwrap_or(usize::MAX));
    let estimates = lines("estimates.csv");
    assert!(!folder.join("log/2").exists(), "there was one flight");
    // The flags say whether the unit was in time, which depends on what else runs on the machine.
    let without_flags = |line: &String| {
        let mut cells: Vec<&str> = line.split(',').collect();
        cells.remove(1);
        cells.join(",")
    };
    Log {
        frames: frames
            .filter(|line| line.contains("<orientation>"))
            .collect(),
        estimates: estimates.iter().skip(1).map(without_flags).collect(),
        is_damaged: code == Some(4),
    }
}

/// The orientations and estimates of a cut log are the first of the whole one, to the last digit.
fn is_beginning(part: &[String], whole: &[String]) -> bool {
    part.len() <= whole.len() && part == &whole[..part.len()]
}

#[test]
fn a_killed_unit_leaves_a_log_that_is_whole_up_to_the_cut() {
    let kills = kills();
    let place = tempfile::tempdir().expect("a folder");
    let folder = place.path();
    run(folder, &["hide", "clean", "--duration", "4", "--out", "."]);
    let fly = |port: &str| {
        let arguments = [
            "stream",
            "flight-0/flight.toml",
            "--port",
            port,
            "--speed",
            "max",
        ];
        start(folder, &arguments)
    };
    let begin = Instant::now();
    let (child, port) = unit(folder);
    fly(&port).wait().expect("it ends");
    let duration = begin.elapsed();
    end(child);
    let whole = log(folder);
    assert!(whole.frames.len() > 900 && whole.estimates.len() > 200);
    let mut random = Random::new(9);
    let mut counts = [0; 4];
    for _ in 0..kills {
        for name in ["flash", "log"] {
            let path = folder.join(name);
            let removed = if path.is_dir() {
                std::fs::remove_dir_all(path)
            } else {
                std::fs::remove_file(path)
            };
            assert!(removed.is_ok() || name == "log");
        }
        let share = f64::from(u32::try_from(random.below(1000)).expect("small")) / 1000.0;
        let cut = Instant::now() + duration.mul_f64(share);
        let (child, port) = unit(folder);
        let stream = fly(&port);
        std::thread::sleep(cut.saturating_duration_since(Instant::now()));
        end(child);
        end(stream);
        let size = std::fs::metadata(folder.join("flash"))
            .expect("the memory")
            .len();
        assert_eq!(size, MEMORY);
        let found = log(folder);
        assert!(
            is_beginning(&found.frames, &whole.frames)
                && is_beginning(&found.estimates, &whole.estimates),
            "killed after {:.0} % of its time: {} frames and {} estimates",
            100.0 * share,
            found.frames.len(),
            found.estimates.len()
        );
        let state = match found.frames.len() {
            0 => 0,
            some if some < whole.frames.len() => 1,
            _ => 2,
        };
        counts[state] += 1;
        counts[3] += u32::from(found.is_damaged);
    }
    let [none, part, all, damaged] = counts;
    println!("| `unit` | {kills} | {none} | {part} | {all} | {damaged} damaged |");
}

/// A unit that is killed while it creates its memory leaves none that a later one refuses.
#[test]
fn a_unit_killed_at_its_start_can_be_started_again() {
    let place = tempfile::tempdir().expect("a folder");
    for wait in 0..12 {
        let child = start(place.path(), &["unit", "--flash", "flash"]);
        std::thread::sleep(Duration::from_millis(2 * wait));
        end(child);
        let flash = place.path().join("flash");
        if let Ok(found) = std::fs::metadata(&flash) {
            assert_eq!(found.len(), MEMORY, "killed after {} ms", 2 * wait);
            std::fs::remove_file(&flash).expect("removed");
        }
    }
}
