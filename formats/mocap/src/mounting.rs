//! How sensors lie on their segments, found from the first row, in which the person stands in the rest posture.

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

use crate::axes::BodyAxes;
use crate::links::{Link, Turn};
use crate::mapping::{Mapping, Mounting};
use crate::table::Table;
use bodyflight_io::diagnostic::{Problem, Result};

/// Smallest share of the forward axis of the pelvis' sensor that is horizontal: below it, no heading follows from it.
const HORIZONTAL: f64 = 0.5;

/// Turns the axes of sensors to those of their segments, if the mapping leaves the mounting to the first row.
///
/// # Errors
/// Returns an error if the sensor of the pelvis does not show where the person faces.
pub(crate) fn find(table: &Table, row: usize, links: &mut [Link], mapping: &Mapping) -> Result<()> {
    if mapping.quaternions.mounting != Mounting::FirstRow {
        return Ok(());
    }
    let turned = |columns: &[usize; 4]| {
        let [w, x, y, z] = columns.map(|column| table.value(row, column));
        UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z))
    };
    let at_pelvis = links.iter().find_map(|link| match &link.turn {
        Turn::Quaternion(columns, _) if link.name == "pelvis" => Some(turned(columns)),
        _ => None,
    });
    let axis = mapping.quaternions.forward.as_ref().map(|axis| axis.0);
    let (Some(pelvis), Some(axis)) = (at_pelvis, axis) else {
        return Err(Problem::bad_input("expected forward, the axis of the pelvis' sensor that points forwards in the first row")
            .at("quaternions")
            .help("forward = \"z\", or \"-x\" and so on"));
    };
    let up = mapping.world.axes.0.transpose() * Vector3::z();
    let ahead = pelvis * axis;
    let flat = ahead - up * ahead.dot(&up);
    if flat.norm() < HORIZONTAL {
        let message = format!(
            "in the first row, the axis of the pelvis' sensor that points forwards is {:.0} degrees off the horizontal",
            ahead.dot(&up).clamp(-1.0, 1.0).asin().to_degrees().abs()
        );
        return Err(Problem::bad_input(message)
            .at("quaternions.forward")
            .help("name another axis of that sensor, or the world's vertical with [world] axes"));
    }
    let back = -flat.normalize();
    let world_from_body = Matrix3::from_columns(&[back.cross(&up), back, up]);
    let common = mapping.body.axes.unwrap_or(BodyAxes(Matrix3::identity()));
    for link in links {
        if let Turn::Quaternion(columns, _) = &link.turn {
            let own = mapping.segments.get(&link.name).and_then(|row| row.axes);
            let still = world_from_body * own.unwrap_or(common).0;
            link.zero = turned(columns).inverse().to_rotation_matrix().matrix() * still;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use bodyflight_core::Segment;

    use super::*;
    use crate::rows::Rows;
    use crate::skeleton::Skeleton;

    /// Sensors turned anyhow on a person who faces any direction, then bends the left knee by a radian.
    #[test]
    fn sensors_mounted_anyhow_give_the_posture() {
        let mut text = "kind = \"quaternions\"\n[world]\naxes = [\"north\", \"west\", \"up\"]\n[body]\naxes = [\"forward\", \"left\", \"up\"]\n\
            rest = \"h-pose\"\n[time]\nrate_hz = 100\n[quaternions]\nmounting = \"first-row\"\nforward = \"-z\"\n"
            .to_owned();
        let heading = UnitQuaternion::from_scaled_axis(Vector3::z() * 2.1);
        // The pelvis' sensor: x down, y right, z back.
        let on_pelvis =
            UnitQuaternion::from_scaled_axis(Vector3::y() * -core::f64::consts::FRAC_PI_2);
        let (mut columns, mut still, mut bent) = (Vec::new(), Vec::new(), Vec::new());
        for (k, segment) in Segment::ALL.into_iter().enumerate() {
            let name = segment.name();
            text.push_str(&format!("[segments.{name}]\ncolumns = [\"{name}\"]\n"));
            columns.extend(["w", "x", "y", "z"].map(|part| format!("{name}.{part}")));
            let mounted = match segment {
                Segment::Pelvis => on_pelvis,
                _ => UnitQuaternion::from_scaled_axis(Vector3::new(0.3, k as f64, -0.7)),
            };
            let knee = UnitQuaternion::from_scaled_axis(Vector3::y());
            let turned = [Segment::LeftShank, Segment::LeftFoot].contains(&segment);
            let moved = if turned { heading * knee } else { heading };
            for (row, turn) in [
                (&mut still, heading * mounted),
                (&mut bent, moved * mounted),
            ] {
                row.extend([turn.w, turn.i, turn.j, turn.k]);
            }
        }
        let mapping = Mapping::parse(&text, Path::new("m.toml")).unwrap();
        let table = || {
            Table::of_rows(columns.clone(), vec![(1, still.clone()), (2, bent.clone())]).unwrap()
        };
        let (mut rows, ..) = Rows::open(table(), &mapping, |_| Ok(1.0)).unwrap();
        let skeleton = Skeleton::new(&mapping).unwrap();
        for (place, expected) in [(0, 0.0), (1, 1.0)] {
            let frame = rows.frame(place).unwrap();
            let (attitude, posture) = skeleton.posture(&frame.world_from_segment);
            let ahead = attitude.quaternion() * -Vector3::y();
            assert!((ahead - heading * Vector3::x()).norm() < 1e-9, "{ahead}");
            for segment in Segment::ALL {
                let angle = posture.parent_from_segment(segment).angle();
                let is_knee = segment == Segment::LeftShank;
                assert!(
                    (angle - if is_knee { expected } else { 0.0 }).abs() < 1e-7,
                    "{segment:?}: {angle}"
                );
            }
            // Heels go back when knees bend.
            let down = posture.parent_from_segment(Segment::LeftShank) * -Vector3::z();
            assert!(place == 0 || down.y > 0.8, "{down}");
        }
        let up = Mapping::parse(&text.replace("\"-z\"", "\"x\""), Path::new("m.toml")).unwrap();
        let said = Rows::open(table(), &up, |_| Ok(1.0))
            .err()
            .unwrap()
            .to_string();
        assert!(said.contains("90 degrees off the horizontal"), "{said}");
        let silent = text.replace("forward = \"-z\"\n", "");
        assert!(
            Mapping::parse(&silent, Path::new("m.toml"))
                .unwrap_err()
                .to_string()
                .contains("forward")
        );
    }
}
