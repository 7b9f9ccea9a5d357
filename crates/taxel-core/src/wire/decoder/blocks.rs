//! Decodes plain stretches of a stream many words at a time, with the best vector instructions of the machine.
//!
//! Words are plain if all their bytes are in place, if they are changes and intensities on the array, and if their
//! stamps do not fall. Any other word ends the loop, and the decoder decodes it alone. Only the decoder defines the
//! meaning of damage, markers and steps back, so all instruction sets return the same events and counts.

#[cfg(target_arch = "x86_64")]
mod avx2;
mod carried;
mod scalar;

pub(super) use carried::Carried;

use super::filling::FilledColumns;
use crate::vectors::Instructions;
use crate::wire::v1::WORD_BYTES;

/// Number of words that are decoded one by one before blocks are tried again: an odd number, so that pairs split by the
/// edges of blocks are whole in the next block.
const STRETCH: usize = 31;

/// Decodes plain words from the start of `bytes` into `filling`, up to the first word that is not plain; returns the
/// number of their bytes.
pub(super) fn plain(
    set: Instructions,
    bytes: &[u8],
    columns: u16,
    rows: u16,
    state: &mut Carried,
    filling: &mut FilledColumns<'_>,
) -> usize {
    let mut done = 0;
    loop {
        done += blocks(set, &bytes[done..], columns, rows, state, filling);
        let most = if set < Instructions::Avx2 { usize::MAX } else { STRETCH };
        let words = scalar::words(&bytes[done..], columns, rows, state, filling, most);
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
    filling: &mut FilledColumns<'_>,
) -> usize {
    let room = &filling.room;
    let most = filling.rows + bytes.len() / WORD_BYTES;
    assert!(
        [room.x.len(), room.y.len(), room.ticks.len()].iter().all(|&n| n >= most)
            && [room.p.len(), room.present.len()].iter().all(|&n| n >= most)
            && room.t.len() >= most,
        "columns too short"
    );
    match set {
        Instructions::Plain => 0,
        // SAFETY: `Decoder::instructions` and `best` select a set only if the machine has it, and the assertion above
        // guarantees that each column has room for one row per word of `bytes`.
        #[cfg(target_arch = "x86_64")]
        Instructions::Avx2 | Instructions::Avx512 => unsafe { avx2::blocks(bytes, columns, rows, state, filling) },
        #[cfg(not(target_arch = "x86_64"))]
        _ => 0,
    }
}
