//! The driver on a strict simulated chip: each write must be enabled, wraps within its page and only clears bits; while
//! busy, the chip answers only status requests.
#![allow(clippy::cast_possible_truncation, reason = "small numbers of a test")]

use std::vec;
use std::vec::Vec;

use embassy_futures::block_on;

use super::*;
use crate::test_spi::{Chip, Pins};

const BYTES: usize = 1 << 16;

struct Simulated {
    cells: Vec<u8>,
    identity: [u8; 3],
    /// Bytes received since the chip was selected.
    heard: Vec<u8>,
    writable: bool,
    /// Remaining busy time (us).
    busy: u32,
    /// Duration of an erase (us).
    erasing: u32,
}

fn chip() -> Pins<Simulated> {
    Pins::new(Simulated {
        cells: vec![0x5a; BYTES],
        identity: [0xc8, 0x40, 16],
        heard: Vec::new(),
        writable: false,
        busy: 0,
        erasing: 300_000,
    })
}

type Found = SerialFlash<Pins<Simulated>, Pins<Simulated>, Pins<Simulated>>;

fn find(pins: &Pins<Simulated>) -> Option<Found> {
    block_on(SerialFlash::find(pins.clone(), pins.clone(), pins.clone()))
}

impl Simulated {
    fn address(&self) -> usize {
        let bytes = self.heard.iter().skip(1).take(3);
        bytes.fold(0, |address, byte| address << 8 | usize::from(*byte))
    }
}

impl Chip for Simulated {
    fn exchange(&mut self, byte: u8) -> u8 {
        self.heard.push(byte);
        let place = self.heard.len();
        let address = self.address();
        match (self.heard[0], place) {
            (STATUS, 2..) => u8::from(self.busy > 0),
            (IDENTIFY, 2..) if self.busy > 0 => 0xff,
            (command, 2..) if self.busy > 0 => panic!("{command:#x} to a busy chip"),
            (IDENTIFY, 2..=4) => self.identity[place - 2],
            (READ, 5..) => self.cells[address + place - 5],
            _ => 0xff,
        }
    }

    fn deselect(&mut self) {
        let heard = core::mem::take(&mut self.heard);
        let Some(command) = heard.first() else { return };
        self.heard.clone_from(&heard);
        let address = self.address();
        self.heard.clear();
        match *command {
            ENABLE_WRITING => self.writable = true,
            PROGRAM if core::mem::take(&mut self.writable) => {
                for (place, byte) in heard.iter().skip(4).enumerate() {
                    self.cells[(address & !0xff) + ((address + place) & 0xff)] &= byte;
                }
                self.busy = 700;
            }
            ERASE_SECTOR if core::mem::take(&mut self.writable) => {
                let sector = address & !(SECTOR as usize - 1);
                self.cells[sector..][..SECTOR as usize].fill(0xff);
                self.busy = self.erasing;
            }
            PROGRAM | ERASE_SECTOR => panic!("writing was not enabled"),
            _ => {}
        }
    }

    fn pass(&mut self, micros: u32) {
        self.busy = self.busy.saturating_sub(micros);
    }
}

#[test]
fn data_written_across_pages_is_read_back_and_erased_data_is_gone() {
    let mut flash = find(&chip()).unwrap();
    assert_eq!(flash.capacity(), BYTES);
    block_on(async {
        flash.erase(SECTOR, 3 * SECTOR).await.unwrap();
        let bytes: Vec<u8> = (0..1000_u32).map(|k| (k * 31 % 251) as u8).collect();
        flash.write(SECTOR + 200, &bytes).await.unwrap();
        let mut read = vec![0; 1000];
        flash.read(SECTOR + 200, &mut read).await.unwrap();
        assert_eq!(read, bytes);
        let mut around = [0; 4];
        flash.read(SECTOR + 196, &mut around).await.unwrap();
        assert_eq!(around, [0xff; 4]);
        flash.read(SECTOR - 4, &mut around).await.unwrap();
        assert_eq!(around, [0x5a; 4]);
        let end = BYTES as u32;
        assert_eq!(
            flash.read(end - 2, &mut around).await,
            Err(FlashError::OutOfBounds)
        );
        assert_eq!(
            flash.write(end, &[0; 4]).await,
            Err(FlashError::OutOfBounds)
        );
        assert_eq!(
            flash.erase(0, end + SECTOR).await,
            Err(FlashError::OutOfBounds)
        );
    });
}

#[test]
fn log_and_configuration_share_the_chip() {
    let flash = find(&chip()).unwrap();
    let [log, setup] = flash.parts();
    assert_eq!(log, 0..BYTES as u32 - 2 * SECTOR);
    assert_eq!(setup, BYTES as u32 - 2 * SECTOR..BYTES as u32);
}

#[test]
fn a_board_without_a_memory_chip_is_reported() {
    for identity in [[0; 3], [0xff; 3], [0xc8, 0x40, 25]] {
        let pins = chip();
        pins.chip.borrow_mut().identity = identity;
        assert!(find(&pins).is_none(), "{identity:?}");
    }
}

#[test]
fn a_chip_that_still_erases_after_a_reset_is_found() {
    let pins = chip();
    pins.chip.borrow_mut().busy = 300_000;
    assert!(find(&pins).is_some());
}

#[test]
fn a_chip_that_never_finishes_erasing_is_an_error() {
    let pins = chip();
    let mut flash = find(&pins).unwrap();
    pins.chip.borrow_mut().erasing = u32::MAX;
    assert_eq!(block_on(flash.erase(0, SECTOR)), Err(FlashError::Busy));
}
