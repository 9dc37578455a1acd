//! Serial ports and the data read from them.

use std::io::{BufRead, BufReader, Write};
use std::process::{Command, Stdio};
use std::time::Duration;

use serde_json::Value;

use crate::{BINARY, bodyflight, fails, plain, shared};

/// Returns the standard output, one JSON object per line.
fn lines(arguments: &[&str]) -> Vec<Value> {
    let output = bodyflight(&[arguments, &["--json"]].concat());
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {message}");
    let text = String::from_utf8(output.stdout).expect("text");
    let value = |line: &str| serde_json::from_str(line).expect("JSON");
    text.lines().map(value).collect()
}

#[test]
fn ports_are_listed() {
    let output = bodyflight(&["ports", "--json"]);
    assert!(output.status.success());
    let ports: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let ports = ports.as_array().expect("a list");
    assert!(
        ports
            .iter()
            .all(|port| port["name"].is_string() && port["kind"].is_string())
    );
    let text = bodyflight(&["ports"]);
    let text = String::from_utf8(text.stdout).expect("text");
    assert_eq!(text.contains("no serial ports"), ports.is_empty(), "{text}");
}

#[test]
fn monitor_reads_the_recordings_of_real_sensors() {
    let einride = |number: u32| format!("xbus/einride-xsens-go/{number}/output.bin");
    for name in (1..=5).map(einride) {
        let Some(path) = shared(&name) else { continue };
        let lines = lines(&["monitor", "--xbus", plain(&path)]);
        let (totals, packets) = lines.split_last().expect("totals");
        assert_eq!(packets.len(), 100, "{name}");
        let totals = &totals["totals"];
        assert_eq!(totals["packets"], 100, "{name}: {totals}");
        for fault in ["skipped_bytes", "bad_checksums", "bad_lengths", "bad_items"] {
            assert_eq!(totals[fault], 0, "{name}: {totals}");
        }
        let text = bodyflight(&["monitor", "--xbus", plain(&path)]);
        let text = String::from_utf8(text.stdout).expect("text");
        assert!(
            text.contains("packet_counter") && text.contains("100 packets"),
            "{text}"
        );
    }
}

fn packet(counter: u16) -> Vec<u8> {
    use bodyflight_core::xbus::{DataId, MessageId, PacketWriter};
    let mut bytes = [0; 64];
    let mut writer = PacketWriter::new(&mut bytes, MessageId::MT_DATA2);
    let written = writer.item(DataId::PACKET_COUNTER, &counter.to_be_bytes());
    written.expect("room");
    writer
        .reals(DataId::RATE_OF_TURN, &[0.5, -1.0, 2.0])
        .expect("room");
    let length = writer.finish().expect("room");
    bytes[..length].to_vec()
}

#[test]
fn monitor_reads_files_and_says_what_it_skipped() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("sensor.bin");
    let mut bytes = vec![0x11; 7];
    (0..20).for_each(|counter| bytes.extend(packet(counter)));
    std::fs::write(&path, bytes).expect("written");
    let lines = lines(&["monitor", "--xbus", plain(&path)]);
    assert_eq!(lines.len(), 21);
    assert_eq!(lines[3]["items"]["packet_counter"], 3);
    assert_eq!(lines[3]["items"]["rate_of_turn_radps"][1], -1.0);
    assert_eq!(lines[20]["totals"]["skipped_bytes"], 7);
    let output = bodyflight(&["monitor", "--xbus", "--items", plain(&path)]);
    let text = String::from_utf8(output.stdout).expect("text");
    assert!(
        text.matches("rate_of_turn_radps [0.5,-1.0,2.0]").count() >= 20,
        "{text}"
    );
}

#[cfg(unix)]
#[test]
fn monitor_reads_a_terminal_until_ctrl_c() {
    use serialport::{SerialPort, TTYPort};
    let (mut device, terminal) = TTYPort::pair().expect("a pseudo terminal");
    let name = terminal.name().expect("a name");
    // The binary needs exclusive access.
    drop(terminal);
    let mut monitor = Command::new(BINARY)
        .args(["monitor", "--xbus", &name, "--json"])
        .stdout(Stdio::piped())
        .spawn()
        .expect("the binary starts");
    let mut output = BufReader::new(monitor.stdout.take().expect("a pipe")).lines();
    let (stop, stopped) = std::sync::mpsc::channel::<()>();
    let sender = std::thread::spawn(move || {
        for counter in 0.. {
            let _ = device.write_all(&packet(counter));
            let pause = stopped.recv_timeout(Duration::from_millis(5));
            if pause != Err(std::sync::mpsc::RecvTimeoutError::Timeout) {
                return;
            }
        }
    });
    for _ in 0..10 {
        let line = output.next().expect("a line").expect("text");
        let packet: Value = serde_json::from_str(&line).expect("JSON");
        assert_eq!(packet["items"]["rate_of_turn_radps"][0], 0.5, "{packet}");
    }
    let id = monitor.id().to_string();
    assert!(
        Command::new("kill")
            .args(["-INT", &id])
            .status()
            .expect("kill")
            .success()
    );
    let last = output.map_while(Result::ok).last().expect("totals");
    assert_eq!(monitor.wait().expect("ended").code(), Some(130));
    let totals: Value = serde_json::from_str(&last).expect("JSON");
    assert!(
        totals["totals"]["packets"].as_u64().expect("a count") >= 10,
        "{totals}"
    );
    drop(stop);
    sender.join().expect("the sender ends");
}

#[cfg(feature = "full")]
#[test]
fn logs_need_the_elf_file_of_a_program_with_defmt() {
    let message = fails(&["monitor", "--defmt", "no.elf"], 3);
    assert!(message.contains("no.elf"), "{message}");
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("unit.hex");
    std::fs::write(&path, ":10000000").expect("written");
    let message = fails(&["monitor", "--defmt", plain(&path)], 2);
    assert!(
        message.contains("not an ELF file") && message.contains("flashed"),
        "{message}"
    );
    if cfg!(target_os = "linux") {
        let message = fails(&["monitor", "--defmt", BINARY], 2);
        assert!(message.contains("does not use defmt"), "{message}");
    }
}

#[test]
fn monitor_reports_what_it_cannot_use() {
    let message = fails(&["monitor", "--xbus", "/dev/no-such-port"], 3);
    assert!(message.contains("bodyflight ports"), "{message}");
    fails(&["monitor"], 2);
    fails(&["monitor", "--xbus", "--defmt", "x", "-"], 2);
}
