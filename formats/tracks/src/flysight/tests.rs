//! Whole tracks, damaged tracks, and other files.

use std::io::Write;

use proptest::prelude::*;

use super::*;

const FIRST: &str = "time,lat,lon,hMSL,velN,velE,velD,hAcc,vAcc,sAcc,gpsFix,numSV\n\
                     ,(deg),(deg),(m),(m/s),(m/s),(m/s),(m),(m),(m/s),,\n";

fn read(text: &[u8]) -> Result<Track> {
    let mut file = tempfile::Builder::new().suffix(".CSV").tempfile().unwrap();
    file.write_all(text).unwrap();
    Track::read(file.path())
}

#[test]
fn axes_are_north_west_up_in_metres() {
    let rows = "2020-01-01T00:00:00.00Z,60.0,10.0,1000,1.0,2.0,3.0,1,1,0.5,3,9\n\
                2020-01-01T00:00:00.20Z,60.001,10.001,999,1.0,2.0,3.0,1,1,0.5,3,9\n";
    let track = read(format!("{FIRST}{rows}").as_bytes()).unwrap();
    assert_eq!(track.skipped.count, 0);
    assert_eq!(track.fixes[0].velocity, Vector::new(1.0, -2.0, -3.0));
    let moved = track.fixes[1].position.components;
    assert!((moved.x - 111.195).abs() < 0.01 && (moved.y + 55.597).abs() < 0.01);
    assert!((moved.z - 999.0).abs() < 1e-9);
}

#[test]
fn bad_rows_are_skipped_and_counted() {
    let rows = "2020-01-01T00:00:00.00Z,60,10,1000,1,2,3,1,1,0.5,3,9\n\
                2020-01-01T00:00:00.20Z,60,10,1000,1,2\n\
                2020-01-01T00:00:00.40Z,60,10,1000,1,NaN,3,1,1,0.5,3,9\n\
                2020-01-01T00:00:00.60Z,60,10,1000,1,2,3,1,1,0.5,2,9\n\
                2020-01-01T00:00:00.80Z,60,10,1000,1,2,3,1,1,0.5,3,9\n\
                2020-01-01T00:00:00.70Z,60,10,1000,1,2,3,1,1,0.5,3,9\n\
                2020-01-01T00:00:01.00Z,60,10,1000,1,2,3,1,1,0.5,3,9\n\
                2020-01-01T00:00:01.20Z,60,10,1000,1,2,3,1,1,0.5,3,9\n\
                2020-01-01T00:00:01.40Z,60,10,1000,1,2,3,1,1,0.5,3,9\n";
    let track = read(format!("{FIRST}{rows}").as_bytes()).unwrap();
    assert_eq!((track.fixes.len(), track.skipped.count), (5, 4));
    let (line, why) = track.skipped.first.unwrap();
    assert_eq!(line, 4);
    assert!(why.contains("velD"), "{why}");
}

#[test]
fn rows_of_files_with_carriage_returns_have_their_line() {
    let row = "2020-01-01T00:00:00.00Z,60,10,1000,1,2,3,1,1,0.5,3,9\r\n";
    let bad = row.replace("60,", "x,");
    let text = format!("{}{row}{row}{bad}{row}", FIRST.replace('\n', "\r\n"));
    let (line, why) = read(text.as_bytes()).unwrap().skipped.first.unwrap();
    assert_eq!((line, why.contains("lat")), (5, true), "{why}");
}

#[test]
fn other_files_are_refused_with_the_expected_columns() {
    for text in ["", "a,b\n1,2\n3,4\n", "$FLYS,1\n$DATA\n$GNSS,1,2\n"] {
        let problem = read(text.as_bytes()).unwrap_err();
        assert!(problem.to_string().contains("velN"), "{problem}");
    }
}

#[test]
fn the_week_begins_on_sunday() {
    // 2023-12-31 was a Sunday.
    let time = Calendar::default()
        .seconds(b"2023-12-31T00:00:00.000Z")
        .unwrap();
    let fix = Fix {
        time,
        position: Vector::zero(),
        velocity: Vector::zero(),
        speed_accuracy: None,
        position_accuracy: None,
    };
    assert!(fix.time_of_week().abs() < 1e-6);
}

proptest! {
    #[test]
    fn no_file_makes_the_reader_panic(
        start in prop_oneof![Just(""), Just("$FLYS,1\n$COL,GNSS,time,lat\n$DATA\n"), Just(FIRST)],
        bytes in prop::collection::vec(any::<u8>(), 0..400),
    ) {
        let _ = read(&[start.as_bytes(), &bytes].concat());
    }

    #[test]
    fn no_damage_makes_a_number_that_is_not_finite(place in 0usize..400, byte in any::<u8>()) {
        let row = "2020-01-01T00:00:00.00Z,60,10,1000,1,2,3,1,1,0.5,3,9\n";
        let mut text = format!("{FIRST}{}", row.repeat(5)).into_bytes();
        let place = place % text.len();
        text[place] = byte;
        if let Ok(track) = read(&text) {
            for fix in track.fixes {
                prop_assert!(fix.position.components.iter().chain(&fix.velocity.components).all(|v| v.is_finite()));
            }
        }
    }
}
