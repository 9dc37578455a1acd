//! The mapping file: the directions of a source's axes, and the names of its segments. `docs/import.md` lists the
//! fields.

use std::collections::BTreeMap;
use std::path::Path;

use bodyflight_core::Segment;
use nalgebra::Vector3;
use serde::Deserialize;

use crate::axes::{BodyAxes, WorldAxes, is_right_handed};
use crate::conflicts;
pub use crate::row::{Kind, Point, Row};
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::file_kind::FileKind;
use bodyflight_io::input;

/// The posture for which the directions of the segment axes are given.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Rest {
    /// Standing, arms down, palms forward.
    HPose,
    /// Standing, arms out to the sides, palms down.
    TPose,
    /// The bones of the file with all rotations zero.
    Bones,
}

/// A mapping as written in the file.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mapping {
    /// Kind of source.
    pub kind: Kind,
    /// Directions of the source's axes on earth.
    pub world: World,
    /// Directions of its segment axes.
    #[serde(default)]
    pub body: BodyTable,
    /// Times of the rows of a table.
    #[serde(default)]
    pub time: Time,
    /// Format of angles.
    #[serde(default)]
    pub angles: Angles,
    /// Format of quaternions.
    #[serde(default)]
    pub quaternions: Quaternions,
    /// Columns with the position of the pelvis.
    pub position: Option<Position>,
    /// Segments of the model, and links between them that only the source has.
    pub segments: BTreeMap<String, Row>,
}

/// Axes and unit of positions.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct World {
    /// Directions of X, Y and Z.
    pub axes: WorldAxes,
    /// Length of one unit (m).
    pub unit_m: Option<f64>,
}

/// Axes of the segments.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BodyTable {
    /// Directions of X, Y and Z of every segment in the rest posture.
    pub axes: Option<BodyAxes>,
    /// The rest posture.
    pub rest: Option<Rest>,
}

/// Times of the rows.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Time {
    /// Column that holds the times.
    pub column: Option<String>,
    /// Length of one unit of time (s).
    pub unit_s: Option<f64>,
    /// Rows per second, if no column holds the times.
    pub rate_hz: Option<f64>,
}

/// Format of angles.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Angles {
    /// `deg` or `rad`.
    pub unit: Option<AngleUnit>,
}

/// Unit of angles.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum AngleUnit {
    /// Degrees.
    Deg,
    /// Radians.
    Rad,
}

/// Format of quaternions.
#[derive(Debug, Clone, Copy, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Quaternions {
    /// Order of the components.
    #[serde(default)]
    pub order: Order,
    /// Axes that they rotate into.
    #[serde(default)]
    pub relative_to: RelativeTo,
    /// How sensors lie on their segments.
    #[serde(default)]
    pub mounting: Mounting,
    /// The axis of the pelvis' sensor that points forwards in the first row.
    pub forward: Option<SensorAxis>,
}

/// How sensors lie on their segments.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Mounting {
    /// Along the axes of the segments.
    #[default]
    Known,
    /// Anyhow: in the first row, the person stands in the rest posture.
    FirstRow,
}

/// An axis of a sensor, such as `z` or `-x`.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(try_from = "String")]
pub struct SensorAxis(pub Vector3<f64>);

impl TryFrom<String> for SensorAxis {
    type Error = String;
    fn try_from(name: String) -> core::result::Result<Self, String> {
        let (sign, letter) = match name.strip_prefix('-') {
            Some(letter) => (-1.0, letter),
            None => (1.0, name.as_str()),
        };
        let place = ["x", "y", "z"].iter().position(|axis| *axis == letter);
        let place =
            place.ok_or_else(|| format!("expected x, y, z or one with -, found \"{name}\""))?;
        let mut axis = Vector3::zeros();
        axis[place] = sign;
        Ok(Self(axis))
    }
}

/// Order of the components of a quaternion.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Order {
    /// Scalar first.
    #[default]
    Wxyz,
    /// Scalar last.
    Xyzw,
}

/// The axes that a quaternion rotates into.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum RelativeTo {
    /// Axes of the source's world.
    #[default]
    World,
    /// Axes of the parent.
    Parent,
}

/// Position of the pelvis.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Position {
    /// Columns of X, Y and Z.
    pub columns: [String; 3],
    /// Offset from there to the midpoint of the hips, in the axes of the source's pelvis (m).
    #[serde(default)]
    pub offset_m: [f64; 3],
}

impl Mapping {
    /// The mapping of a system: names of the axes of its world and of its segments, its rest posture, and its segments.
    ///
    /// # Errors
    /// Returns an error if names of axes are not three directions at right angles.
    pub(crate) fn of_system(
        kind: Kind,
        world: [&str; 3],
        (body, rest): ([&str; 3], Rest),
        segments: BTreeMap<String, Row>,
    ) -> Result<Self> {
        let names = |axes: [&str; 3]| axes.map(str::to_owned);
        Ok(Self {
            kind,
            world: World {
                axes: WorldAxes::try_from(names(world)).map_err(Problem::bad_input)?,
                unit_m: None,
            },
            body: BodyTable {
                axes: Some(BodyAxes::try_from(names(body)).map_err(Problem::bad_input)?),
                rest: Some(rest),
            },
            time: Time::default(),
            angles: Angles::default(),
            quaternions: Quaternions::default(),
            position: None,
            segments,
        })
    }

    /// Reads a mapping.
    ///
    /// # Errors
    /// Returns an error if the file cannot be read or is not a valid mapping.
    pub fn read(path: &Path) -> Result<Self> {
        let text = input::settings(path, FileKind::Mapping)?;
        Self::parse(&text, path)
    }

    /// Like [`Mapping::read`], for text already read from `path`.
    ///
    /// # Errors
    /// Returns an error if it is not a valid mapping.
    pub fn parse(text: &str, path: &Path) -> Result<Self> {
        let mapping: Self =
            toml::from_str(text).map_err(|error| Problem::toml(&error, text, path))?;
        mapping
            .check()
            .map_err(|problem| problem.in_file(path).on_its_line(text))?;
        Ok(mapping)
    }

    fn check(&self) -> Result<()> {
        let own = (self.segments.iter())
            .filter_map(|(name, row)| Some((format!("segments.{name}.axes"), row.axes?)));
        let common = self.body.axes.map(|axes| ("body.axes".to_owned(), axes));
        for (name, axes) in own.chain(common) {
            if is_right_handed(&axes.0) != is_right_handed(&self.world.axes.0) {
                let message = "these axes and those of the world differ in handedness: an axis points the wrong way";
                return Err(Problem::bad_input(message)
                    .at(name)
                    .help("turn one axis of one of them round, such as left for right"));
            }
        }
        let positive = |what: &str, value: Option<f64>| match value {
            Some(value) if !(value.is_finite() && value > 0.0) => {
                let message = format!("expected a number above 0, found {value}");
                Err(Problem::bad_input(message).at(what))
            }
            _ => Ok(()),
        };
        positive("world.unit_m", self.world.unit_m)?;
        positive("time.unit_s", self.time.unit_s)?;
        positive("time.rate_hz", self.time.rate_hz)?;
        if self.kind != Kind::Bvh {
            if self.time.column.is_some() == self.time.rate_hz.is_some() {
                let message = "expected either a column of times or a rate";
                return Err(Problem::bad_input(message)
                    .at("time")
                    .help("[time] column = \"time_s\", or rate_hz = 100"));
            }
            let known = matches!(self.body.rest, Some(Rest::HPose | Rest::TPose));
            if self.kind != Kind::Points && !known {
                let message = "the field rest is missing: it names the posture in which the axes point this way";
                return Err(Problem::bad_input(message)
                    .at("body")
                    .help("rest = \"t-pose\" or \"h-pose\""));
            }
        }
        if self.kind != Kind::Points && self.body.axes.is_none() {
            let message = "the field axes is missing: it says where X, Y and Z of segments point in the rest posture";
            return Err(Problem::bad_input(message)
                .at("body")
                .help("axes = [\"left\", \"up\", \"forward\"]"));
        }
        let of_first_row = self.quaternions.mounting == Mounting::FirstRow;
        if of_first_row
            && (self.quaternions.forward.is_none()
                || self.quaternions.relative_to == RelativeTo::Parent)
        {
            let message = "mounting = \"first-row\" needs forward, the axis of the pelvis' sensor that points forwards, and quaternions relative to the world";
            return Err(Problem::bad_input(message)
                .at("quaternions")
                .help("forward = \"z\", or \"-x\" and so on"));
        }
        self.check_rows()?;
        let position = self.position.as_ref().map(|position| &position.columns);
        conflicts::check(self.kind, position, &self.segments)
    }

    fn check_rows(&self) -> Result<()> {
        for (name, row) in &self.segments {
            let is_link = self
                .segments
                .values()
                .any(|other| other.parent.as_ref() == Some(name));
            if Segment::from_name(name).is_none() && !is_link {
                let known = Segment::ALL.map(Segment::name).join(", ");
                return Err(Problem::bad_input(
                    "neither a segment of the model nor the parent of one",
                )
                .at(format!("segments.{name}"))
                .help(format!("segments: {known}")));
            }
            let problem =
                |message: String| Err(Problem::bad_input(message).at(format!("segments.{name}")));
            if let Some(parent) = &row.parent
                && !self.segments.contains_key(parent)
            {
                return problem(format!("its parent \"{parent}\" is not among the segments"));
            }
            let columns = row.columns.as_ref().map_or(0, Vec::len);
            match self.kind {
                Kind::Bvh if row.joint.is_none() => {
                    return problem("expected joint = \"its name in the file\"".into());
                }
                Kind::Angles => {
                    let rotations = row.rotations.as_deref().unwrap_or("");
                    if rotations.chars().any(|axis| !"xyz".contains(axis)) {
                        return problem(format!(
                            "expected rotations about x, y and z, found \"{rotations}\""
                        ));
                    }
                    if rotations.len() != columns {
                        return problem(format!(
                            "expected a column for each of its {} rotations, found {columns}",
                            rotations.len()
                        ));
                    }
                }
                Kind::Quaternions if columns != 4 && columns != 1 => {
                    return problem(format!(
                        "expected the four columns of its quaternion, or the one name that they share, found {columns}"
                    ));
                }
                Kind::Points if row.from.is_none() || row.to.is_none() => {
                    return problem("expected both from and to, the points at its ends".into());
                }
                _ => {}
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ANGLES: &str = "kind = \"angles\"\n[world]\naxes = [\"east\", \"north\", \"up\"]\n[body]\naxes = [\"right\", \"forward\", \"up\"]\n\
        rest = \"h-pose\"\n[time]\nrate_hz = 200\n[segments.pelvis]\nrotations = \"xz\"\ncolumns = [\"a\", \"-b\"]\n";

    #[test]
    fn impossible_values_are_named_with_their_place() {
        assert!(Mapping::parse(ANGLES, Path::new("m.toml")).is_ok());
        for (text, parts) in [
            (
                ANGLES.replace("\"up\"]", "\"down\"]"),
                ["m.toml:5: body.axes", "handedness"].as_slice(),
            ),
            (
                ANGLES.replace("east", "sunrise"),
                &["m.toml:3", "sunrise", "west"],
            ),
            (
                ANGLES.replace("rate_hz = 200", "rate_hz = 0"),
                &["m.toml:8: time.rate_hz", "found 0"],
            ),
            (
                ANGLES.replace("rate_hz = 200", ""),
                &["m.toml:7: time", "either"],
            ),
            (
                ANGLES.replace("rest = \"h-pose\"", ""),
                &["m.toml:4: body", "posture"],
            ),
            (
                ANGLES.replace("\"xz\"", "\"xyz\""),
                &["m.toml:9: segments.pelvis", "3 rotations, found 2"],
            ),
            (
                ANGLES.replace("\"xz\"", "\"xq\""),
                &["segments.pelvis", "\"xq\""],
            ),
            (
                ANGLES.replace("segments.pelvis", "segments.tail"),
                &["m.toml:9: segments.tail", "neither"],
            ),
            (
                ANGLES.replace("rotations =", "parent = \"hull\"\nrotations ="),
                &["segments.pelvis", "\"hull\""],
            ),
            (
                ANGLES.replace("kind = \"angles\"", "kind = \"quaternions\""),
                &["segments.pelvis", "found 2"],
            ),
            (ANGLES.replace("[time]", "[tempo]"), &["m.toml:7", "tempo"]),
        ] {
            // Only the last list of axes belongs to the body.
            let text = if parts[1] == "handedness" {
                ANGLES.replace("\"forward\", \"up\"]", "\"forward\", \"down\"]")
            } else {
                text
            };
            let problem = Mapping::parse(&text, Path::new("m.toml"))
                .unwrap_err()
                .to_string();
            for part in parts {
                assert!(problem.contains(part), "{text}\n-> {problem}\nlacks {part}");
            }
        }
    }
}
