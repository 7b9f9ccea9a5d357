//! The emulated board as a process of its own.
