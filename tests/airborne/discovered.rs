//! Faults planted in real somersaults: what `discover` names, and with which size.

use bodyflight_core::Segment;
use bodyflight_mvnx::recording::FlightFrame;
use bodyflight_mvnx::xsens::xsens_from_segment;

use crate::PROGRAM;
use crate::faults::{planted, somersaults, turned};

/// Number of frames by which postures are late: 25 ms at 200 Hz.
const LATE: usize = 5;

/// Both somersaults after a change, as the arguments of a search in which the second confirms the first.
fn flights(
    folder: &std::path::Path,
    rate: f64,
    keeps_places: bool,
    change: impl Fn(&[FlightFrame], usize) -> FlightFrame,
) -> [String; 2] {
    let mut captures = somersaults().into_iter();
    ["first", "second"].map(|name| {
        let capture = captures.next().expect("a somersault");
        let folder = folder.join(name);
        std::fs::create_dir_all(&folder).expect("a folder");
        let frames = &capture.frames;
        planted(&folder, &capture, rate, keeps_places, |frame, _| {
            let place = frames.iter().position(|other| other.index == frame.index);
            change(frames, place.expect("a frame of the capture"))
        })
    })
}

#[test]
fn somersaults_are_clean_and_late_postures_are_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let search = |name: &str, change: fn(&[FlightFrame], usize) -> FlightFrame| {
        let [first, second] = flights(&folder.path().join(name), 1.0, false, change);
        PROGRAM.json(&["discover", &first, "--hold-out", &second])
    };
    let clean = search("clean", |frames, place| frames[place]);
    assert_eq!(clean["verdict"], "thin", "{clean}");
    assert_eq!(clean["effects"].as_array().map(Vec::len), Some(0));
    let said = clean["warnings"].to_string();
    assert!(said.contains("vertical is tilted by 1."), "{said}");
    assert!(!said.contains("gyroscope"), "{said}");
    assert!(!said.contains("postures are"), "{said}");

    let late = search("late", |frames, place| FlightFrame {
        posture: frames[place.saturating_sub(LATE)].posture,
        ..frames[place]
    });
    let named = &late["effects"][0];
    assert_eq!(named["name"], "posture-delay", "{late}");
    let delay = named["parameters"]["delay_s"].as_f64().expect("a number");
    assert!((delay - 0.025).abs() < 0.004, "{delay}");
    let said = late["warnings"].to_string();
    assert!(said.contains("the postures are late by 27."), "{said}");
    assert!(!said.contains("the angular momentum changes"), "{said}");
}

#[test]
fn what_no_effect_explains_is_named_before_the_search() {
    let folder = tempfile::tempdir().expect("a folder");
    let fails = |name: &str,
                 rate: f64,
                 keeps_places: bool,
                 change: fn(&[FlightFrame], usize) -> FlightFrame| {
        let [first, second] = flights(&folder.path().join(name), rate, keeps_places, change);
        let (said, code) = PROGRAM.says(&["discover", &first, "--hold-out", &second]);
        assert!(matches!(code, Some(2 | 5)), "{said}");
        said
    };
    let without_rates = |frames: &[FlightFrame], place: usize| {
        let mut changed = frames[place];
        changed.pelvis.velocity = None;
        changed.pelvis.angular_velocity = None;
        changed
    };
    let slow = fails("slow", 0.98, false, without_rates);
    assert!(
        slow.contains("the frame rate is 2.6 % off (201.3 +- 0.5 Hz instead of 196.0)"),
        "{slow}"
    );
    let exchanged = fails("exchanged", 1.0, true, |frames, place| {
        turned(&frames[place], |segments| {
            for left in [Segment::LeftForearm, Segment::LeftHand] {
                // Sensors are calibrated in the T-pose, in which all attitudes are the identity in a file.
                let right = left.mirrored();
                let [own, other] = [left, right]
                    .map(|side| segments[side] * xsens_from_segment(side).quaternion().inverse());
                segments[left] = other * xsens_from_segment(left).quaternion();
                segments[right] = own * xsens_from_segment(right).quaternion();
            }
        })
    });
    assert!(
        exchanged.contains("left and right forearm and hand are exchanged"),
        "{exchanged}"
    );
    let mounted = fails("mounted", 1.0, true, |frames, place| {
        turned(&frames[place], |segments| {
            let by = nalgebra::Vector3::x() * 5.0_f64.to_radians();
            segments[Segment::Pelvis] *= nalgebra::UnitQuaternion::from_scaled_axis(by);
        })
    });
    assert!(
        mounted.contains("pelvis is turned by 5.0 degrees"),
        "{mounted}"
    );
}
