//! The skeleton: bones with their axes and freedoms, and the tree that they form.

use nalgebra::{Matrix3, Rotation3, Vector3};

use bodyflight_io::diagnostic::{Problem, Result};

/// Most bones of a skeleton that are accepted.
const BONE_LIMIT: usize = 10_000;

/// What a number of a bone does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Freedom {
    Turn(usize),
    Move(usize),
}

#[derive(Debug, Clone, PartialEq)]
pub(super) struct Bone {
    pub(super) name: String,
    pub(super) direction: Vector3<f64>,
    pub(super) length: f64,
    /// Angles of its axes, and the order of rotations.
    pub(super) axis: Vector3<f64>,
    order: [usize; 3],
    pub(super) freedoms: Vec<Freedom>,
    /// Angles are in radians.
    pub(super) radians: bool,
}

impl Bone {
    fn new(name: &str, radians: bool) -> Self {
        Self {
            name: name.to_owned(),
            direction: Vector3::zeros(),
            length: 0.0,
            axis: Vector3::zeros(),
            order: [0, 1, 2],
            freedoms: Vec::new(),
            radians,
        }
    }

    /// The rotation by angles about X, Y and Z.
    pub(super) fn rotation(&self, angles: &Vector3<f64>, radians: bool) -> Matrix3<f64> {
        let factor = if radians { 1.0 } else { 1.0_f64.to_radians() };
        self.order.iter().fold(Matrix3::identity(), |turned, axis| {
            let mut about = Vector3::zeros();
            about[*axis] = factor * angles[*axis];
            Rotation3::new(about).matrix() * turned
        })
    }
}

/// A skeleton: its bones, parents before children, the root first.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Asf {
    pub(super) bones: Vec<Bone>,
    pub(super) parents: Vec<Option<usize>>,
}

/// Lines with their numbers; blank lines and remarks are skipped.
pub(super) fn lines(text: &str) -> impl Iterator<Item = (u64, &str)> {
    (1..)
        .zip(text.trim_start_matches('\u{feff}').lines().map(str::trim))
        .filter(|(_, line)| !line.is_empty() && !line.starts_with('#'))
}

pub(super) fn number(word: Option<&str>, what: &str) -> Result<f64> {
    let word = word.unwrap_or("nothing");
    let number: Option<f64> = word.parse().ok();
    number.filter(|number| number.is_finite()).ok_or_else(|| {
        Problem::bad_input(format!("expected a number for {what}, found \"{word}\""))
    })
}

fn vector(words: &[&str], what: &str) -> Result<Vector3<f64>> {
    let mut vector = Vector3::zeros();
    for (k, place) in vector.iter_mut().enumerate() {
        *place = number(words.get(k).copied(), what)?;
    }
    Ok(vector)
}

/// An order of rotations, such as `XYZ`.
fn order(word: Option<&str>) -> Result<[usize; 3]> {
    let word = word.unwrap_or("nothing");
    let axis = |letter: char| "XYZ".find(letter.to_ascii_uppercase());
    let axes: Vec<usize> = word.chars().filter_map(axis).collect();
    match axes[..] {
        [a, b, c] if a != b && b != c && a != c && word.len() == 3 => Ok([a, b, c]),
        _ => Err(Problem::bad_input(format!(
            "expected an order of rotations like XYZ, found \"{word}\""
        ))),
    }
}

fn freedom(word: &str) -> Result<Freedom> {
    let axis = |letter: &str| ["x", "y", "z"].iter().position(|axis| *axis == letter);
    let small = word.to_ascii_lowercase();
    let parts = small.split_at_checked(1);
    match parts.and_then(|(kind, letter)| Some((kind, axis(letter)?))) {
        Some(("r", axis)) => Ok(Freedom::Turn(axis)),
        Some(("t", axis)) => Ok(Freedom::Move(axis)),
        _ => Err(Problem::bad_input(format!(
            "expected a degree of freedom like rx, found \"{word}\""
        ))),
    }
}

impl Asf {
    pub(super) fn parse(text: &str) -> Result<Self> {
        let mut section = String::new();
        let mut radians = false;
        let mut bones = vec![Bone::new("root", false)];
        let mut parents: Vec<Option<usize>> = vec![None];
        let mut links: Vec<(u64, Vec<String>)> = Vec::new();
        for (line, content) in lines(text) {
            let words: Vec<&str> = content.split_whitespace().collect();
            let at_line = |problem: Problem| problem.at_line(line);
            if let Some(keyword) = content.strip_prefix(':') {
                let name = keyword.split_whitespace().next().unwrap_or_default();
                section = name.to_ascii_lowercase();
                continue;
            }
            match (section.as_str(), words[0].to_ascii_lowercase().as_str()) {
                ("units", "angle") => {
                    radians = words.get(1).is_some_and(|unit| unit.starts_with("rad"));
                }
                ("bonedata", "begin") => {
                    if bones.len() > BONE_LIMIT {
                        return Err(Problem::bad_input("too many bones").at_line(line));
                    }
                    bones.push(Bone::new("", radians));
                    parents.push(None);
                }
                ("root" | "bonedata", key) => {
                    let is_root = section == "root";
                    if let Some(bone) = bones.last_mut() {
                        bone.set(key, &words[1..], is_root).map_err(at_line)?;
                    }
                }
                ("hierarchy", "begin" | "end") => {}
                ("hierarchy", _) => {
                    links.push((line, words.iter().map(|&word| word.to_owned()).collect()));
                }
                _ => {}
            }
        }
        let place = |name: &str| bones.iter().position(|bone| bone.name == name);
        for (line, names) in &links {
            let known = |name: &String| {
                place(name).ok_or_else(|| {
                    let message = format!("expected a bone of :bonedata, found \"{name}\"");
                    Problem::bad_input(message).at_line(*line)
                })
            };
            let Some((parent, children)) = names.split_first() else {
                continue;
            };
            let parent = known(parent)?;
            for child in children {
                if let Some(slot) = parents.get_mut(known(child)?) {
                    *slot = Some(parent);
                }
            }
        }
        Self { bones, parents }.sorted()
    }

    /// Parents before children, without bones that hang from nothing.
    fn sorted(self) -> Result<Self> {
        let mut places = vec![0_usize];
        let mut next = 0;
        while let Some(parent) = places.get(next).copied() {
            let children = (1..self.bones.len()).filter(|k| self.parents[*k] == Some(parent));
            places.extend(children);
            next += 1;
            if places.len() > self.bones.len() {
                return Err(Problem::bad_input("the bones of :hierarchy form a cycle"));
            }
        }
        if places.len() < 2 {
            return Err(Problem::bad_input(
                "expected bones in :bonedata and :hierarchy, found none: this is not a skeleton of Acclaim",
            ));
        }
        let new = |old: usize| places.iter().position(|place| *place == old);
        Ok(Self {
            bones: places
                .iter()
                .map(|place| self.bones[*place].clone())
                .collect(),
            parents: places
                .iter()
                .map(|place| self.parents[*place].and_then(new))
                .collect(),
        })
    }
}

impl Bone {
    fn set(&mut self, key: &str, words: &[&str], is_root: bool) -> Result<()> {
        match key {
            "name" => self.name = words.join(" "),
            "direction" => {
                let direction = vector(words, "direction")?;
                // Lengths are along it, so it has none of its own.
                self.direction = direction.try_normalize(1e-9).unwrap_or(direction);
            }
            "length" => self.length = number(words.first().copied(), "length")?,
            "axis" if is_root => self.order = order(words.first().copied())?,
            "axis" => {
                self.axis = vector(words, "axis")?;
                self.order = order(words.get(3).copied())?;
            }
            "dof" | "order" => {
                let of = |word: &&str| freedom(word);
                self.freedoms = words.iter().map(of).collect::<Result<_>>()?;
                if !is_root
                    && self
                        .freedoms
                        .iter()
                        .any(|one| matches!(one, Freedom::Move(_)))
                {
                    return Err(Problem::bad_input(format!(
                        "expected rotations only, found a translation of {}: bones that change their length are not supported",
                        self.name
                    )));
                }
            }
            "position" | "orientation" if is_root && vector(words, key)?.norm() > 0.0 => {
                return Err(Problem::bad_input(format!(
                    "expected the root's {key} at 0 0 0, found {}",
                    words.join(" ")
                )));
            }
            _ => {}
        }
        Ok(())
    }
}
