//! What the header of an OpenSim storage file (`.mot`, `.sto`) says of its numbers.

use crate::header::Header;
use crate::mapping::AngleUnit;

/// The unit of angles: as stated by `inDegrees=` or in a sentence. Without either, OpenSim takes radians, except in the
/// older files of SIMM, which are in degrees. `lines` are those before `endheader`.
pub(crate) fn angle_unit(lines: &[&str]) -> Option<AngleUnit> {
    if let Some(answer) = value(lines, "inDegrees") {
        let yes = ["yes", "y", "true", "1"].map(|yes| answer.eq_ignore_ascii_case(yes));
        return Some(if yes.contains(&true) {
            AngleUnit::Deg
        } else {
            AngleUnit::Rad
        });
    }
    let sentence = |word: &str| {
        let says = |line: &&str| line.contains("angle") && line.contains(word);
        let small: Vec<String> = lines.iter().map(|line| line.to_ascii_lowercase()).collect();
        small.iter().map(String::as_str).any(|line| says(&line))
    };
    let of_simm = |line: &&str| {
        let first = line.split_whitespace().next();
        first.is_some_and(|word| word.eq_ignore_ascii_case("datacolumns"))
    };
    Some(match (sentence("radian"), sentence("degree")) {
        (true, false) => AngleUnit::Rad,
        (false, true) => AngleUnit::Deg,
        _ if lines.iter().any(of_simm) => AngleUnit::Deg,
        _ => AngleUnit::Rad,
    })
}

/// What is after `key=` in the lines.
fn value<'a>(lines: &[&'a str], key: &str) -> Option<&'a str> {
    lines.iter().find_map(|line| {
        let (name, value) = line.split_once('=')?;
        name.trim().eq_ignore_ascii_case(key).then(|| value.trim())
    })
}

/// The rate and the number of rows.
pub(crate) fn header(lines: &[&str]) -> Header {
    let number = |key| value(lines, key)?.parse().ok();
    Header {
        contradictions: Vec::new(),
        rate: number("DataRate").map(|rate| ("DataRate", rate)),
        frames: value(lines, "nRows").and_then(|count| count.parse().ok()),
        found: None,
    }
}

/// The components that each cell after the first holds, one letter each; empty for plain numbers.
pub(crate) fn parts(lines: &[&str]) -> &'static str {
    let kind = lines.iter().find_map(|line| line.strip_prefix("DataType="));
    match kind.map(str::trim) {
        Some("Quaternion") => "wxyz",
        Some("Vec3") => "xyz",
        _ => "",
    }
}

/// The columns of a name: `name.w` and so on if its cells have parts.
pub(crate) fn columns(name: &str, parts: &str) -> Vec<String> {
    if parts.is_empty() {
        return vec![name.to_owned()];
    }
    parts.chars().map(|part| format!("{name}.{part}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_unit_of_angles_is_stated_or_that_of_the_format() {
        for (lines, unit) in [
            (["version=1", "inDegrees=yes"], AngleUnit::Deg),
            (["version=1", "inDegrees=no"], AngleUnit::Rad),
            (["nRows=2", "Angles are in radians."], AngleUnit::Rad),
            (["nRows=2", "Units of angles: Degrees"], AngleUnit::Deg),
            (["nRows=2", "version=1"], AngleUnit::Rad),
            (["name run", "datacolumns 24"], AngleUnit::Deg),
        ] {
            assert_eq!(angle_unit(&lines), Some(unit), "{lines:?}");
        }
    }
}
