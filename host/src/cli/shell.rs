//! `bodyflight completions` and `bodyflight man`.

use std::path::PathBuf;

use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::files::write_file;
use clap::Command;
use clap_complete::Shell;

use super::outputs::Outputs;
use super::terminal;

/// Print the completion script for a shell.
#[derive(clap::Args)]
#[command(
    after_help = "Example: bodyflight completions bash\n\nBash, for instance, reads it from ~/.local/share/bash-completion/completions/bodyflight."
)]
pub(super) struct Completions {
    /// The shell.
    shell: Shell,
}

/// Write a man page for each verb.
#[derive(clap::Args)]
#[command(
    after_help = "Example: bodyflight man --out man1\n\n`man` finds the pages in ~/.local/share/man/man1, for instance."
)]
pub(super) struct Man {
    /// Folder for the pages; created if absent.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    outputs: Outputs,
}

/// Prints the completion script of `program`; it has no JSON form.
pub(super) fn completions(args: &Completions, mut program: Command) -> Result<()> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut program, "bodyflight", &mut script);
    terminal::verbatim(&String::from_utf8_lossy(&script));
    Ok(())
}

/// Writes the pages of `program`.
pub(super) fn man(args: &Man, mut program: Command, json: bool) -> Result<()> {
    program.build();
    let mut pages = Vec::new();
    render(program, &mut pages)?;
    let names: Vec<&str> = pages.iter().map(|(name, _)| name.as_str()).collect();
    args.outputs.check_in(&args.out, &names)?;
    std::fs::create_dir_all(&args.out)
        .map_err(|error| Problem::system("create", &args.out, error))?;
    for (name, page) in &pages {
        write_file(&args.out.join(name), page)?;
    }
    if json {
        return terminal::print_plain_json(&names);
    }
    terminal::print(&format!("{} pages in {}", pages.len(), args.out.display()));
    Ok(())
}

/// Renders the pages of a command and all its subcommands, with their file names.
fn render(command: Command, pages: &mut Vec<(String, Vec<u8>)>) -> Result<()> {
    for verb in command
        .get_subcommands()
        .filter(|verb| verb.get_name() != "help")
    {
        render(verb.clone(), pages)?;
    }
    let page = clap_mangen::Man::new(command);
    let mut text = Vec::new();
    page.render(&mut text)
        .map_err(|error| Problem::internal("cannot write a man page").caused_by(error))?;
    pages.push((page.get_filename(), text));
    Ok(())
}
