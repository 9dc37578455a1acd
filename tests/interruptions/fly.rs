//! Saves of `fly` that are killed: whoever looks sees whole flights only, and the next start leaves no more than these.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use bodyflight_core::link::fault::Random;
use bodyflight_tests::text_inputs::flown;

use super::{KILLS, PROGRAM, TEMPORARY, content, run, start};

/// Frames of a flight of ten seconds.
const FRAMES: usize = 2400;

/// Starts `fly` until its page is there.
fn started(folder: &Path) {
    let mut fly = Command::new(PROGRAM)
        .args(["fly", "--save", "flights"])
        .current_dir(folder)
        .stdout(Stdio::piped())
        .spawn()
        .expect("the binary starts");
    let mut first = String::new();
    let said = fly.stdout.take().expect("it is piped");
    BufReader::new(said)
        .read_line(&mut first)
        .expect("an address");
    assert!(first.contains("fly at"), "{first}");
    fly.kill().expect("it can be killed");
    fly.wait().expect("it ends");
}

fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let names = entries.map(|entry| entry.file_name().to_string_lossy().into_owned());
    names.collect()
}

#[test]
fn a_killed_save_leaves_whole_flights_and_nothing_after_the_next_start() {
    let kills =
        std::env::var("BODYFLIGHT_KILLS").map_or(KILLS, |text| text.parse().expect("a number"));
    let place = tempfile::tempdir().expect("a folder");
    std::fs::write(place.path().join("flown.csv"), flown(FRAMES)).expect("written");
    let flights = place.path().join("flights");
    let arguments = ["fly", "--from", "flown.csv", "--save", "flights"];
    let begin = Instant::now();
    run(place.path(), &arguments);
    let duration = begin.elapsed();
    let whole = content(&flights.join("flown-0"));
    let (mut caught, mut random) = (0, Random::new(3));
    // At random moments, and one while the folder is there for certain.
    for kill in 0..=kills {
        let before = names(&flights).len();
        let mut child = start(place.path(), &arguments);
        if kill == 0 {
            let end = Instant::now() + Duration::from_secs(20);
            while !names(&flights)
                .iter()
                .any(|name| name.starts_with(TEMPORARY))
            {
                assert!(Instant::now() < end, "no save began");
            }
        } else {
            let share = f64::from(u32::try_from(random.below(1100)).expect("small")) / 1000.0;
            std::thread::sleep(duration.mul_f64(share));
        }
        child.kill().expect("it can be killed");
        child.wait().expect("it ends");
        let found = names(&flights);
        let (hidden, seen): (Vec<_>, Vec<_>) =
            found.iter().partition(|name| name.starts_with(TEMPORARY));
        assert!(seen.len() + hidden.len() <= before + 1);
        for flight in &seen {
            assert_eq!(content(&flights.join(flight)), whole, "{flight}");
        }
        caught += hidden.len();
        started(place.path());
        let left = names(&flights);
        assert!(
            left.iter().all(|name| !name.starts_with(TEMPORARY)),
            "{left:?}"
        );
        assert_eq!(left.len(), seen.len());
    }
    println!("| `fly` | {kills} kills and one in the act | {caught} unfinished, all swept |");
    assert!(caught > 0);
}

/// What another process still writes is none of ours.
#[test]
fn the_save_of_another_process_is_not_swept() {
    let place = tempfile::tempdir().expect("a folder");
    std::fs::write(place.path().join("flown.csv"), flown(FRAMES)).expect("written");
    let arguments = ["fly", "--from", "flown.csv", "--save", "flights"];
    let mut runs: Vec<_> = (0..4).map(|_| start(place.path(), &arguments)).collect();
    started(place.path());
    let ended = runs.iter_mut().filter_map(|run| run.wait().ok()?.code());
    let ended: Vec<i32> = ended.collect();
    let found = names(&place.path().join("flights"));
    let done = ended.iter().filter(|code| **code == 0).count();
    assert_eq!(found.len(), done, "{found:?}");
    assert!(
        done > 0 && ended.iter().all(|code| [0, 2].contains(code)),
        "{ended:?}"
    );
}
