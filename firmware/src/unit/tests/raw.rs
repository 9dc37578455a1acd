//! A sensor that measures angular velocity and specific force only.

use bodyflight_core::link::Validity;
use bodyflight_core::xbus::DataId;
use nalgebra::Vector3;

use super::alone::setup;
use super::*;
use crate::sensor::STANDARD_GRAVITY;
use crate::test_line::{counted_packet, solution};

/// Bias of the gyroscope (rad/s).
const BIAS: [f32; 3] = [0.01, -0.02, 0.015];

fn packet(counter: u16, ticks: u32, turn: Vector3<f32>, force: Vector3<f32>) -> Vec<u8> {
    let items: [(DataId, &[f32]); 2] = [
        (DataId::RATE_OF_TURN, turn.as_slice()),
        (DataId::ACCELERATION, force.as_slice()),
    ];
    counted_packet(counter, ticks, &items)
}

/// After two seconds at rest, the flight of the model at once: the filter, which assumed a fall all the time, has to find
/// into it.
#[test]
fn a_sensor_of_rates_and_forces_is_enough() {
    let mut unit = unit();
    assert!(unit.resume(&setup()));
    let flight = samples(7200);
    let attitude = |sample: &Sample| *sample.inertial_from_body().quaternion();
    let velocity = |sample: &Sample| Vector3::from(sample.motion().velocity.unwrap().to_array());
    let up = Vector3::z() * STANDARD_GRAVITY;
    let rest = 480;
    let (mut worst, mut doubtful) = ([0.0_f32; 2], 0);
    for k in 0..rest + 7200_u16 {
        let flown = flight.get(usize::from(k.wrapping_sub(rest)));
        let (turn, force, moving) = match flown {
            None => (Vector3::zeros(), up, Vector3::zeros()),
            Some(sample) => {
                let before = flight.get(usize::from(k - rest).wrapping_sub(1));
                let change = (velocity(sample) - velocity(before.unwrap_or(sample))) * 240.0;
                let turn = Vector3::from(sample.motion().angular_velocity.unwrap().to_array());
                (turn, change + up, velocity(sample))
            }
        };
        let force = attitude(flown.unwrap_or(&flight[0])).inverse() * force;
        let now = u64::from(k) * 1_000_000 / 240 + 1_000_000;
        unit.board.now.set(now);
        if k % 48 == 24 {
            unit.receive_sensor(&solution(moving.into(), 0.3));
        }
        let ticks = u32::from(k) * 10_000 / 240;
        unit.receive_sensor(&packet(k, ticks, turn + Vector3::from(BIAS), force));
        while unit.work() {}
        for estimate in estimates(&heard(&mut unit)) {
            let Some(sample) = flown.filter(|_| k >= rest + 1200) else {
                continue;
            };
            let error = [
                estimate
                    .inertial_from_body
                    .unpack()
                    .angle_to(&attitude(sample)),
                (Vector3::from(estimate.velocity) - velocity(sample)).norm(),
            ];
            worst = [0, 1].map(|part| worst[part].max(error[part]));
            assert!(!estimate.flags.contains(EstimateFlags::LOST), "sample {k}");
            if estimate.flags.contains(EstimateFlags::DOUBTFUL) {
                doubtful = k - rest;
            }
        }
    }
    // The flight turns, so that at the end the attitude is the filter's alone.
    assert!(
        !unit
            .last_sample()
            .unwrap()
            .valid
            .contains(Validity::ATTITUDE)
    );
    let status = unit.status();
    // Those of the first second, in which the sensor was not level yet.
    assert_eq!(
        (status.used, status.missing, status.rejected),
        (7439, 0, 241)
    );
    assert!(worst[0] < 0.05 && worst[1] < 0.6, "{worst:?} rad, m/s");
    // It starts with a velocity that is wrong by 50 m/s, and says so.
    assert!(
        (1200..4800).contains(&doubtful),
        "doubtful until sample {doubtful}"
    );
    std::println!("worst {worst:?} rad, m/s; doubtful until sample {doubtful}");
}
