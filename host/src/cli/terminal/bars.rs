//! Progress bars: the current work, its progress, rate and remaining time. Shown on a terminal only.

use std::io::IsTerminal;
use std::sync::OnceLock;
use std::time::{Duration, Instant};

use bodyflight_io::progress::{Listening, Told, listen};
use bodyflight_mvnx::length::length;
use bodyflight_replay::flight::Flight;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// Time between redraws of a bar while no progress is reported.
const TICK: Duration = Duration::from_millis(250);

/// Full length of a bar in thousandths.
const WHOLE: f64 = 1000.0;

/// A bar for work of known length.
pub(in crate::cli) fn bar(length: u64, what: &'static str) -> ProgressBar {
    let style = "{msg} {wide_bar} {pos}/{len}, {per_sec}, {eta} left";
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
    new_bar(
        Some(whole),
        what,
        "{msg} {wide_bar} {percent} %, {eta} left",
    )
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
        bar.set_style(style);
    }
    bar.set_message(what);
    bar.enable_steady_tick(TICK);
    bar
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

/// A bar for work that runs through a flight, once or in stages.
pub(in crate::cli) struct FlightBar {
    stages: Stages,
    what: &'static str,
    /// Length of the flight (s), if known beforehand.
    length: Option<f64>,
    begin: Instant,
    /// The first reported time of the flight (s).
    start: OnceLock<f64>,
}

impl FlightBar {
    pub(in crate::cli) fn new(what: &'static str, flight: &Flight) -> Self {
        let on_terminal = std::io::stderr().is_terminal();
        let length = on_terminal.then(|| length(&flight.recording)).flatten();
        let bar = if length.is_some() {
            share_bar(what)
        } else {
            spinner(what)
        };
        Self {
            stages: Stages::on(bar, what),
            what,
            length,
            begin: Instant::now(),
            start: OnceLock::new(),
        }
    }

    /// Reports that the work has reached a time of the flight (s).
    pub(in crate::cli) fn at(&self, time: f64) {
        let bar = &self.stages.bar;
        let flown = time - self.start.get_or_init(|| time);
        let rate = flown / self.begin.elapsed().as_secs_f64().max(1e-3);
        let of = self.length.map_or(String::new(), |length| {
            set_share(bar, flown / length);
            format!(" of {length:.0}")
        });
        bar.set_message(format!(
            "{}, {flown:.0}{of} s, {rate:.0} times real time",
            self.what
        ));
    }

    pub(in crate::cli) fn end(self) {
        self.stages.end();
    }
}
