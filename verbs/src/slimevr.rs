//! `bodyflight slimevr`: what SlimeVR's trackers sent, as a folder that `import` reads.

mod remarks;

use std::fmt;
use std::path::{Path, PathBuf};

use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::interrupt;
use bodyflight_mocap::slimevr::capture::Capture;
use bodyflight_mocap::slimevr::record::{Assignment, Record, fusion, sensor_name};
use bodyflight_mocap::slimevr::server::{Counters, Server};
use bodyflight_mocap::slimevr::{SensorState, Tracker, sensor_type};
use serde::Serialize;

pub use remarks::restarted;
use remarks::{about, fusions, missing};

/// What was received.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Report {
    /// The folder with a table for each sensor and the mapping; null if nothing was written.
    pub folder: Option<PathBuf>,
    /// From the begin to the end (s).
    pub duration_s: f64,
    /// The sensors of all trackers.
    pub sensors: Vec<Sensor>,
    /// What arrived apart from them.
    pub datagrams: Counters,
    /// Remarks.
    pub warnings: Vec<String>,
    /// Why the recording should not be trusted.
    pub doubts: Vec<String>,
}

/// A sensor of a tracker.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Sensor {
    /// The tracker's network address, by which it is told apart, and the number of the sensor if it is not the first.
    pub tracker: String,
    /// The segment on which it is worn, if that was given.
    pub segment: Option<&'static str>,
    /// Its type, "unknown" if the tracker does not say.
    pub sensor_type: &'static str,
    /// What makes orientations of its readings; null if that is not known.
    pub fusion: Option<String>,
    /// The tracker's firmware; empty if it does not say.
    pub firmware: String,
    /// Version of its protocol, 0 if it does not say.
    pub protocol: u32,
    /// Orientations received.
    pub samples: u64,
    /// Of those, without an acceleration.
    pub without_acceleration: u64,
    /// Orientations a second (Hz); a tracker at rest sends fewer.
    pub rate_hz: Option<f64>,
    /// Packets of the tracker that arrived.
    pub packets: u64,
    /// Packets of the tracker that never arrived.
    pub lost_packets: u64,
    /// Packets that others overtook.
    pub late_packets: u64,
    /// Those of them that came too late to be used.
    pub unused_packets: u64,
    /// Packets that came again.
    pub repeated_packets: u64,
    /// Times the tracker restarted. Its heading is another one each time.
    pub restarts: u64,
    /// When the first packet came after each of the first sixteen (s).
    pub restarted_s: Vec<f64>,
    /// Longest time in which nothing came from the tracker (s).
    pub longest_silence_s: f64,
    /// Time since the last packet of the tracker (s).
    pub silent_s: f64,
    /// Lowest time to the tracker and back (s); null if no question came back.
    pub round_trip_s: Option<f64>,
    /// Voltage of the tracker's battery (V).
    pub battery_v: Option<f64>,
}

/// A line of `slimevr listen --json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(untagged)]
pub enum Line {
    /// The first one.
    Listening {
        /// The address at which it listens.
        listening: String,
    },
    /// Each second.
    State {
        /// Orientations a second (Hz).
        received_rate_hz: f64,
        /// Trackers that introduced themselves.
        trackers: usize,
        /// Those of which nothing comes.
        silent: Vec<String>,
        /// What arrived apart from samples.
        datagrams: Counters,
    },
    /// A tracker restarted. Its heading is another one.
    Restarted {
        /// The tracker.
        restarted: String,
        /// When the first packet came after it (s).
        time_s: f64,
    },
    /// The last one.
    Totals {
        /// What was received.
        totals: Box<Report>,
    },
}

impl Report {
    /// The state of a server at a time (s).
    pub fn of(server: &Server, time: f64, worn: &[Assignment]) -> Self {
        let mut sensors = Vec::new();
        let (mut warnings, mut doubts) = (Vec::new(), Vec::new());
        for tracker in server.trackers() {
            for (number, state) in &tracker.sensors {
                sensors.push(Sensor::of(tracker, *number, state, time, worn));
            }
            about(tracker, time, &mut warnings);
            if tracker.is_doubled {
                doubts.push(format!(
                    "{}: another tracker sends from its address or has its name, so that their orientations are mixed: give each its own",
                    tracker.name
                ));
            }
        }
        fusions(server, &mut doubts);
        missing(server, worn, &mut warnings);
        let counters = server.counters();
        if counters.impossible > 0 {
            warnings.push(format!(
                "{} packets have numbers that are none, as quaternions that are not of unit length, and are left out",
                counters.impossible
            ));
        }
        if !counters.unknown_types.is_empty() {
            let each = counters.unknown_types.iter();
            let each: Vec<String> = each
                .map(|(kind, count)| format!("{kind} ({count})"))
                .collect();
            warnings.push(format!(
                "packets of types that are not known were left out: {}",
                each.join(", ")
            ));
        }
        Self {
            folder: None,
            duration_s: time,
            sensors,
            datagrams: counters.clone(),
            warnings,
            doubts,
        }
    }

    /// The same with the folder that was written, and the samples for which there was no place in it.
    #[must_use]
    pub fn written(mut self, folder: Option<PathBuf>, refused: u64) -> Self {
        self.folder = folder;
        self.datagrams.refused += refused;
        self
    }

    /// Why the recording should not be trusted, `None` if nothing speaks against it.
    pub fn doubt(&self) -> Option<String> {
        (!self.doubts.is_empty()).then(|| self.doubts.join("; "))
    }
}

impl Sensor {
    fn of(
        tracker: &Tracker,
        number: u8,
        state: &SensorState,
        time: f64,
        worn: &[Assignment],
    ) -> Self {
        let own = |worn: &&Assignment| worn.tracker == tracker.name && worn.sensor == number;
        let [late_packets, repeated_packets] = tracker.disordered();
        Self {
            tracker: sensor_name(tracker, number),
            segment: worn.iter().find(own).map(|worn| worn.segment.name()),
            sensor_type: sensor_type::name(state.sensor_type),
            fusion: fusion(state),
            firmware: tracker.handshake.firmware.clone(),
            protocol: tracker.handshake.protocol,
            samples: state.samples,
            without_acceleration: state.without_acceleration,
            rate_hz: state.rate_hz(),
            packets: tracker.received(),
            lost_packets: tracker.lost(),
            late_packets,
            unused_packets: tracker.unused,
            repeated_packets,
            restarts: tracker.restarts(),
            restarted_s: tracker.restarted_s.clone(),
            longest_silence_s: tracker.longest_silence_s,
            silent_s: tracker.silent_s(time),
            round_trip_s: tracker.round_trip_s,
            battery_v: tracker.battery_v,
        }
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for sensor in &self.sensors {
            let place = sensor.segment.unwrap_or("no segment");
            let rate = sensor.rate_hz.unwrap_or(0.0);
            let packets = (sensor.packets + sensor.lost_packets).max(1) as f64;
            writeln!(
                f,
                "{} ({place}): {}, {} samples, {rate:.1} Hz, {:.2} % of the packets lost, {} late, {} repeated",
                sensor.tracker,
                sensor.sensor_type,
                sensor.samples,
                100.0 * sensor.lost_packets as f64 / packets,
                sensor.late_packets,
                sensor.repeated_packets,
            )?;
        }
        let others = &self.datagrams;
        write!(
            f,
            "{:.1} s, {} datagrams; {} of other programs, {} before an introduction, {} damaged, {} impossible, {} refused",
            self.duration_s,
            others.all,
            others.foreign,
            others.from_strangers,
            others.damaged,
            others.impossible,
            others.refused
        )?;
        match &self.folder {
            Some(folder) => write!(f, "\nwritten: {}", folder.display()),
            None => Ok(()),
        }
    }
}

/// What to read.
#[derive(Debug, Clone)]
pub struct Request<'a> {
    /// Recorded traffic.
    pub capture: &'a Path,
    /// The port at which the server listened.
    pub port: u16,
    /// The folder to write.
    pub folder: &'a Path,
    /// Segments of trackers.
    pub worn: &'a [Assignment],
}

/// Reads recorded traffic as if it arrived.
///
/// # Errors
/// Returns an error if the file cannot be used, has nothing of a tracker, or the folder cannot be written.
pub fn read(request: &Request<'_>) -> Result<Report> {
    let mut capture = Capture::open(request.capture)?;
    let mut record = Record::create(request.folder)?;
    let mut server = Server::of_recorded();
    let (mut samples, mut replies) = (Vec::new(), Vec::new());
    let (mut begin, mut time) = (None, 0.0);
    while let Some(datagram) = capture.next_datagram()? {
        interrupt::check()?;
        if datagram.to_port != request.port {
            continue;
        }
        time = (datagram.time_s - *begin.get_or_insert(datagram.time_s)).max(time);
        server.take(
            time,
            datagram.from,
            &datagram.bytes,
            &mut samples,
            &mut replies,
        );
        // They were answered by who was there.
        replies.clear();
        for received in samples.drain(..) {
            record.push(&received, &server)?;
        }
    }
    for received in server.ended() {
        record.push(&received, &server)?;
    }
    let refused = record.refused();
    let Some(folder) = record.finish(&server, request.worn)? else {
        return Err(nothing(&server, request.port).in_file(request.capture));
    };
    let mut report = Report::of(&server, time, request.worn);
    if capture.is_cut() {
        report
            .warnings
            .push("the traffic ends in the middle of a packet: the file was cut off".to_owned());
    }
    Ok(report.written(Some(folder), refused))
}

/// What to say of traffic without samples.
fn nothing(server: &Server, port: u16) -> Problem {
    let counters = server.counters();
    if counters.impossible > 0 {
        return Problem::bad_input(format!(
            "expected orientations of SlimeVR's trackers, found {} packets whose numbers are none, as quaternions that are not of unit length",
            counters.impossible
        ))
        .help("the sensors do not work, or the sender is no tracker");
    }
    let (trackers, foreign) = (server.trackers().len(), counters.foreign);
    Problem::bad_input(format!(
        "expected orientations of SlimeVR's trackers to port {port}, found none: {trackers} trackers that sent none, and {foreign} datagrams of other programs",
    ))
    .help("record the traffic to the server, or give the server's port with --port")
}
