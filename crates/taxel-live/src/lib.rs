//! Input and output around `taxel-core`: sockets, files and threads.

pub mod address;
pub mod board_line;
pub mod bridged;
pub mod clock;
pub mod error;
pub mod frame_lines;
pub mod host_clock;
mod kernel_drops;
mod latency;
pub mod line_input;
pub mod line_place;
pub mod locked;
pub mod ports;
mod regular_file;
pub mod serial_line;
pub mod text_lines;

pub mod capture;
pub mod emulate;
pub mod pipeline;
pub mod recording;

pub use error::{Error, Result};
pub use kernel_drops::KernelDrops;
pub use latency::Quantiles;
pub use regular_file::open_regular;
