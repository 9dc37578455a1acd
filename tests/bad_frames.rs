//! Bad frames and gaps in an otherwise good recording: bridged and counted, or refused with their location.

use bodyflight_core::Segment;
use bodyflight_tests::small_recording::{is_usable, read, survey, with_numbers, written};

#[test]
fn bad_numbers_only_make_their_frame_bad() {
    let text = written(12);
    let first = |to: &'static str| {
        move |all: &str| format!("{to} {}", all.split_once(' ').expect("numbers").1)
    };
    let scaled = |factor: f64| {
        move |all: &str| {
            let numbers = all
                .split(' ')
                .map(|n| n.parse::<f64>().expect("a number") * factor);
            numbers.map(|n| n.to_string()).collect::<Vec<_>>().join(" ")
        }
    };
    let orientation =
        |change: &dyn Fn(&str) -> String| with_numbers(&text, 6, "orientation", change);
    let cases = [
        (
            orientation(&first("")),
            "orientation",
            "expected 92 numbers, found 91",
        ),
        (
            orientation(&|all| format!("{all} 1")),
            "orientation",
            "expected 92 numbers, found 93",
        ),
        (
            orientation(&|_| String::new()),
            "orientation",
            "expected 92 numbers, found 0",
        ),
        (orientation(&first("nan")), "orientation", "`nan`"),
        (orientation(&first("-inf")), "orientation", "`-inf`"),
        (orientation(&first("1e400")), "orientation", "`1e400`"),
        (orientation(&first("1.#QNAN")), "orientation", "`1.#QNAN`"),
        (
            orientation(&first("0,5")),
            "orientation",
            "decimal separator",
        ),
        (orientation(&first("&#49;")), "orientation", "reference"),
        (orientation(&first("<b/>")), "orientation", "element"),
        (orientation(&scaled(0.0)), "orientation", "norm 0.000"),
        (orientation(&scaled(0.5)), "orientation", "norm 0.5"),
        (orientation(&scaled(2.0)), "orientation", "norm 2.0"),
        (
            with_numbers(&text, 6, "position", first("1\0")),
            "position",
            "`1\\0`",
        ),
        (
            with_numbers(&text, 6, "velocity", first("")),
            "velocity",
            "found 68",
        ),
        (
            with_numbers(&text, 6, "angularVelocity", first("x")),
            "angularVelocity",
            "`x`",
        ),
        (
            with_numbers(&text, 6, "centerOfMass", first("")),
            "centerOfMass",
            "3 or 9",
        ),
        (
            text.replace("index=\"6\"", "index=\"six\""),
            "index",
            "`six`",
        ),
    ];
    for (broken, name, part) in cases {
        let (frames, quality) = read(broken.as_bytes()).expect("bridged");
        assert_eq!(
            (frames.len(), quality.bridged_frames, quality.good_frames),
            (12, 1, 11)
        );
        let fault = quality.first_fault.expect("reported");
        assert_eq!((fault.index, fault.element), (6, name), "{fault:?}");
        assert!(fault.message.contains(part), "{part}: {fault:?}");
        let line = broken
            .lines()
            .position(|l| l.contains("index=\"6\"") || l.contains("\"six\""));
        let line = line.expect("the frame") as u64 + 1;
        assert!(
            (line..line + 8).contains(&fault.line),
            "{fault:?}, frame in line {line}"
        );
        assert!(frames.iter().all(is_usable));
        // The bridged frame is interpolated, not a copy of a neighbour.
        assert!(frames[6].bridged);
        let fall = frames[6].pelvis.position.up();
        assert!(fall < frames[5].pelvis.position.up());
        assert!(fall > frames[7].pelvis.position.up());
        let report = survey(broken.as_bytes()).expect("surveyed");
        assert_eq!((report.bad_frames, report.frames), (1, 12));
        assert_eq!(report.bad_frame_list[0].element, name);
    }
}

#[test]
fn a_sign_change_of_quaternions_is_not_a_motion() {
    let text = written(6);
    let flipped = with_numbers(&text, 3, "orientation", |all| {
        let numbers = all.split(' ').map(|n| n.parse::<f64>().expect("a number"));
        numbers
            .map(|n| format!("{:.6}", -n))
            .collect::<Vec<_>>()
            .join(" ")
    });
    let (frames, _) = read(flipped.as_bytes()).expect("good");
    let (expected, _) = read(text.as_bytes()).expect("good");
    for segment in Segment::ALL {
        let [found, expected] =
            [&frames, &expected].map(|frames| *frames[3].posture.parent_from_segment(segment));
        assert!(found.angle_to(&expected) < 1e-6);
    }
}

#[test]
fn the_wrong_order_of_quaternion_components_is_found_by_the_joints() {
    let text = written(6);
    let mut swapped = text.clone();
    for index in 0..6 {
        swapped = with_numbers(&swapped, index, "orientation", |all| {
            let numbers: Vec<&str> = all.split(' ').collect();
            let xyzw = numbers.chunks(4).flat_map(|q| [q[1], q[2], q[3], q[0]]);
            xyzw.collect::<Vec<_>>().join(" ")
        });
    }
    let problem = read(swapped.as_bytes()).expect_err("swapped");
    assert!(problem.message.contains("do not meet"), "{problem}");
    assert!(problem.help.expect("a way out").contains("w x y z"));
}

#[test]
fn runs_of_bad_frames_are_bridged_up_to_a_tenth_of_a_second() {
    let text = written(60);
    let broken = |range: std::ops::Range<usize>| {
        range.fold(text.clone(), |text, index| {
            with_numbers(&text, index, "orientation", |_| "x".into())
        })
    };
    // 0.1 s at 240 Hz is 24 steps, with 23 frames in between.
    let (frames, quality) = read(broken(20..43).as_bytes()).expect("bridged");
    assert_eq!((frames.len(), quality.bridged_frames), (60, 23));
    assert!(
        frames
            .windows(2)
            .all(|pair| pair[1].index == pair[0].index + 1)
    );
    let problem = read(broken(20..44).as_bytes()).expect_err("too long");
    assert!(
        problem.to_string().contains("frame 20, orientation"),
        "{problem}"
    );
    assert!(problem.line.is_some());
    // At the start and the end there is no second neighbour to interpolate with.
    let (frames, quality) = read(broken(0..5).as_bytes()).expect("left out");
    assert_eq!(
        (frames.len(), frames[0].index, quality.dropped_frames),
        (55, 5, 5)
    );
    let (frames, quality) = read(broken(55..60).as_bytes()).expect("left out");
    assert_eq!((frames.len(), quality.dropped_frames), (55, 5));
    let problem = read(broken(0..60).as_bytes()).expect_err("nothing good");
    assert!(problem.to_string().contains("orientation"), "{problem}");
}

#[test]
fn gaps_in_the_index_stay_visible() {
    let text = written(4).replace("index=\"3\"", "index=\"9\"");
    let (frames, quality) = read(text.as_bytes()).expect("good");
    assert_eq!(quality.missing_frames, 6);
    assert!((frames[3].time - 9.0 / 240.0).abs() < 1e-12);
    let report = survey(text.as_bytes()).expect("good");
    assert_eq!((report.gaps, report.missing_frames), (1, 6));
    for index in ["1", "2"] {
        let repeated = written(4).replace("index=\"3\"", &format!("index=\"{index}\""));
        let problem = read(repeated.as_bytes()).expect_err("out of order");
        assert!(problem.message.contains("order"), "{problem}");
    }
}

#[test]
fn rates_that_are_missing_are_asked_for_by_name() {
    let text = written(2)
        .replace("<angularVelocity>", "<other>")
        .replace("</angularVelocity>", "</other>");
    let (frames, _) = read(text.as_bytes()).expect("readable");
    assert!(frames[0].pelvis.angular_velocity.is_none());
    let problem = frames[0].rates().expect_err("needed");
    assert!(problem.message.contains("<angularVelocity>"), "{problem}");
    assert!(problem.help.is_some());
}
