//! Damaged, foreign and hostile MVNX in the reader and in inspection: refused with the location of the error, without a
//! panic and without a frame of bad numbers.

use std::io::{BufReader, Read};
use std::path::Path;

use bodyflight_mvnx::recording::Options;
use bodyflight_tests::small_recording::{
    NAME, is_usable, read, read_as, replaced, survey, with_numbers, written,
};
use bodyflight_verbs::inspect::{inspect, inspect_input};
use proptest::prelude::*;

#[test]
fn every_truncation_is_handled() {
    let text = written(2);
    let partial = Options {
        allow_truncated: true,
        ..Options::default()
    };
    let end = text.trim_end().len();
    for length in 0..end {
        let bytes = &text.as_bytes()[..length];
        let problem = read(bytes).expect_err("cut");
        assert_eq!(
            problem.file.as_deref(),
            Some(Path::new(NAME)),
            "{length}: {problem}"
        );
        assert!(problem.help.is_some(), "{length}: {problem}");
        if let Ok((frames, quality)) = read_as(bytes, NAME, partial) {
            assert!(quality.truncated, "{length}");
            assert!((1..=2).contains(&frames.len()), "{length}");
            assert!(frames.iter().all(is_usable), "{length}");
        }
        if let Ok(report) = survey(bytes) {
            assert!(report.truncated && report.frames <= 2, "{length}");
        }
    }
    assert_eq!(read(&text.as_bytes()[..end]).expect("whole").0.len(), 2);
    // The number of good frames is reported.
    let second = text.find("index=\"1\"").expect("the second") + 200;
    let problem = read(&text.as_bytes()[..second])
        .expect_err("cut")
        .to_string();
    assert!(problem.contains("after 1 good frames"), "{problem}");
}

#[test]
fn foreign_files_are_recognised_by_their_format() {
    let text = written(1);
    let utf_16: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
    let marked: Vec<u8> = [0xFF, 0xFE]
        .into_iter()
        .chain(utf_16.iter().copied())
        .collect();
    let latin = {
        let mut bytes = replaced(&text, "<comment>", "free", "fr@e").into_bytes();
        let at = bytes
            .iter()
            .position(|byte| *byte == b'@')
            .expect("the mark");
        bytes[at] = 0xE9;
        bytes
    };
    let cases: [(Vec<u8>, &str); 12] = [
        (vec![], "empty"),
        (b"  \r\n\t ".to_vec(), "empty"),
        (vec![0; 4096], "not an XML file"),
        (vec![0x1F, 0x8B, 8, 0, 0], "gzip"),
        (b"PK\x03\x04 and so on".to_vec(), "zip"),
        (utf_16, "UTF-16"),
        (marked, "UTF-16"),
        (
            b"version https://git-lfs.github.com/spec/v1\noid".to_vec(),
            "Git LFS",
        ),
        (b"<html><body/></html>".to_vec(), "a web page"),
        (latin, "UTF-8"),
        (
            text.replacen("UTF-8", "ISO-8859-1", 1).into_bytes(),
            "ISO-8859-1",
        ),
        (b"B\0B\0\0\0\0\0rest".to_vec(), "container"),
    ];
    for (bytes, part) in cases {
        let problem = read(&bytes).expect_err(part);
        assert!(problem.to_string().contains(part), "{part}: {problem}");
        assert!(problem.help.is_some(), "{part}");
        let again = survey(&bytes).expect_err(part);
        assert_eq!(again.with_causes(), problem.with_causes());
    }
    // A file that is not text is refused by its extension, but text that merely has the wrong extension is read.
    let problem = read_as(b"\x01\x02", "a.MVN", Options::default()).expect_err("container");
    assert!(problem.help.expect("a way out").contains(".mvnx"));
    assert!(read_as(text.as_bytes(), "a.mvn", Options::default()).is_ok());
    for path in [env!("CARGO_MANIFEST_DIR"), "no such file.mvnx"] {
        let problem = inspect(Path::new(path), None).expect_err(path);
        assert_eq!(problem.file.as_deref(), Some(Path::new(path)), "{problem}");
        assert!(problem.message.len() > 10, "says why: {problem}");
    }
}

#[test]
fn hostile_xml_is_refused() {
    let text = written(1);
    let inside = |what: &str| text.replacen("<comment>", &format!("<comment>{what}"), 1);
    let bomb = format!(
        "<!DOCTYPE mvnx [<!ENTITY a \"{}\"><!ENTITY b \"&a;&a;&a;\">]><mvnx version=\"4\">&b;</mvnx>",
        "x".repeat(1000)
    );
    let attributes: String = (0..1000).map(|n| format!(" a{n}=\"1\"")).collect();
    let cases = [
        (bomb, "DOCTYPE"),
        (inside("&bomb;"), "entity"),
        (
            replaced(&text, "index=\"0\"", "<orientation>", "<orientation>&x;"),
            "entity",
        ),
        (inside(&"<a>".repeat(100_000)), "deeper"),
        (inside(&"x".repeat(3 << 20)), "1 MiB"),
        (inside(&format!("<!--{}-->", "x".repeat(3 << 20))), "1 MiB"),
        (
            inside(&format!("<![CDATA[{}]]>", "x".repeat(3 << 20))),
            "1 MiB",
        ),
        (inside(&format!("<?{}?>", "x".repeat(3 << 20))), "1 MiB"),
        (inside(&format!("<{}/>", "x".repeat(3 << 20))), "1 MiB"),
        (
            text.replacen("<subject", &format!("<subject{attributes}"), 1),
            "attributes",
        ),
        (
            text.replacen("<subject", "<subject label=\"x\"", 1),
            "duplicate",
        ),
        (
            text.replacen("label=\"A", &format!("label=\"{}", "x".repeat(5000)), 1),
            "4096",
        ),
        (
            text.replacen("</position>", "</orientation>", 1),
            "well-formed",
        ),
        (text.replacen("</sensors>", "", 1), "well-formed"),
        (format!("{text}<mvnx version=\"4\"/>"), "second document"),
        (format!("{text}tail"), "follows"),
    ];
    for (broken, part) in cases {
        let problem = read(broken.as_bytes()).expect_err(part);
        assert!(problem.to_string().contains(part), "{part}: {problem}");
        assert!(problem.line.is_some(), "{part}: {problem}");
    }
}

/// The reader must stop on endless text.
#[test]
fn an_endless_text_stops_the_reader_at_its_limit() {
    let text = written(1);
    let head = &text[..text.find("<comment>").expect("a comment") + "<comment>".len()];
    let endless = head.as_bytes().chain(std::io::repeat(b'x'));
    let problem = inspect_input(BufReader::new(endless), Path::new(NAME)).expect_err("endless");
    assert!(problem.message.contains("1 MiB"), "{problem}");
}

#[test]
fn unusual_but_good_files_are_read() {
    let text = written(5);
    let (expected, _) = read(text.as_bytes()).expect("good");
    let again = |changed: &str| {
        let (frames, quality) = read(changed.as_bytes()).expect("good");
        assert_eq!(quality.good_frames, 5);
        assert_eq!(frames.len(), 5);
        for (found, expected) in frames.iter().zip(&expected) {
            assert_eq!(found.posture, expected.posture);
            assert_eq!(found.pelvis, expected.pelvis);
        }
    };
    again(&format!("\u{FEFF}{text}"));
    again(&text.replace('\n', "\r\n"));
    again(&text.replace(['\n', '\t'], "\r"));
    again(&text.replace("</orientation>", " \t\n</orientation>"));
    again(&text.replace(
        "<velocity>",
        "<novelty a=\"1\"><b>2</b></novelty><velocity>",
    ));
    again(&text.replace("<velocity>", "<x:frame/><velocity><!-- 1 2 3 -->"));
    again(&text.replace("pos_b>", "pos_s>"));
    again(&text.replace(" configuration=\"FullBody\"", ""));
    again(&text.replace("<comment></comment>", ""));
    again(&text.replace("frameRate=\"240\"", "frameRate=\"240.0\""));
    for index in 0..5 {
        let plain = text.replace(&format!("index=\"{index}\" "), "");
        again(&plain);
    }
    // If no joints are listed, they are found from points of the same name.
    let (from, to) = (
        text.find("<joints>").expect("joints"),
        text.find("</joints>").expect("end"),
    );
    again(&format!(
        "{}{}",
        &text[..from],
        &text[to + "</joints>".len()..]
    ));
    // In older files the centre of mass has only its 3 position components.
    let mut older = text.clone();
    for index in 0..5 {
        older = with_numbers(&older, index, "centerOfMass", |all| {
            all.split(' ').take(3).collect::<Vec<_>>().join(" ")
        });
    }
    again(&older);
    let label = survey(text.as_bytes()).expect("good").subject_label;
    assert_eq!(label.as_deref(), Some("A <B> & \"C\""));
}

#[test]
fn headers_that_contradict_themselves_are_refused() {
    let text = written(2);
    let cases = [
        (
            text.replace("segmentCount=\"23\"", "segmentCount=\"24\""),
            "segmentCount",
        ),
        (
            text.replace("segmentCount=\"23\"", "segmentCount=\"-1\""),
            "whole number",
        ),
        (
            text.replace("segmentCount=\"23\"", "segmentCount=\"1000000000\""),
            "segmentCount",
        ),
        (
            text.replace("jointCount=\"22\"", "jointCount=\"18446744073709551615\""),
            "at most",
        ),
        (text.replace("frameRate=\"240\" ", ""), "frameRate"),
        (
            text.replace("frameRate=\"240\"", "frameRate=\"240 Hz\""),
            "240 Hz",
        ),
        (
            text.replace("frameRate=\"240\"", "frameRate=\"NaN\""),
            "NaN",
        ),
        (
            text.replace("frameRate=\"240\"", "frameRate=\"1e6\""),
            "1e6",
        ),
        (text.replace("version=\"4\"", "version=\"2\""), "v3 or v4"),
        (text.replacen(" version=\"4\"", "", 1), "v3 or v4"),
        (text.replace("label=\"L5\"", "label=\"L3\""), "twice"),
        (text.replace("label=\"T8\"", "label=\"T9\""), "T8"),
        (text.replace("type=\"normal\"", "type=\"other\""), "normal"),
        (text.replace(" type=\"normal\"", ""), "type"),
        (
            replaced(&text, "<points>", "0.000000 ", ""),
            "expected 3 numbers, found 2",
        ),
        (replaced(&text, "<points>", "0.000000", "zero"), "zero"),
    ];
    for (broken, part) in cases {
        assert_ne!(broken, text, "{part}");
        let problem = read(broken.as_bytes()).expect_err(part);
        assert!(problem.to_string().contains(part), "{part}: {problem}");
        assert!(
            problem.line.is_some() || part == "T8" || part == "normal",
            "{problem}"
        );
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn random_bytes_never_give_a_bad_frame(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..12),
        allow_truncated in any::<bool>(),
    ) {
        let mut bytes = written(3).into_bytes();
        for (at, byte) in &changes {
            let at = at.index(bytes.len());
            bytes[at] = *byte;
        }
        let options = Options { allow_truncated, ..Options::default() };
        if let Ok((frames, _)) = read_as(&bytes, NAME, options) {
            prop_assert!(frames.iter().all(is_usable));
        }
        if let Ok(report) = survey(&bytes) {
            prop_assert!(!report.to_string().is_empty());
        }
    }

    #[test]
    fn moved_pieces_never_yield_a_bad_frame(
        from in any::<prop::sample::Index>(),
        length in 0usize..3000,
        to in any::<prop::sample::Index>(),
    ) {
        let mut bytes = written(3).into_bytes();
        let from = from.index(bytes.len());
        let piece: Vec<u8> = bytes.drain(from..bytes.len().min(from + length)).collect();
        let to = to.index(bytes.len());
        bytes.splice(to..to, piece);
        if let Ok((frames, _)) = read(&bytes) {
            prop_assert!(frames.iter().all(is_usable));
        }
        let _ = survey(&bytes);
    }
}
