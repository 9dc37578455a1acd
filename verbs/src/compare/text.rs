//! A comparison as text of 80 columns.

use std::fmt;

use bodyflight_replay::comparison::Channel;

use super::effect::Means;
use super::joints::Summary;
use super::{Difference, Pair, Report, Side, Trust};

/// Width of the text.
const WIDTH: usize = 80;
/// Most angles in the table.
const ANGLES: usize = 10;

/// A difference this much unlike that of the mean angles is remarked on (degrees).
const APART: f64 = 5.0;

/// Breaks a paragraph; lines after the first are indented.
fn paragraph(f: &mut fmt::Formatter<'_>, indent: usize, text: &str) -> fmt::Result {
    let mut column = 0;
    for word in text.split(' ') {
        let length = word.chars().count();
        if column > 0 && column + 1 + length > WIDTH {
            write!(f, "\n{:indent$}", "")?;
            column = indent;
        } else if column > 0 {
            write!(f, " ")?;
            column += 1;
        }
        write!(f, "{word}")?;
        column += length;
    }
    writeln!(f)
}

fn side(f: &mut fmt::Formatter<'_>, letter: &str, side: &Side) -> fmt::Result {
    let text = format!(
        "{letter}  {}: {:.1} s, {} frames at {:.0} Hz{}",
        side.name,
        side.duration_s,
        side.frames,
        side.rate_hz,
        if side.compared_rate_hz < 0.7 * side.rate_hz {
            format!(", compared at {:.3} Hz", side.compared_rate_hz)
        } else {
            String::new()
        }
    );
    paragraph(f, 3, &text)
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (k, pair) in self.pairs.iter().enumerate() {
            if k > 0 {
                writeln!(f)?;
            }
            side(f, "A", &self.a)?;
            side(f, "B", &pair.b)?;
            write!(f, "{pair}")?;
        }
        Ok(())
    }
}

impl fmt::Display for Pair {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let alignment = &self.alignment;
        let on = match alignment.on {
            "turn" => "on the start of the turn",
            "exit" => "on the exit",
            "time" => "on the times given",
            "warp" => "by time warping",
            _ => "on the first frames",
        };
        let [from, to] = alignment.compared_s;
        let stretch = if alignment.on == "warp" {
            let [low, high] = alignment.stretch;
            format!(", B {low:.2} to {high:.2} times as slow")
        } else {
            String::new()
        };
        let text = format!(
            "Aligned {on} (A {:.2} s, B {:.2} s, +- {:.2} s){stretch}; compared from {from:.2} to {to:.2} s; \
             similarity {:.2}",
            alignment.a_s, alignment.b_s, alignment.deviation_s, alignment.similarity
        );
        paragraph(f, 0, &text)?;
        writeln!(f, "\nmean                        A         B  RMS of B-A")?;
        for channel in Channel::ALL {
            // Means of angles over several turns say nothing.
            if channel == Channel::Heading {
                continue;
            }
            let ((label, _), (unit, factor)) = (channel.label(), channel.drawn());
            let unit = unit.replace("degrees", "deg");
            let [a, b, rms] = [
                &self.channels.a,
                &self.channels.b,
                &self.channels.rms_difference,
            ]
            .map(|numbers| factor * numbers.get(channel));
            writeln!(
                f,
                "{:20} {a:9.1} {b:9.1} {rms:11.1}",
                format!("{label}, {unit}")
            )?;
        }
        writeln!(f, "yaw rate: positive to the left, seen from above")?;
        angles(f, &self.joints)?;
        if self.differences.is_empty() {
            writeln!(f)?;
            return paragraph(f, 0, &capital(&self.first));
        }
        writeln!(f, "\nDifferences of B from A, the largest effect first:")?;
        for (n, place) in self.by_effect.iter().enumerate() {
            paragraph(
                f,
                4,
                &format!("{:2}. {}", n + 1, self.differences[*place].words),
            )?;
        }
        let sound = |trust: Trust| self.differences.iter().any(|told| told.trust == trust);
        writeln!(f)?;
        if sound(Trust::Sound) {
            paragraph(f, 0, &format!("First: {}", self.first))?;
        } else {
            paragraph(f, 0, &capital(&self.first))?;
        }
        together(f, self)
    }
}

/// What was recorded, and what the model misses it by, for the difference that is told first.
fn together(f: &mut fmt::Formatter<'_>, pair: &Pair) -> fmt::Result {
    let flown = |told: &&Difference| told.model_gap.is_some();
    let sound = pair
        .differences
        .iter()
        .filter(|told| told.trust == Trust::Sound);
    let Some(told) = sound.chain(&pair.differences).find(flown) else {
        return Ok(());
    };
    let (Some(measured), Some([gap, gap_b])) = (told.measured, told.model_gap) else {
        return Ok(());
    };
    let degrees = |means: Means| means.turn_radps.to_degrees();
    let text = format!(
        "Turn rates over {:.1} s from {:.2} s (to the left positive, deg/s): recorded B - A {:+.0}; the model misses \
         A by {:+.0} and B by {:+.0}.",
        told.over_s,
        told.time_s[0],
        degrees(measured),
        degrees(gap),
        degrees(gap_b)
    );
    paragraph(f, 0, &text)
}

/// The angles that differ most for their errors.
fn angles(f: &mut fmt::Formatter<'_>, joints: &[Summary]) -> fmt::Result {
    let mut order: Vec<&Summary> = joints.iter().collect();
    let ratio = |joint: &Summary| joint.rms_difference_rad / joint.deviation_rad;
    order.sort_by(|x, y| ratio(y).total_cmp(&ratio(x)));
    writeln!(
        f,
        "\nmean angle, degrees         A         B  difference       RMS  named from"
    )?;
    let mut apart = false;
    for joint in order.into_iter().take(ANGLES) {
        let [a, b, difference, rms, least] = [
            joint.a_rad,
            joint.b_rad,
            joint.difference_rad,
            joint.rms_difference_rad,
            joint.least_named_rad,
        ]
        .map(f64::to_degrees);
        let differs = (b - a - difference).abs() > APART;
        apart |= differs;
        let mark = if differs { " *" } else { "" };
        writeln!(
            f,
            "{:20} {a:9.1} {b:9.1} {difference:+11.1} {rms:9.1} {least:11.1}{mark}",
            joint.joint
        )?;
    }
    if apart {
        let text = "* the angles of this joint turn about axes that nearly coincide, or wrap: the difference counts, which is a \
                    turn about the axes of the joint's parent";
        paragraph(f, 2, text)?;
    }
    Ok(())
}

fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| {
        first.to_uppercase().chain(letters).collect()
    })
}
