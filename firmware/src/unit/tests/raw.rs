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

/// Two seconds at rest, a take-off as hard as an exit, in which the receiver tells where north is, and the flight of the
/// model at once.
#[test]
fn a_sensor_of_rates_and_forces_is_enough() {
    let mut unit = unit();
    assert!(unit.resume(&setup()));
    let flight = samples(7200);
    let attitude = |sample: &Sample| *sample.inertial_from_body().quaternion();
    let velocity = |sample: &Sample| Vector3::from(sample.motion().velocity.unwrap().to_array());
    let up = Vector3::z() * STANDARD_GRAVITY;
    let (still, rest) = (480, 480 + 1920);
    let take_off = Vector3::new(4.0, -5.0, 0.0);
    let (mut worst, mut doubtful) = ([0.0_f32; 2], 0);
    for k in 0..rest + 7200_u16 {
        let flown = flight.get(usize::from(k.wrapping_sub(rest)));
        let (turn, force, moving) = match flown {
            None if k < still => (Vector3::zeros(), up, Vector3::zeros()),
            None => {
                let time = f32::from(k - still) / 240.0;
                (Vector3::zeros(), up + take_off, take_off * time)
            }
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
            // No receiver in motion gives the same number again and again.
            let noise = Vector3::repeat(0.01 * f32::from(k % 5));
            unit.receive_sensor(&solution((moving + noise).into(), 0.3));
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
    // Those before north was found.
    assert!(
        status.missing == 0 && (480..2000).contains(&status.rejected),
        "{status:?}"
    );
    assert!(worst[0] < 0.1 && worst[1] < 0.8, "{worst:?} rad, m/s");
    // At the start of the flight the velocity jumps as that of no body can; the filter was doubtful before, so it takes that as
    // its own error.
    assert!(doubtful == 0, "doubtful until sample {doubtful}");
    std::println!("worst {worst:?} rad, m/s");
}
