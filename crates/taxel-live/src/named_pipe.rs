//! Named pipes that lines are written to.

#[cfg(not(unix))]
mod portable;
#[cfg(unix)]
mod unix;

#[cfg(not(unix))]
pub(crate) use portable::open_to_write;
#[cfg(unix)]
pub(crate) use unix::open_to_write;
