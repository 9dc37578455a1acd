//! The lines of a suit of BNO08x in their UART-RVC mode: ten pins (GP6 to GP15), each received by a state machine of the PIO
//! and by DMA into a ring.

use core::sync::atomic::AtomicU8;

use bodyflight_core::link::SensorKind;
use bodyflight_firmware::sensor::line_rate;
use bodyflight_firmware::sensor::rvc_suit::{LINES, Lines};
use embassy_rp::Peri;
use embassy_rp::pac::dma::vals::TreqSel;
use embassy_rp::pac::{PADS_BANK0, PIO0, PIO1, PIO2, pio};
use embassy_rp::pio::{Common, Instance, PioPin, StateMachine};
use embassy_rp::pio_programs::uart::{PioUartRx, PioUartRxProgram};

use crate::ring;

/// The channel of the first line; the others follow.
const CHANNEL: usize = 1;

/// Length of a ring: what arrives in 270 ms.
const LENGTH: usize = 512;

/// A ring, which begins at a multiple of its length.
#[repr(align(512))]
struct Ring([AtomicU8; LENGTH]);

static RINGS: [Ring; LINES] = [const { Ring([const { AtomicU8::new(0) }; LENGTH]) }; LINES];

/// The blocks of the PIO, and the state machines of each.
const BLOCKS: [pio::Pio; 3] = [PIO0, PIO1, PIO2];
const MACHINES: usize = 4;

/// Receives a line for ever, by the state machine of its number.
pub(crate) fn receive<P: Instance, const MACHINE: usize>(
    line: usize,
    pin: Peri<'static, impl PioPin>,
    common: &mut Common<'static, P>,
    machine: StateMachine<'static, P, MACHINE>,
    program: &PioUartRxProgram<'static, P>,
) {
    let number = usize::from(pin.pin());
    let rate = line_rate(SensorKind::Bno08xRvc);
    // Whatever is dropped stops.
    core::mem::forget(PioUartRx::new(rate, common, machine, pin, program));
    // A pin without a sensor hears nothing.
    PADS_BANK0.gpio(number).modify(|pad| pad.set_pue(true));
    let block = line / MACHINES;
    let (Some(ring), Some(registers)) = (RINGS.get(line), BLOCKS.get(block)) else {
        return;
    };
    // The requests of each block: four to send, then four to receive.
    let request = TreqSel::from_bits((2 * MACHINES * block + MACHINES + MACHINE) as u8);
    let from = registers.rxf(MACHINE).as_ptr().cast_const().cast();
    ring::fill(CHANNEL + line, from, &ring.0, request);
}

/// What the lines have received.
#[derive(Default)]
pub(crate) struct FromSuit {
    places: [usize; LINES],
}

impl Lines for FromSuit {
    fn next(&mut self, line: usize) -> Option<u8> {
        let (ring, place) = (RINGS.get(line)?, self.places.get_mut(line)?);
        ring::next(CHANNEL + line, &ring.0, place)
    }
}

/// Starts the lines of a block, from one on: each machine with its pin.
macro_rules! receive_block {
    ($first:expr, $block:expr, $($machine:ident: $pin:expr),+) => {{
        let mut block = $block;
        let program = embassy_rp::pio_programs::uart::PioUartRxProgram::new(&mut block.common);
        let mut line = $first;
        $(
            crate::suit::receive(line, $pin, &mut block.common, block.$machine, &program);
            line += 1;
        )+
        // Whatever is dropped stops.
        core::mem::forget(block.common);
        line
    }};
}
pub(crate) use receive_block;
