//! Progress of long-running work: its current stage, and how much of that stage is done.
//!
//! Displays register a listener; without one, nothing is reported. Work that runs several times in parallel, such as
//! experiments, does not report: its stages would get mixed up.

use std::sync::{Arc, PoisonError, RwLock};

use crate::diagnostic::Result;
use crate::interrupt;

/// A progress report.
#[derive(Debug, Clone, PartialEq)]
pub enum Told {
    /// A stage starts.
    Stage(String),
    /// The completed share of the stage (0 to 1).
    Share(f64),
    /// The flight time reached (s), by work that does not know its length.
    Time(f64),
}

type Listener = Arc<dyn Fn(Told) + Send + Sync>;

static LISTENER: RwLock<Option<Listener>> = RwLock::new(None);

/// Keeps the listener registered until dropped.
#[must_use]
pub struct Listening(());

/// Registers a listener, replacing any previous one.
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

/// Reports the start of a stage.
pub fn stage(name: impl Into<String>) {
    tell(Told::Stage(name.into()));
}

/// Reports that `done` of `all` parts of the stage are done. Meant to be called a few times a second.
///
/// # Errors
/// Returns an error if Ctrl-C was pressed.
#[expect(clippy::cast_precision_loss, reason = "for display only")]
pub fn reached(done: usize, all: usize) -> Result<()> {
    tell(Told::Share(done as f64 / all.max(1) as f64));
    interrupt::check()
}

/// Reports the flight time reached (s). Meant to be called a few times a second.
///
/// # Errors
/// Returns an error if Ctrl-C was pressed.
pub fn at(time: f64) -> Result<()> {
    tell(Told::Time(time));
    interrupt::check()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Mutex;

    #[test]
    fn a_listener_receives_progress_until_it_is_dropped() {
        let heard = Arc::new(Mutex::new(Vec::new()));
        let kept = Arc::clone(&heard);
        let listening = listen(move |told| kept.lock().unwrap().push(told));
        stage("filtering");
        reached(1, 4).unwrap();
        drop(listening);
        stage("nobody hears this");
        let expected = [Told::Stage("filtering".to_owned()), Told::Share(0.25)];
        let heard = heard.lock().unwrap();
        // Other tests may report progress meanwhile.
        assert!(
            expected.iter().all(|told| heard.contains(told)),
            "{heard:?}"
        );
        assert!(!heard.contains(&Told::Stage("nobody hears this".to_owned())));
    }
}
