//! Compares the tables of `docs/link.md`, which describe every byte, with the code's.

use std::format;
use std::string::String;

use super::*;

const PAGE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/link.md");
const BEGIN: &str = "<!-- byte table: written by the test, see the top of the page -->\n";
const END: &str = "<!-- end of the byte table -->\n";

fn rows(fields: &[FieldLayout], start: usize, table: &mut String) {
    table.push_str("| offset | bytes | type | field | unit | range | meaning |\n");
    table.push_str("|---|---|---|---|---|---|---|\n");
    let mut offset = start;
    for field in fields {
        let kind = match field.count {
            1 => String::from(field.kind),
            count => format!("{count} x {}", field.kind),
        };
        table.push_str(&format!(
            "| {offset} | {} | {} | `{}` | {} | {} | {} |\n",
            field.size,
            kind.trim_end(),
            field.name,
            field.unit,
            field.range,
            field.meaning.trim(),
        ));
        offset += field.size;
    }
}

fn byte_table() -> String {
    let mut table = format!("Schema hash: `{SCHEMA_HASH:#018x}`\n\n### Header\n\n");
    rows(HEADER, 0, &mut table);
    for message in MESSAGES {
        let wire = 16 + message.size + 4 + 1 + 2;
        table.push_str(&format!(
            "\n### {} = {:#04x}\n\n{} bytes of body, {wire} on the wire.\n\n",
            message.name, message.code, message.size,
        ));
        if !message.fields.is_empty() {
            rows(message.fields, 16, &mut table);
        }
    }
    table
}

#[test]
fn the_page_shows_the_table_of_the_code() {
    let page = std::fs::read_to_string(PAGE).unwrap();
    let (before, rest) = page.split_once(BEGIN).expect("the page marks its table");
    let (found, after) = rest.split_once(END).expect("the page marks the end");
    let expected = byte_table();
    if std::env::var_os("BODYFLIGHT_WRITE_DOCS").is_some() {
        let page = format!("{before}{BEGIN}{expected}{END}{after}");
        std::fs::write(PAGE, page).unwrap();
    } else {
        assert!(
            found == expected,
            "docs/link.md differs from the code: run this test with BODYFLIGHT_WRITE_DOCS=1"
        );
    }
}

#[test]
fn sizes_in_the_table_are_sizes_on_the_wire() {
    for message in examples() {
        let layout = MESSAGES.iter().find(|m| m.code == message.code()).unwrap();
        assert_eq!(layout.name, message.name());
        let sum: usize = layout.fields.iter().map(|field| field.size).sum();
        assert_eq!(layout.size, sum);
        let length = frame_of(&header(), &message).len();
        assert_eq!(length, 16 + sum + 4 + 1 + 2, "{}", layout.name);
    }
    assert_eq!(HEADER.iter().map(|field| field.size).sum::<usize>(), 16);
}

#[test]
fn samples_fit_the_line() {
    // 460800 baud carries 46080 bytes per second, 70 % of which is the budget at 240 Hz.
    assert_eq!(frame_of(&header(), &Message::Sample(sample())).len(), 134);
}

#[test]
fn every_type_has_its_own_code_and_an_example() {
    for (i, a) in MESSAGES.iter().enumerate() {
        assert!(MESSAGES.iter().skip(i + 1).all(|b| a.code != b.code));
        assert!(examples().iter().any(|message| message.code() == a.code));
    }
}
