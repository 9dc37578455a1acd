//! The program behaves as documented: transcripts in the pages, examples in each `--help`.
#![expect(clippy::expect_used, reason = "tests may panic: that is how they fail")]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use bodyflight_shared_data::{LEFT_OUT, listed};
use bodyflight_tests::program::{ctrl_c, text};

#[path = "transcripts/files.rs"]
mod files;

use files::{BODYFLIGHT, bodyflight, copied, prepared};

/// Documented commands with one of these words use the port of MVN or SlimeVR, so only one of them runs at a time.
const WITH_PORT: [&str; 3] = ["mvn", "--mvn", "slimevr"];
static PORT: Mutex<()> = Mutex::new(());

/// Commands that run at once in each test: some fly in real time, and wait more than they compute.
const AT_ONCE: usize = 2;

fn text_of(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// Pages that may contain transcripts: README.md and docs/*.md.
fn pages() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let docs = fs::read_dir(root.join("docs")).expect("docs").flatten();
    let paths = docs
        .map(|entry| entry.path())
        .chain([root.join("README.md")]);
    paths
        .filter(|path| path.extension().is_some_and(|extension| extension == "md"))
        .collect()
}

/// The first block of TOML on a page.
fn toml_block(page: &str) -> Option<&str> {
    let (_, rest) = page.split_once("```toml\n")?;
    rest.split_once("```").map(|(block, _)| block)
}

#[test]
fn transcripts_in_the_documentation_are_reproduced() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut transcripts = 0;
    for path in pages() {
        let page = fs::read_to_string(&path).expect("readable");
        transcripts += page.matches("```console").count();
        let copy = folder.path().join(path.file_name().expect("a name"));
        // The program's output is compared with backslashes replaced by slashes.
        fs::write(&copy, page.replace('\\', "/")).expect("written");
        // Commands run in a folder with the files that the page describes.
        let place = copy.with_extension("in");
        fs::create_dir(&place).expect("a folder");
        if path.ends_with("subject.md") {
            let subject = toml_block(&page).expect("a subject");
            fs::write(place.join("subject.toml"), subject).expect("written");
        }
    }
    assert!(transcripts > 1, "the pages show what the program prints");
    trycmd::TestCases::new()
        .register_bin("bodyflight", Path::new(BODYFLIGHT))
        .case(folder.path().join("*.md"))
        .run();
    // Roundings of the last digit drawn may differ elsewhere.
    if cfg!(target_os = "linux") {
        assert!(pictures_as_written(folder.path()) > 0);
    }
}

/// Checks that pictures on the pages are those that their transcripts wrote; returns their number.
fn pictures_as_written(folder: &Path) -> usize {
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs");
    let places = fs::read_dir(folder).expect("readable").flatten();
    let places = places.filter(|place| place.path().is_dir());
    let files = places.flat_map(|place| fs::read_dir(place.path()).expect("readable").flatten());
    let mut pictures = 0;
    for file in files.filter(|file| file.path().extension().is_some_and(|end| end == "svg")) {
        let name = file.file_name();
        let shown = fs::read(docs.join(&name)).expect("a picture of the page");
        let written = fs::read(file.path()).expect("readable");
        assert!(shown == written, "docs/{} is out of date", name.display());
        pictures += 1;
    }
    pictures
}

/// Commands of this program in the examples of a help text. Words in brackets after them are remarks; `&&` joins two.
fn examples(help: &str) -> Vec<Vec<String>> {
    let (_, rest) = help.split_once("Example").unwrap_or_default();
    let lines = rest.lines().flat_map(|line| line.split(" && "));
    lines
        .filter_map(|line| {
            let line = line.trim_start_matches(['s', ':', ' ']);
            let (command, _) = line.split_once("   (").unwrap_or((line, ""));
            command.strip_prefix("bodyflight ")
        })
        .map(|command| command.split_whitespace().map(str::to_owned).collect())
        .collect()
}

/// Names of the commands that a help text lists.
fn verbs(help: &str) -> Vec<String> {
    let (_, rest) = help.split_once("Commands:").unwrap_or_default();
    // Continuation lines of a description are indented further.
    let lines = rest.lines().skip(1).take_while(|line| !line.is_empty());
    lines
        .filter_map(|line| line.strip_prefix("  ")?.split(' ').next())
        .filter(|verb| !verb.is_empty() && *verb != "help")
        .map(str::to_owned)
        .collect()
}

/// Runs an example, and returns its exit code and output. Endless ones get Ctrl-C after a while.
fn tried(place: &Path, example: &[String]) -> (Option<i32>, String) {
    // Devices of this machine are hidden, and so are browsers and QEMU.
    let words = example.iter().map(|word| {
        word.replace("/dev/", "absent/")
            .replace("/media/", "absent/")
    });
    let alone = example
        .iter()
        .any(|word| WITH_PORT.contains(&word.as_str()));
    let _alone = alone.then(|| PORT.lock().unwrap_or_else(PoisonError::into_inner));
    let mut child = Command::new(BODYFLIGHT)
        .args(words)
        .current_dir(place)
        .env("PATH", "")
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the binary starts");
    let endless = match example.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["fly", ..] => !example.contains(&"--out".to_owned()),
        ["mvn" | "slimevr", "listen", ..] => true,
        ["stream", ..] => example
            .iter()
            .any(|word| word == "--view" || word == "--mvn"),
        ["unit", ref rest @ ..] => rest.first().is_none_or(|word| word.starts_with('-')),
        _ => false,
    };
    if endless {
        std::thread::sleep(Duration::from_millis(1500));
        if child.try_wait().expect("a state").is_none() {
            ctrl_c(child.id());
        }
    }
    let output = child.wait_with_output().expect("it ends");
    let said = text(&output.stdout) + &text(&output.stderr);
    (output.status.code(), said)
}

/// Whether the light program has run all commands of a block or an example: the full one need not run them again.
fn was_run_before(name: &str) -> bool {
    let list = std::env::var_os(LEFT_OUT).filter(|_| cfg!(feature = "full"));
    let list = list.and_then(|list| fs::read_to_string(list).ok());
    list.is_some_and(|list| !list.lines().any(|line| line == name))
}

/// Runs a documented command of the block or example `name`. Returns what is wrong with its outcome, if anything.
fn complaint(place: &Path, name: &str, example: &[String]) -> Option<String> {
    let begin = Instant::now();
    let (code, said) = tried(place, example);
    let needs_more = example.iter().any(|word| {
        let absent = ["/dev/", "/media/", "unit.", "--qemu"];
        absent.iter().any(|part| word.contains(part))
    });
    let left_out = !cfg!(feature = "full") && said.contains("this program was built without");
    if left_out {
        listed(LEFT_OUT, name).expect("written");
    }
    let not_built = left_out || said.contains("the unit's library");
    let is_well = match code {
        // Success, or a negative result.
        Some(0 | 4 | 5) => true,
        Some(3) => needs_more,
        Some(2) => not_built,
        Some(130) => true,
        _ => false,
    };
    println!(
        "{:.1} s: {example:?}, {code:?}",
        begin.elapsed().as_secs_f64()
    );
    (!is_well || said.contains("panicked"))
        .then(|| format!("{example:?} ended with {code:?}: {said}"))
}

/// Documented commands that run one after the other in a folder of their own.
struct Commands {
    name: String,
    examples: Vec<Vec<String>>,
}

/// Runs all that were not run before, each in a copy of the folder `base`; returns what is wrong.
fn complaints(folder: &Path, base: &Path, all: Vec<Commands>) -> Vec<String> {
    let left = Mutex::new(all.into_iter().enumerate());
    let wrong = Mutex::new(Vec::new());
    let work = || {
        let next = || left.lock().unwrap_or_else(PoisonError::into_inner).next();
        while let Some((place, Commands { name, examples })) = next() {
            if was_run_before(&name) {
                continue;
            }
            let place = folder.join(place.to_string());
            copied(base, &place);
            for example in examples {
                make_room(&place, &example);
                let found = complaint(&place, &name, &example);
                let mut wrong = wrong.lock().unwrap_or_else(PoisonError::into_inner);
                wrong.extend(found);
            }
            fs::remove_dir_all(&place).expect("removed");
        }
    };
    std::thread::scope(|scope| {
        for _ in 0..AT_ONCE {
            scope.spawn(work);
        }
    });
    wrong.into_inner().unwrap_or_else(PoisonError::into_inner)
}

#[test]
fn the_examples_of_the_help_work() {
    let folder = tempfile::tempdir().expect("a folder");
    let base = folder.path().join("base");
    fs::create_dir(&base).expect("a folder");
    prepared(&base);
    let help = |words: &[&str]| text_of(&bodyflight(&base, &[words, &["--help"]].concat()));
    let mut helps = Vec::new();
    for verb in verbs(&help(&[])) {
        let page = help(&[&verb]);
        for part in verbs(&page) {
            helps.push((format!("{verb} {part}"), help(&[&verb, &part])));
        }
        helps.push((verb, page));
    }
    let mut all = Vec::new();
    for (verb, page) in helps {
        let examples = examples(&page);
        assert!(!examples.is_empty(), "{verb} --help has no example");
        all.extend(examples.into_iter().map(|example| Commands {
            name: example.join(" "),
            examples: vec![example],
        }));
    }
    assert!(all.len() >= 35, "only {} examples were found", all.len());
    let wrong = complaints(folder.path(), &base, all);
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// The commands of this program in each block of shell commands on a page.
fn shell_blocks(page: &str) -> Vec<Vec<Vec<String>>> {
    let blocks = page.split("```sh\n").skip(1);
    let starts = [
        "bodyflight ",
        "target/release/bodyflight ",
        "cargo run --release -- ",
    ];
    let command = |line: &str| -> Option<Vec<String>> {
        let (line, _remark) = line.split_once(" #").unwrap_or((line, ""));
        let rest = starts.iter().find_map(|start| line.strip_prefix(start))?;
        // Only empty words are quoted on these pages.
        Some(
            rest.split_whitespace()
                .map(|word| word.replace('"', ""))
                .collect(),
        )
    };
    blocks
        .filter_map(|block| block.split_once("```"))
        .map(|(block, _)| {
            let block = block.replace("\\\n", " ");
            block.lines().filter_map(command).collect()
        })
        .collect()
}

/// Removes earlier output, since alternative commands on a page write to the same place.
fn make_room(place: &Path, example: &[String]) {
    let out = example.iter().skip_while(|word| *word != "--out").nth(1);
    if let Some(out) = out.map(|out| place.join(out)) {
        let _ = fs::remove_file(&out);
        let _ = fs::remove_dir_all(&out);
    }
}

#[test]
fn the_commands_of_the_pages_work() {
    let folder = tempfile::tempdir().expect("a folder");
    let base = folder.path().join("base");
    fs::create_dir(&base).expect("a folder");
    prepared(&base);
    let acrobatics = Path::new(env!("CARGO_MANIFEST_DIR")).join("../verbs/data/acrobatics");
    copied(&acrobatics, &base.join("acrobatics"));
    let mut all = Vec::new();
    for path in pages() {
        let page = fs::read_to_string(&path).expect("readable");
        for (k, block) in shell_blocks(&page).into_iter().enumerate() {
            // BVH files are tested in tests/imports.
            let elsewhere = |word: &String| word.ends_with(".bvh") || word == "OTHER/TRACK.CSV";
            let mut examples = block;
            examples.retain(|example| !example.iter().any(elsewhere));
            for word in examples.iter_mut().flatten() {
                *word = word.replace("verbs/data/", "");
            }
            let name = format!("{}-{k}", path.file_stem().expect("a name").display());
            all.push(Commands { name, examples });
        }
    }
    let run: usize = all.iter().map(|block| block.examples.len()).sum();
    assert!(run >= 20, "only {run} commands were found");
    let wrong = complaints(folder.path(), &base, all);
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
