//! Acclaim's ASF (a skeleton) and AMC (its motion), as the CMU library distributes them.
//!
//! A bone hangs from the end of its parent and turns about axes of its own: with `C` the rotation of these axes and `M`
//! that of its angles, it turns by `C M C'` in the axes of the file. An angle list is about the axes named by `axis`,
//! in that order, each in fixed axes.

mod motion;
mod skeleton;

use std::path::{Path, PathBuf};

use crate::tree::Tree;
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::input;
use skeleton::Asf;

/// Reads a motion and the skeleton next to it. Returns them with warnings.
///
/// # Errors
/// Returns an error if no skeleton is found, or a line of either does not follow the format.
pub(crate) fn read(text: &str, path: &Path) -> Result<(Tree, Vec<String>)> {
    let skeleton = skeleton_of(path)?;
    let asf = input::utf_8(input::movement(&skeleton)?, &skeleton)?;
    let asf = Asf::parse(&asf).map_err(|problem| problem.in_file(&skeleton))?;
    motion::moved(&asf, text)
}

/// Whether a text is a motion: its keywords come before the first frame.
pub(crate) fn is_amc(text: &str) -> bool {
    let mut lines = text.lines().map(str::trim);
    let first = lines.find(|line| !line.is_empty() && !line.starts_with('#'));
    first.is_some_and(|line| {
        let keywords = [":fully-specified", ":degrees", ":radians"];
        keywords.contains(&line.to_ascii_lowercase().as_str())
    })
}

/// The skeleton of a motion: the file of the same name, or of the subject before the last `_`; else the only one there.
fn skeleton_of(motion: &Path) -> Result<PathBuf> {
    let folder = match motion.parent() {
        Some(parent) if parent.as_os_str().is_empty() => Path::new("."),
        Some(parent) => parent,
        None => Path::new("."),
    };
    let bare = |path: &Path, end: &str| -> Option<String> {
        let name = path.file_name()?.to_string_lossy().to_ascii_lowercase();
        let name = name.trim_end_matches(".gz").trim_end_matches(".xz");
        name.strip_suffix(end).map(str::to_owned)
    };
    let own = bare(motion, ".amc").unwrap_or_default();
    let mut wanted = vec![own.as_str()];
    wanted.extend(own.rsplit_once('_').map(|(subject, _)| subject));
    let entries = std::fs::read_dir(folder)
        .map_err(|error| Problem::system("read", folder, error))?
        .flatten();
    let mut found: Vec<(String, PathBuf)> = entries
        .filter_map(|entry| Some((bare(&entry.path(), ".asf")?, entry.path())))
        .collect();
    found.sort();
    let named = |name: &&str| found.iter().find(|(bare, _)| bare == name);
    if let Some((_, path)) = wanted.iter().find_map(named) {
        return Ok(path.clone());
    }
    match &found[..] {
        [(_, only)] => Ok(only.clone()),
        _ => {
            let names: Vec<String> = wanted.iter().map(|name| format!("{name}.asf")).collect();
            let message = format!(
                "a motion of Acclaim needs its skeleton: expected {} in its folder, found {}",
                names.join(" or "),
                match found.len() {
                    0 => "no .asf file".to_owned(),
                    count => format!("{count} others"),
                }
            );
            Err(Problem::bad_input(message)
                .in_file(motion)
                .help("copy the subject's .asf file there"))
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;

    /// A thigh with tilted axes, a shank, and a bone without freedom between root and thigh.
    const ASF: &str = "# AST/ASF file\n:version 1.10\n:name VICON\n:units\n  mass 1.0\n  length 0.45\n  angle deg\n\
        :documentation\n   made by hand\n:root\n   order TX TY TZ RX RY RZ\n   axis XYZ\n   position 0 0 0\n   orientation 0 0 0\n\
        :bonedata\n  begin\n     id 1\n     name lhipjoint\n     direction 1 0 0\n     length 2\n     axis 0 0 0  XYZ\n  end\n\
        \u{20} begin\n     id 2\n     name lfemur\n     direction 0 -1 0\n     length 7\n     axis 0 0 90  XYZ\n    dof rx ry rz\n\
        \u{20}   limits (-160.0 20.0)\n           (-70.0 70.0)\n           (-60.0 70.0)\n  end\n\
        \u{20} begin\n     id 3\n     name ltibia\n     direction 0 -1 0\n     length 7\n     axis 0 0 0  XYZ\n    dof rx\n  end\n\
        :hierarchy\n  begin\n    root lhipjoint\n    lhipjoint lfemur\n    lfemur ltibia\n  end\n";
    const AMC: &str = "#!OML:ASF F:\\VICON\\01.ASF\n:FULLY-SPECIFIED\n:DEGREES\n1\nroot 1 2 3 0 0 0\nlfemur 0 0 0\nltibia 0\n\
        2\nroot 1 2 3 0 90 0\nlfemur 90 0 0\nltibia 90\n";

    fn moved(asf: &str, amc: &str) -> Result<(Tree, Vec<String>)> {
        motion::moved(&Asf::parse(asf)?, amc)
    }

    #[test]
    fn bones_turn_about_their_own_axes_at_the_end_of_their_parents() {
        let (tree, warnings) = moved(ASF, AMC).unwrap();
        assert_eq!((tree.frames(), tree.joints.len()), (2, 4));
        assert!(warnings[0].contains("no frame rate"), "{warnings:?}");
        let still = tree.placed(0);
        assert!((still[3].position - Vector3::new(3.0, -5.0, 3.0)).norm() < 1e-12);
        // The root turns left (x to -z). The thigh's own x axis is y there, so 90 degrees about it turn by y again:
        // the shank hangs from (1, 2, 3) + (0, 0, -2) + (0, -7, 0), and its foot points to its front.
        let turned = tree.placed(1);
        assert!((turned[3].position - Vector3::new(1.0, -5.0, 1.0)).norm() < 1e-9);
        let front = turned[3].orientation * -Vector3::y();
        assert!(
            (front - Vector3::new(0.0, 0.0, 1.0)).norm() < 1e-9,
            "{front}"
        );
    }

    #[test]
    fn rates_and_radians_are_those_of_the_file() {
        let amc = AMC.replace(":DEGREES", ":RADIANS\n:SAMPLES-PER-SECOND 60");
        let amc = amc.replace("90", "1.5707963267948966");
        let (tree, warnings) = moved(ASF, &amc).unwrap();
        assert!((tree.rate - 60.0).abs() < 1e-12 && warnings.is_empty());
        let (degrees, _) = moved(ASF, AMC).unwrap();
        let apart = tree.placed(1)[3].orientation - degrees.placed(1)[3].orientation;
        assert!(apart.norm() < 1e-9);
    }

    #[test]
    fn broken_files_are_refused_with_the_line() {
        for (asf, amc, parts) in [
            (
                ASF.to_owned(),
                AMC.replace("ltibia 90\n", ""),
                ["line 10", "frame 2 lacks ltibia"],
            ),
            (
                ASF.to_owned(),
                AMC.replace("ltibia 0\n", ""),
                ["line 7", "frame 1 lacks ltibia"],
            ),
            (
                ASF.to_owned(),
                AMC.replace("ltibia 90", "ltibia"),
                ["line 11", "expected 1 numbers for ltibia"],
            ),
            (
                ASF.to_owned(),
                AMC.replace("ltibia 90", "rtibia 90"),
                ["line 11", "no bone \"rtibia\""],
            ),
            (
                ASF.to_owned(),
                AMC.replace("90 0 0", "90 x 0"),
                ["line 10", "found \"x\""],
            ),
            (
                ASF.to_owned(),
                AMC.replace("\n2\n", "\n3\n"),
                ["line 8", "expected frame 2, found frame 3"],
            ),
            (
                ASF.replace("dof rx\n", "dof rx l\n"),
                AMC.to_owned(),
                ["line 40", "found \"l\""],
            ),
            (
                ASF.replace("position 0 0 0", "position 0 1 0"),
                AMC.to_owned(),
                ["line 13", "root's position"],
            ),
            (
                ASF.replace("axis 0 0 90  XYZ", "axis 0 0 90  XYY"),
                AMC.to_owned(),
                ["line 28", "XYY"],
            ),
            (
                ASF.replace("    lfemur ltibia", "    lfemur lshin"),
                AMC.to_owned(),
                ["line 46", "found \"lshin\""],
            ),
        ] {
            let problem = moved(&asf, &amc).unwrap_err();
            let said = format!("line {}: {problem}", problem.line.unwrap_or(0));
            for part in parts {
                assert!(said.contains(part), "{said}\nlacks {part}");
            }
        }
        assert!(moved(":version 1.10\n", AMC).is_err());
    }
}
