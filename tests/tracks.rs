//! Public FlySight tracks: which of them discovery analyses, and why it refuses the others.

use bodyflight::formats::flysight;
use bodyflight::formats::subject::Subject;
use bodyflight::verbs::discover::{problem, read_point_track};
use bodyflight_core::dynamics::Dynamics;
use bodyflight_discovery::point::search::discover;
use bodyflight_tests::data_folder;

#[test]
fn public_tracks_of_flysights_are_judged_or_refused_with_a_reason() {
    let Some(data) = data_folder() else {
        return;
    };
    let dynamics = |_: f64| Dynamics::paper(Subject::default().body(), 1.0);
    let (mut judged, mut skipped) = (0, 0);
    for folder in ["skyderby", "yoleg-flysight2csv"] {
        for file in std::fs::read_dir(data.join("flysight").join(folder)).expect("a folder") {
            let path = file.expect("a file").path();
            if !flysight::is_flysight(&path) {
                continue;
            }
            let report = read_point_track(&path)
                .and_then(|track| discover(&track, &[], &dynamics, 3).map_err(problem));
            match report {
                Ok(report) => {
                    judged += 1;
                    skipped += report.rows_skipped;
                    assert!(report.free_fall_s > 8.0 && report.disagreement.is_finite());
                }
                Err(problem) => {
                    let said = problem.to_string();
                    assert!(
                        said.contains("free fall") || said.contains("velN"),
                        "{said}"
                    );
                }
            }
        }
    }
    assert_eq!((judged, skipped), (3, 0));
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
