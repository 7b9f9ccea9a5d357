//! Decodes plain stretches of a stream many words at a time, with the best vector instructions of the machine.
//!
//! Words are plain if all their bytes are in place, if they are changes and intensities on the array, and if their
//! stamps do not fall. Any other word ends the loop, and the decoder decodes it alone. Only the decoder defines the
//! meaning of damage, markers and steps back, so all instruction sets return the same events and counts.

#[cfg(target_arch = "x86_64")]
mod avx2;
mod scalar;

pub(super) use scalar::Carried;

use crate::vectors::Instructions;
use crate::wire::columns::Columns;
use crate::wire::v1::WORD_BYTES;

/// Number of words that are decoded one by one before blocks are tried again: an odd number, so that pairs split by the
/// edges of blocks are whole in the next block.
const STRETCH: usize = 31;

/// Decodes plain words from the start of `bytes` into `out`, which has room for a row each, up to the first word that is
/// not plain; returns the number of their bytes.
pub(super) fn plain(
    set: Instructions,
    bytes: &[u8],
    columns: u16,
    rows: u16,
    state: &mut Carried,
    out: &mut Columns<'_>,
) -> usize {
    let mut done = 0;
    loop {
        done += blocks(set, &bytes[done..], columns, rows, state, out);
        let most = if set < Instructions::Avx2 { usize::MAX } else { STRETCH };
        let words = scalar::words(&bytes[done..], columns, rows, state, out, most);
        done += words * WORD_BYTES;
        if words < most {
            return done;
        }
    }
}

/// As [`plain`], but decodes whole blocks only.
#[cfg_attr(not(target_arch = "x86_64"), allow(unused_variables))]
fn blocks(
    set: Instructions,
    bytes: &[u8],
    columns: u16,
    rows: u16,
    state: &mut Carried,
    out: &mut Columns<'_>,
) -> usize {
    assert!(out.left() >= bytes.len() / WORD_BYTES, "columns too short");
    match set {
        Instructions::Plain => 0,
        // SAFETY: `Decoder::instructions` and `best` select a set only if the machine has it, and the assertion above
        // guarantees that there is room for one row per word of `bytes`.
        #[cfg(target_arch = "x86_64")]
        Instructions::Avx2 | Instructions::Avx512 => unsafe { avx2::blocks(bytes, columns, rows, state, out) },
        #[cfg(not(target_arch = "x86_64"))]
        _ => 0,
    }
}
