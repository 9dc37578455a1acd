//! Rows that a track has twice, at different times: no two moments of a fall have the same positions and velocities.

use core::cmp::Ordering;

use super::compare::{Channel, Finding, Remedy};
use crate::Sample;

/// Slowest motion (m/s) that cannot come back to the same fix, and the fewest rows on end that are no chance.
const MOVES: f64 = 5.0;
const FEWEST: usize = 5;

/// All numbers of a fix.
fn numbers(sample: &Sample) -> [f64; 6] {
    let (at, moves) = (&sample.position, &sample.velocity);
    [at.z, at.x, at.y, moves.z, moves.x, moves.y]
}

fn compared(a: &Sample, b: &Sample) -> Ordering {
    let pairs = numbers(a).into_iter().zip(numbers(b));
    pairs.fold(Ordering::Equal, |before, (a, b)| {
        before.then_with(|| a.total_cmp(&b))
    })
}

/// Reports rows that are those of an earlier time again. Returns whether there are none.
pub(super) fn checked(samples: &[Sample], findings: &mut Vec<Finding>) -> bool {
    let moves = |place: &usize| samples[*place].velocity.norm() > MOVES;
    let mut places: Vec<usize> = (0..samples.len()).filter(moves).collect();
    places.sort_by(|a, b| compared(&samples[*a], &samples[*b]).then(a.cmp(b)));
    // Each row that is there again: where, and where before.
    let mut again: Vec<(usize, usize)> = places
        .windows(2)
        .filter(|pair| compared(&samples[pair[0]], &samples[pair[1]]).is_eq())
        .map(|pair| (pair[1], pair[0]))
        .collect();
    again.sort_unstable();
    let runs = again.chunk_by(|a, b| b.0 == a.0 + 1 && b.1 == a.1 + 1);
    let Some(longest) = runs
        .filter(|run| run.len() >= FEWEST)
        .max_by_key(|run| run.len())
    else {
        return true;
    };
    let time = |place: usize| samples[place].time - samples[0].time;
    let (first, last) = (longest[0], longest[longest.len() - 1]);
    findings.push(Finding {
        channel: Channel::Position,
        remedy: Remedy::Reported,
        sentence: format!(
            "the {} rows from {:.1} to {:.1} s are those from {:.1} s again: one of both is no measurement",
            longest.len(),
            time(first.0),
            time(last.0),
            time(first.1)
        ),
    });
    false
}
