//! Handlers of panics and faults: they record the fault in memory that survives a reset, then restart.

use core::panic::PanicInfo;
use core::sync::atomic::{AtomicBool, Ordering};

use bodyflight_firmware::fault::{Kind, Record, Reset, WORDS};
use cortex_m::peripheral::SCB;

use crate::retained::Retained;
use crate::stack::marks;

#[allow(unsafe_code, reason = "start-up code does not clear this section")]
#[unsafe(link_section = ".uninit.record")]
static RECORD: Retained<WORDS> = Retained::new();

/// The sample being processed.
#[allow(unsafe_code, reason = "start-up code does not clear this section")]
#[unsafe(link_section = ".uninit.sequence")]
static SEQUENCE: Retained<1> = Retained::new();

/// Bit of the configuration and control register that makes an integer division by zero a fault.
const DIVISION_TRAP: u32 = 1 << 4;

/// Causes in the configurable fault status: memory, bus and usage faults.
const MEMORY: u32 = 0x0000_00FF;
const BUS: u32 = 0x0000_FF00;
const UNDEFINED: u32 = 1 << 16;
const UNALIGNED: u32 = 1 << 24;
const DIVISION: u32 = 1 << 25;
/// Stacking failed on entry to an exception, or the stack limit was passed.
const STACKING: u32 = 1 << 4 | 1 << 12 | 1 << 20;

/// The source revision that the image was built from.
pub fn build() -> [u8; 8] {
    let mut build = [0; 8];
    for (place, byte) in build.iter_mut().zip(env!("BODYFLIGHT_REVISION").bytes()) {
        *place = byte;
    }
    build
}

/// Makes division by zero a fault, counts this start and returns the history of starts.
pub fn begin(reset: Reset) -> Record {
    // SAFETY: division by zero then faults instead of giving zero, which changes nothing else.
    #[allow(unsafe_code, reason = "accesses a register of the processor")]
    unsafe {
        (*SCB::PTR).ccr.modify(|control| control | DIVISION_TRAP);
    }
    let mut record = Record::read(&RECORD.load());
    record.start(reset, SEQUENCE.load()[0]);
    RECORD.store(record.words());
    note(0);
    record
}

/// Notes the sample being processed.
pub fn note(sequence: u32) {
    SEQUENCE.store([sequence]);
}

/// Records a fault.
fn write_down(kind: Kind, address: u32, place: Option<(&str, u32)>) {
    let mut record = Record::read(&RECORD.load());
    record.fault(kind, address, SEQUENCE.load()[0]);
    if let Some((file, line)) = place {
        record.place(file, line);
    }
    RECORD.store(record.words());
}

/// Whether a panic is being handled.
static PANICKING: AtomicBool = AtomicBool::new(false);

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    cortex_m::interrupt::disable();
    // The logger panics if the first panic came from within it: the record of the first is the one to keep.
    if PANICKING.swap(true, Ordering::Relaxed) {
        SCB::sys_reset();
    }
    let place = info.location();
    let address = place.map_or(0, |place| core::ptr::from_ref(place) as u32);
    let place = place.map(|place| (place.file(), place.line()));
    // Recorded before logging, which may panic itself.
    write_down(Kind::Panic, address, place);
    defmt::error!("{}", defmt::Display2Format(info));
    SCB::sys_reset()
}

/// Handler of processor faults. If the stack pointer is near the end of the stack or outside it, the handler resets it
/// first: otherwise it would fault itself, and the processor would lock up.
#[allow(unsafe_code, reason = "the stack pointer may be anywhere")]
#[unsafe(export_name = "HardFault")]
#[unsafe(naked)]
unsafe extern "C" fn enter_hard_fault() -> ! {
    core::arch::naked_asm!(
        "mrs r0, msp",
        "movw r1, #:lower16:_stack_end",
        "movt r1, #:upper16:_stack_end",
        "add r1, r1, #{room}",
        "movw r2, #:lower16:_stack_start",
        "movt r2, #:upper16:_stack_start",
        "cmp r0, r1",
        "blo 1f",
        "cmp r0, r2",
        "bls 2f",
        "1:",
        "msr msp, r2",
        "2:",
        "b {handler}",
        room = const ROOM,
        handler = sym hard_fault,
    )
}

/// Stack space that the handler needs (bytes).
const ROOM: u32 = 512;

/// Length of the exception frame, and the offset of the program counter in it (bytes).
const FRAME: u32 = 32;
const PROGRAM_COUNTER: u32 = 24;

extern "C" fn hard_fault(frame: u32) -> ! {
    // SAFETY: reads a register of the processor.
    #[allow(unsafe_code, reason = "accesses a register of the processor")]
    let status = unsafe { (*SCB::PTR).cfsr.read() };
    let inside = frame >= marks::bottom() && frame.saturating_add(FRAME) <= marks::top();
    let kind = match status {
        _ if !inside || status & STACKING != 0 => Kind::StackOverflow,
        status if status & UNDEFINED != 0 => Kind::Undefined,
        status if status & UNALIGNED != 0 => Kind::Unaligned,
        status if status & DIVISION != 0 => Kind::DivisionByZero,
        status if status & BUS != 0 => Kind::Bus,
        status if status & MEMORY != 0 => Kind::Memory,
        _ => Kind::HardFault,
    };
    let address = if kind == Kind::StackOverflow {
        0
    } else {
        // SAFETY: the processor has pushed its frame there, inside the stack.
        #[allow(unsafe_code, reason = "reads the exception frame")]
        unsafe {
            ((frame + PROGRAM_COUNTER) as *const u32).read_volatile()
        }
    };
    write_down(kind, address, None);
    SCB::sys_reset()
}
