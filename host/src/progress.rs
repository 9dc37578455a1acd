//! What long work tells of itself: which stage it is in, and how much of that is done.
//!
//! Whoever shows it listens for a while; without a listener nothing is told. Work that runs several times side by side, such
//! as experiments in parallel, is not listened to: its stages would be told all at once.

use std::sync::{Arc, PoisonError, RwLock};

use crate::diagnostic::Result;
use crate::interrupt;

/// What is told.
#[derive(Debug, Clone, PartialEq)]
pub enum Told {
    /// A stage begins.
    Stage(String),
    /// So large a share of the stage is done.
    Share(f64),
}

type Listener = Arc<dyn Fn(Told) + Send + Sync>;

static LISTENER: RwLock<Option<Listener>> = RwLock::new(None);

/// Listens until it is dropped.
#[must_use]
pub struct Listening(());

/// Begins to listen, in place of whoever listened before.
pub fn listen(listener: impl Fn(Told) + Send + Sync + 'static) -> Listening {
    set(Some(Arc::new(listener)));
    Listening(())
}

impl Drop for Listening {
    fn drop(&mut self) {
        set(None);
    }
}

fn set(listener: Option<Listener>) {
    *LISTENER.write().unwrap_or_else(PoisonError::into_inner) = listener;
}

fn tell(told: Told) {
    let listener = LISTENER
        .read()
        .unwrap_or_else(PoisonError::into_inner)
        .clone();
    if let Some(listener) = listener {
        listener(told);
    }
}

/// A stage begins.
pub fn stage(name: impl Into<String>) {
    tell(Told::Stage(name.into()));
}

/// `done` of `all` parts of the stage are done. To be called a few times a second.
///
/// # Errors
/// Returns an error if Ctrl-C was pressed.
#[expect(clippy::cast_precision_loss, reason = "a share for the eye")]
pub fn reached(done: usize, all: usize) -> Result<()> {
    tell(Told::Share(done as f64 / all.max(1) as f64));
    interrupt::check()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Mutex;

    #[test]
    fn a_listener_hears_until_it_is_dropped() {
        let heard = Arc::new(Mutex::new(Vec::new()));
        let kept = Arc::clone(&heard);
        let listening = listen(move |told| kept.lock().unwrap().push(told));
        stage("filtering");
        reached(1, 4).unwrap();
        drop(listening);
        stage("nobody hears this");
        let expected = [Told::Stage("filtering".to_owned()), Told::Share(0.25)];
        let heard = heard.lock().unwrap();
        // Other tests may tell something meanwhile.
        assert!(
            expected.iter().all(|told| heard.contains(told)),
            "{heard:?}"
        );
        assert!(!heard.contains(&Told::Stage("nobody hears this".to_owned())));
    }
}
