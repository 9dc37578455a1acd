//! How late the velocities of a recording are by its places: both record one path, so no physics is needed.

use bodyflight_core::effect::Effect;
use bodyflight_core::flight_sample::FlightSample;
use bodyflight_discovery::input::flight::RecordedFlight;
use bodyflight_discovery::output::report::Report;
use nalgebra::Vector3;

/// Time over which displacements are compared (s).
const PIECE: f64 = 0.2;
/// Share of the way by velocities that the places must have: a recording without places stays where it is.
const MOVES: f64 = 0.5;
/// Standard errors beyond which two latencies contradict each other: one of a thousand by chance.
const SURE: f64 = 3.3;

/// Sums over pieces in which the velocity changes.
#[derive(Default)]
struct Sums {
    count: f64,
    change_change: f64,
    change_behind: f64,
    behind_behind: f64,
    ways: [f64; 2],
}

impl Sums {
    /// Takes a piece: the displacement by places, by velocities, and the change of the velocity.
    fn add(&mut self, moved: Vector3<f64>, by_velocity: Vector3<f64>, change: Vector3<f64>) {
        let behind = moved - by_velocity;
        self.count += 3.0;
        self.change_change += change.norm_squared();
        self.change_behind += change.dot(&behind);
        self.behind_behind += behind.norm_squared();
        self.ways[0] += moved.norm();
        self.ways[1] += by_velocity.norm();
    }

    /// The latency, by which a velocity that is late leaves each displacement behind by its change, and its standard error
    /// (s).
    fn latency(&self) -> Option<(f64, f64)> {
        let latency = self.change_behind / self.change_change;
        let left = (self.behind_behind - latency * self.change_behind).max(0.0);
        let error = (left / (self.count - 1.0) / self.change_change).sqrt();
        let is_known = self.ways[0] > MOVES * self.ways[1] && error.is_finite();
        is_known.then_some((latency, error))
    }
}

/// The latency of the velocities by the places, and its standard error (s); `None` if the recordings have no places.
fn latency(tracks: &[RecordedFlight]) -> Option<(f64, f64)> {
    let mut sums = Sums::default();
    for track in tracks {
        let Some(mut begin) = track.samples.first() else {
            continue;
        };
        let mut by_velocity = Vector3::zeros();
        let velocity = |sample: &FlightSample| sample.motion.velocity_inertial().components;
        for pair in track.samples.windows(2) {
            let [before, here] = [&pair[0], &pair[1]];
            by_velocity += (velocity(before) + velocity(here)) * (0.5 * (here.time - before.time));
            if here.time - begin.time >= PIECE {
                let moved = here.motion.position.components - begin.motion.position.components;
                sums.add(moved, by_velocity, velocity(here) - velocity(begin));
                (begin, by_velocity) = (here, Vector3::zeros());
            }
        }
    }
    sums.latency()
}

/// The place among the names of a latency that the places of the recordings contradict, and why, in a sentence. A search
/// knows velocities and attitudes alone, and what the person's own masses do to a jump may look like a late velocity.
pub(super) fn contradicted(report: &Report, tracks: &[RecordedFlight]) -> Option<(usize, String)> {
    let name = Effect::GnssLatency.description().name;
    let at = report.effects.iter().position(|named| named.name == name)?;
    let named = &report.effects[at];
    let (_, value) = named.parameters.first()?;
    let (_, deviation) = named.standard_errors.first()?;
    let (latency, error) = latency(tracks)?;
    ((value - latency).abs() > SURE * deviation.hypot(error)).then(|| {
        let [latency, error] = [latency, error].map(|time| 1e3 * time);
        let said = format!(
            "{name} is not named: by the places, the velocities are late by {latency:.1} +- {error:.1} ms"
        );
        (at, said)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The latency that is found if velocities of a swing are late by a time (s), and places are scaled.
    fn found(late: f64, scale: f64) -> Option<(f64, f64)> {
        let mut sums = Sums::default();
        for k in 0..50 {
            let begin = 0.2 * f64::from(k);
            let place = |time: f64| Vector3::new((2.0 * time).sin(), time, (3.0 * time).cos());
            let velocity =
                |time: f64| Vector3::new(2.0 * (2.0 * time).cos(), 1.0, -3.0 * (3.0 * time).sin());
            let moved = |late: f64| place(begin + 0.2 - late) - place(begin - late);
            let change = velocity(begin + 0.2 - late) - velocity(begin - late);
            sums.add(moved(0.0) * scale, moved(late), change);
        }
        sums.latency()
    }

    #[test]
    fn a_late_velocity_leaves_the_places_behind() {
        for late in [0.0, 0.03, 0.1] {
            let (latency, error) = found(late, 1.0).unwrap();
            assert!(
                (latency - late).abs() < 0.1 * late + 1e-9 && error < 0.01,
                "{late}: {latency} +- {error}"
            );
        }
        assert_eq!(found(0.03, 0.0), None);
    }
}
