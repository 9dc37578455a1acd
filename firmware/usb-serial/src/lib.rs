//! A USB serial port (CDC-ACM) to the host, for any chip with an `embassy_usb` driver.
#![cfg(target_os = "none")]
#![no_std]

use bodyflight_firmware::ports::Opened;
use embassy_executor::{SpawnToken, Spawner};
use embassy_usb::class::cdc_acm::{BufferedReceiver, CdcAcmClass, CdcAcmError, Sender, State};
use embassy_usb::driver::Driver;
use embassy_usb::{Builder, Config, UsbDevice};
use embedded_io_async::{ErrorType, Read, Write};
use static_cell::StaticCell;

/// Bytes of a packet at full speed.
const PACKET: usize = 64;

/// USB vendor and product id that pid.codes provides for projects without their own; devices for sale must not use
/// them.
const IDENTITY: [u16; 2] = [0x1209, 0x0001];

static CONFIGURATION: StaticCell<[u8; 128]> = StaticCell::new();
static CONTROL: StaticCell<[u8; 64]> = StaticCell::new();
static SERIAL: StaticCell<State<'static>> = StaticCell::new();
static RECEIVED: StaticCell<[u8; PACKET]> = StaticCell::new();

/// Receives bytes from the host.
pub struct Receiver<D: Driver<'static>>(BufferedReceiver<'static, D>);

/// Sends bytes to the host.
pub struct Transmitter<D: Driver<'static>>(Sender<'static, D>);

/// Creates the device, which must run alongside the application, and both directions of its port. Must be called only
/// once.
pub fn start<D: Driver<'static>>(
    driver: D,
) -> (UsbDevice<'static, D>, Receiver<D>, Transmitter<D>) {
    let [vendor, product] = IDENTITY;
    let mut config = Config::new(vendor, product);
    config.manufacturer = Some("bodyflight");
    config.product = Some("bodyflight unit");
    let configuration = CONFIGURATION.init([0; 128]);
    let control = CONTROL.init([0; 64]);
    let mut builder = Builder::new(driver, config, configuration, &mut [], &mut [], control);
    #[expect(clippy::cast_possible_truncation, reason = "a packet has 64 bytes")]
    let class = CdcAcmClass::new(&mut builder, SERIAL.init(State::new()), PACKET as u16);
    let (sender, receiver) = class.split();
    let receiver = receiver.into_buffered(RECEIVED.init([0; PACKET]));
    (builder.build(), Receiver(receiver), Transmitter(sender))
}

/// Spawns the task that runs the device.
pub fn spawn<S, E>(spawner: Spawner, task: Result<SpawnToken<S>, E>) {
    match task {
        Ok(task) => spawner.spawn(task),
        Err(_) => defmt::error!("the device runs already"),
    }
}

impl<D: Driver<'static>> Opened for Receiver<D> {
    fn is_open(&self) -> bool {
        self.0.dtr()
    }
}

impl<D: Driver<'static>> Opened for Transmitter<D> {
    fn is_open(&self) -> bool {
        self.0.dtr()
    }
}

impl<D: Driver<'static>> ErrorType for Receiver<D> {
    type Error = CdcAcmError;
}

impl<D: Driver<'static>> Read for Receiver<D> {
    async fn read(&mut self, bytes: &mut [u8]) -> Result<usize, CdcAcmError> {
        self.0.wait_connection().await;
        self.0.read(bytes).await
    }
}

impl<D: Driver<'static>> ErrorType for Transmitter<D> {
    type Error = CdcAcmError;
}

impl<D: Driver<'static>> Write for Transmitter<D> {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, CdcAcmError> {
        self.0.write(bytes).await
    }

    async fn flush(&mut self) -> Result<(), CdcAcmError> {
        self.0.flush().await
    }
}
