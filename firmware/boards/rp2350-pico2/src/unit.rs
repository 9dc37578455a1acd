//! The unit on a Raspberry Pi Pico 2: USB serial or UART0 to the host (GP0 out, GP1 in), UART1 from a sensor (GP5 in)
//! or SPI0 to one (GP16 to GP19) or ten PIO lines from those of a suit (GP6 to GP15), a log in the program's flash, a third of the supply voltage (GP29), a light (GP25), logs by
//! RTT.
#![no_std]
#![no_main]

mod chip;
mod flash;
mod imu;
mod ring;
mod sensor;
mod suit;

use core::cell::RefCell;

use bodyflight_cortex_m::{count_cycles, faults, stack};
use bodyflight_firmware::ports::{Counted, Either, LineErrors, Preferred};
use bodyflight_firmware::recorder::storage::{EraseAhead, FlightLog};
use bodyflight_firmware::recorder::{Block, Recorder, Until};
use bodyflight_firmware::sensor::icm42688::{self, Icm42688};
use bodyflight_firmware::sensor::rvc_suit;
use bodyflight_firmware::{Board, RECEIVER_BYTES, Unit, millivolts, start};
use bodyflight_usb_serial as usb_serial;
use cortex_m::peripheral::DWT;
// Linked for its logger.
use defmt_rtt as _;
use embassy_executor::Spawner;
use embassy_rp::adc::{self, Adc};
use embassy_rp::clocks::RoscRng;
use embassy_rp::gpio::{Level, Output, Pull};
use embassy_rp::peripherals::{PIO0, PIO1, PIO2, UART0, USB};
use embassy_rp::pio::{self, Pio};
use embassy_rp::uart::{self, BufferedInterruptHandler, BufferedUart};
use embassy_rp::watchdog::Watchdog;
use embassy_rp::{bind_interrupts, usb};
use embassy_time::{Delay, Instant};
use static_cell::{ConstStaticCell, StaticCell};

bind_interrupts!(struct Interrupts {
    UART0_IRQ => BufferedInterruptHandler<UART0>;
    PIO0_IRQ_0 => pio::InterruptHandler<PIO0>;
    PIO1_IRQ_0 => pio::InterruptHandler<PIO1>;
    PIO2_IRQ_0 => pio::InterruptHandler<PIO2>;
    USBCTRL_IRQ => usb::InterruptHandler<USB>;
});

/// Rate of the host's line, and of the sensor's until the kind of the sensor is known (baud).
const BAUD: u32 = 460_800;
/// Ratio of the divider at the supply (VSYS).
const DIVIDER: u16 = 3;

static HOST_ERRORS: LineErrors = LineErrors::new();
static SENSOR_ERRORS: LineErrors = LineErrors::new();

/// The board as the application sees it.
struct Pico2 {
    watchdog: RefCell<Watchdog>,
    light: RefCell<Output<'static>>,
    supply: RefCell<(Adc<'static, adc::Blocking>, adc::Channel<'static>)>,
    recorder: &'static Recorder,
}

impl Board for Pico2 {
    fn cycles(&self) -> u32 {
        DWT::cycle_count()
    }
    fn stack_free(&self) -> u32 {
        stack::free()
    }
    fn line_errors(&self) -> [u32; 2] {
        HOST_ERRORS.counted()
    }
    fn sensor_errors(&self) -> [u32; 2] {
        SENSOR_ERRORS.counted()
    }
    fn set_sensor_rate(&self, baud: u32) {
        sensor::set_rate(baud);
    }
    fn battery(&self) -> u16 {
        let (converter, pin) = &mut *self.supply.borrow_mut();
        let count = converter.blocking_read(pin);
        count.map_or(0, |count| millivolts(count, DIVIDER))
    }
    fn shine(&self, on: bool) {
        self.light.borrow_mut().set_level(on.into());
    }
    fn recorder(&self) -> Option<&Recorder> {
        Some(self.recorder)
    }
    fn feed_watchdog(&self) {
        self.watchdog.borrow_mut().feed(chip::TIMEOUT);
    }
    fn note(&self, sequence: u32) {
        faults::note(sequence);
    }
}

/// Not in the future of the main task, which would hold it twice.
static PORT: StaticCell<rvc_suit::Port<suit::FromSuit, sensor::FromSensor, Delay>> =
    StaticCell::new();
static UNIT: StaticCell<RefCell<Unit<Pico2>>> = StaticCell::new();
static RECORDER: StaticCell<Recorder> = StaticCell::new();
static LOG: StaticCell<FlightLog<'static, flash::ProgramFlash>> = StaticCell::new();
/// Blocks from the seconds before the exit is detected.
static BLOCKS: ConstStaticCell<[Block; 48]> = ConstStaticCell::new([Block::EMPTY; 48]);

type Usb = usb::Driver<'static, USB>;

#[embassy_executor::task]
async fn usb_device(mut device: embassy_usb::UsbDevice<'static, Usb>) {
    device.run().await;
}

#[embassy_executor::main]
async fn main(spawner: Spawner) {
    stack::guard();
    let (mut watchdog, cause) = chip::watchdog();
    let record = faults::begin(cause);
    chip::guard_supply();
    let chip = embassy_rp::init(embassy_rp::config::Config::default());
    watchdog.start(chip::TIMEOUT);
    count_cycles();
    static TO_HOST: StaticCell<[u8; 256]> = StaticCell::new();
    static FROM_HOST: StaticCell<[u8; RECEIVER_BYTES]> = StaticCell::new();
    let mut line = uart::Config::default();
    line.baudrate = BAUD;
    let to_host = TO_HOST.init([0; 256]);
    let from_host = FROM_HOST.init([0; RECEIVER_BYTES]);
    let host = BufferedUart::new(
        chip.UART0, chip.PIN_0, chip.PIN_1, Interrupts, to_host, from_host, line,
    );
    let sensor = sensor::FromSensor::new(chip.UART1, chip.PIN_5, chip.DMA_CH0, line);
    let (transmitter, receiver) = host.split();
    let is_overrun = |error: &uart::Error| matches!(error, uart::Error::Overrun);
    let receiver = Counted::new(receiver, &HOST_ERRORS, is_overrun);
    let pins = imu::Pins {
        clock: chip.PIN_18,
        to_chip: chip.PIN_19,
        from_chip: chip.PIN_16,
        select: chip.PIN_17.into(),
    };
    // A sensor on SPI is used rather than one on a line.
    let (bus, select) = imu::bus(chip.SPI0, pins);
    let sensor = match Icm42688::find(bus, select, Delay).await {
        Some(imu) => {
            let port = icm42688::Port::new(imu, || Instant::now().as_micros());
            Either::First(Counted::new(port, &SENSOR_ERRORS, |_| false))
        }
        None => {
            let first = Pio::new(chip.PIO0, Interrupts);
            let line = suit::receive_block!(
                0, first, sm0: chip.PIN_6, sm1: chip.PIN_7, sm2: chip.PIN_8, sm3: chip.PIN_9
            );
            let second = Pio::new(chip.PIO1, Interrupts);
            let line = suit::receive_block!(
                line, second, sm0: chip.PIN_10, sm1: chip.PIN_11, sm2: chip.PIN_12, sm3: chip.PIN_13
            );
            let third = Pio::new(chip.PIO2, Interrupts);
            suit::receive_block!(line, third, sm0: chip.PIN_14, sm1: chip.PIN_15);
            let clock = || Instant::now().as_micros();
            let port = PORT
                .init_with(|| rvc_suit::Port::new(suit::FromSuit::default(), sensor, Delay, clock));
            Either::Second(Counted::new(port, &SENSOR_ERRORS, is_overrun))
        }
    };
    let (device, from_usb, to_usb) = usb_serial::start(usb::Driver::new(chip.USB, Interrupts));
    let identity = record.identity(faults::build(), RoscRng.next_u32());
    let light = RefCell::new(Output::new(chip.PIN_25, Level::Low));
    let watchdog = RefCell::new(watchdog);
    let converter = Adc::new_blocking(chip.ADC, adc::Config::default());
    let supply = RefCell::new((converter, adc::Channel::new_pin(chip.PIN_29, Pull::None)));
    let recorder = RECORDER.init_with(|| Recorder::new(BLOCKS.take()).until(Until::Canopy));
    let flash = flash::ProgramFlash::new(chip.FLASH);
    let log = LOG.init_with(|| {
        let ahead = EraseAhead::PROGRAM_FLASH;
        FlightLog::new(recorder, flash, flash::LOG, flash::SETUP, ahead)
    });
    let board = Pico2 {
        watchdog,
        light,
        supply,
        recorder,
    };
    let unit = Unit::new_in(UNIT.uninit(), board, identity);
    usb_serial::spawn(spawner, usb_device(device));
    let receiver = Preferred(from_usb, receiver);
    let transmitter = Preferred(to_usb, transmitter);
    start(unit, receiver, transmitter, sensor, log).await;
}
