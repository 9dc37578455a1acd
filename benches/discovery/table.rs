//! Generates the tables of `docs/discovery.md` from the rows of a run.

use std::fmt::Write as _;

use serde_json::Value;

/// Groups in order, with descriptions.
pub(super) const GROUPS: [(&str, &str); 7] = [
    ("single", "one effect"),
    ("pair", "two effects"),
    ("clean", "nothing"),
    ("maneuver", "nothing, synth scripts with their inputs"),
    ("tunnel", "nothing, synth scripts in a tunnel"),
    ("outside", "something outside the library"),
    ("load", "a load drawn from the grammar"),
];

/// Families in order.
pub(super) const FAMILIES: [&str; 5] = ["exact", "constant", "wander", "mixed", "wide"];

pub(super) fn of<'a>(rows: &'a [Value], group: &str, family: &str) -> Vec<&'a Value> {
    let all = rows.iter();
    all.filter(|row| row["group"] == group && row["family"] == family)
        .collect()
}

pub(super) fn count(rows: &[&Value], key: &str) -> usize {
    rows.iter().filter(|row| row[key] == true).count()
}

pub(super) fn sum(rows: &[&Value], key: &str) -> u64 {
    rows.iter().filter_map(|row| row[key].as_u64()).sum()
}

fn sorted(rows: &[&Value], key: &str) -> Vec<f64> {
    let mut values: Vec<f64> = rows.iter().filter_map(|row| row[key].as_f64()).collect();
    values.sort_by(f64::total_cmp);
    values
}

fn percent(part: f64, all: f64) -> String {
    format!("{:.0} %", 100.0 * part / all)
}

/// A share with its 95 % confidence interval (Wilson 1927).
fn share(part: usize, all: usize) -> String {
    let (part, all, square) = (part as f64, all as f64, 1.96_f64.powi(2));
    let middle = (part + 0.5 * square) / (all + square);
    let half = (square * (part * (all - part) / all + 0.25 * square)).sqrt() / (all + square);
    format!(
        "{} ({:.0} to {:.0})",
        percent(part, all),
        100.0 * (middle - half).max(0.0),
        100.0 * (middle + half).min(1.0)
    )
}

/// All tables: by group and family, and the wrong answers.
pub(super) fn tables(rows: &[Value]) -> String {
    let mut text = String::from(
        "| hidden disturbance | joints | pairs | correct (95 % interval) | false names | true parameters within 95 % intervals | misfit: median, 5th and 95th percentile | processor time per pair: median, 95th percentile |\n|---|---|---|---|---|---|---|---|\n",
    );
    for (group, words) in GROUPS {
        for family in FAMILIES {
            let own = of(rows, group, family);
            if !own.is_empty() {
                line(&mut text, words, family, &own);
            }
        }
    }
    everything(&mut text, rows);
    calibrated(&mut text, rows);
    missed(&mut text, rows);
    clean(&mut text, rows);
    described(&mut text, rows);
    wrong(&mut text, rows);
    text
}

fn line(text: &mut String, words: &str, family: &str, rows: &[&Value]) {
    let at = |values: &[f64], share: f64| -> f64 {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a share of a length"
        )]
        let place = ((values.len().max(1) - 1) as f64 * share).round() as usize;
        values.get(place).copied().unwrap_or(f64::NAN)
    };
    let all = rows.len();
    let right = count(rows, "right");
    let (parameters, within) = (sum(rows, "parameters"), sum(rows, "within_95"));
    let within = if parameters == 0 {
        String::new()
    } else {
        let share = percent(within as f64, parameters as f64);
        format!("{within} of {parameters}, {share}")
    };
    let (misfits, times) = (sorted(rows, "misfit"), sorted(rows, "processor_seconds"));
    let _ = writeln!(
        text,
        "| {words} | {family} | {all} | {right}, {} | {} | {within} | {:.2}, {:.2} to {:.2} | {:.1} s, {:.1} s |",
        share(right, all),
        count(rows, "false_name"),
        at(&misfits, 0.5),
        at(&misfits, 0.05),
        at(&misfits, 0.95),
        at(&times, 0.5),
        at(&times, 0.95),
    );
}

/// Summary of all pairs: correct answers and false names.
fn everything(text: &mut String, rows: &[Value]) {
    if rows.is_empty() {
        return;
    }
    let all: Vec<&Value> = rows.iter().collect();
    let single: Vec<&Value> = rows.iter().filter(|row| row["group"] == "single").collect();
    let mut lines = vec![
        ("Correct, all pairs", count(&all, "right"), all.len()),
        (
            "False names, all pairs",
            count(&all, "false_name"),
            all.len(),
        ),
    ];
    if !single.is_empty() {
        lines.push(("Correct, one effect", count(&single, "right"), single.len()));
    }
    text.push('\n');
    for (words, part, of) in lines {
        let _ = writeln!(text, "- {words}: {part} of {of}, {}.", share(part, of));
    }
}

/// Probabilities that separate the lines of [`calibrated`].
const STATED: [f64; 6] = [0.0, 0.02, 0.5, 0.98, 0.999, 1.0];

/// How often effects act, by the stated probability that they do: those named, and the nearest one.
fn calibrated(text: &mut String, rows: &[Value]) {
    let judged = rows.iter().filter_map(|row| row["judged"].as_array());
    let judged: Vec<&Value> = judged.flatten().collect();
    if judged.is_empty() {
        return;
    }
    text.push_str(
        "\n| stated probability that an effect acts | effects | that act (95 % interval) |\n|---|---|---|\n",
    );
    for bounds in STATED.windows(2) {
        let (least, most) = (bounds[0], bounds[1]);
        let is_within = |one: &&&Value| {
            let acts = one["acts"].as_f64().unwrap_or(f64::NAN);
            least <= acts && (acts < most || (acts <= most && most >= 1.0))
        };
        let own: Vec<&Value> = judged.iter().filter(is_within).copied().collect();
        if own.is_empty() {
            continue;
        }
        let act = count(&own, "is_hidden");
        let _ = writeln!(
            text,
            "| {:.1} to {:.1} % | {} | {act}, {} |",
            100.0 * least,
            100.0 * most,
            own.len(),
            share(act, own.len()),
        );
    }
}

/// Hidden effects that were not named, by whether the report says that such flights would show them.
fn missed(text: &mut String, rows: &[Value]) {
    let shares = rows.iter().filter_map(|row| row["share_of_limit"].as_f64());
    let shares: Vec<f64> = shares.collect();
    if shares.is_empty() {
        return;
    }
    let weaker = shares.iter().filter(|share| **share < 1.0).count();
    let _ = writeln!(
        text,
        "\nSingle effects with a value that were not named, {}: {weaker} are weaker than what the report says that such flights would show.",
        shares.len(),
    );
}

/// Misfit of flights with nothing hidden, by family and sensor noise.
fn clean(text: &mut String, rows: &[Value]) {
    let is_clean = |row: &&Value| row["group"] == "clean";
    if !rows.iter().any(|row| is_clean(&row)) {
        return;
    }
    text.push_str("\n| misfit with nothing hidden, minimum to maximum | sensor noise 0.5 to 1 times the paper's | 1 to 2 times |\n|---|---|---|\n");
    for family in FAMILIES {
        let own = of(rows, "clean", family);
        if own.is_empty() {
            continue;
        }
        let range = |noisy: bool| {
            let is_so = |row: &&Value| (row["sensor_noise"].as_f64() > Some(1.0)) == noisy;
            let part: Vec<&Value> = own.iter().copied().filter(is_so).collect();
            let misfits = sorted(&part, "misfit");
            match (misfits.first(), misfits.last()) {
                (Some(least), Some(most)) => {
                    format!("{least:.2} to {most:.2}, pairs: {}", part.len())
                }
                _ => String::new(),
            }
        };
        let _ = writeln!(text, "| {family} | {} | {} |", range(false), range(true));
    }
}

/// For disturbances outside the library: the share that descriptions explain in held-out flights.
fn described(text: &mut String, rows: &[Value]) {
    let outside = |row: &&Value| row["group"] == "outside" || row["group"] == "load";
    let all: Vec<&Value> = rows.iter().filter(outside).collect();
    if all.is_empty() {
        return;
    }
    let shares = sorted(&all, "described_share_held_out");
    let enough = shares.iter().filter(|share| **share >= 0.7).count();
    let _ = writeln!(
        text,
        "\nDisturbances outside the library, {} pairs: {} described, {enough} of them explaining at least 70 % of what any load could in the held-out flight.",
        all.len(),
        shares.len(),
    );
}

/// Wrong answers, one line each.
fn wrong(text: &mut String, rows: &[Value]) {
    let wrong: Vec<&Value> = rows.iter().filter(|row| row["right"] != true).collect();
    if wrong.is_empty() {
        return;
    }
    text.push_str(
        "\n| wrong answer | joints | seed | sensor noise | found |\n|---|---|---|---|---|\n",
    );
    for (group, _) in GROUPS {
        for row in wrong.iter().filter(|row| row["group"] == group) {
            let listed = |key: &str, name: fn(&Value) -> Option<&str>| {
                let found = row[key].as_array().into_iter().flatten();
                found.filter_map(name).collect::<Vec<_>>().join(" + ")
            };
            let names = listed("effects", |effect| effect["name"].as_str());
            let verdict = row["verdict"].as_str().unwrap_or_default();
            let instead = match verdict {
                "calibrated" => listed("nearest", Value::as_str),
                _ => String::new(),
            };
            let or = if instead.is_empty() { "" } else { "or " };
            let _ = writeln!(
                text,
                "| {} | {} | {} | {} | {verdict} {names}{or}{instead} |",
                row["name"].as_str().unwrap_or_default(),
                row["family"].as_str().unwrap_or_default(),
                row["seed"],
                row["sensor_noise"],
            );
        }
    }
}
