//! Credit: what the host may send.

use super::*;

/// The credit heard last.
fn credit(unit: &mut Unit<Bench>) -> Option<u32> {
    heard(unit)
        .into_iter()
        .rev()
        .find_map(|(_, message)| match message {
            Message::Credit(credit) => Some(credit.granted),
            _ => None,
        })
}

/// Streams 240 samples as credit allows, and the last credit; after each burst the unit works.
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
        // Once all is worked off there is more to send.
        assert!(granted > sent || !unit.samples.is_empty());
    }
    while unit.work() {}
    let status = unit.status();
    assert_eq!((status.used, status.dropped_oldest), (240, 0));
    (unit, granted)
}

#[test]
fn credit_is_a_total_that_follows_what_is_worked_off() {
    let (mut unit, granted) = streamed_on_credit(|unit| while unit.work() {});
    // A repeated sample asks again.
    tell_numbered(&mut unit, SESSION, 239, time(239), samples(240)[239]);
    assert!(credit(&mut unit) >= Some(granted));
}

/// However slowly the unit gets to it, the host does not fill its queue, in which samples would be late.
#[test]
fn credit_keeps_the_queue_short() {
    let (unit, _) = streamed_on_credit(|unit| assert!(unit.work()));
    let waited = unit.status().queue_high_water;
    assert!(waited < 8, "{waited}");
}
