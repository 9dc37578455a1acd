//! No import cycles: files that depend on each other are either one thing split in two, or contain something that
//! belongs elsewhere.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

use petgraph::algo::tarjan_scc;
use petgraph::graph::DiGraph;
use serde_json::Value;

use crate::tidy::modules::{Crate, Import};

/// Environment variable that restricts the test to one package.
const ONLY: &str = "TIDY_PACKAGE";

/// Workspaces of the project.
const MANIFESTS: [&str; 2] = ["Cargo.toml", "firmware/boards/stm32f405/Cargo.toml"];

/// Root files of all crates, with the names of their packages.
fn crates() -> Vec<(String, PathBuf)> {
    let mut found = Vec::new();
    for manifest in MANIFESTS {
        let output = Command::new(env!("CARGO"))
            .args([
                "metadata",
                "--no-deps",
                "--format-version=1",
                "--manifest-path",
            ])
            .arg(crate::root().join(manifest))
            .output()
            .expect("cargo runs");
        let metadata: Value = serde_json::from_slice(&output.stdout).expect("cargo's JSON");
        for package in metadata["packages"].as_array().expect("packages") {
            let name = package["name"].as_str().expect("a name");
            for target in package["targets"].as_array().expect("targets") {
                let source = target["src_path"].as_str().expect("a file");
                found.push((name.to_owned(), PathBuf::from(source)));
            }
        }
    }
    found
}

/// Groups of files that depend on each other, with the imports among them.
fn circles(imports: &[Import]) -> Vec<Vec<&Import>> {
    let mut graph = DiGraph::<&Path, ()>::new();
    let mut nodes = BTreeMap::new();
    let mut node = |graph: &mut DiGraph<_, _>, file| {
        *nodes.entry(file).or_insert_with(|| graph.add_node(file))
    };
    for import in imports {
        let from = node(&mut graph, import.from.as_path());
        let to = node(&mut graph, import.to.as_path());
        graph.update_edge(from, to, ());
    }
    let groups = tarjan_scc(&graph);
    let circles = groups.into_iter().filter(|group| group.len() > 1);
    circles
        .map(|group| {
            let files: Vec<&Path> = group.into_iter().map(|node| graph[node]).collect();
            let within = |import: &&Import| {
                files.contains(&import.from.as_path()) && files.contains(&import.to.as_path())
            };
            imports.iter().filter(within).collect()
        })
        .collect()
}

fn report(circle: &[&Import]) -> String {
    let root = crate::root().canonicalize().expect("the root");
    let short = |path: &Path| {
        path.strip_prefix(&root)
            .unwrap_or(path)
            .display()
            .to_string()
    };
    let mut files: Vec<String> = circle.iter().map(|import| short(&import.from)).collect();
    files.dedup();
    let mut pairs = BTreeMap::<_, Vec<String>>::new();
    for Import {
        from,
        to,
        line,
        path,
    } in circle
    {
        let places = pairs.entry((short(from), short(to))).or_default();
        places.push(format!("{path} ({line})"));
    }
    let mut text = format!(
        "{} files name each other: {}\n",
        files.len(),
        files.join(", ")
    );
    for ((from, to), places) in pairs {
        let _ = writeln!(text, "  {from} -> {to}: {}", places.join(", "));
    }
    text
}

#[test]
fn no_files_import_each_other() {
    let only = std::env::var(ONLY).ok();
    let mut files = 0;
    let mut reports = Vec::new();
    for (package, first) in crates() {
        if only.as_ref().is_some_and(|only| *only != package) {
            continue;
        }
        let tree = Crate::read(&first);
        files += tree.files().len();
        let imports = tree.imports();
        for circle in circles(&imports) {
            reports.push(format!("{package}: {}", report(&circle)));
        }
    }
    assert!(files > 0, "no package of this name");
    assert!(
        reports.is_empty(),
        "{} circles of imports ({ONLY}=<package> looks at one package only):\n{}",
        reports.len(),
        reports.join("\n")
    );
}

/// Writes a crate into a temporary folder and reads it.
fn crate_of(files: &[(&str, &str)]) -> (tempfile::TempDir, Crate) {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, text) in files {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
        std::fs::write(path, text).expect("a file");
    }
    let tree = Crate::read(&folder.path().join("lib.rs"));
    (folder, tree)
}

/// Imports that form a cycle, as lines `from -> to`.
fn found(files: &[(&str, &str)]) -> Vec<String> {
    let (folder, tree) = crate_of(files);
    let imports = tree.imports();
    let short = |path: &Path| {
        let path = path.strip_prefix(folder.path()).expect("below the folder");
        path.with_extension("").display().to_string()
    };
    let mut lines: Vec<String> = circles(&imports)
        .into_iter()
        .flatten()
        .map(|import| format!("{} -> {}", short(&import.from), short(&import.to)))
        .collect();
    lines.sort();
    lines.dedup();
    lines
}

#[test]
fn files_that_use_each_other_form_a_cycle() {
    let both = ["a -> b", "b -> a"];
    let lib = ("lib.rs", "mod a; mod b;");
    let uses_b = ("a.rs", "use crate::b::B; pub struct A(B);");
    assert_eq!(
        found(&[lib, uses_b, ("b.rs", "use super::a::A; pub struct B(A);")]),
        both
    );
    assert_eq!(
        found(&[lib, uses_b, ("b.rs", "pub struct B(crate::a::A);")]),
        both
    );
    let in_a_macro = "pub struct B; fn f() { println!(\"{}\", crate::a::N + 1); }";
    assert_eq!(found(&[lib, uses_b, ("b.rs", in_a_macro)]), both);
    let by_the_module = "use crate::a; pub struct B; fn f(_: a::A) {}";
    assert_eq!(found(&[lib, uses_b, ("b.rs", by_the_module)]), both);
    let by_all = "use crate::a::*; pub struct B(A);";
    assert_eq!(found(&[lib, uses_b, ("b.rs", by_all)]), both);
}

#[test]
fn a_parent_and_its_child_form_a_cycle_if_each_uses_the_other() {
    let child = ("a/c.rs", "pub struct C(super::A);");
    let lib = ("lib.rs", "mod a;");
    for parent in ["pub use c::C;", "fn f(_: c::C) {}"] {
        let parent = format!("mod c; pub struct A; {parent}");
        assert_eq!(
            found(&[lib, ("a.rs", &parent), child]),
            ["a -> a/c", "a/c -> a"]
        );
    }
    let declares_only = "pub mod c; pub struct A;";
    assert!(found(&[lib, ("a.rs", declares_only), child]).is_empty());
}

#[test]
fn methods_of_one_type_in_two_files_form_a_cycle_if_each_file_needs_the_other() {
    let lib = ("lib.rs", "mod a; mod b;");
    let child = ("b.rs", "use super::a::A; impl A { fn more(&self) {} }");
    let calls = "pub struct A; impl A { fn f(&self) { self.more(); } }";
    assert_eq!(found(&[lib, ("a.rs", calls), child]), ["a -> b", "b -> a"]);
    let own = "pub struct A; impl A { fn f(&self) { self.g(); } fn g(&self) {} }";
    assert!(found(&[lib, ("a.rs", own), child]).is_empty());
    let of_a_trait = "pub struct A; impl Clone for A { fn clone(&self) -> A { self.more() } }";
    assert!(found(&[lib, ("a.rs", of_a_trait), child]).is_empty());
}

#[test]
fn a_name_leads_to_the_file_that_defines_it() {
    // The root re-exports both, which does not count as a dependency.
    let lib = ("lib.rs", "mod a; mod b; pub use a::A; pub use b::B;");
    let a = ("a.rs", "pub struct A;");
    let b = ("b.rs", "use crate::A; pub struct B(A);");
    assert!(found(&[lib, a, b]).is_empty());
    let circle = ("a.rs", "pub struct A(crate::B);");
    assert_eq!(found(&[lib, circle, b]), ["a -> b", "b -> a"]);
}

#[test]
fn tests_in_a_file_may_use_files_that_depend_on_it() {
    let lib = ("lib.rs", "mod a; mod b;");
    let a = (
        "a.rs",
        "pub struct A; #[cfg(test)] mod tests { use crate::b::B; }",
    );
    let b = ("b.rs", "pub struct B(crate::a::A);");
    assert!(found(&[lib, a, b]).is_empty());
    let own_file = ("a.rs", "pub struct A; #[cfg(test)] mod tests;");
    let tests = ("a/tests.rs", "use super::*; use crate::b::B;");
    assert!(found(&[lib, own_file, tests, b]).is_empty());
}
