//! `cargo xtask fuzz` and `cargo xtask miri`, which need a nightly compiler.

use crate::run::{Result, root, run, run_in, say, target_folder};
use crate::tool::tool;

/// Toolchain of these tasks; the project itself is built with the pinned stable one.
const TOOLCHAIN: &str = "nightly";

/// Memory limit of a fuzz target (MiB), and time limit of one input (s).
const MEMORY_MIB: u32 = 1024;
const SLOWEST_S: u32 = 5;

/// Longest inputs (bytes) of targets that read less of them, or reach the same code in a part of the time with shorter ones.
const LENGTHS: [(&str, u32); 7] = [
    ("csv", 1024),
    ("flysight", 1024),
    ("setup", 256),
    ("jump", 64),
    ("flash", 64),
    ("numbers", 42),
    ("toml", 1024),
];

/// How long to fuzz a target.
#[derive(Clone, Copy)]
pub(crate) enum Effort {
    Seconds(u64),
    Runs(u64),
}

/// Adds to an error that the task needs `what`, and that installing it takes rustup and a network.
fn without(what: &str) -> impl FnOnce(String) -> String {
    let help = format!("this task needs {what}; installing it needs rustup and a network");
    move |error| format!("{error}\n{help}")
}

/// Environment variables that make cargo and its tools use the nightly toolchain.
fn variables() -> Vec<(&'static str, String)> {
    vec![
        ("RUSTUP_TOOLCHAIN", TOOLCHAIN.to_owned()),
        ("CARGO", "cargo".to_owned()),
    ]
}

fn install_toolchain(components: &[&str]) -> Result<()> {
    let mut arguments = vec!["toolchain", "install", TOOLCHAIN, "--profile", "minimal"];
    for component in components {
        arguments.extend(["--component", component]);
    }
    let is_there = run("rustup", &["run", TOOLCHAIN, "rustc", "--version"]).is_ok()
        && components.iter().all(|component| {
            let program = format!("cargo-{component}");
            // Sources are not a program; tools that need them report when they are missing.
            *component == "rust-src"
                || run("rustup", &["which", "--toolchain", TOOLCHAIN, &program]).is_ok()
        });
    if is_there {
        return Ok(());
    }
    run("rustup", &arguments).map_err(without("a nightly toolchain"))
}

/// Fuzzes every target, or those named; inputs that fail are written to `fuzz/artifacts`.
pub(crate) fn fuzz(names: &[String], effort: Effort) -> Result<()> {
    install_toolchain(&[])?;
    let program = tool("cargo-fuzz", "0.13.2", &[], &variables())?
        .display()
        .to_string();
    let known = targets()?;
    if let Some(unknown) = names.iter().find(|name| !known.contains(name)) {
        return Err(format!(
            "unknown target {unknown}; expected one of: {}",
            known.join(", ")
        ));
    }
    let found_before = target_folder()?.join("fuzz-corpus");
    let end = match effort {
        Effort::Seconds(seconds) => format!("-max_total_time={seconds}"),
        Effort::Runs(runs) => format!("-runs={runs}"),
    };
    let limits = [
        format!("-rss_limit_mb={MEMORY_MIB}"),
        format!("-timeout={SLOWEST_S}"),
    ];
    for name in known
        .iter()
        .filter(|name| names.is_empty() || names.contains(name))
    {
        // New entries go to the first folder; the repository's corpora are only read.
        let new = found_before.join(name);
        std::fs::create_dir_all(&new).map_err(|error| format!("{}: {error}", new.display()))?;
        let new = new.display().to_string();
        let kept = root().join("fuzz/corpus").join(name).display().to_string();
        // All code under test is safe, and runs several times faster without a sanitizer.
        let mut arguments = vec!["fuzz", "run", "--sanitizer", "none", name, &new, &kept];
        let longest = LENGTHS.iter().find(|(own, _)| own == name);
        let longest = longest.map(|(_, length)| format!("-max_len={length}"));
        arguments.extend(["--", &end]);
        arguments.extend(longest.as_deref());
        arguments.extend(limits.iter().map(String::as_str));
        arguments.push("-print_final_stats=1");
        run_in(&root(), &program, &arguments, &variables())?;
    }
    say("fuzz: no target found anything");
    Ok(())
}

/// Names of the fuzz targets, which are those of their programs.
fn targets() -> Result<Vec<String>> {
    let folder = root().join("fuzz/fuzz_targets");
    let entries =
        std::fs::read_dir(&folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    let mut names: Vec<String> = entries
        .filter_map(|entry| {
            let path = entry.ok()?.path();
            Some(path.file_stem()?.to_str()?.to_owned())
        })
        .collect();
    names.sort();
    Ok(names)
}

/// Parts of the core to run in miri, and the number of cases for each property: miri is a thousand times slower.
const PARTS: [&str; 7] = [
    "link::",
    "xbus::",
    "effect::",
    "estimator::factor",
    "estimator::coefficients",
    "frame::",
    "math::",
];
const CASES: &str = "4";

/// Exhaustive tests, which would take hours in miri: every length, every damaged bit, flights. Other tests cover the
/// same functions.
const SLOW: [&str; 7] = [
    "neutral_values_keep_every_bit",
    "plausible_effects_leave_a_flight_of_finite_numbers",
    "every_parameter_moves_the_flight",
    "written_packets_of_every_length",
    "a_damaged_block_yields_no_wrong_message",
    "link::tests::damage",
    "link::tests::injected",
];

/// A little-endian and a big-endian target on which `libm` has no assembly, which miri cannot run.
const MACHINES: [&str; 2] = ["riscv64gc-unknown-linux-gnu", "s390x-unknown-linux-gnu"];

/// Runs tests of the core's parsers, algebra and effects in miri, in both byte orders.
pub(crate) fn miri() -> Result<()> {
    install_toolchain(&["miri", "rust-src"])?;
    let mut variables = variables();
    // Property tests need the machine's clock and random seeds.
    variables.push(("MIRIFLAGS", "-Zmiri-disable-isolation".to_owned()));
    variables.push(("PROPTEST_CASES", CASES.to_owned()));
    for machine in MACHINES {
        let mut arguments = vec!["miri", "test", "--package", "bodyflight-core", "--lib"];
        arguments.extend(["--target", machine, "--"]);
        arguments.extend(PARTS);
        arguments.extend(SLOW.into_iter().flat_map(|slow| ["--skip", slow]));
        run_in(&root(), "cargo", &arguments, &variables).map_err(without("miri"))?;
    }
    say("miri: no undefined behaviour in either byte order");
    Ok(())
}
