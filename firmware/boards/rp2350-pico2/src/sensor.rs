//! The line of a sensor, UART1 (GP5 in): received by DMA into a ring, which goes on while the processor stops for its flash.

use core::sync::atomic::{AtomicU8, Ordering};

use embassy_rp::Peri;
use embassy_rp::clocks::clk_peri_freq;
use embassy_rp::pac::{DMA, UART1, dma};
use embassy_rp::peripherals::{self, DMA_CH0, PIN_5};
use embassy_rp::uart::{self, Blocking, UartRx};
use embassy_time::{Duration, Timer};
use embedded_io_async::{ErrorType, Read};

/// The channel in use.
const CHANNEL: usize = 0;

/// Length of the ring as a base-two logarithm: 4 KiB, what arrives in 89 ms at 460800 baud.
const SIZE: u8 = 12;
const LENGTH: usize = 1 << SIZE;

/// The ring. The DMA wraps addresses, so it begins at a multiple of its length.
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
        let ring = RING.0.as_ptr().expose_provenance();
        let registers = DMA.ch(CHANNEL);
        registers
            .read_addr()
            .write_value(UART1.uartdr().as_ptr() as u32);
        registers.write_addr().write_value(ring as u32);
        registers.trans_count().write(|count| {
            count.set_mode(dma::vals::TransCountMode::ENDLESS);
            count.set_count(1);
        });
        UART1.uartdmacr().write(|control| control.set_rxdmae(true));
        registers.ctrl_trig().write(|control| {
            control.set_data_size(dma::vals::DataSize::SIZE_BYTE);
            control.set_incr_write(true);
            // The write address wraps.
            control.set_ring_sel(true);
            control.set_ring_size(SIZE);
            control.set_treq_sel(dma::vals::TreqSel::UART1_RX);
            // To itself: no channel follows.
            control.set_chain_to(CHANNEL as u8);
            control.set_irq_quiet(true);
            control.set_en(true);
        });
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
            let end = DMA.ch(CHANNEL).write_addr().read() as usize % LENGTH;
            let mut count = 0;
            for byte in bytes.iter_mut() {
                let Some(cell) = RING.0.get(self.next).filter(|_| self.next != end) else {
                    break;
                };
                *byte = cell.load(Ordering::Relaxed);
                self.next = (self.next + 1) % LENGTH;
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
