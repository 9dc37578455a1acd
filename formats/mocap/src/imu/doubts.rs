//! What is wrong with sensors, in sentences, and which segments it concerns.

use bodyflight_core::suit::watch::Fault;
use bodyflight_core::{Segment, SegmentArray};

use super::arc::Turned;
use super::checks::Bent;
use super::clocks::Late;
use super::exchange::Exchange;
use super::mapping::{ImuMapping, SensorRow};
use super::stream::Stream;

/// Standard deviation of a segment whose sensor is doubted (rad): little is known of it.
const DOUBTED: f64 = 0.7;
/// Gap after which a direction is not known any more (s).
const LONG_GAP: f64 = 0.5;

/// Part of the name of a fusion that follows the Earth's magnetic field.
const MAGNETOMETER: &str = "magnetometer";

/// Doubts, in the order in which they were found.
#[derive(Debug, Default)]
pub(super) struct Doubts {
    pub(super) said: Vec<String>,
    segments: Vec<Segment>,
}

impl Doubts {
    fn add(&mut self, segments: &[Segment], said: String) {
        self.segments.extend(segments);
        self.said.push(said);
    }

    /// The segments whose sensors something has been said of, each once, in the order of the core.
    pub(super) fn of(&self) -> Vec<Segment> {
        let all = Segment::ALL.into_iter();
        all.filter(|segment| self.concerns(*segment)).collect()
    }

    /// Whether something has been said of a segment's sensor.
    fn concerns(&self, segment: Segment) -> bool {
        self.segments.contains(&segment)
    }

    /// Sensors whose orientations are made in another way than those of most others, or with a magnetometer.
    pub(super) fn fused(&mut self, rows: &[(Segment, &SensorRow)]) {
        let named = rows
            .iter()
            .filter_map(|(segment, row)| Some((*segment, row.fusion.as_deref()?)));
        let named: Vec<(Segment, &str)> = named.collect();
        let count_of = |name: &str| named.iter().filter(|(_, own)| *own == name).count();
        // The first of the most frequent, which is that of the pelvis if there is a choice.
        let usual = named
            .iter()
            .rev()
            .max_by_key(|(_, name)| count_of(name))
            .map(|(_, name)| *name);
        for (segment, name) in &named {
            let sensor = segment.name();
            if usual.is_some_and(|usual| usual != *name) {
                let usual = usual.unwrap_or_default();
                self.add(&[*segment], format!(
                    "the orientations of the sensor {sensor} are made by {name}, those of others by {usual}: what differs between fusions becomes posture; wear sensors of one kind"
                ));
            } else if name.contains(MAGNETOMETER) {
                self.add(&[*segment], format!(
                    "the orientations of the sensor {sensor} are made with a magnetometer, which is off by tens of degrees indoors and near metal: switch it off"
                ));
            }
        }
    }

    /// Sensors that began again between the first pose (s) and the end of the flight. Without the pelvis' direction none is
    /// known.
    pub(super) fn restarted(
        &mut self,
        mapping: &ImuMapping,
        sensors: &[(Segment, &Stream)],
        first_pose_s: f64,
        flight: [f64; 2],
    ) {
        for (segment, stream) in sensors {
            let is_between = |[last, first]: &&[f64; 2]| *first > first_pose_s && *last < flight[1];
            let Some(when) = stream.restarts.iter().find(is_between) else {
                continue;
            };
            let said = restarted(mapping, *segment, *when, flight[0]);
            match segment {
                Segment::Pelvis => {
                    let all: Vec<Segment> = sensors.iter().map(|(segment, _)| *segment).collect();
                    self.add(&all, said);
                }
                _ => self.add(&[*segment], said),
            }
        }
    }

    pub(super) fn exchanged(&mut self, found: Option<Exchange>) {
        let Some(Exchange { pairs, why }) = found else {
            return;
        };
        let names = pairs
            .iter()
            .map(|pair| pair.map(Segment::name).join(" and "));
        let names = names.collect::<Vec<_>>().join(", and ");
        let segments: Vec<Segment> = pairs.into_iter().flatten().collect();
        self.add(
            &segments,
            format!(
                "the sensors {names} are exchanged: {why}; exchange their files in the mapping"
            ),
        );
    }

    pub(super) fn late(&mut self, found: &[Late]) {
        for late in found {
            self.add(&[late.segment], late.said());
        }
    }

    pub(super) fn moved(&mut self, found: &[(Segment, f64)]) {
        for (segment, by) in found {
            if self.concerns(*segment) {
                continue;
            }
            let name = segment.name();
            self.add(&[*segment], format!(
                "the sensor {name} is {:.0} degrees from where it was when the person stood like this first: it slipped, or was turned; fasten it and calibrate again",
                by.to_degrees()
            ));
        }
    }

    /// What the readings of the flight show by themselves.
    pub(super) fn read(
        &mut self,
        mapping: &ImuMapping,
        sensors: &[(Segment, &Stream)],
        flight: [f64; 2],
    ) {
        self.clipped(mapping, sensors, flight);
        self.lost(sensors, flight);
    }

    pub(super) fn failed(&mut self, found: impl Iterator<Item = (Segment, Fault)>) {
        for (segment, fault) in found {
            let name = segment.name();
            let said = match fault {
                Fault::Dead => format!("the sensor {name} sends nothing new at the end"),
                Fault::Slipped if self.concerns(segment) => continue,
                Fault::Slipped => format!(
                    "the sensor {name} feels another force than its neighbour: it slipped, its clock is off, or its axes are not what they are said to be"
                ),
                Fault::Saturated => format!(
                    "the sensor {name} reached the end of its range: turns beyond it are lost"
                ),
            };
            self.add(&[segment], said);
        }
    }

    /// Gaps in the flight after which a direction is not known.
    fn lost(&mut self, sensors: &[(Segment, &Stream)], [from, to]: [f64; 2]) {
        for (segment, stream) in sensors {
            let within = |gap: &&[f64; 2]| gap[0] + gap[1] > from && gap[0] < to;
            let longest = stream
                .gaps
                .iter()
                .filter(within)
                .max_by(|a, b| a[1].total_cmp(&b[1]));
            if let Some([begin, length]) = longest.filter(|gap| gap[1] > LONG_GAP) {
                let name = segment.name();
                self.add(&[*segment], format!(
                    "the sensor {name} sent nothing for {length:.1} s from {:.1} s of the flight on, expected less than {LONG_GAP} s: how it turned meanwhile is not known",
                    begin - from
                ));
            }
        }
    }

    /// Rates that are cut off, if the range is not given.
    fn clipped(&mut self, mapping: &ImuMapping, sensors: &[(Segment, &Stream)], flight: [f64; 2]) {
        for (segment, stream) in sensors {
            let row = mapping.sensors.get(segment.name());
            let is_given = row.is_some_and(|row| row.range_dps.is_some());
            let Some(limit) = stream.clipped_at(flight).filter(|_| !is_given) else {
                continue;
            };
            let name = segment.name();
            self.add(&[*segment], format!(
                "the sensor {name} reads {:.0} deg/s many times in a row, and never more: it reached the end of its range, and turns beyond it are lost; set a greater range",
                limit.to_degrees()
            ));
        }
    }

    /// The sensor on the pelvis, with which the flight ends, ended before the others by this time (s). That is remarked if
    /// nobody says how long the flight was: sensors are switched off one after another.
    pub(super) fn ended(&mut self, early_s: f64, is_end_given: bool) -> Option<String> {
        if early_s <= LONG_GAP {
            return None;
        }
        if is_end_given {
            self.add(&[Segment::Pelvis], format!(
                "the sensor pelvis sends nothing for the last {early_s:.1} s of the flight, which ends with it"
            ));
            return None;
        }
        Some(format!(
            "the sensor pelvis ends {early_s:.1} s before the others, and the flight with it: if it was not over by then, the sensor died"
        ))
    }

    /// Sensors that turned on the spot.
    pub(super) fn turned(&mut self, found: impl Iterator<Item = (Segment, Turned)>) {
        for (segment, turned) in found {
            if self.concerns(segment) {
                continue;
            }
            let name = segment.name();
            self.add(&[segment], format!(
                "at {:.1} s of the flight the sensor {name} turns by {:.0} degrees, and what it feels of the arc on which that would swing it is {:.0} %: it turned on its segment; fasten it and calibrate again",
                turned.begin_s,
                turned.by.to_degrees(),
                100.0 * turned.share.max(0.0)
            ));
        }
    }

    /// Joints beyond their range. A sensor that is part of two of them is the one that moved.
    pub(super) fn bent(&mut self, found: &[Bent]) {
        let joints_of = |segment: &Segment| {
            let has_part = |bent: &&Bent| bent.segments.contains(segment);
            found.iter().filter(has_part).count()
        };
        for Bent { segments, begin_s } in found {
            if segments.iter().any(|segment| self.concerns(*segment)) {
                continue;
            }
            if let Some(segment) = segments.iter().find(|segment| joints_of(segment) > 1) {
                let name = segment.name();
                self.add(&[*segment], format!(
                    "from {begin_s:.1} s of the flight on, {name} is turned to its neighbours as none is: its sensor slipped, or was turned after the calibration; fasten it and calibrate again"
                ));
                continue;
            }
            let [one, other] = segments.map(Segment::name);
            self.add(segments, format!(
                "from {begin_s:.1} s of the flight on, {one} bends from {other} as no joint does: one of their sensors slipped, or was turned after the calibration; fasten it and calibrate again"
            ));
        }
    }

    /// Standard deviations (rad), those of doubted segments as wide as is fit.
    pub(super) fn widened(&self, stated: &SegmentArray<f64>) -> SegmentArray<f64> {
        stated.map(|segment, deviation| match self.concerns(segment) {
            true => deviation.max(DOUBTED),
            false => *deviation,
        })
    }
}

/// What to say of a sensor that began again after its last sample before (s) and the first after it.
pub(super) fn restarted(
    mapping: &ImuMapping,
    segment: Segment,
    [last, first]: [f64; 2],
    begin: f64,
) -> String {
    let name = segment.name();
    let file = mapping.sensors.get(name).and_then(|row| row.file.as_ref());
    let file = file.map_or(String::new(), |file| format!(" ({})", file.display()));
    let (what, next) = if last > begin {
        // A moment before its last sample.
        let end = (10.0 * last).floor() / 10.0;
        (
            format!(
                "restarted at {first:.1} s, {:.1} s after the begin of the flight",
                first - begin
            ),
            format!("end the flight before it, with end_s = {end:.1} in [flight]"),
        )
    } else {
        (
            format!(
                "restarted at {first:.1} s, between the first pose of the calibration and the flight"
            ),
            "calibrate again after a tracker restarted".to_owned(),
        )
    };
    format!("the tracker of {name}{file} {what}: its heading is another one from there on; {next}")
}
