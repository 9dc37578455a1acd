//! Analysis of logger tracks by the real binary.
#![expect(
    clippy::expect_used,
    clippy::panic,
    reason = "tests may panic: that is how they fail"
)]

use std::fmt::Write;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use bodyflight_shared_data::shared;
use std::process::{Command, Output, Stdio};

use serde_json::Value;

fn bodyflight(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_bodyflight"))
        .args(arguments)
        .output()
        .expect("the binary starts")
}

/// Returns the standard output as JSON, and the exit code.
fn json(arguments: &[&str]) -> (Value, Option<i32>) {
    let output = bodyflight(&[arguments, &["--json"]].concat());
    let value = serde_json::from_slice(&output.stdout);
    (
        value.unwrap_or_else(|_| panic!("{}", String::from_utf8_lossy(&output.stderr))),
        output.status.code(),
    )
}

/// Returns the error message and the exit code; terminal output may wrap anywhere.
fn fails(arguments: &[&str]) -> (String, Option<i32>) {
    let output = bodyflight(arguments);
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    let words = message.split_whitespace().filter(|word| *word != "│");
    (words.collect::<Vec<_>>().join(" "), output.status.code())
}

fn number(value: &Value) -> f64 {
    value
        .as_f64()
        .unwrap_or_else(|| panic!("a number: {value}"))
}

/// Rows of a FlySight 1: the aircraft, 55 s of falling belly to earth, the opening, a circling canopy, the ground.
fn jump(seed: u64) -> String {
    let mut text = "time,lat,lon,hMSL,velN,velE,velD,hAcc,vAcc,sAcc,gpsFix,numSV\n\
                    ,(deg),(deg),(m),(m/s),(m/s),(m/s),(m),(m),(m/s),,\n"
        .to_owned();
    let (mut height, mut velocity) = (4000.0_f64, [0.0, -45.0, 0.0_f64]);
    let mut random = seed;
    let mut noise = || {
        random = random
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (random >> 40) as f64 / (1u64 << 24) as f64 - 0.5
    };
    const STEP: f64 = 0.02;
    let mut rest = 0.0;
    let mut step = 0_u32;
    while rest < 15.0 {
        let time = f64::from(step) * STEP;
        if step.is_multiple_of(10) {
            let minute = 10 + step / 3000;
            let second = time - 60.0 * f64::from(step / 3000);
            let [north, west, up] = velocity;
            let _ = writeln!(
                text,
                "2024-06-01T12:{minute:02}:{second:05.2}Z,46.0,8.0,{height:.2},{:.2},{:.2},{:.2},3.0,4.0,0.4,3,12",
                north + 0.3 * noise(),
                -west + 0.3 * noise(),
                -up + 0.3 * noise()
            );
        }
        step += 1;
        let since = time - 30.0;
        let density = 1.225 * (1.0 - 2.2558e-5 * height).powf(4.2559);
        let wind = [6.0 * height / 4000.0, 3.0, 0.0];
        let air = [0, 1, 2].map(|axis| velocity[axis] - wind[axis]);
        let speed = air.iter().map(|part| part * part).sum::<f64>().sqrt();
        if height <= 400.0 {
            velocity = [0.0; 3];
            rest += STEP;
        } else if (0.0..59.0).contains(&since) {
            let opened = ((since - 55.0) / 3.0).clamp(0.0, 1.0);
            let pull = 0.5 * density * speed * (1.0 / 153.0 + 0.25 * opened * opened);
            for axis in 0..3 {
                velocity[axis] -= air[axis] * pull * STEP;
            }
            velocity[2] -= 9.81 * STEP;
        } else if since >= 59.0 {
            let heading = 0.4 * since;
            let wanted = [
                wind[0] + 12.0 * heading.cos(),
                wind[1] + 12.0 * heading.sin(),
                -5.5,
            ];
            for axis in 0..3 {
                velocity[axis] += (wanted[axis] - velocity[axis]) * STEP;
            }
        }
        height += velocity[2] * STEP;
    }
    text
}

/// The same jump as a FlySight 2 writes it: `TRACK.CSV`, and `SENSOR.CSV` with accelerometer and barometer, whose clock
/// has a different origin. The ground pressure is `pressure` (Pa), the opening force 4.2 times gravity.
fn second_generation(folder: &Path, pressure: f64) -> String {
    let mut track =
        "$FLYS,1\n$COL,GNSS,time,lat,lon,hMSL,velN,velE,velD,hAcc,vAcc,sAcc,gpsFix,numSV\n$DATA\n"
            .to_owned();
    let mut sensors = "$FLYS,1\n$COL,BARO,time,pressure,temperature\n\
                       $COL,IMU,time,wx,wy,wz,ax,ay,az,temperature\n$COL,TIME,time,tow,week\n$DATA\n"
        .to_owned();
    // 2024-06-01 is a Saturday, which begins 518400 s into the week; 12:10 is 43800 s later.
    const BEGIN: f64 = 518_400.0 + 43_800.0;
    const CLOCK: f64 = 1234.5;
    let _ = writeln!(sensors, "$TIME,{CLOCK},{BEGIN},2316");
    for (row, line) in jump(3).lines().skip(2).enumerate() {
        let time = CLOCK + 0.2 * row as f64;
        let height: f64 = line
            .split(',')
            .nth(3)
            .and_then(|cell| cell.parse().ok())
            .expect("a height");
        let _ = writeln!(track, "$GNSS,{line}");
        let since = time - CLOCK - 85.0;
        let force = if (1.0..1.6).contains(&since) {
            4.2
        } else {
            1.0
        };
        let _ = writeln!(
            sensors,
            "$IMU,{time:.3},0,0,0,0.0,{:.4},{:.4},20",
            0.6 * force,
            0.8 * force
        );
        let here = pressure * (-(height - 400.0) / 8400.0).exp();
        let _ = writeln!(sensors, "$BARO,{time:.3},{here:.1},15");
    }
    written(folder, "SENSOR.CSV", &sensors);
    written(folder, "TRACK.CSV", &track)
}

#[test]
fn accelerometer_and_barometer_of_a_second_flysight_are_used() {
    let folder = tempfile::tempdir().expect("a folder");
    let track = second_generation(folder.path(), 92_000.0);
    let (report, code) = json(&["fall", &track]);
    assert_eq!(code, Some(0), "{report}");
    let sensors = &report["sensors"];
    let named = |name: &str| number(&sensors[name]);
    assert!(
        (named("ground_pressure_pa") - 92_000.0).abs() < 60.0,
        "{sensors}"
    );
    assert!((named("largest_g") - 4.2).abs() < 0.05, "{sensors}");
    assert!((named("fall_g") - 1.0).abs() < 0.01, "{sensors}");
    // In thinner air the same fall means a larger drag area. The standard pressure at 400 m is 96 611 Pa.
    std::fs::remove_file(folder.path().join("SENSOR.CSV")).expect("removed");
    let (standard, _) = json(&["fall", &track]);
    assert!(
        standard["sensors"]["ground_pressure_pa"].is_null(),
        "{standard}"
    );
    let ratio = number(&report["drag_area_m2"]) / number(&standard["drag_area_m2"]);
    assert!((ratio * 92_000.0 / 96_611.0 - 1.0).abs() < 0.01, "{ratio}");
    let (given, _) = json(&["fall", &track, "--ground-pressure", "920"]);
    let ratio = number(&given["drag_area_m2"]) / number(&report["drag_area_m2"]);
    assert!((ratio - 1.0).abs() < 0.002, "{ratio}");
}

#[test]
fn two_jumpers_of_one_load_fall_through_the_same_wind() {
    let folder = tempfile::tempdir().expect("a folder");
    let own = written(folder.path(), "one.csv", &jump(1));
    let other = written(folder.path(), "two.csv", &jump(9));
    let (report, code) = json(&["fall", &own, "--beside", &other]);
    assert_eq!(code, Some(0), "{report}");
    let beside = &report["beside"];
    assert!(number(&beside["heights"]) >= 3.0, "{beside}");
    assert!(number(&beside["winds_apart"]) < 2.0, "{beside}");
    // On another day the wind from the west is 20 m/s stronger at every height.
    let blown: Vec<String> = jump(9)
        .lines()
        .map(|line| {
            let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
            if let Ok(east) = cells[5].parse::<f64>() {
                cells[5] = format!("{:.2}", east + 20.0);
            }
            cells.join(",")
        })
        .collect();
    let other = written(folder.path(), "three.csv", &(blown.join("\n") + "\n"));
    let (message, code) = fails(&["fall", &own, "--beside", &other]);
    assert_eq!(code, Some(4), "{message}");
    assert!(message.contains("not from one load"), "{message}");
}

#[test]
fn falls_are_validated_beside_the_flights() {
    let folder = tempfile::tempdir().expect("a folder");
    let tracks = folder.path().join("tracks");
    std::fs::create_dir(&tracks).expect("a folder");
    written(&tracks, "one.csv", &jump(1));
    written(
        &tracks,
        "ground.csv",
        "time_s,north_m,east_m,height_m\n0,0,0,3\n1,0,0,3\n2,0,0,3\n",
    );
    let (report, code) = json(&["validate", tracks.to_str().expect("plain")]);
    assert_eq!(code, Some(0), "{report}");
    let checks = report["checks"].as_array().expect("checks");
    let of = |data: &str| checks.iter().filter(|check| check["data"] == data).count();
    assert_eq!(
        (of("flight-1, flight-3"), of("one.csv")),
        (6, 3),
        "{report}"
    );
    assert!(
        checks.iter().all(|check| check["holds"] == true),
        "{report}"
    );
    let said = report["not_judged"].to_string();
    assert!(
        said.contains("ground.csv") && said.contains("no free fall"),
        "{said}"
    );
    // What falls five times as fast gains speed faster than gravity allows, in feet too.
    let stone: String = jump(1)
        .lines()
        .map(|line| {
            let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
            for cell in [3, 6] {
                if let Ok(value) = cells[cell].parse::<f64>() {
                    cells[cell] = format!("{:.2}", 5.0 * value);
                }
            }
            cells.join(",") + "\n"
        })
        .collect();
    written(&tracks, "stone.csv", &stone);
    let output = bodyflight(&["validate", tracks.to_str().expect("plain"), "--json"]);
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    let report: Value = serde_json::from_str(&said).expect("JSON");
    let is_unexplained = output.status.code() == Some(4);
    let not_judged = report["not_judged"].to_string().contains("stone.csv");
    assert!(is_unexplained || not_judged, "{said}");
}

fn written(folder: &Path, name: &str, text: &str) -> String {
    let path = folder.join(name);
    std::fs::write(&path, text).expect("written");
    path.to_str().expect("plain").to_owned()
}

#[test]
fn a_fall_is_reported_as_it_was_flown() {
    let folder = tempfile::tempdir().expect("a folder");
    let track = written(folder.path(), "12-10-00.CSV", &jump(1));
    let plot = folder.path().join("fall.svg");
    let arguments = [
        "fall",
        &track,
        "--mass",
        "80",
        "--plot",
        plot.to_str().expect("plain"),
    ];
    let (report, code) = json(&arguments);
    assert_eq!(
        (code, &report["verdict"]),
        (Some(0), &Value::from("explained")),
        "{report}"
    );
    let near = |name: &str, value: &Value, expected: f64, most: f64| {
        let off = (number(value) - expected).abs();
        assert!(off < most, "{name}: {value}, expected {expected}");
    };
    near("exit", &report["exit"]["time_s"], 30.0, 0.5);
    near("opening", &report["opening"]["time_s"], 85.0, 1.0);
    near("drag area", &report["drag_area_m2"], 80.0 / 153.0, 0.015);
    near("ballistic", &report["ballistic_kgpm2"], 153.0, 4.0);
    assert_eq!(
        report["pieces"].as_array().map(Vec::len),
        Some(1),
        "{report}"
    );
    for wind in report["wind"].as_array().expect("layers") {
        let blows = [6.0 * number(&wind["height_m"]) / 4000.0, 3.0_f64];
        let from = number(&wind["from_rad"]);
        let speed = number(&wind["speed_mps"]);
        // Velocity of the air, north and west, opposite to the direction that the wind blows from.
        let found = [-speed * from.cos(), speed * from.sin()];
        let apart = (found[0] - blows[0]).hypot(found[1] - blows[1]);
        assert!(apart < 3.5 * number(&wind["deviation_mps"]) + 0.3, "{wind}");
    }
    assert!(number(&report["winds_apart"]) < 2.5, "{report}");
    let prediction = &report["prediction"];
    let ratio = number(&prediction["predicted_mps"]) / number(&prediction["measured_mps"]);
    assert!((ratio - 1.0).abs() < 0.03, "{prediction}");
    assert_eq!(prediction["outcome"], "held", "{prediction}");
    assert!(
        std::fs::read_to_string(plot)
            .expect("the plot")
            .starts_with("<svg")
    );
}

#[test]
fn a_track_may_be_compressed_or_piped_and_one_without_a_fall_is_refused() {
    let text = jump(2);
    let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    gzip.write_all(text.as_bytes()).expect("in memory");
    let mut xz = lzma_rust2::XzWriter::new(Vec::new(), lzma_rust2::XzOptions::with_preset(1))
        .expect("a preset");
    xz.write_all(text.as_bytes()).expect("in memory");
    for bytes in [
        text.clone().into_bytes(),
        gzip.finish().expect("in memory"),
        xz.finish().expect("in memory"),
    ] {
        let mut child = Command::new(env!("CARGO_BIN_EXE_bodyflight"))
            .args(["fall", "-", "--json"])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("the binary starts");
        let mut input = child.stdin.take().expect("a pipe");
        input.write_all(&bytes).expect("written");
        drop(input);
        let output = child.wait_with_output().expect("it ends");
        let report: Value = serde_json::from_slice(&output.stdout).expect("JSON");
        assert_eq!(report["verdict"], "explained", "{report}");
    }

    let folder = tempfile::tempdir().expect("a folder");
    let aircraft: String = text
        .lines()
        .take(140)
        .map(|line| format!("{line}\n"))
        .collect();
    let (message, code) = fails(&["fall", &written(folder.path(), "up.csv", &aircraft)]);
    assert_eq!(code, Some(2), "{message}");
    assert!(message.contains("no free fall on this track"), "{message}");
    let track = written(folder.path(), "fall.csv", &text);
    let (message, code) = fails(&["fall", &track, "--mass", "3"]);
    assert_eq!(code, Some(2));
    assert!(
        message.contains("--mass: expected 30 to 300, found 3"),
        "{message}"
    );
}

fn public_tracks() -> Option<PathBuf> {
    shared("data/flysight/skyderby")
}

/// Exit and opening (s) as read from the plots in docs/falls.md: when the vertical velocity departs from that of the
/// aircraft, and when the deployment begins to decelerate the fall.
const MARKED: [(&str, f64, f64); 3] = [
    ("_703_14-41-39.CSV", 515.6, 619.6),
    ("fs2-track.csv", 338.4, 461.2),
    ("speed_skydiving_411.csv", 30.6, 69.4),
];

#[test]
fn public_falls_are_divided_as_a_person_does_and_explained() {
    let Some(folder) = public_tracks() else {
        return;
    };
    let mut trials = [0.0; 3];
    for (name, exit, opening) in MARKED {
        let path = folder.join(name);
        let (report, code) = json(&["fall", path.to_str().expect("plain")]);
        assert_eq!(code, Some(0), "{name}: {report}");
        assert_eq!(report["verdict"], "explained", "{name}: {report}");
        for (moment, marked) in [("exit", exit), ("opening", opening)] {
            let off = (number(&report[moment]["time_s"]) - marked).abs();
            assert!(off < 1.0, "{name}, {moment}: {}", report[moment]);
        }
        // The speed skydiver brakes and the second wingsuit dives, which neither had done before.
        let prediction = &report["prediction"];
        let expected = if name.starts_with("_703") {
            "held"
        } else {
            "posture-changed"
        };
        assert_eq!(prediction["outcome"], expected, "{name}: {prediction}");
        // Such a change could not be predicted, but the error bar accounts for its probability: no prediction is both
        // confident and wrong.
        let named = |name: &str| number(&prediction[name]);
        let off = named("measured_mps") - named("predicted_mps");
        assert!(off.abs() < 2.0 * named("deviation_mps"), "{prediction}");
        let count = |name: &str| number(&prediction["trials"][name]);
        for (sum, name) in trials.iter_mut().zip(["made", "within_one", "within_two"]) {
            *sum += count(name);
        }
        let area = number(&report["drag_area_m2"]);
        assert!((0.08..0.9).contains(&area), "{name}: {area} m2");
    }
    // Of a normal distribution, 68 % lie within one standard deviation and 95 % within two.
    let [made, within_one, within_two] = trials;
    assert!(made > 50.0, "{trials:?}");
    assert!((0.6..0.9).contains(&(within_one / made)), "{trials:?}");
    assert!(within_two / made > 0.85, "{trials:?}");
}
