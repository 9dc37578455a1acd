//! The known flight as quaternions of sensors that lie anyhow on their segments.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

use bodyflight_core::{Posture, Segment, SegmentArray};
use bodyflight_mvnx::xsens;
use bodyflight_tests::opensense_name;
use bodyflight_tests::program::{plain, text, written};
use nalgebra::{UnitQuaternion, Vector3};

use crate::known::{PROGRAM, RETURNS, frames, known, turned};

/// The known flight after a still frame in the H-pose, as quaternions of sensors that lie anyhow on their segments. The
/// z axis of that on the pelvis points forwards in the still frame.
fn sensors() -> Vec<SegmentArray<UnitQuaternion<f64>>> {
    let still = Posture::h_pose().body_from_segments();
    let facing = *xsens::facing_forward().quaternion();
    let mounted = SegmentArray::from_fn(|segment| match segment {
        Segment::Pelvis => {
            UnitQuaternion::rotation_between(&Vector3::z(), &-Vector3::y()).expect("not opposite")
        }
        _ => UnitQuaternion::from_scaled_axis(Vector3::new(0.4, segment as usize as f64, -0.9)),
    });
    let first = still.map(|_, turned| facing * turned);
    let all = core::iter::once(first).chain(known().into_iter().map(|frame| turned(&frame)));
    all.map(|frame| frame.map(|segment, turned| turned * mounted[segment]))
        .collect()
}

/// Checks the postures of an import of [`sensors`]; they have no positions.
fn same_postures(folder: &Path) {
    let came = frames(&folder.join("out/flight.mvnx"));
    let went = known();
    assert_eq!(came.len(), went.len() + 1);
    for (came, went) in came.iter().skip(1).zip(&went) {
        let (a, b) = (turned(came), turned(went));
        for segment in Segment::ALL {
            let angle = a[segment].angle_to(&b[segment]).to_degrees();
            assert!(angle < RETURNS, "{segment:?}: {angle}");
        }
    }
}

#[test]
fn postures_survive_opensense() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = plain(&folder.path().join("out")).to_owned();
    let flight = sensors();
    let mut sto =
        "DataRate=200.000000\nDataType=Quaternion\nversion=3\nOpenSimVersion=4.4\nendheader\ntime"
            .to_owned();
    for segment in Segment::ALL {
        let _ = write!(sto, "\t{}", opensense_name(segment.name()));
    }
    for (k, frame) in flight.iter().enumerate() {
        let _ = write!(sto, "\n{:.3}", k as f64 / 200.0);
        for q in frame.values() {
            let _ = write!(sto, "\t{:.8},{:.8},{:.8},{:.8}", q.w, q.i, q.j, q.k);
        }
    }
    let file = written(folder.path(), "walking_orientations.sto", &sto);
    let output = PROGRAM.run(&["import", &file, "--out", &out]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert!(
        text(&output.stdout).contains("OpenSense"),
        "{}",
        text(&output.stdout)
    );
    // OpenSense has no sensor on the abdomen, so it is halfway between its neighbours.
    let came = frames(&folder.path().join("out/flight.mvnx"));
    for (came, went) in came.iter().skip(1).zip(&known()) {
        let (a, b) = (turned(came), turned(went));
        for segment in Segment::ALL
            .into_iter()
            .filter(|segment| *segment != Segment::Abdomen)
        {
            assert!(
                a[segment].angle_to(&b[segment]).to_degrees() < RETURNS,
                "{segment:?}"
            );
        }
    }
    // Without positions nothing is known to be in the air; the still frame is a jump of its own.
    let (report, code) = PROGRAM.answer(&["airborne", &file]);
    assert_eq!(
        report["phases"].as_array().map(Vec::len),
        Some(0),
        "{report}"
    );
    assert!([Some(4), Some(5)].contains(&code), "{report}");
}

#[test]
fn postures_survive_folders_of_sensors() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = plain(&folder.path().join("out")).to_owned();
    let flight = sensors();
    let mut map = "kind = \"quaternions\"\n[world]\naxes = [\"north\", \"west\", \"up\"]\n[body]\naxes = [\"forward\", \"left\", \"up\"]\n\
        rest = \"h-pose\"\n[time]\ncolumn = \"Time\"\n[quaternions]\nmounting = \"first-row\"\nforward = \"z\"\n"
        .to_owned();
    for form in ["dot", "mt"] {
        let part = folder.path().join(form);
        std::fs::create_dir(&part).expect("a folder");
        for segment in Segment::ALL {
            let tag = format!("D422CD{:02X}", segment as usize);
            if form == "dot" {
                let _ = write!(
                    map,
                    "[segments.{}]\ncolumns = [\"{tag}\"]\n",
                    segment.name()
                );
            }
            let mut file = match form {
                "dot" => format!("sep=,\nDeviceTag:,{tag}\nFirmwareVersion:,2.0.0\nPacketCounter,SampleTimeFine,Quat_W,Quat_X,Quat_Y,Quat_Z,Status,\n"),
                _ => "// Start Time: Unknown\n// Update Rate: 200.0Hz\n// Filter Profile: human (46.1)\nPacketCounter\tSampleTimeFine\tMat[1][1]\tMat[2][1]\tMat[3][1]\tMat[1][2]\tMat[2][2]\tMat[3][2]\tMat[1][3]\tMat[2][3]\tMat[3][3]\n".to_owned(),
            };
            for (k, frame) in flight.iter().enumerate() {
                // A radio lost some packets of one sensor.
                if segment == Segment::LeftHand && (50..55).contains(&k) && form == "dot" {
                    continue;
                }
                let q = frame[segment];
                let _ = if form == "dot" {
                    let ticks = (4_294_000_000_u64 + 5000 * k as u64) % (1 << 32);
                    writeln!(
                        file,
                        "{},{ticks},{:.7},{:.7},{:.7},{:.7},0,",
                        k + segment as usize,
                        q.w,
                        q.i,
                        q.j,
                        q.k
                    )
                } else {
                    let matrix = q.to_rotation_matrix();
                    let cells: Vec<String> = matrix
                        .matrix()
                        .iter()
                        .map(|cell| format!("{cell:.6}"))
                        .collect();
                    writeln!(file, "{:05}\t\t{}", (65_500 + k) % 65_536, cells.join("\t"))
                };
            }
            let name = match form {
                "dot" => format!("jump_{tag}_20240501.csv"),
                _ => format!("MT_0120_000-000_{tag}.txt"),
            };
            written(&part, &name, &file);
        }
        let map = written(folder.path(), "sensors.toml", &map);
        let output = PROGRAM.run(&[
            "import",
            plain(&part),
            "--mapping",
            &map,
            "--out",
            &out,
            "--force",
        ]);
        let said = text(&output.stdout);
        assert!(output.status.success(), "{}", text(&output.stderr));
        assert!(said.contains("200 Hz"), "{said}");
        if form == "dot" {
            assert!(
                said.contains("D422CD06 lacks 5 of") && said.contains("5 rows skipped"),
                "{said}"
            );
            assert_eq!(
                frames(&folder.path().join("out/flight.mvnx")).len(),
                known().len() - 4
            );
        } else {
            same_postures(folder.path());
        }
        let said = PROGRAM.fails(&["import", plain(&part), "--out", &out, "--force"], 2);
        assert!(
            said.contains("a folder of sensors") && said.contains("--mapping"),
            "{said}"
        );
    }
}

/// The rows of a table by the names of its columns; what is no number is left out.
fn table(path: &str) -> Vec<BTreeMap<String, f64>> {
    let text = std::fs::read_to_string(path).expect("a table");
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().expect("names").split(',').collect();
    let row = |line: &str| {
        let cells = names.iter().zip(line.split(','));
        let numbers =
            cells.filter_map(|(name, cell)| Some(((*name).to_owned(), cell.parse().ok()?)));
        numbers.collect()
    };
    lines.map(row).collect()
}

/// Share of the estimates whose muscle input is within twice its deviation of the one that was flown: pitch, yaw, roll.
fn within_bars(found: &[BTreeMap<String, f64>], flown: &[BTreeMap<String, f64>]) -> [f64; 3] {
    ["pitch", "yaw", "roll"].map(|axis| {
        let deviation = format!("sd_{axis}");
        let is_held = |row: &&BTreeMap<String, f64>| {
            let after = flown.partition_point(|flown| flown["time_s"] <= row["time_s"]);
            let truth = flown[after.saturating_sub(1)][axis];
            (row[axis] - truth).abs() <= 2.0 * row[deviation.as_str()]
        };
        found.iter().filter(is_held).count() as f64 / found.len() as f64
    })
}

/// Without a receiver the estimate is doubtful and says why; its bars hold inputs and velocity all the same.
fn without_a_receiver(folder: &Path, sensors: &str, mapping: &str, subject: &str) {
    let text = std::fs::read_to_string(mapping).expect("a mapping");
    let lines = text.lines().filter(|line| !line.starts_with("gnss"));
    let text: String = lines.map(|line| format!("{line}\n")).collect();
    let mapping = written(folder, "alone.toml", &text);
    let (out, found) = (folder.join("alone"), folder.join("alone.csv"));
    let (out, found) = (plain(&out), plain(&found));
    PROGRAM.json(&[
        "import",
        sensors,
        "--mapping",
        &mapping,
        "--subject",
        subject,
        "--out",
        out,
    ]);
    let (report, code) = PROGRAM.answer(&["estimate", out, "--out", found]);
    assert_eq!(code, Some(5), "{report}");
    let doubt = report["doubt"].as_str().unwrap_or_default();
    assert!(doubt.contains("the recording has no velocity"), "{doubt}");
    assert!(report["rms"]["vertical_velocity_mps"].is_null(), "{report}");
    assert!(report["rms"]["roll_rad"].as_f64() < Some(0.02), "{report}");
    let deviation = report["assumed_velocity_sd_mps"].as_f64().expect("m/s");
    assert!((0.5..6.0).contains(&deviation), "{deviation}");
    let found = table(found);
    let flown = table(plain(&folder.join("jump/inputs.csv")));
    let held = within_bars(&found, &flown);
    assert!(held.iter().all(|share| *share > 0.9), "{held:?}");
    let truth = frames(&folder.join("jump/flight.mvnx"));
    for axis in ["north", "west", "up"] {
        let is_held = |row: &&BTreeMap<String, f64>| {
            let of = |name: &str| row[&format!("{name}_{axis}_mps")];
            let after = truth.partition_point(|frame| frame.time <= row["time_s"] + 1e-6);
            let velocity = truth[after.saturating_sub(1)].pelvis.velocity;
            let velocity = velocity.expect("a velocity").components;
            let truth = velocity[["north", "west", "up"]
                .iter()
                .position(|a| *a == axis)
                .expect("one")];
            (of("velocity") - truth).abs() <= 2.0 * of("sd_velocity")
        };
        let share = found.iter().filter(is_held).count() as f64 / found.len() as f64;
        assert!(share > 0.9, "{axis}: {share}");
    }
}

/// Raw sensors of a simulated jump give its postures back; the estimate is consistent with their errors, and its bars hold the
/// inputs that were flown, also during flips.
#[test]
fn raw_sensors_of_a_jump_are_imported_and_estimated() {
    let folder = tempfile::tempdir().expect("a folder");
    let jump = plain(&folder.path().join("jump")).to_owned();
    let out = plain(&folder.path().join("out")).to_owned();
    PROGRAM.json(&[
        "synth",
        "layouts",
        "--sensors",
        "10",
        "--seed",
        "3",
        "--out",
        &jump,
    ]);
    let sensors = format!("{jump}/sensors");
    let mapping = format!("{sensors}/mapping.toml");
    let subject = format!("{jump}/subject.toml");
    let report = PROGRAM.json(&[
        "import",
        &sensors,
        "--mapping",
        &mapping,
        "--subject",
        &subject,
        "--out",
        &out,
    ]);
    assert_eq!(
        report["doubts"].as_array().map(Vec::len),
        Some(0),
        "{report}"
    );
    let segments = report["segments"].as_array().expect("segments");
    let stated = |name: &str| {
        let found = segments.iter().find(|segment| segment["segment"] == name);
        found.expect("a segment")["deviation_deg"]
            .as_f64()
            .expect("degrees")
    };
    assert!(stated("l_thigh") < 12.0 && stated("l_foot") > stated("l_shank"));
    let (came, went) = (
        frames(&folder.path().join("out/flight.mvnx")),
        frames(&folder.path().join("jump/flight.mvnx")),
    );
    let mut squares = Vec::new();
    for (came, went) in came.iter().step_by(10).zip(went.iter().step_by(20)) {
        let (came, went) = (turned(came), turned(went));
        let thigh = |all: &SegmentArray<UnitQuaternion<f64>>| {
            all[Segment::Pelvis].inverse() * all[Segment::LeftThigh]
        };
        squares.push(thigh(&came).angle_to(&thigh(&went)).to_degrees().powi(2));
    }
    let off = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
    assert!(off < 2.5 * 3.0_f64.sqrt() * stated("l_thigh"), "{off}");
    let found = plain(&folder.path().join("found.csv")).to_owned();
    let estimate = PROGRAM.json(&["estimate", &out, "--out", &found]);
    let share = estimate["consistency"]["consistent"]
        .as_f64()
        .unwrap_or(0.0);
    assert!(share > 0.9, "{estimate}");
    let held = within_bars(&table(&found), &table(&format!("{jump}/inputs.csv")));
    assert!(held.iter().all(|share| *share > 0.9), "{held:?}");
    without_a_receiver(folder.path(), &sensors, &mapping, &subject);
    // Whoever exchanges two files is told so, and little is believed of these segments.
    let text = std::fs::read_to_string(&mapping).expect("a mapping");
    let text = text
        .replace("\"l_thigh.csv\"", "\"other.csv\"")
        .replace("\"l_shank.csv\"", "\"l_thigh.csv\"")
        .replace("\"other.csv\"", "\"l_shank.csv\"");
    let exchanged = written(
        folder.path(),
        "exchanged.toml",
        &text.replace("TRACK.CSV", "jump/sensors/TRACK.CSV"),
    );
    let doubted = plain(&folder.path().join("doubted")).to_owned();
    let import = [
        "import",
        &sensors,
        "--mapping",
        &exchanged,
        "--subject",
        &subject,
    ];
    let output = PROGRAM.run(&[&import[..], &["--out", &doubted]].concat());
    let said = format!(
        "{}{}",
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr)
    );
    assert_eq!(output.status.code(), Some(5), "{said}");
    assert!(said.contains("l_thigh and l_shank are exchanged"), "{said}");
    let flight = std::fs::read_to_string(folder.path().join("doubted/flight.toml"));
    assert!(flight.expect("a flight").contains("l_shank = 40.1"));
}
