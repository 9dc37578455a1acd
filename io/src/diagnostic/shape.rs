//! Messages of deserializers in the words of users: shapes of values instead of types of Rust.

/// Ends of messages, and how they are put for users.
const SHAPES: [(&str, &str); 13] = [
    ("f64", "a number"),
    ("f32", "a number"),
    ("usize", "a whole number of 0 or more"),
    ("u64", "a whole number of 0 or more"),
    ("u32", "a whole number of 0 or more"),
    ("u8", "a whole number of 0 to 255"),
    ("i64", "a whole number"),
    ("a string", "text in quotes"),
    ("path string", "text in quotes"),
    ("a boolean", "true or false"),
    ("a map", "a table"),
    ("a sequence", "a list"),
    ("string or table", "text in quotes or a table"),
];

/// A message of serde with the expected shape in plain words.
pub fn plain(message: &str) -> String {
    let Some((found, expected)) = message.rsplit_once(", expected ") else {
        return message.to_owned();
    };
    let length = expected
        .strip_prefix("an array of length ")
        .or_else(|| expected.strip_prefix("a tuple of size "));
    let known = SHAPES.iter().find(|(end, _)| *end == expected);
    let shape = match (length, known) {
        (Some(length), _) => format!("a list of {length} values"),
        (None, Some((_, shape))) => (*shape).to_owned(),
        (None, None) if expected.starts_with("struct ") => "a table".to_owned(),
        (None, None) => return message.to_owned(),
    };
    format!("{found}, expected {shape}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn types_of_rust_become_shapes() {
        for (message, said) in [
            (
                "invalid type: string \"a\", expected f64",
                "invalid type: string \"a\", expected a number",
            ),
            (
                "invalid length 2, expected an array of length 3",
                "invalid length 2, expected a list of 3 values",
            ),
            (
                "invalid type: integer `3`, expected struct AirTable",
                "invalid type: integer `3`, expected a table",
            ),
            ("missing field `a`", "missing field `a`"),
            (
                "unknown field `a`, expected `b`",
                "unknown field `a`, expected `b`",
            ),
        ] {
            assert_eq!(plain(message), said);
        }
    }
}
