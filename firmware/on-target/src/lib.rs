//! The core on a board's processor: hashes of traces, to be compared with the host's bit for bit, and exact instruction
//! counts of the unit's work per sample.
//!
//! Images call `run`, which prints lines `name value` over semihosting; `cargo xtask on-target` runs them in QEMU,
//! whose virtual time is counted in instructions. Linking this crate provides the handlers of panics and hard faults.
#![cfg(target_os = "none")]
#![no_std]

mod handlers;

use core::hint::black_box;

use bodyflight_core::aerodynamics::load_model::LoadModel;
use bodyflight_core::body::anthropometry::{Person, Sex};
use bodyflight_core::body::pattern;
use bodyflight_core::dynamics::step::TIME_STEP;
use bodyflight_core::dynamics::{Dynamics, Inputs, Motion, PostureSample, State};
use bodyflight_core::estimator::full::Full;
use bodyflight_core::estimator::measurement::Measurement;
use bodyflight_core::estimator::motion::ReducedMotionFilter;
use bodyflight_core::estimator::motion::measurement::MotionMeasurement;
use bodyflight_core::estimator::motion::settings::{MOTION, MotionPreset, Slopes};
use bodyflight_core::estimator::preset::{Preset, TRACKING_ON_BACK};
use bodyflight_core::estimator::propagation::Propagation;
use bodyflight_core::estimator::reduced::Reduced;
use bodyflight_core::estimator::{Estimator, trace};
use bodyflight_core::frame::{Rotation, Vector};
use bodyflight_core::math::{Lanes, small_rotation};
use bodyflight_core::suit::mounting::Mounting;
use bodyflight_core::suit::placement::of_size;
use bodyflight_core::suit::set::{Fitted, Suit, pairs_of};
use bodyflight_core::suit::strapdown::Reading;
use bodyflight_core::suit::tray::Gyroscope;
use bodyflight_core::{Body, Posture, Segment};
use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;
use nalgebra::Vector3;
use semihosting::println;

/// Largest value of the SysTick counter.
const RELOAD: u32 = 0x00ff_ffff;

/// Ratio of SysTick ticks to instructions.
#[derive(Debug, Clone, Copy)]
pub struct Pace {
    /// Number of SysTick ticks…
    pub ticks: u32,
    /// …per this number of instructions.
    pub instructions: u32,
}

struct Counter {
    timer: SYST,
    pace: Pace,
    /// Overhead: ticks of an empty measurement.
    empty: u32,
}

impl Counter {
    fn new(mut timer: SYST, pace: Pace) -> Self {
        timer.set_clock_source(SystClkSource::Core);
        timer.set_reload(RELOAD);
        timer.clear_current();
        timer.enable_counter();
        let mut counter = Self {
            timer,
            pace,
            empty: 0,
        };
        counter.empty = counter.ticks(|| ());
        counter
    }

    fn ticks<R>(&mut self, work: impl FnOnce() -> R) -> u32 {
        self.timer.clear_current();
        let start = SYST::get_current();
        black_box(work());
        let end = SYST::get_current();
        start.wrapping_sub(end) & RELOAD
    }

    /// Counts the instructions of `work`, at most six million.
    fn instructions<R>(&mut self, work: impl FnOnce() -> R) -> u32 {
        let ticks = self.ticks(work).saturating_sub(self.empty);
        let Pace {
            ticks: whole,
            instructions,
        } = self.pace;
        ticks / whole * instructions + ticks % whole * instructions / whole
    }
}

/// Bytes of stack below its caller that are painted before a measurement; more than any update uses, and with an
/// estimator above it still within the board's memory.
const PAINTED: u32 = 12 * 1024;
const PAINT: u32 = 0xcccc_cccc;

/// Measures the stack that `work` uses (bytes).
#[allow(
    unsafe_code,
    reason = "reads and writes the unused stack below this frame"
)]
#[inline(never)]
fn stack_of(work: &mut dyn FnMut()) -> u32 {
    // Room for this function's own frame.
    let top = cortex_m::register::msp::read() - 256;
    let bottom = top - PAINTED;
    for word in (bottom..top).step_by(4) {
        // SAFETY: aligned RAM of this board below the stack pointer; the image's statics are far below.
        unsafe { core::ptr::write_volatile(word as *mut u32, PAINT) };
    }
    work();
    // SAFETY: as above.
    let touched = |word: &u32| unsafe { core::ptr::read_volatile(*word as *const u32) } != PAINT;
    (bottom..top)
        .step_by(4)
        .find(touched)
        .map_or(0, |word| top - word)
}

/// The person whose body both host and unit compute from measurements.
fn body() -> Option<Body<f32>> {
    Person::new(1.75, 75.0, Sex::Male).body().ok()
}

fn falling() -> Motion<f32> {
    let belly = small_rotation(&Vector3::new(0.52, 0.0, 0.0));
    let attitude = Rotation::from_quaternion(belly * belly * belly);
    Motion {
        inertial_from_body: attitude,
        position: Vector::zero(),
        velocity: attitude.inverse() * Vector::new(2.0, -3.0, -48.0),
        angular_velocity: Vector::new(0.1, -0.2, 0.05),
    }
}

/// Bits 24 and 25 of the FPSCR: flush subnormals to zero, and a single bit pattern for NaN.
const FLUSH_AND_DEFAULT: u32 = 3 << 24;

/// Runs `work` with subnormals flushed and a default NaN, as on other processors or with other settings.
///
/// The mode is changed in the same block of assembly that calls `work`: the compiler moves no arithmetic across an
/// opaque call, so none of it runs in an unexpected mode.
#[allow(
    unsafe_code,
    reason = "the floating-point mode can only be set in assembly"
)]
fn flushed<R, W: FnOnce() -> R>(work: W) -> Option<R> {
    let mut job = Job {
        work: Some(work),
        result: None,
    };
    // SAFETY: calls a C function with its only argument, which outlives the call. The registers that a C function may
    // change are declared as clobbered, and the mode is restored from a register that it must preserve.
    unsafe {
        core::arch::asm!(
            "vmrs r4, fpscr",
            "orr r5, r4, #{change}",
            "vmsr fpscr, r5",
            "blx {run}",
            "vmsr fpscr, r4",
            out("r4") _,
            out("r5") _,
            change = const FLUSH_AND_DEFAULT,
            run = in(reg) run_job::<R, W> as extern "C" fn(*mut Job<R, W>),
            inout("r0") &raw mut job => _,
            clobber_abi("C"),
        );
    }
    job.result
}

/// The work to be done in another mode, and its result.
struct Job<R, W> {
    work: Option<W>,
    result: Option<R>,
}

extern "C" fn run_job<R, W: FnOnce() -> R>(job: *mut Job<R, W>) {
    // SAFETY: `flushed` lends it for the duration of this call.
    #[allow(unsafe_code, reason = "called from assembly")]
    let job = unsafe { &mut *job };
    job.result = job.work.take().map(|work| work());
}

// Estimators live on the stack, one at a time, each in its own frame.

#[inline(never)]
fn reduced_trace(body: &Body<f32>) -> Option<u64> {
    trace::hash::<Reduced, 30>(body, 40).ok()
}

/// The paper's filter with a window of 12 samples, since one of 60 exceeds the memory of this board.
#[inline(never)]
fn paper_trace(body: &Body<f32>) -> Option<u64> {
    trace::hash::<Full, 12>(body, 8).ok()
}

/// Instructions of a push that only adds an interval and of one that triggers an update, and the stack use of the
/// latter.
#[inline(never)]
fn pushes<P: Propagation<f32>, const INTERVALS: usize>(
    counter: &mut Counter,
    dynamics: &Dynamics<f32>,
    posture: &Posture<f32>,
) -> Option<[u32; 3]> {
    let motion = falling();
    let preset = Preset {
        prediction_window: INTERVALS * P::STRIDE,
        ..TRACKING_ON_BACK
    };
    let mut made = Estimator::<f32, P, INTERVALS>::new(&preset, dynamics, &motion, posture);
    let estimator = made.as_mut().ok()?;
    let seen = Measurement::of(&motion);
    let (mut quiet, mut update) = (0, 0);
    // After the first update every fourth push updates; the largest count of each kind is kept.
    for _ in 0..estimator.prediction_window() + 24 {
        let mut estimated = false;
        let cost = counter.instructions(|| {
            estimated = estimator.push(posture, &seen).is_some();
        });
        let slot = if estimated { &mut update } else { &mut quiet };
        *slot = cost.max(*slot);
    }
    let mut stack = 0;
    for _ in 0..8 {
        let mut push = || {
            black_box(estimator.push(posture, &seen).is_some());
        };
        stack = stack.max(stack_of(&mut push));
    }
    Some([quiet, update, stack])
}

/// Instructions of the motion filter from one estimate to the next, postures included, and the largest stack use of a
/// push.
#[inline(never)]
fn motion_pushes(
    counter: &mut Counter,
    dynamics: &Dynamics<f32>,
    posture: &Posture<f32>,
    slopes: Slopes,
) -> Option<[u32; 2]> {
    let motion = falling();
    let preset = MotionPreset { slopes, ..MOTION };
    let mut filter = ReducedMotionFilter::new(&preset, dynamics, &motion, posture).ok()?;
    let seen = MotionMeasurement::of(&motion);
    let mut most = 0;
    for _ in 0..12 {
        let cost = counter.instructions(|| {
            for _ in 0..MOTION.solution_window {
                black_box(filter.push(posture, &seen).is_some());
            }
        });
        most = cost.max(most);
    }
    let mut stack = 0;
    for _ in 0..8 {
        let mut push = || {
            black_box(filter.push(posture, &seen).is_some());
        };
        stack = stack.max(stack_of(&mut push));
    }
    Some([most, stack])
}

/// Spread of the cost of an update: how much the most expensive exceeds the cheapest, in thousandths, over varying
/// postures, rates and innovations.
#[inline(never)]
fn spread(counter: &mut Counter, dynamics: &Dynamics<f32>) -> Option<u32> {
    let neutral = pattern::neutral::<f32>();
    let motion = falling();
    let mut estimator =
        Estimator::<f32, Reduced, 30>::new(&TRACKING_ON_BACK, dynamics, &motion, &neutral).ok()?;
    let (mut least, mut most) = (u32::MAX, 0);
    for k in 0..estimator.prediction_window() + 160 {
        // Numbers that sweep the range from -1 to 1.
        let swing = |period: usize| {
            let place = (k % period) as f32 / period as f32;
            (place * 4.0 - 2.0).abs() - 1.0
        };
        let posture = pattern::arched(&neutral, 0.2 * swing(37));
        let turn = small_rotation(&(Vector3::new(swing(23), swing(41), swing(59)) * 0.3));
        let attitude = Rotation::from_quaternion(motion.inertial_from_body.quaternion() * turn);
        let seen = Measurement::of(&Motion {
            inertial_from_body: attitude,
            angular_velocity: Vector::new(swing(29), swing(31), swing(43)),
            ..motion
        });
        let mut estimated = false;
        let cost = counter.instructions(|| {
            estimated = estimator.push(&posture, &seen).is_some();
        });
        if estimated {
            least = least.min(cost);
            most = most.max(cost);
        }
    }
    (most > 0).then(|| (most - least) * 1000 / most)
}

#[inline(never)]
fn paper_pushes<const INTERVALS: usize>(
    counter: &mut Counter,
    dynamics: &Dynamics<f32>,
    posture: &Posture<f32>,
) -> Option<[u32; 3]> {
    pushes::<Full, INTERVALS>(counter, dynamics, posture)
}

/// Instructions of one step of a simulation.
#[inline(never)]
fn steps(counter: &mut Counter, dynamics: &Dynamics<f32>, posture: &Posture<f32>) {
    let step = f32::of(TIME_STEP);
    let next = pattern::arched(posture, 0.01);
    let mut sample = PostureSample::blank();
    let cost = counter.instructions(|| {
        dynamics.between_into(black_box(posture), black_box(&next), step, &mut sample);
    });
    println!("posture_sample {cost}");
    let state = State::from_motion(&falling(), &sample);
    let mut inputs = Inputs::belly_turn();
    let fly = |inputs: &Inputs<f32>| dynamics.step(black_box(&state), &sample, inputs, step);
    println!("step {}", counter.instructions(|| fly(&inputs)));
    inputs.muscle.pitch = 0.5;
    inputs.muscle.yaw = 0.5;
    inputs.muscle.roll = 0.5;
    println!(
        "step_with_muscle_input {}",
        counter.instructions(|| fly(&inputs))
    );
}

/// Instructions for a model's loads on a body that lies flat on the stream, and on one aligned with it, in which every
/// segment but the first is in a wake.
#[inline(never)]
fn loads(counter: &mut Counter, dynamics: &Dynamics<f32>, model: LoadModel) -> [u32; 2] {
    let inputs = Inputs::belly_turn();
    let mut dynamics = *dynamics;
    dynamics.aerodynamics.model = model;
    let flat = (pattern::neutral(), falling().velocity);
    let along = (Posture::h_pose(), Vector::new(0.0, 0.5, 60.0));
    [flat, along].map(|(posture, velocity)| {
        let mut sample = PostureSample::blank();
        dynamics.between_into(&posture, &posture, f32::of(TIME_STEP), &mut sample);
        let (sample, velocity) = (black_box(&sample), black_box(&velocity));
        counter.instructions(|| dynamics.loads(sample, &inputs, velocity, &Vector::zero(), 1.0))
    })
}

/// Instructions of ten sensors on the limbs in a second at 100 Hz, posture and errors with each sample, and bytes of
/// their set.
#[inline(never)]
fn suit(counter: &mut Counter, body: &Body<f32>) -> Option<[u32; 2]> {
    let segments: &[Segment; 10] = of_size(10)?.first_chunk()?;
    let fitted = segments.map(|segment| Fitted {
        segment,
        place: body.segments[segment].cg,
        gyroscope: Gyroscope::default(),
        mounting: Mounting {
            segment_from_sensor: small_rotation(&Vector3::new(0.1, 0.2, 0.3)),
            tilt_deviation: 0.05,
            heading_deviation: 0.2,
        },
        range: None,
    });
    let mut suit =
        Suit::<f32, 10, { pairs_of(10) }>::new(&fitted, body, &Posture::h_pose()).ok()?;
    let mut instructions = 0;
    for k in 0..100_u8 {
        let swing = f32::from(k % 10) * 0.1;
        let readings = segments.map(|segment| {
            let own = f32::from(segment as u8) * 0.02;
            Some(Reading {
                angular_velocity: Vector3::new(swing, own, 0.3),
                specific_force: Vector3::new(own, swing, 9.5),
            })
        });
        instructions += counter.instructions(|| {
            suit.push(&readings, 0.01);
            suit.posture()
        });
    }
    Some([instructions, u32::try_from(size_of_val(&suit)).ok()?])
}

/// Prints all results; returns `None` if the core refuses the person or a preset.
pub fn run(timer: SYST, pace: Pace) -> Option<()> {
    let body = body()?;
    println!("trace_reduced {:#018x}", reduced_trace(&body)?);
    println!("trace_paper {:#018x}", paper_trace(&body)?);
    let flushed = flushed(|| reduced_trace(&body)).flatten();
    println!("trace_reduced_flushed {:#018x}", flushed?);

    let mut counter = Counter::new(timer, pace);
    let dynamics = Dynamics::paper(body, 1.0);
    let posture = pattern::neutral::<f32>();
    steps(&mut counter, &dynamics, &posture);
    let [flat, _] = loads(&mut counter, &dynamics, LoadModel::Paper);
    println!("loads {flat}");
    let [flat, along] = loads(&mut counter, &dynamics, LoadModel::FreeFly);
    println!("loads_free_fly {flat}");
    println!("loads_free_fly_in_wakes {along}");
    let [quiet, update, stack] = pushes::<Reduced, 30>(&mut counter, &dynamics, &posture)?;
    println!("reduced_push {quiet}");
    println!("reduced_update {update}");
    println!("stack_of_reduced_update {stack}");
    println!(
        "spread_of_reduced_update {}",
        spread(&mut counter, &dynamics)?
    );
    for (name, slopes) in [
        ("motion_estimate", Slopes::Differences),
        ("motion_estimate_by_sigma_points", Slopes::SigmaPoints),
    ] {
        let [estimate, stack] = motion_pushes(&mut counter, &dynamics, &posture, slopes)?;
        println!("{name} {estimate}");
        println!("stack_of_{name} {stack}");
    }
    let [instructions, bytes] = suit(&mut counter, &body)?;
    println!("suit_in_a_second {instructions}");
    println!("suit_bytes {bytes}");
    // The paper's window of 60 samples does not fit this board. Its cost is extrapolated from two shorter ones, since
    // every sample of the window costs the same.
    let [_, of_8, _] = paper_pushes::<8>(&mut counter, &dynamics, &posture)?;
    let [_, of_12, _] = paper_pushes::<12>(&mut counter, &dynamics, &posture)?;
    println!("paper_update {}", of_12 + (of_12 - of_8) * 12);
    Some(())
}
