//! Fields of a mapping that contradict each other.

use std::collections::BTreeMap;

use bodyflight_core::Segment;
use bodyflight_io::diagnostic::{Problem, Result};

use crate::row::{Kind, Point, Row};

/// Checks that points, columns and joints are not taken for two things at once.
///
/// # Errors
/// Returns an error that names the segment.
pub(crate) fn check(
    kind: Kind,
    position: Option<&[String; 3]>,
    segments: &BTreeMap<String, Row>,
) -> Result<()> {
    if let Some(columns) = position {
        different(columns).map_err(|problem| {
            problem
                .at("position.columns")
                .help("one column each for X, Y and Z")
        })?;
    }
    for (name, row) in segments {
        in_row(kind, row).map_err(|problem| problem.at(format!("segments.{name}")))?;
    }
    let of_model = |segment: Segment| Some((segment, segments.get(segment.name())?));
    let rows: Vec<(Segment, &Row)> = Segment::ALL.into_iter().filter_map(of_model).collect();
    for (place, (segment, row)) in rows.iter().enumerate() {
        let before = rows.get(..place).unwrap_or_default();
        let taken = before.iter().find(|(other, others)| {
            // Parts of the trunk may share what the source has.
            (is_limb(*segment) || is_limb(*other)) && same(kind, row, others)
        });
        if let Some((other, _)) = taken {
            return Err(Problem::bad_input(format!(
                "it has what {} has in the file: expected its own",
                other.name()
            ))
            .at(format!("segments.{}", segment.name()))
            .help("leave out a segment that the file lacks, if it is an abdomen, a head, a hand or a foot"));
        }
        let inner = segment.parent().filter(|inner| is_limb(*inner));
        let inner = inner.and_then(|inner| segments.get(inner.name()).zip(Some(inner)));
        if let Some((inner_row, inner)) = inner {
            for (end, own, other) in [
                ("begins", &row.from, &inner_row.from),
                ("ends", &row.to, &inner_row.to),
            ] {
                if is_shared(own.as_ref(), other.as_ref()) {
                    return Err(Problem::bad_input(format!(
                        "it {end} where {} {end}: a limb begins where the one before it ends",
                        inner.name()
                    ))
                    .at(format!("segments.{}", segment.name()))
                    .help("from is the end towards the trunk, to the other one"));
                }
            }
        }
    }
    Ok(())
}

fn is_limb(segment: Segment) -> bool {
    segment.mirrored() != segment
}

/// Whether two segments are given by the same.
fn same(kind: Kind, one: &Row, other: &Row) -> bool {
    match kind {
        Kind::Bvh => one.joint.is_some() && one.joint == other.joint,
        Kind::Quaternions => one.columns.is_some() && one.columns == other.columns,
        Kind::Points => {
            is_shared(one.from.as_ref(), other.from.as_ref())
                && is_shared(one.to.as_ref(), other.to.as_ref())
        }
        // Both legs may follow one angle.
        Kind::Angles => false,
    }
}

/// Whether both are there and the same points.
fn is_shared(one: Option<&Point>, other: Option<&Point>) -> bool {
    let names = |point: &Point| {
        let mut names = point.names().to_vec();
        names.sort();
        names
    };
    one.zip(other)
        .is_some_and(|(one, other)| names(one) == names(other))
}

fn in_row(kind: Kind, row: &Row) -> Result<()> {
    let left = row.left.iter().flatten();
    let mut points = row.from.iter().chain(&row.to).chain(left);
    if points.any(|point| point.names().is_empty()) {
        return Err(Problem::bad_input(
            "expected the name of a point, or several for the midpoint, found an empty list",
        ));
    }
    if is_shared(row.from.as_ref(), row.to.as_ref()) {
        return Err(Problem::bad_input(
            "from and to are the same, so it has no direction",
        ));
    }
    if let Some([right, left]) = &row.left
        && is_shared(Some(right), Some(left))
    {
        return Err(Problem::bad_input(
            "the two points of left are the same: expected the second further left",
        ));
    }
    match (&row.columns, kind) {
        (Some(columns), Kind::Angles | Kind::Quaternions) => different(columns),
        _ => Ok(()),
    }
}

fn different(columns: &[String]) -> Result<()> {
    let name = |column: &String| column.trim_start_matches('-').to_owned();
    let twice = columns.iter().enumerate().find(|(place, column)| {
        let before = columns.get(..*place).unwrap_or_default();
        before.iter().any(|other| name(other) == name(column))
    });
    match twice {
        Some((_, column)) => Err(Problem::bad_input(format!(
            "the column \"{column}\" is there twice: expected a different one for each part"
        ))),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::mapping::Mapping;

    const POINTS: &str = "kind = \"points\"\n[world]\naxes = [\"north\", \"west\", \"up\"]\n[time]\nrate_hz = 100\n\
        [position]\ncolumns = [\"a\", \"b\", \"c\"]\n\
        [segments.pelvis]\nfrom = [\"LHIP\", \"RHIP\"]\nto = \"BACK\"\nleft = [\"RHIP\", \"LHIP\"]\n\
        [segments.l_upperarm]\nfrom = \"LSHO\"\nto = \"LELB\"\n[segments.l_forearm]\nfrom = \"LELB\"\nto = \"LWRI\"\n\
        [segments.r_upperarm]\nfrom = \"RSHO\"\nto = \"RELB\"\n[segments.r_forearm]\nfrom = \"RELB\"\nto = \"RWRI\"\n";

    fn refused(text: &str) -> String {
        let problem = Mapping::parse(text, Path::new("m.toml")).unwrap_err();
        problem.to_string()
    }

    #[test]
    fn what_is_taken_for_two_things_is_refused_with_the_segment() {
        assert!(Mapping::parse(POINTS, Path::new("m.toml")).is_ok());
        for (from, to, said) in [
            (
                "[\"a\", \"b\", \"c\"]",
                "[\"c\", \"b\", \"c\"]",
                "position.columns: the column \"c\" is there twice",
            ),
            (
                "from = \"RELB\"\nto = \"RWRI\"",
                "from = \"LELB\"\nto = \"LWRI\"",
                "segments.r_forearm: it has what l_forearm has",
            ),
            (
                "from = \"LELB\"\nto = \"LWRI\"",
                "from = \"LWRI\"\nto = \"LELB\"",
                "segments.l_forearm: it ends where l_upperarm ends",
            ),
            (
                "from = \"LSHO\"\nto = \"LELB\"",
                "from = \"LELB\"\nto = \"LSHO\"",
                "segments.l_forearm: it begins where l_upperarm begins",
            ),
            (
                "from = \"RELB\"\n",
                "from = \"RWRI\"\n",
                "segments.r_forearm: from and to are the same",
            ),
            (
                "from = \"RELB\"\n",
                "from = []\n",
                "segments.r_forearm: expected the name of a point",
            ),
            (
                "left = [\"RHIP\", \"LHIP\"]",
                "left = [\"LHIP\", \"LHIP\"]",
                "segments.pelvis: the two points of left are the same",
            ),
        ] {
            assert!(POINTS.contains(from), "{from}");
            let found = refused(&POINTS.replacen(from, to, 1));
            assert!(found.contains(said), "{found}\nlacks {said}");
        }
    }

    #[test]
    fn columns_and_joints_belong_to_one_limb() {
        let quaternions = "kind = \"quaternions\"\n[world]\naxes = [\"north\", \"west\", \"up\"]\n[body]\n\
            axes = [\"forward\", \"left\", \"up\"]\nrest = \"t-pose\"\n[time]\nrate_hz = 100\n\
            [segments.l_thigh]\ncolumns = [\"w\", \"x\", \"y\", \"z\"]\n";
        let twice =
            format!("{quaternions}[segments.r_thigh]\ncolumns = [\"w\", \"x\", \"y\", \"z\"]\n");
        assert!(refused(&twice).contains("segments.r_thigh: it has what l_thigh has"));
        let odd = quaternions.replace("\"y\"", "\"x\"");
        assert!(refused(&odd).contains("segments.l_thigh: the column \"x\" is there twice"));
        let joints = "kind = \"bvh\"\n[world]\naxes = [\"west\", \"up\", \"north\"]\n[body]\n\
            axes = [\"left\", \"up\", \"forward\"]\n[segments.abdomen]\njoint = \"Spine\"\n[segments.thorax]\njoint = \"Spine\"\n";
        assert!(Mapping::parse(joints, Path::new("m.toml")).is_ok());
        let twice = format!(
            "{joints}[segments.l_foot]\njoint = \"Foot\"\n[segments.r_foot]\njoint = \"Foot\"\n"
        );
        assert!(refused(&twice).contains("segments.r_foot: it has what l_foot has"));
    }
}
