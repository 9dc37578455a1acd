//! Public FlySight tracks: what is read of them.

use bodyflight_tests::data_folder;
use bodyflight_tracks::flysight;

#[test]
fn negative_milliseconds_and_inertial_sensors_are_read() {
    let Some(data) = data_folder() else {
        return;
    };
    let negative = data.join("flysight/yoleg-flysight2csv/negative-microsecond-TRACK.CSV");
    let track = flysight::Track::read(&negative).expect("a track");
    assert_eq!((track.fixes.len(), track.skipped.count), (5, 0));
    // This track has inertial sensor data on the same clock.
    let both = data.join("flysight/yoleg-flysight2csv/TRACK.CSV");
    let track = flysight::Track::read(&both).expect("a track");
    assert!(track.inertial.len() > 300);
    let (first, last) = (
        track.fixes[0].time_of_week(),
        track.fixes[track.fixes.len() - 1].time_of_week(),
    );
    let during = |sample: &&flysight::InertialSample| (first..=last).contains(&sample.time_of_week);
    assert!(track.inertial.iter().filter(during).count() > 200);
}
