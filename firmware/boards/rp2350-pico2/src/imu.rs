//! The bus of an inertial sensor, SPI0.

use embassy_rp::Peri;
use embassy_rp::gpio::{AnyPin, Level, Output};
use embassy_rp::peripherals::SPI0;
use embassy_rp::spi::{self, Blocking, ClkPin, MisoPin, MosiPin, Spi};

/// Pins of the inertial sensor.
pub(crate) struct Pins<C, T, F> {
    pub(crate) clock: C,
    pub(crate) to_chip: T,
    pub(crate) from_chip: F,
    pub(crate) select: Peri<'static, AnyPin>,
}

/// The bus and the select pin; reading a measurement takes 15 us.
pub(crate) fn bus<C: ClkPin<SPI0>, T: MosiPin<SPI0>, F: MisoPin<SPI0>>(
    spi: Peri<'static, SPI0>,
    pins: Pins<Peri<'static, C>, Peri<'static, T>, Peri<'static, F>>,
) -> (Spi<'static, SPI0, Blocking>, Output<'static>) {
    let mut config = spi::Config::default();
    config.frequency = 8_000_000;
    let bus = Spi::new_blocking(spi, pins.clock, pins.to_chip, pins.from_chip, config);
    (bus, Output::new(pins.select, Level::High))
}
