//! Chip set-up besides the ports: watchdog, clocks, flash, the memory chip, battery, random numbers.

use bodyflight_firmware::fault::Reset;
use bodyflight_firmware::millivolts;
use bodyflight_firmware::recorder::serial_flash::SerialFlash;
use embassy_stm32::adc::{Adc, SampleTime};
use embassy_stm32::gpio::{Level, Output, Speed};
use embassy_stm32::interrupt::{self, InterruptExt, Priority};
use embassy_stm32::mode::Blocking;
use embassy_stm32::pac::{FLASH, RCC, RNG, USART6};
use embassy_stm32::peripherals::{ADC1, IWDG, PA3, PA15, PB3, PB4, PB5, SPI3};
use embassy_stm32::spi::{self, Spi, mode::Master};
use embassy_stm32::time::Hertz;
use embassy_stm32::wdg::IndependentWatchdog;
use embassy_stm32::{Config, Peri, rcc};
use embassy_time::Delay;

/// Watchdog timeout: four heartbeats (us).
const WATCHDOG: u32 = 1_000_000;

/// Number of polls while the crystal starts, about 100 ms at the initial 16 MHz; crystals take 2 ms.
const CRYSTAL_LOOKS: u32 = 100_000;

/// Number of polls for a random number, which is generated in 40 cycles of its clock.
const RANDOM_LOOKS: u32 = 10_000;

/// Cause of the chip's reset. The flags accumulate until they are cleared, and power-on sets those of weaker causes
/// too.
pub(crate) fn reset() -> Reset {
    let flags = RCC.csr().read();
    RCC.csr().modify(|csr| csr.set_rmvf(true));
    if flags.porrstf() {
        Reset::Power
    } else if flags.wdgrstf() {
        Reset::Watchdog
    } else if flags.sftrstf() {
        Reset::Software
    } else if flags.borrstf() {
        Reset::BrownOut
    } else {
        Reset::Other
    }
}

/// Keys that unlock the option bytes, and the code of the highest brown-out level.
const OPTION_KEYS: [u32; 2] = [0x0819_2a3b, 0x4c5d_6e7f];
const HIGHEST_LEVEL: u8 = 0;

/// Number of polls while the option bytes are written, which takes a fraction of a second.
const OPTION_LOOKS: u32 = 10_000_000;

/// Sets the brown-out level to 2.7 V, the least voltage at which flash is fast enough for 168 MHz with five wait
/// states. The option bytes keep it, so they are written only once in the life of a chip.
pub(crate) fn guard_supply() {
    if FLASH.optcr().read().bor_lev() == HIGHEST_LEVEL {
        return;
    }
    for key in OPTION_KEYS {
        FLASH.optkeyr().write_value(key);
    }
    FLASH.optcr().modify(|option| {
        option.set_optlock(false);
        option.set_bor_lev(HIGHEST_LEVEL);
    });
    FLASH.optcr().modify(|option| option.set_optstrt(true));
    let _ = (0..OPTION_LOOKS).any(|_| !FLASH.sr().read().bsy());
    FLASH.optcr().modify(|option| option.set_optlock(true));
}

/// Starts the watchdog, which can be done first since it has its own oscillator.
#[allow(
    unsafe_code,
    reason = "runs before the clocks are set, when there are no peripherals to own"
)]
pub(crate) fn watchdog() -> IndependentWatchdog<'static, IWDG> {
    // SAFETY: nothing else uses the watchdog.
    let peripheral = unsafe { IWDG::steal() };
    let mut watchdog = IndependentWatchdog::new(peripheral, WATCHDOG);
    watchdog.unleash();
    watchdog
}

/// 168 MHz, from a crystal of 12 MHz, or from the chip's internal oscillator of 16 MHz if no crystal starts. The
/// internal oscillator is within 1 % at room temperature, which is close enough for the serial lines.
pub(crate) fn clocks() -> Config {
    RCC.cr().modify(|control| control.set_hseon(true));
    let crystal = (0..CRYSTAL_LOOKS).any(|_| RCC.cr().read().hserdy());
    let mut config = Config::default();
    let prediv = if crystal {
        config.rcc.hse = Some(rcc::Hse {
            freq: Hertz::mhz(12),
            mode: rcc::HseMode::Oscillator,
        });
        config.rcc.pll_src = rcc::PllSource::HSE;
        rcc::PllPreDiv::DIV6
    } else {
        RCC.cr().modify(|control| control.set_hseon(false));
        config.rcc.pll_src = rcc::PllSource::HSI;
        rcc::PllPreDiv::DIV8
    };
    config.rcc.pll = Some(rcc::Pll {
        prediv,
        mul: rcc::PllMul::MUL168,
        divp: Some(rcc::PllPDiv::DIV2),
        divq: Some(rcc::PllQDiv::DIV7),
        divr: None,
    });
    config.rcc.ahb_pre = rcc::AHBPrescaler::DIV1;
    config.rcc.apb1_pre = rcc::APBPrescaler::DIV4;
    config.rcc.apb2_pre = rcc::APBPrescaler::DIV2;
    config.rcc.sys = rcc::Sysclk::PLL1_P;
    config.dma_interrupt_priority = Priority::P1;
    config
}

/// Clock of USART6: half of the processor's (Hz).
const SENSOR_CLOCK: u32 = 84_000_000;

/// Sets the rate of the sensor's line (baud). The register holds the clock cycles of a bit, since each is sampled 16 times.
pub(crate) fn set_sensor_rate(baud: u32) {
    let cycles = (SENSOR_CLOCK + baud / 2) / baud.max(1);
    USART6.brr().write(|divider| divider.0 = cycles);
}

/// Enables prefetch and both caches, which make flash with five wait states nearly as fast as with none.
pub(crate) fn accelerate_flash() {
    FLASH.acr().modify(|control| {
        control.set_prften(true);
        control.set_icen(true);
        control.set_dcen(true);
    });
}

/// Gives reception priority over transmission, and both priority over the clock, whose interrupts may be delayed by 30
/// ms.
pub(crate) fn order_interrupts() {
    // SAFETY: there are no critical sections by priority that this could break.
    interrupt::USART3.set_priority(Priority::P2);
    interrupt::USART6.set_priority(Priority::P2);
    interrupt::DMA1_STREAM3.set_priority(Priority::P3);
    interrupt::OTG_FS.set_priority(Priority::P3);
    interrupt::TIM2.set_priority(Priority::P4);
}

/// The memory chip.
pub(crate) type Flash = SerialFlash<Spi<'static, Blocking, Master>, Output<'static>, Delay>;

/// Pins of the memory chip.
pub(crate) struct FlashPins {
    pub(crate) clock: Peri<'static, PB3>,
    pub(crate) to_chip: Peri<'static, PB5>,
    pub(crate) from_chip: Peri<'static, PB4>,
    pub(crate) select: Peri<'static, PA15>,
}

/// Finds the memory chip; transferring a page takes 0.1 ms.
pub(crate) async fn flash(spi: Peri<'static, SPI3>, pins: FlashPins) -> Option<Flash> {
    let mut config = spi::Config::default();
    config.frequency = Hertz::mhz(21);
    let bus = Spi::new_blocking(spi, pins.clock, pins.to_chip, pins.from_chip, config);
    let select = Output::new(pins.select, Level::High, Speed::VeryHigh);
    SerialFlash::find(bus, select, Delay).await
}

/// The battery, behind a divider of two equal resistors.
pub(crate) struct Battery {
    converter: Adc<'static, ADC1>,
    pin: Peri<'static, PA3>,
}

const DIVIDER: u16 = 2;

impl Battery {
    pub(crate) fn new(converter: Peri<'static, ADC1>, pin: Peri<'static, PA3>) -> Self {
        Self {
            converter: Adc::new(converter),
            pin,
        }
    }

    /// Measures the voltage (mV). Takes 24 us: the divider has 100 kOhm, so the converter uses its longest sampling
    /// time.
    pub(crate) fn millivolts(&mut self) -> u16 {
        let count = self
            .converter
            .blocking_read(&mut self.pin, SampleTime::CYCLES480);
        millivolts(count, DIVIDER)
    }
}

/// An unpredictable random number, or `None` if the generator does not work.
pub(crate) fn random() -> Option<u32> {
    RCC.ahb2enr().modify(|enabled| enabled.set_rngen(true));
    RNG.cr().modify(|control| control.set_rngen(true));
    let next = || {
        let ready = (0..RANDOM_LOOKS).any(|_| RNG.sr().read().drdy());
        ready.then(|| RNG.dr().read())
    };
    // The first number after a reset must not be used.
    let number = next().and_then(|_| next());
    RNG.cr().modify(|control| control.set_rngen(false));
    number
}
