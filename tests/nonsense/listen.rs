//! Live streams that contradict themselves.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};

use super::{bodyflight, kind, recorded};

/// Sends a recording to an address, four times as fast as it was.
fn sent(recording: &Path, address: &str) {
    let flight = recording.join("flight.mvnx");
    let flight = flight.to_str().expect("plain");
    let (said, ended) = bodyflight(&["mvn", "send", flight, "--to", address, "--speed", "4"]);
    assert_eq!(ended, Some(0), "{said}");
}

#[test]
fn a_stream_that_contradicts_itself_is_doubted_by_who_only_listens() {
    let folder = tempfile::tempdir().expect("a folder");
    let recorded = recorded(folder.path());
    for (name, expected) in [("nothing", 0), ("forearm frozen from 4 s", 5)] {
        let made = folder.path().join("made");
        recorded.write(&made, kind(name).expect("a kind"));
        let mut listen = Command::new(env!("CARGO_BIN_EXE_bodyflight"))
            .args(["mvn", "listen", "--bind", "127.0.0.1:0", "--frames", "1400"])
            .arg("--json")
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("the binary starts");
        let mut lines = BufReader::new(listen.stdout.take().expect("a pipe")).lines();
        let first = lines.next().expect("a line").expect("text");
        let address = first.split('"').nth(3).expect("an address");
        sent(&made, address);
        let said: Vec<String> = lines.map_while(Result::ok).collect();
        let ended = listen.wait().expect("ended").code();
        let is_told = said
            .concat()
            .contains("r_forearm keeps exactly the same attitude");
        assert_eq!(
            (ended, is_told),
            (Some(expected), expected == 5),
            "{said:?}"
        );
    }
}

#[test]
fn a_live_stream_is_checked_as_a_recording_is() {
    let folder = tempfile::tempdir().expect("a folder");
    let recorded = recorded(folder.path());
    let made = folder.path().join("made");
    recorded.write(&made, kind("the body stands").expect("a kind"));
    let mut stream = Command::new(env!("CARGO_BIN_EXE_bodyflight"))
        .args(["stream", "--mvn", "127.0.0.1:0", "--virtual"])
        .stderr(Stdio::piped())
        .stdout(Stdio::null())
        .spawn()
        .expect("the binary starts");
    let mut lines = BufReader::new(stream.stderr.take().expect("a pipe")).lines();
    let first = lines.next().expect("a line").expect("text");
    let address = first.rsplit(' ').next().expect("an address");
    sent(&made, address);
    let said: Vec<String> = lines.map_while(Result::ok).collect();
    let said = said.join(" ");
    // On a machine that is too slow, the unit drops samples, which is another problem.
    let ended = stream.wait().expect("ended").code();
    assert!([Some(4), Some(5)].contains(&ended), "{said}");
    assert!(said.contains("something carries the body"), "{said}");
}
