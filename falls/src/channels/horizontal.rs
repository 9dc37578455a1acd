//! Horizontal positions against velocities.

use nalgebra::{Matrix2, Vector2};

use super::compare::{
    Channel, FEWEST, Finding, MOVES, Remedy, displacement, is_alike, speed_unit, windows,
};
use super::derived::velocities;
use crate::{Sample, median};

/// Smallest median cosine between the displacements by positions and by velocities.
const SAME_WAY: f64 = 0.97;

/// Share of moving windows of one channel in which the other moves, below which it does not follow.
const FOLLOWS: f64 = 0.1;

/// Axes that were exchanged or turned round, in the axes north and west.
const TURNED: [(&str, Matrix2<f64>); 4] = [
    (
        "the northward velocities have the opposite sign",
        Matrix2::new(-1.0, 0.0, 0.0, 1.0),
    ),
    (
        "the eastward velocities have the opposite sign",
        Matrix2::new(1.0, 0.0, 0.0, -1.0),
    ),
    (
        "both horizontal velocities have the opposite sign",
        Matrix2::new(-1.0, 0.0, 0.0, -1.0),
    ),
    (
        "northward and eastward velocities are exchanged",
        Matrix2::new(0.0, -1.0, -1.0, 0.0),
    ),
];

/// Compares horizontal positions with velocities; converts or replaces what is wrong. Returns whether the horizontal
/// motion is known.
pub(super) fn checked(
    samples: &mut [Sample],
    has_places: bool,
    findings: &mut Vec<Finding>,
) -> bool {
    let pairs: Vec<[Vector2<f64>; 2]> = windows(samples)
        .into_iter()
        .map(|window| {
            let [first, last] = window;
            [
                (samples[last].position - samples[first].position).xy(),
                displacement(samples, window).xy(),
            ]
        })
        .collect();
    let moves = |place: usize| {
        pairs
            .iter()
            .filter(|pair| pair[place].norm() > MOVES)
            .count()
    };
    let (by_place, by_velocity) = (moves(0), moves(1));
    if samples.iter().all(|sample| sample.across() == 0.0) && by_place == 0 {
        findings.push(finding(
            Remedy::NotUsed,
            "the horizontal velocities are all zero: the horizontal motion is not known".to_owned(),
        ));
        return false;
    }
    if by_place.max(by_velocity) < FEWEST {
        return has_places || by_velocity > 0;
    }
    if (by_place as f64) < FOLLOWS * by_velocity as f64 {
        if has_places {
            findings.push(Finding {
                channel: Channel::Position,
                remedy: Remedy::NotUsed,
                sentence: "the positions hardly change while the horizontal velocities do: the positions are not used"
                    .to_owned(),
            });
        }
        return true;
    }
    if let Some(axis) = (0..2).find(|axis| is_empty(samples, &pairs, *axis)) {
        replace(samples);
        let name = ["north", "east"][axis];
        findings.push(finding(
            Remedy::NotUsed,
            format!(
                "the {name}ward velocities are all zero while the positions change: the horizontal velocities are not used; \
                 they are derived from the positions"
            ),
        ));
        return true;
    }
    mended(samples, &pairs, by_place, findings);
    true
}

/// Whether one of the velocities is always zero while the positions move along its axis, and the other one is not.
fn is_empty(samples: &[Sample], pairs: &[[Vector2<f64>; 2]], axis: usize) -> bool {
    let is_zero = |axis: usize| samples.iter().all(|sample| sample.velocity[axis] == 0.0);
    let moves = pairs.iter().filter(|pair| pair[0][axis].abs() > MOVES);
    is_zero(axis) && !is_zero(1 - axis) && moves.count() >= FEWEST
}

/// Mends velocities by the displacements according to positions and to velocities, `pairs`; `by_place` of them move.
fn mended(
    samples: &mut [Sample],
    pairs: &[[Vector2<f64>; 2]],
    by_place: usize,
    findings: &mut Vec<Finding>,
) {
    let moving: Vec<&[Vector2<f64>; 2]> = (pairs.iter())
        .filter(|[place, velocity]| place.norm() > MOVES && velocity.norm() > 0.25 * MOVES)
        .collect();
    let follows = moving.len() as f64 >= FOLLOWS * by_place as f64;
    let ratio = median(
        moving
            .iter()
            .map(|[place, displacement]| place.norm() / displacement.norm()),
    );
    let same_way = |turned: &Matrix2<f64>| {
        let cosines = moving.iter().map(|[place, displacement]| {
            place.dot(&(turned * displacement)) / (place.norm() * displacement.norm())
        });
        median(cosines).is_some_and(|cosine| cosine > SAME_WAY)
    };
    let (Some(ratio), true) = (ratio, follows) else {
        replace(samples);
        findings.push(finding(
            Remedy::NotUsed,
            "the horizontal velocities hardly change while the positions do: they are not used; velocities are derived from \
             the positions"
                .to_owned(),
        ));
        return;
    };
    if same_way(&Matrix2::identity()) {
        scaled(samples, ratio, findings);
        return;
    }
    if let Some((name, turned)) = TURNED.iter().find(|(_, turned)| same_way(turned)) {
        for sample in samples.iter_mut() {
            let [x, y] = (turned * sample.velocity.xy()).into();
            (sample.velocity.x, sample.velocity.y) = (x, y);
        }
        findings.push(finding(
            Remedy::Converted,
            format!("positions and velocities disagree: {name}, which is corrected"),
        ));
        scaled(samples, ratio, findings);
        return;
    }
    let has_no_sign = (0..2).all(|axis| {
        let values = || samples.iter().map(|sample| sample.velocity[axis]);
        values().all(|value| value >= -1e-9) || values().all(|value| value <= 1e-9)
    });
    replace(samples);
    findings.push(finding(
        Remedy::NotUsed,
        format!(
            "positions and velocities disagree: {}; they are not used, and velocities are derived from the positions",
            if has_no_sign {
                "the horizontal velocities have no sign"
            } else {
                "the horizontal velocities point elsewhere"
            }
        ),
    ));
}

/// Converts velocities of the right direction but another unit.
fn scaled(samples: &mut [Sample], ratio: f64, findings: &mut Vec<Finding>) {
    if is_alike(ratio, 1.0) {
        return;
    }
    if let Some(unit) = speed_unit(ratio) {
        for sample in samples {
            sample.velocity.x *= unit.factor;
            sample.velocity.y *= unit.factor;
        }
        findings.push(finding(
            Remedy::Converted,
            format!(
                "positions and horizontal velocities disagree by a factor of {ratio:.2}: the velocities are in {}, and are \
                 converted to metres per second",
                unit.name
            ),
        ));
        return;
    }
    // Slow and curved tracks of coarse positions may differ by some per cent, which decides nothing.
    if is_alike(ratio / (1.0 + ratio), 0.5) {
        return;
    }
    replace(samples);
    findings.push(finding(
        Remedy::NotUsed,
        format!(
            "positions and horizontal velocities disagree by a factor of {ratio:.2}: the velocities are not used, and are \
             derived from the positions"
        ),
    ));
}

fn finding(remedy: Remedy, sentence: String) -> Finding {
    Finding {
        channel: Channel::HorizontalVelocity,
        remedy,
        sentence,
    }
}

/// Replaces the horizontal velocities by those of the positions.
fn replace(samples: &mut [Sample]) {
    let derived = velocities(samples);
    for (sample, velocity) in samples.iter_mut().zip(derived) {
        sample.velocity.x = velocity.x;
        sample.velocity.y = velocity.y;
    }
}
