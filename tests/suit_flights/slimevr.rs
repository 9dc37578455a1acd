//! A jump with SlimeVR's trackers: from their packets, late, lost and out of order, to postures and estimates.

use std::net::SocketAddr;
use std::path::Path;

use bodyflight_core::suit::placement::of_size;
use bodyflight_tests::program::{plain, text};
use bodyflight_tests::slimevr_trackers::{Form, Fusion, Tracker, pcap};
use nalgebra::{UnitQuaternion, Vector3};

use super::{BEFORE, Jump, PROGRAM, rows};

/// When trackers are switched on: a simulated sensor jumps from the tray to the body before, which none does (s).
const SWITCHED_ON: f64 = 38.2;

/// Numbers that look random.
struct Random(u64);

impl Random {
    /// From 0 to 1.
    fn share(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as f64 / (1_u64 << 31) as f64
    }
}

/// How a network treats packets.
#[derive(Clone, Copy)]
struct Network {
    /// Share that is lost.
    lost: f64,
    /// Usual largest delay (s).
    jitter_s: f64,
    /// Share of the time in which all wait.
    stalled: f64,
    /// Share that comes twice, or is overtaken.
    disordered: f64,
}

/// A network at home.
const USUAL: Network = Network {
    lost: 0.01,
    jitter_s: 0.01,
    stalled: 0.02,
    disordered: 0.01,
};

/// Traffic of a sensor's readings: a tracker for each, with the acceleration turned as its firmware does.
fn traffic(jump: &Path, network: Network, turn_deg: f64) -> Vec<(f64, SocketAddr, Vec<u8>)> {
    let mut all = Vec::new();
    let forms = [Form::Bundled, Form::Separate, Form::Compact];
    for (place, segment) in (0_u8..).zip(of_size(10).expect("a set")) {
        let mut random = Random(u64::from(place) + 7);
        let from = SocketAddr::from(([192, 168, 1, 100 + place], 6969));
        let mut tracker = Tracker::new(place, forms[usize::from(place) % 3]);
        // Times of the record are those of the simulation.
        all.push((0.0, from, tracker.handshake(13)));
        all.push((0.0, from, tracker.information(0, 13, false)));
        let table = rows(&jump.join(format!("sensors/{}.csv", segment.name())));
        let numbers = table.iter().skip(1).map(|row| {
            let each = row
                .iter()
                .map(|cell| cell.parse::<f64>().expect("a number"));
            each.collect::<Vec<f64>>()
        });
        let mut fusion = Fusion::default();
        let mut last: Option<(f64, UnitQuaternion<f64>)> = None;
        let turned = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turn_deg.to_radians());
        // Packets wait in one queue, so that one does not overtake another by chance.
        let mut queue = 0.0_f64;
        for numbers in numbers {
            let time = numbers[0];
            if time < SWITCHED_ON {
                continue;
            }
            let step = last.map_or(1.0 / 120.0, |(before, _)| time - before);
            let (rate, force) = (
                Vector3::from_row_slice(&numbers[1..4]),
                Vector3::from_row_slice(&numbers[4..7]),
            );
            let (turn, free) = fusion.take(&rate, &force, step);
            // The firmware does not repeat an orientation.
            let same = last.is_some_and(|(_, sent)| (sent.coords - turn.coords).amax() < 1e-4);
            last = Some((
                time,
                if same {
                    last.map_or(turn, |(_, sent)| sent)
                } else {
                    turn
                },
            ));
            if same {
                continue;
            }
            if random.share() < network.stalled / 10.0 {
                queue = queue.max(time + 0.1);
            }
            for packet in tracker.sample(0, &turn, &(turned * free)) {
                if random.share() < network.lost {
                    continue;
                }
                let delay = 0.002 + network.jitter_s * random.share().powi(3);
                let arrival = (time + delay).max(queue);
                queue = arrival;
                if random.share() < network.disordered {
                    all.push((arrival + 0.03 * random.share(), from, packet.clone()));
                    if random.share() < 0.5 {
                        continue;
                    }
                }
                all.push((arrival, from, packet));
            }
        }
    }
    all.sort_by(|one, other| one.0.total_cmp(&other.0));
    all
}

/// Reads traffic and imports the jump, and returns the largest errors of directions over time (degrees) and what was said.
fn imported(
    folder: &Path,
    traffic: &[(f64, SocketAddr, Vec<u8>)],
) -> (Vec<f64>, String, Option<i32>) {
    let capture = folder.join("traffic.pcap");
    std::fs::write(&capture, pcap(traffic)).expect("a file");
    let record = folder.join("record");
    let worn: Vec<String> = (0_u8..)
        .zip(of_size(10).expect("a set"))
        .map(|(place, segment)| {
            format!(
                "{}={}",
                Tracker::new(place, Form::Bundled).name(),
                segment.name()
            )
        })
        .collect();
    let mut arguments = vec!["slimevr", "read", plain(&capture), "--out", plain(&record)];
    for one in &worn {
        arguments.extend(["--tracker", one]);
    }
    let report = PROGRAM.json(&arguments);
    assert_eq!(report["sensors"].as_array().map(Vec::len), Some(10));
    // When the calibration and the flight were is known from the simulation.
    let mapping = record.join("mapping.toml");
    let own = std::fs::read_to_string(&mapping).expect("a mapping");
    let told =
        std::fs::read_to_string(folder.join("jump/sensors/mapping.toml")).expect("a mapping");
    let begin = told.find("[calibration]").expect("windows");
    let end = told.find("[sensors.").expect("sensors");
    // The trackers were not switched on in the tray.
    let worn = told[begin..end].lines();
    let worn = worn.filter(|line| !line.starts_with("tray_s") && !line.starts_with("turns_s"));
    let windows = worn.collect::<Vec<_>>().join("\n");
    let windows = windows.replace("gnss = ", &format!("gnss_begin_s = {BEFORE:?}\ngnss = "));
    std::fs::write(&mapping, format!("{own}\n{windows}\n")).expect("a file");
    std::fs::copy(
        folder.join("jump/sensors/TRACK.CSV"),
        record.join("TRACK.CSV"),
    )
    .expect("a track");
    let (subject, suit) = (folder.join("jump/subject.toml"), folder.join("suit"));
    let output = PROGRAM.run(&[
        "import",
        plain(&record),
        "--mapping",
        plain(&mapping),
        "--subject",
        plain(&subject),
        "--out",
        plain(&suit),
        "--force",
        "--json",
    ]);
    let said = text(&output.stdout) + &text(&output.stderr);
    let code = output.status.code();
    if ![Some(0), Some(5)].contains(&code) {
        return (Vec::new(), said, code);
    }
    let jump = Jump {
        folder: folder.to_owned(),
        said: String::new(),
        is_imported: true,
        is_doubted: code == Some(5),
    };
    let mut off: Vec<f64> = jump.off().into_iter().map(|(_, off)| off).collect();
    off.sort_by(f64::total_cmp);
    (off, said, code)
}

fn flown(folder: &Path, name: &str, seed: &str) {
    let jump = folder.join("jump");
    let made = PROGRAM.run(&[
        "synth",
        name,
        "--sensors",
        "10",
        "--seed",
        seed,
        "--out",
        plain(&jump),
    ]);
    assert!(made.status.success(), "{}", text(&made.stderr));
}

#[test]
fn packets_of_ten_trackers_become_postures_and_estimates() {
    let folder = tempfile::tempdir().expect("a folder");
    flown(folder.path(), "transitions", "6100");
    let traffic = traffic(&folder.path().join("jump"), USUAL, 180.0);
    assert!(traffic.iter().all(|(time, ..)| *time >= 0.0));
    let (off, said, code) = imported(folder.path(), &traffic);
    assert_eq!(code, Some(0), "{said}");
    let usual = off[off.len() / 2];
    eprintln!(
        "largest error of a direction: median {usual:.1}, largest {:.1} degrees",
        off[off.len() - 1]
    );
    assert!(usual < 20.0, "{usual}: {said}");
    let suit = folder.path().join("suit");
    let estimated = PROGRAM.run(&["estimate", plain(&suit), "--json"]);
    assert!(
        [Some(0), Some(5)].contains(&estimated.status.code()),
        "{}",
        text(&estimated.stderr)
    );
    let page = folder.path().join("page.html");
    let viewed = PROGRAM.run(&["view", plain(&suit), "--out", plain(&page)]);
    assert!(viewed.status.success(), "{}", text(&viewed.stderr));
}

/// What networks, forms and firmware do to the directions, as a table.
#[test]
#[ignore = "some minutes; prints a table"]
fn the_table_of_networks() {
    let networks = [
        ("raw readings", None),
        (
            "good",
            Some((
                Network {
                    lost: 0.0,
                    jitter_s: 0.002,
                    stalled: 0.0,
                    disordered: 0.0,
                },
                180.0,
            )),
        ),
        ("usual", Some((USUAL, 180.0))),
        (
            "bad",
            Some((
                Network {
                    lost: 0.1,
                    jitter_s: 0.03,
                    stalled: 0.2,
                    disordered: 0.05,
                },
                180.0,
            )),
        ),
        ("usual, acceleration turned otherwise", Some((USUAL, 0.0))),
    ];
    for name in ["transitions", "aggressive-turns", "exit-and-tracking"] {
        for (what, network) in networks {
            let folder = tempfile::tempdir().expect("a folder");
            let (off, said, code) = match network {
                None => {
                    let jump = Jump::new(folder.path(), name, 6101, None);
                    let mut off: Vec<f64> = jump.off().into_iter().map(|(_, off)| off).collect();
                    off.sort_by(f64::total_cmp);
                    (
                        off,
                        jump.said.clone(),
                        Some(if jump.is_doubted { 5 } else { 0 }),
                    )
                }
                Some((network, turn)) => {
                    flown(folder.path(), name, "6101");
                    imported(
                        folder.path(),
                        &traffic(&folder.path().join("jump"), network, turn),
                    )
                }
            };
            let at = |share: f64| {
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "a place in the list"
                )]
                let place = ((off.len() as f64 - 1.0) * share).max(0.0) as usize;
                off.get(place).copied().unwrap_or(f64::NAN)
            };
            println!(
                "{name}, {what}: median {:.1}, 95 % {:.1}, code {code:?}",
                at(0.5),
                at(0.95)
            );
            if code != Some(0) {
                println!("    {}", said.chars().take(1500).collect::<String>());
            }
        }
    }
}
