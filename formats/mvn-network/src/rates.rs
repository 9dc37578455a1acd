//! Velocity and angular velocity of the pelvis: as sent, otherwise from differences.

use std::collections::VecDeque;

use bodyflight_core::frame::{Body, Inertial, Rotation, Vector};
use nalgebra::Vector3;

use bodyflight_mvnx::rotation_rate;

/// Time over which differences are taken (s), up to the sample itself; they therefore lag by half of it.
pub const DIFFERENCE_WINDOW: f64 = 0.02;
/// Longest gap bridged by a difference (s).
const LONGEST_PAUSE: f64 = 0.1;
/// Sum of squared angular velocities (rad2/s2) needed to determine the unit.
const EVIDENCE: f64 = 5.0;

/// Unit of a sender's angular velocities, which the protocol does not specify.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AngularUnit {
    /// rad/s.
    Radians,
    /// deg/s.
    Degrees,
}

impl AngularUnit {
    fn in_radians(self, sent: Vector3<f64>) -> Vector3<f64> {
        match self {
            Self::Radians => sent,
            Self::Degrees => sent.map(f64::to_radians),
        }
    }
}

#[derive(Debug, Clone, Copy)]
struct Instant {
    time: f64,
    inertial_from_body: Rotation<f64, Inertial, Body>,
    position: Vector<f64, Inertial>,
}

/// Rates of one sample, in the axes of the model.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct PelvisRates {
    /// Velocity (m/s).
    pub(super) velocity: Option<Vector<f64, Inertial>>,
    /// Angular velocity (rad/s).
    pub(super) angular_velocity: Option<Vector<f64, Inertial>>,
    /// Whether each of the two comes from differences.
    pub(super) differenced: [bool; 2],
}

/// The last samples, and the evidence about the unit.
#[derive(Debug, Default)]
pub(super) struct Rates {
    history: VecDeque<Instant>,
    unit: Option<AngularUnit>,
    /// Sums over the samples so far of the dot product of the sent angular velocity with the one from differences, and
    /// of the square of the latter (rad2/s2). Their ratio is about 1 if rad/s are sent, about 57 if deg/s are.
    evidence: [f64; 2],
}

impl Rates {
    /// Starts with the unit, if it is known.
    pub(super) fn new(unit: Option<AngularUnit>) -> Self {
        Self {
            unit,
            ..Self::default()
        }
    }

    /// The unit, if it is known by now.
    pub(super) fn unit(&self) -> Option<AngularUnit> {
        self.unit
    }

    /// The rates of a sample. The velocities given are those sent, if any, in the axes of MVN.
    pub(super) fn push(
        &mut self,
        time: f64,
        inertial_from_body: Rotation<f64, Inertial, Body>,
        position: Vector<f64, Inertial>,
        sent_velocity: Option<Vector3<f64>>,
        sent_angular_velocity: Option<Vector3<f64>>,
    ) -> PelvisRates {
        let now = Instant {
            time,
            inertial_from_body,
            position,
        };
        let differences = self.differences(&now);
        self.history.push_back(now);
        let sent_rotation = sent_angular_velocity.map(Vector::<f64, Inertial>::from_components);
        if let (None, Some(sent), Some((_, measured))) = (self.unit, sent_rotation, &differences) {
            self.learn(&sent.components, &measured.components);
        }
        let velocity = sent_velocity.map(Vector::from_components);
        let angular_velocity = self
            .unit
            .zip(sent_rotation)
            .map(|(unit, sent)| Vector::from_components(unit.in_radians(sent.components)));
        PelvisRates {
            velocity: velocity.or(differences.map(|(velocity, _)| velocity)),
            angular_velocity: angular_velocity.or(differences.map(|(_, rotation)| rotation)),
            differenced: [
                velocity.is_none() && differences.is_some(),
                angular_velocity.is_none() && differences.is_some(),
            ],
        }
    }

    /// Mean velocity (m/s) and angular velocity (rad/s) over the window that ends now.
    fn differences(
        &mut self,
        now: &Instant,
    ) -> Option<(Vector<f64, Inertial>, Vector<f64, Inertial>)> {
        // If the second oldest is far enough back, the oldest is no longer needed.
        while self
            .history
            .get(1)
            .is_some_and(|second| now.time - second.time >= DIFFERENCE_WINDOW)
        {
            self.history.pop_front();
        }
        let from = self.history.front()?;
        let duration = now.time - from.time;
        let newest = self.history.back()?;
        if duration <= 0.0 || now.time - newest.time > LONGEST_PAUSE {
            self.history.clear();
            return None;
        }
        let moved = (now.position - from.position) / duration;
        let turned = rotation_rate(
            from.inertial_from_body.quaternion(),
            now.inertial_from_body.quaternion(),
            duration,
        );
        Some((moved, Vector::from_components(turned)))
    }

    /// Determines the unit by comparing the sent rates with the rotation seen in the orientations.
    fn learn(&mut self, sent: &Vector3<f64>, measured: &Vector3<f64>) {
        self.evidence[0] += sent.dot(measured);
        self.evidence[1] += measured.norm_squared();
        if self.evidence[1] < EVIDENCE {
            return;
        }
        let ratio = self.evidence[0] / self.evidence[1];
        self.unit = if (0.5..2.0).contains(&ratio) {
            Some(AngularUnit::Radians)
        } else if (0.5..2.0).contains(&ratio.to_radians()) {
            Some(AngularUnit::Degrees)
        } else {
            None
        };
        self.evidence = [0.0; 2];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::UnitQuaternion;

    /// A rotation about the vertical at 1.5 rad/s while moving along X, sent in some unit.
    fn turning(sent: impl Fn(f64) -> Option<f64>, frames: u32) -> (Rates, PelvisRates) {
        let mut rates = Rates::new(None);
        let mut last = PelvisRates::default();
        for i in 0..frames {
            let time = f64::from(i) / 240.0;
            let attitude = UnitQuaternion::from_scaled_axis(Vector3::z() * (1.5 * time));
            last = rates.push(
                time,
                Rotation::from_quaternion(attitude),
                Vector::new(2.0 * time, 0.0, 0.0),
                None,
                sent(1.5).map(|rate| Vector3::z() * rate),
            );
        }
        (rates, last)
    }

    #[test]
    fn the_unit_follows_from_the_turn() {
        for (unit, factor) in [
            (AngularUnit::Radians, 1.0),
            (AngularUnit::Degrees, 1f64.to_degrees()),
        ] {
            let (rates, last) = turning(|rate| Some(rate * factor), 40);
            assert_eq!(rates.unit(), Some(unit));
            let rate = last.angular_velocity.unwrap().components;
            assert!((rate - Vector3::z() * 1.5).norm() < 1e-9);
            assert_eq!(last.differenced, [true, false]);
        }
        // It is neither unit, so differences continue to be used.
        let (rates, last) = turning(|rate| Some(rate * -3.0), 100);
        assert_eq!(rates.unit(), None);
        assert!((last.angular_velocity.unwrap().up() - 1.5).abs() < 1e-9);
    }

    #[test]
    fn differences_replace_what_is_not_sent() {
        let (rates, last) = turning(|_| None, 40);
        assert!(rates.history.len() <= 6, "{}", rates.history.len());
        assert_eq!(last.differenced, [true, true]);
        assert!((last.velocity.unwrap() - Vector::new(2.0, 0.0, 0.0)).norm() < 1e-9);
        assert!((last.angular_velocity.unwrap().up() - 1.5).abs() < 1e-9);
        let (_, first) = turning(|_| None, 1);
        assert_eq!(first, PelvisRates::default());
    }

    #[test]
    fn no_difference_is_taken_across_a_pause() {
        let (mut rates, _) = turning(|_| None, 40);
        let mut push = |time| {
            rates.push(
                time,
                Rotation::identity(),
                Vector::new(0.0, 0.0, 0.0),
                None,
                None,
            )
        };
        assert_eq!(push(1.0).velocity, None);
        assert!(push(1.0 + 1.0 / 60.0).velocity.is_some());
        // There is no velocity either if time does not advance.
        assert_eq!(push(1.0).velocity, None);
    }
}
