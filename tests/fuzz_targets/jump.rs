//! The track of a jump, made of parts as the input chooses.

use core::fmt::Write;
use std::path::Path;

use super::choices::Choices;
use super::files::{NOWHERE, judged};

/// Most rows of a track: with the longer intervals they are a whole jump.
const MOST_ROWS: u32 = 240;

/// Intervals between rows (s).
const INTERVALS: [f64; 6] = [0.5, 0.2, 0.25, 1.0, 0.04, 5.0];

/// Reads and analyses a track of parts, each with an acceleration, an interval, a number of rows, noise, and rows that
/// are missing, repeated or wrong. A track of any shape is refused, or analysed with finite numbers.
pub(super) fn jump(input: &[u8]) {
    let mut choices = Choices(input);
    let mut text = "time_s,north_m,east_m,height_m,north_mps,east_mps,up_mps\n".to_owned();
    let mut height = f64::from(choices.word() % 8000);
    let mut velocity = [30.0, 0.0, 0.0];
    let (mut time, mut place, mut rows, mut noise) = (0.0, [0.0; 2], 0, 7_u32);
    while !choices.is_empty() && rows < MOST_ROWS {
        let kind = choices.byte();
        let interval = INTERVALS
            .get(usize::from(kind & 7))
            .copied()
            .unwrap_or(INTERVALS[0]);
        let [north, east, up] = [(); 3].map(|()| f64::from(choices.byte().cast_signed()) / 8.0);
        let shaken = f64::from(choices.byte()) / 16.0;
        let count = u32::from(choices.byte());
        let is_odd = kind & 0x80 != 0;
        for row in 0..count.min(MOST_ROWS - rows) {
            time += interval;
            for (velocity, acceleration) in velocity.iter_mut().zip([north, east, up]) {
                *velocity = (*velocity + acceleration * interval).clamp(-120.0, 120.0);
            }
            place[0] += velocity[0] * interval;
            place[1] += velocity[1] * interval;
            height += velocity[2] * interval;
            noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let error = shaken * (f64::from(noise >> 16) / 65_536.0 - 0.5);
            let [north, east, up] = velocity;
            let row = match row {
                // A jump of the clock, a place that is no number, a height far away.
                3 if is_odd => format!("{},0,0,0,0,0,0", time - 100.0),
                5 if is_odd => format!("{time},nan,,{height},{north},{east},{up}"),
                7 if is_odd => format!("{time},1e12,0,1e9,{north},{east},{up}"),
                _ => format!(
                    "{time:.3},{:.2},{:.2},{:.2},{north:.3},{east:.3},{:.3}",
                    place[0],
                    place[1],
                    height + error,
                    up + error
                ),
            };
            let _ = writeln!(text, "{row}");
        }
        rows += count;
    }
    let path = Path::new(NOWHERE).join("track.csv");
    judged(text.as_bytes(), &path, MOST_ROWS as usize);
}
