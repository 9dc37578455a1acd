//! Saves of `fly` that are killed: whoever looks sees whole flights only, and the next start leaves no more than these.

use std::path::Path;
use std::time::{Duration, Instant};

use bodyflight_core::link::fault::Random;
use bodyflight_tests::text_inputs::flown;

use super::{TEMPORARY, content, end, goes_on, kills, run, start};

/// Frames of a flight of ten seconds.
const FRAMES: usize = 2400;

/// Starts `fly` until its page is there.
fn started(folder: &Path) {
    let (fly, first) = goes_on(folder, &["fly", "--save", "flights"]);
    assert!(first.contains("fly at"), "{first}");
    end(fly);
}

fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let names = entries.map(|entry| entry.file_name().to_string_lossy().into_owned());
    names.collect()
}

#[test]
fn a_killed_save_leaves_whole_flights_and_nothing_after_the_next_start() {
    let kills = kills();
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
        let child = start(place.path(), &arguments);
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
        end(child);
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
