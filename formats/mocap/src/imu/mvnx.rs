//! The sensors in a recording of MVN: their own readings, or orientations by the suit's fusion and accelerations.

use std::path::Path;

use bodyflight_core::Segment;
use bodyflight_core::suit::strapdown::Reading;
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_mvnx::field::{Field, Fields, ReadOptions};
use bodyflight_mvnx::frame::{Frame, FrameKind};
use bodyflight_mvnx::reader::Reader;
use bodyflight_mvnx::xsens::MvnSegment;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::fused::{Turning, with_gravity};
use super::mapping::SensorRow;
use super::stream::Stream;

/// The samples of one sensor.
#[derive(Default)]
struct Samples {
    times: Vec<f64>,
    readings: Vec<Reading<f64>>,
    turning: Turning,
    is_fused: bool,
}

/// Reads the sensors of the segments; `prefix` is the name of a sensor, if it is not that of MVN's segment.
///
/// # Errors
/// Returns an error if the file cannot be read, or lacks a sensor or its readings.
pub(super) fn streams(
    path: &Path,
    rows: &[(Segment, &SensorRow)],
) -> Result<Vec<(Segment, Stream)>> {
    let fields = Fields::NONE
        .with(Field::SensorOrientation)
        .with(Field::SensorFreeAcceleration)
        .with(Field::SensorAngularVelocity)
        .with(Field::SensorAcceleration);
    let options = ReadOptions {
        fields,
        ..ReadOptions::default()
    };
    let mut reader = Reader::open(path, options)?;
    let header = reader.header().clone();
    let place = |segment: Segment, row: &SensorRow| {
        let own = MvnSegment::leading(segment).label();
        let name = if row.prefix.is_empty() {
            own
        } else {
            &row.prefix
        };
        let place = header.sensors.iter().position(|sensor| sensor == name);
        place.ok_or_else(|| {
            Problem::unknown("sensor", name, header.sensors.iter().map(String::as_str))
                .at(format!("table sensors.{}", segment.name()))
                .in_file(path)
        })
    };
    let mut places = Vec::new();
    for (segment, row) in rows {
        places.push((*segment, place(*segment, row)?, Samples::default()));
    }
    let mut frame = Frame::default();
    while reader.next_frame(&mut frame)? {
        if frame.kind != FrameKind::Normal || frame.fault.is_some() {
            continue;
        }
        let time = frame.index as f64 / header.frame_rate;
        for (_, place, samples) in &mut places {
            samples.take(time, &frame, *place);
        }
    }
    let each = places.into_iter().map(|(segment, _, samples)| {
        let is_fused = samples.is_fused;
        let mut stream = Stream::new(samples.times, samples.readings).map_err(|problem| {
            problem
                .at(format!("sensor {}", segment.name()))
                .in_file(path)
                .help("export with sensorOrientation and sensorFreeAcceleration, or with sensorAngularVelocity and sensorAcceleration")
        })?;
        stream.is_fused = is_fused;
        Ok((segment, stream))
    });
    each.collect()
}

impl Samples {
    fn take(&mut self, time: f64, frame: &Frame, place: usize) {
        let raw = (
            frame.vector(Field::SensorAngularVelocity, place),
            frame.vector(Field::SensorAcceleration, place),
        );
        let reading = match raw {
            (Some(rate), Some(force)) => Some((rate, force)),
            _ => {
                self.is_fused = true;
                self.fused(time, frame, place)
            }
        };
        if let Some((angular_velocity, specific_force)) = reading {
            self.times.push(time);
            self.readings.push(Reading {
                angular_velocity,
                specific_force,
            });
        }
    }

    fn fused(
        &mut self,
        time: f64,
        frame: &Frame,
        place: usize,
    ) -> Option<(Vector3<f64>, Vector3<f64>)> {
        let numbers = frame.numbers(Field::SensorOrientation)?;
        let [w, x, y, z] = numbers.get(4 * place..4 * place + 4)? else {
            return None;
        };
        let turn = UnitQuaternion::from_quaternion(Quaternion::new(*w, *x, *y, *z));
        let rate = self.turning.rate(time, &turn)?;
        let free = frame.vector(Field::SensorFreeAcceleration, place)?;
        Some((rate, with_gravity(&turn, &free)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bodyflight_shared_data::shared;

    /// A recording of MVN 2018 with orientations and accelerations, and one with the readings themselves, too short to use.
    #[test]
    fn sensors_of_real_recordings_are_read() {
        let Some(data) = shared("data") else { return };
        let file = data.join("mvnx/andres-fr-blender-mvnx-io/test_mocap.mvnx");
        let row = SensorRow::default();
        let found = streams(
            &file,
            &[(Segment::Pelvis, &row), (Segment::LeftForearm, &row)],
        );
        for (segment, stream) in found.unwrap() {
            assert!((stream.rate_hz - 60.0).abs() < 0.1);
            let [begin, end] = stream.span();
            let times = (0..40).map(|k| begin + (end - begin) * f64::from(k) / 40.0);
            let forces = times.filter_map(|time| stream.at(time));
            let forces: Vec<f64> = forces
                .map(|reading| reading.specific_force.norm())
                .collect();
            let mean = forces.iter().sum::<f64>() / forces.len() as f64;
            assert!((mean - 9.8).abs() < 1.0, "{segment:?}: {mean}");
        }
        let wrong = SensorRow {
            prefix: "Tail".to_owned(),
            ..SensorRow::default()
        };
        let said = streams(&file, &[(Segment::Head, &wrong)]).err().unwrap();
        assert!(said.to_string().contains("Tail"), "{said}");
        let short = data.join("mvnx/robotology-xsens-mvn/Meri-020.mvnx");
        let said = streams(&short, &[(Segment::Pelvis, &row)]).err().unwrap();
        assert!(said.to_string().contains("at least 100 samples"), "{said}");
    }
}
