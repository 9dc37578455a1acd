//! Changes of joints by angles that a person asks about: what if this knee were bent by 20 degrees more?

use std::path::Path;

use bodyflight_core::body::joint_angle::{JointAngle, share_within};
use bodyflight_core::{Posture, Segment};

use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::input;
use bodyflight_io::text::with_commas;

/// Largest change (degrees).
const MOST: f64 = 180.0;

/// How much an angle changes.
#[derive(Debug, Clone, PartialEq)]
enum Amount {
    /// By a constant (rad), if there is a window (s) only within it.
    Constant(f64, Option<[f64; 2]>),
    /// By a curve: times (s) and changes (rad), in ascending order of time.
    Curve(Vec<(f64, f64)>),
}

/// A change of one angle of one joint.
#[derive(Debug, Clone, PartialEq)]
pub struct JointChange {
    angle: JointAngle,
    amount: Amount,
}

impl JointChange {
    /// Reads `l_shank.bend=+20`, the same with a window in seconds, `l_shank.bend=+20@1.0..2.5`, or with the column of a CSV
    /// file in degrees over `time_s`, `l_shank.bend=curve.csv:knee`.
    ///
    /// # Errors
    /// Returns an error that says what was expected, and lists the names of joints and angles if one is unknown.
    pub fn parse(text: &str) -> Result<Self> {
        let (name, value) = text.split_once('=').ok_or_else(|| {
            Problem::bad_input(format!("expected JOINT.ANGLE=DEGREES, found \"{text}\""))
                .help("for example --joint l_shank.bend=+20, --joint l_shank.bend=+20@1.0..2.5")
        })?;
        let angle = angle_named(name.trim())?;
        let amount = amount(value).map_err(|problem| problem.at(format!("--joint {name}")))?;
        Ok(Self { angle, amount })
    }

    /// A change by a constant (rad), all the time.
    pub const fn by(angle: JointAngle, amount: f64) -> Self {
        let amount = Amount::Constant(amount, None);
        Self { angle, amount }
    }

    /// A change by a curve: times (s) and changes (rad), in ascending order of time.
    pub const fn along(angle: JointAngle, points: Vec<(f64, f64)>) -> Self {
        let amount = Amount::Curve(points);
        Self { angle, amount }
    }

    /// Name of joint and angle.
    pub fn name(&self) -> String {
        self.angle.to_string()
    }

    /// The constant (rad), `None` for a curve.
    pub fn constant(&self) -> Option<f64> {
        match self.amount {
            Amount::Constant(amount, _) => Some(amount),
            Amount::Curve(_) => None,
        }
    }

    /// When it acts (s); `None` for the whole flight.
    pub fn window(&self) -> Option<[f64; 2]> {
        match &self.amount {
            Amount::Constant(_, window) => *window,
            Amount::Curve(points) => Some([points.first()?.0, points.last()?.0]),
        }
    }

    /// The change (rad) at a time (s); a window as in [`share_within`].
    pub fn at(&self, time: f64) -> f64 {
        match &self.amount {
            Amount::Constant(amount, None) => *amount,
            Amount::Constant(amount, Some(window)) => amount * share_within(*window, time),
            Amount::Curve(points) => interpolated(points, time),
        }
    }

    /// The angle in a posture (rad).
    pub fn angle(&self, posture: &Posture<f64>) -> f64 {
        self.angle.value(posture)
    }

    /// Whether it bends a knee.
    pub fn is_bend(&self) -> bool {
        self.angle.is_bend()
    }
}

/// Returns the angle of a joint by its name, such as `l_shank.bend`.
///
/// # Errors
/// Returns an error that lists the names of joints or angles if one is unknown.
pub fn angle_named(name: &str) -> Result<JointAngle> {
    let (joint, angle) = name.split_once('.').unwrap_or((name, ""));
    let movable = |segment: &Segment| *segment != Segment::Pelvis;
    let segment = Segment::from_name(joint).filter(movable).ok_or_else(|| {
        let joints = Segment::ALL.into_iter().filter(movable);
        Problem::unknown("joint", joint, joints.map(|segment| segment.name()))
    })?;
    JointAngle::of_joint(segment)
        .find(|own| own.name == angle)
        .ok_or_else(|| {
            let allowed = JointAngle::of_joint(segment).map(|own| own.name);
            let allowed: Vec<&str> = allowed.collect();
            let message = format!("{joint} has no angle \"{angle}\"");
            Problem::bad_input(message).help(format!("it has {}", allowed.join(", ")))
        })
}

/// A posture with all changes at a time (s), each in the axes of the joint's parent.
pub fn changed(changes: &[JointChange], time: f64, posture: &Posture<f64>) -> Posture<f64> {
    changes.iter().fold(*posture, |posture, change| {
        change.angle.turned(&posture, change.at(time))
    })
}

/// Checks that each change by a constant acts in a flight between these times (s).
///
/// # Errors
/// Returns an error that names the joint whose window is outside of the flight.
pub fn check_windows(changes: &[JointChange], from: f64, to: f64) -> Result<()> {
    let idle = changes.iter().find_map(|change| {
        let window = change.window().filter(|_| change.constant().is_some())?;
        (window[1] <= from || window[0] >= to).then_some((change, window))
    });
    let Some((change, [begin, end])) = idle else {
        return Ok(());
    };
    Err(Problem::bad_input(format!(
        "expected a window within the flight, from {from:.2} to {to:.2} s, found {begin} to {end} s: it changes nothing"
    ))
    .at(format!("--joint {}", change.name())))
}

fn interpolated(points: &[(f64, f64)], time: f64) -> f64 {
    let after = points.partition_point(|(at, _)| *at <= time);
    match (
        after.checked_sub(1).and_then(|before| points.get(before)),
        points.get(after),
    ) {
        (Some((from, low)), Some((to, high))) => low + (high - low) * (time - from) / (to - from),
        (Some((_, last)), None) => *last,
        (None, first) => first.map_or(0.0, |(_, first)| *first),
    }
}

fn amount(text: &str) -> Result<Amount> {
    let text = text.trim();
    let (number, window) = match text.split_once('@') {
        Some((number, window)) => (number, Some(window)),
        None => (text, None),
    };
    if let Ok(degrees) = number.trim().parse::<f64>() {
        return Ok(Amount::Constant(
            within(degrees)?,
            window.map(span).transpose()?,
        ));
    }
    let (path, column) = text.rsplit_once(':').ok_or_else(|| {
        Problem::bad_input(format!(
            "expected degrees or FILE.csv:COLUMN, found \"{text}\""
        ))
    })?;
    Ok(Amount::Curve(curve(Path::new(path), column)?))
}

/// Degrees as radians, if they are those of a joint.
fn within(degrees: f64) -> Result<f64> {
    if degrees.abs() <= MOST {
        return Ok(degrees.to_radians());
    }
    let message = format!("expected at most {MOST} degrees, found {degrees}");
    Err(Problem::bad_input(message))
}

fn span(text: &str) -> Result<[f64; 2]> {
    let ends = text.split_once("..");
    let number = |text: &str| {
        text.trim()
            .parse::<f64>()
            .ok()
            .filter(|time| time.is_finite())
    };
    let ends = ends.and_then(|(begin, end)| Some([number(begin)?, number(end)?]));
    ends.filter(|[begin, end]| begin < end).ok_or_else(|| {
        let message = format!("expected a window in seconds such as 1.0..2.5, found \"{text}\"");
        Problem::bad_input(message)
    })
}

/// A column of a CSV file in degrees, over its column `time_s`.
fn curve(path: &Path, column: &str) -> Result<Vec<(f64, f64)>> {
    let text = input::text(path)?;
    let text = with_commas(text.as_bytes());
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .comment(Some(b'#'))
        .from_reader(&*text);
    let broken = |error: csv::Error| Problem::bad_input(error.to_string()).in_file(path);
    let head = reader.headers().map_err(broken)?.clone();
    let place = |name: &str| {
        head.iter().position(|own| own == name).ok_or_else(|| {
            Problem::unknown("column", name, head.iter())
                .in_file(path)
                .at_line(1)
        })
    };
    let (time, value) = (place("time_s")?, place(column)?);
    let mut points: Vec<(f64, f64)> = Vec::new();
    for row in reader.records() {
        let row = row.map_err(broken)?;
        let line = row.position().map_or(0, csv::Position::line);
        let at_line = |problem: Problem| problem.in_file(path).at_line(line);
        let number = |at: usize| {
            let cell = row.get(at).unwrap_or_default();
            let number = cell.parse::<f64>().ok().filter(|number| number.is_finite());
            number.ok_or_else(|| {
                at_line(Problem::bad_input(format!(
                    "expected a number, found \"{cell}\""
                )))
            })
        };
        let point = (number(time)?, within(number(value)?).map_err(at_line)?);
        if points.last().is_some_and(|(before, _)| *before >= point.0) {
            let message = format!(
                "expected a time above that of the row before, found {}",
                point.0
            );
            return Err(at_line(Problem::bad_input(message)));
        }
        points.push(point);
    }
    if points.is_empty() {
        return Err(
            Problem::bad_input("expected rows below the names of columns, found none")
                .in_file(path),
        );
    }
    Ok(points)
}

#[cfg(test)]
mod tests {
    use super::*;
    use bodyflight_core::body::pattern;

    #[test]
    fn a_bend_adds_to_the_angle_of_the_knee_and_to_nothing_else() {
        let neutral = pattern::neutral::<f64>();
        for (text, by) in [("l_shank.bend=+20", 20.0), ("l_shank.phi=-20", -20.0)] {
            let change = JointChange::parse(text).unwrap();
            let bent = changed(core::slice::from_ref(&change), 1.0, &neutral);
            let more = change.angle(&bent) - change.angle(&neutral);
            assert!((more.to_degrees() - by).abs() < 1e-9, "{text}: {more}");
            for segment in Segment::ALL {
                let same =
                    bent.parent_from_segment(segment) == neutral.parent_from_segment(segment);
                assert_eq!(same, segment != Segment::LeftShank, "{segment:?}");
            }
        }
    }

    #[test]
    fn a_window_is_entered_and_left_smoothly() {
        let change = JointChange::parse("r_thigh.theta=-10@1.0..2.5").unwrap();
        for (time, degrees) in [
            (0.9, 0.0),
            (1.1, -5.0),
            (1.2, -10.0),
            (2.5, -10.0),
            (2.6, -5.0),
            (3.0, 0.0),
        ] {
            assert!(
                (change.at(time).to_degrees() - degrees).abs() < 1e-9,
                "{time}"
            );
        }
    }

    #[test]
    fn a_curve_is_interpolated_and_kept_at_its_ends() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("knee.csv");
        std::fs::write(&path, "time_s,knee\n1.0,0\n2.0,30\n").unwrap();
        let change = JointChange::parse(&format!("l_shank.bend={}:knee", path.display())).unwrap();
        for (time, degrees) in [(0.0, 0.0), (1.5, 15.0), (9.0, 30.0)] {
            assert!(
                (change.at(time).to_degrees() - degrees).abs() < 1e-9,
                "{time}"
            );
        }
        assert_eq!(change.window(), Some([1.0, 2.0]));
        std::fs::write(&path, "time_s,knee\n1.0,0\n1.0,30\n").unwrap();
        let problem =
            JointChange::parse(&format!("l_shank.bend={}:knee", path.display())).unwrap_err();
        assert_eq!(problem.line, Some(3));
        let problem =
            JointChange::parse(&format!("l_shank.bend={}:hip", path.display())).unwrap_err();
        assert!(problem.to_string().contains("hip"), "{problem}");
    }

    #[test]
    fn mistakes_name_the_joint_and_what_is_allowed() {
        for (text, parts) in [
            ("l_shank.bend", ["JOINT.ANGLE=DEGREES", "+20"]),
            ("l_knee.bend=20", ["l_knee", "l_shank"]),
            ("pelvis.phi=20", ["pelvis", "l_thigh"]),
            (
                "l_thigh.bend=20",
                ["l_thigh has no angle \"bend\"", "psi, theta, phi"],
            ),
            (
                "l_shank=20",
                ["l_shank has no angle", "bend, psi, theta, phi"],
            ),
            ("l_shank.bend=200", ["l_shank.bend", "at most 180"]),
            ("l_shank.bend=much", ["degrees or FILE.csv:COLUMN", "much"]),
            ("l_shank.bend=20@2..1", ["window in seconds", "2..1"]),
        ] {
            let problem = JointChange::parse(text).unwrap_err();
            let said = format!("{problem} {:?}", problem.help);
            assert!(
                parts.iter().all(|part| said.contains(part)),
                "{text}: {said}"
            );
        }
    }
}
