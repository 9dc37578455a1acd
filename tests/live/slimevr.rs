//! SlimeVR's trackers that talk to the real binary.

use std::io::{BufRead, BufReader};
use std::net::UdpSocket;
use std::path::Path;
use std::process::{Child, ChildStdout, Command, Stdio};
use std::time::{Duration, Instant};

use bodyflight_tests::program::Program;
use bodyflight_tests::slimevr_trackers::{Form, Tracker};
use nalgebra::{UnitQuaternion, Vector3};
use serde_json::Value;

use super::{BINARY, fails, plain};

/// A listener, and what it prints after its address.
struct Listener {
    process: Child,
    address: String,
    lines: std::io::Lines<BufReader<ChildStdout>>,
}

impl Listener {
    fn new(more: &[&str]) -> Self {
        let mut process = Command::new(BINARY)
            .args(["slimevr", "listen", "--bind", "127.0.0.1:0", "--json"])
            .args(more)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the binary starts");
        let mut lines = BufReader::new(process.stdout.take().expect("a pipe")).lines();
        let first = lines.next().expect("a line").expect("text");
        let first: Value = serde_json::from_str(&first).expect("JSON");
        Self {
            address: first["listening"].as_str().expect("an address").to_owned(),
            process,
            lines,
        }
    }

    /// Ends it as Ctrl-C does; returns the totals and the exit code.
    fn end(self) -> (Value, Option<i32>) {
        let (mut lines, code) = self.said();
        let totals = lines.pop().expect("totals");
        (totals["totals"].clone(), code)
    }

    /// Ends it as Ctrl-C does; returns all that it printed after its address and the exit code.
    fn said(mut self) -> (Vec<Value>, Option<i32>) {
        let id = self.process.id().to_string();
        let sent = Command::new("kill").args(["-INT", &id]).status();
        assert!(sent.expect("kill is there").success());
        let lines = self.lines.map_while(Result::ok);
        let lines = lines.map(|line| serde_json::from_str(&line).expect("JSON"));
        let lines: Vec<Value> = lines.collect();
        for line in &lines {
            Program(BINARY).fits("slimevr-listen", line);
        }
        let code = self.process.wait().expect("ended").code();
        (lines, code)
    }
}

/// A tracker on the network, which must be answered before it sends.
struct Wearer {
    tracker: Tracker,
    socket: UdpSocket,
}

impl Wearer {
    fn new(tracker: Tracker, sensor_type: u32, address: &str) -> Self {
        let socket = UdpSocket::bind("127.0.0.1:0").expect("a socket");
        socket.connect(address).expect("an address");
        let patience = Some(Duration::from_millis(200));
        socket.set_read_timeout(patience).expect("a timeout");
        let own = Self { tracker, socket };
        let mut answer = [0; 100];
        for _ in 0..20 {
            own.send(&own.tracker.handshake(sensor_type));
            let length = own.socket.recv(&mut answer).unwrap_or(0);
            // As the firmware looks at it.
            if length > 13 && answer[0] == 3 && &answer[1..13] == b"Hey OVR =D 5" {
                return own;
            }
        }
        panic!("nobody answers");
    }

    fn send(&self, bytes: &[u8]) {
        self.socket.send(bytes).expect("sent");
    }

    /// Types of what the server sends, until it is silent.
    fn heard(&self) -> Vec<u8> {
        let patience = Some(Duration::from_millis(5));
        self.socket.set_read_timeout(patience).expect("a timeout");
        let mut bytes = [0; 100];
        let mut kinds = Vec::new();
        while let Ok(length) = self.socket.recv(&mut bytes) {
            if length >= 4 {
                kinds.push(bytes[3]);
            }
            if bytes[3] == 10 {
                self.send(&bytes[..length]);
            }
        }
        kinds
    }
}

/// Orientation of a tracker at a time (s).
fn turn(time: f64, phase: f64) -> UnitQuaternion<f64> {
    let tilt = UnitQuaternion::from_scaled_axis(Vector3::x() * (0.5 + phase));
    UnitQuaternion::from_scaled_axis(Vector3::z() * (2.0 * time)) * tilt
}

fn table(folder: &Path, name: &str) -> Vec<Vec<f64>> {
    let text = std::fs::read_to_string(folder.join(name)).expect("a table");
    let numbers = |line: &str| {
        line.split(',')
            .map(|cell| cell.parse().unwrap_or(f64::NAN))
            .collect()
    };
    text.lines().skip(1).map(numbers).collect()
}

#[test]
fn trackers_are_answered_and_recorded_until_ctrl_c() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("jump");
    let worn = [
        "--tracker",
        "A0:B1:C2:D3:E4:01=pelvis",
        "--tracker",
        "a0-b1-c2-d3-e4-02/1=l_shank",
    ];
    let listener = Listener::new(&[&["--out", plain(&out)], &worn[..]].concat());
    let mut one = Wearer::new(Tracker::new(1, Form::Separate), 13, &listener.address);
    let mut two = Wearer::new(Tracker::new(2, Form::Bundled), 13, &listener.address);
    let information = one.tracker.information(0, 13, false);
    one.send(&information);
    for sensor in [0, 1] {
        let information = two.tracker.information(sensor, 13, false);
        two.send(&information);
    }
    let begin = Instant::now();
    let pushed = Vector3::new(1.0, -2.0, 0.5);
    let mut heard = Vec::new();
    for k in 0..150_u32 {
        let time = f64::from(k) * 0.01;
        let due = Duration::from_secs_f64(time);
        std::thread::sleep(due.saturating_sub(begin.elapsed()));
        for packet in one.tracker.sample(0, &turn(time, 0.0), &pushed) {
            one.send(&packet);
        }
        for sensor in [0, 1] {
            for packet in two
                .tracker
                .sample(sensor, &turn(time, 0.1 * f64::from(sensor)), &pushed)
            {
                // Every tenth is lost, and the one after it comes twice.
                if k % 10 != 5 {
                    two.send(&packet);
                }
                if k % 10 == 6 {
                    two.send(&packet);
                }
            }
        }
        heard.extend(one.heard());
    }
    let sent_for = begin.elapsed().as_secs_f64();
    for strange in [
        &b"GET / HTTP/1.1\r\n\r\n"[..],
        &[0; 12],
        &one.tracker.packet(77, &[]),
    ] {
        one.send(strange);
    }
    std::thread::sleep(Duration::from_millis(200));
    let (totals, code) = listener.end();
    assert_eq!(code, Some(130), "{totals}");
    let is_sent = |kind: u8| heard.contains(&kind);
    assert!(is_sent(1) && is_sent(10) && is_sent(15), "{heard:?}");
    let sensors = totals["sensors"].as_array().expect("sensors");
    assert_eq!(sensors.len(), 3, "{totals}");
    let sensor = |name: &str| {
        let own = sensors.iter().find(|sensor| sensor["tracker"] == name);
        own.expect("a known sensor")
    };
    let first = sensor("A0:B1:C2:D3:E4:01");
    assert_eq!(
        (first["samples"].as_u64(), first["lost_packets"].as_u64()),
        (Some(150), Some(0))
    );
    assert!(first["round_trip_s"].as_f64() < Some(0.2), "{first}");
    let second = sensor("A0:B1:C2:D3:E4:02/1");
    assert_eq!(second["samples"], 135, "{second}");
    assert_eq!(
        (
            second["lost_packets"].as_u64(),
            second["repeated_packets"].as_u64()
        ),
        (Some(30), Some(30))
    );
    assert_eq!(totals["datagrams"]["foreign"], 1, "{totals}");
    assert_eq!(totals["datagrams"]["unknown_types"]["77"], 1, "{totals}");
    let rows = table(&out, "A0B1C2D3E401.csv");
    assert_eq!(rows.len(), 150);
    for (k, row) in (0_u32..).zip(&rows) {
        let sent = turn(f64::from(k) * 0.01, 0.0);
        for (found, expected) in row[1..5].iter().zip([sent.w, sent.i, sent.j, sent.k]) {
            assert!((found - expected).abs() < 1e-6, "{k}: {row:?}");
        }
        assert!((row[5] - 1.0).abs() < 1e-6 && (row[6] + 2.0).abs() < 1e-6);
    }
    let arrived_for = rows[149][0] - rows[0][0];
    assert!(
        (arrived_for - sent_for).abs() < 0.2,
        "sent for {sent_for} s, arrived for {arrived_for} s"
    );
    let lost: f64 = table(&out, "A0B1C2D3E402-1.csv")
        .iter()
        .map(|row| row[9])
        .sum();
    assert!((lost - 30.0).abs() < 1e-9, "{lost}");
    let mapping = std::fs::read_to_string(out.join("mapping.toml")).expect("a mapping");
    for part in [
        "[sensors.pelvis]\nfile = \"A0B1C2D3E401.csv\"\nfusion = \"VQF\"\nacceleration_turn_deg = 180",
        "[sensors.l_shank]\nfile = \"A0B1C2D3E402-1.csv\"",
        "# [sensors.SEGMENT]\n# file = \"A0B1C2D3E402.csv\"",
    ] {
        assert!(mapping.contains(part), "{part}: {mapping}");
    }
}

#[test]
fn different_fusions_and_silent_trackers_are_named() {
    let listener = Listener::new(&[]);
    let mut one = Wearer::new(Tracker::new(1, Form::Compact), 13, &listener.address);
    let mut two = Wearer::new(Tracker::new(2, Form::Compact), 4, &listener.address);
    let silent = Wearer::new(Tracker::new(3, Form::Compact), 4, &listener.address);
    let information = two.tracker.information(0, 4, true);
    two.send(&information);
    let begin = Instant::now();
    while begin.elapsed() < Duration::from_millis(2600) {
        let time = begin.elapsed().as_secs_f64();
        let of_two = two.tracker.sample(0, &turn(time, 0.0), &Vector3::zeros());
        two.send(&of_two[0]);
        if time < 1.0 {
            let of_one = one.tracker.sample(0, &turn(time, 0.0), &Vector3::zeros());
            one.send(&of_one[0]);
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    drop(silent);
    let (totals, code) = listener.end();
    assert_eq!(code, Some(5), "{totals}");
    let (doubts, warnings) = (totals["doubts"].to_string(), totals["warnings"].to_string());
    assert!(
        doubts.contains("BNO08x with magnetometer (A0:B1:C2:D3:E4:02) and VQF"),
        "{doubts}"
    );
    assert!(
        warnings.contains("A0:B1:C2:D3:E4:01: nothing has come"),
        "{warnings}"
    );
    assert!(
        warnings.contains("A0:B1:C2:D3:E4:03: it introduced itself"),
        "{warnings}"
    );
}

#[test]
fn a_tracker_that_restarts_is_told_when_it_does_and_at_the_end() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("jump");
    let listener = Listener::new(&["--out", plain(&out)]);
    let mut one = Wearer::new(Tracker::new(1, Form::Bundled), 13, &listener.address);
    // Its server was lost for a moment, then it restarts.
    for (number, samples) in [(0, 30), (30, 30), (0, 50)] {
        std::thread::sleep(Duration::from_millis(1200));
        if samples != 30 || number == 30 {
            one.send(&one.tracker.handshake(13));
        }
        one.tracker.number = number;
        for k in 0..samples {
            let turned = turn(0.01 * f64::from(k), 0.0);
            for packet in one.tracker.sample(0, &turned, &Vector3::zeros()) {
                one.send(&packet);
            }
            std::thread::sleep(Duration::from_millis(5));
        }
    }
    std::thread::sleep(Duration::from_millis(1200));
    let (lines, code) = listener.said();
    assert_eq!(code, Some(130), "{lines:?}");
    let told: Vec<&Value> = lines
        .iter()
        .filter(|line| !line["restarted"].is_null())
        .collect();
    let [told] = told[..] else {
        panic!("{lines:?}");
    };
    assert_eq!(told["restarted"], "A0:B1:C2:D3:E4:01");
    let totals = &lines.last().expect("totals")["totals"];
    let sensor = &totals["sensors"][0];
    assert_eq!(
        (sensor["restarts"].as_u64(), sensor["samples"].as_u64()),
        (Some(1), Some(110))
    );
    assert_eq!(sensor["restarted_s"][0], told["time_s"]);
    let warnings = totals["warnings"].to_string();
    assert!(warnings.contains("it restarted before"), "{warnings}");
    let restarts: Vec<f64> = table(&out, "A0B1C2D3E401.csv")
        .iter()
        .map(|row| row[10])
        .collect();
    assert_eq!(restarts, [[0.0; 60].as_slice(), &[1.0; 50]].concat());
    let mapping = std::fs::read_to_string(out.join("mapping.toml")).expect("a mapping");
    assert!(mapping.contains("110 samples, restarted at"), "{mapping}");
}

#[test]
fn wrong_calls_are_reported() {
    let folder = tempfile::tempdir().expect("a folder");
    let there = folder.path().join("there");
    std::fs::create_dir(&there).expect("a folder");
    assert!(fails(&["slimevr", "listen", "--out", plain(&there)], 2).contains("exists"));
    assert!(fails(&["slimevr", "listen", "--bind", "nowhere"], 3).contains("HOST:PORT"));
    for (worn, part) in [
        ("A0:B1", "ADDRESS=SEGMENT"),
        ("A0:B1=tail", "unknown segment"),
        ("A0:B1/x=head", "ADDRESS=SEGMENT"),
    ] {
        assert!(
            fails(&["slimevr", "listen", "--tracker", worn], 2).contains(part),
            "{worn}"
        );
    }
    let twice = [
        "slimevr",
        "listen",
        "--tracker",
        "A:1=head",
        "--tracker",
        "A:2=head",
    ];
    assert!(fails(&twice, 2).contains("two trackers are on head"));
    let taken = UdpSocket::bind("127.0.0.1:0").expect("a socket");
    let address = taken.local_addr().expect("an address").to_string();
    let message = fails(&["slimevr", "listen", "--bind", &address], 3);
    assert!(message.contains("SlimeVR's own server"), "{message}");
    let file = folder.path().join("other.pcap");
    std::fs::write(&file, "time,x\n0,1\n1,2\n").expect("a file");
    let out = folder.path().join("out");
    let read = ["slimevr", "read", plain(&file), "--out", plain(&out)];
    assert!(fails(&read, 2).contains("pcap"));
    std::fs::write(&file, bodyflight_tests::slimevr_trackers::pcap(&[])).expect("a file");
    assert!(fails(&read, 2).contains("found none: 0 trackers"));
    assert!(!out.exists());
}
