//! Bytes that a peripheral sends by DMA into a ring, which goes on while the processor stops for its flash.

use core::sync::atomic::{AtomicU8, Ordering};

use embassy_rp::pac::dma::vals::{DataSize, TransCountMode, TreqSel};
use embassy_rp::pac::{DMA, dma};

/// Lets a channel fill a ring for ever, a byte for each request. The DMA wraps addresses, so the ring begins at a multiple
/// of its length.
pub(crate) fn fill(channel: usize, from: *const (), ring: &'static [AtomicU8], request: TreqSel) {
    let registers = DMA.ch(channel);
    registers.read_addr().write_value(from as u32);
    let begin = ring.as_ptr().expose_provenance();
    registers.write_addr().write_value(begin as u32);
    registers.trans_count().write(|count| {
        count.set_mode(TransCountMode::ENDLESS);
        count.set_count(1);
    });
    registers.ctrl_trig().write(|control| {
        control.set_data_size(DataSize::SIZE_BYTE);
        control.set_incr_write(true);
        // The write address wraps.
        control.set_ring_sel(true);
        control.set_ring_size(ring.len().ilog2() as u8);
        control.set_treq_sel(request);
        // To itself: no channel follows.
        control.set_chain_to(channel as u8);
        control.set_irq_quiet(true);
        control.set_en(true);
    });
}

/// The next byte in a channel's ring, if there is one; its place moves on.
pub(crate) fn next(channel: usize, ring: &'static [AtomicU8], place: &mut usize) -> Option<u8> {
    let registers: dma::Channel = DMA.ch(channel);
    let end = registers.write_addr().read() as usize % ring.len();
    let cell = ring.get(*place).filter(|_| *place != end)?;
    *place = (*place + 1) % ring.len();
    Some(cell.load(Ordering::Relaxed))
}
