//! A simulated chip on SPI with its select pin and the passing of time, for the tests of drivers.

use core::cell::RefCell;
use core::convert::Infallible;
use std::rc::Rc;

use embedded_hal::digital::{self, OutputPin};
use embedded_hal::spi::{self, SpiBus};
use embedded_hal_async::delay::DelayNs;

/// A chip, as its pins see it.
pub(crate) trait Chip {
    /// Exchanges one byte; the chip is selected.
    fn exchange(&mut self, byte: u8) -> u8;

    /// Ends a command: the chip is selected no longer.
    fn deselect(&mut self);

    /// Passes some time (us).
    fn pass(&mut self, micros: u32);
}

/// The bus, the select pin and the clock of a chip.
pub(crate) struct Pins<C> {
    pub(crate) chip: Rc<RefCell<C>>,
    selected: Rc<RefCell<bool>>,
}

impl<C> Pins<C> {
    pub(crate) fn new(chip: C) -> Self {
        Self {
            chip: Rc::new(RefCell::new(chip)),
            selected: Rc::default(),
        }
    }
}

impl<C> Clone for Pins<C> {
    fn clone(&self) -> Self {
        Self {
            chip: Rc::clone(&self.chip),
            selected: Rc::clone(&self.selected),
        }
    }
}

impl<C: Chip> Pins<C> {
    fn exchange(&self, byte: u8) -> u8 {
        assert!(*self.selected.borrow(), "nobody is selected");
        self.chip.borrow_mut().exchange(byte)
    }
}

impl<C> spi::ErrorType for Pins<C> {
    type Error = Infallible;
}

impl<C: Chip> SpiBus for Pins<C> {
    fn read(&mut self, words: &mut [u8]) -> Result<(), Infallible> {
        words.iter_mut().for_each(|word| *word = self.exchange(0));
        Ok(())
    }
    fn write(&mut self, words: &[u8]) -> Result<(), Infallible> {
        for word in words {
            self.exchange(*word);
        }
        Ok(())
    }
    fn transfer(&mut self, _: &mut [u8], _: &[u8]) -> Result<(), Infallible> {
        unreachable!("not used")
    }
    fn transfer_in_place(&mut self, _: &mut [u8]) -> Result<(), Infallible> {
        unreachable!("not used")
    }
    fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

impl<C> digital::ErrorType for Pins<C> {
    type Error = Infallible;
}

impl<C: Chip> OutputPin for Pins<C> {
    fn set_low(&mut self) -> Result<(), Infallible> {
        *self.selected.borrow_mut() = true;
        Ok(())
    }
    fn set_high(&mut self) -> Result<(), Infallible> {
        *self.selected.borrow_mut() = false;
        self.chip.borrow_mut().deselect();
        Ok(())
    }
}

impl<C: Chip> DelayNs for Pins<C> {
    async fn delay_ns(&mut self, time: u32) {
        self.chip.borrow_mut().pass(time / 1000);
    }
}
