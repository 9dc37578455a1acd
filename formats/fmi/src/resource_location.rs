//! The folder of a unit's resources, which FMI 2.0 gives as a URI.

use std::path::PathBuf;

/// The folder that a `file:` URI means; `None` if it means no local file.
pub fn folder_of(uri: &str) -> Option<PathBuf> {
    let rest = uri.strip_prefix("file:")?;
    // An authority may stand before the path: none, or this machine.
    let path = match rest.strip_prefix("//") {
        None => rest,
        Some(rest) => rest.strip_prefix("localhost").unwrap_or(rest),
    };
    if !path.starts_with('/') {
        return None;
    }
    let path = decoded(path)?;
    // `/C:/folder` is a path with a drive.
    let drive = path.strip_prefix('/').filter(|rest| {
        let mut letters = rest.chars();
        letters
            .next()
            .is_some_and(|letter| letter.is_ascii_alphabetic())
            && letters.next() == Some(':')
    });
    Some(PathBuf::from(drive.unwrap_or(&path)))
}

/// Replaces each `%` and two digits by its byte; `None` if that gives no text.
fn decoded(text: &str) -> Option<String> {
    let mut bytes = text.bytes();
    let mut found = Vec::with_capacity(text.len());
    while let Some(byte) = bytes.next() {
        found.push(match byte {
            b'%' => {
                let mut digit = || char::from(bytes.next()?).to_digit(16);
                u8::try_from(digit()? * 16 + digit()?).ok()?
            }
            byte => byte,
        });
    }
    String::from_utf8(found).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_are_found_in_every_way_that_importers_write_them() {
        for (uri, folder) in [
            ("file:///tmp/unit/resources", "/tmp/unit/resources"),
            ("file:/tmp/unit/resources", "/tmp/unit/resources"),
            ("file://localhost/tmp/unit", "/tmp/unit"),
            ("file:///tmp/my%20unit/%C3%BC", "/tmp/my unit/\u{fc}"),
            ("file:///C:/units/one", "C:/units/one"),
        ] {
            assert_eq!(folder_of(uri), Some(PathBuf::from(folder)), "{uri}");
        }
        for uri in [
            "",
            "/tmp",
            "http://host/unit",
            "file://host/unit",
            "file:///a%2",
            "file:///%ff",
        ] {
            assert_eq!(folder_of(uri), None, "{uri}");
        }
    }
}
