//! `cargo xtask soak`: hours of streaming, killed processes and full disks.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use crate::page;
use crate::run::{PROGRAM, Result, build_full_program, cargo_in, root, say, target_folder};

/// Number of programs to kill.
const KILLS: u32 = 100;

/// Longest time before a program is killed (ms).
const LIFE_MS: u32 = 1500;

/// Sizes of the small disks (KiB), all smaller than a flight.
const ROOM_KIB: [u32; 4] = [16, 64, 256, 1024];

/// Kills running programs and fills disks, then streams for hours of virtual time through faults, restarts and wrapping
/// clocks. `write` puts the table of the streaming test into the documentation.
pub(crate) fn soak(hours: u32, write: bool) -> Result<()> {
    build_full_program()?;
    kill()?;
    fill_disks()?;
    let table = target_folder()?.join("soak.md");
    let variables = [
        ("BODYFLIGHT_SOAK_HOURS", hours.to_string()),
        ("BODYFLIGHT_SOAK_TABLE", table.display().to_string()),
    ];
    for [test, which] in [["soak", "--ignored"], ["unit_soak", "--include-ignored"]] {
        let package = [
            "test",
            "--locked",
            "--package",
            "bodyflight-tests",
            "--test",
            test,
        ];
        let arguments = [&package[..], &["--", which, "--nocapture"]].concat();
        cargo_in(&root(), &arguments, &variables)?;
    }
    if write {
        page::put("soak", &table)?;
    }
    Ok(())
}

fn program() -> Result<Command> {
    Ok(Command::new(target_folder()?.join(PROGRAM)))
}

/// Checks that every file under `folder` with a final name is complete: a recording ends with its last tag, others with
/// a newline. Returns the number of files.
fn check_whole(folder: &Path) -> Result<u32> {
    let mut whole = 0;
    let entries =
        std::fs::read_dir(folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    for entry in entries.flatten() {
        let path = entry.path();
        if path.is_dir() {
            whole += check_whole(&path)?;
            continue;
        }
        let name = entry.file_name().to_string_lossy().into_owned();
        if name.starts_with(".tmp") {
            // A killed process cannot clean up; a temporary file is not mistaken for a result.
            continue;
        }
        let text = std::fs::read_to_string(&path)
            .map_err(|error| format!("{}: {error}", path.display()))?;
        let ends = if name.ends_with(".mvnx") {
            "</mvnx>\n"
        } else {
            "\n"
        };
        if !text.ends_with(ends) && !text.ends_with(ends.trim_end()) || text.is_empty() {
            return Err(format!("{} is incomplete", path.display()));
        }
        whole += 1;
    }
    Ok(whole)
}

/// Kills programs while they write, at moments spread over their lifetime.
fn kill() -> Result<()> {
    let folder = target_folder()?.join("soak");
    let _ = std::fs::remove_dir_all(&folder);
    let mut whole = 0;
    for round in 0..KILLS {
        let out = folder.join(round.to_string());
        std::fs::create_dir_all(&out).map_err(|error| format!("{}: {error}", out.display()))?;
        let mut child = program()?
            .args([
                "hide",
                "clean",
                "--flights",
                "20",
                "--duration",
                "5",
                "--out",
            ])
            .arg(&out)
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .map_err(|error| format!("cannot start bodyflight: {error}"))?;
        // A step coprime to the lifetime spreads the moments over it.
        std::thread::sleep(Duration::from_millis(u64::from(round * 397 % LIFE_MS)));
        let _ = child.kill();
        child
            .wait()
            .map_err(|error| format!("bodyflight: {error}"))?;
        whole += check_whole(&out)?;
        let _ = std::fs::remove_dir_all(&out);
    }
    say(&format!(
        "{KILLS} programs killed while writing: {whole} files, all complete"
    ));
    Ok(())
}

/// Writes to disks that are too small: there must be an error and no partial file.
fn fill_disks() -> Result<()> {
    let folder = target_folder()?.join("soak/disk");
    std::fs::create_dir_all(&folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    for room in ROOM_KIB {
        let script = format!(
            "mount -t tmpfs -o size={room}k none \"$1\" || exit 99; \"$2\" hide clean --duration 5 --out \"$1\"; code=$?; \
             ls -A \"$1\"/* ; exit $code"
        );
        let output = Command::new("unshare")
            .args([
                "--mount",
                "--user",
                "--map-root-user",
                "sh",
                "-c",
                &script,
                "sh",
            ])
            .arg(&folder)
            .arg(program()?.get_program())
            .output()
            .map_err(|error| format!("cannot start unshare: {error}"))?;
        let errors = String::from_utf8_lossy(&output.stderr);
        let listed = String::from_utf8_lossy(&output.stdout);
        match output.status.code() {
            Some(99) | None => {
                say(&format!(
                    "full disks: skipped, this machine does not allow mounts for tests ({})",
                    errors.trim()
                ));
                return Ok(());
            }
            Some(1) if errors.contains("unshare") => {
                say(&format!("full disks: skipped ({})", errors.trim()));
                return Ok(());
            }
            Some(3) if !listed.contains(".tmp") => {}
            code => {
                return Err(format!(
                    "a disk of {room} KiB: code {code:?}, {listed}, {errors}"
                ));
            }
        }
    }
    say(&format!(
        "{} disks filled: an error each, and no partial file",
        ROOM_KIB.len()
    ));
    Ok(())
}
