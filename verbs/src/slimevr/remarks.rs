//! What is to be said of trackers.

use std::collections::BTreeMap;

use bodyflight_core::Segment;
use bodyflight_mocap::slimevr::Tracker;
use bodyflight_mocap::slimevr::record::{Assignment, acceleration_turn_deg, fusion, sensor_name};
use bodyflight_mocap::slimevr::server::Server;

/// Silence that is said (s).
const SILENCE: f64 = 1.0;
/// Share of lost packets, and of orientations without an acceleration, from which it is said.
const MUCH: f64 = 0.05;
/// Version of the protocol from which accelerations are turned on the tracker.
const TURNED_SINCE: u32 = 22;

/// What is to be said of a tracker that restarted, by the time of the first packet after it (s).
pub fn restarted(time: f64) -> String {
    format!(
        "it restarted before {time:.1} s: its heading is another one from there on, and import doubts it if that was after the first pose of the calibration"
    )
}

/// What is to be said of a tracker.
pub(super) fn about(tracker: &Tracker, time: f64, warnings: &mut Vec<String>) {
    let name = &tracker.name;
    let mut say = |text: String| warnings.push(format!("{name}: {text}"));
    let (failures, code) = tracker.errors;
    if failures > 0 {
        say(format!(
            "it reported {failures} failures of a sensor, the last with code {code}"
        ));
    }
    if tracker.samples() == 0 {
        say("it introduced itself, but sent no orientation: does its sensor work?".to_owned());
        return;
    }
    let silent = tracker.silent_s(time);
    if silent > SILENCE {
        say(format!(
            "nothing has come from it for {silent:.1} s: its battery may be empty"
        ));
    }
    if tracker.longest_silence_s > SILENCE {
        say(format!(
            "it was silent for up to {:.1} s",
            tracker.longest_silence_s
        ));
    }
    for time in &tracker.restarted_s {
        say(restarted(*time));
    }
    let packets = (tracker.received() + tracker.lost()).max(1) as f64;
    if tracker.unused as f64 > MUCH * packets {
        say(format!(
            "{} of its packets came too late to be used: do two trackers send from its address?",
            tracker.unused
        ));
    }
    let lost = tracker.lost() as f64 / packets;
    if lost > MUCH {
        say(format!(
            "{:.1} % of its packets were lost: place the access point nearer, or use another channel",
            100.0 * lost
        ));
    }
    let bare: u64 = tracker
        .sensors
        .values()
        .map(|own| own.without_acceleration)
        .sum();
    if bare as f64 > MUCH * tracker.samples() as f64 {
        say(format!(
            "{bare} of {} orientations came without an acceleration, and import leaves them out",
            tracker.samples()
        ));
    }
    let protocol = tracker.handshake.protocol;
    if protocol < TURNED_SINCE {
        say(format!(
            "its firmware speaks version {protocol} of the protocol, whose accelerations follow the chip and not the tracker: the mapping has acceleration_turn_deg = {}, which is right for chips that are mounted as in SlimeVR's own trackers",
            acceleration_turn_deg(protocol)
        ));
    }
}

/// Sensors whose orientations are not made in the same way.
pub(super) fn fusions(server: &Server, doubts: &mut Vec<String>) {
    let mut by_fusion: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for tracker in server.trackers() {
        for (number, state) in &tracker.sensors {
            if let Some(fusion) = fusion(state).filter(|_| state.samples > 0) {
                let name = sensor_name(tracker, *number);
                by_fusion.entry(fusion).or_default().push(name);
            }
        }
    }
    if by_fusion.len() > 1 {
        let each = by_fusion.iter();
        let each: Vec<String> = each
            .map(|(fusion, names)| format!("{fusion} ({})", names.join(", ")))
            .collect();
        doubts.push(format!(
            "the trackers make orientations in different ways, {}: what differs becomes posture; wear trackers of one kind",
            each.join(" and ")
        ));
    }
    for (fusion, names) in &by_fusion {
        if fusion.contains("magnetometer") {
            doubts.push(format!(
                "the magnetometer is used in {}: it is off by tens of degrees indoors and near metal; switch it off",
                names.join(", ")
            ));
        }
    }
}

/// Trackers that should be worn and are not there, or sent nothing.
pub(super) fn missing(server: &Server, worn: &[Assignment], warnings: &mut Vec<String>) {
    for one in worn {
        let is_there = server.trackers().iter().any(|tracker| {
            let sensor = tracker.sensors.get(&one.sensor);
            tracker.name == one.tracker && sensor.is_some_and(|sensor| sensor.samples > 0)
        });
        if !is_there {
            warnings.push(format!(
                "nothing came from the tracker {} for {}",
                one.tracker,
                Segment::name(one.segment)
            ));
        }
    }
}
