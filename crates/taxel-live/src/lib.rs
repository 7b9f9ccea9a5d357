//! Input and output around `taxel-core`: sockets, files and threads.

pub mod address;
pub mod clock;
pub mod error;
mod host_clock;
mod kernel_drops;
mod latency;
pub mod line_place;
pub mod locked;
mod named_pipe;
pub mod ports;
pub mod read_at;
pub mod serial_line;

pub mod capture;
pub mod emulate;
pub mod pipeline;
pub mod recording;

pub use error::{Error, Result};
pub use kernel_drops::KernelDrops;
pub use latency::Quantiles;
