//! What arrives later than it should.

use bodyflight_emulator::tampered::Sent;

/// Solutions take `by` packets longer.
pub fn late(all: &mut [Sent], by: usize) {
    let solutions: Vec<_> = all.iter().map(|sent| sent.solution).collect();
    for (k, sent) in all.iter_mut().enumerate() {
        sent.solution = k.checked_sub(by).and_then(|k| solutions[k]);
    }
}

/// The solutions take longer and longer, up to a second.
pub fn later_and_later(all: &mut [Sent]) {
    let solutions: Vec<_> = all.iter().map(|sent| sent.solution).collect();
    all.iter_mut().for_each(|sent| sent.solution = None);
    for (k, solution) in solutions.into_iter().enumerate() {
        let arrives = k + 240 * k / all.len();
        if let Some(sent) = all.get_mut(arrives).filter(|_| solution.is_some()) {
            sent.solution = solution;
        }
    }
}

/// What one of the sensors says is that of `by` packets ago.
pub fn stale<T: Clone>(all: &mut [Sent], by: usize, of: fn(&mut Sent) -> &mut T) {
    let before: Vec<T> = all.iter_mut().map(|sent| of(sent).clone()).collect();
    for (k, sent) in all.iter_mut().enumerate() {
        of(sent).clone_from(&before[k.saturating_sub(by)]);
    }
}
