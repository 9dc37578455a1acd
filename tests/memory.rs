//! Memory use while reading, in a separate process so that the peak is the reader's.

use std::io::{BufReader, Read};
use std::path::Path;

use bodyflight_core::Posture;
use bodyflight_core::frame::{Rotation, Vector};
use bodyflight_mvnx::recording::{FlightFrame, Options, PelvisMotion, Recording};
use bodyflight_mvnx::writer::{Description, Origin, Writer};
use bodyflight_replay::subject::Subject;

/// A short recording of a person at rest.
fn written(count: u64) -> Vec<u8> {
    let description = Description {
        subject_label: "Synthetic".into(),
        frame_rate: 240.0,
        start_unix_ms: 0,
        comment: String::new(),
        origin: Origin::Simulated,
    };
    let body = Subject::default().body();
    let path = Path::new("endless.mvnx");
    let mut writer = Writer::new(Vec::new(), path, description, &body).expect("begun");
    for index in 0..count {
        let pelvis = PelvisMotion {
            inertial_from_body: Rotation::identity(),
            position: Vector::zero(),
            velocity: Some(Vector::zero()),
            angular_velocity: Some(Vector::zero()),
        };
        let frame = FlightFrame {
            index,
            time: 0.0,
            posture: Posture::h_pose(),
            pelvis,
            centre_of_mass: None,
            bridged: false,
        };
        writer.write(&frame).expect("written");
    }
    writer.complete().expect("complete")
}

/// A recording of any length, generated while it is read.
struct Endless {
    head: Vec<u8>,
    frame: Vec<u8>,
    tail: Vec<u8>,
    frames: u64,
    next: u64,
    buffer: Vec<u8>,
    place: usize,
}

impl Endless {
    fn new(frames: u64) -> Self {
        let text = String::from_utf8(written(2)).expect("text");
        let begin = text.rfind("<frame ").expect("a frame");
        let end = begin + text[begin..].find("</frame>").expect("its end") + "</frame>".len();
        let first = text.find("type=\"normal\"").expect("normal");
        let head = text[..text[..first].rfind("<frame ").expect("a frame")].to_owned();
        Self {
            buffer: head.clone().into_bytes(),
            head: head.into_bytes(),
            frame: text.as_bytes()[begin..end].to_vec(),
            tail: text.as_bytes()[end..].to_vec(),
            frames,
            next: 0,
            place: 0,
        }
    }

    /// Size of one frame (bytes).
    fn frame_length(&self) -> usize {
        self.frame.len()
    }
}

impl Read for Endless {
    fn read(&mut self, bytes: &mut [u8]) -> std::io::Result<usize> {
        if self.place == self.buffer.len() {
            self.place = 0;
            self.buffer.clear();
            if self.next < self.frames {
                let text = String::from_utf8_lossy(&self.frame);
                let index = format!("index=\"{}\"", self.next);
                self.buffer
                    .extend(text.replacen("index=\"1\"", &index, 1).bytes());
                self.next += 1;
            } else if self.next == self.frames {
                self.buffer.extend_from_slice(&self.tail);
                self.next += 1;
            }
        }
        let length = bytes.len().min(self.buffer.len() - self.place);
        bytes[..length].copy_from_slice(&self.buffer[self.place..self.place + length]);
        self.place += length;
        Ok(length)
    }
}

/// Peak memory of this process (MB), or `None` with a visible notice if the system does not report it.
fn peak_memory_mb() -> Option<u64> {
    let Ok(status) = std::fs::read_to_string("/proc/self/status") else {
        bodyflight_shared_data::skipped("there is no /proc/self/status with the peak memory");
        return None;
    };
    let line = status.lines().find(|line| line.starts_with("VmHWM"));
    let number = line
        .and_then(|line| line.split_whitespace().nth(1))
        .expect("VmHWM in kB");
    Some(number.parse::<u64>().expect("a number") / 1024)
}

#[test]
fn memory_stays_small_for_any_input() {
    one_huge_event_is_refused_before_it_fills_memory();
    memory_does_not_grow_with_the_recording();
}

fn memory_does_not_grow_with_the_recording() {
    // BODYFLIGHT_RECORDING_S=600 measures ten minutes.
    let seconds: u64 = std::env::var("BODYFLIGHT_RECORDING_S")
        .ok()
        .and_then(|s| s.parse().ok())
        .unwrap_or(20);
    let source = Endless::new(240 * seconds);
    assert!(!source.head.is_empty());
    let megabytes = source.frame_length() as u64 * 240 * seconds / 1_000_000;
    let begin = std::time::Instant::now();
    let input = BufReader::with_capacity(1 << 16, source);
    let mut recording =
        Recording::new(input, Path::new("endless.mvnx"), Options::default()).expect("good");
    let (mut count, mut early, mut late) = (0u64, 0, 0);
    while let Some(frame) = recording.next() {
        frame.expect("a good frame");
        count += 1;
        if count == 1000 {
            early = recording.buffered_bytes();
        }
        late = recording.buffered_bytes();
    }
    let elapsed = begin.elapsed().as_secs_f64();
    let peak = peak_memory_mb();
    let speed = seconds as f64 / elapsed;
    println!(
        "{count} frames, {megabytes} MB in {elapsed:.1} s: {speed:.0} times real time, peak {peak:?} MB, buffers {late} B"
    );
    assert_eq!(count, 240 * seconds);
    assert!(
        late <= early + 4096,
        "buffers grew from {early} to {late} bytes"
    );
    assert!(
        peak.is_none_or(|peak| peak < 100),
        "peak memory {peak:?} MB"
    );
    assert!(speed > 20.0, "{speed} times real time");
}

fn one_huge_event_is_refused_before_it_fills_memory() {
    let head = b"<?xml version=\"1.0\"?><mvnx version=\"4\"><comment>".as_slice();
    let input = BufReader::new(head.chain(std::io::repeat(b'a').take(200_000_000)));
    let problem = Recording::new(input, Path::new("huge.mvnx"), Options::default()).err();
    let problem = problem.expect("refused").to_string();
    assert!(problem.contains("huge.mvnx"), "{problem}");
    let peak = peak_memory_mb();
    assert!(
        peak.is_none_or(|peak| peak < 100),
        "peak memory {peak:?} MB"
    );
}
