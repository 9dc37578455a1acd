//! Tables of the unit's estimates and of its reports on itself.

use std::path::Path;

use bodyflight_core::link::{Estimate, Status};

use bodyflight_io::diagnostic::Result;
use bodyflight_io::files::CsvFile;

/// Columns of the estimates, in the order of the link's `ESTIMATE` message. The paper's filters have neither attitude
/// nor velocity; the flag `MOTION` tells.
const ESTIMATES: [&str; 22] = [
    "time_s",
    "flags",
    "input_pitch",
    "input_yaw",
    "input_roll",
    "damping_pitch",
    "damping_yaw",
    "damping_roll",
    "variance_input_pitch",
    "variance_input_yaw",
    "variance_input_roll",
    "variance_damping_pitch",
    "variance_damping_yaw",
    "variance_damping_roll",
    "nis",
    "inertial_from_body_w",
    "inertial_from_body_x",
    "inertial_from_body_y",
    "inertial_from_body_z",
    "velocity_north",
    "velocity_west",
    "velocity_up",
];

/// Columns of the unit's reports; the counters are those of its `STATUS` message.
const REPORTS: [&str; 8] = [
    "time_s",
    "battery_v",
    "used",
    "rejected",
    "missing",
    "dropped_oldest",
    "innovation_rejected",
    "deadline_missed",
];

/// Time (s) of a message at `time` since the first sample at `first` (us).
pub(super) fn since(first: u64, time: u64) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "a flight is short")]
    let since = time.saturating_sub(first) as f64 * 1e-6;
    since
}

/// `first` is the time of the first sample; all times are in microseconds.
pub(super) fn write_estimates(
    first: u64,
    estimates: &[(u64, Estimate)],
    path: &Path,
) -> Result<()> {
    let mut table = CsvFile::create(path, &ESTIMATES)?;
    for (time, estimate) in estimates {
        let numbers = estimate.state.iter().chain(&estimate.variance);
        let attitude = estimate.inertial_from_body.unpack();
        let motion = [attitude.w, attitude.i, attitude.j, attitude.k];
        let numbers = numbers
            .chain([&estimate.nis])
            .chain(&motion)
            .chain(&estimate.velocity);
        let row = [since(first, *time), f64::from(estimate.flags.bits())]
            .into_iter()
            .chain(numbers.map(|number| f64::from(*number)));
        table.write(row)?;
    }
    table.finish()
}

/// Writes about one row a second; the voltage is NaN if the unit measures none.
pub(super) fn write_reports(first: u64, reports: &[(u64, Status)], path: &Path) -> Result<()> {
    let mut table = CsvFile::create(path, &REPORTS)?;
    for (time, report) in reports {
        let counters = [
            report.used,
            report.rejected,
            report.missing,
            report.dropped_oldest,
            report.innovation_rejected,
            report.deadline_missed,
        ];
        let battery = battery_v(report).unwrap_or(f64::NAN);
        let row = [since(first, *time), battery];
        table.write(row.into_iter().chain(counters.map(f64::from)))?;
    }
    table.finish()
}

/// Battery voltage (V), if the unit measures it.
pub(super) fn battery_v(report: &Status) -> Option<f64> {
    (report.battery > 0).then(|| f64::from(report.battery) * 1e-3)
}

#[cfg(test)]
mod tests {
    use bodyflight_core::Posture;
    use bodyflight_core::frame::Rotation;
    use bodyflight_core::link::{BlockWriter, Counters, Header, Ledger, Message, Motion, Sample};
    use nalgebra::UnitQuaternion;

    use super::super::flight::{flights, write};
    use super::*;

    #[test]
    fn a_battery_is_read_from_the_log() {
        let sample: Message = Sample::new(
            &Posture::h_pose(),
            &Rotation::from_quaternion(UnitQuaternion::identity()),
            &Motion::default(),
        )
        .into();
        let report = |battery| -> Message {
            let status = Status::new(0, &Counters::default(), &Ledger::default());
            Status { battery, ..status }.into()
        };
        let mut block = BlockWriter::new();
        let messages = [sample, report(3712), report(0), report(3698), sample];
        for (time, message) in (0..).step_by(500_000).zip(messages) {
            let header = Header {
                time,
                ..Header::default()
            };
            assert!(block.push(&header, &message));
        }
        let (flights, damaged) = flights(&[block.bytes().to_vec()]);
        assert_eq!((flights.len(), damaged), (1, 0));
        let folder = tempfile::tempdir().unwrap();
        let written = write(&flights[0], None, folder.path()).unwrap();
        assert_eq!(written.battery_v, Some(3.698));
        let table = std::fs::read_to_string(folder.path().join("unit.csv")).unwrap();
        let rows: Vec<_> = table.lines().collect();
        assert_eq!(rows[0], REPORTS.join(","));
        assert_eq!(
            rows[1],
            "0.500000,3.712000,0.000000,0.000000,0.000000,0.000000,0.000000,0.000000"
        );
        assert!(rows[2].starts_with("1.000000,NaN,"), "{}", rows[2]);
    }
}
