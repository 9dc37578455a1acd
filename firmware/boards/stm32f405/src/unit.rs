//! The unit on an STM32F405: USB serial (PA11, PA12) or USART3 to the host (PB10 out, PB11 in, 460800 baud), USART6
//! from an inertial sensor (PC7 in) or SPI2 to one (PB13, PB14, PB15, PB9), a log in a memory chip (PB3, PB4, PB5, PA15),
//! half the voltage of the battery (PA3), a light (PC1), logs by RTT, a crystal of 12 MHz. The chip itself is in `chip.rs`.
#![no_std]
#![no_main]

mod chip;

use core::cell::RefCell;

use bodyflight_cortex_m::{count_cycles, faults, stack};
use bodyflight_firmware::ports::{Counted, Either, LineErrors, Preferred};
use bodyflight_firmware::recorder::storage::{EraseAhead, FlightLog};
use bodyflight_firmware::recorder::{Block, Recorder, Until};
use bodyflight_firmware::{Board, RECEIVER_BYTES, Unit, start};
use bodyflight_usb_serial as usb_serial;
use cortex_m::peripheral::DWT;
// Linked for its logger.
use defmt_rtt as _;
use embassy_executor::Spawner;
use embassy_stm32::gpio::{Level, Output, Speed};
use embassy_stm32::mode::Async;
use embassy_stm32::peripherals::{DMA1_CH1, DMA1_CH3, DMA2_CH1, IWDG, USART3, USART6, USB_OTG_FS};
use embassy_stm32::usart::{self, RingBufferedUartRx, Uart, UartRx, UartTx};
use embassy_stm32::wdg::IndependentWatchdog;
use embassy_stm32::{bind_interrupts, dma, usb};
use static_cell::{ConstStaticCell, StaticCell};

bind_interrupts!(struct Interrupts {
    USART3 => usart::InterruptHandler<USART3>;
    USART6 => usart::InterruptHandler<USART6>;
    DMA1_STREAM1 => dma::InterruptHandler<DMA1_CH1>;
    DMA1_STREAM3 => dma::InterruptHandler<DMA1_CH3>;
    DMA2_STREAM1 => dma::InterruptHandler<DMA2_CH1>;
    OTG_FS => usb::InterruptHandler<USB_OTG_FS>;
});

/// Rate of the host's line, and of the sensor's until the kind of the sensor is known (baud).
const BAUD: u32 = 460_800;

/// Buffer for USB reception: a packet for each of its two endpoints, and one for line control.
const FROM_USB_BYTES: usize = 256;

static HOST_ERRORS: LineErrors = LineErrors::new();
static SENSOR_ERRORS: LineErrors = LineErrors::new();

/// The board as the application sees it.
struct Stm32f405 {
    watchdog: RefCell<IndependentWatchdog<'static, IWDG>>,
    light: RefCell<Output<'static>>,
    battery: RefCell<chip::Battery>,
    recorder: Option<&'static Recorder>,
}

impl Board for Stm32f405 {
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
        chip::set_sensor_rate(baud);
    }

    fn battery(&self) -> u16 {
        self.battery.borrow_mut().millivolts()
    }

    fn shine(&self, on: bool) {
        self.light.borrow_mut().set_level(on.into());
    }

    fn recorder(&self) -> Option<&Recorder> {
        self.recorder
    }

    fn feed_watchdog(&self) {
        self.watchdog.borrow_mut().pet();
    }

    fn note(&self, sequence: u32) {
        faults::note(sequence);
    }
}

type Usb = usb::Driver<'static, USB_OTG_FS>;
type FromHost = Preferred<usb_serial::Receiver<Usb>, Counted<RingBufferedUartRx<'static>>>;
type ToHost = Preferred<usb_serial::Transmitter<Usb>, UartTx<'static, Async>>;
type FromSensor = Either<Counted<chip::Imu>, Counted<RingBufferedUartRx<'static>>>;
type OnBoardLog = FlightLog<'static, chip::Flash>;

static UNIT: StaticCell<RefCell<Unit<Stm32f405>>> = StaticCell::new();
static RECORDER: StaticCell<Recorder> = StaticCell::new();
static LOG: StaticCell<OnBoardLog> = StaticCell::new();
/// Blocks from the seconds before the exit is detected.
static BLOCKS: ConstStaticCell<[Block; 48]> = ConstStaticCell::new([Block::EMPTY; 48]);
static FROM_HOST: StaticCell<[u8; RECEIVER_BYTES]> = StaticCell::new();
static FROM_USB: StaticCell<[u8; FROM_USB_BYTES]> = StaticCell::new();
static FROM_SENSOR: StaticCell<[u8; RECEIVER_BYTES]> = StaticCell::new();

#[embassy_executor::task]
async fn usb_device(mut device: embassy_usb::UsbDevice<'static, Usb>) {
    device.run().await;
}

/// A task of its own, because the stack frame of `main` holds what each step of the set-up moves.
#[embassy_executor::task]
async fn application(
    unit: &'static RefCell<Unit<Stm32f405>>,
    receiver: FromHost,
    transmitter: ToHost,
    sensor: FromSensor,
    log: Option<&'static mut OnBoardLog>,
) {
    start(unit, receiver, transmitter, sensor, log).await;
}

fn is_overrun(error: &usart::Error) -> bool {
    matches!(error, usart::Error::Overrun)
}

/// The sensor: one on SPI, if there is one, rather than one on the line.
fn from_sensor(line: RingBufferedUartRx<'static>, imu: Option<chip::Imu>) -> FromSensor {
    match imu {
        Some(imu) => Either::First(Counted::new(imu, &SENSOR_ERRORS, |_| false)),
        None => Either::Second(Counted::new(line, &SENSOR_ERRORS, is_overrun)),
    }
}

/// The recorder, and the log in the memory chip.
fn on_board_log(flash: chip::Flash) -> (&'static Recorder, &'static mut OnBoardLog) {
    let recorder = RECORDER.init_with(|| Recorder::new(BLOCKS.take()).until(Until::Canopy));
    let [part, setup] = flash.parts();
    let ahead = EraseAhead::OWN_CHIP;
    let log = LOG.init_with(|| FlightLog::new(recorder, flash, part, setup, ahead));
    (recorder, log)
}

#[embassy_executor::main]
async fn main(spawner: Spawner) {
    let watchdog = chip::watchdog();
    let record = faults::begin(chip::reset());
    chip::guard_supply();
    let board = embassy_stm32::init(chip::clocks());
    chip::accelerate_flash();
    count_cycles();
    let light = Output::new(board.PC1, Level::Low, Speed::Low);
    let mut line = usart::Config::default();
    line.baudrate = BAUD;
    let host = Uart::new(
        board.USART3,
        board.PB11,
        board.PB10,
        board.DMA1_CH3,
        board.DMA1_CH1,
        Interrupts,
        line,
    );
    let sensor = UartRx::new(board.USART6, board.PC7, board.DMA2_CH1, Interrupts, line);
    let (Ok(host), Ok(sensor)) = (host, sensor) else {
        defmt::error!("the lines cannot be set to {} baud", BAUD);
        return;
    };
    let (transmitter, receiver) = host.split();
    let receiver = receiver.into_ring_buffered(FROM_HOST.init([0; RECEIVER_BYTES]));
    let sensor = sensor.into_ring_buffered(FROM_SENSOR.init([0; RECEIVER_BYTES]));
    chip::order_interrupts();
    let driver = usb::Driver::new_fs(
        board.USB_OTG_FS,
        Interrupts,
        board.PA12,
        board.PA11,
        FROM_USB.init([0; FROM_USB_BYTES]),
        usb::Config::default(),
    );
    let (device, from_usb, to_usb) = usb_serial::start(driver);
    let battery = chip::Battery::new(board.ADC1, board.PA3);
    let pins = chip::FlashPins {
        clock: board.PB3,
        to_chip: board.PB5,
        from_chip: board.PB4,
        select: board.PA15,
    };
    let flash = chip::flash(board.SPI3, pins).await;
    let (recorder, log) = flash.map(on_board_log).unzip();
    let pins = chip::ImuPins {
        clock: board.PB13,
        to_chip: board.PB15,
        from_chip: board.PB14,
        select: board.PB9,
    };
    let sensor = from_sensor(sensor, chip::imu(board.SPI2, pins).await);
    let chance = chip::random().unwrap_or_else(DWT::cycle_count);
    let identity = record.identity(faults::build(), chance);
    let board = Stm32f405 {
        watchdog: RefCell::new(watchdog),
        light: RefCell::new(light),
        battery: RefCell::new(battery),
        recorder,
    };
    let unit = Unit::new_in(UNIT.uninit(), board, identity);
    let receiver = Counted::new(receiver, &HOST_ERRORS, is_overrun);
    usb_serial::spawn(spawner, usb_device(device));
    let receiver = Preferred(from_usb, receiver);
    let transmitter = Preferred(to_usb, transmitter);
    match application(unit, receiver, transmitter, sensor, log) {
        Ok(task) => spawner.spawn(task),
        Err(_) => defmt::error!("the application is running already"),
    }
}
