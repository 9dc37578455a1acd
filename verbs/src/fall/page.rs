//! A page about the jumps of one or many tracks: figures as a skydiver reads them, a map, and height, speed and drag area
//! over time with the phases marked. It is one HTML file with drawings in SVG, and needs neither a network nor scripts.

mod chart;
mod drawing;
mod figures;
mod map;

use std::path::Path;

use bodyflight_falls::fall::Jump;
use bodyflight_falls::verdict::Verdict;

use super::units::Units;
use super::{Falls, Report};
use drawing::escaped;

/// A track with its jumps.
pub struct Entry<'a> {
    /// The file.
    pub track: &'a Path,
    /// Its jumps.
    pub falls: &'a Falls,
}

/// Style of the page: readable on paper and on a dark screen.
const STYLE: &str = "body{font:15px/1.45 system-ui,sans-serif;max-width:960px;margin:1.5em auto;padding:0 1em;color:#222;\
background:#fff}h1{font-size:1.4em}h2{font-size:1.15em;margin-top:2em;border-top:1px solid #ccc;padding-top:.8em}\
table{border-collapse:collapse;font-variant-numeric:tabular-nums}td,th{padding:.15em .8em .15em 0;text-align:left;\
vertical-align:top}.book td,.book th{border-bottom:1px solid #ddd;text-align:right;white-space:nowrap;font-size:.85em;\
padding-right:.5em}.book td:first-child,\
.book th:first-child{text-align:left;white-space:normal}.figures{columns:2}.figures tr{break-inside:avoid}.note{color:#555}svg{max-width:100%;\
height:auto;display:block;margin:.6em 0}svg text{font:12px system-ui,sans-serif;fill:#333}";

/// The page. Tracks without a jump are listed with their reasons, `refused`.
pub fn html(title: &str, entries: &[Entry<'_>], refused: &[String], units: Units) -> String {
    let title = escaped(title);
    let mut page = format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" \
         content=\"width=device-width\"><title>{title}</title><style>{STYLE}</style></head><body>\n<h1>{title}</h1>\n"
    );
    let several = entries
        .iter()
        .map(|entry| entry.falls.jumps.len())
        .sum::<usize>()
        > 1;
    if several {
        page += &book(entries, units);
    }
    let mut number = 0;
    for entry in entries {
        for (place, (report, jump)) in entry.falls.jumps.iter().enumerate() {
            number += 1;
            page += &section(entry, (number, place), (report, jump), units);
        }
    }
    if !refused.is_empty() {
        page += "<h2>Tracks without a jump</h2>\n<ul>";
        for reason in refused {
            page += &format!("<li>{}</li>", escaped(reason));
        }
        page += "</ul>\n";
    }
    page + "</body></html>\n"
}

/// The table of all jumps, each with a small drawing of its height.
fn book(entries: &[Entry<'_>], units: Units) -> String {
    let mut table = "<table class=\"book\"><tr><th>jump</th><th>UTC</th><th>exit</th><th>opening</th><th>fall</th>\
                     <th>mean</th><th>fastest</th><th>drag area</th><th>verdict</th><th>height</th></tr>\n"
        .to_owned();
    let mut number = 0;
    for entry in entries {
        for (report, jump) in &entry.falls.jumps {
            number += 1;
            let height = |moment: Option<super::Moment>| {
                moment.map_or("?".to_owned(), |moment| units.length(moment.height_m))
            };
            let cells = [
                format!(
                    "<a href=\"#jump-{number}\">{}</a>",
                    escaped(&name(entry.track))
                ),
                date(report),
                height(report.exit),
                height(report.opening),
                format!("{:.1} s", report.fall_s),
                units.speed(report.mean_rate_mps),
                units.speed(report.fastest_mps),
                figures::area(report),
                report.verdict.name().to_owned(),
                chart::small(jump),
            ];
            let cells = cells.map(|cell| format!("<td>{cell}</td>"));
            table += &format!("<tr>{}</tr>\n", cells.concat());
        }
    }
    table + "</table>\n"
}

fn section(
    entry: &Entry<'_>,
    (number, place): (usize, usize),
    (report, jump): (&Report, &Jump),
    units: Units,
) -> String {
    let mut text = format!(
        "<h2 id=\"jump-{number}\">{} {}</h2>\n",
        escaped(&name(entry.track)),
        date(report)
    );
    let doubtful = matches!(report.verdict, Verdict::Uncertain | Verdict::Unexplained);
    text += &format!(
        "<p{}><b>{}</b>: {}.</p>\n",
        if doubtful { "" } else { " class=\"note\"" },
        report.verdict.name(),
        escaped(report.reason.trim_end_matches('.'))
    );
    if place == 0 {
        for finding in &entry.falls.channels {
            text += &format!("<p class=\"note\">{}.</p>\n", escaped(&finding.sentence));
        }
    }
    text += &figures::table(report, jump, units);
    text += &chart::charts(jump, report.mass_kg, units);
    text += &map::map(jump, units);
    text += &figures::winds(report, units);
    text
}

/// The name of a track: its file, and for a file that is named alike in every folder, the folder too.
fn name(track: &Path) -> String {
    let file = track.file_name().unwrap_or_default().to_string_lossy();
    let folder = track.parent().and_then(Path::file_name);
    match folder {
        Some(folder) if file.eq_ignore_ascii_case("TRACK.CSV") => {
            format!("{}/{file}", folder.to_string_lossy())
        }
        _ => file.into_owned(),
    }
}

fn date(report: &Report) -> String {
    let start = report
        .exit
        .or(report.opening)
        .and_then(|moment| moment.unix_s);
    start.and_then(bodyflight_tracks::date).unwrap_or_default()
}
