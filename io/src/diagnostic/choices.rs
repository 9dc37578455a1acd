//! Unknown names, and the nearest known ones.

use super::Problem;

/// The known name nearest to `found`, if they differ by no more than a typing error.
pub fn nearest<'a>(found: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let found = found.to_lowercase();
    let slips = |name: &str| strsim::damerau_levenshtein(&found, &name.to_lowercase());
    let (slips, name) = (known.into_iter())
        .map(|name| (slips(name), name))
        .min_by_key(|(slips, _)| *slips)?;
    (slips <= 1 + found.chars().count() / 4).then_some(name)
}

/// The known names, starting with the one that was probably meant.
pub fn choices<'a>(found: &str, known: impl IntoIterator<Item = &'a str>) -> String {
    let known: Vec<&str> = known.into_iter().collect();
    let all = known.join(", ");
    match nearest(found, known.iter().copied()) {
        Some(name) => format!("did you mean \"{name}\"? one of: {all}"),
        None => format!("one of: {all}"),
    }
}

impl Problem {
    /// An unknown name: "unknown `what` ...", with a list of the known ones.
    pub fn unknown<'a>(what: &str, found: &str, known: impl IntoIterator<Item = &'a str>) -> Self {
        Self::bad_input(format!("unknown {what} \"{found}\"")).help(choices(found, known))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const KNOWN: [&str; 3] = ["rotations", "tracking", "drag"];

    #[test]
    fn a_typing_error_is_distinguished_from_another_word() {
        assert_eq!(nearest("rotation", KNOWN), Some("rotations"));
        assert_eq!(nearest("Tracknig", KNOWN), Some("tracking"));
        assert_eq!(nearest("darg", KNOWN), Some("drag"));
        assert_eq!(nearest("wind", KNOWN), None);
        assert_eq!(nearest("", []), None);
    }

    #[test]
    fn the_likely_choice_comes_first() {
        assert_eq!(
            choices("drg", KNOWN),
            "did you mean \"drag\"? one of: rotations, tracking, drag"
        );
        assert_eq!(choices("sit", KNOWN), "one of: rotations, tracking, drag");
    }
}
