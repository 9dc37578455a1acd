//! Memory that survives a reset.

use core::cell::UnsafeCell;
use core::mem::MaybeUninit;

/// `N` words in memory that the start-up code does not initialise. After power-on their contents are arbitrary, so they
/// are only accessed by volatile reads and writes, word by word.
#[repr(transparent)]
pub(crate) struct Retained<const N: usize>(UnsafeCell<MaybeUninit<[u32; N]>>);

// SAFETY: words are read and written whole; consistency between several words is checked by a checksum.
#[allow(unsafe_code, reason = "shared like an atomic")]
unsafe impl<const N: usize> Sync for Retained<N> {}

impl<const N: usize> Retained<N> {
    pub(crate) const fn new() -> Self {
        Self(UnsafeCell::new(MaybeUninit::uninit()))
    }

    #[allow(unsafe_code, reason = "reads memory that start-up does not clear")]
    pub(crate) fn load(&self) -> [u32; N] {
        let words: *const u32 = self.0.get().cast();
        // SAFETY: within the words; a volatile read takes the bits as they are.
        core::array::from_fn(|place| unsafe { words.add(place).read_volatile() })
    }

    #[allow(unsafe_code, reason = "writes memory that survives a reset")]
    pub(crate) fn store(&self, words: [u32; N]) {
        let places: *mut u32 = self.0.get().cast();
        for (place, word) in words.into_iter().enumerate() {
            // SAFETY: within the words.
            unsafe { places.add(place).write_volatile(word) };
        }
    }
}
