//! MVN's network stream: through the library on loopback, and through the binary.

use std::io::{BufRead, BufReader};
use std::net::UdpSocket;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use bodyflight_core::Segment;
use bodyflight_mvn_network::{AngularUnit, Options, Receiver, Sink, Source};
use bodyflight_mvnx::recording::{self, FlightFrame, Recording};
use bodyflight_replay::subject::Subject;
use serde_json::Value;

use crate::{BINARY, bodyflight, fails, plain, shared};

fn synthetic_flight(folder: &Path) -> PathBuf {
    let output = bodyflight(&["synth", "rotations", "--out", plain(folder)]);
    assert!(output.status.success());
    folder.join("flight.mvnx")
}

fn frames(path: &Path, count: usize) -> Vec<FlightFrame> {
    Recording::open(path, recording::Options::default())
        .expect("a recording")
        .take(count)
        .map(|frame| frame.expect("a good frame"))
        .collect()
}

/// A loopback socket and a sink that sends to it.
fn sink_to(address: &str) -> Sink {
    Sink::connect(address, &Subject::default().body(), "test").expect("a sink")
}

fn assert_same_posture(sent: &FlightFrame, received: &FlightFrame) {
    assert_eq!(sent.index, received.index);
    for segment in Segment::ALL {
        let angle = sent
            .posture
            .parent_from_segment(segment)
            .rotation_to(received.posture.parent_from_segment(segment))
            .imag()
            .norm()
            * 2.0;
        assert!(angle < 1e-6, "frame {}: {segment:?}: {angle}", sent.index);
    }
    let turn = sent
        .pelvis
        .inertial_from_body
        .quaternion()
        .rotation_to(received.pelvis.inertial_from_body.quaternion());
    assert!(turn.imag().norm() < 1e-6);
    let gap = sent.pelvis.position - received.pelvis.position;
    // Single precision represents the height to a relative 1e-7.
    assert!(gap.norm() <= 2e-7 * sent.pelvis.position.norm() + 1e-6);
}

fn round_trip(sent: &[FlightFrame]) -> Vec<FlightFrame> {
    let options = Options {
        rate: Some(240.0),
        angular_unit: Some(AngularUnit::Radians),
        ..Options::default()
    };
    let mut source = Source::with_options("127.0.0.1:0", options).expect("a source");
    let address = source.local_address().expect("an address").to_string();
    let mut sink = sink_to(&address);
    let mut received = Vec::new();
    // Frames are sent in small batches, since a socket's buffer is limited.
    for (lot, frames) in sent.chunks(4).enumerate() {
        for frame in frames {
            sink.send(frame).expect("sent");
        }
        while received.len() + 4 < lot * 4 {
            let frame = source
                .next_within(Duration::from_secs(5))
                .expect("a source");
            received.push(frame.expect("a frame in time"));
        }
    }
    let totals = sink.finish().expect("sent");
    assert_eq!(totals.frames, sent.len() as u64);
    while received.len() < sent.len() {
        let frame = source
            .next_within(Duration::from_secs(5))
            .expect("a source");
        let counters = source.receiver().counters();
        received.push(frame.unwrap_or_else(|| panic!("{} frames sent, {counters:?}", sent.len())));
    }
    let counters = source.receiver().counters();
    assert_eq!(counters.datagrams, totals.datagrams);
    let faults = counters.bad_datagrams
        + counters.missing_samples
        + counters.incomplete_samples
        + counters.bad_samples
        + counters.late_datagrams
        + counters.repeated_datagrams
        + counters.restarts;
    assert_eq!(faults, 0, "{counters:?}");
    let information = source.receiver().information();
    assert_eq!(information.name(), Some("test"));
    assert_eq!(information.scale.segments.len(), 23);
    assert!(information.scale.points.len() > 40 && information.time_code.is_some());
    received
}

#[test]
fn a_flight_survives_the_network_round_trip() {
    let folder = tempfile::tempdir().expect("a folder");
    let sent = frames(&synthetic_flight(folder.path()), 600);
    let received = round_trip(&sent);
    for (sent, received) in sent.iter().zip(&received) {
        assert_same_posture(sent, received);
        assert!((sent.time - received.time).abs() < 1e-9);
        let (velocity, rate) = sent.rates().expect("rates");
        let (velocity_again, rate_again) = received.rates().expect("rates");
        assert!((velocity - velocity_again).norm() < 2e-5);
        assert!((rate - rate_again).norm() < 2e-6);
    }
}

#[test]
fn real_recordings_survive_the_network_round_trip() {
    for name in [
        "mvnx/robotology-xsens-mvn/Meri-020.mvnx",
        "mvnx/andres-fr-blender-mvnx-io/test_mocap.mvnx",
    ] {
        let Some(path) = shared(name) else { continue };
        let sent = frames(&path, usize::MAX);
        let received = round_trip(&sent);
        for (sent, received) in sent.iter().zip(&received) {
            assert_same_posture(sent, received);
        }
    }
}

#[test]
fn lost_repeated_and_swapped_datagrams_affect_no_others() {
    let folder = tempfile::tempdir().expect("a folder");
    let sent = frames(&synthetic_flight(folder.path()), 400);
    let socket = UdpSocket::bind("127.0.0.1:0").expect("a socket");
    let address = socket.local_addr().expect("an address").to_string();
    socket
        .set_read_timeout(Some(Duration::from_secs(5)))
        .expect("a timeout");
    let mut sink = sink_to(&address);
    let (mut datagrams, mut buffer) = (Vec::new(), vec![0; 65_536]);
    for frame in &sent {
        sink.send(frame).expect("sent");
        while (datagrams.len() as u64) < sink.sent().datagrams {
            let length = socket.recv(&mut buffer).expect("a datagram");
            datagrams.push(buffer[..length].to_vec());
        }
    }
    let (mut faulty, mut repeated, mut dropped) = (Vec::new(), 0, 0);
    for (number, datagram) in datagrams.iter().enumerate() {
        // The first half second stays intact, since it determines which kinds of datagrams are sent.
        let at_work = number > 360;
        if at_work && number % 37 == 0 {
            dropped += 1;
            continue;
        }
        faulty.push(datagram.clone());
        if at_work && number % 41 == 0 {
            faulty.push(datagram.clone());
            repeated += 1;
        }
        if at_work && number % 13 == 0 {
            let last = faulty.len() - 1;
            faulty.swap(last, last - 1);
        }
    }
    assert!(dropped > 10 && repeated > 10);
    let mut receiver = Receiver::new(Options {
        rate: Some(240.0),
        ..Options::default()
    });
    let mut received = Vec::new();
    for datagram in &faulty {
        receiver.push(datagram);
        received.extend(core::iter::from_fn(|| receiver.next_frame()));
    }
    receiver.flush();
    received.extend(core::iter::from_fn(|| receiver.next_frame()));
    let counters = receiver.counters();
    assert_eq!(counters.repeated_datagrams, repeated, "{counters:?}");
    assert_eq!(counters.late_datagrams, 0, "{counters:?}");
    // A sample is lost if and only if its pose is lost.
    let sent_count = sent.len() as u64 - 1;
    let lost = sent_count - received.len() as u64;
    assert!(lost > 0 && lost <= dropped, "{counters:?}");
    assert_eq!(counters.incomplete_samples + counters.missing_samples, lost);
    for frame in &received {
        let index = usize::try_from(frame.index).expect("small");
        assert_same_posture(&sent[index], frame);
    }
}

#[test]
fn the_binary_sends_and_listens() {
    let folder = tempfile::tempdir().expect("a folder");
    let flight = synthetic_flight(folder.path());
    let mut listener = Command::new(BINARY)
        .args([
            "mvn",
            "listen",
            "--bind",
            "127.0.0.1:0",
            "--frames",
            "300",
            "--json",
        ])
        .stdout(Stdio::piped())
        .spawn()
        .expect("the binary starts");
    let mut output = BufReader::new(listener.stdout.take().expect("a pipe"));
    let mut first = String::new();
    output.read_line(&mut first).expect("a line");
    let first: Value = serde_json::from_str(&first).expect("JSON");
    let address = first["listening"].as_str().expect("an address").to_owned();
    let mut sender = Command::new(BINARY)
        .args([
            "mvn",
            "send",
            plain(&flight),
            "--to",
            &address,
            "--speed",
            "2",
        ])
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("the binary starts");
    let last = output.lines().map_while(Result::ok).last().expect("totals");
    sender.kill().expect("ended");
    sender.wait().expect("ended");
    assert!(listener.wait().expect("ended").success());
    let totals = &serde_json::from_str::<Value>(&last).expect("JSON")["totals"];
    assert_eq!(totals["frames"], 300, "{totals}");
    assert_eq!(totals["counters"]["bad_datagrams"], 0, "{totals}");
    assert_eq!(totals["counters"]["bad_samples"], 0, "{totals}");
    assert!(totals["subject"].is_string(), "{totals}");
    let rate = totals["sender_rate_hz"].as_f64().expect("a rate");
    assert!((rate - 240.0).abs() < 2.0, "{totals}");
}

/// Interrupts a process as Ctrl-C does.
fn interrupt(process: &std::process::Child) {
    let sent = Command::new("kill")
        .args(["-INT", &process.id().to_string()])
        .status();
    assert!(sent.expect("kill is there").success());
}

#[test]
fn frames_received_until_ctrl_c_are_a_flight() {
    let folder = tempfile::tempdir().expect("a folder");
    let flight = synthetic_flight(folder.path());
    let subject = folder.path().join("subject.toml");
    let out = folder.path().join("kept.mvnx");
    let options = ["--out", plain(&out), "--subject", plain(&subject)];
    let mut listener = Command::new(BINARY)
        .args(["mvn", "listen", "--bind", "127.0.0.1:0", "--json"])
        .args(options)
        .stdout(Stdio::piped())
        .spawn()
        .expect("the binary starts");
    let output = BufReader::new(listener.stdout.take().expect("a pipe"));
    let mut lines = output.lines().map_while(Result::ok);
    let first: Value = serde_json::from_str(&lines.next().expect("a line")).expect("JSON");
    let address = first["listening"].as_str().expect("an address").to_owned();
    let to = ["--to", &address, "--speed", "2"];
    let mut sender = Command::new(BINARY)
        .args(["mvn", "send", plain(&flight)])
        .args(to)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("the binary starts");
    // Three seconds of flight have arrived by the time the second rates are reported.
    let _ = (lines.next(), lines.next());
    interrupt(&listener);
    sender.kill().expect("ended");
    sender.wait().expect("ended");
    let last = lines.last().expect("what was kept");
    assert_eq!(listener.wait().expect("ended").code(), Some(130));
    let kept = &serde_json::from_str::<Value>(&last).expect("JSON")["kept"];
    let count = kept["frames"].as_u64().expect("frames");
    assert!(count > 240 && kept["frame_rate_hz"] == 240.0, "{kept}");

    // Positions are single precision on the network and have six decimals in the file.
    let sent = frames(&flight, usize::MAX);
    let received = frames(&out, usize::MAX);
    assert_eq!(received.len() as u64, count);
    let offset = sent
        .iter()
        .position(|frame| (frame.pelvis.position - received[0].pelvis.position).norm() < 1e-3);
    let offset = offset.expect("where it began");
    for received in &received {
        // Frames lost on the network are gaps in the recording too.
        let index = usize::try_from(received.index).expect("small");
        let sent = &sent[offset + index];
        let gap = (sent.pelvis.position - received.pelvis.position).norm();
        assert!(gap < 1e-3, "frame {}: {gap}", received.index);
        let hand = |frame: &FlightFrame| *frame.posture.parent_from_segment(Segment::LeftForearm);
        assert!(hand(sent).angle_to(&hand(received)) < 1e-4);
    }
    let looked = bodyflight(&["inspect", plain(&out), "--json"]);
    assert!(looked.status.success());
    let report = bodyflight(&["simulate", plain(&out), "--json"]);
    assert!(report.status.success());
    let report: Value = serde_json::from_slice(&report.stdout).expect("JSON");
    assert_eq!(report["frames"].as_u64(), Some(count - 1));
}

#[test]
fn wrong_addresses_are_reported() {
    assert!(fails(&["mvn", "listen", "--bind", "nowhere"], 3).contains("HOST:PORT"));
    let taken = UdpSocket::bind("127.0.0.1:0").expect("a socket");
    let address = taken.local_addr().expect("an address").to_string();
    let message = fails(&["mvn", "listen", "--bind", &address], 3);
    assert!(message.contains("another program"), "{message}");
    fails(&["mvn", "send", "no.mvnx", "--to", "127.0.0.1:9763"], 3);
    fails(
        &[
            "mvn",
            "send",
            "no.mvnx",
            "--to",
            "127.0.0.1:9763",
            "--speed",
            "0",
        ],
        2,
    );
    fails(&["mvn", "listen", "--rate", "-1"], 2);
}
