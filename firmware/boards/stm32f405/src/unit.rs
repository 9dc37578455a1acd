//! The unit on an STM32F405: USART3 to the host (PB10 out, PB11 in, 460800 baud), USART6 from an inertial
//! sensor (PC7 in, 460800 baud), logs by RTT, a crystal of 12 MHz.
#![no_std]
#![no_main]

use core::cell::RefCell;
use core::sync::atomic::{AtomicU32, Ordering};

use bodyflight_cortex_m::faults;
use bodyflight_firmware::{Board, RECEIVER_BYTES, Unit, run};
use cortex_m::peripheral::DWT;
// Linked for its logger.
use defmt_rtt as _;
use embassy_executor::Spawner;
use embassy_stm32::mode::Async;
use embassy_stm32::peripherals::{DMA1_CH1, DMA1_CH3, DMA2_CH1, IWDG, USART3, USART6};
use embassy_stm32::time::Hertz;
use embassy_stm32::usart::{self, RingBufferedUartRx, Uart, UartRx, UartTx};
use embassy_stm32::wdg::IndependentWatchdog;
use embassy_stm32::{Config, bind_interrupts, dma, rcc};
use embedded_io_async::{ErrorType, Read};
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

/// The watchdog bites after this long without a heartbeat, four of them (us).
const WATCHDOG: u32 = 1_000_000;

/// Receiver overruns since the start.
static OVERRUNS: AtomicU32 = AtomicU32::new(0);
/// Other errors of the receiver.
static LINE_ERRORS: AtomicU32 = AtomicU32::new(0);

/// The board as the application sees it.
struct Stm32f405 {
    watchdog: RefCell<IndependentWatchdog<'static, IWDG>>,
}

impl Board for Stm32f405 {
    fn cycles(&self) -> u32 {
        DWT::cycle_count()
    }

    fn stack_free(&self) -> u32 {
        faults::stack_free()
    }

    fn line_errors(&self) -> [u32; 2] {
        [&OVERRUNS, &LINE_ERRORS].map(|counter| counter.load(Ordering::Relaxed))
    }

    fn feed_watchdog(&self) {
        self.watchdog.borrow_mut().pet();
    }

    fn note(&self, sequence: u32) {
        faults::note(sequence);
    }
}

/// A receiver that counts its errors; the application goes on behind them.
struct Receiver(RingBufferedUartRx<'static>);

impl ErrorType for Receiver {
    type Error = usart::Error;
}

impl Read for Receiver {
    async fn read(&mut self, bytes: &mut [u8]) -> Result<usize, usart::Error> {
        let result = self.0.read(bytes).await;
        if let Err(error) = &result {
            let counter = match error {
                usart::Error::Overrun => &OVERRUNS,
                _ => &LINE_ERRORS,
            };
            counter.fetch_add(1, Ordering::Relaxed);
        }
        result
    }
}

/// 168 MHz from a crystal of 12 MHz.
fn clocks() -> Config {
    let mut config = Config::default();
    config.rcc.hse = Some(rcc::Hse {
        freq: Hertz::mhz(12),
        mode: rcc::HseMode::Oscillator,
    });
    config.rcc.pll_src = rcc::PllSource::HSE;
    config.rcc.pll = Some(rcc::Pll {
        prediv: rcc::PllPreDiv::DIV6,
        mul: rcc::PllMul::MUL168,
        divp: Some(rcc::PllPDiv::DIV2),
        divq: Some(rcc::PllQDiv::DIV7),
        divr: None,
    });
    config.rcc.ahb_pre = rcc::AHBPrescaler::DIV1;
    config.rcc.apb1_pre = rcc::APBPrescaler::DIV4;
    config.rcc.apb2_pre = rcc::APBPrescaler::DIV2;
    config.rcc.sys = rcc::Sysclk::PLL1_P;
    config
}

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
    run(unit, receiver, transmitter, sensor).await;
}

#[embassy_executor::main]
async fn main(spawner: Spawner) {
    let record = faults::begin();
    let board = embassy_stm32::init(clocks());
    if let Some(mut core) = cortex_m::Peripherals::take() {
        core.DCB.enable_trace();
        core.DWT.enable_cycle_counter();
    }
    let mut line = usart::Config::default();
    line.baudrate = BAUD;
    line.eager_reads = Some(1);
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
    let mut watchdog = IndependentWatchdog::new(board.IWDG, WATCHDOG);
    watchdog.unleash();
    // The cycle counter has run for a time that differs from start to start.
    let identity = record.identity(faults::build(), DWT::cycle_count() << 8);
    let board = Stm32f405 {
        watchdog: RefCell::new(watchdog),
    };
    let unit = UNIT.init_with(|| RefCell::new(Unit::new(board, identity)));
    match application(unit, Receiver(receiver), transmitter, Receiver(sensor)) {
        Ok(task) => spawner.spawn(task),
        Err(_) => defmt::error!("the task is running already"),
    }
}
