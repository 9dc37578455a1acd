//! The motion: for each frame, the numbers of each bone with a freedom.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

use super::skeleton::{Asf, Freedom, lines, number};
use crate::tree::Tree;
use bodyflight_io::diagnostic::{Problem, Result};

/// Frame rate of almost all of the CMU library (Hz), for files that state none: the format has no field for it.
const USUAL_RATE: f64 = 120.0;
/// The skeleton with the motion of a text, and warnings.
///
/// # Errors
/// Returns an error with the line that does not follow the format.
pub(super) fn moved(skeleton: &Asf, text: &str) -> Result<(Tree, Vec<String>)> {
    let mut reader = Amc::of(skeleton);
    for (line, content) in lines(text) {
        let words: Vec<&str> = content.split_whitespace().collect();
        reader
            .line(&words)
            .map_err(|problem| problem.at_line(line))?;
    }
    reader
        .ended()
        .map_err(|problem| problem.at_line(text.lines().count() as u64))?;
    if reader.frames < 2 {
        let message = format!("expected at least 2 frames, found {}", reader.frames);
        return Err(Problem::bad_input(message));
    }
    let mut warnings = Vec::new();
    let rate = reader.rate.unwrap_or_else(|| {
        warnings.push(format!(
            "the file states no frame rate: {USUAL_RATE} Hz is taken, that of most of the CMU library; [time] rate_hz in a mapping says it otherwise, and `airborne` measures it in a jump"
        ));
        USUAL_RATE
    });
    let joints = skeleton
        .bones
        .iter()
        .zip(&skeleton.parents)
        .map(|(bone, parent)| {
            let above = parent.and_then(|parent| skeleton.bones.get(parent));
            let offset = above.map_or_else(Vector3::zeros, |bone| bone.direction * bone.length);
            (bone.name.clone(), *parent, offset)
        });
    let tree = Tree::of_vectors(joints.collect(), rate, reader.values);
    Ok((tree, warnings))
}

/// A motion while it is read.
struct Amc<'a> {
    skeleton: &'a Asf,
    places: BTreeMap<&'a str, usize>,
    /// Rotation from each bone's axes to those of the file.
    axes: Vec<Matrix3<f64>>,
    radians: bool,
    rate: Option<f64>,
    /// Number of the current frame, and the bones that it has.
    current: Option<u64>,
    seen: Vec<bool>,
    frame: Vec<f64>,
    frames: usize,
    values: Vec<f64>,
}

impl<'a> Amc<'a> {
    fn of(skeleton: &'a Asf) -> Self {
        let bones = &skeleton.bones;
        Self {
            skeleton,
            places: (bones.iter().enumerate())
                .map(|(k, bone)| (bone.name.as_str(), k))
                .collect(),
            axes: (bones.iter())
                .map(|bone| bone.rotation(&bone.axis, bone.radians))
                .collect(),
            radians: bones.last().is_some_and(|bone| bone.radians),
            rate: None,
            current: None,
            seen: vec![false; bones.len()],
            frame: vec![0.0; 3 * (bones.len() + 1)],
            frames: 0,
            values: Vec::new(),
        }
    }

    fn line(&mut self, words: &[&str]) -> Result<()> {
        let Some((first, rest)) = words.split_first() else {
            return Ok(());
        };
        if let Some(keyword) = first.strip_prefix(':') {
            match keyword.to_ascii_uppercase().as_str() {
                "DEGREES" => self.radians = false,
                "RADIANS" => self.radians = true,
                "SAMPLES-PER-SECOND" => {
                    let rate = number(rest.first().copied(), keyword)?;
                    self.rate = Some(rate).filter(|rate| *rate > 0.0);
                }
                _ => {}
            }
            return Ok(());
        }
        if let (Ok(frame), []) = (first.parse::<u64>(), rest) {
            self.ended()?;
            if let Some(before) = self.current
                && frame != before + 1
            {
                return Err(Problem::bad_input(format!(
                    "expected frame {}, found frame {frame}",
                    before + 1
                ))
                .help("fill the gap, or cut the file there"));
            }
            self.current = Some(frame);
            return Ok(());
        }
        if self.current.is_none() {
            let message = format!("expected the number of a frame, found \"{first}\"");
            return Err(Problem::bad_input(message));
        }
        self.bone(first, rest)
    }

    fn bone(&mut self, name: &str, words: &[&str]) -> Result<()> {
        let Some((place, bone)) = (self.places.get(name))
            .and_then(|place| Some((*place, self.skeleton.bones.get(*place)?)))
        else {
            return Err(Problem::bad_input(format!(
                "the skeleton has no bone \"{name}\": it belongs to another subject"
            )));
        };
        if words.len() != bone.freedoms.len() {
            return Err(Problem::bad_input(format!(
                "expected {} numbers for {name}, one for each degree of freedom, found {}",
                bone.freedoms.len(),
                words.len()
            )));
        }
        let mut angles = Vector3::zeros();
        for (freedom, word) in bone.freedoms.iter().zip(words) {
            let value = number(Some(word), name)?;
            match *freedom {
                Freedom::Turn(axis) => angles[axis] = value,
                Freedom::Move(axis) => self.frame[axis] = value,
            }
        }
        let axes = self.axes[place];
        let turned = axes * bone.rotation(&angles, self.radians) * axes.transpose();
        let turned = Rotation3::from_matrix_unchecked(turned);
        let vector = UnitQuaternion::from_rotation_matrix(&turned).scaled_axis();
        let from = 3 * (place + 1);
        if let Some(slots) = self.frame.get_mut(from..from + 3) {
            slots.copy_from_slice(vector.as_slice());
        }
        if core::mem::replace(&mut self.seen[place], true) {
            return Err(Problem::bad_input(format!("found {name} twice in a frame")));
        }
        Ok(())
    }

    /// Ends the current frame.
    fn ended(&mut self) -> Result<()> {
        let Some(frame) = self.current else {
            return Ok(());
        };
        let bones = self.skeleton.bones.iter().zip(&self.seen);
        let lacks: Vec<&str> = bones
            .filter(|(bone, seen)| !bone.freedoms.is_empty() && !**seen)
            .map(|(bone, _)| bone.name.as_str())
            .collect();
        if !lacks.is_empty() {
            return Err(Problem::bad_input(format!(
                "frame {frame} lacks {}",
                lacks.join(", ")
            )));
        }
        self.values.extend_from_slice(&self.frame);
        self.frames += 1;
        self.seen.fill(false);
        Ok(())
    }
}
