//! Interrupt-driven driver for the board's CMSDK UARTs, which hold one byte in each direction.

use core::convert::Infallible;
use core::future::poll_fn;
use core::task::Poll;

use bodyflight_firmware::RECEIVER_BYTES;
use cortex_m::peripheral::NVIC;
use cortex_m_rt::exception;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::pipe::Pipe;
use embassy_sync::waitqueue::AtomicWaker;
use embedded_io_async::{ErrorType, Read, Write};

/// Registers, as offsets from the base.
const DATA: usize = 0x00;
const STATE: usize = 0x04;
const CONTROL: usize = 0x08;
const INTERRUPT_CLEAR: usize = 0x0C;
const DIVIDER: usize = 0x10;

const TRANSMIT_FULL: u32 = 1;
const RECEIVE_FULL: u32 = 1 << 1;
/// Control bits that enable transmitter and receiver, and the interrupts of both.
const ENABLED: u32 = 0b1111;
/// Interrupts of transmitter and receiver.
const BOTH: u32 = 0b11;
/// 20 MHz over 460 800 baud. QEMU checks only that it is at least 16.
const DIVISION: u32 = 43;

/// The first interrupts of the UARTs, two each; the lines of their overruns are not used.
const INTERRUPTS: core::ops::Range<u16> = 32..36;

/// A UART with its receive buffer.
pub(super) struct Port {
    base: usize,
    received: Pipe<CriticalSectionRawMutex, RECEIVER_BYTES>,
    room: AtomicWaker,
}

/// The line to the host.
pub(super) static UART0: Port = Port::new(0x5020_0000);
/// The line from the inertial sensor.
pub(super) static UART1: Port = Port::new(0x5020_1000);

impl Port {
    const fn new(base: usize) -> Self {
        Self {
            base,
            received: Pipe::new(),
            room: AtomicWaker::new(),
        }
    }

    #[allow(unsafe_code, reason = "memory-mapped registers")]
    fn read(&self, register: usize) -> u32 {
        // SAFETY: a register of this UART.
        unsafe { core::ptr::read_volatile((self.base + register) as *const u32) }
    }

    #[allow(unsafe_code, reason = "memory-mapped registers")]
    fn write(&self, register: usize, value: u32) {
        // SAFETY: a register of this UART.
        unsafe { core::ptr::write_volatile((self.base + register) as *mut u32, value) }
    }

    /// Takes the byte that has arrived if there is room for it. Until then QEMU holds the ones that follow.
    fn take(&self) {
        // Bytes that follow arrive only after this one is read, and raise a new interrupt.
        while self.received.free_capacity() > 0 && self.read(STATE) & RECEIVE_FULL != 0 {
            let [byte, ..] = self.read(DATA).to_le_bytes();
            let _ = self.received.try_write(&[byte]);
        }
    }

    fn on_interrupt(&self) {
        self.write(INTERRUPT_CLEAR, BOTH);
        self.take();
        self.room.wake();
    }
}

/// Starts both.
pub(super) fn start() {
    for port in [&UART0, &UART1] {
        port.write(DIVIDER, DIVISION);
        port.write(CONTROL, ENABLED);
    }
    for number in INTERRUPTS {
        // SAFETY: there are no critical sections by priority that this could break.
        #[allow(unsafe_code, reason = "enables the interrupt")]
        unsafe {
            NVIC::unmask(Line(number));
        }
    }
}

/// An interrupt by its number.
#[derive(Clone, Copy)]
struct Line(u16);

// SAFETY: the number is the same at each call.
#[allow(unsafe_code, reason = "the numbers are those of this chip")]
unsafe impl cortex_m::interrupt::InterruptNumber for Line {
    fn number(self) -> u16 {
        self.0
    }
}

/// All interrupts: only those of the UARTs are enabled.
#[exception]
#[allow(unsafe_code, reason = "the handler of all interrupts is unsafe")]
unsafe fn DefaultHandler(_: i16) {
    UART0.on_interrupt();
    UART1.on_interrupt();
}

/// The receiving half of a port.
pub(super) struct Receiver(pub(super) &'static Port);

impl ErrorType for Receiver {
    type Error = Infallible;
}

impl Read for Receiver {
    async fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Infallible> {
        let count = self.0.received.read(bytes).await;
        // A byte may have waited for the room.
        cortex_m::interrupt::free(|_| self.0.take());
        Ok(count)
    }
}

/// The transmitting half of a port.
pub(super) struct Transmitter(pub(super) &'static Port);

impl ErrorType for Transmitter {
    type Error = Infallible;
}

impl Write for Transmitter {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        let port = self.0;
        poll_fn(|context| {
            port.room.register(context.waker());
            let mut count = 0;
            for &byte in bytes {
                if port.read(STATE) & TRANSMIT_FULL != 0 {
                    break;
                }
                port.write(DATA, u32::from(byte));
                count += 1;
            }
            if count == 0 && !bytes.is_empty() {
                Poll::Pending
            } else {
                Poll::Ready(Ok(count))
            }
        })
        .await
    }

    async fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}
