//! What verbs cost: readers against memory, each verb on one standard input against its limit, and how costs grow. Prints
//! the tables of docs/benchmarks.md.
//!
//! Times are of processors, not of a clock, so that they depend less on what else the machine does. An argument chooses one
//! table: `readers`, `verbs` or `scaling`.
#![expect(clippy::expect_used, reason = "a bench that cannot start should panic")]

#[path = "verbs/cost.rs"]
mod cost;
#[path = "verbs/limits.rs"]
mod limits;
#[path = "verbs/readers.rs"]
mod readers;
#[path = "verbs/scaling.rs"]
mod scaling;
#[path = "verbs/table.rs"]
mod table;

use cost::Program;
use limits::Limits;

fn main() {
    let place = tempfile::tempdir().expect("a folder");
    let program = Program::in_folder(place.path());
    let limits = Limits::measured();
    println!("{limits}\n");
    let chosen = std::env::args().skip(1).find(|word| !word.starts_with('-'));
    let is_asked = |table: &str| chosen.as_deref().is_none_or(|chosen| chosen == table);
    if is_asked("readers") {
        readers::print(place.path(), &limits);
    }
    if is_asked("verbs") {
        table::print(&program, &limits);
    }
    if is_asked("scaling") {
        scaling::print(&program);
    }
}
