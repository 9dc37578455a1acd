//! The text of `bodyflight fall`.

use bodyflight_falls::prediction::{Prediction, Trials};
use bodyflight_verbs::fall::answer::Answer;
use bodyflight_verbs::fall::beside::Beside;
use bodyflight_verbs::fall::logbook::Logbook;
use bodyflight_verbs::fall::units::Units;
use bodyflight_verbs::fall::{Moment, Report, WindRow};

use crate::cli::terminal;

/// Prints all that is known of a track.
pub(super) fn answer(answer: &Answer, units: Units) {
    for finding in &answer.channels {
        terminal::print(&finding.sentence);
    }
    for note in &answer.notes {
        terminal::print(note);
    }
    print(&answer.report, units);
    for (place, other) in answer.other_jumps.iter().enumerate() {
        terminal::print(&format!("\nanother jump on this track ({}):", place + 2));
        print(other, units);
    }
}

/// Prints a line for each jump.
pub(super) fn logbook(book: &Logbook, units: Units) {
    let mut table = terminal::table(&[
        "track",
        "UTC",
        "exit",
        "opening",
        "fall s",
        "mean",
        "fastest",
        "normalised",
        "verdict",
    ])
    .path(0)
    .spare(&[7, 6, 4, 5]);
    for line in &book.jumps {
        let length =
            |height: Option<f64>| height.map_or("?".to_owned(), |metres| units.length(metres));
        table.add_row([
            line.track.clone(),
            line.date().unwrap_or_default(),
            length(line.exit_height_m),
            length(line.opening_height_m),
            format!("{:.1}", line.fall_s),
            units.speed(line.mean_rate_mps),
            units.speed(line.fastest_mps),
            units.speed(line.normalised_rate_mps),
            line.verdict.name().to_owned(),
        ]);
    }
    terminal::print(&table.to_string());
    for refused in &book.refused {
        terminal::print(refused);
    }
    terminal::print(&format!(
        "{} tracks, {} jumps, {} tracks without one",
        book.tracks,
        book.jumps.len(),
        book.refused.len()
    ));
}

fn moment(name: &str, moment: Option<&Moment>, units: Units) {
    let Some(moment) = moment else {
        terminal::print(&format!("{name:<10}not on the track"));
        return;
    };
    terminal::print(&format!(
        "{name:<10}{:.1} +- {:.1} s, {}",
        moment.time_s,
        moment.deviation_s,
        units.length(moment.height_m)
    ));
}

fn print(report: &Report, units: Units) {
    moment("exit", report.exit.as_ref(), units);
    moment("opening", report.opening.as_ref(), units);
    moment("canopy", report.canopy.as_ref(), units);
    moment("landing", report.landing.as_ref(), units);
    terminal::print(&format!(
        "fall      {:.1} s, {} over ground; mean {}, fastest {}; {} normalised to {} of the standard atmosphere",
        report.fall_s,
        units.length(report.fall_distance_m),
        units.speed(report.mean_rate_mps),
        units.speed(report.fastest_mps),
        units.speed(report.normalised_rate_mps),
        units.length(report.reference_height_m)
    ));
    if let (Some(time), Some(way)) = (report.canopy_s, report.canopy_distance_m) {
        terminal::print(&format!(
            "canopy    {time:.0} s, {} over ground from opening to landing",
            units.length(way)
        ));
    }
    terminal::print(&format!("drag area {}", drag(report)));
    let glide =
        |glide: Option<f64>| glide.map_or("unknown".to_owned(), |glide| format!("{glide:.2}"));
    terminal::print(&format!(
        "glide     {} in the fall, {} under canopy over ground",
        glide(report.glide),
        glide(report.canopy_glide)
    ));
    if let Some(opening) = &report.opening_details {
        let sensed = report.sensors.largest_g.map_or(String::new(), |g| {
            format!(", {g:.1} g by the accelerometer")
        });
        terminal::print(&format!(
            "opened    in {:.1} s and {}, {:.1} g by the receiver{sensed}",
            opening.duration_s,
            units.length(opening.lost_m),
            opening.largest_g
        ));
    }
    print_sensors(report);
    let mut table = terminal::table(&["piece", "drag area m2", "lift area m2", "glide"]);
    for piece in &report.pieces {
        table.add_row([
            format!("{:.1} to {:.1} s", piece.from_s, piece.until_s),
            format!("{:.3} +- {:.3}", piece.drag_area_m2, piece.deviation_m2),
            format!("{:.3}", piece.lift_area_m2),
            format!("{:.2}", piece.glide),
        ]);
    }
    terminal::print(&table.to_string());
    print_winds(report, units);
    if let Some(prediction) = &report.prediction {
        print_prediction(prediction, units);
    }
    if let Some(beside) = &report.beside {
        print_beside(beside, units);
    }
    if report.rows_taken_out + report.rows_skipped > 0 {
        terminal::print(&format!(
            "{} rows are far from their neighbours and {} could not be read; none of them were used",
            report.rows_taken_out, report.rows_skipped
        ));
    }
    if !report.has_velocities {
        terminal::print(
            "the track has no velocities: they are differentiated from its positions, and noisier",
        );
    }
    let verdict = report.verdict.name();
    terminal::print(&format!("verdict: {verdict} ({})", report.reason));
}

fn drag(report: &Report) -> String {
    match report.steady_drag() {
        Some([area, spread, ballistic]) => format!(
            "{area:.3} m2 at {:.0} kg, +- {spread:.3} from second to second; {ballistic:.0} kg/m2",
            report.mass_kg
        ),
        None => "unknown: no second of the fall can be used, or nothing slows it".to_owned(),
    }
}

fn print_sensors(report: &Report) {
    let sensors = &report.sensors;
    if let (Some(force), Some(area)) = (sensors.fall_g, sensors.drag_area_m2) {
        terminal::print(&format!(
            "sensors   {force:.2} g in the steady fall, and from it a drag area of {area:.3} m2"
        ));
    }
    if let Some([usual, largest]) = sensors.canopy_g {
        terminal::print(&format!(
            "          {usual:.2} g under canopy, {largest:.1} at most"
        ));
    }
    if let Some([x, y, z]) = sensors.up_in_logger {
        terminal::print(&format!(
            "          up in the steady fall is ({x:.2}, {y:.2}, {z:.2}) in the axes of the logger"
        ));
    }
}

fn print_beside(beside: &Beside, units: Units) {
    let winds = match beside.winds_apart {
        Some(apart) => format!(
            "the winds of both falls are {apart:.1} deviations apart, at {} heights",
            beside.heights
        ),
        None => "the wind cannot be derived from one of the falls".to_owned(),
    };
    terminal::print(&format!(
        "beside    {} at the same height of the standard atmosphere; {winds}",
        units.speed(beside.normalised_rate_mps)
    ));
}

fn print_prediction(prediction: &Prediction, units: Units) {
    let factor = units.speed_factor();
    terminal::print(&format!(
        "last third: {:.1} +- {:.1} {} downwards predicted from the first two, {:.1} measured; {}",
        prediction.predicted_mps * factor,
        prediction.deviation_mps * factor,
        units.speed_name(),
        prediction.measured_mps * factor,
        prediction.sentence
    ));
    let changed = match prediction.changes_before {
        0 => "never".to_owned(),
        1 => "once".to_owned(),
        times => format!("{times} times"),
    };
    let Trials {
        made,
        held,
        within_one,
        within_two,
    } = prediction.trials;
    terminal::print(&format!(
        "            the posture had changed {changed} before: a chance of {:.0} % that it stays. Of {made} earlier predictions \
         of this kind {held} held within 5 %, {within_one} within one deviation, {within_two} within two",
        100.0 * prediction.kept_chance
    ));
}

fn print_winds(report: &Report, units: Units) {
    if report.wind.is_empty() {
        terminal::print(
            "wind      not determined by the fall: it glides, is too short, or the bars are wider than the wind",
        );
    }
    if !report.wind.is_empty() || !report.canopy_wind.is_empty() {
        let (name, factor) = (units.speed_name(), units.speed_factor());
        let bars = format!("+- {name}");
        let mut table = terminal::table(&["wind at", "from", name, &bars, "source"]);
        let mut add = |row: &WindRow, by: &str| {
            table.add_row([
                units.length(row.height_m),
                format!("{:.0} deg", row.from_rad.to_degrees()),
                format!("{:.1}", row.speed_mps * factor),
                format!("{:.1}", row.deviation_mps * factor),
                by.to_owned(),
            ]);
        };
        report.wind.iter().for_each(|row| add(row, "the fall"));
        report
            .canopy_wind
            .iter()
            .for_each(|row| add(row, "circles under canopy"));
        terminal::print(&table.to_string());
    }
    if let Some(apart) = report.winds_apart {
        terminal::print(&format!(
            "winds of fall and canopy are {apart:.1} deviations apart"
        ));
    }
}
