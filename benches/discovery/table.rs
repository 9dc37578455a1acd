//! The table of `docs/discovery.md`, from the rows of a run.

use std::fmt::Write as _;

use serde_json::Value;

/// One line for each thing that was hidden and each family of joints, and one for each group.
pub(super) fn table(rows: &[Value]) -> String {
    let mut table = String::from(
        "| hidden | joints | flights | right | by exact name | parameters within 3 standard errors | held-out misfit closed: mean, least, at least 0.9 | otherwise |\n|---|---|---|---|---|---|---|---|\n",
    );
    let mut keys: Vec<(String, String)> = Vec::new();
    let label = |row: &Value| {
        let hidden = row["hidden"].as_array().map_or_else(Vec::new, Clone::clone);
        let hidden: Vec<&str> = hidden.iter().filter_map(Value::as_str).collect();
        let name = if hidden.is_empty() {
            "nothing".to_owned()
        } else {
            hidden.join(" + ")
        };
        (name, row["family"].as_str().unwrap_or_default().to_owned())
    };
    for row in rows {
        if !keys.contains(&label(row)) {
            keys.push(label(row));
        }
    }
    for group in ["single", "clean", "outside", "pair"] {
        let own: Vec<&Value> = rows.iter().filter(|row| row["group"] == group).collect();
        if own.is_empty() {
            continue;
        }
        for key in keys
            .iter()
            .filter(|key| own.iter().any(|row| label(row) == **key))
        {
            let of: Vec<&Value> = own
                .iter()
                .copied()
                .filter(|row| label(row) == *key)
                .collect();
            line(&mut table, &key.0, &key.1, &of);
        }
        line(&mut table, &format!("**all: {group}**"), "", &own);
    }
    table
}

fn line(table: &mut String, name: &str, family: &str, rows: &[&Value]) {
    let right = rows.iter().filter(|row| row["right"] == true).count();
    let exact = rows.iter().filter(|row| row["exact"] == true).count();
    let sum = |key: &str| rows.iter().filter_map(|row| row[key].as_u64()).sum::<u64>();
    let closed: Vec<f64> = rows
        .iter()
        .filter(|row| row["right"] == true && row["verdict"] == "named")
        .filter_map(|row| row["held_out_closed_share"].as_f64())
        .map(|share| share.min(1.0))
        .collect();
    let (mut least, mut sum_of) = (f64::INFINITY, 0.0);
    for share in &closed {
        least = least.min(*share);
        sum_of += share;
    }
    let most = closed.iter().filter(|share| **share >= 0.9).count();
    let closed = match closed.len() {
        0 => String::new(),
        count => format!(
            "{:.2}, least {least:.2}, {most} of {count}",
            sum_of / count as f64
        ),
    };
    let mut otherwise: Vec<String> = rows
        .iter()
        .filter(|row| row["right"] != true)
        .map(|row| {
            let found = row["effects"]
                .as_array()
                .map_or_else(Vec::new, Clone::clone);
            let found: Vec<String> = found
                .iter()
                .filter_map(|e| e["name"].as_str().map(str::to_owned))
                .collect();
            let verdict = row["verdict"].as_str().unwrap_or_default();
            if verdict == "named" {
                found.join(" + ")
            } else {
                verdict.to_owned()
            }
        })
        .collect();
    otherwise.sort();
    otherwise.dedup();
    let otherwise = if name.starts_with("**") {
        String::new()
    } else {
        otherwise.join(", ")
    };
    let (all, within) = (sum("parameters"), sum("within_three_standard_errors"));
    let within = if all == 0 {
        String::new()
    } else {
        format!("{within} of {all}")
    };
    let _ = writeln!(
        table,
        "| {name} | {family} | {} | {right} | {exact} | {within} | {closed} | {otherwise} |",
        rows.len()
    );
}
