//! A recording in order by its form, with numbers that contradict each other.

use core::fmt::Write;
use std::path::Path;
use std::sync::OnceLock;

use bodyflight_mvnx::recording::{Options, Recording};

use super::choices::Choices;
use crate::small_recording::{NAME, element, is_usable, survey, written};

/// Number of frames of the recording, at a rate at which they are long enough to be judged.
const FRAMES: usize = 12;
const RATE: [&str; 2] = ["frameRate=\"240\"", "frameRate=\"20\""];

/// Most edits of one input.
const MOST_EDITS: usize = 6;

/// The elements of a frame that have numbers for segments, joints or sensors.
const ELEMENTS: [&str; 4] = ["orientation", "position", "velocity", "angularVelocity"];

/// The recording's numbers by frame and element, between the pieces of text around them.
struct Numbers {
    /// Text before each element, in order; the rest of the file is last.
    between: Vec<String>,
    /// Numbers of each element, in the same order, and their text.
    values: Vec<Vec<f64>>,
    texts: Vec<String>,
}

fn small() -> &'static Numbers {
    static SMALL: OnceLock<Numbers> = OnceLock::new();
    SMALL.get_or_init(|| {
        let text = written(FRAMES as u64).replacen(RATE[0], RATE[1], 1);
        assert!(text.contains(RATE[1]));
        let mut found: Vec<(usize, &str)> = Vec::new();
        for frame in 0..FRAMES {
            for name in ELEMENTS {
                let numbers = element(&text, frame, name);
                found.push((numbers.as_ptr() as usize - text.as_ptr() as usize, numbers));
            }
        }
        found.sort_unstable();
        let (mut between, mut values, mut texts, mut end) = (Vec::new(), Vec::new(), Vec::new(), 0);
        for (begin, numbers) in found {
            between.push(text[end..begin].to_owned());
            let parsed = numbers
                .split_whitespace()
                .map(|n| n.parse().expect("a number"));
            values.push(parsed.collect());
            texts.push(numbers.to_owned());
            end = begin + numbers.len();
        }
        between.push(text[end..].to_owned());
        Numbers {
            between,
            values,
            texts,
        }
    })
}

/// Edits: which element, over which frames and which of its numbers, and what becomes of them. The recording is refused,
/// or described and doubted in finite numbers.
pub(super) fn numbers(input: &[u8]) {
    let small = small();
    let mut values = small.values.clone();
    let mut choices = Choices(input);
    for _ in 0..MOST_EDITS {
        if choices.is_empty() {
            break;
        }
        edit(&mut values, &mut choices);
    }
    let mut text = small.between[0].clone();
    for (place, numbers) in values.iter().enumerate() {
        // Most elements are as they were.
        if *numbers == small.values[place] {
            text += &small.texts[place];
        } else {
            for number in numbers {
                let _ = write!(text, "{number} ");
            }
        }
        text += &small.between[place + 1];
    }
    if let Ok(report) = survey(text.as_bytes()) {
        assert!(report.duration_s.is_finite() && report.frame_rate_hz >= 1.0);
        let json = serde_json::to_string(&report).expect("JSON");
        assert!(
            !json.contains("null,null"),
            "a number that is not finite: {json}"
        );
    }
    let Ok(mut recording) = Recording::new(text.as_bytes(), Path::new(NAME), Options::default())
    else {
        return;
    };
    let frames: Result<Vec<_>, _> = recording.by_ref().collect();
    assert!(frames.is_err() || frames.is_ok_and(|frames| frames.iter().all(is_usable)));
    for warning in recording.warnings() {
        let message = warning.message;
        assert!(
            !message.contains("NaN") && !message.contains("inf "),
            "{message}"
        );
        let [from, to] = warning.span_s.unwrap_or_default();
        assert!(from <= to, "{message}");
    }
}

fn edit(values: &mut [Vec<f64>], choices: &mut Choices<'_>) {
    let element = usize::from(choices.byte()) % ELEMENTS.len();
    let (begin, count) = (choices.byte(), choices.byte());
    let (first, length) = (usize::from(choices.byte()), usize::from(choices.byte()));
    let (change, amount) = (choices.byte(), f64::from(choices.byte().cast_signed()));
    let mut before: Option<Vec<f64>> = None;
    for frame in (0..FRAMES)
        .skip(usize::from(begin) % FRAMES)
        .take(usize::from(count))
    {
        let numbers = &mut values[frame * ELEMENTS.len() + element];
        let original = numbers.clone();
        for place in (first..first + length).take_while(|place| *place < original.len()) {
            let value = numbers[place];
            numbers[place] = match change % 8 {
                0 => before.as_ref().map_or(value, |before| before[place]),
                1 => 0.0,
                2 => -value,
                3 => value * (amount / 8.0),
                4 => value + amount / 16.0,
                5 => value * f64::exp2(amount),
                6 => original[original.len() - 1 - place],
                _ => original[(place + 3) % original.len()],
            };
        }
        before.get_or_insert(original);
    }
}
