//! Replays the corpora of `fuzz/` on stable, with small changes to each entry.

use std::path::PathBuf;
use std::time::Instant;

use bodyflight_core::link::fault::Random;
use bodyflight_tests::fuzz_targets::TARGETS;

/// Number of changed copies of each entry.
const CHANGED: usize = 24;

fn corpus(target: &str) -> Vec<(PathBuf, Vec<u8>)> {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("../fuzz/corpus")
        .join(target);
    let entries =
        std::fs::read_dir(&folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
    let mut files: Vec<PathBuf> = entries
        .map(|entry| entry.expect("an entry").path())
        .collect();
    files.sort();
    files
        .into_iter()
        .map(|path| {
            let bytes = std::fs::read(&path).expect("an entry");
            (path, bytes)
        })
        .collect()
}

/// A copy with a few bytes changed, removed or inserted.
fn changed(bytes: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for _ in 0..=random.below(4) {
        let place = random.below(bytes.len() + 1);
        let [value, ..] = random.bits().to_le_bytes();
        match random.below(4) {
            0 => bytes.insert(place, value),
            1 if place < bytes.len() => drop(bytes.remove(place)),
            2 => bytes.truncate(place),
            _ if place < bytes.len() => bytes[place] ^= 1 << (value & 7),
            _ => {}
        }
    }
    bytes
}

/// Runs a target on `bytes`; on failure, reports the entry.
fn run(target: fn(&[u8]), bytes: &[u8], what: &str) {
    let outcome = std::panic::catch_unwind(|| target(bytes));
    assert!(
        outcome.is_ok(),
        "{what}: {:?}",
        String::from_utf8_lossy(bytes)
    );
}

#[test]
fn entries_find_nothing() {
    for (name, target) in TARGETS {
        let entries = corpus(name);
        assert!(entries.len() >= 5, "{name}: {} entries", entries.len());
        let size: usize = entries.iter().map(|(_, bytes)| bytes.len()).sum();
        assert!(
            size <= 512 << 10,
            "{name}: {size} bytes is too large a corpus"
        );
        for (path, bytes) in entries {
            run(target, &bytes, &path.display().to_string());
        }
    }
}

#[test]
fn changed_entries_find_nothing() {
    let mut random = Random::new(21);
    for (name, target) in TARGETS {
        let entries = corpus(name);
        let (begin, count) = (Instant::now(), entries.len() * CHANGED);
        for (path, bytes) in entries {
            for _ in 0..CHANGED {
                let bytes = changed(&bytes, &mut random);
                run(target, &bytes, &format!("{} changed", path.display()));
            }
        }
        let rate = count as f64 / begin.elapsed().as_secs_f64();
        println!("{name}: {count} inputs, {rate:.0} a second");
    }
}

#[test]
fn every_target_has_its_program() {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../fuzz");
    let manifest = std::fs::read_to_string(folder.join("Cargo.toml")).expect("the manifest");
    for (name, _) in TARGETS {
        let program = format!("fuzz_targets/{name}.rs");
        assert!(manifest.contains(&program), "{program}");
        let text = std::fs::read_to_string(folder.join(&program)).expect("a program");
        assert!(text.contains(&format!("run(\"{name}\", bytes)")), "{text}");
    }
}
