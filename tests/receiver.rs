//! The track that a satellite receiver would record during a recorded flight.

use std::fmt::Write as _;
use std::path::Path;

use bodyflight_mvnx::recording::{FlightFrame, Options, Recording};
use nalgebra::Vector3;

use crate::estimator_flights::Noise;

/// Time after the flight that a track covers (s).
const AFTER: f64 = 1.0;

/// Half of the time over which the receiver's own filter takes the mean (s).
const FILTERED: f64 = 0.05;

/// A receiver.
#[derive(Debug, Clone, Copy)]
pub struct Receiver {
    /// Solutions in a second.
    pub rate: f64,
    /// Standard deviation of each horizontal component of the velocity (m/s), which it states; the vertical one is half as
    /// large again.
    pub deviation: f64,
    /// Time for which its errors last (s); zero for errors that are independent of each other.
    pub lasts: f64,
    /// Time of its track before the flight (s), by which its clock is ahead of the recording's.
    pub before: f64,
}

impl Receiver {
    /// Its track of a recorded flight, as a FlySight 2 writes it. Panics if the recording is not readable.
    pub fn track(&self, recording: &Path, seed: u64) -> String {
        let frames: Vec<FlightFrame> = Recording::open(recording, Options::default())
            .and_then(Iterator::collect)
            .unwrap_or_else(|problem| panic!("{problem}"));
        let mut text = "$FLYS,1\n$VAR,FIRMWARE_VER,v2023.07.01\n\
                        $COL,GNSS,time,lat,lon,hMSL,velN,velE,velD,hAcc,vAcc,sAcc,numSV\n\
                        $UNIT,GNSS,,deg,deg,m,m/s,m/s,m/s,m,m,m/s,\n$DATA\n"
            .to_owned();
        let mut noise = Noise::new(seed);
        let sizes = Vector3::new(1.0, 1.0, 1.5) * self.deviation;
        let mut draw = || sizes.map(|size| noise.normal(size));
        let mut error = draw();
        let kept = if self.lasts > 0.0 {
            (-1.0 / (self.rate * self.lasts)).exp()
        } else {
            0.0
        };
        let last = frames.last().map_or(0.0, |frame| frame.time);
        let first = -self.before;
        let rows = (0u32..).map(|row| f64::from(row) / self.rate);
        for since in rows.take_while(|since| first + since <= last + AFTER) {
            let time = (first + since).clamp(0.0, last);
            let begin = frames.partition_point(|frame| frame.time < time - FILTERED);
            let end = frames.partition_point(|frame| frame.time <= time + FILTERED);
            let near = frames.get(begin..end).unwrap_or_default().iter();
            let velocities = near.filter_map(|frame| frame.pelvis.velocity);
            let sum: Vector3<f64> = velocities.map(|velocity| velocity.components).sum();
            let seen = sum / (end - begin).max(1) as f64 + error;
            error = error * kept + draw() * (1.0 - kept * kept).sqrt();
            let (minute, second) = ((since / 60.0).floor(), since % 60.0);
            // Writing to a String cannot fail.
            let _ = writeln!(
                text,
                "$GNSS,2024-06-01T12:{minute:02}:{second:06.3}Z,46.0,8.0,3000.0,{:.2},{:.2},{:.2},3.0,4.0,{:.2},14",
                seen.x, -seen.y, -seen.z, self.deviation
            );
        }
        text
    }
}
