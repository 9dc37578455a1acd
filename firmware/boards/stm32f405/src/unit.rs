//! The unit on an STM32F405: USART3 to the host (PB10 out, PB11 in, 460800 baud), USART6 from an inertial
//! sensor (PC7 in, 460800 baud), a light (PC1), logs by RTT, a crystal of 12 MHz. The chip itself is in `chip.rs`.
#![no_std]
#![no_main]

mod chip;

use core::cell::RefCell;

use bodyflight_cortex_m::{faults, stack};
use bodyflight_firmware::ports::{Counted, LineErrors};
use bodyflight_firmware::recorder::storage::NoLog;
use bodyflight_firmware::{Board, RECEIVER_BYTES, Unit, run};
use cortex_m::peripheral::DWT;
// Linked for its logger.
use defmt_rtt as _;
use embassy_executor::Spawner;
use embassy_stm32::gpio::{Level, Output, Speed};
use embassy_stm32::mode::Async;
use embassy_stm32::peripherals::{DMA1_CH1, DMA1_CH3, DMA2_CH1, IWDG, USART3, USART6};
use embassy_stm32::usart::{self, RingBufferedUartRx, Uart, UartRx, UartTx};
use embassy_stm32::wdg::IndependentWatchdog;
use embassy_stm32::{bind_interrupts, dma};
use static_cell::StaticCell;

bind_interrupts!(struct Interrupts {
    USART3 => usart::InterruptHandler<USART3>;
    USART6 => usart::InterruptHandler<USART6>;
    DMA1_STREAM1 => dma::InterruptHandler<DMA1_CH1>;
    DMA1_STREAM3 => dma::InterruptHandler<DMA1_CH3>;
    DMA2_STREAM1 => dma::InterruptHandler<DMA2_CH1>;
});

/// Rate of both lines (baud).
const BAUD: u32 = 460_800;

static HOST_ERRORS: LineErrors = LineErrors::new();
static SENSOR_ERRORS: LineErrors = LineErrors::new();

/// The board as the application sees it.
struct Stm32f405 {
    watchdog: RefCell<IndependentWatchdog<'static, IWDG>>,
    light: RefCell<Output<'static>>,
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

    fn shine(&self, on: bool) {
        self.light.borrow_mut().set_level(on.into());
    }

    fn feed_watchdog(&self) {
        self.watchdog.borrow_mut().pet();
    }

    fn note(&self, sequence: u32) {
        faults::note(sequence);
    }
}

type Receiver = Counted<RingBufferedUartRx<'static>>;

static UNIT: StaticCell<RefCell<Unit<Stm32f405>>> = StaticCell::new();
static FROM_HOST: StaticCell<[u8; RECEIVER_BYTES]> = StaticCell::new();
static FROM_SENSOR: StaticCell<[u8; RECEIVER_BYTES]> = StaticCell::new();

#[embassy_executor::task]
async fn application(
    unit: &'static RefCell<Unit<Stm32f405>>,
    receiver: Receiver,
    transmitter: UartTx<'static, Async>,
    sensor: Receiver,
) {
    run(unit, receiver, transmitter, sensor, NoLog).await;
}

#[embassy_executor::main]
async fn main(spawner: Spawner) {
    let watchdog = chip::watchdog();
    let record = faults::begin(chip::reset());
    let board = embassy_stm32::init(chip::clocks());
    chip::accelerate_flash();
    if let Some(mut core) = cortex_m::Peripherals::take() {
        core.DCB.enable_trace();
        core.DWT.enable_cycle_counter();
    }
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
    let chance = chip::random().unwrap_or_else(DWT::cycle_count);
    let identity = record.identity(faults::build(), chance);
    let board = Stm32f405 {
        watchdog: RefCell::new(watchdog),
        light: RefCell::new(light),
    };
    let unit = UNIT.init_with(|| RefCell::new(Unit::new(board, identity)));
    let is_overrun = |error: &usart::Error| matches!(error, usart::Error::Overrun);
    let receiver = Counted::new(receiver, &HOST_ERRORS, is_overrun);
    let sensor = Counted::new(sensor, &SENSOR_ERRORS, is_overrun);
    match application(unit, receiver, transmitter, sensor) {
        Ok(task) => spawner.spawn(task),
        Err(_) => defmt::error!("the task is running already"),
    }
}
