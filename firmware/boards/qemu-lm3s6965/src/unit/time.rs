//! Time from SysTick: an interrupt each millisecond, with microseconds from the counter. Boards in QEMU share this file.

use core::cell::RefCell;
use core::task::Waker;

use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m_rt::exception;
use critical_section::{CriticalSection, Mutex};
use embassy_time_driver::{Driver, time_driver_impl};
use embassy_time_queue_utils::Queue;

use super::clock::MILLISECOND;

/// Bit of the ICSR: the counter has wrapped and the interrupt has not run yet.
const PENDING: u32 = 1 << 26;
/// Interrupt control and state register.
const ICSR: *const u32 = 0xE000_ED04 as *const u32;

struct Clock {
    milliseconds: u64,
    queue: Queue,
}

struct Time(Mutex<RefCell<Clock>>);

time_driver_impl!(static TIME: Time = Time(Mutex::new(RefCell::new(Clock {
    milliseconds: 0,
    queue: Queue::new(),
}))));

impl Clock {
    /// Ticks since the start. Interrupts must be masked.
    fn ticks(&self) -> u64 {
        let wrapped = || {
            // SAFETY: reading this register changes nothing.
            #[allow(
                unsafe_code,
                reason = "the accessor for this bit needs to own the peripheral"
            )]
            let state = unsafe { core::ptr::read_volatile(ICSR) };
            state & PENDING != 0
        };
        let before = SYST::get_current();
        // After the wrap the counter is read again: it may have wrapped between the two reads.
        let (counter, milliseconds) = if wrapped() {
            (SYST::get_current(), self.milliseconds + 1)
        } else {
            (before, self.milliseconds)
        };
        let elapsed = (MILLISECOND - 1).saturating_sub(counter);
        milliseconds * u64::from(MILLISECOND) + u64::from(elapsed)
    }

    fn microseconds(&self) -> u64 {
        self.ticks() * 1000 / u64::from(MILLISECOND)
    }
}

impl Time {
    fn with<R>(&self, work: impl FnOnce(&mut Clock) -> R) -> R {
        critical_section::with(|token: CriticalSection<'_>| work(&mut self.0.borrow_ref_mut(token)))
    }
}

impl Driver for Time {
    fn now(&self) -> u64 {
        self.with(|clock| clock.microseconds())
    }

    fn schedule_wake(&self, at: u64, waker: &Waker) {
        self.with(|clock| {
            if clock.queue.schedule_wake(at, waker) {
                // The next tick checks the queue; tasks that are already due are woken here.
                let now = clock.microseconds();
                clock.queue.next_expiration(now);
            }
        });
    }
}

/// Starts the ticks.
pub(super) fn start(timer: &mut SYST) {
    timer.set_clock_source(SystClkSource::Core);
    timer.set_reload(MILLISECOND - 1);
    timer.clear_current();
    timer.enable_interrupt();
    timer.enable_counter();
}

/// Ticks of the processor's clock; wraps.
#[expect(clippy::cast_possible_truncation, reason = "the counter wraps")]
pub(super) fn ticks() -> u32 {
    TIME.with(|clock| clock.ticks()) as u32
}

#[exception]
fn SysTick() {
    TIME.with(|clock| {
        clock.milliseconds += 1;
        let now = clock.microseconds();
        clock.queue.next_expiration(now);
    });
}
