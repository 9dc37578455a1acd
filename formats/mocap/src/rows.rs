//! Orientations of segments from the rows of a table with angles, quaternions or points.

use std::collections::BTreeMap;

use bodyflight_core::{Segment, SegmentArray};
use nalgebra::{Matrix3, Quaternion, Rotation3, UnitQuaternion, Vector3};

use crate::alike;
use crate::links::{Ends, Link, Turn, links, unit};
use crate::mapping::Mapping;
use crate::marker_set::{Marker, Points, Rod};
use crate::mounting;
use crate::points::{self, Carried};
use crate::repair::Fault;
use crate::skeleton::SourceFrame;
use crate::slip::Slip;
use crate::table::Table;
use crate::timing::{self, Timing};
use bodyflight_io::diagnostic::{Problem, Result};

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
    /// Time of each row of the table (s).
    times: Vec<f64>,
    /// Length of one unit (m).
    unit_m: f64,
    /// Lengths of the segments that are given by points (m).
    pub lengths_m: Box<SegmentArray<Option<f64>>>,
    /// Faults of single points.
    pub faults: Vec<Fault>,
    /// Points that slipped.
    pub slips: Vec<Slip>,
    /// What contradicts itself in the rows, and what is only remarked.
    pub alike: Box<alike::Found>,
    /// Axes of each link in the previous frame, for links whose rotation about the long axis is carried on.
    carried: Vec<Option<Carried>>,
}

impl Rows {
    /// Finds the columns of a mapping, and repairs points. Returns the opened table, the timing of the complete rows,
    /// and the number of incomplete rows. `unit_m` gives the length of one unit (m) for a length of the left thigh in
    /// units of the file.
    ///
    /// # Errors
    /// Returns an error if a column is missing, a matrix is not a rotation, or the times are not evenly spaced.
    pub fn open(
        mut table: Table,
        mapping: &Mapping,
        unit_m: impl FnOnce(Option<f64>) -> Result<f64>,
    ) -> Result<(Self, Timing, usize)> {
        let mut links = links(&table, mapping)?;
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
        let unit_s = mapping.time.unit_s.unwrap_or(1.0);
        let rate = mapping.time.rate_hz.unwrap_or(1.0);
        let times: Vec<f64> = (0..table.rows())
            .map(|row| {
                time.map_or(row as f64 / rate, |column| {
                    unit_s * table.value(row, column)
                })
            })
            .collect();
        let lengths = lengths(&table, &links);
        let unit_m = unit_m(lengths[Segment::LeftThigh])?;
        let (faults, slips) = repaired(&mut table, &links, &times, unit_m);
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
            return Err(too_few(rows.len(), &faults));
        }
        let alike = alike::found(&table, &links, &rows, mapping);
        if let Some(first) = rows.first() {
            mounting::find(&table, *first, &mut links, mapping)?;
        }
        let timing = match time {
            Some(_) => {
                let times: Vec<f64> = rows.iter().map(|row| times[*row]).collect();
                timing::frames(&times).map_err(|uneven| {
                    Problem::bad_input(uneven.message)
                        .at_line(table.line(rows[uneven.row]))
                        .help("resample the table to an even rate")
                })?
            }
            None => Timing {
                rate,
                indices: rows.iter().map(|row| *row as u64).collect(),
            },
        };
        let opened = Self {
            table,
            rows,
            links,
            position,
            world: mapping.world.axes.0,
            times,
            unit_m,
            lengths_m: Box::new(lengths.map(|_, length| length.map(|length| length * unit_m))),
            faults,
            slips,
            alike: Box::new(alike),
            carried: Vec::new(),
        };
        Ok((opened, timing, skipped))
    }

    /// Length of one unit (m).
    pub fn unit_m(&self) -> f64 {
        self.unit_m
    }

    /// Time of the first complete row (s).
    pub fn first_s(&self) -> f64 {
        let row = self.rows.first().and_then(|row| self.times.get(*row));
        row.copied().unwrap_or(0.0)
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

    /// Line of a frame in the file, from 1.
    pub fn line(&self, place: usize) -> u64 {
        self.table.line(self.rows.get(place).copied().unwrap_or(0))
    }

    /// A frame, by its index among the complete rows; rotations that the source does not have continue those of the
    /// previous call.
    ///
    /// # Errors
    /// Returns an error if a quaternion is not of unit length or points do not define a direction.
    pub fn frame(&mut self, place: usize) -> Result<SourceFrame> {
        let row = self.rows.get(place).copied().unwrap_or(0);
        let mut placed: Vec<Matrix3<f64>> = Vec::with_capacity(self.links.len());
        let mut world_from_segment = SegmentArray::from_fn(|_| Matrix3::identity());
        self.carried.resize(self.links.len(), None);
        let mut carried = core::mem::take(&mut self.carried);
        for (link, carried) in self.links.iter().zip(&mut carried) {
            let parent = link.parent.and_then(|parent| placed.get(parent));
            let own = self.turned(link, row, parent, carried).map_err(|message| {
                Problem::bad_input(message)
                    .at_line(self.table.line(row))
                    .at(format!("segments.{}", link.name))
            })?;
            if let Some(segment) = link.segment {
                world_from_segment[segment] = own;
            }
            placed.push(own);
        }
        self.carried = carried;
        Ok(SourceFrame {
            world_from_segment,
            position: self.place(row, &world_from_segment),
        })
    }

    /// The midpoint of the hips (m), in the axes of the source's world.
    fn place(
        &self,
        row: usize,
        world_from_segment: &SegmentArray<Matrix3<f64>>,
    ) -> Option<Vector3<f64>> {
        let unit_m = self.unit_m;
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
        middle(&self.table, row, points)
    }

    /// The rotation from the axes of a link to those of the world.
    fn turned(
        &self,
        link: &Link,
        row: usize,
        parent: Option<&Matrix3<f64>>,
        carried: &mut Option<Carried>,
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
                let turned = unit(&Quaternion::new(w, x, y, z))?.to_rotation_matrix();
                Ok(if *relative { on } else { Matrix3::identity() } * turned.matrix() * link.zero)
            }
            Turn::Points(ends) => self.between(link, ends, row, parent, carried),
        }
    }

    /// The axes of a model segment from the points at its ends, in the axes of the source's world.
    fn between(
        &self,
        link: &Link,
        ends: &Ends,
        row: usize,
        parent: Option<&Matrix3<f64>>,
        carried: &mut Option<Carried>,
    ) -> core::result::Result<Matrix3<f64>, String> {
        let at = |points: &[[usize; 3]]| self.world * self.point(row, points);
        let inertial = |parent: &Matrix3<f64>| {
            let turned = Rotation3::from_matrix_unchecked(self.world * parent);
            UnitQuaternion::from_rotation_matrix(&turned)
        };
        let parent = parent.map(inertial);
        let time = self.times.get(row).copied().unwrap_or(0.0);
        let left = ends.left.as_ref().map(|[right, left]| at(left) - at(right));
        let own = points::axes(
            link.segment,
            &(at(&ends.to) - at(&ends.from)),
            left,
            parent.as_ref(),
            (*carried, time),
        )?;
        let parent_from_own = parent.map_or(own, |parent| parent.inverse() * own);
        *carried = Some(Carried {
            time,
            parent_from_own,
        });
        Ok(self.world.transpose() * own.to_rotation_matrix().matrix())
    }
}

/// The error for a table without two complete rows; the first fault of its points may explain it.
fn too_few(found: usize, faults: &[Fault]) -> Problem {
    let problem = Problem::bad_input(format!(
        "expected at least 2 rows with a value in every mapped column, found {found}"
    ));
    match faults.first() {
        Some(first) => problem.help(first.to_string()),
        None => problem,
    }
}

/// Lengths of the segments that are given by points (units of the file): the medians over all rows.
fn lengths(table: &Table, links: &[Link]) -> SegmentArray<Option<f64>> {
    let mut all = SegmentArray::from_fn(|_| None);
    for link in links {
        let (Turn::Points(ends), Some(segment)) = (&link.turn, link.segment) else {
            continue;
        };
        let length =
            |row: usize| (middle(table, row, &ends.to) - middle(table, row, &ends.from)).norm();
        let lengths = (0..table.rows()).map(length);
        let mut lengths: Vec<f64> = lengths.filter(|length| *length > 0.0).collect();
        lengths.sort_by(f64::total_cmp);
        all[segment] = lengths.get(lengths.len() / 2).copied();
    }
    all
}

/// Repairs the points of all links.
fn repaired(
    table: &mut Table,
    links: &[Link],
    times: &[f64],
    unit_m: f64,
) -> (Vec<Fault>, Vec<Slip>) {
    let mut markers: Vec<Marker> = Vec::new();
    let mut index = |columns: &[usize; 3]| {
        let known = markers.iter().position(|marker| marker.columns == *columns);
        known.unwrap_or_else(|| {
            let name = table.columns[columns[0]].trim_end_matches(".x").to_owned();
            markers.push(Marker {
                name,
                columns: *columns,
            });
            markers.len() - 1
        })
    };
    let mut rods = Vec::new();
    for link in links {
        let Turn::Points(ends) = &link.turn else {
            continue;
        };
        let mut all = |points: &[[usize; 3]]| points.iter().map(&mut index).collect::<Vec<_>>();
        let ends_of = [all(&ends.from), all(&ends.to)];
        let left = (ends.left.as_ref()).map(|[right, left]| [all(right), all(left)]);
        let trunk = [
            Segment::Pelvis,
            Segment::Abdomen,
            Segment::Thorax,
            Segment::Head,
        ];
        rods.push(Rod {
            segment: link.name.clone(),
            ends: ends_of,
            rigid: link
                .segment
                .is_some_and(|segment| !trunk.contains(&segment)),
            parent: link.parent,
            left,
        });
    }
    let points = Points {
        table,
        markers,
        rods,
        times: times.to_vec(),
        unit_m,
        dropped: BTreeMap::new(),
    };
    points.repair()
}

/// The midpoint of points (units of the file).
fn middle(table: &Table, row: usize, points: &[[usize; 3]]) -> Vector3<f64> {
    let sum = points.iter().fold(Vector3::zeros(), |sum, columns| {
        sum + Vector3::from(columns.map(|column| table.value(row, column)))
    });
    sum / points.len().max(1) as f64
}
