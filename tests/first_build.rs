//! The program of the README's first command: complete in what it promises, and honest about what it leaves out.

use std::fs;

use bodyflight_tests::program::{Program, plain, text};

const PROGRAM: Program = Program(env!("CARGO_BIN_EXE_bodyflight"));

/// All of the paper's experiments in one run, with every worker busy.
#[test]
fn the_paper_is_reproduced_whole() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("reproduction");
    let output = PROGRAM.run(&["reproduce", "--out", plain(&out)]);
    assert!(
        output.status.success(),
        "{}: {}",
        output.status,
        text(&output.stderr)
    );
    let report = fs::read_to_string(out.join("report.md")).expect("the report");
    let pictures = fs::read_dir(&out).expect("the folder").flatten();
    let pictures =
        pictures.filter(|entry| entry.path().extension().is_some_and(|end| end == "svg"));
    assert!(pictures.count() >= 15, "{report}");
}

#[test]
fn the_page_is_in_the_program() {
    let folder = tempfile::tempdir().expect("a folder");
    let flight = folder.path().join("t");
    PROGRAM.json(&["synth", "neutral-fall", "--out", plain(&flight)]);
    let page = folder.path().join("t.html");
    let flight = flight.join("flight.toml");
    PROGRAM.json(&["view", plain(&flight), "--out", plain(&page)]);
    let html = fs::read_to_string(&page).expect("the page");
    assert!(html.contains("bodyflight-data") && html.len() > 500_000);
}

#[cfg(not(feature = "full"))]
#[test]
fn what_is_left_out_is_said_with_the_command_that_adds_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let flight = folder.path().join("t");
    PROGRAM.json(&["synth", "neutral-fall", "--out", plain(&flight)]);
    let flight = plain(&flight.join("flight.toml")).to_owned();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let elf = at("unit.elf");
    fs::write(&elf, b"").expect("a file");
    // A flat image begins with its stack and its first instruction.
    let image = at("unit.bin");
    let words = [0x1001_0000_u32, 0x0800_0189].map(u32::to_le_bytes);
    fs::write(&image, [&words.concat()[..], &[0; 1016]].concat()).expect("a file");
    for words in [
        vec!["export", &flight, "--out", &at("t.parquet")],
        vec!["export", &flight, "--out", &at("t.mcap")],
        vec!["export", &flight, "--out", &at("t.npz")],
        vec!["simulate", &flight, "--plot", &at("t.pdf")],
        vec!["simulate", &flight, "--plot", &at("t.png")],
        vec![
            "reproduce",
            "layouts",
            "--format",
            "pdf",
            "--out",
            &at("report"),
        ],
        vec!["monitor", "--defmt", &elf],
        vec!["unit", "flash", &image, "--key", &elf],
        vec!["completions", "bash"],
        vec!["man", "--out", &at("man")],
        vec!["fmu", &flight, "--library", &elf, "--out", &at("t.fmu")],
    ] {
        let said = PROGRAM.fails(&words, 2);
        assert!(said.contains("--features full"), "{words:?}: {said}");
    }
    PROGRAM.json(&["export", &flight, "--out", &at("t.csv")]);
}
