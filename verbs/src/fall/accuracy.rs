//! What a receiver itself says of its accuracy.

use bodyflight_tracks::Track;

/// Accuracies in half of a fall with which its figures mean something (m, m/s). Receivers in falls state 1 to 10 m and 0.2 to
/// 1.5 m/s, and 150 m for some seconds after an exit with four satellites.
const POSITION: f64 = 50.0;
const SPEED: f64 = 5.0;

/// Why a fall between two times (s) cannot be judged: in half of it the receiver states that it hardly knows where it is, or
/// how fast.
pub(super) fn coarse(track: &Track, [from, to]: [f64; 2]) -> Option<String> {
    let kinds = [
        (
            "places and heights",
            &track.position_accuracy,
            POSITION,
            "m",
        ),
        ("velocities", &track.speed_accuracy, SPEED, "m/s"),
    ];
    kinds.into_iter().find_map(|(what, stated, most, unit)| {
        let pairs = track.samples.iter().zip(stated);
        let falling = pairs.filter(|(sample, _)| (from..=to).contains(&sample.time));
        let mut stated: Vec<f64> = falling.filter_map(|(_, stated)| *stated).collect();
        stated.sort_by(f64::total_cmp);
        let median = stated.get(stated.len() / 2)?;
        (*median > most).then(|| {
            format!(
                "the receiver states that its {what} are accurate to {median:.0} {unit} in half of the fall, expected {most:.0} {unit} or better: it had no view of the sky"
            )
        })
    })
}
