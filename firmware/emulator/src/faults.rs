//! Faults that make the unit start again, and what it must report then.

use std::sync::{Mutex, PoisonError};
use std::thread;

use bodyflight_core::link::HelloAcknowledge;
use bodyflight_firmware::fault::Kind;

use crate::Result;
use crate::chip::{Chip, Provoked};

/// How a fault is brought about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Harm {
    /// A program fault, at a random place or within a task or an interrupt.
    Program(&'static str, &'static str),
    /// A power failure or reset by the pin; whether memory is kept.
    Power(&'static str, bool),
}

/// A fault, with the cause of the reset and the kind of fault that the unit must report.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Fault {
    /// Its name.
    pub name: &'static str,
    /// How it is brought about.
    pub harm: Harm,
    /// Cause of the reset, as in `HELLO_ACK`.
    pub cause: u8,
    /// Kind of the fault, if there is one.
    pub kind: Option<Kind>,
}

/// Every kind of fault.
pub const FAULTS: [Fault; 13] = {
    const fn program(
        name: &'static str,
        [what, within]: [&'static str; 2],
        cause: u8,
        kind: Kind,
    ) -> Fault {
        Fault {
            name,
            harm: Harm::Program(what, within),
            cause,
            kind: Some(kind),
        }
    }
    const fn power(name: &'static str, what: &'static str, keep: bool, cause: u8) -> Fault {
        Fault {
            name,
            harm: Harm::Power(what, keep),
            cause,
            kind: None,
        }
    }
    use Kind::{Bus, DivisionByZero, Panic, StackOverflow, Unaligned, Undefined, Watchdog};
    [
        program("undefined instruction", ["undefined", ""], 1, Undefined),
        program("nothing at an address", ["bus", ""], 1, Bus),
        program("division by zero", ["division", ""], 1, DivisionByZero),
        program("unaligned pair of words", ["unaligned", ""], 1, Unaligned),
        program(
            "stack overflow in a task",
            ["stack", "task"],
            1,
            StackOverflow,
        ),
        program(
            "stack overflow in an interrupt",
            ["stack", "interrupt"],
            1,
            StackOverflow,
        ),
        program("panic", ["panic", ""], 1, Panic),
        program("hang in a task", ["hang", "task"], 2, Watchdog),
        program("hang in an interrupt", ["hang", "interrupt"], 2, Watchdog),
        power("brown-out, memory kept", "brown-out", true, 4),
        power("brown-out, memory lost", "brown-out", false, 4),
        power("power off and on", "power-on", false, 0),
        power("reset pin", "pin", true, 3),
    ]
};

impl Fault {
    /// Brings the fault about; program faults tell where.
    ///
    /// # Errors
    /// Returns an error if the emulator has ended.
    pub fn provoke(&self, chip: &mut Chip) -> Result<Option<Provoked>> {
        match self.harm {
            Harm::Program(what, within) => chip.provoke(what, within).map(Some),
            Harm::Power(what, keep) => chip.power(what, keep).map(|()| None),
        }
    }

    /// Whether a unit that started again reports this fault.
    pub fn is_reported(&self, greeting: &HelloAcknowledge) -> bool {
        let is_kind = |kind| greeting.fault_kind == kind as u8;
        greeting.reset_cause == self.cause && self.kind.is_none_or(is_kind)
    }
}

/// Runs `task` for each number below `count`, two at a time, and returns the results in order.
pub fn two_at_a_time<T: Send>(count: usize, task: impl Fn(usize) -> T + Sync) -> Vec<T> {
    let left = Mutex::new((0..count).collect::<Vec<_>>());
    let done = Mutex::new(Vec::new());
    let next = || left.lock().unwrap_or_else(PoisonError::into_inner).pop();
    let run = || {
        while let Some(number) = next() {
            let result = (number, task(number));
            let mut done = done.lock().unwrap_or_else(PoisonError::into_inner);
            done.push(result);
        }
    };
    thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(run);
        }
    });
    let mut done = done.into_inner().unwrap_or_else(PoisonError::into_inner);
    done.sort_by_key(|(number, _)| *number);
    done.into_iter().map(|(_, result)| result).collect()
}
