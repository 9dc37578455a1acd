//! Loads of a small grammar that describe what no effect of the library explains.

pub(crate) mod fit;
pub(crate) mod grammar;
pub(crate) mod projection;
pub(crate) mod search;
pub(crate) mod term;
