//! Inserts generated tables into the documentation.

use std::path::Path;

use crate::run::{Result, root};

/// The page with generated tables.
const PAGE: &str = "docs/unit.md";

/// Replaces the text between the markers `name` on the page by the content of a file.
pub(crate) fn put(name: &str, file: &Path) -> Result<()> {
    let read = |path: &Path| {
        std::fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))
    };
    let page = root().join(PAGE);
    let text = between(&read(&page)?, name, &read(file)?)?;
    std::fs::write(&page, text).map_err(|error| format!("{PAGE}: {error}"))
}

fn between(page: &str, name: &str, text: &str) -> Result<String> {
    let (begin, end) = (
        format!("<!-- {name} -->\n"),
        format!("<!-- end of {name} -->"),
    );
    let marks = page
        .split_once(&begin)
        .and_then(|(before, rest)| Some((before, rest.split_once(&end)?.1)));
    let (before, after) = marks.ok_or_else(|| format!("{PAGE} has no {begin}"))?;
    Ok(format!("{before}{begin}{text}{end}{after}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_text_between_the_markers_is_replaced() {
        let page =
            "a\n<!-- x -->\nold\n<!-- end of x -->\nb\n<!-- y -->\nkept\n<!-- end of y -->\n";
        assert_eq!(between(page, "x", "new\n"), Ok(page.replace("old", "new")));
        assert!(between(page, "z", "new\n").is_err());
    }
}
