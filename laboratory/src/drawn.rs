//! Draws loads from the grammar by a seed, so that hidden loads are not hand-picked.

use core::f64::consts::FRAC_PI_2;

use bodyflight_core::Segment;
use bodyflight_core::dynamics::applied_load::factor::{FACTORS, Factor};
use bodyflight_core::dynamics::applied_load::{AppliedLoad, Axis, Direction, Kind, Point};
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};

/// Sizes: moments (N m), forces on the body and on a segment (N).
const MOMENTS: [f64; 2] = [12.0, 30.0];
const FORCES: [f64; 2] = [80.0, 200.0];
const ON_SEGMENT: [f64; 2] = [30.0, 80.0];

/// Elbows and knees: the axis about which they bend, and their bend in the neutral posture (rad). A load that grows with
/// any other angle hardly acts, and one that acts in the neutral posture already is mostly a constant, which no flight can
/// tell from errors of the joints.
const HINGES: [(Segment, Axis, f64); 4] = [
    (Segment::LeftForearm, Axis::Y, -FRAC_PI_2),
    (Segment::RightForearm, Axis::Y, FRAC_PI_2),
    (Segment::LeftShank, Axis::X, 1.0),
    (Segment::RightShank, Axis::X, 1.0),
];

fn between(random: &mut ChaCha8Rng, [low, high]: [f64; 2]) -> f64 {
    low + (high - low) * random.random::<f64>()
}

fn one_of<V: Copy>(random: &mut ChaCha8Rng, values: &[V]) -> V {
    values[random.random_range(0..values.len())]
}

/// A load drawn from the grammar.
pub fn drawn(seed: u64) -> AppliedLoad<f64> {
    let mut random = ChaCha8Rng::seed_from_u64(seed ^ 0x10ad);
    let axis = one_of(&mut random, &Axis::ALL);
    let (kind, direction, sizes) = match random.random_range(0..5) {
        0 | 1 => (Kind::Moment, Direction::Body(axis), MOMENTS),
        2 => (Kind::Force(Point::Body), Direction::World(axis), FORCES),
        3 => (Kind::Force(Point::Body), Direction::Body(axis), FORCES),
        _ => {
            let segment = Segment::ALL[random.random_range(1..Segment::ALL.len())];
            (
                Kind::Force(Point::Segment(segment)),
                Direction::Body(axis),
                ON_SEGMENT,
            )
        }
    };
    let size = between(&mut random, sizes) * one_of(&mut random, &[-1.0, 1.0]);
    let mut factors = [None; FACTORS];
    factors[0] = Some(factor(&mut random));
    // Half of the loads also depend on the speed, as aerodynamic loads do.
    if random.random::<bool>() {
        factors[1] = Some(Factor::SpeedSquared { reference: 50.0 });
    }
    AppliedLoad {
        kind,
        direction,
        size,
        factors,
    }
}

fn factor(random: &mut ChaCha8Rng) -> Factor<f64> {
    match random.random_range(0..4) {
        0 | 1 => Factor::Sine {
            frequency: between(random, [0.4, 4.5]),
            phase: between(random, [-3.0, 3.0]),
        },
        2 => {
            let period = between(random, [3.0, 8.0]);
            Factor::Pulse {
                start: period * random.random::<f64>(),
                duration: between(random, [0.15, 0.4]) * period,
                period,
            }
        }
        _ => {
            let (segment, axis, from) = one_of(random, &HINGES);
            Factor::Joint {
                segment,
                axis,
                from,
                reference: between(random, [0.3, 0.6]),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use bodyflight_core::body::pattern;

    use super::*;

    #[test]
    fn hinges_are_bent_as_stated_in_the_neutral_posture() {
        let neutral = pattern::neutral::<f64>();
        for (segment, axis, bend) in HINGES {
            let turn = neutral.parent_from_segment(segment).scaled_axis();
            let off = turn - axis.unit::<f64>() * bend;
            assert!(off.norm() < 1e-9, "{segment:?}: {turn}");
        }
    }

    #[test]
    fn seeds_draw_loads_of_all_kinds() {
        let all: Vec<AppliedLoad<f64>> = (0..40).map(drawn).collect();
        let moments = all.iter().filter(|load| load.kind == Kind::Moment).count();
        assert!((8..28).contains(&moments), "{moments}");
        let pulses = all
            .iter()
            .filter(|load| matches!(load.factors[0], Some(Factor::Pulse { .. })));
        assert!(pulses.count() >= 4);
        assert_eq!(drawn(7), drawn(7));
        assert_ne!(drawn(7), drawn(8));
    }
}
