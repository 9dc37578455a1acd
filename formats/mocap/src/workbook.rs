//! Sheets of a workbook of Excel (`.xlsx`): an archive with an XML file for each sheet.

use quick_xml::events::{BytesStart, Event};

use crate::archive::Archive;
use bodyflight_io::diagnostic::{Problem, Result};

/// Most columns of a sheet.
const COLUMN_LIMIT: usize = 16_384;

/// A workbook with the places of its sheets.
pub(crate) struct Workbook<'a> {
    archive: &'a Archive<'a>,
    /// Name of each sheet, and the member that holds it.
    sheets: Vec<(String, String)>,
    /// Texts that cells name by number.
    texts: Vec<String>,
}

/// A row: its number in the sheet, and the text of each cell, empty where there is none.
pub(crate) type SheetRow = (u64, Vec<String>);

/// Whether an archive is a workbook.
pub(crate) fn is_workbook(archive: &Archive<'_>) -> bool {
    archive.names().any(|name| name == "xl/workbook.xml")
}

/// The XML of a member.
fn xml(archive: &Archive<'_>, name: &str) -> Result<String> {
    let bytes = archive
        .member(name)?
        .ok_or_else(|| Problem::bad_input("the workbook lacks this part").at(name.to_owned()))?;
    String::from_utf8(bytes)
        .map_err(|_| Problem::bad_input("expected text in UTF-8").at(name.to_owned()))
}

/// The tags and texts of an XML text, in order.
fn events<'t>(
    text: &'t str,
    part: &str,
    mut of: impl FnMut(Event<'t>) -> Result<()>,
) -> Result<()> {
    let mut parser = quick_xml::Reader::from_str(text);
    loop {
        match parser.read_event() {
            Ok(Event::Eof) => return Ok(()),
            Ok(event) => of(event)?,
            Err(error) => {
                let problem = Problem::bad_input("expected XML as Excel writes it");
                return Err(problem.at(part.to_owned()).caused_by(error));
            }
        }
    }
}

fn attribute(tag: &BytesStart<'_>, name: &str) -> Option<String> {
    let mut attributes = tag.attributes().flatten();
    let found = attributes.find(|attribute| attribute.key.local_name().as_ref() == name)?;
    Some(found.value.into_owned())
}

impl<'a> Workbook<'a> {
    /// Reads the list of sheets.
    ///
    /// # Errors
    /// Returns an error if a part is absent or damaged.
    pub(crate) fn read(archive: &'a Archive<'a>) -> Result<Self> {
        let mut targets = Vec::new();
        let part = "xl/_rels/workbook.xml.rels";
        events(&xml(archive, part)?, part, |event| {
            if let Event::Start(tag) | Event::Empty(tag) = event
                && let Some((id, target)) = attribute(&tag, "Id").zip(attribute(&tag, "Target"))
            {
                let target = target.trim_start_matches('/');
                let inside = target.strip_prefix("xl/").unwrap_or(target);
                targets.push((id, format!("xl/{inside}")));
            }
            Ok(())
        })?;
        let mut sheets = Vec::new();
        let part = "xl/workbook.xml";
        events(&xml(archive, part)?, part, |event| {
            if let Event::Start(tag) | Event::Empty(tag) = event
                && tag.local_name().as_ref() == "sheet"
                && let Some((name, id)) = attribute(&tag, "name").zip(attribute(&tag, "id"))
                && let Some((_, target)) = targets.iter().find(|(known, _)| *known == id)
            {
                sheets.push((name, target.clone()));
            }
            Ok(())
        })?;
        let mut texts: Vec<String> = Vec::new();
        let part = "xl/sharedStrings.xml";
        if archive.names().any(|name| name == part) {
            events(&xml(archive, part)?, part, |event| {
                match event {
                    Event::Start(tag) | Event::Empty(tag) if tag.local_name().as_ref() == "si" => {
                        texts.push(String::new());
                    }
                    Event::Text(text) => {
                        if let Some(last) = texts.last_mut() {
                            last.push_str(&text);
                        }
                    }
                    _ => {}
                }
                Ok(())
            })?;
        }
        Ok(Self {
            archive,
            sheets,
            texts,
        })
    }

    /// Names of the sheets.
    pub(crate) fn names(&self) -> String {
        let names: Vec<&str> = self.sheets.iter().map(|(name, _)| name.as_str()).collect();
        names.join(", ")
    }

    /// The rows of a sheet, `None` if there is none of this name.
    ///
    /// # Errors
    /// Returns an error if the sheet is damaged.
    pub(crate) fn sheet(&self, name: &str) -> Result<Option<Vec<SheetRow>>> {
        let Some((_, part)) = self.sheets.iter().find(|(own, _)| own == name) else {
            return Ok(None);
        };
        let mut rows: Vec<SheetRow> = Vec::new();
        let (mut column, mut shared, mut within) = (0, false, false);
        events(&xml(self.archive, part)?, part, |event| {
            match event {
                Event::Start(tag) if tag.local_name().as_ref() == "row" => {
                    let after = rows.last().map_or(1, |(number, _)| number + 1);
                    let number = attribute(&tag, "r").and_then(|number| number.parse().ok());
                    rows.push((number.unwrap_or(after), Vec::new()));
                    column = 0;
                }
                Event::Start(tag) => match tag.local_name().as_ref() {
                    "c" => {
                        if let Some(place) =
                            attribute(&tag, "r").and_then(|place| column_of(&place))
                        {
                            column = place;
                        }
                        shared = attribute(&tag, "t").as_deref() == Some("s");
                    }
                    "v" | "t" => within = true,
                    _ => {}
                },
                Event::End(tag) => match tag.local_name().as_ref() {
                    "c" => column += 1,
                    "v" | "t" => within = false,
                    _ => {}
                },
                Event::Empty(tag) if tag.local_name().as_ref() == "c" => column += 1,
                Event::Text(text) if within && column < COLUMN_LIMIT => {
                    let known = if shared { text.parse().ok() } else { None };
                    let known = known.and_then(|place: usize| self.texts.get(place));
                    if let Some((_, cells)) = rows.last_mut() {
                        if cells.len() <= column {
                            cells.resize(column + 1, String::new());
                        }
                        cells[column] = known.map_or_else(|| text.to_string(), Clone::clone);
                    }
                }
                _ => {}
            }
            Ok(())
        })?;
        Ok(Some(rows))
    }
}

/// Index of the column of a cell such as `AB12`.
fn column_of(place: &str) -> Option<usize> {
    let letters = place.bytes().take_while(u8::is_ascii_uppercase);
    let number = letters.fold(0_usize, |number, letter| {
        number
            .saturating_mul(26)
            .saturating_add(usize::from(letter - b'A') + 1)
    });
    number.checked_sub(1)
}

#[cfg(test)]
pub(crate) mod tests {
    use core::fmt::Write;

    use super::*;
    use crate::archive::tests::packed;

    /// A workbook of sheets with rows of cells; cells that are no numbers are shared texts.
    #[expect(clippy::cast_possible_truncation, reason = "small numbers")]
    pub(crate) fn written(sheets: &[(&str, Vec<Vec<String>>)]) -> Vec<u8> {
        let mut list = "<workbook xmlns:r=\"x\"><sheets>".to_owned();
        let mut relations = "<Relationships>".to_owned();
        let mut texts: Vec<String> = Vec::new();
        let mut members: Vec<(String, String)> = Vec::new();
        for (k, (name, rows)) in sheets.iter().enumerate() {
            let _ = write!(
                list,
                "<sheet name=\"{name}\" sheetId=\"{k}\" r:id=\"rId{k}\"/>"
            );
            let _ = write!(
                relations,
                "<Relationship Id=\"rId{k}\" Type=\"t\" Target=\"worksheets/sheet{k}.xml\"/>"
            );
            let mut sheet = "<worksheet><sheetData>".to_owned();
            for (number, row) in (1..).zip(rows) {
                let _ = write!(sheet, "<row r=\"{number}\">");
                for (column, cell) in row.iter().enumerate() {
                    let letter = char::from(b'A' + (column % 26) as u8);
                    let first = if column < 26 {
                        String::new()
                    } else {
                        char::from(b'A' + (column / 26 - 1) as u8).to_string()
                    };
                    let place = format!("{first}{letter}{number}");
                    if cell.is_empty() {
                        continue;
                    }
                    if cell.parse::<f64>().is_ok() {
                        let _ = write!(sheet, "<c r=\"{place}\"><v>{cell}</v></c>");
                    } else {
                        let _ =
                            write!(sheet, "<c r=\"{place}\" t=\"s\"><v>{}</v></c>", texts.len());
                        texts.push(cell.clone());
                    }
                }
                sheet.push_str("</row>");
            }
            sheet.push_str("</sheetData></worksheet>");
            members.push((format!("xl/worksheets/sheet{k}.xml"), sheet));
        }
        list.push_str("</sheets></workbook>");
        relations.push_str("</Relationships>");
        let shared: String = texts
            .iter()
            .map(|text| format!("<si><t>{text}</t></si>"))
            .collect();
        members.push(("xl/workbook.xml".into(), list));
        members.push(("xl/_rels/workbook.xml.rels".into(), relations));
        members.push((
            "xl/sharedStrings.xml".into(),
            format!("<sst>{shared}</sst>"),
        ));
        let members: Vec<(&str, &[u8])> = (members.iter())
            .map(|(name, text)| (name.as_str(), text.as_bytes()))
            .collect();
        packed(&members)
    }

    #[test]
    fn cells_stand_where_their_names_say() {
        let row = |cells: &[&str]| {
            cells
                .iter()
                .map(|&cell| cell.to_owned())
                .collect::<Vec<_>>()
        };
        let bytes = written(&[
            ("First", vec![row(&["a", "", "b"]), row(&["1.5", "2"])]),
            ("Second", vec![row(&["only"])]),
        ]);
        let archive = Archive::read(&bytes).unwrap();
        assert!(is_workbook(&archive));
        let book = Workbook::read(&archive).unwrap();
        assert_eq!(book.names(), "First, Second");
        let rows = book.sheet("First").unwrap().unwrap();
        assert_eq!(rows[0], (1, row(&["a", "", "b"])));
        assert_eq!(rows[1], (2, row(&["1.5", "2"])));
        assert_eq!(book.sheet("Second").unwrap().unwrap()[0].1, row(&["only"]));
        assert!(book.sheet("Third").unwrap().is_none());
        assert_eq!(
            (column_of("A1"), column_of("AB7"), column_of("7")),
            (Some(0), Some(27), None)
        );
    }
}
