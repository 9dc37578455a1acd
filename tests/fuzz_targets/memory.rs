//! What a unit finds in its memory after power on.

use core::cell::RefCell;
use core::convert::Infallible;
use core::ops::Range;
use core::pin::pin;
use core::task::{Context, Waker};
use std::rc::Rc;
use std::sync::OnceLock;

use bodyflight_core::link::{
    BlockReader, Configure, Header, LogAction, Message, Setup, SetupAction, SetupState,
};
use bodyflight_firmware::recorder::storage::{Answer, EraseAhead, FlightLog, Log};
use bodyflight_firmware::recorder::{Block, Recorder};
use embedded_storage_async::nor_flash::{ErrorType, NorFlash, ReadNorFlash};

use super::choices::Choices;
use super::line::Host;

const SECTOR: u32 = 4096;
/// Sectors of the log, and of the configuration behind them.
const LOG: Range<u32> = 0..8 * SECTOR;
const SETUP: Range<u32> = LOG.end..LOG.end + 2 * SECTOR;
const SIZE: usize = SETUP.end as usize;

/// Samples of the stored flight: they take about half of the log.
const STORED: u32 = 110;

/// Flash memory that outlives the unit.
#[derive(Clone)]
struct Chip(Rc<RefCell<Vec<u8>>>);

impl ErrorType for Chip {
    type Error = Infallible;
}

impl ReadNorFlash for Chip {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Infallible> {
        bytes.copy_from_slice(&self.0.borrow()[offset as usize..][..bytes.len()]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        SIZE
    }
}

impl NorFlash for Chip {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = SECTOR as usize;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), Infallible> {
        self.0.borrow_mut()[from as usize..to as usize].fill(0xff);
        Ok(())
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Infallible> {
        let cells = &mut self.0.borrow_mut()[offset as usize..][..bytes.len()];
        for (cell, byte) in cells.iter_mut().zip(bytes) {
            *cell &= byte;
        }
        Ok(())
    }
}

/// What the memory told: blocks of the log, the stored configuration, and the state of the latter.
#[derive(Debug, Default)]
struct Told {
    blocks: Vec<Vec<u8>>,
    setup: Option<Setup>,
    state: Option<SetupState>,
}

impl Chip {
    /// Runs the storage's task on this memory with a recorder, while `act` makes requests; `go` lets the task work.
    fn run(&self, recorder: &Recorder, act: impl FnOnce(&mut dyn FnMut())) -> Told {
        let told = RefCell::new(Told::default());
        let answer = |answer: Answer<'_>| match answer {
            Answer::Block(_, bytes) => told.borrow_mut().blocks.push(bytes.to_vec()),
            Answer::Setup(state, setup) => {
                let mut told = told.borrow_mut();
                told.state = Some(state);
                told.setup = setup.copied();
            }
        };
        let mut storage = FlightLog::new(recorder, self.clone(), LOG, SETUP, EraseAhead::OWN_CHIP);
        let mut task = pin!(storage.run(answer));
        let mut context = Context::from_waker(Waker::noop());
        act(&mut || {
            // It yields after each sector that it erases, and never ends.
            for _ in 0..2 * SIZE / SECTOR as usize {
                assert!(task.as_mut().poll(&mut context).is_pending());
            }
        });
        told.take()
    }

    /// Everything that a host reads.
    fn read(&self) -> Told {
        let recorder = Recorder::new(&mut []);
        let mut told = self.run(&recorder, |go| {
            recorder.ask_setup(SetupAction::Read, None);
            go();
            // More than there can be.
            for number in 0..=LOG.end / 1024 {
                recorder.ask(LogAction::Read, number);
                go();
            }
        });
        told.blocks.retain(|block| !block.is_empty());
        told
    }
}

/// Messages of the blocks that are whole.
fn messages(blocks: &[Vec<u8>]) -> impl Iterator<Item = (Header, Message)> {
    blocks
        .iter()
        .flat_map(|block| BlockReader::new(block))
        .flatten()
}

/// A memory with a flight and a configuration, and what was written into it.
struct Flown {
    memory: Vec<u8>,
    setup: Setup,
    messages: Vec<(Header, Message)>,
}

fn flown() -> &'static Flown {
    static FLOWN: OnceLock<Flown> = OnceLock::new();
    FLOWN.get_or_init(|| {
        let chip = Chip(Rc::new(RefCell::new(vec![0xff; SIZE])));
        let setup = Host::new().setup();
        record(&chip, STORED, setup.encode());
        let told = chip.read();
        assert_eq!(told.setup, Some(setup));
        let written: Vec<_> = messages(&told.blocks).collect();
        assert_eq!(written.len(), STORED as usize);
        Flown {
            memory: chip.0.take(),
            setup,
            messages: written,
        }
    })
}

/// Records a flight, and stores a configuration if there is one.
fn record(chip: &Chip, samples: u32, setup: Option<[u8; bodyflight_core::link::SETUP_LENGTH]>) {
    let recorder = Recorder::new(vec![Block::EMPTY; 64].leak());
    let host = Host::new();
    chip.run(&recorder, |go| {
        if setup.is_some() {
            recorder.ask_setup(SetupAction::Store, setup);
            go();
        }
        recorder.begin([]);
        for number in 0..samples {
            let (header, message) = host.numbered(number);
            recorder.note(&header, &message);
            go();
        }
        recorder.end();
        go();
    });
    assert_eq!(recorder.lost(), 0);
}

/// The memory of a unit with bytes changed as the input chooses: place and change of each. What is read back is what was
/// written, or is missing; the configuration is the stored one or none; and the unit flies and records on.
pub(super) fn flash(input: &[u8]) {
    let flown = flown();
    let chip = Chip(Rc::new(RefCell::new(flown.memory.clone())));
    let mut choices = Choices(input);
    let mut is_spared = true;
    while !choices.is_empty() {
        let place = (usize::from(choices.word()) | usize::from(choices.byte()) << 16) % SIZE;
        let (length, change) = (usize::from(choices.byte()), choices.byte());
        is_spared &= place + length < LOG.end as usize;
        for cell in chip.0.borrow_mut()[place..].iter_mut().take(length) {
            *cell ^= change;
        }
    }
    let told = chip.read();
    assert!(told.setup.is_none_or(|found| found == flown.setup));
    assert!(!is_spared || told.setup.is_some(), "nothing hit it");
    let mut expected = flown.messages.iter();
    for found in messages(&told.blocks) {
        assert!(
            expected.any(|written| *written == found),
            "a message that was not written, or in another order: {found:?}"
        );
    }
}

/// A configuration of arbitrary numbers with its checksum in order: it is refused, or the unit flies with it on its
/// sensor's bytes without a number that is not finite.
pub(super) fn setup(input: &[u8]) {
    let mut choices = Choices(input);
    let mut host = Host::new();
    let mut setup = host.setup();
    let edits = choices.byte() % 8;
    for _ in 0..edits {
        let (row, field) = (usize::from(choices.byte()), choices.byte());
        let value = f32::from_bits(u32::from(choices.word()) << 16 | u32::from(choices.word()));
        edit(&mut setup, row, field, value);
    }
    setup.configure.table_digest = setup.table.digest();
    let Some(record) = setup.encode() else { return };
    let Ok(read) = Setup::decode(&record) else {
        return;
    };
    if !host.resume(&read) {
        return;
    }
    while !choices.is_empty() {
        host.sense(&mut choices);
    }
    host.end();
}

/// Changes one number of a configuration.
fn edit(setup: &mut Setup, row: usize, field: u8, value: f32) {
    let Configure {
        sample_rate,
        update_rate,
        height,
        air_density,
        air_velocity,
        arch,
        receiver_latency,
        ..
    } = &mut setup.configure;
    let place = match field {
        0 => sample_rate,
        1 => update_rate,
        2 => height,
        3 => air_density,
        4..=6 => &mut air_velocity[usize::from(field) - 4],
        7 => arch,
        8 => receiver_latency,
        _ => {
            let rows: Vec<_> = setup.table.rows().copied().collect();
            let mut row = rows[row % rows.len()];
            let field = usize::from(field) - 9;
            match field % 20 {
                0 => row.mass = value,
                1 => row.length = value,
                field @ 2..=4 => row.joint_offset[field - 2] = value,
                field @ 5..=7 => row.cg[field - 5] = value,
                field @ 8..=13 => row.inertia[field - 8] = value,
                field @ 14..=16 => row.area[field - 14] = value,
                field => row.coefficients[field - 17] = value,
            }
            setup.table.insert(row);
            return;
        }
    };
    *place = value;
}
