//! Sensors that moved on their segments: the first pose again, and joints that no person bends so.

use bodyflight_core::suit::range::beyond;
use bodyflight_core::suit::rest::Rest;
use bodyflight_core::suit::set::SuitPosture;
use bodyflight_core::{Segment, SegmentArray};
use nalgebra::Vector3;

use super::stream::Stream;

/// Time over which a joint must be beyond its range (s).
const LASTING: f64 = 1.0;
/// Share of a radian that it must be beyond it in the mean.
const BEYOND: f64 = 0.08;
/// Angle from the first pose from which a sensor moved, besides three standard deviations (rad).
const MOVED: f64 = 0.35;
/// Angle of up at the pelvis from the first pose within which it is the same pose (rad).
const SAME: f64 = 0.35;
/// Length of a rest in which a pose is compared (s).
const REST: f64 = 1.0;

/// A joint that is beyond its range for some time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Bent {
    pub(super) segments: [Segment; 2],
    pub(super) begin_s: f64,
}

/// Watches the joints of a flight.
pub(super) struct Joints {
    mean: SegmentArray<f64>,
    since: SegmentArray<f64>,
    pub(super) bent: Vec<Bent>,
}

impl Joints {
    pub(super) fn new() -> Self {
        Self {
            mean: SegmentArray::from_fn(|_| 0.0),
            since: SegmentArray::from_fn(|_| 0.0),
            bent: Vec::new(),
        }
    }

    /// Takes the posture at a time (s), `step` (s) after the last.
    pub(super) fn take(&mut self, time: f64, step: f64, seen: &SuitPosture<f64>) {
        let turned = seen.orientations.map(|_, found| found.body_from_segment);
        for (segment, found) in seen.orientations.iter() {
            let Some((of, by)) = beyond(segment, &turned) else {
                continue;
            };
            if !found.is_measured || !seen.orientations[of].is_measured {
                continue;
            }
            let mean = &mut self.mean[segment];
            if *mean < 0.5 * BEYOND {
                self.since[segment] = time;
            }
            *mean += (by - *mean) * (step / (step + LASTING));
            if *mean > BEYOND && self.bent.iter().all(|bent| bent.segments[0] != segment) {
                self.bent.push(Bent {
                    segments: [segment, of],
                    begin_s: self.since[segment],
                });
            }
        }
    }
}

/// The first pose, and what is left of it whenever the person stands like that again.
pub(super) struct FirstPose {
    up: Vector3<f64>,
    /// Since when all sensors rest (s).
    resting: Option<f64>,
    /// Sensors that moved, and by how much (rad).
    pub(super) moved: Vec<(Segment, f64)>,
}

impl FirstPose {
    /// `up` is that of the pelvis' sensor in the first pose.
    pub(super) fn new(up: Vector3<f64>) -> Self {
        Self {
            up,
            resting: None,
            moved: Vec::new(),
        }
    }

    /// Takes the posture on the ground at a time (s).
    pub(super) fn take(
        &mut self,
        time: f64,
        sensors: &[(Segment, &Stream)],
        posture: impl Fn() -> SuitPosture<f64>,
    ) {
        let since = *self.resting.get_or_insert(time);
        if time - since < REST {
            return;
        }
        self.resting = None;
        let rests = sensors.iter().map(|(segment, stream)| {
            let mut rest = Rest::default();
            stream
                .within([since, time])
                .for_each(|(_, reading)| rest.take(reading));
            (*segment, rest)
        });
        let rests: Vec<_> = rests.collect();
        let pelvis = rests.iter().find(|(s, _)| *s == Segment::Pelvis);
        let is_same = pelvis
            .and_then(|(_, rest)| rest.up())
            .is_some_and(|up| up.angle(&self.up) < SAME);
        if !is_same || !rests.iter().all(|(_, rest)| rest.is_still()) {
            return;
        }
        let seen = posture();
        for (segment, _) in sensors {
            let found = &seen.orientations[*segment];
            let by = found.body_from_segment.angle();
            let is_known = self.moved.iter().any(|(moved, _)| moved == segment);
            if found.is_measured && !is_known && by > MOVED + 3.0 * found.deviation() {
                self.moved.push((*segment, by));
            }
        }
    }
}
