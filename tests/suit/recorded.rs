//! Integration of real gyroscopes against an optical reference: the BROAD data set (Laidig et al. 2021, CC BY 4.0), as
//! tables. It is not part of the repository.

use std::path::Path;

use bodyflight_core::suit::rest::Rest;
use bodyflight_core::suit::strapdown::{Reading, Strapdown};
use bodyflight_core::suit::tray::Gyroscope;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

/// Time over which attitudes are integrated (s).
const DURATION: f64 = 60.0;

/// Errors of tilt and heading after a minute of motion that follows a rest (degrees), and the turn meanwhile.
fn drift(text: &str) -> Option<[f64; 3]> {
    let rows = text.lines().skip(1).map(|line| {
        let numbers = line.split(',').map(|cell| cell.parse().unwrap_or(f64::NAN));
        numbers.collect::<Vec<f64>>()
    });
    let rows: Vec<Vec<f64>> = rows.collect();
    let begin = rows.iter().position(|row| row[11] > 0.5)?;
    let (mut rest, mut gyroscope) = (Rest::default(), Gyroscope::default());
    let reading = |row: &[f64]| Reading {
        angular_velocity: Vector3::new(row[1], row[2], row[3]),
        specific_force: Vector3::new(row[4], row[5], row[6]),
    };
    let still = &rows[..begin.saturating_sub(100)];
    still.iter().for_each(|row| rest.take(&reading(row)));
    gyroscope.set_bias(&rest, still.len() as f64 * (rows[1][0] - rows[0][0]));
    let truth = |row: &[f64]| {
        let found = Quaternion::new(row[7], row[8], row[9], row[10]);
        found
            .norm()
            .is_finite()
            .then(|| UnitQuaternion::from_quaternion(found))
    };
    let first = (0..begin).rev().find(|k| truth(&rows[*k]).is_some())?;
    let mut strapdown = Strapdown::new(truth(&rows[first])?);
    let (mut errors, mut turned) = (None, 0.0);
    for pair in rows[first..].windows(2) {
        let (before, row) = (&pair[0], &pair[1]);
        let rate = gyroscope.corrected(&reading(row).angular_velocity);
        let step = row[0] - before[0];
        strapdown.advance(&rate, step);
        turned += rate.norm() * step;
        if let Some(truth) = truth(row) {
            let off = strapdown.reference_from_sensor * truth.inverse();
            let tilt = (off * Vector3::z()).angle(&Vector3::z());
            let heading = 2.0 * off.k.atan2(off.w);
            let heading = (heading + 3.0 * std::f64::consts::PI) % std::f64::consts::TAU;
            let heading = (heading - std::f64::consts::PI).abs();
            errors = Some([tilt, heading, turned].map(f64::to_degrees));
        }
        if row[0] - rows[first][0] > DURATION {
            break;
        }
    }
    errors
}

#[test]
#[ignore = "needs the tables in the folder named by BODYFLIGHT_BROAD"]
fn a_minute_of_real_motion_drifts_by_a_few_degrees() {
    let folder = std::env::var_os("BODYFLIGHT_BROAD").expect("BODYFLIGHT_BROAD");
    let mut files: Vec<_> = std::fs::read_dir(Path::new(&folder))
        .expect("a folder")
        .map(|entry| entry.expect("a file").path())
        .collect();
    files.sort();
    assert!(!files.is_empty());
    for file in files {
        let text = std::fs::read_to_string(&file).expect("a table");
        let [tilt, heading, turned] = drift(&text).expect("a rest, then motion");
        let name = file
            .file_stem()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned();
        println!("{name}: tilt {tilt:.1}, heading {heading:.1}, turned {turned:.0}");
        assert!(tilt < 5.0 && heading < 12.0, "{name}");
    }
}
