//! `bodyflight discover` for the track of a point.

use std::path::PathBuf;

use bodyflight::diagnostic::{Problem, Result};
use bodyflight::formats::flight::Flight;
use bodyflight::formats::flysight::is_flysight;
use bodyflight::verbs::discover::{figure, model_toml, problem, read_point_track};
use bodyflight_discovery::point::report::{COMPONENT_NAMES, Report};
use bodyflight_discovery::point::search::discover;

use super::args::Args;
use super::output::{print_conclusion, print_gap, print_held_out, print_names, write_all};
use crate::cli::terminal;

pub(super) fn run(args: &Args, json: bool) -> Result<()> {
    let flight = Flight::read(args.flight())?;
    let track = read_point_track(&flight.recording)?;
    let other = |path: &PathBuf| {
        let recording = Flight::read(path)?.recording;
        if is_flysight(&recording) {
            read_point_track(&recording)
        } else {
            Err(
                Problem::bad_input("expected the recording of a point (CSV)")
                    .in_file(&recording)
                    .help("flights that are held out must be of the same kind as those fitted"),
            )
        }
    };
    let held_out = args
        .hold_out
        .iter()
        .map(other)
        .collect::<Result<Vec<_>>>()?;
    let report = discover(
        &track,
        &held_out,
        &|height| flight.dynamics(height),
        args.max_effects,
    )
    .map_err(|error| problem(error).in_file(&flight.recording))?;
    if let Some(folder) = &args.out {
        let title = format!("{}: what the model misses", args.flight().display());
        let figure = figure::point_svg(&title, &report)?;
        write_all(folder, &report, &figure, &model_toml(&report.model, None))?;
    }
    if json {
        return terminal::print_json(&report);
    }
    print(&report);
    if let Some(folder) = &args.out {
        terminal::print(&format!("written: {}", folder.display()));
    }
    print_conclusion(
        (report.verdict, &report.effects),
        report.gap.closed_share,
        (args.flight(), args.out.as_deref()),
    );
    Ok(())
}

fn print(report: &Report) {
    print_names(report.verdict, &report.effects, &report.nearest);
    terminal::print(&format!(
        "free fall of {:.1} s, noise of a velocity {:.2} m/s, {} rows skipped",
        report.free_fall_s, report.noise_mps, report.rows_skipped
    ));
    if let Some(latency) = report.latency {
        terminal::print(&format!(
            "velocity late by {:.3} +- {:.3} s, compared with the positions",
            latency.latency_s, latency.standard_error_s
        ));
    }
    if let Some(force) = report.specific_force {
        terminal::print(&format!(
            "mean specific force {:.2} m/s2 from the inertial sensor, {:.2} from the satellites",
            force.inertial_mps2, force.satellites_mps2
        ));
    }
    let gap = &report.gap;
    print_gap(
        ["missing in 2 s", "noise and posture"],
        &COMPONENT_NAMES,
        [&gap.before, &gap.after, &gap.floor],
    );
    for (index, gap) in report.held_out.iter().enumerate() {
        let misfits = [gap.misfit_before, gap.misfit_after, gap.misfit_expected];
        print_held_out("fall", index, misfits, gap.closed_share);
    }
}
