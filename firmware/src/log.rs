//! Logging through defmt if the board enables it, otherwise disabled.

#[cfg(feature = "defmt")]
macro_rules! info {
    ($($argument:tt)*) => { defmt::info!($($argument)*) };
}

#[cfg(not(feature = "defmt"))]
macro_rules! info {
    ($text:literal $(, $argument:expr)* $(,)?) => {{ $( let _ = &$argument; )* }};
}

pub(crate) use info;
