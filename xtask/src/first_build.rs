//! `cargo xtask first-build`: what the README's first command compiles, compared with its budget.
//!
//! Times differ between machines, so the program's is stated as a multiple of the core's, which is built just before
//! it. Crates that are compiled at once slow each other down where processors share a core; the budget has room for that,
//! since building one by one would take a minute and a half longer in every test run.

use std::collections::BTreeSet;
use std::process::Command;

use crate::budgets::{Budgets, FirstBuild};
use crate::run::{PROGRAM, Result, cargo, root, say, target_folder};

/// Counts the crates, and measures the processor time unless the program is built already.
pub(crate) fn first_build() -> Result<()> {
    count_crates()?;
    let budget = Budgets::read()?.first_build;
    if target_folder()?.join(PROGRAM).exists() {
        say("the program is built already, so its processor time is not measured");
        return Ok(());
    }
    measure(&budget)
}

/// Compares the number of crates with its budget, which takes a second.
pub(crate) fn count_crates() -> Result<()> {
    let (crates, allowed) = (crates()?, Budgets::read()?.first_build.crates);
    say(&format!("first build: {crates} crates of {allowed}"));
    if crates > allowed {
        return Err(format!(
            "the program needs {crates} crates, budgets.toml allows {allowed}"
        ));
    }
    Ok(())
}

fn measure(budget: &FirstBuild) -> Result<()> {
    let release = ["build", "--locked", "--release", "--package"];
    let build = |package| -> Result<f64> {
        let before = children_time()?;
        cargo(&[&release[..], &[package]].concat())?;
        Ok(children_time()? - before)
    };
    let core = build("bodyflight-core")?;
    let times = (core + build("bodyflight")?) / core;
    say(&format!(
        "first build: {times:.1} times the processor time of the core, of {}",
        budget.times_the_core
    ));
    if times > budget.times_the_core {
        return Err("the first build takes longer than budgets.toml allows".into());
    }
    Ok(())
}

/// Number of different crates that the program consists of or is built with.
fn crates() -> Result<usize> {
    let tree = "tree --locked --package bodyflight --edges normal,build --prefix none --no-dedupe";
    let output = Command::new("cargo")
        .args(tree.split(' '))
        .current_dir(root())
        .output()
        .map_err(|error| format!("cargo tree: {error}"))?;
    if !output.status.success() {
        return Err(String::from_utf8_lossy(&output.stderr).into_owned());
    }
    let text = String::from_utf8_lossy(&output.stdout);
    // A line is a name, a version, and perhaps a folder or "(proc-macro)".
    let package = |line: &str| -> String {
        let words: Vec<&str> = line.split_whitespace().take(2).collect();
        words.join(" ")
    };
    Ok(text.lines().map(package).collect::<BTreeSet<_>>().len())
}

/// Processor time of this program's children that have ended (clock ticks), from Linux's `/proc`.
fn children_time() -> Result<f64> {
    let path = "/proc/self/stat";
    let text = std::fs::read_to_string(path).map_err(|error| format!("{path}: {error}"))?;
    // The name of the program, in parentheses, may contain spaces; times of children are fields 16 and 17.
    let fields = text.rsplit(')').next().unwrap_or_default();
    let times = fields.split_whitespace().skip(13).take(2);
    let times: Vec<f64> = times.filter_map(|field| field.parse().ok()).collect();
    match times[..] {
        [user, system] => Ok(user + system),
        _ => Err(format!("{path} has no times of children")),
    }
}
