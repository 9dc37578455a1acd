//! `cargo xtask book`: builds the project's pages as a book.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use crate::run::{Result, root, run, say, target_folder};
use crate::tool::tool;

/// Single files of the book.
const PARTS: [&str; 11] = [
    "ARCHITECTURE.md",
    "CHANGELOG.md",
    "CONTRIBUTING.md",
    "README.md",
    "SECURITY.md",
    "firmware/emulator/README.md",
    "verbs/data/acrobatics/README.md",
    "python/README.md",
    "python/examples/learn_turn.py",
    "python/examples/learn_with_sb3.py",
    "python/examples/three_skydivers.py",
];

/// Folders that are included completely.
const FOLDERS: [&str; 2] = ["docs", "python/notebooks"];

/// Copies the pages in their places in the repository, builds the book, and checks every link in it.
pub(crate) fn book() -> Result<()> {
    let folder = target_folder()?.join("book");
    let sources = folder.join("src");
    if folder.exists() {
        std::fs::remove_dir_all(&folder).map_err(failed(&folder))?;
    }
    for part in PARTS {
        copy(&root().join(part), &sources.join(part))?;
    }
    for folder in FOLDERS {
        copy_folder(&root().join(folder), &sources.join(folder))?;
    }
    copy(&root().join("docs/SUMMARY.md"), &sources.join("SUMMARY.md"))?;
    copy(&root().join("docs/book.toml"), &folder.join("book.toml"))?;
    // The features for serving and watching the book are not needed, nor is speed: it is compiled in a third of the time.
    let options = ["--no-default-features", "--features", "search", "--debug"];
    let variables = [("CARGO_PROFILE_DEV_DEBUG", "0".to_owned())];
    let program = tool("mdbook", "0.5.4", &options, &variables)?
        .display()
        .to_string();
    run(&program, &["build", &folder.display().to_string()])?;
    let pages = folder.join("book");
    let links = check_links(&pages)?;
    say(&format!(
        "{links} links are valid: {}",
        pages.join("index.html").display()
    ));
    Ok(())
}

fn failed(path: &Path) -> impl Fn(std::io::Error) -> String {
    let path = path.to_owned();
    move |error| format!("{}: {error}", path.display())
}

fn copy(from: &Path, to: &Path) -> Result<()> {
    if let Some(folder) = to.parent() {
        std::fs::create_dir_all(folder).map_err(failed(folder))?;
    }
    std::fs::copy(from, to).map_err(failed(from))?;
    Ok(())
}

fn copy_folder(from: &Path, to: &Path) -> Result<()> {
    for path in entries(from)? {
        let to = to.join(path.file_name().unwrap_or_default());
        if path.is_dir() {
            copy_folder(&path, &to)?;
        } else {
            copy(&path, &to)?;
        }
    }
    Ok(())
}

fn entries(folder: &Path) -> Result<Vec<PathBuf>> {
    let entries = std::fs::read_dir(folder).map_err(failed(folder))?;
    Ok(entries.flatten().map(|entry| entry.path()).collect())
}

/// Checks that each link of each page leads to a file and an anchor in it, and returns the number of links.
fn check_links(folder: &Path) -> Result<usize> {
    let mut pages = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(folder) = folders.pop() {
        for path in entries(&folder)? {
            if path.is_dir() {
                folders.push(path);
            } else if path
                .extension()
                .is_some_and(|extension| extension == "html")
            {
                pages.push(path);
            }
        }
    }
    let mut count = 0;
    let mut broken = BTreeSet::new();
    // The menu repeats the links of the summary, and the page that combines all pages has no location.
    for page in pages
        .iter()
        .filter(|page| !page.ends_with("print.html") && !page.ends_with("404.html"))
    {
        let text = std::fs::read_to_string(page).map_err(failed(page))?;
        for link in links(&text) {
            count += 1;
            if !leads_somewhere(page, &text, link)? {
                broken.insert(format!("{}: {link}", page.display()));
            }
        }
    }
    if broken.is_empty() {
        return Ok(count);
    }
    let broken: Vec<String> = broken.into_iter().collect();
    Err(format!("broken links:\n{}", broken.join("\n")))
}

/// Links of a page to other pages of the book.
fn links(text: &str) -> impl Iterator<Item = &str> {
    ["href=\"", "src=\""]
        .into_iter()
        .flat_map(|attribute| text.split(attribute).skip(1))
        .filter_map(|rest| rest.split('"').next())
        .filter(|link| !link.contains("://") && !link.starts_with("mailto:"))
}

fn leads_somewhere(page: &Path, text: &str, link: &str) -> Result<bool> {
    let (file, place) = link.split_once('#').unwrap_or((link, ""));
    let has_place = |text: &str| place.is_empty() || text.contains(&format!("id=\"{place}\""));
    if file.is_empty() {
        return Ok(has_place(text));
    }
    let path = page.with_file_name(file);
    if !path.exists() || place.is_empty() {
        return Ok(path.exists());
    }
    let other = std::fs::read_to_string(&path).map_err(failed(&path))?;
    Ok(has_place(&other))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn links_within_the_book_are_followed_to_their_place() {
        let text = r##"<h1 id="top">x</h1><a href="#top">a</a><a href="#gone">b</a><a href="https://example.org">c</a><img src="no.svg">"##;
        let found: Vec<_> = links(text)
            .map(|link| {
                (
                    link,
                    leads_somewhere(Path::new("/nowhere/page.html"), text, link).unwrap(),
                )
            })
            .collect();
        assert_eq!(found, [("#top", true), ("#gone", false), ("no.svg", false)]);
    }
}
