//! Numbers in MVNX: decimal, separated by white space.

use bodyflight_io::text;

use super::scanner::shortened;

/// Largest difference from 1 of the norm of a segment's quaternion; six decimals give 2e-6.
const NORM_TOLERANCE: f64 = 0.01;

/// Appends the numbers of `text` to `numbers`, at most to its `capacity`; the rest are only counted.
///
/// Returns how many numbers there were, or a message about the first token that is not a finite number.
pub(super) fn append(text: &str, capacity: usize, numbers: &mut Vec<f64>) -> Result<usize, String> {
    let mut count = 0;
    for number in text::numbers(text) {
        count += 1;
        if numbers.len() < capacity {
            numbers.push(number.map_err(refusal)?);
        }
    }
    Ok(count)
}

/// What is wrong with a word that is no finite number.
fn refusal(word: &str) -> String {
    let hint = if word.contains(',') {
        "; the decimal separator is a point"
    } else {
        ""
    };
    let word = shortened(word);
    format!("expected a finite number, found `{word}`{hint}")
}

/// The first segment whose quaternion is not a rotation, with its norm.
pub(super) fn off_unit(orientation: &[f64]) -> Option<(usize, f64)> {
    orientation
        .chunks_exact(4)
        .map(|q| q.iter().map(|c| c * c).sum::<f64>().sqrt())
        .enumerate()
        .find(|(_, norm)| norm.is_nan() || (norm - 1.0).abs() > NORM_TOLERANCE)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tokens_of_all_kinds() {
        let mut numbers = Vec::new();
        let text = "  1.500000 -0.000000\t1e-3\r\n+2  4.9e-324 ";
        assert_eq!(append(text, 92, &mut numbers), Ok(5));
        assert_eq!(numbers, [1.5, -0.0, 0.001, 2.0, 4.9e-324]);
        let long = format!("0.{}", "3".repeat(400));
        assert_eq!(append(&long, 92, &mut numbers), Ok(1));
        numbers.clear();
        assert_eq!(append("1 2 3 x", 3, &mut numbers), Ok(4));
        for bad in [
            "nan",
            "NaN",
            "inf",
            "-infinity",
            "1e400",
            "1.#QNAN",
            "-1.#IND",
            "1,5",
            "\u{2212}1",
            "0x10",
            "\u{661}",
            "1\0",
            "1_000",
            "--1",
            ".",
            "e5",
        ] {
            let found = append(bad, 92, &mut Vec::new());
            assert!(found.is_err(), "{bad:?} was read as {found:?}");
        }
    }
}
