//! Bytes to events and back: the board's wire, version 1 (thesis, Appendix 1, sections 3 to 5) and version 2 (ours).
//!
//! Nothing here does I/O: callers push bytes as they arrive, in pieces of any size, and receive events. Socket, file
//! and emulated board are built around this module.

mod columns;
pub mod command;
mod cut;
pub mod decoder;
pub mod registers;
pub mod sender_decoder;
mod silence;
pub mod v1;
pub mod v2;

pub use columns::{Columns, Filled, Room};
pub use command::{Command, CommandReader};
pub use cut::{Cut, cut};
pub use decoder::{Counts, Decoder, Pairing, decode, most_rows};
pub use registers::{Refusal, Registers};
pub use sender_decoder::{Ahead, DatagramInfo, Order, SenderDecoder, StepBack};
pub use v1::{STAMP_US, WORD_BYTES, Word, encode};
