//! Interrupt-driven driver for the board's PL011 UARTs.

use core::convert::Infallible;
use core::future::poll_fn;
use core::sync::atomic::{AtomicU32, Ordering};
use core::task::Poll;

use bodyflight_firmware::RECEIVER_BYTES;
use cortex_m::peripheral::NVIC;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::pipe::Pipe;
use embassy_sync::waitqueue::AtomicWaker;
use embedded_io_async::{ErrorType, Read, Write};
use lm3s6965::Interrupt;

/// Registers, as offsets from the base.
const DATA: usize = 0x00;
const FLAGS: usize = 0x18;
const LINE_CONTROL: usize = 0x2C;
const CONTROL: usize = 0x30;
const INTERRUPT_MASK: usize = 0x38;
const INTERRUPT_CLEAR: usize = 0x44;

const RECEIVE_EMPTY: u32 = 1 << 4;
const TRANSMIT_FULL: u32 = 1 << 5;
/// Interrupts: bytes received, a pause after bytes received, room to transmit.
const RECEIVED: u32 = 1 << 4;
const PAUSE: u32 = 1 << 6;
const ROOM: u32 = 1 << 5;
/// Error bits beside a received byte: framing, parity or break; and overrun.
const BYTE_ERRORS: u32 = 7 << 8;
const OVERRUN: u32 = 1 << 11;
/// 8 data bits, no parity, 1 stop bit, FIFOs of 16 bytes.
const LINE: u32 = 3 << 5 | 1 << 4;
/// Control bits that enable the UART, its transmitter and its receiver.
const ENABLED: u32 = 1 | 1 << 8 | 1 << 9;
const FIFO: usize = 16;

/// A UART with its receive buffer and error counters.
pub(super) struct Port {
    base: usize,
    interrupt: Interrupt,
    received: Pipe<CriticalSectionRawMutex, RECEIVER_BYTES>,
    room: AtomicWaker,
    overruns: AtomicU32,
    framing: AtomicU32,
}

/// The line to the host.
pub(super) static UART0: Port = Port::new(0x4000_C000, Interrupt::UART0);
/// The line from the inertial sensor.
pub(super) static UART1: Port = Port::new(0x4000_D000, Interrupt::UART1);

impl Port {
    const fn new(base: usize, interrupt: Interrupt) -> Self {
        Self {
            base,
            interrupt,
            received: Pipe::new(),
            room: AtomicWaker::new(),
            overruns: AtomicU32::new(0),
            framing: AtomicU32::new(0),
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

    /// Starts receiving. QEMU has no baud rate to set.
    pub(super) fn start(&self) {
        self.write(CONTROL, 0);
        self.write(LINE_CONTROL, LINE);
        self.write(INTERRUPT_MASK, RECEIVED | PAUSE);
        self.write(CONTROL, ENABLED);
        // SAFETY: there are no critical sections by priority that this could break.
        #[allow(unsafe_code, reason = "enables the interrupt")]
        unsafe {
            NVIC::unmask(self.interrupt);
        }
    }

    /// Number of overruns and of other errors since the start.
    pub(super) fn errors(&self) -> [u32; 2] {
        [&self.overruns, &self.framing].map(|counter| counter.load(Ordering::Relaxed))
    }

    fn on_interrupt(&self) {
        // Cleared first, so that bytes arriving from here on raise a new interrupt.
        self.write(INTERRUPT_CLEAR, RECEIVED | PAUSE | ROOM);
        while self.read(FLAGS) & RECEIVE_EMPTY == 0 {
            self.take_fifo();
        }
        if self.read(FLAGS) & TRANSMIT_FULL == 0 {
            self.write(INTERRUPT_MASK, RECEIVED | PAUSE);
            self.room.wake();
        }
    }

    /// Moves the contents of the FIFO to the pipe.
    fn take_fifo(&self) {
        let mut bytes = [0; FIFO];
        let mut count = 0;
        for place in &mut bytes {
            if self.read(FLAGS) & RECEIVE_EMPTY != 0 {
                break;
            }
            let word = self.read(DATA);
            *place = word.to_le_bytes()[0];
            count += 1;
            add(&self.framing, u32::from(word & BYTE_ERRORS != 0));
            add(&self.overruns, u32::from(word & OVERRUN != 0));
        }
        let mut received = bytes.get(..count).unwrap_or_default();
        // Where the pipe wraps around, it accepts the bytes in two pieces.
        while let Ok(taken @ 1..) = self.received.try_write(received) {
            received = received.get(taken..).unwrap_or_default();
        }
        add(&self.overruns, u32::from(!received.is_empty()));
    }
}

/// Adds to a counter. Only one context writes each counter, so the addition need not be atomic.
fn add(counter: &AtomicU32, more: u32) {
    counter.store(
        counter.load(Ordering::Relaxed).wrapping_add(more),
        Ordering::Relaxed,
    );
}

/// The receiving half of a port.
pub(super) struct Receiver(pub(super) &'static Port);

impl ErrorType for Receiver {
    type Error = Infallible;
}

impl Read for Receiver {
    async fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Infallible> {
        Ok(self.0.received.read(bytes).await)
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
                if port.read(FLAGS) & TRANSMIT_FULL != 0 {
                    break;
                }
                port.write(DATA, u32::from(byte));
                count += 1;
            }
            if count == 0 && !bytes.is_empty() {
                port.write(INTERRUPT_MASK, RECEIVED | PAUSE | ROOM);
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

mod handlers {
    //! Interrupt handlers, with the names of the vector table.

    use lm3s6965::interrupt;

    #[interrupt]
    fn UART0() {
        super::UART0.on_interrupt();
    }

    #[interrupt]
    fn UART1() {
        super::UART1.on_interrupt();
    }
}
