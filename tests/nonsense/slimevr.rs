//! Traffic of SlimeVR's trackers that is nonsense, and records of it.

use std::fs;
use std::path::Path;

use bodyflight_tests::slimevr_jump::{Restart, Traffic, USUAL, address, calibrated, traffic, worn};
use bodyflight_tests::slimevr_trackers::{Form, Tracker, pcap};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::{bodyflight, part, rows};

/// Place of the sensor on the left thigh in the set of ten.
const THIGH: u8 = 6;

/// A kind of nonsense: a file of traffic, made of a jump, and a change of the record.
struct Kind {
    name: &'static str,
    file: fn(&Path) -> Vec<u8>,
    change: fn(&Path),
}

const fn sent(name: &'static str, file: fn(&Path) -> Vec<u8>) -> Kind {
    Kind {
        name,
        file,
        change: |_| (),
    }
}

const fn recorded(name: &'static str, change: fn(&Path)) -> Kind {
    Kind {
        name,
        file: |jump| pcap(&usual(jump)),
        change,
    }
}

fn usual(jump: &Path) -> Traffic {
    traffic(jump, USUAL, 180.0, None)
}

/// The traffic of a jump, each datagram changed; `None` leaves it out.
fn changed(jump: &Path, change: impl Fn(f64, u8, &mut Vec<u8>) -> bool) -> Traffic {
    let mut all = usual(jump);
    all.retain_mut(|(time, from, bytes)| {
        let place = (0..10).find(|place| address(*place) == *from);
        change(*time, place.expect("a tracker"), bytes)
    });
    all
}

fn restarted(jump: &Path, off_s: [f64; 2]) -> Vec<u8> {
    let restart = Restart {
        place: THIGH,
        off_s,
    };
    pcap(&traffic(jump, USUAL, 180.0, Some(restart)))
}

/// A byte of what the tracker on the thigh says of its sensor.
fn informed(jump: &Path, at: usize, value: u8) -> Vec<u8> {
    pcap(&changed(jump, |_, place, bytes| {
        if place == THIGH && bytes[3] == 15 {
            bytes[at] = value;
        }
        true
    }))
}

/// A file of pcap as Wireshark saves it: the same packets in blocks.
fn pcapng(file: &[u8]) -> Vec<u8> {
    let block = |kind: u32, parts: &[&[u8]]| {
        let content = parts.concat();
        let filling = vec![0; content.len().next_multiple_of(4) - content.len()];
        let length = u32::try_from(content.len() + filling.len() + 12).expect("short");
        let length = length.to_le_bytes();
        [
            &kind.to_le_bytes()[..],
            &length,
            &content,
            &filling,
            &length,
        ]
        .concat()
    };
    let order = 0x1A2B_3C4D_u32.to_le_bytes();
    let mut made = block(0x0A0D_0D0A, &[&order, &[1, 0, 0, 0], &[0xFF; 8]]);
    made.extend(block(1, &[&[101, 0, 0, 0], &[0; 4]]));
    let mut rest = &file[24..];
    while let Some((head, after)) = rest.split_first_chunk::<16>() {
        let number = |at: usize| u32::from_le_bytes(*head[at..].first_chunk().expect("enough"));
        let time = u64::from(number(0)) * 1_000_000 + u64::from(number(4));
        let [low, high] = [time & 0xFFFF_FFFF, time >> 32];
        let [low, high] = [low, high].map(|half| u32::try_from(half).expect("half"));
        let (packet, next) = after.split_at(number(8) as usize);
        let times = [high.to_le_bytes(), low.to_le_bytes()].concat();
        made.extend(block(6, &[&[0; 4], &times, &head[8..], packet]));
        rest = next;
    }
    made
}

/// A single tracker whose quaternions are twice as long as they should be.
fn long_quaternions(_: &Path) -> Vec<u8> {
    let mut tracker = Tracker::new(0, Form::Bundled);
    let mut all = vec![(0.0, address(0), tracker.handshake(13))];
    let turn = UnitQuaternion::new_unchecked(Quaternion::new(2.0, 0.0, 0.0, 0.0));
    for k in 0..200 {
        let packets = tracker.sample(0, &turn, &Vector3::zeros());
        let time = 0.01 * f64::from(k);
        all.extend(packets.into_iter().map(|bytes| (time, address(0), bytes)));
    }
    pcap(&all)
}

/// The lines of the table of the left thigh after its names, changed.
fn edited(record: &Path, change: impl Fn(Vec<String>) -> Vec<String>) {
    let path = record.join("A0B1C2D3E406.csv");
    let text = fs::read_to_string(&path).expect("a table");
    let mut lines = text.lines().map(str::to_owned);
    let names = lines.next().expect("names");
    let lines = change(lines.collect());
    fs::write(&path, [vec![names], lines].concat().join("\n")).expect("written");
}

const KINDS: [Kind; 22] = [
    sent("nothing", |jump| pcap(&usual(jump))),
    sent("a file of Wireshark", |jump| pcapng(&pcap(&usual(jump)))),
    sent("a third of the packets out of order", |jump| {
        let network = bodyflight_tests::slimevr_jump::Network {
            lost: 0.0,
            disordered: 0.33,
            ..USUAL
        };
        pcap(&traffic(jump, network, 180.0, None))
    }),
    sent("a table in place of traffic", |_| {
        b"time,x\n0,1\n1,2\n".to_vec()
    }),
    sent("traffic of another program", |jump| {
        pcap(&changed(jump, |_, _, bytes| {
            *bytes = b"GET / HTTP/1.1\r\n\r\n".to_vec();
            true
        }))
    }),
    sent("only introductions", |jump| {
        pcap(&changed(jump, |_, _, bytes| bytes[3] == 3))
    }),
    sent("quaternions of length 2", long_quaternions),
    sent("traffic that is cut off", |jump| {
        let mut bytes = pcap(&usual(jump));
        bytes.truncate(bytes.len() / 10 * 8 + 3);
        bytes
    }),
    sent("two trackers at one address", |jump| {
        let mut all = usual(jump);
        for (_, from, _) in &mut all {
            if *from == address(THIGH) {
                *from = address(7);
            }
        }
        pcap(&all)
    }),
    sent("two trackers of one name", |jump| {
        let name = Tracker::new(7, Form::Bundled).mac;
        pcap(&changed(jump, |_, place, bytes| {
            if place == THIGH && bytes[3] == 3 {
                let at = bytes.windows(5).position(|own| *own == name[..5]);
                bytes[at.expect("a name") + 5] = 7;
            }
            true
        }))
    }),
    sent("a tracker of another kind", |jump| informed(jump, 14, 4)),
    sent("a magnetometer in use", |jump| informed(jump, 16, 3)),
    sent("a tracker is not there", |jump| {
        pcap(&changed(jump, |_, place, _| place != THIGH))
    }),
    sent("a tracker dies in flight", |jump| {
        pcap(&changed(jump, |time, place, _| {
            place != THIGH || time < 80.0
        }))
    }),
    sent("a tracker restarts before the first pose", |jump| {
        restarted(jump, [39.0, 40.2])
    }),
    sent("a tracker restarts before the exit", |jump| {
        restarted(jump, [60.0, 63.0])
    }),
    sent("a tracker restarts in flight", |jump| {
        restarted(jump, [80.0, 83.0])
    }),
    recorded("a table that is cut off", |record| {
        edited(record, |mut lines| {
            lines.truncate(lines.len() / 10 * 8);
            lines
        });
    }),
    recorded("a table that is cut off in a line", |record| {
        edited(record, |mut lines| {
            lines.truncate(lines.len() / 10 * 8);
            let last = lines.last_mut().expect("a line");
            last.truncate(20);
            lines
        });
    }),
    recorded("a table with times backwards", |record| {
        edited(record, |mut lines| {
            lines[2000..2010].reverse();
            lines
        });
    }),
    recorded("a table with a quaternion of length 2", |record| {
        edited(record, |mut lines| {
            let cells = lines[2000].split(',').enumerate().map(|(place, cell)| {
                let number: f64 = cell.parse().unwrap_or(f64::NAN);
                match place {
                    1..5 => format!("{:.8}", 2.0 * number),
                    _ => cell.to_owned(),
                }
            });
            lines[2000] = cells.collect::<Vec<_>>().join(",");
            lines
        });
    }),
    recorded("a table for two segments", |record| {
        let mapping = record.join("mapping.toml");
        let text = fs::read_to_string(&mapping).expect("a mapping");
        let text = text.replace("A0B1C2D3E407.csv", "A0B1C2D3E406.csv");
        fs::write(mapping, text).expect("written");
    }),
];

#[test]
fn neither_read_nor_import_is_silent_about_nonsense_of_trackers() {
    let page = part(7);
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name).to_str().expect("plain").to_owned();
    let [jump, file, record, out] = ["jump", "traffic", "record", "out"].map(at);
    let seed = "6104";
    let (said, code) = bodyflight(&[
        "synth",
        "transitions",
        "--sensors",
        "10",
        "--seed",
        seed,
        "--out",
        &jump,
    ]);
    assert_eq!(code, Some(0), "{said}");
    let all = rows(&page);
    let names: Vec<&str> = all.iter().map(|row| row[0]).collect();
    assert_eq!(names, KINDS.map(|kind| kind.name));
    let mut wrong = Vec::new();
    for (row, kind) in all.iter().zip(&KINDS) {
        let [_, sentence, read, import] = row[..] else {
            panic!("{row:?}: expected a kind, a sentence and two codes");
        };
        fs::write(&file, (kind.file)(Path::new(&jump))).expect("written");
        let _ = fs::remove_dir_all(&record);
        let worn = worn();
        let mut arguments = vec!["slimevr", "read", &file, "--out", &record];
        arguments.extend(worn.iter().map(String::as_str));
        let (mut all_said, ended) = bodyflight(&arguments);
        let mut is_right = ended == read.parse().ok();
        if Path::new(&record).exists() && import != "-" {
            calibrated(Path::new(&jump), Path::new(&record), 4.0);
            (kind.change)(Path::new(&record));
            let mapping = format!("{record}/mapping.toml");
            let subject = format!("{jump}/subject.toml");
            let (said, ended) = bodyflight(&[
                "import",
                &record,
                "--mapping",
                &mapping,
                "--subject",
                &subject,
                "--out",
                &out,
                "--force",
            ]);
            is_right &= ended == import.parse().ok();
            all_said += &said;
        } else {
            is_right &= import == "-";
        }
        if !is_right || !all_said.contains(sentence) {
            wrong.push(format!("{}: ends with {ended:?}: {all_said}", kind.name));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n\n"));
}
