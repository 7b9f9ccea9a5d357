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
mod status_line;
pub mod v1;
pub mod v2;

pub use columns::Columns;
pub use command::{Command, CommandReader};
pub use cut::{CutDatagrams, cut};
pub use decoder::{Counts, Decoder, decode, most_rows};
pub use registers::{Registers, WriteRefusal};
pub use sender_decoder::{DatagramInfo, SenderDecoder, SenderTotals, StepBack};
pub use status_line::{Greeting, StatusLine};
pub use v1::{STAMP_US, WORD_BYTES, Word, encode};

/// A year, us: bounds a silence, so that no arrival time can overflow a board's 64-bit clock.
const LONGEST: i64 = 365 * 86_400 * 1_000_000;

/// Time between two arrivals, us; 0 if the host's clock stepped back.
fn silence(before: i64, now: i64) -> i64 {
    now.saturating_sub(before).clamp(0, LONGEST)
}

/// The counts of `$now` less those of `$earlier`, both of this type: the fields named first are subtracted, the others have
/// the values after the semicolon.
#[macro_export]
macro_rules! counts_since {
    ($now:expr, $earlier:expr; $($field:ident),+; $($further:tt)*) => {
        Self { $($field: $now.$field - $earlier.$field,)+ $($further)* }
    };
}
