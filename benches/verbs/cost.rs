//! Processor time of the program and of this thread.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// The program as `cargo build --release` leaves it, in a folder of inputs.
pub(crate) struct Program {
    path: PathBuf,
    pub(crate) folder: PathBuf,
}

impl Program {
    /// The program beside the folder of this bench, or the one that `BODYFLIGHT` names.
    pub(crate) fn in_folder(folder: &Path) -> Self {
        let own = std::env::current_exe().expect("a path");
        let built = own.ancestors().nth(2).expect("a folder").join("bodyflight");
        let path = std::env::var_os("BODYFLIGHT").map_or(built, PathBuf::from);
        assert!(
            path.is_file(),
            "{} is missing: cargo build --release",
            path.display()
        );
        Self {
            path,
            folder: folder.to_path_buf(),
        }
    }

    /// Processor time (s) of a run, on this many workers.
    pub(crate) fn seconds(&self, arguments: &str, workers: u32) -> f64 {
        let before = of_children();
        let status = Command::new(&self.path)
            .args(arguments.split(' '))
            .env("RAYON_NUM_THREADS", workers.to_string())
            .current_dir(&self.folder)
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .status()
            .expect("the program starts");
        // What was repeated or flies past its end is doubted.
        let code = status.code();
        assert!(matches!(code, Some(0 | 4 | 5)), "{arguments}: {code:?}");
        of_children() - before
    }
}

/// Processor time (s) of the children that have ended, from the system's count of hundredths.
fn of_children() -> f64 {
    let text = std::fs::read_to_string("/proc/self/stat").expect("Linux");
    let (_, after_name) = text.rsplit_once(')').expect("a name in brackets");
    let ticks = after_name.split_whitespace().skip(13).take(2);
    let ticks = ticks.map(|ticks| ticks.parse::<f64>().expect("a number"));
    ticks.sum::<f64>() / 100.0
}

/// Least processor time (s) of this thread for some work, of a few attempts.
pub(crate) fn least<T>(mut work: impl FnMut() -> T) -> f64 {
    let attempt = |_| {
        let before = of_this_thread();
        std::hint::black_box(work());
        of_this_thread() - before
    };
    (0..3).map(attempt).fold(f64::INFINITY, f64::min)
}

fn of_this_thread() -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").expect("Linux");
    let nanoseconds = text.split(' ').next().expect("a number");
    nanoseconds.parse::<f64>().expect("a number") * 1e-9
}

/// Size of a file (bytes).
pub(crate) fn size(path: &Path) -> f64 {
    std::fs::metadata(path).expect("a file").len() as f64
}
