//! Movement patterns and the response to them, by the real binary: synthetic flights whose patterns are known.
#![expect(clippy::expect_used, reason = "tests may panic: that is how they fail")]

use std::path::Path;

use bodyflight_core::body::joint_angle::JointAngle;
use bodyflight_replay::flight::Flight;
use bodyflight_tests::program::{Program, plain};
use bodyflight_verbs::technique::against::TURN;
use bodyflight_verbs::technique::linear::Linear;
use bodyflight_verbs::technique::response::response;
use nalgebra::DVector;
use serde_json::Value;

const PROGRAM: Program = Program(env!("CARGO_BIN_EXE_bodyflight"));

/// The pattern of the maneuver `rotations`: one arm up, the other down.
const TURN_PATTERN: [(&str, f64); 2] = [("l_upperarm.phi", 1.0), ("r_upperarm.phi", -1.0)];

fn known() -> DVector<f64> {
    let weight = |name: String| {
        let own = TURN_PATTERN.iter().find(|(angle, _)| *angle == name);
        own.map_or(0.0, |(_, weight)| *weight)
    };
    let weights = JointAngle::all().map(|axis| weight(axis.to_string()));
    DVector::from_vec(weights.collect()).normalize()
}

fn found(pattern: &Value) -> DVector<f64> {
    let all = pattern["weights"].as_array().expect("weights");
    let weight = |name: String| {
        let own = all.iter().find(|weight| weight["angle"] == name);
        own.and_then(|own| own["weight"].as_f64())
            .expect("a weight")
    };
    DVector::from_vec(
        JointAngle::all()
            .map(|axis| weight(axis.to_string()))
            .collect(),
    )
}

fn flown(folder: &Path, name: &str, options: &[&str]) -> String {
    let out = plain(&folder.join(name)).to_owned();
    PROGRAM.json(&[&["synth", "rotations", "--out", &out], options].concat());
    out
}

#[test]
fn the_pattern_of_a_turn_and_its_transfer_function_are_recovered() {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, options, cosine, tolerance) in [
        ("exact", vec!["--noise", "0"], 0.998, 0.05),
        (
            "wrong",
            vec!["--seed", "2", "--joint-error-deg", "2"],
            0.99,
            0.05,
        ),
        (
            "wander",
            vec!["--seed", "3", "--joint-wander-deg", "1"],
            0.99,
            0.05,
        ),
    ] {
        let flight = flown(folder.path(), name, &options);
        let report = PROGRAM.json(&["technique", &flight, "--against", &flight]);
        agrees(&report);
        let pattern = &report["patterns"][0];
        assert_eq!(pattern["state"], "named", "{name}");
        let weights = found(pattern);
        let alike = weights.dot(&known());
        // The exact response is that of the known pattern on the same body.
        let read = Flight::read(Path::new(&flight)).expect("a flight");
        let dynamics = read.dynamics(0.0);
        let linear = Linear::of(
            &dynamics,
            &read.constant_inputs(),
            &JointAngle::all().collect::<Vec<_>>(),
        )
        .expect("a steady fall");
        let exact = response(&linear.of_pattern(&known()), TURN, &[]);
        let bode = pattern["answer"]["responses"][TURN]["bode"]
            .as_array()
            .expect("points");
        let within = |highest: f64| {
            let pairs = bode.iter().zip(&exact.bode);
            let used = pairs.filter(|(_, exact)| exact.frequency_hz < highest);
            let apart = used.map(|(point, exact)| {
                let gain = point["gain"].as_f64().expect("a gain");
                (gain / exact.gain - 1.0).abs()
            });
            apart.fold(0.0, f64::max)
        };
        let (slow, fast) = (within(0.5), within(2.001));
        println!("{name}: cosine {alike:.4}, gain within {slow:.3} to 0.5 Hz, {fast:.3} to 2 Hz");
        for (point, exact) in bode.iter().zip(&exact.bode) {
            let number = |key: &str| point[key].as_f64().expect("a number");
            let apart = (number("gain") - exact.gain).abs();
            assert!(apart < 3.0 * number("gain_deviation"), "{name}: {point}");
        }
        assert!(alike.abs() > cosine, "{name}: {alike}");
        assert!(slow < tolerance, "{name}: {slow}");
        assert!(fast < tolerance, "{name}: {fast}");
        // The recorded turn is that of the linear response: same model.
        let correlation = report["recorded"]["correlation"]
            .as_f64()
            .expect("a number");
        assert!(correlation > 0.8, "{name}: {correlation}");
        // Errors of the joints lessen the slope; what is said of exact joints is not lessened.
        let slope = report["recorded"]["slope_of_exact_joints"]
            .as_f64()
            .expect("a number");
        assert!((slope - 1.02).abs() < 0.04, "{name}: {slope}");
    }
}

/// The linear response is that of the full simulation at small amplitudes, and a technique costs nothing against itself.
fn agrees(report: &Value) {
    let all = report["patterns"][0]["answer"]["agreement"]
        .as_array()
        .expect("inputs");
    assert_eq!(all.len(), 5);
    for input in all {
        let error = input["error_at_smallest"].as_f64().expect("a number");
        assert!(error < 0.02, "{input}");
        assert!(
            input["valid_to_rad"].as_f64().expect("a range") > 0.5,
            "{input}"
        );
    }
    let against = &report["against"];
    assert!((against["alike"].as_f64().expect("a cosine") - 1.0).abs() < 1e-9);
    assert_eq!(against["own"], against["other"]);
    let turned = against["own_turn"]["turned_rad"]
        .as_f64()
        .expect("an angle");
    assert!(turned > 0.5, "{against}");
}

#[test]
fn the_patterns_of_a_recording_that_contradicts_itself_are_doubted() {
    let Some(cases) = bodyflight_shared_data::shared("cases/recordings") else {
        return;
    };
    let output = PROGRAM.run(&["technique", plain(&cases.join("bad-frozen.mvnx.xz"))]);
    assert_eq!(output.status.code(), Some(5));
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(
        said.contains("r_forearm keeps exactly the same attitude"),
        "{said}"
    );
}

#[test]
fn a_somersault_is_not_given_the_response_of_a_fall_without_a_word() {
    let data =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../verbs/data/acrobatics/flight-1.mvnx.gz");
    let output = PROGRAM.run(&["technique", plain(&data)]);
    assert_eq!(output.status.code(), Some(5));
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(said.contains("not of this maneuver"), "{said}");
}
