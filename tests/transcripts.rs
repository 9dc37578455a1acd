//! What the documentation shows is what the program does: transcripts in the pages, examples in each `--help`.
#![expect(clippy::expect_used, reason = "tests may panic: that is how they fail")]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// The program.
const BODYFLIGHT: &str = env!("CARGO_BIN_EXE_bodyflight");

/// Verbs whose examples need a person, a browser, hardware, a track, another system's file or minutes.
const NOT_RUN: [&str; 13] = [
    "discover",
    "fall",
    "fly",
    "help",
    "import",
    "monitor",
    "mvn",
    "reproduce",
    "sensitivity",
    "stream",
    "tune",
    "unit",
    "view",
];

fn bodyflight(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(BODYFLIGHT)
        .args(arguments)
        .current_dir(folder)
        .output()
        .expect("the binary starts")
}

fn text_of(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// Pages with transcripts, in folders of their own: README.md and docs/*.md.
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
fn transcripts_of_the_documentation_are_true() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut transcripts = 0;
    for path in pages() {
        let page = fs::read_to_string(&path).expect("readable");
        transcripts += page.matches("```console").count();
        let copy = folder.path().join(path.file_name().expect("a name"));
        // What the program prints is compared with slashes for backslashes.
        fs::write(&copy, page.replace('\\', "/")).expect("written");
        // Commands run beside what the page describes.
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
}

/// Lines of a help that begin with a command of this program.
fn examples(help: &str) -> Vec<Vec<&str>> {
    let (_, rest) = help.split_once("Example").unwrap_or_default();
    rest.lines()
        .filter_map(|line| {
            line.trim_start_matches([':', ' '])
                .strip_prefix("bodyflight ")
        })
        .map(|command| command.split_whitespace().collect())
        .collect()
}

#[test]
fn the_examples_of_the_help_work() {
    let folder = tempfile::tempdir().expect("a folder");
    let place = folder.path();
    let made = bodyflight(place, &["synth", "rotations", "--seed", "1", "--out", "."]);
    assert!(made.status.success(), "{made:?}");
    let help = text_of(&bodyflight(place, &["--help"]));
    let (_, verbs) = help.split_once("Commands:").expect("verbs");
    // Further lines of a description stand further in.
    let verbs = (verbs.lines().skip(1))
        .take_while(|line| !line.is_empty())
        .filter_map(|line| line.strip_prefix("  "))
        .filter_map(|line| line.split(' ').next().filter(|verb| !verb.is_empty()));
    let mut run = 0;
    for verb in verbs {
        let help = text_of(&bodyflight(place, &[verb, "--help"]));
        let examples = examples(&help);
        assert!(
            verb == "help" || !examples.is_empty(),
            "{verb} --help has no example"
        );
        if NOT_RUN.contains(&verb) {
            continue;
        }
        for example in examples {
            let output = bodyflight(place, &example);
            assert!(output.status.success(), "{example:?}: {output:?}");
            run += 1;
        }
    }
    assert!(run >= 9, "only {run} examples were run");
}
