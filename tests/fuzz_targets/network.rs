//! The network stream of MVN, and SlimeVR's trackers.

use std::net::SocketAddr;
use std::path::Path;

use bodyflight_mocap::slimevr::capture::Capture;
use bodyflight_mocap::slimevr::server::{MOST_TRACKERS, Server};
use bodyflight_mvn_network::{Options, Receiver};

use super::choices::Choices;

/// Any datagrams, each preceded by its length; the highest bit of the length flushes the receiver afterwards.
pub(super) fn mxtp(input: &[u8]) {
    let mut choices = Choices(input);
    let mut receiver = Receiver::new(Options::default());
    let (mut sent, mut taken) = (0, 0);
    while !choices.is_empty() {
        let length = choices.word();
        receiver.push(choices.bytes(usize::from(length & 0x7FFF)));
        sent += 1;
        if length & 0x8000 != 0 {
            receiver.flush();
        }
        while let Some(frame) = receiver.next_frame() {
            assert!(frame.posture.is_valid() && frame.time.is_finite());
            assert!(frame.pelvis.position.is_finite());
            taken += 1;
        }
    }
    let counters = receiver.counters();
    assert_eq!(counters.datagrams, sent);
    assert_eq!(counters.frames, taken);
    let scale = &receiver.information().scale;
    assert!(scale.segments.len() <= 128 && scale.points.len() <= 1024);
}

/// Any datagrams of a few senders at any times, each preceded by its length, its sender and the time since the one before;
/// or, after a first byte of 255, a file of recorded traffic.
pub(super) fn slimevr(input: &[u8]) {
    if let Some((255, file)) = input.split_first() {
        let file = std::io::Cursor::new(file.to_vec());
        let Ok(mut capture) = Capture::of(Box::new(file), Path::new("traffic.pcap")) else {
            return;
        };
        let mut server = Server::of_recorded();
        while let Ok(Some(captured)) = capture.next_datagram() {
            heard(&mut server, captured.time_s, captured.from, &captured.bytes);
        }
        return;
    }
    let mut choices = Choices(input);
    let mut server = Server::default();
    let (mut time, mut sent, mut taken) = (0.0, 0, 0);
    while !choices.is_empty() {
        let length = usize::from(choices.word());
        let from = SocketAddr::from(([10, 0, 0, choices.byte()], 6969));
        time += f64::from(choices.byte()) * 0.02;
        taken += heard(&mut server, time, from, choices.bytes(length));
        sent += 1;
        let mut replies = Vec::new();
        server.tick(time, &mut replies);
        assert!(replies.len() <= 2 * MOST_TRACKERS);
    }
    taken += server.ended().len() as u64;
    assert_eq!(server.counters().all, sent);
    let samples = server.trackers().iter().map(|tracker| tracker.samples());
    assert_eq!(samples.sum::<u64>(), taken);
    assert!(server.counters().unknown_types.len() <= 256);
}

/// Lets a server hear a datagram; returns how many samples it gave.
fn heard(server: &mut Server, time: f64, from: SocketAddr, bytes: &[u8]) -> u64 {
    let (mut samples, mut replies) = (Vec::new(), Vec::new());
    server.take(time, from, bytes, &mut samples, &mut replies);
    assert!(server.trackers().len() <= MOST_TRACKERS);
    assert!(replies.len() <= 17);
    for received in &samples {
        let [w, x, y, z] = received.sample.orientation;
        assert!((w * w + x * x + y * y + z * z - 1.0).abs() < 1e-9);
        assert!(received.tracker < server.trackers().len());
    }
    samples.len() as u64
}
