//! The line of a sensor, UART1 (GP5 in): received by DMA into a ring.

use core::sync::atomic::AtomicU8;

use embassy_rp::Peri;
use embassy_rp::clocks::clk_peri_freq;
use embassy_rp::pac::UART1;
use embassy_rp::pac::dma::vals::TreqSel;
use embassy_rp::peripherals::{self, DMA_CH0, PIN_5};
use embassy_rp::uart::{self, Blocking, UartRx};
use embassy_time::{Duration, Timer};
use embedded_io_async::{ErrorType, Read};

use crate::ring;

/// The channel in use.
const CHANNEL: usize = 0;

/// Length of the ring: what arrives in 89 ms at 460800 baud.
const LENGTH: usize = 4096;

/// The ring, which begins at a multiple of its length.
#[repr(align(4096))]
struct Ring([AtomicU8; LENGTH]);

static RING: Ring = Ring([const { AtomicU8::new(0) }; LENGTH]);

/// How often the ring is looked at.
const LOOK: Duration = Duration::from_millis(1);

/// The receiver.
pub(crate) struct FromSensor {
    _line: UartRx<'static, Blocking>,
    _channel: Peri<'static, DMA_CH0>,
    /// Place of the next byte in the ring.
    next: usize,
}

impl FromSensor {
    pub(crate) fn new(
        line: Peri<'static, peripherals::UART1>,
        pin: Peri<'static, PIN_5>,
        channel: Peri<'static, DMA_CH0>,
        config: uart::Config,
    ) -> Self {
        let line = UartRx::new_blocking(line, pin, config);
        UART1.uartdmacr().write(|control| control.set_rxdmae(true));
        let from = UART1.uartdr().as_ptr().cast_const().cast();
        ring::fill(CHANNEL, from, &RING.0, TreqSel::UART1_RX);
        Self {
            _line: line,
            _channel: channel,
            next: 0,
        }
    }

    /// The error on the line since the last call, if any.
    fn error(&self) -> Option<uart::Error> {
        let state = UART1.uartris().read();
        let error = if state.oeris() {
            uart::Error::Overrun
        } else if state.feris() {
            uart::Error::Framing
        } else if state.beris() {
            uart::Error::Break
        } else {
            return None;
        };
        UART1.uarticr().write(|clear| {
            clear.set_oeic(true);
            clear.set_feic(true);
            clear.set_beic(true);
        });
        Some(error)
    }
}

impl ErrorType for FromSensor {
    type Error = uart::Error;
}

impl Read for FromSensor {
    async fn read(&mut self, bytes: &mut [u8]) -> Result<usize, uart::Error> {
        loop {
            if let Some(error) = self.error() {
                return Err(error);
            }
            let mut count = 0;
            for place in bytes.iter_mut() {
                let Some(byte) = ring::next(CHANNEL, &RING.0, &mut self.next) else {
                    break;
                };
                *place = byte;
                count += 1;
            }
            if count > 0 {
                return Ok(count);
            }
            Timer::after(LOOK).await;
        }
    }
}

/// Sets the rate of the line (baud): the divider in 64ths.
pub(crate) fn set_rate(baud: u32) {
    let divider = (8 * clk_peri_freq() / baud.max(1)).div_ceil(2);
    let (whole, part) = (divider / 64, divider % 64);
    UART1
        .uartibrd()
        .write_value(embassy_rp::pac::uart::regs::Uartibrd(whole));
    UART1
        .uartfbrd()
        .write_value(embassy_rp::pac::uart::regs::Uartfbrd(part));
    // The divider is taken over with a write of this register.
    UART1.uartlcr_h().modify(|_| {});
}
