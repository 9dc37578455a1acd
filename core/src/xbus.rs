//! Xbus.
