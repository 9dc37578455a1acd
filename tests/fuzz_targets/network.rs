//! The network stream of MVN.

use bodyflight_mvn_network::{Options, Receiver};

use super::choices::Choices;

/// Any datagrams, each preceded by its length; the highest bit of the length flushes the receiver afterwards.
pub(super) fn mxtp(input: &[u8]) {
    let mut choices = Choices(input);
    let mut receiver = Receiver::new(Options::default());
    let (mut sent, mut taken) = (0, 0);
    while !choices.is_empty() {
        let length = choices.word();
        receiver.push(choices.bytes(usize::from(length & 0x7FFF)));
        sent += 1;
        if length & 0x8000 != 0 {
            receiver.flush();
        }
        while let Some(frame) = receiver.next_frame() {
            assert!(frame.posture.is_valid() && frame.time.is_finite());
            assert!(frame.pelvis.position.is_finite());
            taken += 1;
        }
    }
    let counters = receiver.counters();
    assert_eq!(counters.datagrams, sent);
    assert_eq!(counters.frames, taken);
    let scale = &receiver.information().scale;
    assert!(scale.segments.len() <= 128 && scale.points.len() <= 1024);
}
