//! Plain stretches of a stream, many words at a time, with what instructions the machine has.
//!
//! Words are plain when all their bytes are in place, they are changes and intensities on the array, and their stamps do
//! not fall. Anything else stops the loop, and the decoder takes the next word by itself: it alone says what damage,
//! markers and steps back mean, so every set of instructions gives the same events and counts.

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
mod carried;
mod scalar;

pub(super) use carried::Carried;

use super::filling::{Filling, STREAMED};
use crate::vectors::Instructions;
use crate::wire::v1::WORD_BYTES;

/// Of a cache line.
const LINE_BYTES: usize = 64;

/// Words of the longest block.
const BLOCK_WORDS: usize = 32;

/// Decodes plain words from the start of `bytes` into `filling`, up to the first that is not plain; gives how many
/// bytes they had.
pub(super) fn plain(
    set: Instructions,
    bytes: &[u8],
    columns: u16,
    rows: u16,
    state: &mut Carried,
    filling: &mut Filling<'_>,
) -> usize {
    let mut done = 0;
    if bytes.len() >= STREAMED {
        // Rows that go past the caches begin where a line does.
        let ahead = filling.room.x[filling.rows..].as_ptr().align_offset(LINE_BYTES);
        let words = scalar::words(bytes, columns, rows, state, filling, ahead);
        done = words * WORD_BYTES;
        if words < ahead {
            return done;
        }
    }
    loop {
        done += blocks(set, &bytes[done..], columns, rows, state, filling);
        // An odd number, so that pairs that lie across the edges of AVX2's blocks come to lie inside.
        let most = if set < Instructions::Avx2 { usize::MAX } else { BLOCK_WORDS - 1 };
        let words = scalar::words(&bytes[done..], columns, rows, state, filling, most);
        done += words * WORD_BYTES;
        if words < most {
            return done;
        }
    }
}

/// As [`plain`], whole blocks only.
#[cfg_attr(not(target_arch = "x86_64"), allow(unused_variables))]
fn blocks(
    set: Instructions,
    bytes: &[u8],
    columns: u16,
    rows: u16,
    state: &mut Carried,
    filling: &mut Filling<'_>,
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
        // SAFETY: `Decoder::instructions` and `best` let a set through only where the machine has it, and every column has
        // room for as many rows more as there are words in `bytes`, as just asserted.
        #[cfg(target_arch = "x86_64")]
        Instructions::Avx2 | Instructions::Avx512 => unsafe { avx2::blocks(bytes, columns, rows, state, filling) },
        // SAFETY: as above.
        #[cfg(target_arch = "x86_64")]
        Instructions::Avx512Bytes => unsafe { avx512::blocks(bytes, columns, rows, state, filling) },
        #[cfg(not(target_arch = "x86_64"))]
        _ => 0,
    }
}
