//! OpenSense's files of sensor orientations: OpenSim's quaternions with a column for each sensor, named after the bone
//! of OpenSim's model that it lies on.

use std::collections::BTreeMap;

use crate::mapping::{Kind, Mapping, Mounting, Rest, Row, SensorAxis};
use crate::table::Table;
use bodyflight_io::diagnostic::{Problem, Result};

/// Segments, and the bones on which their sensors lie, in order of preference.
const BONES: [(&str, &[&str]); 15] = [
    ("pelvis", &["pelvis"]),
    ("thorax", &["torso"]),
    ("head", &["head", "skull"]),
    ("l_upperarm", &["humerus_l"]),
    ("l_forearm", &["ulna_l", "radius_l"]),
    ("l_hand", &["hand_l"]),
    ("r_upperarm", &["humerus_r"]),
    ("r_forearm", &["ulna_r", "radius_r"]),
    ("r_hand", &["hand_r"]),
    ("l_thigh", &["femur_l"]),
    ("l_shank", &["tibia_l"]),
    ("r_thigh", &["femur_r"]),
    ("r_shank", &["tibia_r"]),
    ("l_foot", &["calcn_l", "toes_l"]),
    ("r_foot", &["calcn_r", "toes_r"]),
];
/// What the names of sensors end with.
const SENSOR: &str = "_imu";

/// Whether a text holds quaternions of OpenSim with a sensor among its columns.
pub(crate) fn is_orientations(text: &str) -> bool {
    text.lines()
        .any(|line| line.trim() == "DataType=Quaternion")
}

/// The mapping of OpenSense's names, `None` if no column is named after a sensor on the pelvis.
///
/// # Errors
/// Returns an error if the sensors do not cover the body.
pub(crate) fn mapping(table: &Table) -> Result<(Option<Mapping>, Vec<String>)> {
    let names: Vec<&str> = table
        .columns
        .iter()
        .filter_map(|name| name.strip_suffix(".w"))
        .collect();
    let sensor = |bones: &[&str]| {
        let named = bones.iter().find_map(|bone| {
            let of_bone = |name: &&&str| name.strip_suffix(SENSOR).unwrap_or(name) == *bone;
            names.iter().find(of_bone)
        });
        named.map(|name| (*name).to_owned())
    };
    let found: BTreeMap<String, Row> = (BONES.iter())
        .filter_map(|(segment, bones)| {
            let row = Row {
                columns: Some(vec![sensor(bones)?]),
                ..Row::default()
            };
            Some(((*segment).to_owned(), row))
        })
        .collect();
    if !found.contains_key("pelvis") {
        return Ok((None, Vec::new()));
    }
    let (world, body) = (["north", "west", "up"], ["forward", "left", "up"]);
    let mut mapping = Mapping::of_system(Kind::Quaternions, world, (body, Rest::HPose), found)?;
    mapping.time.column = table.columns.first().cloned();
    mapping.quaternions.mounting = Mounting::FirstRow;
    mapping.quaternions.forward =
        Some(SensorAxis::try_from("z".to_owned()).map_err(Problem::bad_input)?);
    let warning = "as in OpenSense's examples, the world's Z is taken as up, the first row as standing with arms down, and the z axis of the pelvis' sensor as pointing forwards: a mapping says it otherwise";
    Ok((Some(mapping), vec![warning.to_owned()]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn standard_names_need_no_mapping() {
        let names = "time\tpelvis_imu\ttorso_imu\thumerus_l_imu\tradius_l_imu\tulna_l_imu\tfemur_r_imu\tcalcn_r_imu";
        let row = |time: &str| format!("{time}{}", "\t1,0,0,0".repeat(7));
        let text = format!(
            "DataRate=100.000000\nDataType=Quaternion\nversion=3\nOpenSimVersion=4.4\nendheader\n{names}\n{}\n{}\n",
            row("0"),
            row("0.01")
        );
        assert!(is_orientations(&text));
        let table = Table::parse(&text).unwrap();
        let (found, warnings) = mapping(&table).unwrap();
        let found = found.unwrap();
        let sensor = |segment: &str| found.segments[segment].columns.clone().unwrap();
        assert_eq!(sensor("thorax"), ["torso_imu"]);
        assert_eq!(sensor("l_forearm"), ["ulna_l_imu"]);
        assert_eq!(sensor("r_foot"), ["calcn_r_imu"]);
        assert!(!found.segments.contains_key("r_upperarm"));
        assert_eq!(found.time.column.as_deref(), Some("time"));
        assert_eq!(warnings.len(), 1);
        let other = Table::parse(&text.replace("pelvis_imu", "hips")).unwrap();
        assert!(mapping(&other).unwrap().0.is_none());
    }
}
