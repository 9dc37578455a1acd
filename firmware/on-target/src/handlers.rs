//! What ends an image that goes wrong: the code by which QEMU exits says which of the two it was.

use core::panic::PanicInfo;

use cortex_m_rt::{ExceptionFrame, exception};
use semihosting::{eprintln, process};

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    eprintln!("{info}");
    process::exit(101)
}

#[allow(unsafe_code, reason = "the runtime hands over the faulting frame")]
#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    eprintln!("{frame:?}");
    process::exit(102)
}
