//! How many files one must understand before another: the longest chain of imports in a crate.

use std::collections::BTreeMap;
use std::path::Path;

use crate::tidy::modules::{Crate, Import};

/// Crates of many stages, with the largest number of files in a chain of imports.
const FLOORS: [(&str, usize); 1] = [("discovery/src/lib.rs", 12)];

/// Files that each file imports.
type Imports<'a> = BTreeMap<&'a Path, Vec<&'a Path>>;

/// The longest chain of imports, from a file down to one that imports none. Files must not import each other.
fn longest_chain(imports: &[Import]) -> Vec<&Path> {
    let is_test = |path: &Path| {
        let mut parts = path.iter();
        parts.any(|part| part == "tests" || part == "tests.rs")
    };
    let mut below = Imports::new();
    for import in imports.iter().filter(|import| !is_test(&import.from)) {
        below.entry(&import.from).or_default().push(&import.to);
    }
    let mut known = BTreeMap::new();
    let mut longest = Vec::new();
    for file in below.keys() {
        let chain = chain_from(file, &below, &mut known);
        if chain.len() > longest.len() {
            longest = chain;
        }
    }
    longest
}

fn chain_from<'a>(
    file: &'a Path,
    below: &Imports<'a>,
    known: &mut BTreeMap<&'a Path, Vec<&'a Path>>,
) -> Vec<&'a Path> {
    if let Some(chain) = known.get(file) {
        return chain.clone();
    }
    let mut longest = Vec::new();
    for next in below.get(file).into_iter().flatten() {
        let chain = chain_from(next, below, known);
        if chain.len() > longest.len() {
            longest = chain;
        }
    }
    longest.insert(0, file);
    known.insert(file, longest.clone());
    longest
}

#[test]
fn crates_of_many_stages_stay_flat() {
    for (first, most) in FLOORS {
        let imports = Crate::read(&crate::root().join(first)).imports();
        let chain = longest_chain(&imports);
        let names = chain.iter().map(|path| path.display().to_string());
        let names = names.collect::<Vec<_>>().join("\n  ");
        assert!(
            chain.len() <= most,
            "{} files in a chain of imports, at most {most}:\n  {names}",
            chain.len()
        );
        assert!(chain.len() > 1, "the imports of {first} are not found");
    }
}

#[test]
fn the_longest_chain_leads_through_every_file_on_the_way() {
    let import = |from: &str, to: &str| Import {
        from: from.into(),
        to: to.into(),
        line: 1,
        path: String::new(),
    };
    let imports = [
        import("lib.rs", "c.rs"),
        import("c.rs", "b.rs"),
        import("lib.rs", "a.rs"),
        import("b.rs", "a.rs"),
        import("tests.rs", "lib.rs"),
    ];
    let names = ["lib.rs", "c.rs", "b.rs", "a.rs"].map(Path::new);
    assert_eq!(longest_chain(&imports), names);
}
