//! Readers on files of at least 100 MB, which are public recordings again and again.

use std::fmt::Write as _;
use std::path::Path;

use bodyflight_mocap::source::Source;
use bodyflight_mvnx::{Fields, Frame, ReadOptions, Reader};
use bodyflight_shared_data::shared;

use crate::cost::least;
use crate::limits::Limits;

/// Size of the files (bytes).
const SIZE: usize = 100_000_000;

pub(crate) fn print(folder: &Path, limits: &Limits) {
    println!("| reader | MB | MB per second of a core | share of memory |\n|---|---|---|---|");
    let row = |name: &str, text: String, read: &dyn Fn(Vec<u8>)| {
        let text = text.into_bytes();
        // The reader may keep the bytes, so that each attempt needs its own, which are made beforehand.
        let mut copies = vec![text.clone(), text.clone(), text];
        let bytes = copies[0].len() as f64;
        let seconds = least(|| read(copies.pop().expect("one for each attempt")));
        println!(
            "| {name} | {:.0} | {:.0} | {:.1} % |",
            1e-6 * bytes,
            1e-6 * bytes / seconds,
            100.0 * limits.byte * bytes / seconds
        );
    };
    let tracks = [
        ("FlySight 1", "flysight/skyderby/_703_14-41-39.CSV", 1),
        ("FlySight 2", "flysight/skyderby/fs2-track.csv", 7),
    ];
    for (name, file, head) in tracks {
        let track = track(&public(&format!("data/{file}")), head);
        row(name, track, &|bytes| {
            bodyflight_tracks::parse(&bytes, Path::new(file)).expect("a track");
        });
    }
    let sensors = repeated_rows(&public("data/flysight/yoleg-flysight2csv/SENSOR.CSV"), 17);
    let beside = folder.join("TRACK.CSV");
    std::fs::write(folder.join("SENSOR.CSV"), &sensors).expect("written");
    let track = public("data/flysight/yoleg-flysight2csv/TRACK.CSV");
    row("FlySight 2, with its sensors", sensors, &|_| {
        bodyflight_tracks::parse(track.as_bytes(), &beside).expect("a track");
    });
    row(
        "BVH",
        bvh(&public("cases/mocap/b_NTSC-29.97.bvh")),
        &|bytes| {
            Source::parse(bytes, Path::new("a.bvh"), None).expect("a motion");
        },
    );
    let recording = recording(&public("data/acrobatics/Do_44_mvtPrep_1.mvnx"));
    for (name, fields) in [("all", Fields::ALL), ("a flight's", Fields::FLIGHT)] {
        let options = ReadOptions {
            fields,
            ..ReadOptions::default()
        };
        row(
            &format!("MVNX, {name} fields"),
            recording.clone(),
            &|bytes| {
                let reader = Reader::new(&bytes[..], Path::new("a.mvnx"), options);
                let (mut reader, mut frame) = (reader.expect("a recording"), Frame::default());
                while reader.next_frame(&mut frame).expect("a frame") {}
            },
        );
    }
    println!();
}

fn public(file: &str) -> String {
    let path = shared(file).expect("shared data");
    std::fs::read_to_string(path).expect("text")
}

/// The lines after the first `head` again and again.
fn repeated_rows(text: &str, head: usize) -> String {
    let begin = text.split_inclusive('\n').take(head).map(str::len).sum();
    let (head, rows) = text.split_at(begin);
    let rows = format!("{}\n", rows.trim_end());
    let mut text = head.to_owned();
    while text.len() < SIZE {
        text += &rows;
    }
    text
}

/// The rows of a track again and again, a fifth of a second apart.
fn track(text: &str, head: usize) -> String {
    let mut lines = text.lines();
    let mut made: String = lines
        .by_ref()
        .take(head)
        .flat_map(|line| [line, "\n"])
        .collect();
    let mut tenths = 0;
    for row in lines.collect::<Vec<_>>().iter().cycle() {
        let Some((before, after)) = row.split_once("20") else {
            continue;
        };
        let (_, after) = after.split_once(',').expect("a place");
        let [hours, minutes] = [tenths / 36_000, tenths / 600 % 60];
        let (day, hour) = (1 + hours / 24, hours % 24);
        let second = 0.1 * f64::from(tenths % 600);
        let _ = writeln!(
            made,
            "{before}2024-06-{day:02}T{hour:02}:{minutes:02}:{second:05.2}Z,{after}"
        );
        tenths += 2;
        if made.len() > SIZE {
            break;
        }
    }
    made
}

fn bvh(text: &str) -> String {
    let head = text.lines().position(|line| line.starts_with("Frame Time"));
    let head = head.expect("a motion") + 1;
    let frames = text.lines().count() - head;
    let made = repeated_rows(text, head);
    let count = made.lines().count() - head;
    made.replacen(&format!("Frames: {frames}"), &format!("Frames: {count}"), 1)
}

fn recording(text: &str) -> String {
    let mut made = String::new();
    let begin = text.find("<frame time=\"0\" index=\"0\"").expect("frames");
    let end = text.rfind("</frame>").expect("frames") + "</frame>".len();
    made += &text[..begin];
    let frames: Vec<&str> = text[begin..end].split_inclusive("</frame>").collect();
    for (index, frame) in frames.iter().cycle().enumerate() {
        let inside = &frame[frame.find('>').expect("a tag")..];
        let time = 5 * index;
        let _ = write!(
            made,
            "\n<frame time=\"{time}\" index=\"{index}\" tc=\"00:00:00:00\" ms=\"{time}\" type=\"normal\"{inside}"
        );
        if made.len() > SIZE {
            break;
        }
    }
    made + &text[end..]
}
