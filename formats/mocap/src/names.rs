//! Joint names used by common programs, for files without a mapping.

use std::collections::BTreeMap;

use bodyflight_core::Segment;

use crate::mapping::{Kind, Mapping, Rest, Row};
use crate::skeleton::is_needed;
use crate::tree::Tree;

/// Names of the joint at the proximal end of limbs, without side, separators and capitals. Where one program calls a
/// joint what another calls its neighbour, the less ambiguous name comes first: SMPL's foot is at the toes.
const LIMBS: [(&str, &[&str]); 6] = [
    (
        "upperarm",
        &[
            "arm",
            "upperarm",
            "uparm",
            "uarm",
            "shldrbend",
            "shldr",
            "humerus",
            "shoulder",
        ],
    ),
    (
        "forearm",
        &[
            "forearmbend",
            "forearm",
            "lowerarm",
            "lowarm",
            "farm",
            "radius",
            "elbow",
        ],
    ),
    ("hand", &["hand", "wrist"]),
    (
        "thigh",
        &["upleg", "thighbend", "thigh", "upperleg", "femur", "hip"],
    ),
    (
        "shank",
        &["shin", "calf", "lowerleg", "lowleg", "tibia", "knee", "leg"],
    ),
    ("foot", &["ankle", "foot"]),
];
const PELVIS: [&str; 4] = ["hips", "pelvis", "hip", "lowertorso"];
/// The lowest part of the spine, where it has a name of its own.
const ABDOMEN: [&str; 3] = ["lowerback", "abdomen", "abdomenlower"];
const HEAD: [&str; 2] = ["head", "neck"];

/// Beginnings of the names of segments, and letters of the sides.
const SIDES: [(&str, char); 2] = [("l_", 'l'), ("r_", 'r')];

/// Prefixes that programs put before every name.
const PREFIXES: [&str; 4] = ["mixamorig", "bip001", "bip01", "character1"];

/// Fewest names that show what all have in common, and the shortest such ending.
const FEWEST_NAMES: usize = 10;
const SHORTEST_ENDING: usize = 3;

/// The side of a joint and its bare name, in small letters without separators.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Name {
    side: Option<char>,
    bare: String,
}

impl Name {
    /// Understands `LeftArm`, `mixamorig:LeftArm`, `lShldr`, `L_Hip`, `upper_arm.R`, `Bip01 R Thigh`, `thigh_l`.
    fn of(joint: &str) -> Self {
        let own = joint.rsplit(':').next().unwrap_or_default();
        let mut words: Vec<String> = own
            .split(|c: char| !c.is_alphanumeric())
            .filter(|word| !word.is_empty())
            .map(str::to_owned)
            .collect();
        if words.len() > 1 && PREFIXES.contains(&words[0].to_ascii_lowercase().as_str()) {
            words.remove(0);
        }
        let side_of = |word: &str| match word.to_ascii_lowercase().as_str() {
            "l" | "left" => Some('l'),
            "r" | "right" => Some('r'),
            _ => None,
        };
        let mut side = None;
        words.retain(|word| {
            let found = side_of(word).filter(|_| side.is_none());
            side = side.or(found);
            found.is_none()
        });
        let joined = words.concat();
        let mut bare = joined.to_ascii_lowercase();
        for prefix in PREFIXES {
            if let Some(rest) = bare.strip_prefix(prefix).filter(|rest| !rest.is_empty()) {
                bare = rest.to_owned();
            }
        }
        if side.is_none() {
            let capital_next = joined.chars().nth(1).is_some_and(char::is_uppercase);
            for (prefix, letter) in [("left", 'l'), ("right", 'r'), ("l", 'l'), ("r", 'r')] {
                let stripped = bare.strip_prefix(prefix);
                let Some(rest) = stripped.filter(|_| prefix.len() > 1 || capital_next) else {
                    continue;
                };
                (side, bare) = (Some(letter), rest.to_owned());
                break;
            }
        }
        // Acclaim writes all in small letters: a side is what leaves the name of a limb.
        for letter in ['l', 'r'] {
            let rest = bare.strip_prefix(letter).filter(|_| side.is_none());
            let is_limb = |rest: &&str| LIMBS.iter().any(|(_, names)| names.contains(rest));
            if let Some(rest) = rest.filter(is_limb) {
                (side, bare) = (Some(letter), rest.to_owned());
            }
        }
        // Some rigs number the parts of a limb: the first stands for it.
        let unnumbered = bare.trim_end_matches(|c: char| c.is_ascii_digit());
        if unnumbered.len() < bare.len()
            && LIMBS.iter().any(|(_, names)| names.contains(&unnumbered))
        {
            bare = unnumbered.to_owned();
        }
        Self { side, bare }
    }
}

/// What programs put before and after every name: the end of what all names begin with that is a separator, and the
/// begin of a word that all end with.
fn shared(names: &[&str]) -> [usize; 2] {
    let Some((first, rest)) = names.split_first().filter(|_| names.len() >= FEWEST_NAMES) else {
        return [0, 0];
    };
    let same = |alike: fn(&str, &str) -> usize| {
        rest.iter()
            .map(|name| alike(first, name))
            .min()
            .unwrap_or(0)
    };
    let begin = same(|a, b| a.bytes().zip(b.bytes()).take_while(|(a, b)| a == b).count());
    let end = same(|a, b| {
        let both = a.bytes().rev().zip(b.bytes().rev());
        both.take_while(|(a, b)| a == b).count()
    });
    let begin = first
        .get(..begin)
        .and_then(|same| same.rfind(|c: char| c.is_ascii() && !c.is_alphanumeric()))
        .map_or(0, |at| at + 1);
    let is_word = |same: &&str| same.len() >= SHORTEST_ENDING && same.is_ascii();
    let end = first
        .get(first.len() - end..)
        .filter(is_word)
        .map_or(0, str::len);
    let is_longer = |name: &&str| name.len() > begin + end;
    if names.iter().all(is_longer) {
        [begin, end]
    } else {
        [0, 0]
    }
}

/// The joints of a file by their names.
struct Joints<'a> {
    bvh: &'a Tree,
    names: Vec<Name>,
}

impl<'a> Joints<'a> {
    fn of(bvh: &'a Tree) -> Self {
        let all: Vec<&str> = bvh.joints.iter().map(|joint| joint.name.as_str()).collect();
        let [begin, end] = shared(&all);
        let names =
            (all.iter()).map(|name| Name::of(name.get(begin..name.len() - end).unwrap_or(name)));
        Self {
            bvh,
            names: names.collect(),
        }
    }

    /// The first joint of that side with one of these names for which `fits` holds, in the order of the names.
    fn find(
        &self,
        side: Option<char>,
        names: &[&str],
        fits: impl Fn(usize) -> bool,
    ) -> Option<usize> {
        names.iter().find_map(|name| {
            let of_name = |joint: &usize| {
                let found = &self.names[*joint];
                found.side == side && found.bare == *name
            };
            (0..self.names.len())
                .filter(of_name)
                .find(|joint| fits(*joint))
        })
    }

    /// The joints of a limb from the body outwards, each hanging from the one before; the last may be absent.
    fn limb(&self, side: char, rows: &[(&str, &[&str])]) -> Option<[Option<usize>; 3]> {
        let [(_, upper), (_, lower), (_, end)] = rows else {
            return None;
        };
        upper.iter().find_map(|name| {
            let upper = self.find(Some(side), &[name], |_| true)?;
            let lower = self.find(Some(side), lower, |joint| self.bvh.hangs_from(joint, upper))?;
            let end = self.find(Some(side), end, |joint| self.bvh.hangs_from(joint, lower));
            Some([Some(upper), Some(lower), end])
        })
    }

    /// The nearest joint that both hang from.
    fn common(&self, one: usize, other: usize) -> Option<usize> {
        self.bvh
            .chain(one)
            .skip(1)
            .find(|joint| self.bvh.hangs_from(other, *joint))
    }
}

/// The joint of each segment; `None` if the skeleton is not understood.
fn joints(bvh: &Tree) -> Option<BTreeMap<Segment, usize>> {
    let joints = Joints::of(bvh);
    let mut found = BTreeMap::new();
    for (side, letter) in SIDES {
        for rows in [&LIMBS[..3], &LIMBS[3..]] {
            let limb = joints.limb(letter, rows)?;
            for ((row, _), joint) in rows.iter().zip(limb) {
                let segment = Segment::from_name(&format!("{side}{row}"))?;
                if let Some(joint) = joint {
                    found.insert(segment, joint);
                }
            }
        }
    }
    // The thorax is where the arms branch off, whatever it is called; so is the pelvis, unless it has its name.
    let thorax = joints.common(
        found[&Segment::LeftUpperArm],
        found[&Segment::RightUpperArm],
    )?;
    let legs = [found[&Segment::LeftThigh], found[&Segment::RightThigh]];
    let branch = joints.common(legs[0], legs[1])?;
    let carries = |joint: usize| legs.iter().all(|leg| bvh.hangs_from(*leg, joint));
    let pelvis = joints
        .find(None, &PELVIS, |joint| {
            carries(joint) && !bvh.hangs_from(branch, joint)
        })
        .unwrap_or(branch);
    if thorax == pelvis {
        return None;
    }
    // The spine from the pelvis up, without both ends.
    let mut spine: Vec<usize> = (bvh.chain(thorax).skip(1))
        .take_while(|joint| *joint != pelvis && !bvh.hangs_from(pelvis, *joint))
        .collect();
    spine.reverse();
    let abdomen = joints
        .find(None, &ABDOMEN, |joint| spine.contains(&joint))
        .or_else(|| spine.get(spine.len().saturating_sub(1) / 2).copied());
    found.extend([(Segment::Pelvis, pelvis), (Segment::Thorax, thorax)]);
    found.extend(abdomen.map(|joint| (Segment::Abdomen, joint)));
    let head = joints.find(None, &HEAD, |joint| bvh.hangs_from(joint, thorax));
    found.extend(head.map(|joint| (Segment::Head, joint)));
    Some(found)
}

/// Hands and feet that have a joint which does not hang from that of the limb before it, and those without one whose
/// counterpart has one, in sentences.
pub(crate) fn ends(bvh: &Tree) -> [Vec<String>; 2] {
    let joints = Joints::of(bvh);
    let name = |joint: usize| bvh.joints.get(joint).map_or("", |joint| &joint.name);
    let (mut misplaced, mut missing) = (Vec::new(), Vec::new());
    for rows in [&LIMBS[..3], &LIMBS[3..]] {
        let found = SIDES.map(|(_, letter)| joints.limb(letter, rows));
        for (own, (side, letter)) in SIDES.into_iter().enumerate() {
            let (Some([_, Some(lower), None]), Some((row, names))) = (found[own], rows.last())
            else {
                continue;
            };
            let stray = joints.find(Some(letter), names, |_| true);
            let counterpart = found[1 - own].and_then(|[.., end]| end);
            if let Some(stray) = stray {
                misplaced.push(format!(
                    "{} does not hang from {}: their names are exchanged",
                    name(stray),
                    name(lower)
                ));
            } else if let Some(counterpart) = counterpart {
                missing.push(format!(
                    "{side}{row} has no joint whose name is known, and moves rigidly with the limb before it, while its counterpart has {}",
                    name(counterpart)
                ));
            }
        }
    }
    [misplaced, missing]
}

/// The mapping for a file with the joint names of a known skeleton, otherwise `None`. The axes are those that most
/// programs write: Y up, Z forward, X left.
pub fn mapping(bvh: &Tree) -> Option<Mapping> {
    let found = joints(bvh)?;
    let row = |joint: usize| Row {
        joint: bvh.joints.get(joint).map(|joint| joint.name.clone()),
        ..Row::default()
    };
    let needed = Segment::ALL.into_iter().filter(|s| is_needed(*s));
    if !needed
        .into_iter()
        .all(|segment| found.contains_key(&segment))
    {
        return None;
    }
    let segments = (found.into_iter())
        .map(|(segment, joint)| (segment.name().to_owned(), row(joint)))
        .collect();
    let (world, body) = (["west", "up", "north"], ["left", "up", "forward"]);
    Mapping::of_system(Kind::Bvh, world, (body, Rest::Bones), segments).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sides_and_bare_names_are_understood_in_every_spelling() {
        for (joint, side, bare) in [
            ("LeftUpLeg", Some('l'), "upleg"),
            ("mixamorig:RightForeArm", Some('r'), "forearm"),
            ("mixamorig_LeftArm", Some('l'), "arm"),
            ("lShldr", Some('l'), "shldr"),
            ("rThighBend", Some('r'), "thighbend"),
            ("L_Hip", Some('l'), "hip"),
            ("upper_arm.R", Some('r'), "upperarm"),
            ("Bip01 R UpperArm", Some('r'), "upperarm"),
            ("thigh_l", Some('l'), "thigh"),
            ("left_knee", Some('l'), "knee"),
            ("LHipJoint", Some('l'), "hipjoint"),
            ("LowerBack", None, "lowerback"),
            ("radius", None, "radius"),
            ("rradius", Some('r'), "radius"),
            ("lfemur", Some('l'), "femur"),
            ("lowerneck", None, "lowerneck"),
            ("Hips", None, "hips"),
            ("LUArm", Some('l'), "uarm"),
            ("upperleg01.L", Some('l'), "upperleg"),
            ("Spine1", None, "spine1"),
        ] {
            let name = Name::of(joint);
            assert_eq!((name.side, name.bare.as_str()), (side, bare), "{joint}");
        }
    }

    #[test]
    fn what_all_names_have_in_common_says_nothing() {
        let parts = [
            "Hips", "Spine", "Head", "L_Arm", "R_Arm", "L_Hand", "R_Hand", "L_Leg", "R_Leg", "Neck",
        ];
        let named = |name: fn(&str) -> String| {
            let names: Vec<String> = parts.iter().map(|part| name(part)).collect();
            shared(&names.iter().map(String::as_str).collect::<Vec<_>>())
        };
        assert_eq!(named(|part| part.to_owned()), [0, 0]);
        assert_eq!(named(|part| format!("J_Bip_{part}")), [6, 0]);
        assert_eq!(named(|part| format!("{part}Joint")), [0, 5]);
        // A few names may begin alike by chance.
        assert_eq!(shared(&["L_Arm", "L_Leg"]), [0, 0]);
        assert_eq!(shared(&[]), [0, 0]);
    }
}
