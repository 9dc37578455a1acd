//! Orientations of segments from the rows of a table with angles, quaternions or points.

use bodyflight_core::{Segment, SegmentArray};
use nalgebra::{Matrix3, Quaternion, Rotation3, UnitQuaternion, Vector3};

use super::mapping::{AngleUnit, Kind, Mapping, Order, Point, RelativeTo, Row};
use super::skeleton::SourceFrame;
use super::table::Table;
use super::timing::{self, Timing};
use crate::diagnostic::{Problem, Result};

/// Largest accepted error of the length of a quaternion, and of a rotation matrix: the Frobenius norm of the difference
/// between the matrix times its transpose and the identity.
const OFF_UNIT: f64 = 0.02;
/// Shortest vector between two points that defines a direction (units of the file), and smallest angle between two such
/// vectors (rad).
const NO_WAY: f64 = 1e-9;
const NO_ANGLE: f64 = 0.05;

/// A table opened with its mapping.
pub struct Rows {
    table: Table,
    /// Complete rows.
    rows: Vec<usize>,
    /// The links, parents before children.
    links: Vec<Link>,
    position: Option<([usize; 3], Vector3<f64>)>,
    /// Rotation from the source's axes to inertial axes, for points.
    world: Matrix3<f64>,
}

/// A segment of the source.
struct Link {
    name: String,
    segment: Option<Segment>,
    parent: Option<usize>,
    zero: Matrix3<f64>,
    turn: Turn,
}

enum Turn {
    /// Axis, factor to radians, column.
    Angles(Vec<(usize, f64, usize)>),
    /// Columns of w, x, y, z, and whether the quaternion is relative to the parent.
    Quaternion([usize; 4], bool),
    Points(Ends),
}

struct Ends {
    from: Vec<[usize; 3]>,
    to: Vec<[usize; 3]>,
    left: Option<[Vec<[usize; 3]>; 2]>,
}

impl Rows {
    /// Finds the columns of a mapping. Returns the opened table, the timing of the complete rows, and the number of
    /// incomplete rows.
    ///
    /// # Errors
    /// Returns an error if a column is missing, a matrix is not a rotation, or the times are not evenly spaced.
    pub fn open(table: Table, mapping: &Mapping) -> Result<(Self, Timing, usize)> {
        let links = links(&table, mapping)?;
        let position = match &mapping.position {
            Some(position) => {
                let [x, y, z] = &position.columns;
                let columns = [table.column(x)?, table.column(y)?, table.column(z)?];
                Some((columns, Vector3::from(position.offset_m)))
            }
            None => None,
        };
        let time = match &mapping.time.column {
            Some(column) => Some(table.column(column)?),
            None => None,
        };
        let used: Vec<usize> = (links.iter().flat_map(Link::columns))
            .chain(position.iter().flat_map(|(columns, _)| *columns))
            .chain(time)
            .collect();
        let whole = |row: &usize| {
            used.iter()
                .all(|column| table.value(*row, *column).is_finite())
        };
        let rows: Vec<usize> = (0..table.rows()).filter(whole).collect();
        let skipped = table.rows() - rows.len();
        if rows.len() < 2 {
            let message = format!(
                "expected at least 2 rows with a value in every mapped column, found {}",
                rows.len()
            );
            return Err(Problem::bad_input(message));
        }
        let timing = match (time, mapping.time.rate_hz) {
            (Some(column), _) => {
                let unit = mapping.time.unit_s.unwrap_or(1.0);
                let times: Vec<f64> = (rows.iter())
                    .map(|row| unit * table.value(*row, column))
                    .collect();
                timing::frames(&times).map_err(|uneven| {
                    Problem::bad_input(uneven.message)
                        .at_line(table.line(rows[uneven.row]))
                        .help("resample the table to an even rate")
                })?
            }
            (None, rate) => Timing {
                rate: rate.unwrap_or(1.0),
                indices: rows.iter().map(|row| *row as u64).collect(),
            },
        };
        let opened = Self {
            table,
            rows,
            links,
            position,
            world: mapping.world.axes.0,
        };
        Ok((opened, timing, skipped))
    }

    /// Name of a segment in the source, `None` if it is not mapped.
    pub fn name(&self, segment: Segment) -> Option<String> {
        let link = self
            .links
            .iter()
            .find(|link| link.segment == Some(segment))?;
        Some(match &link.turn {
            Turn::Angles(_) | Turn::Points(_) => link.name.clone(),
            Turn::Quaternion([w, ..], _) => self.table.columns[*w].clone(),
        })
    }

    /// Length of the left thigh in the first row (m), if it is given by points.
    pub fn thigh(&self, unit_m: f64) -> Option<f64> {
        let is_thigh = |link: &&Link| link.segment == Some(Segment::LeftThigh);
        match &self.links.iter().find(is_thigh)?.turn {
            Turn::Points(ends) => {
                let row = *self.rows.first()?;
                let way = self.point(row, &ends.to) - self.point(row, &ends.from);
                Some(way.norm() * unit_m)
            }
            _ => None,
        }
    }

    /// A frame, by its index among the complete rows.
    ///
    /// # Errors
    /// Returns an error if a quaternion is not of unit length or points do not define a direction.
    pub fn frame(&self, place: usize, unit_m: f64) -> Result<SourceFrame> {
        let row = self.rows.get(place).copied().unwrap_or(0);
        let mut placed: Vec<Matrix3<f64>> = Vec::with_capacity(self.links.len());
        let mut world_from_segment = SegmentArray::from_fn(|_| Matrix3::identity());
        for link in &self.links {
            let parent = link.parent.and_then(|parent| placed.get(parent));
            let own = self.turned(link, row, parent).map_err(|message| {
                Problem::bad_input(message)
                    .at_line(self.table.line(row))
                    .at(format!("segments.{}", link.name))
            })?;
            if let Some(segment) = link.segment {
                world_from_segment[segment] = own;
            }
            placed.push(own);
        }
        Ok(SourceFrame {
            world_from_segment,
            position: self.place(row, unit_m, &world_from_segment),
        })
    }

    /// The midpoint of the hips (m), in the axes of the source's world.
    fn place(
        &self,
        row: usize,
        unit_m: f64,
        world_from_segment: &SegmentArray<Matrix3<f64>>,
    ) -> Option<Vector3<f64>> {
        if let Some((columns, offset)) = &self.position {
            let at = self.point(row, &[*columns]) * unit_m;
            return Some(at + world_from_segment[Segment::Pelvis] * offset);
        }
        let hip = |segment| {
            let link = self
                .links
                .iter()
                .find(|link| link.segment == Some(segment))?;
            match &link.turn {
                Turn::Points(ends) => Some(self.point(row, &ends.from) * unit_m),
                _ => None,
            }
        };
        Some((hip(Segment::LeftThigh)? + hip(Segment::RightThigh)?) * 0.5)
    }

    /// The midpoint of points (units of the file).
    fn point(&self, row: usize, points: &[[usize; 3]]) -> Vector3<f64> {
        let sum = points.iter().fold(Vector3::zeros(), |sum, columns| {
            sum + Vector3::from(columns.map(|column| self.table.value(row, column)))
        });
        sum / points.len().max(1) as f64
    }

    /// The rotation from the axes of a link to those of the world.
    fn turned(
        &self,
        link: &Link,
        row: usize,
        parent: Option<&Matrix3<f64>>,
    ) -> core::result::Result<Matrix3<f64>, String> {
        let on = parent.copied().unwrap_or_else(Matrix3::identity);
        match &link.turn {
            Turn::Angles(angles) => {
                Ok(angles
                    .iter()
                    .fold(on * link.zero, |turned, (axis, factor, column)| {
                        let mut about = Vector3::zeros();
                        about[*axis] = factor * self.table.value(row, *column);
                        turned * Rotation3::new(about).matrix()
                    }))
            }
            Turn::Quaternion(columns, relative) => {
                let [w, x, y, z] = columns.map(|column| self.table.value(row, column));
                let quaternion = Quaternion::new(w, x, y, z);
                let length = quaternion.norm();
                if (length - 1.0).abs() > OFF_UNIT {
                    return Err(format!(
                        "expected a quaternion of unit length, found {w} {x} {y} {z} of length {length:.3}"
                    ));
                }
                let turned = UnitQuaternion::new_normalize(quaternion).to_rotation_matrix();
                Ok(if *relative { on } else { Matrix3::identity() } * turned.matrix() * link.zero)
            }
            Turn::Points(ends) => self.between(link, ends, row, parent),
        }
    }

    /// The axes of a model segment from the points at its ends, in the axes of the source's world.
    fn between(
        &self,
        link: &Link,
        ends: &Ends,
        row: usize,
        parent: Option<&Matrix3<f64>>,
    ) -> core::result::Result<Matrix3<f64>, String> {
        let at = |points: &[[usize; 3]]| self.world * self.point(row, points);
        let along = at(&ends.to) - at(&ends.from);
        if along.norm() < NO_WAY {
            return Err("its two points coincide".to_owned());
        }
        let left = match (&ends.left, parent) {
            (Some([right, left]), _) => at(left) - at(right),
            (None, Some(parent)) => (self.world * parent).column(0).into_owned(),
            (None, None) => return Err("expected left: two points across the body".to_owned()),
        };
        if left.norm() < NO_WAY || left.cross(&along).norm() < NO_ANGLE * left.norm() * along.norm()
        {
            return Err(
                "its long axis is parallel to its left direction, so its rotation is undefined"
                    .to_owned(),
            );
        }
        let along = along.normalize();
        // Direction of the far end: the toes are in front, the head is up, hands and knees are down.
        let (dorsal, cranial) = match link.segment {
            Some(Segment::LeftFoot | Segment::RightFoot) => (-along, (-along).cross(&left) * -1.0),
            Some(Segment::Pelvis | Segment::Abdomen | Segment::Thorax | Segment::Head) => {
                (along.cross(&left), along)
            }
            _ => ((-along).cross(&left), -along),
        };
        let (dorsal, cranial) = (dorsal.normalize(), cranial.normalize());
        let axes = Matrix3::from_columns(&[dorsal.cross(&cranial), dorsal, cranial]);
        Ok(self.world.transpose() * axes)
    }
}

impl Link {
    /// The columns that it needs.
    fn columns(&self) -> Vec<usize> {
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
fn links(table: &Table, mapping: &Mapping) -> Result<Vec<Link>> {
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
            let unit = match (mapping.angles.unit, table.in_degrees) {
                (Some(AngleUnit::Rad), _) | (None, Some(false)) => 1.0,
                _ => 1.0_f64.to_radians(),
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
            for (place, name) in columns.iter_mut().zip(named) {
                *place = table.column(name)?;
            }
            if mapping.quaternions.order == Order::Xyzw {
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
    let off = (written * written.transpose() - Matrix3::identity()).norm();
    if !(off < OFF_UNIT && written.determinant() > 0.0) {
        let message = format!(
            "expected the rows of a rotation matrix, found a matrix with an error of {off:.3}"
        );
        return Err(Problem::bad_input(message));
    }
    Ok(*Rotation3::from_matrix(&written).matrix())
}
