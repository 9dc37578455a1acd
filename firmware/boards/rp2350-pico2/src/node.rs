//! A node of the line of sensors on the limbs, on a Raspberry Pi Pico 2 or a smaller board with an RP2350: SPI0 to the sensor
//! (GP0 in, GP1 select, GP2 clock, GP3 out), UART1 to and from the line's transceiver (GP4 out, GP5 in, GP6 high to drive), the
//! address at GP7 and GP26 to GP28, a light (GP25), logs by RTT.
#![no_std]
#![no_main]

mod chip;
mod imu;

use bodyflight_core::Segment;
use bodyflight_core::chain::{BAUD, PACKET_LENGTH};
use bodyflight_cortex_m::{faults, stack};
use bodyflight_firmware::node::{self, Line};
use bodyflight_firmware::sensor::icm42688::Icm42688;
// Linked for its logger.
use defmt_rtt as _;
use embassy_executor::Spawner;
use embassy_rp::Peri;
use embassy_rp::gpio::{AnyPin, Input, Level, Output, Pull};
use embassy_rp::pac::UART1;
use embassy_rp::uart::{self, Blocking, Uart};
use embassy_rp::watchdog::Watchdog;
use embassy_time::{Delay, Duration, Instant, block_for};

/// How long a pin takes to follow its pull-up.
const RISE: Duration = Duration::from_micros(50);

/// The transceiver's line.
struct Pair {
    uart: Uart<'static, Blocking>,
    drive: Output<'static>,
    light: Output<'static>,
    watchdog: Watchdog,
}

impl Line for Pair {
    fn now(&mut self) -> u64 {
        Instant::now().as_micros()
    }

    fn hear(&mut self) -> Option<u8> {
        let is_empty = UART1.uartfr().read().rxfe();
        // Bytes with errors fail the packet's checksum.
        (!is_empty).then(|| UART1.uartdr().read().data())
    }

    fn send(&mut self, packet: &[u8; PACKET_LENGTH]) {
        self.drive.set_high();
        // A blocking write of this peripheral has no errors.
        let _ = self.uart.blocking_write(packet);
        while self.uart.busy() {}
        self.drive.set_low();
        while self.hear().is_some() {}
    }

    fn feed_watchdog(&mut self) {
        self.watchdog.feed(chip::TIMEOUT);
    }

    fn shine(&mut self, on: bool) {
        self.light.set_level(on.into());
    }
}

/// The address: a pin connected to ground is a zero, an open one a one, the lowest bit first. So a wire that breaks makes no
/// second pelvis, which has address 0.
fn address(pins: [Peri<'static, AnyPin>; 4]) -> Option<&'static Segment> {
    let pins = pins.map(|pin| Input::new(pin, Pull::Up));
    block_for(RISE);
    let bits = pins.iter().rev();
    let address = bits.fold(0, |bits, pin| bits << 1 | usize::from(pin.is_high()));
    Segment::ALL.get(address)
}

#[embassy_executor::main]
async fn main(_spawner: Spawner) {
    stack::guard();
    let (mut watchdog, cause) = chip::watchdog();
    faults::begin(cause);
    chip::guard_supply();
    let chip = embassy_rp::init(embassy_rp::config::Config::default());
    watchdog.start(chip::TIMEOUT);
    let pins = [
        chip.PIN_7.into(),
        chip.PIN_26.into(),
        chip.PIN_27.into(),
        chip.PIN_28.into(),
    ];
    let mut config = uart::Config::default();
    config.baudrate = BAUD;
    let line = Pair {
        drive: Output::new(chip.PIN_6, Level::Low),
        uart: Uart::new_blocking(chip.UART1, chip.PIN_4, chip.PIN_5, config),
        light: Output::new(chip.PIN_25, Level::Low),
        watchdog,
    };
    let pins_of_imu = imu::Pins {
        clock: chip.PIN_2,
        to_chip: chip.PIN_3,
        from_chip: chip.PIN_0,
        select: chip.PIN_1.into(),
    };
    let (bus, select) = imu::bus(chip.SPI0, pins_of_imu);
    if let Some(address) = address(pins) {
        node::run(*address, line, Icm42688::new(bus, select, Delay)).await;
    }
}
