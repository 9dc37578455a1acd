//! The tasks: receiving, estimating, transmitting and reporting, in one executor.
//!
//! Tasks waiting for I/O yield to the others, but nothing else runs during an update. A board's receiver must buffer
//! the bytes that arrive meanwhile: 240 in 5 ms at 460800 baud, for which [`RECEIVER_BYTES`](crate::RECEIVER_BYTES) is
//! ample.

use core::cell::RefCell;

use bodyflight_core::link::{MAX_FRAME_LENGTH, Status};
use embassy_futures::join::{join3, join5};
use embassy_futures::yield_now;
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::signal::Signal;
use embassy_time::{Duration, Ticker, Timer, with_timeout};
use embedded_io_async::{Read, Write};

use crate::board::Board;
use crate::display::Glance;
use crate::light::STEP_MS;
use crate::log::info;
use crate::recorder::storage::{Answer, Log};
use crate::unit::Unit;

/// Transmission timeout of a frame, after which it counts as dropped.
const LINE_TIMEOUT: Duration = Duration::from_millis(250);

/// Interval of heartbeats, which feed the watchdog.
const HEARTBEAT: Duration = Duration::from_millis(250);

/// Number of heartbeats between reports.
const HEARTBEATS_A_REPORT: u32 = 4;

/// Number of consecutive errors after which a failed receiver yields to the other tasks. Until then it is read again at
/// once, because it is off until the next read and every byte that arrives meanwhile is another error.
const ERRORS_AT_ONCE: u32 = 4;

/// Pause after a port was closed or a transmitter failed.
const RECEIVER_PAUSE: Duration = Duration::from_millis(5);

/// State shared by the tasks.
struct Shared<'a, B: Board> {
    unit: &'a RefCell<Unit<B>>,
    /// Set after bytes were received: there may be samples.
    arrived: Signal<NoopRawMutex, ()>,
    /// Set when there may be frames to send.
    outgoing: Signal<NoopRawMutex, ()>,
}

/// Starts with the configuration that is stored in the log's memory, if there is one, and [runs](run).
pub async fn start<B: Board>(
    unit: &RefCell<Unit<B>>,
    receiver: impl Read,
    transmitter: impl Write,
    sensor: impl Read,
    mut log: impl Log,
) {
    if let Some(setup) = log.stored().await {
        unit.borrow_mut().resume(&setup);
    }
    run(unit, receiver, transmitter, sensor, log).await;
}

/// Runs the unit on its ports forever. `sensor` is the port of the inertial sensor, or [`NoPort`] without one; `log`
/// keeps the on-board log, or is [`NoLog`](crate::recorder::storage::NoLog) without storage.
pub async fn run<B: Board>(
    unit: &RefCell<Unit<B>>,
    receiver: impl Read,
    transmitter: impl Write,
    sensor: impl Read,
    mut log: impl Log,
) {
    let shared = Shared {
        unit,
        arrived: Signal::new(),
        outgoing: Signal::new(),
    };
    info!("unit started");
    unit.borrow_mut().introduce();
    let answer = |answer: Answer<'_>| {
        match answer {
            Answer::Block(block, bytes) => unit.borrow_mut().answer_log(block, bytes),
            Answer::Setup(state, setup) => unit.borrow_mut().answer_setup(state, setup),
        }
        shared.outgoing.signal(());
    };
    join3(
        log.run(answer),
        shared.shine(),
        join5(
            shared.receive(receiver),
            shared.receive_sensor(sensor),
            shared.estimate(),
            shared.transmit(transmitter),
            shared.report(),
        ),
    )
    .await;
}

impl<B: Board> Shared<'_, B> {
    async fn receive(&self, mut receiver: impl Read) {
        let mut bytes = [0; 128];
        let mut errors = 0;
        loop {
            match receiver.read(&mut bytes).await {
                Ok(count) if count > 0 => {
                    errors = 0;
                    let received = bytes.get(..count).unwrap_or_default();
                    self.unit.borrow_mut().receive(received);
                }
                Ok(_) => Timer::after(RECEIVER_PAUSE).await,
                Err(_) => {
                    self.unit.borrow_mut().line_error();
                    after_error(&mut errors).await;
                }
            }
            self.arrived.signal(());
            self.outgoing.signal(());
        }
    }

    async fn receive_sensor(&self, mut sensor: impl Read) {
        let mut bytes = [0; 128];
        let mut errors = 0;
        loop {
            match sensor.read(&mut bytes).await {
                Ok(count) if count > 0 => {
                    errors = 0;
                    let received = bytes.get(..count).unwrap_or_default();
                    self.unit.borrow_mut().receive_sensor(received);
                    self.arrived.signal(());
                }
                Ok(_) => Timer::after(RECEIVER_PAUSE).await,
                Err(_) => after_error(&mut errors).await,
            }
        }
    }

    async fn estimate(&self) {
        loop {
            let worked = self.unit.borrow_mut().work();
            if worked {
                self.outgoing.signal(());
                yield_now().await;
            } else {
                self.arrived.wait().await;
            }
        }
    }

    async fn transmit(&self, mut transmitter: impl Write) {
        let mut frame = [0; MAX_FRAME_LENGTH];
        loop {
            let length = self.unit.borrow_mut().transmit(&mut frame);
            let Some(bytes) = length.and_then(|length| frame.get(..length)) else {
                self.outgoing.wait().await;
                continue;
            };
            let sent = with_timeout(LINE_TIMEOUT, transmitter.write_all(bytes)).await;
            if !matches!(sent, Ok(Ok(()))) {
                self.unit.borrow_mut().transmit_failed();
                Timer::after(RECEIVER_PAUSE).await;
            }
        }
    }

    async fn report(&self) {
        let mut heartbeat = Ticker::every(HEARTBEAT);
        let mut beats = 0u32;
        loop {
            heartbeat.next().await;
            self.unit.borrow_mut().feed_watchdog();
            beats = beats.wrapping_add(1);
            if beats.is_multiple_of(HEARTBEATS_A_REPORT) {
                let status = self.unit.borrow_mut().report();
                self.outgoing.signal(());
                self.log(&status);
            }
        }
    }

    async fn shine(&self) {
        let mut step = Ticker::every(Duration::from_millis(STEP_MS));
        loop {
            self.unit.borrow_mut().shine();
            step.next().await;
        }
    }

    fn log(&self, status: &Status) {
        let unit = self.unit.borrow();
        if let Some(sample) = unit.last_sample() {
            let Glance {
                heading,
                pitch,
                roll,
                turn,
            } = Glance::of(sample);
            info!(
                "heading {} pitch {} roll {} deg, turn {} deg/s",
                heading, pitch, roll, turn
            );
        }
        info!(
            "used {} rejected {} missing {} dropped {} damaged {} misses {} longest update {} cycles",
            status.used,
            status.rejected,
            status.missing,
            status.dropped_oldest,
            status.crc_bad.wrapping_add(status.cobs_bad),
            status.deadline_missed,
            status.cycles_max
        );
    }
}

/// Counts an error of a receiver, and yields to the other tasks after several in a row.
async fn after_error(errors: &mut u32) {
    *errors += 1;
    if errors.is_multiple_of(ERRORS_AT_ONCE) {
        yield_now().await;
    }
}

/// Placeholder for the port of a sensor that is not connected.
#[derive(Debug, Clone, Copy, Default)]
pub struct NoPort;

impl embedded_io_async::ErrorType for NoPort {
    type Error = core::convert::Infallible;
}

impl Read for NoPort {
    async fn read(&mut self, _: &mut [u8]) -> Result<usize, Self::Error> {
        core::future::pending().await
    }
}
