//! What if: a flight simulated with a change, beside the same flight without it.
//!
//! Both runs begin with the same motion. Postures are the recorded ones, with the change of the joints: the person does not
//! react to what the change does.

use std::fmt;

use bodyflight_core::observation::Observation;
use bodyflight_replay::Precision;
use bodyflight_replay::comparison::Channel;
use bodyflight_replay::flight::Flight;
use bodyflight_replay::joint_change::{JointChange, check_windows};
use bodyflight_replay::steps::{Replay, Step};
use bodyflight_replay::subject::Subject;
use serde::Serialize;

use crate::output::plot::{CHANGED, Curve, Panel, UNCHANGED, figure_svg};
use bodyflight_io::diagnostic::Result;
use bodyflight_io::interrupt;
use bodyflight_mvnx::recording::{Options, Warning, faults};

/// Most rows over time in a report, and in its text.
const ROWS: usize = 101;
const ROWS_SHOWN: usize = 11;
/// Bend of a knee below which it is bent forwards (rad).
const FORWARDS: f64 = -0.1;

/// What is changed.
#[derive(Debug, Clone, Default)]
pub struct Change {
    /// Joints.
    pub joints: Vec<JointChange>,
    /// The person, if it is another one.
    pub subject: Option<Subject>,
    /// Whether known conscious inputs are left out.
    pub without_inputs: bool,
}

impl Change {
    /// Whether there is none.
    pub fn is_none(&self) -> bool {
        self.joints.is_empty() && self.subject.is_none() && !self.without_inputs
    }

    /// The flight with the change, apart from the joints.
    fn applied(&self, flight: &Flight) -> Flight {
        let mut changed = flight.clone();
        if let Some(subject) = &self.subject {
            changed.subject = subject.clone();
            changed.has_subject = true;
        }
        if self.without_inputs {
            changed.inputs = None;
        }
        changed
    }

    /// When it begins to act (s).
    fn begin(&self) -> Option<f64> {
        if self.subject.is_some() || self.without_inputs {
            return None;
        }
        let begins = self
            .joints
            .iter()
            .map(|joint| joint.window().map(|[begin, _]| begin));
        // One that acts all the time decides.
        begins
            .collect::<Option<Vec<f64>>>()?
            .into_iter()
            .reduce(f64::min)
    }
}

/// The result of a change.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Report {
    /// Number of frames simulated.
    pub frames: u64,
    /// Length of the flight (s).
    pub duration_s: f64,
    /// When the change begins (s since frame 0); means are from then on.
    pub from_s: f64,
    /// The joints that are changed.
    pub joints: Vec<Joint>,
    /// Whether the person is another one.
    pub other_subject: bool,
    /// Whether the known conscious inputs of the flight are left out.
    pub without_inputs: bool,
    /// Mean turn rate about the vertical, positive counter-clockwise from above, that is to the left (rad/s).
    pub turn_radps: Both,
    /// Angle turned about the vertical from then on (rad).
    pub turned_rad: Both,
    /// Mean fall rate (m/s).
    pub fall_mps: Both,
    /// Largest angle between the two attitudes (rad).
    pub largest_attitude_difference_rad: f64,
    /// Angle between the two attitudes at the end (rad).
    pub attitude_difference_rad: f64,
    /// The two runs over time, at most 101 rows.
    pub over_time: Vec<Row>,
    /// Inconsistencies of the recording, and angles that no joint reaches.
    pub warnings: Vec<Warning>,
    /// The same in sentences about the change.
    pub notes: Vec<String>,
    /// Why the result means nothing, if one of the simulations diverges.
    pub diverged: Option<String>,
}

impl Report {
    /// Why the result cannot be trusted.
    pub fn doubt(&self) -> Option<String> {
        faults(&self.warnings).or_else(|| self.diverged.clone())
    }
}

/// A value without and with the change.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Both {
    /// Without the change.
    pub unchanged: f64,
    /// With it.
    pub changed: f64,
    /// The difference that the change makes.
    pub difference: f64,
}

impl Both {
    fn of(unchanged: f64, changed: f64) -> Self {
        Self {
            unchanged,
            changed,
            difference: changed - unchanged,
        }
    }
}

/// A joint that is changed.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Joint {
    /// Name of joint and angle.
    pub joint: String,
    /// The change (rad); null for a curve.
    pub change_rad: Option<f64>,
    /// When it acts (s); null for the whole flight.
    pub window_s: Option<[f64; 2]>,
    /// Smallest and largest angle as recorded (rad).
    pub recorded_rad: [f64; 2],
    /// Smallest and largest angle with the change (rad).
    pub changed_rad: [f64; 2],
}

/// Both runs at one time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Row {
    /// Time since frame 0 (s).
    pub time_s: f64,
    /// Turn rate about the vertical, positive to the left (rad/s).
    pub turn_radps: Both,
    /// Fall rate (m/s).
    pub fall_mps: Both,
    /// Angle between the two attitudes (rad).
    pub attitude_difference_rad: f64,
}

/// A change with the data for figures.
#[derive(Debug, Clone)]
pub struct Simulation {
    /// The numbers.
    pub report: Report,
    /// Time (s), and what is observed without and with the change, thinned out.
    pub seen: Vec<(f64, [Observation<f64>; 2])>,
}

/// Most points of a curve.
const POINTS: usize = 4000;

/// Simulates a flight with and without a change. `each` is called with both steps of every frame; `progress` with the time
/// reached (s).
///
/// # Errors
/// Returns an error if a file is unusable, there are fewer than two frames, or a simulation diverges.
pub fn what_if(
    flight: &Flight,
    change: &Change,
    options: Options,
    precision: Precision,
    each: &mut dyn FnMut([&Step; 2]) -> Result<()>,
    progress: &mut dyn FnMut(f64),
) -> Result<Simulation> {
    let other = change.applied(flight);
    let mut unchanged = Replay::open(flight, options, precision)?;
    let start = unchanged.start().simulated;
    let begin = unchanged.start().time;
    let mut changed = Replay::open_changed(&other, options, precision, &change.joints, &start)?;
    let mut sums = Sums::new(change, change.begin().unwrap_or(begin).max(begin));
    sums.postures(change, [unchanged.start(), changed.start()]);
    while let (Some(one), Some(two)) = (unchanged.next(), changed.next()) {
        let (one, two) = (one?, two?);
        sums.add(&one, &two);
        sums.postures(change, [&one, &two]);
        each([&one, &two])?;
        if sums.frames.is_multiple_of(1024) {
            progress(one.time);
            interrupt::check()?;
        }
    }
    check_windows(&change.joints, begin, sums.end)?;
    let warnings = unchanged.frames().warnings();
    let mut simulation = sums.simulation(change, begin, warnings);
    simulation.report.diverged = unchanged.diverged().or_else(|| changed.diverged());
    Ok(simulation)
}

/// What is collected from frame to frame.
struct Sums {
    from: f64,
    frames: u64,
    counted: f64,
    end: f64,
    turn: [f64; 2],
    fall: [f64; 2],
    turned: [f64; 2],
    largest: f64,
    last: f64,
    before: Option<f64>,
    every: usize,
    skipped: usize,
    seen: Vec<(f64, [Observation<f64>; 2], f64)>,
    angles: Vec<[[f64; 2]; 2]>,
}

impl Sums {
    fn new(change: &Change, from: f64) -> Self {
        Self {
            from,
            frames: 1,
            counted: 0.0,
            end: from,
            turn: [0.0; 2],
            fall: [0.0; 2],
            turned: [0.0; 2],
            largest: 0.0,
            last: 0.0,
            before: None,
            every: 1,
            skipped: 0,
            seen: Vec::new(),
            angles: vec![[[f64::INFINITY, f64::NEG_INFINITY]; 2]; change.joints.len()],
        }
    }

    fn add(&mut self, one: &Step, two: &Step) {
        let motions = [&one.simulated, &two.simulated];
        let observed = motions.map(Observation::of);
        let [a, b] = motions.map(|motion| *motion.inertial_from_body.quaternion());
        self.last = a.angle_to(&b);
        self.largest = self.largest.max(self.last);
        self.frames += 1;
        self.end = one.time;
        if one.time >= self.from {
            self.counted += 1.0;
            let step = self.before.map_or(0.0, |before| one.time - before);
            for (k, seen) in observed.iter().enumerate() {
                self.turn[k] += seen.yaw_rate;
                self.fall[k] -= seen.vertical_velocity;
                self.turned[k] += seen.yaw_rate * step;
            }
            self.before = Some(one.time);
        }
        self.skipped += 1;
        if self.skipped >= self.every {
            self.skipped = 0;
            self.seen.push((one.time, observed, self.last));
            if self.seen.len() > POINTS {
                self.seen = self.seen.iter().copied().step_by(2).collect();
                self.every *= 2;
            }
        }
    }

    /// The angles of the changed joints, recorded and changed.
    fn postures(&mut self, change: &Change, steps: [&Step; 2]) {
        for (joint, angles) in change.joints.iter().zip(&mut self.angles) {
            for ([least, most], step) in angles.iter_mut().zip(steps) {
                let angle = joint.angle(&step.posture);
                *least = least.min(angle);
                *most = most.max(angle);
            }
        }
    }

    fn simulation(self, change: &Change, begin: f64, warnings: Vec<Warning>) -> Simulation {
        let count = self.counted.max(1.0);
        let mean = |sums: [f64; 2]| Both::of(sums[0] / count, sums[1] / count);
        let joints: Vec<Joint> = (change.joints.iter().zip(&self.angles))
            .map(|(joint, [recorded, changed])| Joint {
                joint: joint.name(),
                change_rad: joint.constant(),
                window_s: joint.window(),
                recorded_rad: *recorded,
                changed_rad: *changed,
            })
            .collect();
        let bent = |(change, joint): (&JointChange, &Joint)| {
            let [least, _] = joint.changed_rad;
            let by = change.is_bend() && least < FORWARDS;
            by.then(|| {
                let degrees = -least.to_degrees();
                format!(
                    "{} bends the knee forwards by {degrees:.0} degrees",
                    joint.joint
                )
            })
        };
        let notes = change.joints.iter().zip(&joints).filter_map(bent).collect();
        let every = self.seen.len().div_ceil(ROWS).max(1);
        let row = |(time, [one, two], apart): &(f64, [Observation<f64>; 2], f64)| Row {
            time_s: *time,
            turn_radps: Both::of(one.yaw_rate, two.yaw_rate),
            fall_mps: Both::of(-one.vertical_velocity, -two.vertical_velocity),
            attitude_difference_rad: *apart,
        };
        Simulation {
            report: Report {
                frames: self.frames,
                duration_s: self.end - begin,
                from_s: self.from,
                joints,
                other_subject: change.subject.is_some(),
                without_inputs: change.without_inputs,
                turn_radps: mean(self.turn),
                turned_rad: Both::of(self.turned[0], self.turned[1]),
                fall_mps: mean(self.fall),
                largest_attitude_difference_rad: self.largest,
                attitude_difference_rad: self.last,
                over_time: self.seen.iter().step_by(every).map(row).collect(),
                warnings,
                notes,
                diverged: None,
            },
            seen: (self.seen.into_iter())
                .map(|(time, seen, _)| (time, seen))
                .collect(),
        }
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for joint in &self.joints {
            let [from, to] = joint.recorded_rad.map(f64::to_degrees);
            let [least, most] = joint.changed_rad.map(f64::to_degrees);
            writeln!(
                f,
                "{}: recorded {from:.0} to {to:.0} degrees, changed {least:.0} to {most:.0}",
                joint.joint
            )?;
        }
        writeln!(
            f,
            "\nmean from {:.2} s on     unchanged   changed  difference",
            self.from_s
        )?;
        let mut line = |name: &str, both: Both, factor: f64| {
            let [one, two, apart] =
                [both.unchanged, both.changed, both.difference].map(|value| factor * value);
            writeln!(f, "{name:22} {one:11.1} {two:9.1} {apart:+11.1}")
        };
        let degrees = 1.0_f64.to_degrees();
        line("turn rate, deg/s", self.turn_radps, degrees)?;
        line("turned, deg", self.turned_rad, degrees)?;
        line("fall rate, m/s", self.fall_mps, 1.0)?;
        writeln!(
            f,
            "\ntime, s   turn rate, deg/s   fall rate, m/s   attitudes apart, deg"
        )?;
        let every = self.over_time.len().div_ceil(ROWS_SHOWN).max(1);
        for row in self.over_time.iter().step_by(every) {
            writeln!(
                f,
                "{:7.2}   {:7.1} {:+8.1}   {:7.1} {:+6.1}   {:8.1}",
                row.time_s,
                row.turn_radps.changed.to_degrees(),
                row.turn_radps.difference.to_degrees(),
                row.fall_mps.changed,
                row.fall_mps.difference,
                row.attitude_difference_rad.to_degrees()
            )?;
        }
        write!(
            f,
            "changed, and the difference to unchanged; turns to the left are positive; both runs begin with the same motion"
        )
    }
}

/// A figure of all channels, without and with the change.
///
/// # Errors
/// Returns an error if the figure cannot be drawn.
pub fn svg(title: &str, simulation: &Simulation) -> Result<String> {
    let panels = Channel::ALL.map(|channel| {
        let (label, (unit, factor)) = (channel.titled(), channel.drawn());
        let curve = |line, run: usize| Curve {
            line,
            points: (simulation.seen.iter())
                .map(|(time, seen)| (*time, factor * channel.value(&seen[run])))
                .collect(),
        };
        Panel {
            caption: format!("{label} ({unit})"),
            curves: vec![curve(UNCHANGED, 0), curve(CHANGED, 1)],
            bands: Vec::new(),
            shades: Vec::new(),
            wraps: channel.is_angle(),
        }
    });
    figure_svg(title, &panels)
}
