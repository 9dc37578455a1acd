//! Draws the results of a run: how often the answer was correct, by disturbance and family.

use std::fmt::Write as _;

use serde_json::Value;

use super::table::{FAMILIES, GROUPS, count, of, sum};

/// Left edge of the first bars, width of a bar, distance between lines, and top of the first line (pixels).
const LEFT: f64 = 300.0;
const WIDTH: f64 = 300.0;
const LINE: f64 = 17.0;
const TOP: f64 = 44.0;

/// A bar filled to a fraction of its width, with a number beside it.
fn bar(svg: &mut String, place: (f64, f64), share: f64, words: &str) {
    let (x, y) = place;
    let _ = writeln!(
        svg,
        "<rect x=\"{x}\" y=\"{y:.0}\" width=\"{WIDTH}\" height=\"11\" fill=\"#eee\"/>\
         <rect x=\"{x}\" y=\"{y:.0}\" width=\"{:.1}\" height=\"11\" fill=\"#8fb8de\"/>\
         <text x=\"{:.0}\" y=\"{:.0}\">{words}</text>",
        share * WIDTH,
        x + WIDTH + 6.0,
        y + 10.0,
    );
}

/// Renders the figure as SVG.
pub(super) fn figure(rows: &[Value]) -> String {
    let second = LEFT + WIDTH + 110.0;
    let mut lines = String::new();
    let mut y = TOP;
    for (group, words) in GROUPS {
        for family in FAMILIES {
            let own = of(rows, group, family);
            if own.is_empty() {
                continue;
            }
            let (right, all) = (count(&own, "right"), own.len());
            let _ = writeln!(
                lines,
                "<text x=\"{:.0}\" y=\"{:.0}\" text-anchor=\"end\">{words}, {family}</text>",
                LEFT - 8.0,
                y + 10.0
            );
            let label = format!("{right} of {all}");
            bar(&mut lines, (LEFT, y), right as f64 / all as f64, &label);
            let (parameters, within) = (sum(&own, "parameters"), sum(&own, "within_95"));
            if parameters > 0 {
                let label = format!("{within} of {parameters}");
                bar(
                    &mut lines,
                    (second, y),
                    within as f64 / parameters as f64,
                    &label,
                );
            }
            y += LINE;
        }
        y += 6.0;
    }
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{:.0}\" height=\"{:.0}\" font-family=\"sans-serif\" font-size=\"11\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n\
         <text x=\"{LEFT}\" y=\"28\" font-weight=\"bold\">correct</text>\
         <text x=\"{second}\" y=\"28\" font-weight=\"bold\">true parameters within 95 % intervals</text>\n{lines}</svg>\n",
        second + WIDTH + 90.0,
        y + 10.0,
    )
}
