//! What the drawings of a page share: colours of the phases, axes, lines of few points.

use bodyflight_falls::fall::Jump;

/// Colours of a line and of the background of each phase on the ground or in the aircraft, in the fall, at the opening,
/// and under canopy.
pub(super) const PHASES: [(&str, &str, &str); 4] = [
    ("before", "#888888", "#ffffff"),
    ("fall", "#c8352c", "#fbe9e7"),
    ("opening", "#c98a00", "#fff4d6"),
    ("canopy", "#1f6fb2", "#e6f1fa"),
];

/// Most points of a line: more are not seen.
const MOST: usize = 700;

/// The phases of a jump that are on the track: place in [`PHASES`], first and last time (s).
pub(super) fn phases(jump: &Jump) -> Vec<(usize, [f64; 2])> {
    let (Some(first), Some(last)) = (jump.samples.first(), jump.samples.last()) else {
        return Vec::new();
    };
    let [begin, end] = jump.times.fall;
    let open = jump.times.canopy.map(|canopy| canopy.time);
    let landing = jump.times.landing.map_or(last.time, |landing| landing.time);
    let mut phases = vec![(0, [first.time, begin]), (1, [begin, end])];
    if jump.times.opening.is_some() {
        let open = open.unwrap_or(end).max(end);
        phases.push((2, [end, open]));
        phases.push((3, [open, landing.max(open)]));
    }
    phases.push((0, [landing, last.time]));
    phases.retain(|(_, [from, to])| to > from);
    phases
}

/// The times that are drawn: from shortly before the fall to shortly after the landing.
pub(super) fn shown(jump: &Jump) -> [f64; 2] {
    let (first, last) = match (jump.samples.first(), jump.samples.last()) {
        (Some(first), Some(last)) => (first.time, last.time),
        _ => (0.0, 1.0),
    };
    let landing = jump
        .times
        .landing
        .map_or(last, |landing| landing.time + 10.0);
    let from = (jump.times.fall[0] - 20.0).max(first);
    [from, landing.min(last).max(from + 1.0)]
}

/// Every so many-th of the points, so that few enough are left; the last one stays.
pub(super) fn thinned(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let every = points.len().div_ceil(MOST).max(1);
    let kept = points.iter().step_by(every).chain(points.last());
    kept.copied().collect()
}

/// A range of values on an axis of the drawing.
#[derive(Debug, Clone, Copy)]
pub(super) struct Axis {
    low: f64,
    high: f64,
    from: f64,
    to: f64,
}

impl Axis {
    /// The axis from `low` at `from` to `high` at `to` (pixels).
    pub(super) fn new([low, high]: [f64; 2], [from, to]: [f64; 2]) -> Self {
        let high = if high > low { high } else { low + 1.0 };
        Self {
            low,
            high,
            from,
            to,
        }
    }

    /// The place of a value (pixels); places beyond the ends are those of the ends.
    pub(super) fn at(&self, value: f64) -> f64 {
        let share = ((value - self.low) / (self.high - self.low)).clamp(0.0, 1.0);
        self.from + share * (self.to - self.from)
    }

    /// Round values on the axis, about `count` of them.
    pub(super) fn ticks(&self, count: f64) -> Vec<f64> {
        let step = round_step((self.high - self.low) / count);
        let mut ticks = Vec::new();
        let mut tick = (self.low / step).ceil() * step;
        while tick <= self.high && ticks.len() < 100 {
            ticks.push(tick);
            tick += step;
        }
        ticks
    }
}

/// The nearest of 1, 2 or 5 times a power of ten that is not smaller.
pub(super) fn round_step(about: f64) -> f64 {
    let power = 10.0_f64.powf(about.max(1e-9).log10().floor());
    let factor = [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .find(|factor| factor * power >= about);
    factor.unwrap_or(10.0) * power
}

/// A line through points (pixels).
pub(super) fn line(points: &[[f64; 2]], colour: &str, width: f64) -> String {
    let places: Vec<String> = points
        .iter()
        .map(|[x, y]| format!("{x:.1},{y:.1}"))
        .collect();
    format!(
        "<polyline fill=\"none\" stroke=\"{colour}\" stroke-width=\"{width}\" points=\"{}\"/>",
        places.join(" ")
    )
}

/// The parts of a track's points that no missing fix divides, at times and values.
pub(super) fn parts(
    jump: &Jump,
    [from, to]: [f64; 2],
    value: impl Fn(&bodyflight_falls::Sample) -> f64,
) -> Vec<Vec<[f64; 2]>> {
    let gap = bodyflight_falls::longest_step(&jump.samples);
    jump.samples
        .chunk_by(|one, next| next.time - one.time <= gap)
        .map(|part| {
            let part = part
                .iter()
                .filter(|sample| (from..=to).contains(&sample.time));
            let points: Vec<[f64; 2]> = part.map(|sample| [sample.time, value(sample)]).collect();
            thinned(&points)
        })
        .filter(|part| part.len() > 1)
        .collect()
}

/// Text in which no character begins a tag or ends an attribute.
pub(super) fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_places_stay_in_the_drawing() {
        let axis = Axis::new([0.0, 4321.0], [100.0, 0.0]);
        assert_eq!(axis.ticks(5.0), [0.0, 1000.0, 2000.0, 3000.0, 4000.0]);
        assert!((axis.at(9e9) - 0.0).abs() < 1e-9 && (axis.at(-1.0) - 100.0).abs() < 1e-9);
        assert!((round_step(0.3) - 0.5).abs() < 1e-12);
    }
}
