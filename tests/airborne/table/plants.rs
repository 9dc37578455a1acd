//! The faults of the table: how each is planted, and which words name it.

use bodyflight_core::Segment;
use bodyflight_core::frame::{Rotation, Vector};
use bodyflight_mvnx::recording::FlightFrame;
use bodyflight_mvnx::xsens::xsens_from_segment;
use nalgebra::{UnitQuaternion, Vector3};

use super::people::Wrong;
use crate::faults::{Capture, turned};

/// Time by which postures are late (s).
const LATE: f64 = 0.025;
/// Angle by which attitudes are turned (rad).
const TURN: f64 = 5.0 * core::f64::consts::PI / 180.0;

/// What is planted.
#[derive(Clone, Copy)]
pub(super) enum Plant {
    /// Frames of a recording, with the factor of its rate, and whether the places of the joints stay as measured.
    Frames(f64, bool, fn(&Capture, usize) -> FlightFrame),
    /// The subject.
    Subject(Wrong),
}

/// Words that name a fault; its size follows.
pub(super) type Words = &'static [&'static str];

/// Something planted: as the page calls it, what is planted one after the other, and the words that name each.
pub(super) struct Row {
    pub(super) planted: &'static str,
    pub(super) plants: Vec<(Plant, Words)>,
}

fn same(capture: &Capture, at: usize) -> FlightFrame {
    capture.frames[at]
}

/// A recording of places and attitudes alone: its rates are what its times make of them.
fn without_rates(capture: &Capture, at: usize) -> FlightFrame {
    let mut changed = capture.frames[at];
    changed.pelvis.velocity = None;
    changed.pelvis.angular_velocity = None;
    changed
}

fn late(capture: &Capture, at: usize) -> FlightFrame {
    let place = (at as f64 - LATE * capture.rate).max(0.0);
    let before = place.floor();
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a frame of the capture"
    )]
    let [from, to] = [0, 1].map(|next| capture.frames[(before as usize + next).min(at)].posture);
    FlightFrame {
        posture: from.interpolated(&to, place - before),
        ..capture.frames[at]
    }
}

fn turned_pelvis(capture: &Capture, at: usize) -> FlightFrame {
    turned(&capture.frames[at], |segments| {
        segments[Segment::Pelvis] *= UnitQuaternion::from_scaled_axis(Vector3::x() * TURN);
    })
}

fn turned_body(capture: &Capture, at: usize) -> FlightFrame {
    let mut changed = capture.frames[at];
    let attitude = *changed.pelvis.inertial_from_body.quaternion();
    let turn = UnitQuaternion::from_scaled_axis(Vector3::x() * TURN);
    changed.pelvis.inertial_from_body = Rotation::from_quaternion(attitude * turn);
    changed
}

fn biased(capture: &Capture, at: usize) -> FlightFrame {
    rated(capture, at, |rate| rate + Vector3::y() * 0.05)
}

fn scaled(capture: &Capture, at: usize) -> FlightFrame {
    rated(capture, at, |rate| rate * 1.03)
}

/// The frame with other angular velocities in axes of the body (rad/s).
fn rated(capture: &Capture, at: usize, change: fn(Vector3<f64>) -> Vector3<f64>) -> FlightFrame {
    let mut changed = capture.frames[at];
    let attitude = *changed.pelvis.inertial_from_body.quaternion();
    let rate = changed.pelvis.angular_velocity.expect("a rate").components;
    let rate = attitude * change(attitude.inverse() * rate);
    changed.pelvis.angular_velocity = Some(Vector::from_components(rate));
    changed
}

/// The frame with the attitudes of both sides exchanged.
fn exchanged(capture: &Capture, at: usize, left: &[Segment]) -> FlightFrame {
    turned(&capture.frames[at], |segments| {
        for left in left {
            // Sensors are calibrated in the T-pose, in which all attitudes are the identity in a file.
            let right = left.mirrored();
            let [own, other] = [*left, right]
                .map(|side| segments[side] * xsens_from_segment(side).quaternion().inverse());
            segments[*left] = other * xsens_from_segment(*left).quaternion();
            segments[right] = own * xsens_from_segment(right).quaternion();
        }
    })
}

fn exchanged_forearms(capture: &Capture, at: usize) -> FlightFrame {
    exchanged(capture, at, &[Segment::LeftForearm, Segment::LeftHand])
}

fn exchanged_arms(capture: &Capture, at: usize) -> FlightFrame {
    let arm = [
        Segment::LeftUpperArm,
        Segment::LeftForearm,
        Segment::LeftHand,
    ];
    exchanged(capture, at, &arm)
}

fn exchanged_legs(capture: &Capture, at: usize) -> FlightFrame {
    let leg = [Segment::LeftThigh, Segment::LeftShank, Segment::LeftFoot];
    exchanged(capture, at, &leg)
}

/// The rows of the table in order.
pub(super) fn rows() -> Vec<Row> {
    let frames = |change: fn(&Capture, usize) -> FlightFrame| Plant::Frames(1.0, false, change);
    let placed = |change: fn(&Capture, usize) -> FlightFrame| Plant::Frames(1.0, true, change);
    let row = |planted, plant, words| Row {
        planted,
        plants: vec![(plant, words)],
    };
    let too_long = |own| Plant::Subject(Wrong::Length(own, 1.1));
    vec![
        row("nothing", frames(same), &[]),
        row(
            "postures late by 25 ms",
            frames(late),
            &["posture-delay delay_s", "the postures are late by"],
        ),
        row(
            "pelvis turned by 5 degrees, places of the joints as measured",
            placed(turned_pelvis),
            &["pelvis is turned by"],
        ),
        row(
            "whole body turned by 5 degrees against its motion",
            frames(turned_body),
            &["mounting x_rad"],
        ),
        row(
            "bias of the gyroscope of 0.050 rad/s",
            frames(biased),
            &["a bias of"],
        ),
        row(
            "scale of the gyroscope of 1.03",
            frames(scaled),
            &["a scale of"],
        ),
        row(
            "frame rate 2 % high",
            Plant::Frames(1.02, false, without_rates),
            &["the frame rate is"],
        ),
        row(
            "frame rate 2 % low",
            Plant::Frames(0.98, false, without_rates),
            &["the frame rate is"],
        ),
        Row {
            planted: "left and right exchanged: forearms with hands, arms, legs",
            plants: vec![
                (
                    placed(exchanged_forearms),
                    &["left and right forearm and hand are exchanged"],
                ),
                (
                    placed(exchanged_arms),
                    &["left and right arm are exchanged"],
                ),
                (
                    placed(exchanged_legs),
                    &["left and right leg are exchanged"],
                ),
            ],
        },
        row(
            "a thigh 1.5 times as heavy in the subject",
            Plant::Subject(Wrong::Mass(Segment::LeftThigh, 1.5)),
            &["l_thigh of the subject weighs"],
        ),
        row(
            "a thigh 10 % too long in the subject",
            too_long(Segment::LeftThigh),
            &["l_thigh is"],
        ),
        row(
            "a forearm 10 % too long in the subject",
            too_long(Segment::RightForearm),
            &["r_forearm is"],
        ),
    ]
}
