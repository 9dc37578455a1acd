//! Progress bars: the current work, its progress, rate and remaining time. Shown on a terminal only.

use std::fmt::Write;
use std::io::IsTerminal;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use bodyflight_io::progress::{Listening, Told, listen};
use bodyflight_mvnx::length::span;
use bodyflight_replay::flight::Flight;
use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};

/// Time between redraws of a bar while no progress is reported.
const TICK: Duration = Duration::from_millis(250);

/// Full length of a bar in thousandths.
const WHOLE: f64 = 1000.0;

/// A bar for work of known length.
pub(in crate::cli) fn bar(length: u64, what: &'static str) -> ProgressBar {
    let style = "{msg} {wide_bar} {pos}/{len}{rate}{left}";
    new_bar(Some(length), what, style)
}

/// A bar for work that reports only the completed share, in thousandths.
pub(in crate::cli) fn share_bar(what: &'static str) -> ProgressBar {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a constant"
    )]
    let whole = WHOLE as u64;
    new_bar(Some(whole), what, "{msg} {wide_bar} {percent} %{left}")
}

/// A spinner for work of unknown length.
pub(in crate::cli) fn spinner(what: &'static str) -> ProgressBar {
    new_bar(None, what, "{spinner} {msg} {elapsed}")
}

fn new_bar(length: Option<u64>, what: &'static str, style: &str) -> ProgressBar {
    let target = if std::io::stderr().is_terminal() {
        ProgressDrawTarget::stderr()
    } else {
        ProgressDrawTarget::hidden()
    };
    let bar = ProgressBar::with_draw_target(length, target);
    if let Ok(style) = ProgressStyle::with_template(style) {
        bar.set_style(style.with_key("rate", rate).with_key("left", left));
    }
    bar.set_message(what);
    bar.enable_steady_tick(TICK);
    bar
}

/// How much is done in a second, once something is.
fn rate(state: &ProgressState, text: &mut dyn Write) {
    if state.pos() > 0 {
        // A bar that cannot be drawn is no reason to fail.
        let _ = write!(text, ", {:.1}/s", state.per_sec());
    }
}

/// The remaining time, once something is done from which it can be told.
fn left(state: &ProgressState, text: &mut dyn Write) {
    if state.pos() > 0 {
        // A bar that cannot be drawn is no reason to fail.
        let _ = write!(text, ", {} left", HumanDuration(state.eta()));
    }
}

/// Sets the completed share of a bar in thousandths.
pub(in crate::cli) fn set_share(bar: &ProgressBar, share: f64) {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a share in thousandths"
    )]
    bar.set_position((WHOLE * share.clamp(0.0, 1.0)) as u64);
}

/// A bar for work that reports its stages.
pub(in crate::cli) struct Stages {
    bar: ProgressBar,
    _listening: Listening,
}

impl Stages {
    pub(in crate::cli) fn new(what: &'static str) -> Self {
        Self::on(share_bar(what), what)
    }

    fn on(bar: ProgressBar, what: &'static str) -> Self {
        let told = bar.clone();
        let listening = listen(move |news| match news {
            Told::Stage(stage) => {
                told.set_message(format!("{what}: {stage}"));
                told.set_position(0);
                told.reset_eta();
            }
            Told::Share(share) => set_share(&told, share),
            // Bars of flights are told the time by the work itself.
            Told::Time(_) => {}
        });
        Self {
            bar,
            _listening: listening,
        }
    }

    pub(in crate::cli) fn end(self) {
        self.bar.finish_and_clear();
    }
}

/// Work that runs through a flight, perhaps more than once.
struct Passes {
    /// Times of the first and the last frame (s), if known beforehand.
    span: Option<[f64; 2]>,
    /// How often the work runs through the flight.
    count: f64,
    /// Passes completed.
    done: f64,
    /// The latest reported time of the flight (s).
    last: f64,
}

impl Passes {
    fn new(span: Option<[f64; 2]>, count: u32) -> Self {
        Self {
            span,
            count: f64::from(count),
            done: 0.0,
            last: f64::NEG_INFINITY,
        }
    }

    /// The share of all the work that is done when a pass reaches this time (s), if the length of the flight is known.
    fn share(&mut self, time: f64) -> Option<f64> {
        // Time that goes back is that of the next pass.
        if time < self.last && self.done + 1.0 < self.count {
            self.done += 1.0;
        }
        self.last = time;
        let [first, last] = self.span?;
        let share = ((time - first) / (last - first)).clamp(0.0, 1.0);
        Some((self.done + share) / self.count)
    }
}

/// A bar for work that runs through a flight, once or more, or in stages.
pub(in crate::cli) struct FlightBar {
    stages: Stages,
    what: &'static str,
    begin: Instant,
    passes: Mutex<Passes>,
}

impl FlightBar {
    pub(in crate::cli) fn new(what: &'static str, flight: &Flight) -> Self {
        Self::of_passes(what, flight, 1)
    }

    /// Same as [`FlightBar::new`], for work that runs through the flight so many times.
    pub(in crate::cli) fn of_passes(what: &'static str, flight: &Flight, count: u32) -> Self {
        let on_terminal = std::io::stderr().is_terminal();
        let span = on_terminal.then(|| span(&flight.recording)).flatten();
        let bar = if span.is_some() {
            share_bar(what)
        } else {
            spinner(what)
        };
        Self {
            stages: Stages::on(bar, what),
            what,
            begin: Instant::now(),
            passes: Mutex::new(Passes::new(span, count)),
        }
    }

    /// Reports that the work has reached a time of the flight (s).
    pub(in crate::cli) fn at(&self, time: f64) {
        let bar = &self.stages.bar;
        let mut passes = self.passes.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(share) = passes.share(time) {
            set_share(bar, share);
        }
        let [first, last] = passes.span.unwrap_or([0.0, f64::NAN]);
        let flown = time - first;
        let of = if last.is_finite() {
            format!(" of {:.0}", last - first)
        } else {
            String::new()
        };
        let rate = flown / self.begin.elapsed().as_secs_f64().max(1e-3);
        let what = self.what;
        bar.set_message(if passes.count > 1.0 {
            format!(
                "{what}, pass {:.0} of {:.0}, {flown:.0}{of} s",
                passes.done + 1.0,
                passes.count
            )
        } else {
            format!("{what}, {flown:.0}{of} s, {rate:.0} times real time")
        });
    }

    pub(in crate::cli) fn end(self) {
        self.stages.end();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bar_starts_at_the_first_frame_and_only_grows() {
        // Work reports every few seconds, and the recording begins at 10 s.
        let mut passes = Passes::new(Some([10.0, 30.0]), 2);
        let times = [14.0, 20.0, 30.0, 10.0, 15.0, 30.0];
        let shares = times.map(|time| passes.share(time).unwrap());
        let expected = [0.1, 0.25, 0.5, 0.5, 0.625, 1.0];
        for (share, expected) in shares.iter().zip(expected) {
            assert!((share - expected).abs() < 1e-12, "{shares:?}");
        }
        // A time before the first frame, or a third pass, does not move it back.
        assert_eq!(Passes::new(Some([10.0, 30.0]), 1).share(0.0), Some(0.0));
        assert_eq!(Passes::new(None, 1).share(3.0), None);
    }
}
