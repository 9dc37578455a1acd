//! Credit: the number of samples that the host may send.

use super::*;

/// The credit received last.
fn credit(unit: &mut Unit<Bench>) -> Option<u32> {
    heard(unit)
        .into_iter()
        .rev()
        .find_map(|(_, message)| match message {
            Message::Credit(credit) => Some(credit.granted),
            _ => None,
        })
}

/// Streams 240 samples as credit allows, with the unit working after each burst. Returns the last credit.
fn streamed_on_credit(work: impl Fn(&mut Unit<Bench>)) -> (Unit<Bench>, u32) {
    let mut unit = running(StreamMode::Credit);
    let mut granted = credit(&mut unit).unwrap();
    let samples = samples(240);
    let mut sent = 0;
    while sent < 240 {
        while sent < granted.min(240) {
            tell_numbered(&mut unit, SESSION, sent, time(sent), samples[sent as usize]);
            sent += 1;
        }
        work(&mut unit);
        granted = credit(&mut unit).unwrap_or(granted);
        // Once all are processed, more credit is granted.
        assert!(granted > sent || !unit.samples.is_empty());
    }
    while unit.work() {}
    let status = unit.status();
    assert_eq!((status.used, status.dropped_oldest), (240, 0));
    (unit, granted)
}

#[test]
fn credit_is_a_total_that_follows_the_samples_processed() {
    let (mut unit, granted) = streamed_on_credit(|unit| while unit.work() {});
    // A repeated sample asks for the credit again.
    tell_numbered(&mut unit, SESSION, 239, time(239), samples(240)[239]);
    assert!(credit(&mut unit) >= Some(granted));
}

/// However slow the unit is, the host does not overfill its queue, which would make samples late.
#[test]
fn credit_keeps_the_queue_short() {
    let (unit, _) = streamed_on_credit(|unit| assert!(unit.work()));
    let waited = unit.status().queue_high_water;
    assert!(waited < 8, "{waited}");
}
