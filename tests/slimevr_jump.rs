//! A simulated jump as SlimeVR's trackers send it, through a network that delays, loses and overtakes packets.

use std::net::SocketAddr;
use std::path::Path;

use bodyflight_core::Segment;
use bodyflight_core::suit::placement::of_size;
use nalgebra::{UnitQuaternion, Vector3};

use super::slimevr_trackers::{Form, Fusion, Tracker};

/// When trackers are switched on: a simulated sensor jumps from the tray to the body before, which none does (s).
pub const SWITCHED_ON: f64 = 38.2;

/// Numbers that look random.
#[derive(Debug, Clone)]
pub struct Random(pub u64);

impl Random {
    /// From 0 to 1.
    pub fn share(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as f64 / (1_u64 << 31) as f64
    }
}

/// How a network treats packets.
#[derive(Debug, Clone, Copy)]
pub struct Network {
    /// Share that is lost.
    pub lost: f64,
    /// Usual largest delay (s).
    pub jitter_s: f64,
    /// Share of the time in which all wait.
    pub stalled: f64,
    /// Share that comes twice, or is overtaken.
    pub disordered: f64,
}

/// A network at home.
pub const USUAL: Network = Network {
    lost: 0.01,
    jitter_s: 0.01,
    stalled: 0.02,
    disordered: 0.01,
};

/// Datagrams: when they arrive (s), from where, and what is in them.
pub type Traffic = Vec<(f64, SocketAddr, Vec<u8>)>;

/// A tracker that is off for a while, and has another heading after it.
#[derive(Debug, Clone, Copy)]
pub struct Restart {
    /// The place of its segment in the set of ten.
    pub place: u8,
    /// From when to when it is off (s).
    pub off_s: [f64; 2],
}

/// The way of a tracker's packets to the server. They wait in one queue, so that one does not overtake another by chance.
struct Way {
    network: Network,
    random: Random,
    queue_s: f64,
    from: SocketAddr,
}

impl Way {
    fn send(&mut self, time: f64, packets: Vec<Vec<u8>>, all: &mut Traffic) {
        let (network, random) = (self.network, &mut self.random);
        if random.share() < network.stalled / 10.0 {
            self.queue_s = self.queue_s.max(time + 0.1);
        }
        for packet in packets {
            if random.share() < network.lost {
                continue;
            }
            let delay = 0.002 + network.jitter_s * random.share().powi(3);
            let arrival = (time + delay).max(self.queue_s);
            self.queue_s = arrival;
            if random.share() < network.disordered {
                all.push((arrival + 0.03 * random.share(), self.from, packet.clone()));
                if random.share() < 0.5 {
                    continue;
                }
            }
            all.push((arrival, self.from, packet));
        }
    }
}

/// Times (s), rates and forces of a simulated sensor.
fn readings(jump: &Path, segment: Segment) -> Vec<(f64, Vector3<f64>, Vector3<f64>)> {
    let table = jump.join(format!("sensors/{}.csv", segment.name()));
    let table = std::fs::read_to_string(table).expect("a table");
    let rows = table.lines().skip(1).map(|row| {
        let cells = row.split(',');
        let each: Vec<f64> = cells.map(|cell| cell.parse().expect("a number")).collect();
        let [rate, force] = [1, 4].map(|at| Vector3::from_row_slice(&each[at..at + 3]));
        (each[0], rate, force)
    });
    rows.filter(|(time, ..)| *time >= SWITCHED_ON).collect()
}

/// Traffic of a jump's sensors: a tracker for each, with the acceleration turned as its firmware does.
pub fn traffic(jump: &Path, network: Network, turn_deg: f64, restart: Option<Restart>) -> Traffic {
    let mut all = Vec::new();
    let forms = [Form::Bundled, Form::Separate, Form::Compact];
    for (place, segment) in (0_u8..).zip(of_size(10).expect("a set")) {
        let mut way = Way {
            network,
            random: Random(u64::from(place) + 7),
            queue_s: 0.0,
            from: address(place),
        };
        let mut off_s = restart
            .filter(|restart| restart.place == place)
            .map(|own| own.off_s);
        let mut heading = UnitQuaternion::identity();
        let mut tracker = Tracker::new(place, forms[usize::from(place) % 3]);
        // Times of the record are those of the simulation.
        all.push((0.0, way.from, tracker.handshake(13)));
        all.push((0.0, way.from, tracker.information(0, 13, false)));
        let mut fusion = Fusion::default();
        let mut before: Option<f64> = None;
        let mut sent: Option<UnitQuaternion<f64>> = None;
        let turned = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turn_deg.to_radians());
        for (time, rate, force) in readings(jump, *segment) {
            let step = before.map_or(1.0 / 120.0, |before| time - before);
            before = Some(time);
            let (turn, free) = fusion.take(&rate, &force, step);
            if off_s.is_some_and(|[from, until]| (from..until).contains(&time)) {
                continue;
            }
            if off_s.take_if(|[_, until]| time >= *until).is_some() {
                tracker.number = 0;
                all.push((time, way.from, tracker.handshake(13)));
                heading = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 1.2);
            }
            let turn = heading * turn;
            // The firmware does not repeat an orientation.
            if sent.is_some_and(|sent| (sent.coords - turn.coords).amax() < 1e-4) {
                continue;
            }
            sent = Some(turn);
            way.send(time, tracker.sample(0, &turn, &(turned * free)), &mut all);
        }
    }
    all.sort_by(|one, other| one.0.total_cmp(&other.0));
    all
}

/// The address in the network of the tracker of a place in the set.
pub fn address(place: u8) -> SocketAddr {
    SocketAddr::from(([192, 168, 1, 100 + place], 6969))
}

/// Which tracker is worn where, as arguments.
pub fn worn() -> Vec<String> {
    let each = (0_u8..).zip(of_size(10).expect("a set"));
    each.flat_map(|(place, segment)| {
        let tracker = Tracker::new(place, Form::Bundled).name();
        [
            "--tracker".to_owned(),
            format!("{tracker}={}", segment.name()),
        ]
    })
    .collect()
}

/// Adds to the mapping of a record when the calibration and the flight were, which is known from the simulation, and its track,
/// which begins so long before the flight (s).
pub fn calibrated(jump: &Path, record: &Path, before_s: f64) {
    let mapping = record.join("mapping.toml");
    let own = std::fs::read_to_string(&mapping).expect("a mapping");
    let told = std::fs::read_to_string(jump.join("sensors/mapping.toml")).expect("a mapping");
    let begin = told.find("[calibration]").expect("windows");
    let end = told.find("[sensors.").expect("sensors");
    // The trackers were not switched on in the tray.
    let worn = told[begin..end].lines();
    let worn = worn.filter(|line| !line.starts_with("tray_s") && !line.starts_with("turns_s"));
    let windows = worn.collect::<Vec<_>>().join("\n");
    let windows = windows.replace("gnss = ", &format!("gnss_begin_s = {before_s:?}\ngnss = "));
    std::fs::write(&mapping, format!("{own}\n{windows}\n")).expect("a file");
    let track = jump.join("sensors/TRACK.CSV");
    std::fs::copy(track, record.join("TRACK.CSV")).expect("a track");
}
