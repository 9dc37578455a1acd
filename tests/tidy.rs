//! The project's rules as tests: sizes, module pages, the architecture map and the equation map.
#![expect(
    clippy::expect_used,
    clippy::panic,
    reason = "tests may panic: that is how they fail"
)]

mod tidy {
    pub(crate) mod circles;
    pub(crate) mod claims;
    pub(crate) mod floors;
    pub(crate) mod items;
    pub(crate) mod lengths;
    pub(crate) mod methods;
    pub(crate) mod modules;
    pub(crate) mod paper;
}

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// Longest source file (lines before its tests). Longer ones usually combine two things.
const LINE_LIMIT: usize = 430;
/// Folders without our own sources.
const FOREIGN: [&str; 3] = ["target", "node_modules", ".git"];

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn files_below(folder: &Path, extension: &str, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("a folder of the project") {
        let path = entry.expect("an entry").path();
        let name = path
            .file_name()
            .and_then(|name| name.to_str())
            .unwrap_or_default();
        if path.is_dir() {
            if !FOREIGN.contains(&name) {
                files_below(&path, extension, found);
            }
        } else if name.ends_with(extension) {
            found.push(path);
        }
    }
}

fn sources() -> Vec<(PathBuf, String)> {
    let mut paths = Vec::new();
    files_below(&root(), ".rs", &mut paths);
    assert!(
        paths.len() > 20,
        "the sources are not where this test looks"
    );
    let read = |path: PathBuf| {
        let text = fs::read_to_string(&path).expect("readable");
        (path, text)
    };
    paths.into_iter().map(read).collect()
}

#[test]
fn every_source_file_is_short_and_begins_with_its_purpose() {
    let mut faults = Vec::new();
    for (path, text) in sources() {
        let code_lines = text
            .lines()
            .take_while(|line| !line.contains("#[cfg(test)]"))
            .count();
        if code_lines > LINE_LIMIT {
            faults.push(format!(
                "{}: {code_lines} lines before its tests",
                path.display()
            ));
        }
        if !text.starts_with("//!") && !text.starts_with("#!") {
            faults.push(format!("{}: does not begin with //!", path.display()));
        }
        for (number, line) in text.lines().enumerate() {
            let loose_end = ["TODO", "FIXME", "XXX"]
                .iter()
                .find(|mark| line.contains(&format!("// {mark}")) && !line.contains("issue"));
            if let Some(mark) = loose_end {
                faults.push(format!(
                    "{}:{}: {mark} without an issue",
                    path.display(),
                    number + 1
                ));
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

/// Folders of the program's own code. What it prints may contain text from files and networks.
const PROGRAM: [&str; 10] = [
    "discovery",
    "estimation",
    "falls",
    "formats",
    "host/src",
    "io",
    "laboratory",
    "replay",
    "unit",
    "verbs",
];

/// Text reaches the terminal through one module, which escapes control characters.
#[test]
fn only_the_terminal_module_prints() {
    let printing = ["print!(", "println!(", "stdout()", "stderr()", "dbg!("];
    let mut faults = Vec::new();
    let mut seen = 0;
    for (path, text) in sources() {
        let path = path.strip_prefix(root()).expect("below the root");
        let is_program = PROGRAM.iter().any(|folder| path.starts_with(folder))
            && path.components().any(|part| part.as_os_str() == "src")
            && !path.components().any(|part| part.as_os_str() == "tests")
            && !path.ends_with("tests.rs");
        let is_terminal = path.starts_with("host/src/cli/terminal")
            || path == Path::new("host/src/cli/terminal.rs");
        if !is_program || is_terminal {
            continue;
        }
        seen += 1;
        let code = text
            .lines()
            .take_while(|line| !line.contains("#[cfg(test)]"));
        for (number, line) in code.enumerate() {
            if printing.iter().any(|word| line.contains(word)) {
                faults.push(format!(
                    "{}:{}: {}",
                    path.display(),
                    number + 1,
                    line.trim()
                ));
            }
        }
    }
    assert!(
        seen > 200,
        "{seen} files are too few: the test looks in the wrong place"
    );
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

/// A unit has one spelling in names of columns, keys and code: `_mps`, `_radps`, `_mps2`.
#[test]
fn units_have_one_spelling() {
    let other = [
        "m_s",
        "m_s2",
        "mm_s",
        "rad_s",
        "deg_s",
        "m_per_s",
        "rad_per_s",
    ];
    let mut faults = Vec::new();
    for extension in [".rs", ".ts", ".mjs", ".toml", ".md", ".json", ".svg"] {
        let mut paths = Vec::new();
        files_below(&root(), extension, &mut paths);
        for path in paths.iter().filter(|path| !path.ends_with("CHANGELOG.md")) {
            let text = fs::read_to_string(path).expect("readable");
            let words = text.split(|c: char| !c.is_ascii_alphanumeric() && c != '_');
            for word in words.filter(|word| word.contains('_')) {
                let spelled = |unit: &&str| {
                    word.strip_suffix(*unit)
                        .is_some_and(|name| name.len() > 1 && name.ends_with('_'))
                };
                if other.iter().any(spelled) {
                    faults.push(format!("{}: {word}", path.display()));
                }
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

/// Words in backquotes that look like a path of the project.
fn quoted_paths(text: &str) -> Vec<&str> {
    let quoted = text.split('`').skip(1).step_by(2);
    quoted
        .filter(|word| word.contains('/') && !word.contains([' ', '<', '*', ':']))
        .collect()
}

#[test]
fn every_path_on_the_architecture_page_exists() {
    let page = fs::read_to_string(root().join("ARCHITECTURE.md")).expect("ARCHITECTURE.md");
    let paths = quoted_paths(&page);
    assert!(paths.len() > 10, "the page names its folders");
    let missing: Vec<_> = paths
        .iter()
        .filter(|path| !root().join(path).exists())
        .collect();
    assert!(
        missing.is_empty(),
        "ARCHITECTURE.md names what is not there: {missing:?}"
    );
    // The README's commands create folders, which git ignores.
    let ignored = fs::read_to_string(root().join(".gitignore")).expect(".gitignore");
    for folder in fs::read_dir(root()).expect("the root").flatten() {
        let name = folder.file_name().into_string().expect("a plain name");
        let ours =
            !name.starts_with('.') && !ignored.lines().any(|line| line == format!("/{name}"));
        if folder.path().is_dir() && ours {
            assert!(
                page.contains(&format!("`{name}/")),
                "ARCHITECTURE.md does not name {name}/"
            );
        }
    }
}

/// A row of docs/equations.md: where an equation is implemented and tested.
struct Row {
    file: String,
    item: String,
    test: String,
}

fn equation_map() -> BTreeMap<String, Row> {
    let page = fs::read_to_string(root().join("docs/equations.md")).expect("docs/equations.md");
    let mut map = BTreeMap::new();
    for line in page.lines().filter(|line| line.starts_with("| `")) {
        let cells: Vec<&str> = line
            .split('|')
            .map(|cell| cell.trim().trim_matches('`'))
            .collect();
        let [_, label, file, item, test, ..] = cells[..] else {
            panic!("a broken row: {line}")
        };
        let row = Row {
            file: file.into(),
            item: item.into(),
            test: test.into(),
        };
        assert!(
            map.insert(label.to_owned(), row).is_none(),
            "{label} stands twice"
        );
    }
    map
}

/// Labels of the paper's equations without `eq:`; `None` if the paper is absent.
fn paper_labels() -> Option<Vec<String>> {
    let path = bodyflight_shared_data::shared("paper/skydiver-model.tex")?;
    let text = fs::read_to_string(path).expect("the paper");
    let labels = text
        .split("\\label{eq")
        .skip(1)
        .filter_map(|rest| rest.split('}').next());
    let plain = |label: &str| match label.strip_prefix(':') {
        Some(name) => name.to_owned(),
        None => format!("eq{label}"),
    };
    let mut labels: Vec<String> = labels.map(plain).collect();
    labels.sort();
    labels.dedup();
    Some(labels)
}

#[test]
fn the_equation_map_is_true() {
    let map = equation_map();
    assert_eq!(map.len(), 41, "the paper has 41 labelled equations");
    if let Some(labels) = paper_labels() {
        let mapped: Vec<&String> = map.keys().collect();
        assert_eq!(mapped, labels.iter().collect::<Vec<_>>());
    }
    let tests: String = sources().into_iter().map(|(_, text)| text).collect();
    for (label, row) in &map {
        let source = fs::read_to_string(root().join(&row.file))
            .unwrap_or_else(|error| panic!("{label}: {}: {error}", row.file));
        let kinds = ["fn", "struct", "enum", "const", "type"];
        let defined = kinds.iter().any(|kind| {
            [" ", "(", "<", ":", ";"]
                .iter()
                .any(|end| source.contains(&format!("{kind} {}{end}", row.item)))
        });
        assert!(defined, "{label}: no {} in {}", row.item, row.file);
        let cited = [')', ',', ']', '`']
            .iter()
            .any(|end| source.contains(&format!("({label}{end}")))
            || source.contains(&format!("({label})"));
        assert!(cited, "{label}: {} does not cite ({label})", row.file);
        assert!(
            tests.contains(&format!("fn {}(", row.test)),
            "{label}: no test {}",
            row.test
        );
    }
}
