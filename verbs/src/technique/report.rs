//! The result of `bodyflight technique`, and its text.

use std::fmt;

use bodyflight_mvnx::recording::Warning;
use serde::Serialize;

use super::against::{Against, Merit, TURN, Turn};
use super::agreement::Agreement;
use super::patterns::State;
use super::response::{HIGHEST_HZ, Response, Root};

/// Most weights in the text.
const MOST: usize = 8;

/// The movement patterns of a flight.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Report {
    /// Frames used, at most about 60 a second.
    pub frames: u64,
    /// Time of the first (s since frame 0).
    pub from_s: f64,
    /// Time of the last (s since frame 0).
    pub to_s: f64,
    /// Time that they cover (s).
    pub duration_s: f64,
    /// Joint error assumed, per axis (rad).
    pub joint_error_rad: f64,
    /// Root mean square of the largest pattern that such errors make (rad); smaller ones are not named.
    pub floor_rad: f64,
    /// How many of the first eight patterns are below that.
    pub below_errors: u64,
    /// The patterns, the largest share first.
    pub patterns: Vec<Pattern>,
    /// Number, from 1, of the pattern that contributes most to the turn rate; null if none was found.
    pub turning: Option<u64>,
    /// The fall about which the model is linearised; null if there is none.
    pub fall: Option<Fall>,
    /// The recorded turn rate against the linear one; null if there is none.
    pub recorded: Option<Recorded>,
    /// The turn pattern against the best of other flights, and changes of its joints.
    pub against: Option<Against>,
    /// Reasons not to trust the result.
    pub doubts: Vec<String>,
    /// What is implausible in the recording.
    pub warnings: Vec<Warning>,
}

/// The turn rate that the linear response to all recorded joint angles gives, against the recorded one. Means are left out.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Recorded {
    /// Correlation of the two.
    pub correlation: f64,
    /// Recorded turn rate for the linear one: slope of the best line, if all that scatters is in the recorded turn rate.
    pub slope: f64,
    /// The same if all that scatters is in the recorded joints: their errors turn the linear response, but no body.
    pub slope_of_exact_joints: f64,
    /// Root mean square of the recorded turn rate about its mean (rad/s).
    pub turn_rms_radps: f64,
}

/// A movement pattern: joint angles that change together.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Pattern {
    /// Whether it can be told.
    pub state: State,
    /// Share of the variance of all joint angles.
    pub share: f64,
    /// Root mean square of its amplitude (rad).
    pub rms_rad: f64,
    /// Largest amplitude either way (rad).
    pub largest_rad: f64,
    /// How much each joint angle changes per unit of the pattern; squares add up to 1.
    pub weights: Vec<Weight>,
    /// What the body answers; null if there is no linear response.
    pub answer: Option<Answer>,
}

/// The part of a joint angle in a pattern.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Weight {
    /// The joint angle, named as for `simulate --joint`.
    pub angle: String,
    /// Its change per unit of the pattern.
    pub weight: f64,
    /// The same without what errors may have made, of length 1: responses are those of this movement. 0 if it is left out.
    pub told: f64,
    /// Standard deviation of the weight due to joint errors.
    pub deviation: f64,
}

/// The response of the fall to a pattern.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Answer {
    /// Root mean square of the pattern times the gain of the turn rate (rad/s).
    pub turn_share_radps: f64,
    /// The response of each output.
    pub responses: Vec<Response>,
    /// How far the linear turn rate agrees with the full simulation; empty if the pattern does not turn the body.
    pub agreement: Vec<Agreement>,
}

/// The steady fall of the neutral pose, and how the recording compares with it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Fall {
    /// Fall rate (m/s).
    pub fall_rate_mps: f64,
    /// Rotation about the left axis from standing (rad).
    pub body_pitch_rad: f64,
    /// Bend of the knees (rad) that makes the fall vertical; null if none does, and the body glides.
    pub knee_rad: Option<f64>,
    /// Horizontal for vertical speed, positive towards the head.
    pub glide: f64,
    /// Growth of its fastest growing motion (1/s); null if it is stable.
    pub growth_per_s: Option<f64>,
    /// Share of the recorded frames that are belly to earth.
    pub belly_share: f64,
    /// Mean fall rate of the recording (m/s).
    pub mean_fall_mps: Option<f64>,
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{:.1} s from {:.1} to {:.1} s; assumed joint errors of {:.1} degrees make\npatterns of up to {:.1} degrees RMS",
            self.duration_s,
            self.from_s,
            self.to_s,
            self.joint_error_rad.to_degrees(),
            self.floor_rad.to_degrees()
        )?;
        if let Some(fall) = &self.fall {
            let stable = match fall.growth_per_s {
                None => "stable".to_owned(),
                Some(growth) => format!("unstable, grows by {growth:.2}/s"),
            };
            let how = match fall.knee_rad {
                Some(knee) => format!("trimmed, knees {:.0} degrees", knee.to_degrees()),
                None => format!("not trimmed, glide {:+.2}", fall.glide),
            };
            writeln!(
                f,
                "response about a fall at {:.1} m/s, {how},\n{stable}",
                fall.fall_rate_mps
            )?;
        }
        if let Some(recorded) = &self.recorded {
            writeln!(
                f,
                "turn rate recorded against the linear one: correlation {:.2}, slope {:.2}\n(or {:.2} if it is the joints that are recorded wrong)",
                recorded.correlation, recorded.slope, recorded.slope_of_exact_joints
            )?;
        }
        for (k, pattern) in self.patterns.iter().enumerate() {
            writeln!(f)?;
            pattern.write(f, k + 1)?;
        }
        if self.below_errors > 0 && !self.patterns.is_empty() {
            writeln!(
                f,
                "\nfurther patterns are below what the assumed joint errors make: cannot tell"
            )?;
        }
        if let (Some(number), Some(against)) = (self.turning, &self.against) {
            writeln!(f, "\npattern {number} turns the body most")?;
            write_against(f, against)?;
        }
        Ok(())
    }
}

impl Pattern {
    fn write(&self, f: &mut fmt::Formatter<'_>, number: usize) -> fmt::Result {
        let state = match self.state {
            State::Mixed => ", mixed with another of the same size",
            State::Named | State::BelowErrors => "",
        };
        writeln!(
            f,
            "pattern {number}: {:.0} % of the movement, {:.1} degrees RMS, at most {:.1}{state}",
            100.0 * self.share,
            self.rms_rad.to_degrees(),
            self.largest_rad.to_degrees()
        )?;
        let shown = self.weights.iter().filter(|weight| weight.told.abs() > 0.0);
        for weight in shown.take(MOST) {
            writeln!(
                f,
                "  {:18} {:+.2} +- {:.2}",
                weight.angle, weight.weight, weight.deviation
            )?;
        }
        let Some(answer) = &self.answer else {
            return Ok(());
        };
        writeln!(
            f,
            "  output              gain per rad           bandwidth, Hz"
        )?;
        for response in &answer.responses {
            let label = match response.output {
                "turn_rate_radps" => "turn rate, rad/s",
                "fall_rate_mps" => "fall rate, m/s",
                "forward_drift_mps" => "forwards, m/s",
                "left_drift_mps" => "to the left, m/s",
                _ => "pitch, rad",
            };
            writeln!(
                f,
                "  {label:18} {:+13.3} +- {:<6.3} {:>11}",
                response.gain,
                response.gain_deviation,
                bandwidth(response.bandwidth_hz)
            )?;
        }
        if let Some(turn) = answer.responses.get(TURN) {
            writeln!(f, "  poles of the turn rate, 1/s: {}", roots(&turn.poles))?;
            writeln!(f, "  zeros, 1/s: {}", roots(&turn.zeros))?;
        }
        if answer.agreement.is_empty() {
            return writeln!(f, "  it hardly turns the body: its range is not judged");
        }
        let ranges: Vec<String> = answer.agreement.iter().map(range).collect();
        writeln!(f, "  turn rate within 10 % of the full simulation up to")?;
        writeln!(f, "  {}", ranges.join(", "))
    }
}

fn range(agreement: &Agreement) -> String {
    let input = match agreement.frequency_hz {
        None => "step".to_owned(),
        Some(frequency) => format!("{frequency} Hz"),
    };
    let more = if agreement.is_limit { "" } else { ">=" };
    match agreement.valid_to_rad {
        Some(valid) => format!("{more}{:.1} ({input})", valid.to_degrees()),
        None => format!("none ({input})"),
    }
}

fn bandwidth(found: Option<f64>) -> String {
    found.map_or_else(
        || format!("above {HIGHEST_HZ:.0}"),
        |frequency| format!("{frequency:.2}"),
    )
}

fn roots(all: &[Root]) -> String {
    let texts: Vec<String> = all
        .iter()
        .filter(|root| root.im_radps >= 0.0)
        .map(|root| {
            if root.im_radps > 1e-6 {
                format!("{:.2}+-{:.2}i", root.re_per_s, root.im_radps)
            } else {
                format!("{:.2}", root.re_per_s)
            }
        })
        .collect();
    if texts.is_empty() {
        "none".to_owned()
    } else {
        texts.join(" ")
    }
}

fn write_against(f: &mut fmt::Formatter<'_>, against: &Against) -> fmt::Result {
    let line = |f: &mut fmt::Formatter<'_>, name: &str, merit: &Merit, turn: Option<&Turn>| {
        let turned = turn.map_or_else(String::new, |turn| {
            format!("{:9.0}", turn.turned_rad.to_degrees())
        });
        writeln!(
            f,
            "  {name:32} {:8.2} {:>13} {turned}",
            merit.gain,
            bandwidth(merit.bandwidth_hz)
        )
    };
    if let (Some(best), Some(alike)) = (&against.best, against.alike) {
        writeln!(
            f,
            "best of the others: {best}; cosine of the patterns {alike:.2}"
        )?;
    }
    writeln!(
        f,
        "  technique                            gain bandwidth, Hz  turned, deg"
    )?;
    line(f, "own", &against.own, against.own_turn.as_ref())?;
    if let Some(other) = &against.other {
        line(f, "the other's", other, against.other_turn.as_ref())?;
    }
    for (k, change) in against.changes.iter().enumerate() {
        let turn = against.changed_turn.as_ref().filter(|_| k == 0);
        let name = format!("{} {}", change.joint, change.change);
        line(f, &name, &change.merit, turn)?;
    }
    if against.changes.is_empty() {
        writeln!(
            f,
            "no change of one joint gains bandwidth and keeps half of the gain"
        )?;
    }
    writeln!(
        f,
        "turned: by the full simulation in 2 s, {:.1} degrees of the pattern held",
        against.step_rad.to_degrees()
    )
}
