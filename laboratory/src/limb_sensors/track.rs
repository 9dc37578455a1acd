//! The track of a receiver in the flight, as FlySight 1 writes it.

use std::fmt::Write as _;
use std::path::Path;

use bodyflight_core::frame::Vector;
use bodyflight_io::diagnostic::Result;
use bodyflight_io::files::write_file;
use bodyflight_mvnx::recording::FlightFrame;
use nalgebra::Vector3;
use rand::rngs::ChaCha8Rng;

use super::errors::normal;

/// Solutions in a second, and standard deviations of the velocity, horizontal and vertical (m/s).
const RATE: f64 = 5.0;
const VELOCITY: [f64; 2] = [0.1, 0.2];
/// Time before and after the flight, at the velocity of its begin and end (s).
const AROUND: f64 = 4.0;
/// Length of a degree of latitude (m), and latitude and longitude of the begin (degrees).
const DEGREE: f64 = 111_320.0;
const BEGIN: [f64; 2] = [46.0, 8.0];

/// A solution: time (s), place and velocity, north, west and up (m, m/s).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fix {
    time: f64,
    place: Vector3<f64>,
    velocity: Vector3<f64>,
}

impl Fix {
    /// Time since the begin of the flight (s) and velocity (m/s, north, west, up); `None` before it.
    pub(super) fn in_flight(&self) -> Option<(f64, Vector3<f64>)> {
        let time = self.time - AROUND;
        (time >= 0.0).then_some((time, self.velocity))
    }
}

pub(super) fn of(random: &mut ChaCha8Rng, frames: &[FlightFrame]) -> Vec<Fix> {
    let mut track = Vec::new();
    let (Some(first), Some(last)) = (frames.first(), frames.last()) else {
        return track;
    };
    let mut frame = first;
    let mut rest = frames.iter().peekable();
    while track.len() as f64 / RATE <= last.time + 2.0 * AROUND {
        let time = track.len() as f64 / RATE - AROUND;
        while let Some(next) = rest.next_if(|next| next.time <= time + 1e-9) {
            frame = next;
        }
        let velocity = frame.pelvis.velocity.unwrap_or_else(Vector::zero);
        let velocity = velocity.components;
        let [level, up] = VELOCITY;
        let noise = normal(random).component_mul(&Vector3::new(level, level, up));
        track.push(Fix {
            time: time + AROUND,
            place: frame.pelvis.position.components + velocity * (time - frame.time),
            velocity: velocity + noise,
        });
    }
    track
}

pub(super) fn write(track: &[Fix], path: &Path) -> Result<()> {
    let mut text = String::from(
        "time,lat,lon,hMSL,velN,velE,velD,hAcc,vAcc,sAcc,gpsFix,numSV\n,(deg),(deg),(m),(m/s),(m/s),(m/s),(m),(m),(m/s),,\n",
    );
    let [latitude, longitude] = BEGIN;
    for Fix {
        time,
        place,
        velocity,
    } in track
    {
        let north = latitude + place.x / DEGREE;
        let east = longitude - place.y / (DEGREE * latitude.to_radians().cos());
        let (minute, second) = ((time / 60.0).floor(), time % 60.0);
        // Writing to a String cannot fail.
        let _ = writeln!(
            text,
            "2026-06-01T10:{minute:02.0}:{second:06.3}Z,{north:.7},{east:.7},{:.3},{:.2},{:.2},{:.2},2.0,3.0,0.25,3,12",
            place.z, velocity.x, -velocity.y, -velocity.z
        );
    }
    write_file(path, text.as_bytes())
}
