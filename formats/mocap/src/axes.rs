//! The directions of a source's axes, by name.

use bodyflight_io::diagnostic::choices::choices;
use nalgebra::Matrix3;
use serde::Deserialize;

/// Names of the directions on earth, as north, west, up.
const WORLD: [(&str, [f64; 3]); 6] = [
    ("north", [1.0, 0.0, 0.0]),
    ("south", [-1.0, 0.0, 0.0]),
    ("west", [0.0, 1.0, 0.0]),
    ("east", [0.0, -1.0, 0.0]),
    ("up", [0.0, 0.0, 1.0]),
    ("down", [0.0, 0.0, -1.0]),
];

/// Names of the directions of a standing person in body axes: left, dorsal, cranial.
const BODY: [(&str, [f64; 3]); 6] = [
    ("left", [1.0, 0.0, 0.0]),
    ("right", [-1.0, 0.0, 0.0]),
    ("back", [0.0, 1.0, 0.0]),
    ("forward", [0.0, -1.0, 0.0]),
    ("up", [0.0, 0.0, 1.0]),
    ("down", [0.0, 0.0, -1.0]),
];

/// The directions of the source's X, Y and Z on earth: the rotation from source axes to inertial axes.
///
/// The source's axes may be left-handed if the body axes of the source are too.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(try_from = "[String; 3]")]
pub struct WorldAxes(pub Matrix3<f64>);

/// The directions of a segment's X, Y and Z while the person stands in the rest posture: the rotation from segment axes
/// to body axes.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(try_from = "[String; 3]")]
pub struct BodyAxes(pub Matrix3<f64>);

impl TryFrom<[String; 3]> for WorldAxes {
    type Error = String;
    fn try_from(names: [String; 3]) -> Result<Self, String> {
        matrix(&names, &WORLD).map(Self)
    }
}

impl TryFrom<[String; 3]> for BodyAxes {
    type Error = String;
    fn try_from(names: [String; 3]) -> Result<Self, String> {
        matrix(&names, &BODY).map(Self)
    }
}

fn matrix(names: &[String; 3], known: &[(&str, [f64; 3])]) -> Result<Matrix3<f64>, String> {
    let mut axes = Matrix3::zeros();
    for (name, mut axis) in names.iter().zip(axes.column_iter_mut()) {
        let Some((_, direction)) = known.iter().find(|(direction, _)| direction == name) else {
            let known = choices(name, known.iter().map(|(direction, _)| *direction));
            return Err(format!("unknown direction \"{name}\"; {known}"));
        };
        axis.copy_from_slice(direction);
    }
    if axes.determinant().abs() < 0.5 {
        return Err(format!(
            "expected three directions at right angles, found {}",
            names.join(", ")
        ));
    }
    Ok(axes)
}

/// Whether the axes are right-handed.
pub fn is_right_handed(axes: &Matrix3<f64>) -> bool {
    axes.determinant() > 0.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    fn names(names: [&str; 3]) -> [String; 3] {
        names.map(str::to_owned)
    }

    #[test]
    fn columns_are_the_directions_in_the_order_of_the_names() {
        let axes = WorldAxes::try_from(names(["west", "up", "north"])).unwrap();
        assert_eq!(axes.0 * Vector3::y(), Vector3::z());
        assert!(is_right_handed(&axes.0));
        let unity = BodyAxes::try_from(names(["right", "up", "forward"])).unwrap();
        assert!(!is_right_handed(&unity.0));
    }

    #[test]
    fn invalid_axes_are_refused_with_a_reason() {
        let unknown = BodyAxes::try_from(names(["left", "north", "up"])).unwrap_err();
        assert!(
            unknown.contains("\"north\"") && unknown.contains("forward"),
            "{unknown}"
        );
        let flat = WorldAxes::try_from(names(["east", "west", "up"])).unwrap_err();
        assert!(flat.contains("right angles"), "{flat}");
    }
}
