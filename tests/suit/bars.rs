//! What is stated of errors, against the errors: the tables of docs/suit.md.

use bodyflight_core::suit::placement::of_size;

use super::{flown, followed, root};

/// Direction of all limbs and of those with a sensor (degrees), and stated deviations as a share of the actual ones, over
/// flights of three seeds.
fn measured(name: &str, count: usize) -> [f64; 3] {
    let (mut directions, mut seen) = (Vec::new(), Vec::new());
    let (mut actual, mut stated) = (Vec::new(), Vec::new());
    for seed in 1..=3 {
        let (_, found) = followed(&flown(name, seed), count, seed, None);
        directions.push(found.direction);
        seen.push(found.measured);
        for segment in of_size(count).expect("a set").iter().skip(1) {
            actual.push(found.actual[segment]);
            stated.push(found.stated[segment]);
        }
    }
    let ratio = root(stated.into_iter()) / root(actual.into_iter());
    [root(directions.into_iter()), root(seen.into_iter()), ratio]
}

/// Recomputes the table of docs/suit.md.
#[test]
#[ignore = "takes minutes; run it after a change of the suit, and copy what it prints"]
fn the_table_of_the_documentation_is_as_measured() {
    let mut table = String::new();
    for name in [
        "rotations",
        "transitions",
        "exit-and-tracking",
        "aggressive-turns",
        "layouts",
        "back-loop",
    ] {
        table += &format!("| {name} |");
        for count in [16, 13, 10, 8, 5] {
            let [all, seen, ratio] = measured(name, count);
            table += &format!(" {all:.0}, {seen:.0}, {ratio:.1} |");
        }
        table += "\n";
    }
    let docs = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/suit.md"));
    assert!(
        docs.expect("the page").contains(&table),
        "measured:\n{table}"
    );
}
