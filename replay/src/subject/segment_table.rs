//! `segments.json`: segment values that replace the computed ones, in the format of a full segment table.

use std::path::Path;

use bodyflight_core::body::solid::is_possible_inertia;
use bodyflight_core::{Body, Segment};
use nalgebra::{Matrix3, Vector3};
use serde::Deserialize;

use bodyflight_io::diagnostic::choices::choices;
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::input;

/// Largest difference (logarithm of the ratio) between a table and the measurements of the person, whose equipment a table
/// may describe in more detail.
const MASS_APART: f64 = 0.15;
const HEIGHT_APART: f64 = 0.05;

/// A table read from a file: any segments, with any of their values.
#[derive(Debug, Clone)]
pub(super) struct SegmentTable {
    rows: Vec<(Segment, Row)>,
    height: Option<f64>,
    text: String,
}

#[derive(Deserialize)]
struct TableFile {
    height: Option<f64>,
    segments: Vec<Row>,
}

/// Values in SI units and segment axes; those that are absent keep their computed values.
#[derive(Debug, Clone, Deserialize)]
struct Row {
    name: String,
    mass: Option<f64>,
    length: Option<f64>,
    joint_offset: Option<[f64; 3]>,
    cg: Option<[f64; 3]>,
    inertia: Option<[[f64; 3]; 3]>,
    area: Option<[f64; 3]>,
    moment_arm: Option<f64>,
}

impl SegmentTable {
    pub(super) fn read(path: &Path) -> Result<Self> {
        let text = input::text(path)?;
        Self::parse(text, path)
    }

    pub(super) fn parse(text: String, path: &Path) -> Result<Self> {
        let file: TableFile = serde_json::from_str(&text).map_err(|error| {
            Problem::bad_input(error.to_string())
                .in_file(path)
                .at_line(error.line() as u64)
                .help("docs/subject.md describes the format under segments.json")
        })?;
        let fault =
            |place: String, message: String| Problem::bad_input(message).in_file(path).at(place);
        if let Some(height) = file.height
            && !(height > 0.0 && height < 3.0)
        {
            return Err(fault(
                "height".into(),
                format!("expected up to 3 m, found {height}"),
            ));
        }
        let mut rows: Vec<(Segment, Row)> = Vec::new();
        for row in file.segments {
            let segment = Segment::from_name(&row.name).ok_or_else(|| {
                let known = choices(&row.name, Segment::ALL.map(Segment::name));
                fault(
                    format!("segment {}", row.name),
                    format!("unknown name; {known}"),
                )
            })?;
            if rows.iter().any(|(known, _)| *known == segment) {
                return Err(fault(
                    format!("segment {}", row.name),
                    "listed twice".into(),
                ));
            }
            row.check().map_err(|(field, message)| {
                fault(format!("segment {}, field {field}", row.name), message)
            })?;
            rows.push((segment, row));
        }
        Ok(Self {
            rows,
            height: file.height,
            text,
        })
    }

    pub(super) fn text(&self) -> &str {
        &self.text
    }

    /// Replaces the values that the table lists. If they make another person than the measurements of the subject, it
    /// returns the measurement and what differs.
    pub(super) fn apply(&self, body: &mut Body<f64>) -> core::result::Result<(), (String, String)> {
        let measured = *body;
        self.replace(body);
        let apart = |a: f64, b: f64| (a / b).ln().abs();
        let [expected, found] = [measured.mass(), body.mass()];
        if apart(expected, found) > MASS_APART {
            return Err((
                "mass_kg".to_owned(),
                format!(
                    "the segments of the table weigh {found:.1} kg together, the person with equipment {expected:.1} kg; correct one of them"
                ),
            ));
        }
        let [expected, found] = [measured.height, body.height];
        if apart(expected, found) > HEIGHT_APART {
            return Err((
                "height_m".to_owned(),
                format!(
                    "the table is of a person of {found:.3} m, the subject has {expected:.3} m; correct one of them"
                ),
            ));
        }
        Ok(())
    }

    fn replace(&self, body: &mut Body<f64>) {
        if let Some(height) = self.height {
            body.height = height;
        }
        for (segment, row) in &self.rows {
            let values = &mut body.segments[*segment];
            let set = |value: Option<f64>, target: &mut f64| *target = value.unwrap_or(*target);
            set(row.mass, &mut values.mass);
            set(row.length, &mut values.length);
            // A table in the reference format has a length but no moment arm: the arm is the length.
            set(row.moment_arm.or(row.length), &mut values.moment_arm);
            let set = |value: Option<[f64; 3]>, target: &mut Vector3<f64>| {
                *target = value.map_or(*target, Vector3::from);
            };
            set(row.joint_offset, &mut values.joint_offset);
            set(row.cg, &mut values.cg);
            set(row.area, &mut values.area);
            if let Some(inertia) = row.inertia {
                values.inertia = Matrix3::from_row_slice(inertia.as_flattened());
            }
        }
    }
}

impl Row {
    fn check(&self) -> core::result::Result<(), (&'static str, String)> {
        let positive = |field, value: Option<f64>, high: f64| match value {
            Some(value) if !(value > 0.0 && value <= high) => Err((
                field,
                format!("expected above 0 and up to {high}, found {value}"),
            )),
            _ => Ok(()),
        };
        positive("mass", self.mass, 200.0)?;
        positive("length", self.length, 2.0)?;
        positive("moment_arm", self.moment_arm, 10.0)?;
        for (field, vector) in [("joint_offset", self.joint_offset), ("cg", self.cg)] {
            if vector.is_some_and(|v| !v.iter().all(|c| c.abs() <= 2.0)) {
                return Err((
                    field,
                    format!("expected three numbers within 2 m, found {vector:?}"),
                ));
            }
        }
        if self
            .area
            .is_some_and(|v| !v.iter().all(|&a| (0.0..=4.0).contains(&a)))
        {
            return Err((
                "area",
                format!("expected three areas of 0 to 4 m2, found {:?}", self.area),
            ));
        }
        if let Some(inertia) = self.inertia
            && !is_possible_inertia(&Matrix3::from_row_slice(inertia.as_flattened()))
        {
            let message = "expected the inertia of a solid, a symmetric matrix: positive, with no principal \
                           moment above the sum of the other two";
            return Err(("inertia", format!("{message}; found {inertia:?}")));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::subject::Subject;

    #[test]
    fn a_table_of_another_person_is_refused() {
        let person = |table: &str| {
            let subject =
                "height_m = 1.75\nmass_kg = 75\nsex = \"male\"\nsegments = \"segments.json\"";
            Subject::parse_with_table(subject, table, Path::new("subject.toml"))
        };
        let heavy = r#"{"segments": [{"name": "thorax", "mass": 40.0}]}"#;
        let tall = r#"{"height": 1.9, "segments": []}"#;
        for (table, field, words) in [
            (heavy, "mass_kg", "weigh 10"),
            (tall, "height_m", "of a person of 1.900 m"),
        ] {
            let problem = person(table).expect_err(field).to_string();
            assert!(
                problem.contains(field) && problem.contains(words),
                "{problem}"
            );
        }
        assert!(person(r#"{"height": 1.76, "segments": []}"#).is_ok());
    }

    fn parse(rows: &str) -> Result<SegmentTable> {
        SegmentTable::parse(
            format!("{{\"segments\": [{rows}]}}"),
            Path::new("segments.json"),
        )
    }

    #[test]
    fn a_row_replaces_what_it_lists_and_nothing_else() {
        let before = Subject::default().body();
        let mut after = before;
        parse("{\"name\": \"head\", \"mass\": 7.5, \"area\": [0.05, 0.04, 0.03]}")
            .unwrap()
            .apply(&mut after)
            .unwrap();
        let (old, new) = (
            &before.segments[Segment::Head],
            &after.segments[Segment::Head],
        );
        assert!((new.mass - 7.5).abs() < 1e-12 && new.area == Vector3::new(0.05, 0.04, 0.03));
        assert_eq!((new.cg, new.inertia), (old.cg, old.inertia));
        assert_eq!(
            after.segments[Segment::Thorax],
            before.segments[Segment::Thorax]
        );
    }

    #[test]
    fn faults_are_named_by_segment_and_field() {
        for (rows, parts) in [
            ("{\"name\": \"tail\"}", ["segment tail", "r_foot"]),
            (
                "{\"name\": \"head\", \"mass\": -1}",
                ["segment head, field mass", "-1"],
            ),
            (
                "{\"name\": \"head\", \"cg\": [0, 0]}",
                ["segments.json:1", "length 3"],
            ),
            (
                "{\"name\": \"head\", \"area\": [0, -1, 0]}",
                ["field area", "-1"],
            ),
            (
                "{\"name\": \"head\", \"inertia\": [[1,2,0],[0,1,0],[0,0,1]]}",
                ["field inertia", "symmetric"],
            ),
            (
                "{\"name\": \"head\"}, {\"name\": \"head\"}",
                ["segment head", "twice"],
            ),
            ("{", ["segments.json:1", "column"]),
        ] {
            let problem = parse(rows).unwrap_err().to_string();
            for part in parts {
                assert!(problem.contains(part), "{rows} -> {problem} lacks {part}");
            }
        }
    }
}
