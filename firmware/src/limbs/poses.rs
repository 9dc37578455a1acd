//! The poses of a calibration as sensors on the limbs feel them: rests of all sensors, and what happens in between.
//!
//! Biases come from the last long rest without any sway, as in a tray, or else from the last pose; scales from full turns
//! between two rests. Upright, bent, a march and upright again is a calibration, whether or not the person stood upright
//! before the march. Nothing needs a signal: what is not held is no rest.

use bodyflight_core::chain::cycle::Cycle;
use bodyflight_core::link::{CalibrationVerdict, LIMBS, LimbSensor, LimbTable};
use bodyflight_core::suit::mounting::{March, MountingError, Stances, fit};
use bodyflight_core::suit::rest::Rest;
use bodyflight_core::suit::set::Fitted;
use bodyflight_core::suit::tray::{Gyroscope, Turns};
use bodyflight_core::{Body, Lanes, Segment};
use nalgebra::{UnitQuaternion, Vector3};

/// Length of the pieces that are judged (s), shortest rest (s), and shortest rest in a tray (s).
const PIECE: f32 = 0.25;
const SHORTEST: f32 = 2.0;
const TRAY: f32 = 6.0;
/// Fewest readings of a sensor in a piece.
const FEWEST: u32 = 10;
/// Largest standard deviation of the angular velocity in a tray (rad/s): nobody stands as still.
const QUIET: f32 = 0.006;
/// Standard deviation of the angular velocity of a person who stands still, while a bias is taken (rad/s).
const SWAY: f32 = 0.002;
/// Cosines of angles of up: within a rest (5 degrees), between two poses that are the same (15), between upright and bent
/// (40), and between a segment and the vertical in the upright pose (25).
const HELD: f32 = 0.996;
const SAME: f32 = 0.966;
const BENT: f32 = 0.766;
const UPRIGHT: f32 = 0.906;
/// Time after which the person stands upright again who marches straight from the bend (s), and shortest and longest march
/// (s).
const STRAIGHTENING: f32 = 1.5;
const SHORTEST_MARCH: f32 = 2.0;
const LONGEST_MARCH: f32 = 15.0;

/// What was seen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Seen {
    /// The poses of a calibration, and now the person stands upright.
    Calibration,
    /// The person stands upright and still, with calibrated sensors.
    Upright,
}

/// One sensor.
#[derive(Debug, Clone, Copy)]
struct Node {
    segment: Segment,
    /// How it lies on its segment, if it is calibrated.
    mounted: Option<UnitQuaternion<f32>>,
    gyroscope: Gyroscope<f32>,
    /// The present piece, the present rest, and the two rests before it.
    piece: Rest<f32>,
    rest: Rest<f32>,
    before: [Rest<f32>; 2],
    /// Up in the last piece at rest.
    up: Vector3<f32>,
    rate: Vector3<f32>,
    /// Motion since the last rest, and the march between the last two.
    turns: Turns<f32>,
    march: March<f32>,
    marched: March<f32>,
    is_turned: bool,
}

impl Node {
    fn new(segment: Segment) -> Self {
        Self {
            segment,
            mounted: None,
            gyroscope: Gyroscope::default(),
            piece: Rest::default(),
            rest: Rest::default(),
            before: [Rest::default(); 2],
            up: Vector3::zeros(),
            rate: Vector3::zeros(),
            turns: Turns::default(),
            march: March::default(),
            marched: March::default(),
            is_turned: false,
        }
    }
}

/// All sensors at rest or in motion.
#[derive(Debug)]
pub(super) struct Poses {
    nodes: heapless::Vec<Node, LIMBS>,
    is_calibrated: bool,
    has_too_many: bool,
    /// Length of the present piece, of the present rest, and time since the last rest (s).
    piece: f32,
    rest: f32,
    moved: f32,
    /// Length of the march between the last two rests (s), and whether the present motion began bent.
    marched: f32,
    is_from_bent: bool,
    rests: u16,
    has_tray: bool,
}

impl Poses {
    /// Sensors of which nothing is known.
    pub(super) const fn new() -> Self {
        Self {
            nodes: heapless::Vec::new(),
            is_calibrated: false,
            has_too_many: false,
            piece: 0.0,
            rest: 0.0,
            moved: 0.0,
            marched: 0.0,
            is_from_bent: false,
            rests: 0,
            has_tray: false,
        }
    }

    /// Sensors with a calibration, if the table has any.
    pub(super) fn of(table: &LimbTable) -> Self {
        let mut poses = Self::new();
        poses.is_calibrated = !table.is_empty();
        for row in table.rows() {
            let mut node = Node::new(row.segment);
            node.mounted = Some(row.fitted().mounting.segment_from_sensor);
            // The table has no more than there is room for.
            let _ = poses.nodes.push(node);
        }
        poses
    }

    /// Number of rests, and sensors whose scale is calibrated.
    pub(super) fn progress(&self) -> [u16; 2] {
        let turned = self.nodes.iter().filter(|node| node.is_turned);
        [
            self.rests,
            turned.fold(0, |mask, node| mask | 1 << node.segment as u8),
        ]
    }

    /// Takes a cycle that came `duration` (s) after the last.
    pub(super) fn take(&mut self, cycle: &Cycle, duration: f32) -> Option<Seen> {
        if !self.is_calibrated {
            self.welcome(cycle);
        }
        self.piece += duration;
        let before = self.moved;
        self.moved += duration;
        let is_straight = before < STRAIGHTENING && self.moved >= STRAIGHTENING;
        let begins_anew = self.is_from_bent && is_straight;
        for node in &mut self.nodes {
            if let Some(reading) = &cycle.readings[node.segment] {
                node.piece.take(reading);
                node.rate = node.gyroscope.corrected(&reading.angular_velocity);
            }
            // A lost rate is taken to be the last one.
            node.turns.take(&node.rate, duration);
            if begins_anew {
                node.march = March::default();
            }
            node.march.take(&node.rate, duration);
        }
        if self.piece < PIECE {
            return None;
        }
        let seen = if self.is_still() {
            self.hold()
        } else {
            self.end_rest();
            None
        };
        for node in &mut self.nodes {
            node.piece = Rest::default();
        }
        self.piece = 0.0;
        seen
    }

    /// Makes room for sensors that are heard first.
    fn welcome(&mut self, cycle: &Cycle) {
        for (segment, reading) in cycle.readings.iter() {
            let is_known = self.nodes.iter().any(|node| node.segment == segment);
            if reading.is_some() && !is_known {
                let is_full = self.nodes.push(Node::new(segment)).is_err();
                self.has_too_many |= is_full;
            }
        }
    }

    /// Whether all sensors that are heard rest, and have not been turned since the rest began.
    fn is_still(&self) -> bool {
        let is_resting = self.rest > 0.0;
        let mut heard = self
            .nodes
            .iter()
            .filter(|node| node.piece.count() >= FEWEST);
        let has_any = heard.clone().next().is_some();
        has_any
            && heard.all(|node| {
                let up = node.piece.up().unwrap_or_else(Vector3::zeros);
                node.piece.is_still() && (!is_resting || up.dot(&node.up) > HELD)
            })
    }

    /// A piece at rest.
    fn hold(&mut self) -> Option<Seen> {
        let begins = self.rest <= 0.0;
        if begins {
            let straightening = if self.is_from_bent {
                STRAIGHTENING
            } else {
                0.0
            };
            self.marched = self.moved - straightening;
        }
        self.moved = 0.0;
        for node in &mut self.nodes {
            let Some(up) = node.piece.up() else { continue };
            if begins {
                node.marched = node.march;
                node.rest = Rest::default();
                let is_as_before = up.dot(&node.up) > HELD;
                // What is no full turn changes nothing.
                let is_full =
                    self.has_tray && is_as_before && node.gyroscope.set_gain(&node.turns).is_ok();
                node.is_turned |= is_full;
            } else {
                node.rest.merge(&node.piece);
            }
            node.up = up;
            node.turns = Turns::default();
            node.march = March::default();
        }
        let before = self.rest;
        self.is_from_bent = self.of_pelvis(|node| {
            let [upright, _] = node.before;
            upright
                .up()
                .is_some_and(|upright| upright.dot(&node.up) <= SAME)
        });
        self.rest += self.piece;
        if self.rest >= TRAY && self.is_quiet() {
            self.take_bias(0.0);
            self.has_tray = true;
        }
        if before >= SHORTEST || self.rest < SHORTEST {
            return None;
        }
        self.rests = self.rests.saturating_add(1);
        if self.is_calibrated {
            return self.is_upright().then_some(Seen::Upright);
        }
        self.is_calibration().then_some(Seen::Calibration)
    }

    /// Motion ends a rest; a short one is forgotten.
    fn end_rest(&mut self) {
        if self.rest >= SHORTEST {
            if !self.has_tray {
                self.take_bias(SWAY);
            }
            // Who stands upright again before the march is where the march begins, and not in the next pose.
            if !self.is_upright_again() {
                for node in &mut self.nodes {
                    let [_, last] = node.before;
                    node.before = [last, node.rest];
                }
            }
        }
        self.rest = 0.0;
    }

    fn is_quiet(&self) -> bool {
        let mut nodes = self.nodes.iter();
        nodes.all(|node| node.rest.rate_deviation() < QUIET)
    }

    /// Takes the biases from the present rest, in which the person may sway (rad/s).
    fn take_bias(&mut self, sway: f32) {
        for node in &mut self.nodes {
            let gyroscope = &mut node.gyroscope;
            gyroscope.set_bias(&node.rest, self.rest);
            let own = gyroscope.bias_deviation;
            gyroscope.bias_deviation = (own * own + sway * sway).root();
        }
    }

    /// Whether the two rests before and the present one are upright, bent and upright, with a march in between.
    fn is_calibration(&self) -> bool {
        self.is_upright_again() && (SHORTEST_MARCH..LONGEST_MARCH).contains(&self.marched)
    }

    /// The same without the march.
    fn is_upright_again(&self) -> bool {
        self.of_pelvis(|node| {
            let [upright, bent] = node.before.map(|rest| rest.up());
            let (Some(upright), Some(bent), Some(now)) = (upright, bent, node.rest.up()) else {
                return false;
            };
            upright.dot(&now) > SAME && upright.dot(&bent) < BENT
        })
    }

    /// What holds of the sensor on the pelvis, or of any if there is none: the verdict then says what is missing.
    fn of_pelvis(&self, holds: impl Fn(&Node) -> bool) -> bool {
        let is_pelvis = |node: &&Node| node.segment == Segment::Pelvis;
        let pelvis = self.nodes.iter().find(is_pelvis).or(self.nodes.first());
        pelvis.is_some_and(holds)
    }

    /// Whether all calibrated sensors that are heard, and that of the pelvis, are as in the upright pose.
    fn is_upright(&self) -> bool {
        let mut has_pelvis = false;
        let is_up = self.nodes.iter().all(|node| {
            let (Some(mounted), Some(up)) = (node.mounted, node.rest.up()) else {
                return true;
            };
            has_pelvis |= node.segment == Segment::Pelvis;
            (mounted * up).z > UPRIGHT
        });
        is_up && has_pelvis
    }

    /// The calibration of all sensors, or why there is none and of which one.
    pub(super) fn fit(&self, body: &Body<f32>) -> Result<LimbTable, (CalibrationVerdict, Segment)> {
        let has_pelvis = self.nodes.iter().any(|n| n.segment == Segment::Pelvis);
        if self.has_too_many {
            return Err((CalibrationVerdict::TooMany, Segment::Pelvis));
        }
        if !has_pelvis {
            return Err((CalibrationVerdict::NoPelvis, Segment::Pelvis));
        }
        let mut table = LimbTable::new();
        // The pelvis first: its row begins a table.
        let (pelvis, others): (heapless::Vec<_, LIMBS>, heapless::Vec<_, LIMBS>) = (
            self.nodes
                .iter()
                .filter(|n| n.segment == Segment::Pelvis)
                .collect(),
            self.nodes
                .iter()
                .filter(|n| n.segment != Segment::Pelvis)
                .collect(),
        );
        for node in pelvis.iter().chain(&others) {
            let [upright, bent] = node.before;
            // A sensor that was silent in a pose takes no part.
            let Some(up) = upright.up() else { continue };
            let stances = Stances {
                upright: up,
                bent: bent.up(),
                march: Some(node.marched),
            };
            let mounting = fit(node.segment, &stances, &UnitQuaternion::identity());
            let mounting = mounting.map_err(|error| {
                let verdict = match error {
                    MountingError::NoHeading => CalibrationVerdict::NoHeading,
                    MountingError::Contradiction => CalibrationVerdict::Contradiction,
                };
                (verdict, node.segment)
            })?;
            let fitted = Fitted {
                segment: node.segment,
                place: body.segments[node.segment].cg,
                gyroscope: node.gyroscope,
                mounting,
                range: None,
            };
            table.insert(&LimbSensor::new(&fitted));
        }
        Ok(table)
    }
}
