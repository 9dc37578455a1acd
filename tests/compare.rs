//! Comparing recordings, by the real binary: alignment, differences of joints, and their effects, against flights whose
//! differences are known.
#![expect(clippy::expect_used, reason = "tests may panic: that is how they fail")]

#[path = "compare/planted.rs"]
mod planted;

use std::f64::consts::TAU;
use std::path::Path;

use bodyflight_core::observation::Observation;
use bodyflight_mvnx::recording::{FlightFrame, Options};
use bodyflight_replay::flight::Flight;
use bodyflight_shared_data::shared;
use bodyflight_tests::program::{Program, plain, text};
use planted::{Clean, Suit, at, clean, recorded};
use serde_json::Value;

const PROGRAM: Program = Program(env!("CARGO_BIN_EXE_bodyflight"));

fn number(value: &Value, pointer: &str) -> f64 {
    value
        .pointer(pointer)
        .and_then(Value::as_f64)
        .expect(pointer)
}

/// Mean turn rate between two times (rad/s).
fn turn(frames: &[FlightFrame], from: f64, to: f64) -> f64 {
    let inside = frames
        .iter()
        .filter(|frame| (from..=to).contains(&frame.time));
    let rates: Vec<f64> = inside
        .map(|frame| Observation::of(&frame.motion().expect("a motion")).yaw_rate)
        .collect();
    rates.iter().sum::<f64>() / rates.len() as f64
}

#[test]
fn shifts_between_suits_of_other_rates_and_errors_are_found() {
    let folder = tempfile::tempdir().expect("a folder");
    let clean = clean(PROGRAM, folder.path(), "aggressive-turns");
    let whole = |name: &str, suit: Suit, shift: f64| {
        recorded(&clean, name, &clean.frames, suit, |time| time + shift)
    };
    let suit = |rate: f64, joint_deg: f64, noise: f64, seed: u64| Suit {
        rate,
        joint_deg,
        noise,
        seed,
    };
    let a = whole("a", suit(240.0, 2.0, 1.0, 1), 0.0);
    for (n, (rate, joint_deg, noise, shift)) in [
        (60.0, 0.0, 0.0, 0.4),
        (100.0, 2.0, 1.0, 1.3),
        (120.0, 3.0, 2.0, 0.9),
        (240.0, 2.0, 0.5, 2.0),
    ]
    .into_iter()
    .enumerate()
    {
        let b = whole(
            &format!("b{n}"),
            suit(rate, joint_deg, noise, 10 + n as u64),
            shift,
        );
        let report = PROGRAM.json(&["compare", &a, &b]);
        let alignment = &report["pairs"][0]["alignment"];
        assert_eq!(alignment["on"], "turn");
        let found = number(alignment, "/a_s") - number(alignment, "/b_s");
        let bar = number(alignment, "/deviation_s");
        assert!(
            (found - shift).abs() < 0.02 + 3.0 * bar,
            "{found}, {shift}, {bar}"
        );
        assert!(bar < 0.1, "{bar}");
        // The same flight with other errors: nothing is to be named.
        assert_eq!(report["pairs"][0]["differences"], serde_json::json!([]));
        assert!(number(alignment, "/similarity") > 0.95, "{alignment}");
    }
}

#[test]
fn a_known_warp_of_time_is_found() {
    let folder = tempfile::tempdir().expect("a folder");
    let clean = clean(PROGRAM, folder.path(), "rotations");
    let suit = |rate: f64, seed: u64| Suit {
        rate,
        joint_deg: 2.0,
        noise: 1.0,
        seed,
    };
    let a = recorded(&clean, "a", &clean.frames, suit(120.0, 1), |time| time);
    for (n, stretch) in [0.8, -0.8].into_iter().enumerate() {
        let source = |time: f64| 1.0 + time + stretch * (TAU * time / 20.0).sin();
        let name = format!("b{n}");
        let b = recorded(
            &clean,
            &name,
            &clean.frames,
            suit(90.0, 2 + n as u64),
            source,
        );
        let out = format!("{b}.csv");
        let report = PROGRAM.json(&["compare", &a, &b, "--align", "warp", "--out", &out]);
        assert_eq!(report["pairs"][0]["differences"], serde_json::json!([]));
        let table = std::fs::read_to_string(&out).expect("a table");
        let mut rows = table.lines();
        assert!(
            rows.next()
                .expect("names")
                .starts_with("time_s,a_time_s,b_time_s,a_roll_rad")
        );
        // While nothing moves, any time belongs to any other: judged is where the body turns.
        let (mut squares, mut count, mut worst) = (0.0, 0.0, 0.0_f64);
        for row in rows {
            let cells: Vec<f64> = row
                .split(',')
                .map(|cell| cell.parse().expect("a number"))
                .collect();
            let (a_time, b_time) = (cells[1], cells[2]);
            let moving = at(&clean.frames, a_time.min(29.8), 1.0);
            let before = at(&clean.frames, (a_time - 0.2).max(0.0), 1.0);
            let rate =
                |frame: &FlightFrame| Observation::of(&frame.motion().expect("a motion")).yaw_rate;
            if (rate(&moving) - rate(&before)).abs() < 0.1 {
                continue;
            }
            let error = source(b_time) - a_time;
            squares += error * error;
            count += 1.0;
            worst = worst.max(error.abs());
        }
        let rms = f64::sqrt(squares / count);
        println!("warp {stretch}: RMS {rms:.3} s, largest {worst:.3} s over {count} rows");
        assert!(
            count > 200.0 && rms < 0.1 && worst < 0.4,
            "{rms}, {worst}, {count}"
        );
    }
}

#[test]
fn planted_differences_are_named_with_joint_sign_size_and_effect() {
    let folder = tempfile::tempdir().expect("a folder");
    let clean = clean(PROGRAM, folder.path(), "neutral-fall");
    let suit = |seed: u64| Suit {
        rate: 120.0,
        joint_deg: 1.5,
        noise: 1.0,
        seed,
    };
    let own = clean.changed(&[], 8.0);
    for (n, (joint, degrees)) in [
        ("l_shank.bend", -25.0),
        ("r_shank.bend", 30.0),
        ("r_thigh.phi", 22.0),
        ("l_upperarm.phi", -30.0),
    ]
    .into_iter()
    .enumerate()
    {
        let change = format!("{joint}={degrees:+}@3.0..7.0");
        let flown = clean.changed(&[&change], 8.0);
        let seed = 100 + 2 * n as u64;
        let a = recorded(&clean, &format!("a{n}"), &own, suit(seed), |time| time);
        let b = recorded(&clean, &format!("b{n}"), &flown, suit(seed + 1), |time| {
            time
        });
        let (report, _) = PROGRAM.answer(&["compare", &a, &b, "--align", "start"]);
        let differences = report["pairs"][0]["differences"]
            .as_array()
            .expect("a list");
        assert_eq!(differences.len(), 1, "{joint}: {differences:#?}");
        let told = &differences[0];
        assert_eq!(told["joint"], joint);
        let from = number(told, "/time_s/0");
        assert!((3.0..3.3).contains(&from), "{joint} from {from}");
        let by = number(told, "/difference_rad").to_degrees();
        let bar = number(told, "/deviation_rad").to_degrees();
        assert!(
            (by - degrees).abs() < 3.0 * bar && bar < 7.0,
            "{joint}: {by} +- {bar}"
        );
        // By the model, which flew both, the effect is what the flights differ by.
        let truth = turn(&flown, from, from + 2.0) - turn(&own, from, from + 2.0);
        let effect = number(told, "/effect/turn_radps");
        let bar = number(told, "/effect_deviation/turn_radps");
        println!(
            "{joint} {degrees}: turn {effect:.3} +- {bar:.3} rad/s, true {truth:.3}: {}",
            told["words"]
        );
        assert!(
            (effect - truth).abs() < 3.0 * bar,
            "{joint}: {effect} +- {bar}, true {truth}"
        );
        let words = told["words"].as_str().expect("words");
        let more = if degrees > 0.0 {
            "degrees more from"
        } else {
            "degrees less from"
        };
        assert!(words.contains(joint) && words.contains(more), "{words}");
        if told["trust"] == "sound" {
            assert!(
                effect.abs() > 2.0 * bar || !words.contains("turn"),
                "{words}"
            );
        }
    }
}

#[test]
fn flights_that_cannot_be_aligned_are_refused_with_what_to_do() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = |name: &str| plain(&folder.path().join(name)).to_owned();
    let (turns, fall, layouts) = (out("turns"), out("fall"), out("layouts"));
    for (maneuver, out) in [
        ("rotations", &turns),
        ("neutral-fall", &fall),
        ("layouts", &layouts),
    ] {
        PROGRAM.json(&["synth", maneuver, "--out", out]);
    }
    for (arguments, parts) in [
        (
            vec![&*turns, &*fall, "--align", "turn"],
            ["start of a turn", "fall has none"],
        ),
        (
            vec![&*turns, &*fall, "--align", "exit"],
            ["exit", "turns and fall"],
        ),
        (
            vec![&*turns, &*layouts, "--align", "warp"],
            ["differ too much", "similarity"],
        ),
        (
            vec![&*turns, &*fall, "--from", "29.9"],
            ["overlap", "--from"],
        ),
    ] {
        let said = PROGRAM.fails(&[&["compare"], &arguments[..]].concat(), 4);
        assert!(parts.iter().all(|part| said.contains(part)), "{said}");
    }
    let said = PROGRAM.fails(&["compare", &turns, &fall, "--align", "time=1"], 2);
    assert!(said.contains("time=2.1,3.4"), "{said}");
    let said = PROGRAM.fails(
        &[
            "compare", &turns, &fall, "--align", "start", "--plot", "x.jpg",
        ],
        2,
    );
    assert!(said.contains(".svg, .pdf or .png"), "{said}");
}

#[test]
fn text_figure_and_table_of_several_flights_are_written() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = |name: &str| plain(&folder.path().join(name)).to_owned();
    let names = ["one", "two", "three"].map(out);
    for (seed, name) in ["1", "2", "3"].into_iter().zip(&names) {
        PROGRAM.json(&["synth", "rotations", "--seed", seed, "--out", name]);
    }
    let [one, two, three] = &names;
    let (table, plot) = (out("{}.csv"), out("{}.svg"));
    let arguments = ["compare", one, two, three, "--out", &table, "--plot", &plot];
    let output = PROGRAM.run(&arguments);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let said = text(&output.stdout);
    assert!(
        said.lines()
            .all(|line| line.chars().count() <= 80 || line.starts_with("written")),
        "{said}"
    );
    assert_eq!(
        said.matches("Aligned on the start of the turn").count(),
        2,
        "{said}"
    );
    for name in ["two", "three"] {
        let drawing = std::fs::read_to_string(out(&format!("{name}.svg"))).expect("a drawing");
        assert!(drawing.matches("<ellipse").count() == 5 * 2 * 2 * 16 && drawing.contains(name));
        assert!(
            std::fs::read_to_string(out(&format!("{name}.csv")))
                .expect("a table")
                .lines()
                .count()
                > 1000
        );
    }
    let said = PROGRAM.fails(&["compare", one, two, three, "--out", &out("one.csv")], 2);
    assert!(said.contains("{}"), "{said}");
}

/// Flights of an independent simulator: between a recording and the same with other errors of joints and sensors nothing
/// is named, and effects of other movements are told as sound only where the model misses both flights by less.
#[test]
fn flights_of_an_independent_simulator_are_compared_honestly() {
    let Some(flights) = shared("flights") else {
        return;
    };
    let folder = tempfile::tempdir().expect("a folder");
    let name = "none-slow-101";
    for part in ["flight-0", "flight-1"] {
        let (from, to) = (flights.join(name).join(part), folder.path().join(part));
        std::fs::create_dir_all(&to).expect("a folder");
        for file in [
            "flight.toml",
            "subject.toml",
            "segments.json",
            "flight.mvnx.xz",
        ] {
            std::fs::copy(from.join(file), to.join(file)).expect("copied");
        }
        let packed = to.join("flight.mvnx.xz");
        let unpacked = std::process::Command::new("xz")
            .arg("--decompress")
            .arg(packed)
            .status();
        if !unpacked.is_ok_and(|status| status.success()) {
            bodyflight_shared_data::skipped("xz");
            return;
        }
    }
    let path = |part: &str| plain(&folder.path().join(part)).to_owned();
    let said = PROGRAM.fails(&["compare", &path("flight-0"), &path("flight-1")], 4);
    assert!(said.contains("cannot align"), "{said}");
    let flight = Flight::read(Path::new(&path("flight-0"))).expect("a flight");
    let frames = flight.open(Options::default()).expect("a recording");
    let original = Clean {
        folder: path("flight-0"),
        frames: frames.map(|frame| frame.expect("a frame")).collect(),
        flight,
    };
    let suit = Suit {
        rate: 100.0,
        joint_deg: 2.0,
        noise: 1.0,
        seed: 5,
    };
    let again = recorded(&original, "again", &original.frames, suit, |time| {
        time + 0.7
    });
    let [from, to] =
        [&original.folder, &again].map(|folder| Path::new(folder).join("segments.json"));
    std::fs::copy(from, to).expect("copied");
    let report = PROGRAM.json(&["compare", &original.folder, &again, "--align", "warp"]);
    assert_eq!(
        report["pairs"][0]["differences"],
        serde_json::json!([]),
        "{report}"
    );
    let found =
        number(&report, "/pairs/0/alignment/a_s") - number(&report, "/pairs/0/alignment/b_s");
    assert!((found - 0.7).abs() < 0.1, "{found}");
    // Told effects exceed what the model misses the flights by.
    let arguments = [
        "compare",
        &path("flight-0"),
        &path("flight-1"),
        "--align",
        "start",
    ];
    let (report, _) = PROGRAM.answer(&arguments);
    let differences = report["pairs"][0]["differences"]
        .as_array()
        .expect("a list");
    let sound: Vec<&Value> = differences
        .iter()
        .filter(|told| told["trust"] == "sound")
        .collect();
    assert!(!sound.is_empty(), "{differences:#?}");
    for told in sound {
        let parts = ["turn_radps", "fall_mps", "drift_mps", "pitch_rad"];
        let stands = parts.iter().any(|part| {
            let effect = number(told, &format!("/effect/{part}")).abs();
            let gaps = [0, 1].map(|side| number(told, &format!("/model_gap/{side}/{part}")).abs());
            effect > 2.0 * number(told, &format!("/effect_deviation/{part}"))
                && gaps.iter().all(|gap| *gap < effect)
        });
        assert!(stands, "{told:#?}");
    }
}
