//! The recording as a table of another system, from which velocities and angular velocities are missing.

use core::fmt::Write;

use super::recorded::{Kind, Recorded, decimal};

/// Segments of the model, and the place of the one in the recording that leads it.
pub(super) const SEGMENTS: [(&str, usize); 16] = [
    ("pelvis", 0),
    ("abdomen", 2),
    ("thorax", 4),
    ("head", 6),
    ("r_upperarm", 8),
    ("r_forearm", 9),
    ("r_hand", 10),
    ("l_upperarm", 12),
    ("l_forearm", 13),
    ("l_hand", 14),
    ("r_thigh", 15),
    ("r_shank", 16),
    ("r_foot", 17),
    ("l_thigh", 19),
    ("l_shank", 20),
    ("l_foot", 21),
];

/// The mapping of the table.
pub(super) fn mapping() -> String {
    let mut text = "kind = \"quaternions\"\n[world]\naxes = [\"north\", \"west\", \"up\"]\n\
        [body]\naxes = [\"forward\", \"left\", \"up\"]\nrest = \"t-pose\"\n\
        [time]\ncolumn = \"time\"\nunit_s = 0.001\n[position]\ncolumns = [\"x\", \"y\", \"z\"]\n"
        .to_owned();
    for (name, _) in SEGMENTS {
        let columns = ["w", "x", "y", "z"].map(|part| format!("\"{name}.{part}\""));
        let _ = write!(
            text,
            "[segments.{name}]\ncolumns = [{}]\n",
            columns.join(", ")
        );
    }
    text
}

/// The changed recording as a table.
pub(super) fn table(recorded: &Recorded, kind: &Kind) -> String {
    let mut text = "time;x;y;z".to_owned();
    for (name, _) in SEGMENTS {
        let _ = write!(text, ";{name}.w;{name}.x;{name}.y;{name}.z");
    }
    for frame in recorded.changed(kind) {
        let (_, time) = frame.open.split_once(" time=\"").expect("a time");
        let time = time.split('"').next().expect("its end");
        let mut row = String::new();
        let place = frame.position[0];
        let numbers = SEGMENTS.iter().flat_map(|(_, at)| frame.orientation[*at]);
        for number in [place.x, place.y, place.z].into_iter().chain(numbers) {
            decimal(number, &mut row);
        }
        let _ = write!(text, "\n{time};{}", row.trim_end().replace(' ', ";"));
    }
    text
}
