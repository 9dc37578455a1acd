//! Inputs as text, of any length: the track of a jump, markers of a body that swings its limbs, a flight of a page.

use std::fmt::Write;

use bodyflight_core::Segment;
use bodyflight_replay::subject::Subject;
use bodyflight_viewer::frame::{LAYOUT, NUMBERS, SEGMENT_NUMBERS, place};

/// A mapping for [`markers`].
pub const MAPPING: &str = include_str!("fuzz_targets/mappings/points.toml");

/// A jump, then a long walk on the ground.
pub fn track(rows: u32) -> String {
    let mut text = "time_s,north_m,east_m,height_m,north_mps,east_mps,up_mps\n".to_owned();
    let (mut height, mut speed) = (4000.0_f64, 0.0_f64);
    for row in 0..rows {
        let time = 0.2 * f64::from(row);
        speed = match height {
            _ if time < 30.0 => 0.0,
            height if height > 1200.0 => speed + 0.2 * 9.8 * (1.0 - (speed / 52.0).powi(2)),
            height if height > 300.0 => (speed - 5.0).max(5.0),
            _ => 0.0,
        };
        height -= 0.2 * speed;
        let shake = 0.1 * (1.7 * time).sin();
        let _ = writeln!(
            text,
            "{time:.1},{:.1},0,{height:.2},8,0,{:.2}",
            8.0 * time,
            shake - speed
        );
    }
    text
}

/// Markers of a body that swings its limbs.
pub fn markers(rows: u32) -> String {
    let ends = [
        ("hip", 0.09, 0.95),
        ("knee", 0.09, 0.53),
        ("ank", 0.09, 0.1),
        ("sho", 0.2, 1.45),
        ("elb", 0.22, 1.15),
        ("wri", 0.22, 0.9),
    ];
    let sides = [("l", 1.0), ("r", -1.0)];
    let mut text = "time".to_owned();
    for (side, _) in sides {
        for (name, ..) in ends {
            let _ = write!(text, ",{side}{name}.x,{side}{name}.y,{side}{name}.z");
        }
    }
    for row in 0..rows {
        let time = f64::from(row) / 100.0;
        let _ = write!(text, "\n{time:.2}");
        for (_, sign) in sides {
            for (_, y, z) in ends {
                let swing = 0.3 * (0.95 - z) * (3.0 * time).sin();
                let _ = write!(text, ",{swing:.4},{:.2},{z}", sign * y);
            }
        }
    }
    text + "\n"
}

/// A flight as the page of `fly` saves it without a program, of the default subject who falls spread out.
pub fn flown(frames: usize) -> String {
    let columns = LAYOUT.iter().flat_map(|(name, count)| {
        (0..*count).map(move |k| match count {
            1 => (*name).to_owned(),
            _ => format!("{name}_{k}"),
        })
    });
    let columns: Vec<String> = columns.collect();
    // Identities are the only numbers that are not zero.
    let of_segments = place("segments").unwrap_or_default();
    let mut ones: Vec<usize> = (0..Segment::ALL.len())
        .map(|segment| of_segments + segment * SEGMENT_NUMBERS)
        .collect();
    ones.extend(place("inertial_from_body"));
    let row: Vec<&str> = (0..NUMBERS)
        .map(|number| if ones.contains(&number) { "1" } else { "0" })
        .collect();
    let mass = Subject::default().body().mass();
    let first = format!("# bodyflight fly: density_kgpm3=1.0, mass_kg={mass}\n");
    let row = row.join(",") + "\n";
    first + &columns.join(",") + "\n" + &row.repeat(frames)
}
