//! The segments of a table's source and their columns, from a mapping.

use bodyflight_core::Segment;
use bodyflight_io::diagnostic::{Problem, Result};
use nalgebra::{Matrix3, Quaternion, Rotation3, UnitQuaternion};

use crate::mapping::{AngleUnit, Kind, Mapping, Order, Point, RelativeTo, Row};
use crate::table::Table;

/// Largest accepted error of the length of a quaternion, and of a rotation matrix: the Frobenius norm of the difference
/// between the matrix times its transpose and the identity.
const OFF_UNIT: f64 = 0.02;

/// A segment of the source.
pub(crate) struct Link {
    pub(crate) name: String,
    pub(crate) segment: Option<Segment>,
    pub(crate) parent: Option<usize>,
    pub(crate) zero: Matrix3<f64>,
    pub(crate) turn: Turn,
}

pub(crate) enum Turn {
    /// Axis, factor to radians, column.
    Angles(Vec<(usize, f64, usize)>),
    /// Columns of w, x, y, z, and whether the quaternion is relative to the parent.
    Quaternion([usize; 4], bool),
    Points(Ends),
}

pub(crate) struct Ends {
    pub(crate) from: Vec<[usize; 3]>,
    pub(crate) to: Vec<[usize; 3]>,
    pub(crate) left: Option<[Vec<[usize; 3]>; 2]>,
}

impl Link {
    /// The columns that it needs.
    pub(crate) fn columns(&self) -> Vec<usize> {
        match &self.turn {
            Turn::Angles(angles) => angles.iter().map(|(_, _, column)| *column).collect(),
            Turn::Quaternion(columns, _) => columns.to_vec(),
            Turn::Points(ends) => (ends.left.iter().flatten())
                .chain([&ends.from, &ends.to])
                .flatten()
                .flatten()
                .copied()
                .collect(),
        }
    }
}

/// The links of a mapping, parents first.
pub(crate) fn links(table: &Table, mapping: &Mapping) -> Result<Vec<Link>> {
    let mut links: Vec<Link> = Vec::new();
    let mut waiting: Vec<(&String, &Row)> = mapping.segments.iter().collect();
    while !waiting.is_empty() {
        let before = waiting.len();
        let mut still = Vec::new();
        for (name, row) in waiting {
            let place = |name: &str| links.iter().position(|link| link.name == name);
            let parent = parent(mapping, name, row);
            match parent.map(place) {
                Some(None) => still.push((name, row)),
                found => {
                    let link = link(table, mapping, name, row, found.flatten())
                        .map_err(|problem| problem.at(format!("segments.{name}")))?;
                    links.push(link);
                }
            }
        }
        if still.len() == before {
            let names: Vec<&str> = still.iter().map(|(name, _)| name.as_str()).collect();
            let message = format!("their parents form a cycle: {}", names.join(", "));
            return Err(Problem::bad_input(message).at("segments"));
        }
        waiting = still;
    }
    Ok(links)
}

/// The parent of a segment: the one named, or the next mapped segment towards the pelvis.
fn parent<'a>(mapping: &'a Mapping, name: &str, row: &'a Row) -> Option<&'a str> {
    if let Some(parent) = &row.parent {
        return Some(parent);
    }
    let mut above = Segment::from_name(name)?.parent();
    while let Some(segment) = above {
        if mapping.segments.contains_key(segment.name()) {
            return Some(segment.name());
        }
        above = segment.parent();
    }
    None
}

fn link(
    table: &Table,
    mapping: &Mapping,
    name: &str,
    row: &Row,
    parent: Option<usize>,
) -> Result<Link> {
    let named = row.columns.as_deref().unwrap_or(&[]);
    let turn = match mapping.kind {
        Kind::Angles => {
            let unit = match mapping.angles.unit.or(table.angles) {
                Some(AngleUnit::Rad) => 1.0,
                Some(AngleUnit::Deg) | None => 1.0_f64.to_radians(),
            };
            let axes = row.rotations.as_deref().unwrap_or("").bytes();
            let angles = axes.zip(named).map(|(axis, column)| {
                let (sign, column) = match column.strip_prefix('-') {
                    Some(column) => (-1.0, column),
                    None => (1.0, column.as_str()),
                };
                Ok((usize::from(axis - b'x'), sign * unit, table.column(column)?))
            });
            Turn::Angles(angles.collect::<Result<_>>()?)
        }
        Kind::Quaternions => {
            let mut columns = [0; 4];
            // One name stands for four columns, which say what they hold.
            let shared = |name: &String| ["w", "x", "y", "z"].map(|part| format!("{name}.{part}"));
            let each = match named {
                [one] => shared(one).to_vec(),
                four => four.to_vec(),
            };
            for (place, name) in columns.iter_mut().zip(&each) {
                *place = table.column(name)?;
            }
            if named.len() == 4 && mapping.quaternions.order == Order::Xyzw {
                columns.rotate_right(1);
            }
            let relative = mapping.quaternions.relative_to == RelativeTo::Parent;
            Turn::Quaternion(columns, relative)
        }
        Kind::Points | Kind::Bvh => {
            let of = |point: &Point| -> Result<Vec<[usize; 3]>> {
                let names = point.names().iter();
                names
                    .map(|name| {
                        let [x, y, z] = ["x", "y", "z"].map(|axis| format!("{name}.{axis}"));
                        Ok([table.column(&x)?, table.column(&y)?, table.column(&z)?])
                    })
                    .collect()
            };
            let ends = |point: &Option<Point>| point.as_ref().map_or(Ok(Vec::new()), of);
            Turn::Points(Ends {
                from: ends(&row.from)?,
                to: ends(&row.to)?,
                left: match &row.left {
                    Some([right, left]) => Some([of(right)?, of(left)?]),
                    None => None,
                },
            })
        }
    };
    Ok(Link {
        name: name.to_owned(),
        segment: Segment::from_name(name),
        parent,
        zero: zero(row)?,
        turn,
    })
}

/// The matrix of a link at zero angles.
fn zero(row: &Row) -> Result<Matrix3<f64>> {
    let Some(rows) = row.zero else {
        return Ok(Matrix3::identity());
    };
    let written = Matrix3::from_row_slice(&rows.concat());
    let rotation = rotation(&written).map_err(Problem::bad_input)?;
    Ok(*rotation.matrix())
}

/// The rotation nearest to a matrix that is one but for rounding, or what is wrong with it.
pub(crate) fn rotation(written: &Matrix3<f64>) -> core::result::Result<Rotation3<f64>, String> {
    let off = (written * written.transpose() - Matrix3::identity()).norm();
    if off < OFF_UNIT && written.determinant() > 0.0 {
        return Ok(Rotation3::from_matrix(written));
    }
    Err(format!(
        "expected a rotation matrix, found a matrix with an error of {off:.3}"
    ))
}

/// The unit quaternion of one that is so but for rounding, or what is wrong with it.
pub(crate) fn unit(written: &Quaternion<f64>) -> core::result::Result<UnitQuaternion<f64>, String> {
    let length = written.norm();
    if (length - 1.0).abs() <= OFF_UNIT {
        return Ok(UnitQuaternion::new_normalize(*written));
    }
    let [w, x, y, z] = [written.w, written.i, written.j, written.k];
    Err(format!(
        "expected a quaternion of unit length, found {w} {x} {y} {z} of length {length:.3}"
    ))
}
