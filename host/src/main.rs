//! The command line.

use std::process::ExitCode;

fn main() -> ExitCode {
    ExitCode::from(bodyflight::cli::main(std::env::args_os()))
}
