//! Panics and faults: written down where a reset does not reach, then a new start. And the stack's high water.

use core::cell::Cell;
use core::mem::MaybeUninit;
use core::panic::PanicInfo;
use core::sync::atomic::{AtomicU32, Ordering};

use bodyflight_firmware::fault::{Kind, Record, WORDS};
use cortex_m::peripheral::SCB;
use cortex_m_rt::{ExceptionFrame, exception};
use critical_section::Mutex;

/// What the stack is filled with before the start.
const PAINT: u32 = 0xCCCC_CCCC;

#[allow(unsafe_code, reason = "placed where the start-up code does not write")]
#[unsafe(link_section = ".uninit.record")]
static RECORD: Mutex<Cell<MaybeUninit<[u32; WORDS]>>> =
    Mutex::new(Cell::new(MaybeUninit::uninit()));

fn load() -> Record {
    let words = critical_section::with(|token| RECORD.borrow(token).get());
    // SAFETY: any bits are words; whether they are a record is checked by their sum.
    #[allow(unsafe_code, reason = "reads memory that power-on left as it was")]
    let words = unsafe { words.assume_init() };
    Record::read(&words)
}

fn store(record: &Record) {
    let words = MaybeUninit::new(record.words());
    critical_section::with(|token| RECORD.borrow(token).set(words));
}

/// The first bytes of the source revision that the image was built from, zero where unknown.
pub fn build() -> [u8; 8] {
    let mut build = [0; 8];
    let revision = option_env!("BODYFLIGHT_REVISION").unwrap_or_default();
    for (place, byte) in build.iter_mut().zip(revision.bytes()) {
        *place = byte;
    }
    build
}

/// Counts this start and tells what is known of those before.
pub fn begin() -> Record {
    let mut record = load();
    record.start();
    store(&record);
    record
}

/// The sample in work.
static SEQUENCE: AtomicU32 = AtomicU32::new(0);

/// Notes the sample in work.
pub fn note(sequence: u32) {
    SEQUENCE.store(sequence, Ordering::Relaxed);
}

fn restart(kind: Kind, address: u32) -> ! {
    let mut record = load();
    record.fault(kind, address, SEQUENCE.load(Ordering::Relaxed));
    store(&record);
    SCB::sys_reset()
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    defmt::error!("{}", defmt::Display2Format(info));
    restart(Kind::Panic, 0)
}

#[allow(unsafe_code, reason = "the runtime hands over the faulting frame")]
#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    restart(Kind::HardFault, frame.pc())
}

/// Bytes of stack that were never touched.
pub fn stack_free() -> u32 {
    #[allow(
        unsafe_code,
        reason = "the linker's mark of the lowest address of the stack"
    )]
    unsafe extern "C" {
        static _stack_end: u32;
    }
    let bottom = &raw const _stack_end as u32;
    let top = cortex_m::register::msp::read();
    let painted = |address: &u32| {
        // SAFETY: aligned RAM between the statics and the stack pointer.
        #[allow(unsafe_code, reason = "looks at unused stack")]
        let word = unsafe { core::ptr::read_volatile(*address as *const u32) };
        word == PAINT
    };
    let end = (bottom..top).step_by(4).find(|address| !painted(address));
    end.unwrap_or(top).saturating_sub(bottom)
}
