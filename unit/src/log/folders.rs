//! All flights of a log, each in a folder of its own.

use std::path::{Path, PathBuf};

use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_replay::subject::Subject;
use serde::Serialize;

use super::flight::{LEVELLED, LoggedFlight, Written, write};

/// What became of the flights of a log.
#[derive(Debug, Default)]
pub struct WrittenLog {
    /// Those that were written.
    pub written: Vec<Written>,
    /// Those that have nothing to record.
    pub without_attitude: Vec<WithoutAttitude>,
}

/// A flight that was not written, since none of its samples has an attitude.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct WithoutAttitude {
    /// Its place in the log, the oldest is 1.
    pub number: usize,
    /// Samples.
    pub samples: usize,
    /// Duration (s).
    pub duration_s: f64,
}

impl WrittenLog {
    /// Refuses a log of which nothing could be written, although it has flights.
    ///
    /// # Errors
    /// Returns an error if no flight has an attitude.
    pub fn check(&self) -> Result<()> {
        match self.without_attitude.as_slice() {
            [_, ..] if self.written.is_empty() => Err(Problem::bad_input(
                "expected flights with an attitude, found none in this log",
            )
            .help(LEVELLED)),
            _ => Ok(()),
        }
    }
}

impl WithoutAttitude {
    /// Says that the flight was not written, and what to do.
    pub fn sentence(&self) -> String {
        format!(
            "flight {} ({:.1} s, {} samples) was not written, since none of its samples has an attitude: {LEVELLED}",
            self.number, self.duration_s, self.samples
        )
    }
}

/// The folder of each flight in that of the log, by its place in the log; none for a flight without any attitude.
pub fn folders<'a>(
    flights: &'a [LoggedFlight],
    folder: &'a Path,
) -> impl Iterator<Item = (usize, &'a LoggedFlight, Option<PathBuf>)> {
    flights.iter().zip(1..).map(move |(flight, number)| {
        let own = flight.has_attitude();
        (number, flight, own.then(|| folder.join(number.to_string())))
    })
}

/// Writes each flight into its [folder](folders), as [`write()`] does.
///
/// # Errors
/// Returns an error if a folder cannot be written to.
pub fn write_all(
    flights: &[LoggedFlight],
    subject: Option<&Subject>,
    folder: &Path,
) -> Result<WrittenLog> {
    let mut log = WrittenLog::default();
    for (number, flight, own) in folders(flights, folder) {
        match own {
            Some(own) => log.written.push(write(flight, subject, &own)?),
            None => log.without_attitude.push(WithoutAttitude {
                number,
                samples: flight.lengths()[0],
                duration_s: flight.duration(),
            }),
        }
    }
    Ok(log)
}

#[cfg(test)]
mod tests {
    use bodyflight_core::Posture;
    use bodyflight_core::frame::Rotation;
    use bodyflight_core::link::{Header, Motion, Sample, Validity};
    use nalgebra::UnitQuaternion;

    use super::*;

    fn flight(has_attitude: bool) -> LoggedFlight {
        let attitude = Rotation::from_quaternion(UnitQuaternion::identity());
        let mut sample = Sample::new(&Posture::h_pose(), &attitude, &Motion::default());
        if !has_attitude {
            sample.valid.remove(Validity::ATTITUDE);
        }
        let mut flight = LoggedFlight::default();
        for time in [0, 4000, 8000] {
            let header = Header {
                time,
                ..Header::default()
            };
            flight.push(&header, sample.into());
        }
        flight
    }

    #[test]
    fn a_flight_without_attitude_does_not_keep_the_others_from_being_written() {
        let folder = tempfile::tempdir().unwrap();
        let flights = [true, false, true].map(flight);
        let log = write_all(&flights, None, folder.path()).unwrap();
        let paths: Vec<_> = log.written.iter().map(|one| one.flight.clone()).collect();
        let expected = ["1", "3"].map(|one| folder.path().join(one).join("flight.toml"));
        assert_eq!(paths, expected);
        assert!(paths.iter().all(|path| path.exists()));
        assert!(!folder.path().join("2").exists());
        let [without] = log.without_attitude.as_slice() else {
            panic!("{:?}", log.without_attitude)
        };
        assert_eq!((without.number, without.samples), (2, 3));
        let said = without.sentence();
        assert!(
            said.contains("flight 2") && said.contains("still"),
            "{said}"
        );
        assert!(log.check().is_ok());
    }

    #[test]
    fn a_log_without_any_attitude_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let log = write_all(&[false, false].map(flight), None, folder.path()).unwrap();
        assert_eq!(log.without_attitude.len(), 2);
        let said = log.check().unwrap_err().to_string();
        assert!(said.contains("found none"), "{said}");
        assert!(WrittenLog::default().check().is_ok(), "an empty log");
    }
}
