//! A jump with SlimeVR's trackers: from their packets, late, lost and out of order, to postures and estimates.

use std::path::Path;

use bodyflight_tests::program::{plain, text};
use bodyflight_tests::slimevr_jump::{Network, Restart, Traffic, USUAL, calibrated, traffic, worn};
use bodyflight_tests::slimevr_trackers::pcap;

use super::{BEFORE, Jump, PROGRAM};

/// Reads traffic and imports the jump, of which this is added to the flight's table in the mapping; returns the largest errors
/// of directions over time (degrees) and what was said.
fn imported(folder: &Path, traffic: &Traffic, flight: &str) -> (Vec<f64>, String, Option<i32>) {
    let capture = folder.join("traffic.pcap");
    std::fs::write(&capture, pcap(traffic)).expect("a file");
    let record = folder.join("record");
    // That of another traffic.
    let _ = std::fs::remove_dir_all(&record);
    let worn = worn();
    let mut arguments = vec!["slimevr", "read", plain(&capture), "--out", plain(&record)];
    arguments.extend(worn.iter().map(String::as_str));
    let report = PROGRAM.json(&arguments);
    assert_eq!(report["sensors"].as_array().map(Vec::len), Some(10));
    let jump = folder.join("jump");
    calibrated(&jump, &record, BEFORE);
    let mapping = record.join("mapping.toml");
    let own = std::fs::read_to_string(&mapping).expect("a mapping");
    let own = own.replace("[flight]\n", &format!("[flight]\n{flight}\n"));
    std::fs::write(&mapping, own).expect("a file");
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
    let traffic = traffic(&folder.path().join("jump"), USUAL, 180.0, None);
    assert!(traffic.iter().all(|(time, ..)| *time >= 0.0));
    let (off, said, code) = imported(folder.path(), &traffic, "");
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

/// The heading of a tracker that restarted is another one, so that its sensor is doubted, unless that was before the first pose.
#[test]
fn trackers_that_restart_after_the_first_pose_are_doubted() {
    let folder = tempfile::tempdir().expect("a folder");
    flown(folder.path(), "transitions", "6103");
    let jump = folder.path().join("jump");
    let (pelvis, l_thigh) = (0, 6);
    let told = "the tracker of l_thigh (A0B1C2D3E406.csv) restarted at";
    for (place, off_s, flight, expected) in [
        // Before the first pose, and in a part that is not flown.
        (l_thigh, [39.0, 40.2], "", None),
        (l_thigh, [80.0, 83.0], "end_s = 79.5", None),
        // In the flight, and so short that no gap would tell.
        (
            l_thigh,
            [80.0, 83.0],
            "",
            Some("83.0 s, 17.0 s after the begin of the flight"),
        ),
        (
            l_thigh,
            [80.0, 80.1],
            "",
            Some("end the flight before it, with end_s = 79.9"),
        ),
        // Between the march and the exit, where gaps are not doubted.
        (
            l_thigh,
            [60.0, 63.0],
            "",
            Some("calibrate again after a tracker restarted"),
        ),
        // Directions are relative to the pelvis.
        (
            pelvis,
            [60.0, 63.0],
            "",
            Some("the tracker of pelvis (A0B1C2D3E400.csv) restarted at"),
        ),
    ] {
        let restart = Some(Restart { place, off_s });
        let sent = traffic(&jump, USUAL, 180.0, restart);
        let (_, said, code) = imported(folder.path(), &sent, flight);
        let said = said.split_whitespace().collect::<Vec<_>>().join(" ");
        let Some(expected) = expected else {
            assert_eq!(code, Some(0), "{off_s:?}: {said}");
            continue;
        };
        assert_eq!(code, Some(5), "{off_s:?}: {said}");
        assert!(said.contains(expected), "{off_s:?}: {said}");
        assert_eq!(said.contains(told), place == l_thigh, "{said}");
        let flight = folder.path().join("suit/flight.toml");
        let flight = std::fs::read_to_string(flight).expect("a flight");
        let doubted = flight.lines().find(|line| line.starts_with("doubted"));
        let count = doubted.map(|line| line.matches('"').count() / 2);
        assert_eq!(
            count,
            Some(if place == pelvis { 10 } else { 1 }),
            "{doubted:?}"
        );
    }
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
                        &traffic(&folder.path().join("jump"), network, turn, None),
                        "",
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
