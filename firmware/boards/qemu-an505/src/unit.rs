//! The unit on this board: UART0 to the host, UART1 or a file of the desktop from the sensor, log and configuration in
//! another file, messages by semihosting.
//!
//! `bodyflight unit --qemu IMAGE --flash FILE --sensor BYTES` starts it in QEMU.
#![no_std]
#![no_main]

#[path = "unit/clock.rs"]
mod clock;
#[path = "unit/file.rs"]
mod file;
#[path = "unit/line.rs"]
mod line;
#[path = "../../qemu-lm3s6965/src/unit/poll.rs"]
mod poll;
#[path = "../../qemu-lm3s6965/src/unit/time.rs"]
mod time;
#[path = "unit/uart.rs"]
mod uart;

use core::cell::RefCell;

use bodyflight_cortex_m::{faults, stack};
use bodyflight_firmware::fault::Reset;
use bodyflight_firmware::ports::Either;
use bodyflight_firmware::recorder::storage::{EraseAhead, FlightLog};
use bodyflight_firmware::recorder::{Block, Recorder};
use bodyflight_firmware::{Board, Unit, start};
use cortex_m::peripheral::{Peripherals, SYST};
use cortex_m_rt::entry;
// Linked for its logger.
use defmt_semihosting as _;
use static_cell::{ConstStaticCell, StaticCell};

use file::FileFlash;
use line::FileLine;
use uart::{Receiver, Transmitter, UART0, UART1};

// Not by a feature of embassy-time, which would ask the images without a clock for one.
defmt::timestamp!("{=u64:us}", embassy_time::Instant::now().as_micros());

/// The board as the application sees it.
struct An505 {
    recorder: Option<&'static Recorder>,
}

impl Board for An505 {
    /// Ticks of the processor's clock, as QEMU has no cycle counter.
    fn cycles(&self) -> u32 {
        time::ticks()
    }

    fn stack_free(&self) -> u32 {
        stack::free()
    }

    /// QEMU holds what does not fit, so that nothing is lost.
    fn line_errors(&self) -> [u32; 2] {
        [0; 2]
    }

    fn recorder(&self) -> Option<&Recorder> {
        self.recorder
    }

    /// The machine has no watchdog that survives QEMU's pauses.
    fn feed_watchdog(&self) {}

    fn note(&self, sequence: u32) {
        faults::note(sequence);
    }
}

type OnBoardLog = FlightLog<'static, FileFlash>;

static UNIT: StaticCell<RefCell<Unit<An505>>> = StaticCell::new();
static RECORDER: StaticCell<Recorder> = StaticCell::new();
static LOG: StaticCell<OnBoardLog> = StaticCell::new();
/// Blocks from the seconds before the exit is detected.
static BLOCKS: ConstStaticCell<[Block; 48]> = ConstStaticCell::new([Block::EMPTY; 48]);

#[embassy_executor::task]
async fn application(unit: &'static RefCell<Unit<An505>>, log: Option<&'static mut OnBoardLog>) {
    let (receiver, transmitter) = (Receiver(&UART0), Transmitter(&UART0));
    let sensor = match FileLine::find() {
        Some(line) => Either::First(line),
        None => Either::Second(Receiver(&UART1)),
    };
    start(unit, receiver, transmitter, sensor, log).await;
}

/// The recorder, and the log in the file.
fn on_board_log(flash: FileFlash) -> (&'static Recorder, &'static mut OnBoardLog) {
    let recorder = RECORDER.init_with(|| Recorder::new(BLOCKS.take()));
    let [part, setup] = flash.parts();
    let ahead = EraseAhead::OWN_CHIP;
    let log = LOG.init_with(|| FlightLog::new(recorder, flash, part, setup, ahead));
    (recorder, log)
}

#[entry]
fn main() -> ! {
    stack::guard();
    // The machine starts by power-on, after a fault, or when QEMU is told to reset it.
    let record = faults::begin(Reset::Software);
    if let Some(mut peripherals) = Peripherals::take() {
        time::start(&mut peripherals.SYST);
        uart::start();
    }
    // The counter has a different value at each start of the machine.
    let identity = record.identity(faults::build(), SYST::get_current() << 8);
    let (recorder, log) = FileFlash::find().map(on_board_log).unzip();
    let unit = Unit::new_in(UNIT.uninit(), An505 { recorder }, identity);
    poll::forever(|spawner| match application(unit, log) {
        Ok(task) => spawner.spawn(task),
        Err(_) => defmt::error!("the task is running already"),
    })
}
