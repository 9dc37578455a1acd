//! Memory that lost bits: a damaged block costs only itself, and is said to be damaged.

use super::*;

/// A chip with some flights of 4 s, each of which takes a sixth of it.
fn flown(flights: u16) -> Chip {
    let chip = Chip::new(usize::MAX, 1);
    for session in 1..=flights {
        record(&chip, session, 4);
    }
    chip
}

/// Checks that all blocks are read but at most four consecutive ones, and that those are said to be damaged. If the
/// memory was full, the oldest blocks may be missing without a word: they cannot be told from those being erased.
fn check(whole: &[Vec<u8>], found: &[Vec<u8>], was_full: bool) -> Result<(), TestCaseError> {
    let lost: Vec<_> = (0..whole.len())
        .filter(|number| !found.contains(&whole[*number]))
        .collect();
    let span = lost.last().map_or(0, |last| last - lost[0] + 1);
    prop_assert!(span <= 4, "{} blocks lost: {:?}", lost.len(), lost);
    let errors = found.iter().flat_map(|block| BlockReader::new(block));
    let damaged = errors.filter(Result::is_err).count();
    let least = match lost.first() {
        Some(0) if was_full => 0,
        _ => lost.len(),
    };
    // In a sector that was not full, what became of its empty slots is damage too.
    prop_assert!((least..=4).contains(&damaged), "{} of {:?}", damaged, lost);
    let kept = found.iter().filter(|block| whole.contains(block));
    let expected = whole.iter().filter(|block| found.contains(block));
    prop_assert!(expected.eq(kept), "in another order");
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(6))]

    /// Bytes of each sector in turn are changed, few or all of them.
    #[test]
    fn a_damaged_sector_costs_only_its_blocks(
        hits in prop::collection::vec((0..SECTOR, 1_u8..), 1..12),
        all in any::<bool>(),
        is_full in any::<bool>(),
    ) {
        let chip = flown(if is_full { 8 } else { 3 });
        let whole = blocks(&chip);
        prop_assert!(whole.len() > 70, "{}", whole.len());
        let kept = chip.0.borrow().bytes.clone();
        for sector in 0..SECTORS {
            if all {
                let (_, noise) = hits[0];
                for place in 0..SECTOR {
                    chip.0.borrow_mut().bytes[sector * SECTOR + place] ^= noise.wrapping_add(place as u8) | 1;
                }
            }
            for (place, change) in &hits {
                chip.0.borrow_mut().bytes[sector * SECTOR + place] ^= change;
            }
            check(&whole, &blocks(&chip), is_full)?;
            chip.0.borrow_mut().bytes.clone_from(&kept);
        }
    }

    /// After the damage the next flight is written, and all but the damaged blocks are still there.
    #[test]
    fn a_flight_is_written_after_damage(
        sector in 0..SECTORS,
        hits in prop::collection::vec((0..SECTOR, 1_u8..), 1..12),
    ) {
        let chip = flown(5);
        let whole = blocks(&chip);
        for (place, change) in &hits {
            chip.0.borrow_mut().bytes[sector * SECTOR + place] ^= change;
        }
        record(&chip, 9, 1);
        let found = blocks(&chip);
        let all = found.iter().flat_map(|block| BlockReader::new(block)).flatten();
        let samples = all.filter(|(header, message)| header.session == 9 && matches!(message, Message::Sample(_)));
        prop_assert_eq!(samples.count(), 240);
        // The oldest blocks gave way to the new ones.
        let newest = whole.get(40..).unwrap_or_default();
        let missing = newest.iter().filter(|block| !found.contains(block)).count();
        prop_assert!(missing <= 4, "{}", missing);
    }

    /// A stored configuration that lost bits is refused: neither it nor an older one is used.
    #[test]
    fn a_damaged_configuration_is_refused(
        hits in prop::collection::vec((0..SETUP_SECTORS * SECTOR, 1_u8..), 1..4),
    ) {
        let chip = Chip::new(usize::MAX, 1);
        for height in [1.6, 1.7, 1.8] {
            setup::store(&chip, height);
        }
        let start = Chip::SETUP.start as usize;
        for place in 0..SETUP_SECTORS * SECTOR {
            let change = hits.iter().find(|(hit, _)| *hit == place).map_or(0, |(_, change)| *change);
            chip.0.borrow_mut().bytes[start + place] ^= change;
        }
        let height = setup::height(&chip);
        prop_assert!(matches!(height, None | Some(1.8)), "{height:?}");
    }
}

#[test]
fn each_byte_of_the_stored_configuration_counts() {
    let chip = Chip::new(usize::MAX, 1);
    for height in [1.6, 1.7, 1.8] {
        setup::store(&chip, height);
    }
    let kept = chip.0.borrow().bytes.clone();
    let mut refused = 0;
    for place in Chip::SETUP {
        chip.0.borrow_mut().bytes[place as usize] ^= 0x10;
        match setup::height(&chip) {
            None => refused += 1,
            height => assert_eq!(height, Some(1.8), "byte {place}"),
        }
        chip.0.borrow_mut().bytes[place as usize] = kept[place as usize];
    }
    assert!(refused >= SETUP_LENGTH, "{refused}");
}

#[test]
fn blocks_that_cannot_be_read_are_told_and_the_others_are_read() {
    let chip = flown(3);
    let whole = blocks(&chip);
    for number in [0, 10, 11, 80] {
        let start = number as u32 * 1024;
        chip.0.borrow_mut().unreadable = start..start + 1024;
        let found = blocks(&chip);
        let mut expected = whole.clone();
        // No packet begins so.
        expected[number] = vec![0xff];
        assert_eq!(found, expected);
    }
}
