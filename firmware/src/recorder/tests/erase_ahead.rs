//! A memory chip of 2 MiB that always takes the longest times in its data sheet, and is full of older data.

use core::future::poll_fn;
use core::task::Poll;
use std::rc::Rc;

use embedded_storage_async::nor_flash::{ErrorType, NorFlash, ReadNorFlash};

use super::super::storage::{EraseAhead, FlightLog};
use super::chip::NoPower;
use super::*;

/// Longest times of the chips used (us), such as GigaDevice's GD25Q16: erasing a sector of 4 KiB and writing a page.
const ERASING: u64 = 400_000;
const WRITING: u64 = 3_000;
const PAGE: usize = 256;

/// Samples in a second (Hz), as many as take the bytes of 240 Hz with estimates and a sensor's measurements.
const RATE: u32 = 700;

/// Bytes of the log and of the whole chip.
const LOG: u32 = (2 << 20) - 2 * 4096;
const CHIP: usize = 2 << 20;

struct Cells {
    bytes: Vec<u8>,
    now: u64,
    /// Number of sectors erased.
    erased: u32,
}

#[derive(Clone)]
struct Slow(Rc<RefCell<Cells>>);

impl Slow {
    fn new() -> Self {
        let bytes = vec![0x5a; CHIP];
        Self(Rc::new(RefCell::new(Cells {
            bytes,
            now: 0,
            erased: 0,
        })))
    }

    /// Waits while the chip is busy.
    async fn wait(&self, time: u64) {
        let end = self.0.borrow().now + time;
        poll_fn(|_| match self.0.borrow().now >= end {
            true => Poll::Ready(()),
            false => Poll::Pending,
        })
        .await;
    }
}

impl ErrorType for Slow {
    type Error = NoPower;
}

impl ReadNorFlash for Slow {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NoPower> {
        bytes.copy_from_slice(&self.0.borrow().bytes[offset as usize..][..bytes.len()]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        CHIP
    }
}

impl NorFlash for Slow {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = SECTOR;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), NoPower> {
        for sector in (from..to).step_by(SECTOR) {
            self.wait(ERASING).await;
            let cells = &mut *self.0.borrow_mut();
            cells.erased += 1;
            cells.bytes[sector as usize..][..SECTOR].fill(0xff);
        }
        Ok(())
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NoPower> {
        let first = offset as usize / PAGE;
        let pages = (offset as usize + bytes.len()).div_ceil(PAGE) - first;
        self.wait(WRITING * pages as u64).await;
        let cells = &mut self.0.borrow_mut().bytes[offset as usize..];
        for (cell, byte) in cells.iter_mut().zip(bytes) {
            *cell &= byte;
        }
        Ok(())
    }
}

/// What became of a fall.
struct Logged {
    /// Blocks dropped since the memory was too slow.
    lost: u32,
    /// Number of sectors erased on the ground and in the fall.
    erased: [u32; 2],
    /// Bytes of blocks that were logged in each second of the fall.
    rate: f32,
    /// Numbers of the samples read back.
    samples: Vec<u32>,
}

/// Logs `ground` and `fall` seconds with the buffer of the F405, at a rate that makes 14 kB/s.
fn log(ground: u32, fall: u32, ahead: EraseAhead) -> Logged {
    let chip = Slow::new();
    let recorder = Recorder::new(vec![Block::EMPTY; 48].leak()).until(Until::Canopy);
    let blocks = RefCell::new(BTreeMap::new());
    let answer = |answer: Answer<'_>| {
        if let Answer::Block(number, bytes) = answer {
            blocks.borrow_mut().insert(number, bytes.to_vec());
        }
    };
    let mut storage = FlightLog::new(&recorder, chip.clone(), 0..LOG, LOG..CHIP as u32, ahead);
    let mut task = core::pin::pin!(storage.run(answer));
    recorder.begin(preamble());
    let mut before = 0;
    for number in 0..(ground + fall) * RATE {
        let (mut header, message) = sample(number / 3);
        let Message::Sample(mut sample) = message else {
            unreachable!("a sample");
        };
        header.sequence = number;
        header.time = u64::from(number) * 1_000_000 / u64::from(RATE);
        let falling = (number as f32 / RATE as f32 - ground as f32).max(0.0);
        let mut motion = sample.motion();
        motion.velocity = Some(Vector::new(
            30.0,
            falling.sin(),
            (-9.8 * falling).max(-53.0),
        ));
        sample = Sample::new(&sample.posture(), &sample.inertial_from_body(), &motion);
        chip.0.borrow_mut().now = header.time;
        if number == ground * RATE {
            before = chip.0.borrow().erased;
        }
        recorder.note(&header, &sample.into());
        assert!(poll_once(task.as_mut()).is_pending());
    }
    let lost = recorder.lost();
    let erased = [before, chip.0.borrow().erased - before];
    recorder.end();
    for number in 0.. {
        recorder.ask(LogAction::Read, number);
        while !blocks.borrow().contains_key(&number) {
            chip.0.borrow_mut().now += ERASING;
            assert!(poll_once(task.as_mut()).is_pending());
        }
        if blocks.borrow()[&number].is_empty() {
            break;
        }
    }
    let blocks = blocks.borrow();
    let bytes: usize = blocks.values().map(Vec::len).sum();
    let messages = blocks.values().flat_map(|block| BlockReader::new(block));
    let messages = messages.map(|read| read.expect("a whole block"));
    let samples = messages.filter(|(_, message)| matches!(message, Message::Sample(_)));
    Logged {
        lost,
        erased,
        rate: bytes as f32 / fall as f32,
        samples: samples.map(|(header, _)| header.sequence).collect(),
    }
}

/// After three quarters of a minute on the ground, a fall is logged whole even by a chip at its worst.
#[test]
fn a_fall_is_logged_whole_by_the_slowest_chip() {
    let (ground, fall) = (45, 70);
    let Logged {
        lost,
        rate,
        samples,
        ..
    } = log(ground, fall, EraseAhead::OWN_CHIP);
    assert_eq!(lost, 0);
    assert!((13_000.0..15_500.0).contains(&rate), "{rate} bytes/s");
    assert!(samples.windows(2).all(|pair| pair[1] == pair[0] + 1));
    assert!(samples[0] < ground * RATE, "{}", samples[0]);
    assert_eq!(samples.last(), Some(&((ground + fall) * RATE - 1)));
}

/// Without the time to erase ahead, the same chip loses blocks of the same fall.
#[test]
fn a_fall_straight_after_switching_on_is_too_much_for_the_slowest_chip() {
    assert!(log(1, 75, EraseAhead::OWN_CHIP).lost > 0);
}

/// Where the program stops while a sector is erased, it does so on the ground only: 255 sectors are enough.
#[test]
fn nothing_is_erased_in_a_fall_where_the_program_would_stop() {
    let logged = log(105, 70, EraseAhead::PROGRAM_FLASH);
    assert_eq!(logged.lost, 0);
    assert_eq!(logged.erased, [255, 0]);
}
